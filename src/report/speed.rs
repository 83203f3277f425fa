//! Speed of the renderer: the gain of culling and clustering, the cost of triangles, lights and pixels.

use super::frame_time::{FrameTime, PASSES, Timed};
use super::picture_error::relative_rms;
use super::speed_cases::{Case, clustering, culling};
use crate::error::Result;
use crate::gpu::Gpu;
use crate::render::{DirectionalOptions, Options};
use lightcast_core::image::PolarMap;
use lightcast_core::light::{self, Light};
use std::time::Duration;

/// Time for the frames of one row.
const BUDGET: Duration = Duration::from_secs(3);

/// A row of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Its name, which says what is special about it.
    pub name: String,
    /// Columns and rows of the picture.
    pub size: [u32; 2],
    /// Triangles of the scene.
    pub triangles: usize,
    /// Lights that shine on everything.
    pub lights: usize,
    /// Lights that a pixel considers, on average, where that was counted.
    pub seen: Option<f64>,
    /// Error of the lights or of the picture; the table's title says which.
    pub error: Option<f64>,
    /// Median times.
    pub time: FrameTime,
    /// The gain, or the published figure.
    pub note: String,
}

impl Row {
    /// Measures a case; its error is that of its list.
    ///
    /// # Errors
    /// Those of the device.
    pub fn measure(gpu: Gpu, case: Case) -> Result<Self> {
        Ok(Drawn::new(gpu, &case)?.row)
    }
}

/// A row and the picture that it stands for.
struct Drawn {
    row: Row,
    picture: Vec<[f32; 4]>,
}

impl Drawn {
    fn new(gpu: Gpu, case: &Case) -> Result<Self> {
        let Case { name, model, options, lights, note } = case;
        let scene = model.scene();
        let meshes = scene.instances.iter().map(|instance| &scene.meshes[instance.mesh]);
        let triangles = meshes.map(|mesh| mesh.indices.len() / 3).sum();
        let mut timed = Timed::new(gpu, scene, options)?;
        let time = timed.measure(&lights.lights, BUDGET)?;
        let mut picture = Vec::new();
        timed.renderer.read_radiance(&mut picture)?;
        let row = Row {
            name: name.clone(),
            size: [options.width_px, options.height_px],
            triangles,
            lights: lights_of(&lights.lights, &options.directional),
            seen: None,
            error: lights.error,
            time,
            note: note.clone(),
        };
        Ok(Self { row, picture })
    }
}

/// Lights in set H.
fn lights_of(lights: &[Light], options: &DirectionalOptions) -> usize {
    let (mut high, mut clusters, mut places) = (Vec::new(), Vec::new(), Vec::new());
    light::prefix(lights, options.lights, &mut high);
    if let Some(most) = options.clusters {
        light::cluster(&high, most, &mut clusters, &mut places);
        return clusters.len();
    }
    high.len()
}

/// The gain of regions: in lights that a pixel considers and in time, and the difference of the pictures.
/// `gpu` opens a device.
///
/// # Errors
/// Those of the device.
pub fn culling_rows(gpu: impl Fn() -> Result<Gpu>) -> Result<Vec<Row>> {
    let [all, region] = culling();
    let lights_a_pixel = |case: &Case| -> Result<f64> {
        let options = Options {
            directional: DirectionalOptions { count_lights: true, ..case.options.directional },
            ..case.options
        };
        let Timed { mut renderer, camera, .. } = Timed::new(gpu()?, case.model.scene(), &options)?;
        renderer.draw(&case.lights.lights, &camera, 1)?;
        let counts = renderer.read_counts()?;
        Ok(f64::from(counts.looked_at) / f64::from(counts.pixels.max(1)))
    };
    let seen = [lights_a_pixel(&all)?, lights_a_pixel(&region)?];
    let [mut all, mut region] = [Drawn::new(gpu()?, &all)?, Drawn::new(gpu()?, &region)?];
    (all.row.seen, region.row.seen) = (Some(seen[0]), Some(seen[1]));
    region.row.error = Some(relative_rms(&all.picture, &region.picture));
    let fewer = seen[0] / seen[1].max(1e-9);
    region.row.note =
        format!("{fewer:.3} times fewer (expected 1.6 to 1.8); time {}", gain(&all.row, &region.row));
    Ok(vec![all.row, region.row])
}

/// The gain of clusters of the lights of a map, and the difference of the pictures.
///
/// # Errors
/// Those of the device, and of [`light::Extractor::new`].
pub fn clustering_rows(gpu: impl Fn() -> Result<Gpu>, map: &PolarMap) -> Result<Vec<Row>> {
    let [all, clusters @ ..] = clustering(map)?;
    let mut all = Drawn::new(gpu()?, &all)?;
    all.row.error = None;
    let mut rows = vec![all.row];
    for case in clusters {
        let mut drawn = Drawn::new(gpu()?, &case)?;
        drawn.row.error = Some(relative_rms(&all.picture, &drawn.picture));
        drawn.row.note = format!("time {}", gain(&rows[0], &drawn.row));
        rows.push(drawn.row);
    }
    Ok(rows)
}

