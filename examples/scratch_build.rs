use lightcast::camera::*;
use lightcast::image::*;
use std::time::Instant;
fn main() {
    for (w, h, f) in [(640usize, 480usize, 480.0), (1024, 1024, 1024.0), (2880, 2880, 2880.0)] {
        let fx = 0.5 * f / std::f64::consts::FRAC_PI_2;
        let lens = Lens::new(LensParameters {
            width: w,
            height: h,
            fx,
            fy: fx,
            cx: w as f64 * 0.5 + 0.3,
            cy: h as f64 * 0.5 - 0.2,
            k: [0.; 4],
            field_of_view_rad: std::f64::consts::PI,
        })
        .unwrap();
        for shape in [PolarShape::hemisphere(360, 90), PolarShape::hemisphere(1440, 360)] {
            let t = Instant::now();
            let mut m = FrameToPolar::new(&Projection::Fisheye(lens), LOOKING_UP, shape).unwrap();
            let build = t.elapsed();
            let frame = Frame {
                stamp: Stamp::default(),
                width: w,
                height: h,
                channels: 1,
                pixels: Pixels::Codes((0..w * h).map(|i| (i * 7919 % 4000) as u16).collect()),
            };
            let r = Response::new(ResponseModel::Linear { black_level: 10, white_level: 4095, gain: 1.0 })
                .unwrap();
            let mut map = PolarMap::black(shape);
            let mut best = f64::MAX;
            for _ in 0..30 {
                let t = Instant::now();
                std::hint::black_box(m.apply(&frame, &r, &mut map).unwrap());
                best = best.min(t.elapsed().as_secs_f64());
            }
            // streaming: read raw + same bytes
            let bytes = vec![1u64; (m.streamed_bytes() + w * h * 2) / 8];
            let mut sb = f64::MAX;
            for _ in 0..30 {
                let t = Instant::now();
                let mut s = [0u64; 8];
                for c in bytes.as_chunks::<8>().0 {
                    for k in 0..8 {
                        s[k] += c[k];
                    }
                }
                std::hint::black_box(s);
                sb = sb.min(t.elapsed().as_secs_f64());
            }
            println!(
                "{w}x{h} -> {}x{}: build {:.2?}, apply {:.3} ms, stream {:.3} ms, matrix {:.2} MB, power {:?}",
                shape.columns,
                shape.rows,
                build,
                best * 1e3,
                sb * 1e3,
                m.streamed_bytes() as f64 / 1e6,
                map.power()[0]
            );
        }
    }
}
