use super::input::{Input, display_name, is_standard_input};
use super::messages::PROGRESS;
use super::panorama::{PanoramaArguments, map_shape, read_panorama};
use super::progress::Progress;
use super::render::load_scene;
use super::resolution::Resolution;
use super::standard_output::print;
use crate::error::{Error, Result};
use crate::gpu::{Backend, Gpu};
use crate::report::frame_time::heading;
use crate::report::pictures::{COUNTS, Measured, Pictures, lines, means, options, plot};
use crate::scene::Scene;
use std::path::{Path, PathBuf};

/// Print error of pictures against the number of lights, as tables and a plot.
///
/// Every scene is drawn under every MAP, a lat-long panorama whose upper half is used, with 4, 8, ... 512
/// lights of equal power and refined ones, and once with every pixel of the map as a light: the reference.
/// Tables say how far each picture is from it (RMS of linear radiance relative to the mean, and mean FLIP,
/// both over the pixels that show a surface) and the median time of a frame; the last one holds the geometric
/// means.
///
/// Pictures are small by default, as there may be no GPU: the whole takes minutes in software.
///
/// Example: lightcast report-pictures studio.hdr noon.hdr --scene bunny.glb --plot error.svg
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Panoramas: OpenEXR or Radiance HDR; `-` for one on standard input.
    #[arg(required = true)]
    maps: Vec<PathBuf>,

    #[command(flatten)]
    panorama: PanoramaArguments,

    /// Scenes beside the built-in one: glTF, OBJ or PLY; each is put on a ground. May be given several times.
    #[arg(long, value_name = "FILE")]
    scene: Vec<PathBuf>,

    /// Size of the pictures.
    #[arg(long, value_name = "COLUMNSxROWS", default_value = "160x120")]
    size: Resolution,

    /// Size of the polar map that a panorama is averaged to; the reference has a light for each of its
    /// pixels.
    #[arg(long, value_name = "COLUMNSxROWS", default_value = "120x30")]
    resolution: Resolution,

    /// Shadow maps, for the lights of most power; the others borrow the nearest. By default every light has
    /// its own.
    #[arg(long, value_name = "N", default_value_t = COUNTS[COUNTS.len() - 1])]
    shadow_maps: usize,

    /// File for the plot of the means (its folder is made if it does not exist).
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
}

/// Prints as it measures, so that what is done is not lost when the rest is interrupted.
pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let Arguments { maps, panorama: how, scene: scenes, size, resolution, shadow_maps, plot: plot_file } =
        arguments;
    if let Some(folder) = plot_file.as_deref().and_then(Path::parent) {
        std::fs::create_dir_all(folder).map_err(|error| {
            Error::failed("the folder for the plot cannot be made").because(error).at(folder)
        })?;
    }
    let side = |side: usize| u32::try_from(side).unwrap_or(u32::MAX);
    let options = options([side(size.columns), side(size.rows)], *shadow_maps);
    let shape = map_shape(Some(*resolution), true)?;
    let map = |path: &PathBuf| {
        let panorama = Input::panorama(path, "report-pictures")?;
        Ok((name(path), read_panorama(&panorama, *how, shape)?))
    };
    let maps = maps.iter().map(map).collect::<Result<Vec<_>>>()?;
    let mut models = vec![("built-in scene".to_owned(), Scene::built_in())];
    for path in scenes {
        models.push((name(path), load_scene(path, true)?));
    }

    let progress = Progress::in_percent(100 * (models.len() * maps.len()) as u64);
    let mut measured = Vec::new();
    let (mut adapter, mut adapter_name) = (String::new(), String::new());
    for (scene_name, scene) in models {
        let gpu = Gpu::open(&Gpu::instance(Backend::Vulkan), None)?;
        if measured.is_empty() {
            let mut heading = heading(&gpu);
            adapter.clone_from(&heading[0]);
            heading.push(format!(
                "Pictures of {} x {} pixels, one sample each; references of {} x {} lights over the upper hemisphere; at \
                 most {shadow_maps} shadow maps; no list for glossy surfaces. Times are medians of frames.",
                size.columns, size.rows, resolution.columns, resolution.rows
            ));
            adapter_name.clone_from(&gpu.info.name);
            if !PROGRESS.suspend(|| print(&heading))? {
                return Ok(());
            }
        }
        let mut pictures = Pictures::new(gpu, scene, &options)?;
        for (map_name, map) in &maps {
            progress.set_message(format!("{scene_name}, {map_name}"));
            let start = 100 * measured.len() as u64;
            let rows = pictures.measure(map, |share| progress.set_position(start + (90.0 * share) as u64))?;
            if !PROGRESS.suspend(|| print(&lines(&adapter, &format!("{scene_name}, {map_name}"), &rows)))? {
                return Ok(());
            }
            measured.push(Measured { scene: scene_name.clone(), map: map_name.clone(), rows });
        }
    }
    progress.finish();
    let title = format!("geometric means over {}", measured.len());
    print(&lines(&adapter, &title, &means(measured.iter())))?;
    if let Some(path) = plot_file {
        let title =
            format!("Error of pictures ({} x {}, {adapter_name}): geometric means", size.columns, size.rows);
        std::fs::write(path, plot(&title, &measured).to_svg())
            .map_err(|error| Error::failed("the plot cannot be written").because(error).at(path))?;
    }
    Ok(())
}

/// The name of a file in tables.
pub(super) fn name(path: &Path) -> String {
    if is_standard_input(path) {
        return display_name(path);
    }
    path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}