/// How much quicker one row is than another, for the frame and for the shading pass; where that is not
/// measured, for the rest of the frame without shadow maps and surfaces.
fn gain(slow: &Row, quick: &Row) -> String {
    let ratio = |slow: Duration, quick: Duration| slow.as_secs_f64() / quick.as_secs_f64().max(1e-9);
    let frame = format!("{:.2} times less", ratio(slow.time.frame, quick.time.frame));
    let [_, _, _, shade_slow, _] = slow.time.passes;
    let [_, _, _, shade_quick, _] = quick.time.passes;
    let rest = |row: &Row| {
        let [_, shadow_maps, surfaces, _, _] = row.time.passes;
        Some(row.time.frame.saturating_sub(shadow_maps? + surfaces?))
    };
    if let (Some(slow), Some(quick)) = (shade_slow, shade_quick) {
        format!("{frame}, of shading {:.2}", ratio(slow, quick))
    } else if let (Some(slow), Some(quick)) = (rest(slow), rest(quick)) {
        format!("{frame}, without shadow maps and surfaces {:.2}", ratio(slow, quick))
    } else {
        frame
    }
}

/// Lines for rows under a title, header first, times in ms; above it the adapter, as
/// [`heading`](super::frame_time::heading) has it.
pub fn lines(adapter: &str, title: &str, rows: &[Row]) -> Vec<String> {
    let passes: String = PASSES.map(|(name, _)| format!(" {name:>11}")).concat();
    let header = format!(
        "{title:<28} {:>9} {:>9} {:>6} {:>7} {:>8} {:>9} {:>8} {:>6}{passes}",
        "size", "triangles", "lights", "a pixel", "error", "frame", "Hz", "frames"
    );
    let mut lines = vec![adapter.to_owned(), header];
    let cell =
        |value: Option<f64>, digits: usize| value.map_or("-".to_owned(), |value| format!("{value:.digits$}"));
    let ms = |time: Duration| time.as_secs_f64() * 1e3;
    lines.extend(rows.iter().map(|row| {
        let Row { name, size: [width, height], triangles, lights, time, note, .. } = row;
        let (seen, error) = (cell(row.seen, 1), cell(row.error, 5));
        let (frame, frames) = (ms(time.frame), time.frames);
        let hz = 1e3 / frame.max(1e-6);
        let passes = time.passes.map(|pass| format!(" {:>11}", cell(pass.map(ms), 3))).concat();
        let size = format!("{width}x{height}");
        format!(
            "  {name:<26} {size:>9} {triangles:>9} {lights:>6} {seen:>7} {error:>8} {frame:>9.2} {hz:>8.2} \
             {frames:>6}{passes}  {note}"
        )
        .trim_end()
        .to_owned()
    }));
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::Backend;
    use crate::report::speed_cases::{Lights, made_up_map};

    fn row(frame_ms: u64, shade_ms: Option<u64>) -> Row {
        let shade = shade_ms.map(Duration::from_millis);
        let time = FrameTime {
            frame: Duration::from_millis(frame_ms),
            passes: [None, Some(Duration::from_micros(1500)), Some(Duration::ZERO), shade, None],
            frames: 3,
        };
        let (name, note) = ("a row".to_owned(), "7 Hz".to_owned());
        let (triangles, error) = (16_130, Some(0.0123));
        Row { name, size: [320, 240], triangles, lights: 72, seen: None, error, time, note }
    }

    #[test]
    fn tables_say_what_was_measured_and_what_was_not() {
        let lines = lines("an adapter", "title", &[row(20, None)]);
        assert_eq!((lines.len(), lines[0].as_str()), (3, "an adapter"));
        let cells: Vec<&str> = lines[2].split_whitespace().collect();
        let expected = [
            "a", "row", "320x240", "16130", "72", "-", "0.01230", "20.00", "50.00", "3", "-", "1.500",
            "0.000", "-", "-", "7", "Hz",
        ];
        assert_eq!(cells, expected);
    }

    #[test]
    fn gains_are_ratios_of_times() {
        // 28.5 ms and 18.5 ms are left.
        let mixed = gain(&row(30, None), &row(20, Some(5)));
        assert_eq!(mixed, "1.50 times less, without shadow maps and surfaces 1.54");
        let mut unmeasured = row(30, None);
        unmeasured.time.passes = [None; PASSES.len()];
        assert_eq!(gain(&unmeasured, &row(20, None)), "1.50 times less");
        assert_eq!(gain(&row(30, Some(15)), &row(20, Some(5))), "1.50 times less, of shading 3.00");
    }

    #[test]
    fn lights_that_shine_on_everything_are_the_head_or_its_clusters() {
        let lights = Lights::of_map(&made_up_map(), 300).unwrap().lights;
        let options = DirectionalOptions::default();
        assert_eq!(lights_of(&lights, &options), 72);
        let clustered = DirectionalOptions { lights: 300, clusters: Some(24), ..options };
        assert!((2..=24).contains(&lights_of(&lights, &clustered)));
    }

    #[test]
    fn culling_looks_at_fewer_lights_and_changes_no_picture() {
        if Gpu::for_test().is_none() {
            return;
        }
        let gpu = || Gpu::open(&Gpu::instance(Backend::Vulkan), None);
        let rows = culling_rows(gpu).unwrap();
        lines("", "culling", &rows).iter().for_each(|line| println!("{line}"));
        // The sums are in another order.
        assert!(rows[1].error.unwrap() < 1e-5, "{:?}", rows[1].error);
        let [all, region] = [&rows[0], &rows[1]].map(|row| row.seen.unwrap());
        assert_eq!(all, 300.0);
        assert!((1.6..1.8).contains(&(all / region)), "{region}");
        assert_eq!((rows[0].lights, rows[0].triangles), (300, 16_128));
        assert_eq!(rows[0].error, None);
    }
}
