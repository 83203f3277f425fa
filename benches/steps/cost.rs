//! The cost of a frame against the size of the map and the number of lights: a table with fitted exponents,
//! and a plot.

use super::scene;
use lightcast::design::{FilterOptions, RateFilter};
use lightcast::picture::{Panel, Plot, Series};
use lightcast_core::camera::{FrameToPolar, LOOKING_UP, Projection};
use lightcast_core::image::{PolarMap, PolarShape};
use lightcast_core::light::ReferencedList;
use lightcast_core::light::error::ListError;
use lightcast_core::light::{Extractor, MapIrradiance, Options};
use rustix::time::{ClockId, clock_gettime};
use std::hint::black_box;

/// Rows of the maps, which have four times as many columns, and numbers of lights: each has four times the
/// pixels or lights of the previous one.
const ROWS: [usize; 5] = [45, 90, 180, 360, 720];
const LIGHTS: [usize; 5] = [16, 64, 256, 1024, 4096];
/// The fixed size and number of lights while the other varies.
const FIXED_ROWS: usize = 90;
const FIXED_LIGHTS: usize = 256;
/// Pixels of the raw frame along a side.
const FRAME: usize = 1024;
/// A step is repeated for at least this time, and at least this many times.
const LEAST_TIME_MS: f64 = 200.0;
const LEAST_REPEATS: usize = 5;

const STEPS: [&str; 5] = [
    "frame to polar",
    "assignment, refinement",
    "error estimate, map",
    "filter and list's error",
    "of which the error",
];
/// The last step is part of the one before.
const APART: usize = STEPS.len() - 1;

/// Median times in ms of the steps of a frame.
struct Cost {
    pixels: usize,
    lights: usize,
    steps_ms: [f64; STEPS.len()],
}

/// Prints the table and returns the plot as SVG.
pub fn run() -> String {
    println!(
        "median ms of processor time per frame, raw frame of {FRAME}x{FRAME}\n{:>9} {:>6} {}{:>25}",
        "map",
        "lights",
        STEPS.map(|step| format!("{step:>25}")).concat(),
        "all"
    );
    let mut costs = Vec::new();
    for rows in ROWS {
        let shape = PolarShape::hemisphere(4 * rows, rows);
        let matrix_ms = frame_to_polar(shape);
        for lights in LIGHTS {
            let cost = Cost { pixels: shape.len(), lights, steps_ms: steps(shape, lights, matrix_ms) };
            let columns = cost.steps_ms.map(|ms| format!("{ms:>25.4}")).concat();
            let map = format!("{}x{rows}", shape.columns());
            println!("{map:>9} {lights:>6} {columns}{:>25.4}", cost.all_ms());
            costs.push(cost);
        }
    }
    let (mut step, mut filtered) = (super::chain(), ReferencedList::default());
    let whole_ms = median_ms(|_| step(&mut filtered));
    println!("raw 640x480 to {} filtered adaptive lights: {whole_ms:.4} ms", super::LIGHTS);
    let by_pixels: Vec<_> = costs.iter().filter(|cost| cost.lights == FIXED_LIGHTS).collect();
    let by_lights: Vec<_> = costs.iter().filter(|cost| cost.pixels == 4 * FIXED_ROWS * FIXED_ROWS).collect();
    let panels = [
        (&by_pixels, format!("{FIXED_LIGHTS} lights"), "pixels of the map", true),
        (&by_lights, format!("map of {} x {FIXED_ROWS}", 4 * FIXED_ROWS), "lights", false),
    ];
    let panels = panels.map(|(costs, title, x_label, of_pixels)| {
        let x = |cost: &Cost| (if of_pixels { cost.pixels } else { cost.lights }) as f64;
        let points =
            |y: &dyn Fn(&Cost) -> f64| costs.iter().map(|cost| (x(cost), y(cost))).collect::<Vec<_>>();
        let mut series: Vec<Series> = STEPS
            .iter()
            .enumerate()
            .map(|(step, name)| Series { name: (*name).into(), points: points(&|cost| cost.steps_ms[step]) })
            .collect();
        series.push(Series { name: "all".into(), points: points(&|cost| cost.all_ms()) });
        let exponents =
            series.iter().map(|series| format!("{} {:.2}", series.name, exponent(&series.points)));
        println!("exponent over {x_label}, {title}: {}", exponents.collect::<Vec<_>>().join(", "));
        Panel { title, x_label: x_label.into(), y_label: "ms per frame".into(), series, ..Panel::default() }
    });
    Plot { title: format!("Cost of a frame, raw {FRAME} x {FRAME}, one thread"), panels: panels.into() }
        .to_svg()
}

