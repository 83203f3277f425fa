use super::input::Input;
use super::messages::PROGRESS;
use super::panorama::{PanoramaArguments, read_panorama};
use super::progress::Progress;
use super::report_pictures::name;
use super::standard_output::print;
use crate::error::Result;
use crate::gpu::{Backend, Gpu};
use crate::report::frame_time::heading;
use crate::report::speed::{Row, clustering_rows, culling_rows, lines};
use crate::report::speed_cases::{self as cases, Case};
use std::path::PathBuf;

/// Print the speed of the renderer, as tables.
///
/// Tables say what angular regions and clusters of lights gain, what triangles, lights and pixels cost, and
/// how fast the paper's settings and 1920 x 1080 pixels are: median time of a frame until the device is done,
/// and GPU time of every pass where the adapter measures it, all in ms.
///
/// The lights are those of the upper halves of MAPS, lat-long panoramas: the gain of clusters is measured
/// with each, the rest with the first. Without a MAP a made-up one is used.
///
/// Example: lightcast report-speed studio.hdr noon.hdr
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct Arguments {
    /// Panoramas: OpenEXR or Radiance HDR; `-` for one on standard input.
    maps: Vec<PathBuf>,

    #[command(flatten)]
    panorama: PanoramaArguments,
}

/// Prints as it measures, so that what is done is not lost when the rest is interrupted.
pub(super) fn run(arguments: &Arguments) -> Result<()> {
    let mut maps = Vec::new();
    for path in &arguments.maps {
        let panorama = Input::panorama(path, "report-speed")?;
        maps.push((name(path), read_panorama(&panorama, arguments.panorama, cases::SHAPE)?));
    }
    if maps.is_empty() {
        maps.push(("a made-up map".to_owned(), cases::made_up_map()));
    }
    let (first_name, first) = &maps[0];
    let tables = [
        ("cost", cases::growth(first)?),
        ("the paper's settings", cases::paper(first)?),
        ("full size", cases::full_size(first)?),
    ];
    let row_count = 2 + 3 * maps.len() + tables.iter().map(|(_, cases)| cases.len()).sum::<usize>();
    let progress = Progress::in_percent(row_count as u64);
    let show = |lines: Vec<String>| PROGRESS.suspend(|| print(&lines));

    let mut head = heading(&gpu()?);
    let adapter = head[0].clone();
    head.push(format!(
        "Lights of {first_name} unless a table says otherwise. Error: of the irradiance of the lights that light \
         everything (RMS / mean); of culling and clusters that of the picture against the first row (-). Times are \
         medians of so many frames, in ms; a pixel: lights that it looks at."
    ));
    let mut goes_on = show(head)?;
    if goes_on {
        progress.set_message("culling");
        goes_on = show(lines(&adapter, "culling", &culling_rows(gpu)?))?;
        progress.inc(2);
    }
    for (name, map) in &maps {
        if goes_on {
            progress.set_message(format!("clusters, {name}"));
            goes_on = show(lines(&adapter, &format!("clusters, {name}"), &clustering_rows(gpu, map)?))?;
            progress.inc(3);
        }
    }
    for (title, cases) in tables {
        if goes_on {
            progress.set_message(title);
            goes_on = show(lines(&adapter, title, &rows(cases, &progress)?))?;
        }
    }
    progress.finish();
    Ok(())
}

fn gpu() -> Result<Gpu> {
    Gpu::open(&Gpu::instance(Backend::Vulkan), None)
}

fn rows(cases: Vec<Case>, progress: &Progress) -> Result<Vec<Row>> {
    let measure = |case| {
        let row = Row::measure(gpu()?, case)?;
        progress.inc(1);
        Ok(row)
    };
    cases.into_iter().map(measure).collect()
}
