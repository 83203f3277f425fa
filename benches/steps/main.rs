//! The time of every step, beside the published figures (METHODS section 11) and, for calibration, beside the
//! time to read the same bytes once. `make bench` runs all and prints the table; `cargo bench --bench steps
//! -- NAME` runs those whose name contains NAME. `make cost` (`cargo bench --bench steps -- --cost FILE`)
//! draws cost against map size and number of lights.
//!
//! Everything runs on one thread. The surroundings are a sky with clouds, a small sun and lamps; the
//! radiances do not affect the cost of calibration and tables, and affect that of the rest only by where the
//! lights crowd.

mod cost;
mod scene;
mod stream;
mod table;

use criterion::{BatchSize, Criterion};
use lightcast::design::{FilterOptions, RateFilter};
use lightcast::wire::{Delivery, Message, binary, json, write_list_line};
use lightcast_core::camera::{FrameToPolar, LOOKING_UP, Projection};
use lightcast_core::image::{Bayer, Frame, PolarMap, PolarShape, luminance};
use lightcast_core::light::ReferencedList;
use lightcast_core::light::error::ListError;
use lightcast_core::light::{
    Extractor, LightList, MapIrradiance, NearestSites, Options, RegionLists, Regions, cluster,
};
use lightcast_core::sampling::{Bicontinuous, Standard, sample_points};
use std::hint::black_box;
use std::time::Duration;

/// Lights of every list, as in the paper's figures.
const LIGHTS: usize = 300;
/// The most clusters: as many as the paper has shadow maps.
const CLUSTERS: usize = 72;

fn main() {
    if let Some(file) = std::env::args().skip_while(|argument| argument != "--cost").nth(1) {
        std::fs::write(file, cost::run()).expect("the plot's file can be written");
        return;
    }
    let mut criterion = Criterion::default()
        .measurement_time(Duration::from_secs(3))
        .warm_up_time(Duration::from_secs(1))
        .sample_size(50)
        .configure_from_args();
    let mut table = table::Table::default();
    for shape in [PolarShape::hemisphere(360, 90), PolarShape::hemisphere(1440, 360)] {
        for size in [(640, 480), (2880, 2880)] {
            calibrate(&mut criterion, &mut table, size, None, shape);
        }
        calibrate(&mut criterion, &mut table, (2880, 2880), Some(Bayer::Rggb), shape);
    }
    for shape in [PolarShape::hemisphere(360, 90), PolarShape::hemisphere(1440, 360)] {
        lights(&mut criterion, &mut table, shape);
    }
    for_rendering(&mut criterion, &mut table);
    messages(&mut criterion, &mut table);
    whole(&mut criterion, &mut table);
    criterion.final_summary();
    table.print();
}

fn name_of(shape: PolarShape) -> String {
    format!("{}x{}", shape.columns(), shape.rows())
}

/// From a raw frame, of a mosaic sensor or not, to a polar map, and a read of as many bytes.
fn calibrate(
    criterion: &mut Criterion,
    table: &mut table::Table,
    (width, height): (usize, usize),
    bayer: Option<Bayer>,
    shape: PolarShape,
) {
    let (lens, response) = (scene::lens(width, height), scene::response());
    let projection = Projection::Fisheye(lens);
    let matrix = match bayer {
        None => FrameToPolar::new(&projection, LOOKING_UP, shape),
        Some(bayer) => FrameToPolar::mosaic(&projection, bayer, LOOKING_UP, shape),
    };
    let mut matrix = matrix.expect("lens and map are sound");
    let frame = Frame { bayer, ..scene::raw_frame(&lens, &response, 0) };
    let mut map = PolarMap::black(shape);
    let bytes = matrix.streamed_bytes() + 2 * width * height;
    let words = vec![1u64; bytes / 8];
    let colours = bayer.map(|bayer| format!(" {bayer}")).unwrap_or_default();
    let name = format!("{width}x{height}{colours} to {}", name_of(shape));

    let mut group = criterion.benchmark_group("calibrate");
    group.bench_function(&name, |bencher| {
        bencher.iter(|| matrix.apply(black_box(&frame), &response, &mut map).expect("frames match"));
    });
    group.bench_function(format!("{name}, reading only"), |bencher| {
        bencher.iter(|| stream::read(black_box(&words)));
    });
    group.finish();
    let published = (shape.columns() == 360).then_some("grab and map < 1 ms");
    table.row("calibrate", &name, published, String::new());
    table.row("calibrate", &format!("{name}, reading only"), None, format!("{:.1} MB", bytes as f64 / 1e6));
}