impl Cost {
    fn all_ms(&self) -> f64 {
        self.steps_ms[..APART].iter().sum()
    }
}

fn frame_to_polar(shape: PolarShape) -> f64 {
    let (lens, response) = (scene::lens(FRAME, FRAME), scene::response());
    let mut matrix =
        FrameToPolar::new(&Projection::Fisheye(lens), LOOKING_UP, shape).expect("lens and map are sound");
    let frame = scene::raw_frame(&lens, &response, 0);
    let mut map = PolarMap::black(shape);
    median_ms(|_| {
        matrix.apply(black_box(&frame), &response, &mut map).expect("frames match");
    })
}

fn steps(shape: PolarShape, lights: usize, matrix_ms: f64) -> [f64; STEPS.len()] {
    let map = scene::map(shape);
    let mut extractor =
        Extractor::new(shape, &Options { count: lights, ..Options::default() }).expect("sound options");
    let (mut list, mut filtered) = (ReferencedList::default(), ReferencedList::default());
    extractor.step(&map, &mut list);
    let extract_ms = median_ms(|_| extractor.extract(black_box(&map), &mut list.list));
    let (mut irradiance, mut reference) = (MapIrradiance::new(shape), Vec::new());
    let map_ms = median_ms(|_| irradiance.reference(black_box(&map), &mut reference));
    let mut error = ListError::new();
    let error_ms = median_ms(|_| error.measure(black_box(&mut list)));
    let mut filter = RateFilter::new(&FilterOptions::default()).expect("sound options");
    let filter_ms = median_ms(|time| {
        list.list.stamp = scene::stamp(time as u64);
        filter.step(black_box(&list), &mut filtered).expect("a rate that a filter can be made for");
    });
    [matrix_ms, extract_ms, map_ms, filter_ms, error_ms]
}

/// Median of the thread's processor time: time that other processes take does not count.
fn median_ms(mut step: impl FnMut(usize)) -> f64 {
    let now_ms = || {
        let time = clock_gettime(ClockId::ThreadCPUTime);
        time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 * 1e-6
    };
    step(0);
    let (start, mut times_ms) = (now_ms(), Vec::new());
    while now_ms() < start + LEAST_TIME_MS || times_ms.len() < LEAST_REPEATS {
        let before = now_ms();
        step(times_ms.len() + 1);
        times_ms.push(now_ms() - before);
    }
    times_ms.sort_by(f64::total_cmp);
    times_ms[times_ms.len() / 2]
}

/// Slope of the straight line through the points' logarithms, by least squares: 1 where cost is proportional.
fn exponent(points: &[(f64, f64)]) -> f64 {
    let logarithms: Vec<(f64, f64)> = points.iter().map(|(x, y)| (x.ln(), y.ln())).collect();
    let count = logarithms.len() as f64;
    let (mean_x, mean_y) =
        logarithms.iter().fold((0.0, 0.0), |(sum_x, sum_y), (x, y)| (sum_x + x / count, sum_y + y / count));
    let (products, squares) = logarithms.iter().fold((0.0, 0.0), |(products, squares), (x, y)| {
        (products + (x - mean_x) * (y - mean_y), squares + (x - mean_x).powi(2))
    });
    products / squares
}
