use super::progress::Progress;
use crate::error::{Error, Result};
use crate::files::{write_exr, write_png16};
use crate::source::synthetic::{Script, Synthetic};
use lightcast_core::camera::LOOKING_UP;
use lightcast_core::image::{Frame, Pixels};
use std::path::{Path, PathBuf};

/// Compute a sequence of frames from a script.
///
/// A script (TOML) names a scene (sky with sun and clouds, room with lamps, or an HDR panorama), what moves
/// in it, and the camera: a lat-long picture, or a fisheye lens with a response. Frames of radiance become
/// OpenEXR files, raw sensor codes 16-bit PNG files. Fisheye frames are accompanied by calibration.json with
/// lens and response. The same script gives the same bytes. replay/*.toml are scripts that explain their
/// keys.
///
/// Panoramas that a script names as data:PATH are looked for in the folder that LIGHTCAST_DATA names.
///
/// Example: lightcast synthesize replay/day.toml --output /tmp/day
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Script file (TOML).
    #[arg(value_name = "SCRIPT")]
    script: PathBuf,

    /// Folder for the frames; made if it is not there. Files of the same name are replaced.
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,

    /// Make the first N frames, or go on past the script's end; the script's own number by default.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
}

pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let data = std::env::var_os("LIGHTCAST_DATA").map(PathBuf::from);
    let script = Script::load(&arguments.script, data.as_deref())?;
    let folder = &arguments.output;
    std::fs::create_dir_all(folder)
        .map_err(|error| Error::failed("cannot be made").because(error).at(folder))?;
    let frames = arguments.frames.map_or(script.frames, |frames| frames as usize);

    let progress = Progress::of(Some(frames as u64), "frames");
    let mut source = Synthetic::new(script);
    let mut frame = Frame::default();
    let mut bytes = 0;
    for index in 0..frames {
        source.render(index, &mut frame);
        bytes += write(folder, source.script(), index, &frame)?;
        progress.inc(1);
    }
    progress.finish();

    let script = source.script();
    tracing::info!(
        "{}: {frames} frames of {} x {} at {} Hz, {}, {:.1} MB",
        folder.join(script.name.pattern()).display(),
        frame.width,
        frame.height,
        script.frame_rate_hz,
        match (&frame.pixels, script.half) {
            (Pixels::Codes(_), _) => "raw codes",
            (_, true) => "radiance in half floats",
            (_, false) => "radiance",
        },
        bytes as f64 / 1e6,
    );
    if let Some(calibration) = script.calibration() {
        let path = folder.join("calibration.json");
        std::fs::write(&path, calibration.to_json())
            .map_err(|error| Error::failed("cannot be written").because(error).at(&path))?;
        tracing::info!("{}: lens and response", path.display());
        if script.world_from_camera() != LOOKING_UP {
            let rows = script.world_from_camera().transpose().to_cols_array_2d();
            tracing::info!("the camera does not look up: world_from_camera = {rows:?}");
        }
    }
    Ok(())
}

/// Writes one frame; returns the size of its file.
fn write(folder: &Path, script: &Script, index: usize, frame: &Frame) -> Result<u64> {
    let path = folder.join(script.name.file(index));
    match frame.pixels {
        Pixels::Codes(_) => write_png16(&path, frame)?,
        Pixels::Radiance(_) => write_exr(&path, frame, Some(script.frame_rate_hz), script.half)?,
    }
    Ok(std::fs::metadata(&path).map_or(0, |metadata| metadata.len()))
}
