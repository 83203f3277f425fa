//! Raw frame to polar map (METHODS section 4): response and matrix in one pass, beside the time to read the same
//! bytes once, which is the limit. Published (2005): frame grab and polar map 360 x 90 in under 1 ms.
#![allow(missing_docs)] // criterion's macros make undocumented functions

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use lightcast::camera::{
    FrameToPolar, LOOKING_UP, Lens, LensParameters, Projection, Response, ResponseModel,
};
use lightcast::image::{Frame, Pixels, PolarMap, PolarShape, Stamp};
use std::f64::consts::{FRAC_PI_2, PI};
use std::hint::black_box;

/// A 180 degree lens whose circle fills the shorter side.
fn lens(width: usize, height: usize) -> Lens {
    let f = 0.5 * width.min(height) as f64 / FRAC_PI_2;
    Lens::new(LensParameters {
        width,
        height,
        fx: f,
        fy: f,
        cx: 0.5 * width as f64 + 0.3,
        cy: 0.5 * height as f64 - 0.2,
        k: [0.0; 4],
        field_of_view_rad: PI,
    })
    .expect("the lens is sound")
}

/// Reads every byte once, eight sums side by side: what memory gives.
fn stream(words: &[u64]) -> [u64; 8] {
    let mut sums = [0u64; 8];
    for chunk in words.as_chunks::<8>().0 {
        for lane in 0..8 {
            sums[lane] = sums[lane].wrapping_add(chunk[lane]);
        }
    }
    sums
}

fn calibrate(criterion: &mut Criterion) {
    let model = ResponseModel::Logarithmic { a: 500.0, b: 250.0, black_clip_code: 10, saturation_code: 4000 };
    let response = Response::new(model).expect("the response is sound");
    for (width, height) in [(640, 480), (2880, 2880)] {
        for (columns, rows) in [(360, 90), (1440, 360)] {
            let shape = PolarShape::hemisphere(columns, rows);
            let projection = Projection::Fisheye(lens(width, height));
            let mut matrix =
                FrameToPolar::new(&projection, LOOKING_UP, shape).expect("lens and map are sound");
            let codes = (0..width * height).map(|index| (index * 7919 % 4096) as u16).collect();
            let frame =
                Frame { stamp: Stamp::default(), width, height, channels: 1, pixels: Pixels::Codes(codes) };
            let mut map = PolarMap::black(shape);
            let bytes = matrix.streamed_bytes() + 2 * width * height;
            let words = vec![1u64; bytes / 8];

            let mut group = criterion.benchmark_group("calibrate");
            group.throughput(Throughput::Bytes(bytes as u64)).sample_size(20);
            let name = format!("{width}x{height} to {columns}x{rows}");
            group.bench_function(BenchmarkId::new("frame to polar", &name), |bencher| {
                bencher.iter(|| matrix.apply(black_box(&frame), &response, &mut map).expect("frames match"));
            });
            group.bench_function(BenchmarkId::new("stream the same bytes", &name), |bencher| {
                bencher.iter(|| stream(black_box(&words)));
            });
            group.finish();
        }
    }
}

criterion_group!(benches, calibrate);
criterion_main!(benches);