/// The steps from polar map to list.
fn lights(criterion: &mut Criterion, table: &mut table::Table, shape: PolarShape) {
    let name = name_of(shape);
    let map = scene::map(shape);
    let values: Vec<f32> = map.pixels.iter().map(|&pixel| luminance(pixel)).collect();
    let z = |row: f64| 2.0 * (0.5 * shape.theta_max_rad() * row / shape.rows() as f64).sin().powi(2);
    let edges: Vec<f64> = (0..=shape.rows()).map(|row| z(row as f64)).collect();
    let centres: Vec<f64> = (0..shape.rows()).map(|row| z(row as f64 + 0.5)).collect();
    let mut standard = Standard::new(shape.columns(), &edges);
    let mut bicontinuous = Bicontinuous::new(shape.columns(), &centres, z(shape.rows() as f64));
    let points = sample_points(LIGHTS, 4);
    let mut extractor =
        Extractor::new(shape, &Options { count: LIGHTS, ..Options::default() }).expect("sound options");
    let mut list = ReferencedList::default();
    extractor.step(&map, &mut list);
    let sites: Vec<[f32; 3]> = list.list.lights.iter().map(|light| light.direction).collect();
    let mut nearest_sites = NearestSites::new(shape, LIGHTS);
    let mut nearest = vec![0; shape.len()];
    let (mut irradiance, mut reference) = (MapIrradiance::new(shape), Vec::new());
    let mut list_error = ListError::new();

    let mut group = criterion.benchmark_group(&name);
    group.bench_function("CDFs, standard", |bencher| bencher.iter(|| standard.update(black_box(&values))));
    group.bench_function("CDFs, bicontinuous", |bencher| {
        bencher.iter(|| bicontinuous.update(black_box(&values)));
    });
    group.bench_function("300 samples, standard", |bencher| {
        bencher.iter(|| points.iter().map(|&u| standard.sample(black_box(u))[0]).sum::<f64>());
    });
    group.bench_function("300 samples, bicontinuous", |bencher| {
        bencher.iter(|| points.iter().map(|&u| bicontinuous.sample(black_box(u))[0]).sum::<f64>());
    });
    group.bench_function("nearest of 300 sites", |bencher| {
        bencher.iter(|| nearest_sites.assign(black_box(&sites), &mut nearest));
    });
    group.bench_function("assignment and refinement", |bencher| {
        bencher.iter(|| extractor.extract(black_box(&map), &mut list.list));
    });
    group.bench_function("error estimate, map", |bencher| {
        bencher.iter(|| irradiance.reference(black_box(&map), &mut reference));
    });
    group.bench_function("error estimate, list and prefixes", |bencher| {
        bencher.iter(|| list_error.measure(black_box(&mut list)));
    });
    group.finish();

    let paper = |figure: &'static str| (shape.columns() == 360).then_some(figure);
    let error = format!("error {:.5}", list.list.error.expect("measured"));
    table.row(&name, "CDFs, standard", None, String::new());
    table.row(&name, "CDFs, bicontinuous", paper("CDFs and power < 2 ms"), String::new());
    table.row(&name, "300 samples, standard", None, String::new());
    table.row(&name, "300 samples, bicontinuous", paper("410 a ms: 0.73 ms"), String::new());
    table.row(&name, "nearest of 300 sites", None, String::new());
    table.row(&name, "assignment and refinement", None, error);
    table.row(&name, "error estimate, map", None, String::new());
    table.row(&name, "error estimate, list and prefixes", None, String::new());
}

/// The steps that a renderer needs for a list.
fn for_rendering(criterion: &mut Criterion, table: &mut table::Table) {
    let shape = PolarShape::hemisphere(360, 90);
    let mut extractor =
        Extractor::new(shape, &Options { count: LIGHTS, ..Options::default() }).expect("sound options");
    let mut list = LightList::default();
    extractor.extract(&scene::map(shape), &mut list);
    let (mut clusters, mut places) = (Vec::new(), Vec::new());
    let (regions, mut lists) = (Regions::for_normals(), RegionLists::default());
    // Each step runs once, for the remarks of a table of which only some rows are measured.
    cluster(&list.lights, CLUSTERS, &mut clusters, &mut places);
    regions.assign(&list.lights, LIGHTS, &mut lists);
    let mut group = criterion.benchmark_group("for rendering");
    group.bench_function("clustering, 300 lights", |bencher| {
        bencher.iter(|| cluster(black_box(&list.lights), CLUSTERS, &mut clusters, &mut places));
    });
    group.bench_function("200 regions, 300 lights", |bencher| {
        bencher.iter(|| regions.assign(black_box(&list.lights), LIGHTS, &mut lists));
    });
    group.finish();
    let remark = format!("{} clusters of at most {CLUSTERS}", clusters.len());
    table.row("for rendering", "clustering, 300 lights", Some("about 1 ms"), remark);
    let mean = regions.mean_lights(&lists);
    let remark = format!("{mean:.0} lights a region, gain {:.2}", LIGHTS as f64 / mean);
    table.row("for rendering", "200 regions, 300 lights", Some("< 1 ms"), remark);
}

/// The cost of sending a list to clients: its body is made once for all of them, the message is assembled for
/// each and decoded by each.
fn messages(criterion: &mut Criterion, table: &mut table::Table) {
    let shape = PolarShape::hemisphere(360, 90);
    let mut extractor =
        Extractor::new(shape, &Options { count: LIGHTS, ..Options::default() }).expect("sound options");
    let mut list = LightList::default();
    extractor.extract(&scene::map(shape), &mut list);
    let (mut body, mut bytes, mut object, mut text) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let (delivery, mut message) = (Delivery::default(), Message::default());
    // Each step runs once: a benchmark that is measured alone then has the input that another one makes.
    binary::encode_list(&list, &mut body).expect("a sound list");
    binary::encode(&body, &delivery, &mut bytes);
    write_list_line(&list, &mut object).expect("memory takes them");
    json::encode(&object, &delivery, &mut text);
    let mut group = criterion.benchmark_group("messages");
    group.bench_function("300 lights to bytes", |bencher| {
        bencher.iter(|| binary::encode_list(black_box(&list), &mut body).expect("a sound list"));
    });
    group.bench_function("300 lights to bytes, for one client more", |bencher| {
        bencher.iter(|| binary::encode(black_box(&body), &delivery, &mut bytes));
    });
    group.bench_function("300 lights from bytes", |bencher| {
        bencher.iter(|| binary::decode(black_box(&bytes), &mut message).expect("a sound message"));
    });
    group.bench_function("300 lights to JSON", |bencher| {
        bencher.iter(|| {
            object.clear();
            write_list_line(black_box(&list), &mut object).expect("memory takes them");
        });
    });
    group.bench_function("300 lights to JSON, for one client more", |bencher| {
        bencher.iter(|| json::encode(black_box(&object), &delivery, &mut text));
    });
    group.bench_function("300 lights from JSON", |bencher| {
        bencher.iter(|| json::decode(black_box(&text), &mut message).expect("a sound message"));
    });
    group.finish();
    for (form, length) in [("bytes", bytes.len()), ("JSON", text.len())] {
        table.row("messages", &format!("300 lights to {form}"), None, format!("{length} bytes"));
        table.row("messages", &format!("300 lights to {form}, for one client more"), None, String::new());
        table.row("messages", &format!("300 lights from {form}"), None, String::new());
    }
}

/// All steps from a raw frame of 640 x 480 to the filtered list.
fn chain() -> impl FnMut(&mut ReferencedList) {
    let shape = PolarShape::hemisphere(360, 90);
    let (lens, response) = (scene::lens(640, 480), scene::response());
    let frames: Vec<_> = (0..16).map(|time| scene::raw_frame(&lens, &response, time)).collect();
    let mut matrix =
        FrameToPolar::new(&Projection::Fisheye(lens), LOOKING_UP, shape).expect("lens and map are sound");
    let mut extractor =
        Extractor::new(shape, &Options { count: LIGHTS, ..Options::default() }).expect("sound options");
    let mut filter = RateFilter::new(&FilterOptions::default()).expect("sound options");
    let (mut map, mut list) = (PolarMap::black(shape), ReferencedList::default());
    let mut time = 0u64;
    move |filtered| {
        matrix.apply(&frames[time as usize % frames.len()], &response, &mut map).expect("frames match");
        map.stamp = scene::stamp(time);
        extractor.step(&map, &mut list);
        filter.step(&list, filtered).expect("a rate that a filter can be made for");
        time += 1;
    }
}

/// The filter, and all steps together.
fn whole(criterion: &mut Criterion, table: &mut table::Table) {
    let (mut step, mut filtered) = (chain(), ReferencedList::default());
    let mut group = criterion.benchmark_group("whole");
    group.bench_function("raw 640x480 to 300 filtered adaptive lights", |bencher| {
        bencher.iter(|| step(black_box(&mut filtered)));
    });
    let (mut filter, mut after) =
        (RateFilter::new(&FilterOptions::default()).expect("sound options"), ReferencedList::default());
    let mut lists: Vec<ReferencedList> = (0..16).map(|_| filtered.clone()).collect();
    let mut time = 0u64;
    group.bench_function("filter of 300 lights, its error included", |bencher| {
        bencher.iter_batched_ref(
            || {
                time += 1;
                let list = &mut lists[time as usize % 16];
                list.list.stamp = scene::stamp(time);
                list.clone()
            },
            |list| filter.step(black_box(list), &mut after).expect("a rate that a filter can be made for"),
            BatchSize::SmallInput,
        );
    });
    group.finish();
    table.row("whole", "filter of 300 lights, its error included", Some("210 lights 1 ms"), String::new());
    table.row(
        "whole",
        "raw 640x480 to 300 filtered adaptive lights",
        Some("map to clustered lights < 5 ms"),
        format!("error {:.5}", filtered.list.error.expect("measured")),
    );
}
