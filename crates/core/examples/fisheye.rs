//! Raw codes of a calibrated fisheye camera to a polar map of radiance: `cargo run --example fisheye`.

use lightcast_core::camera::{
    FrameToPolar, LOOKING_UP, Lens, LensParameters, Projection, Response, ResponseModel,
};
use lightcast_core::error::Result;
use lightcast_core::image::{Frame, Pixels, PolarMap, PolarShape};
use std::f64::consts::PI;

fn main() -> Result<()> {
    // An equidistant lens: 180 degrees over a circle of 640 pixels, half-pixel centres.
    let focal_px = 640.0 / PI;
    let lens = Lens::new(LensParameters {
        width: 640,
        height: 640,
        fx: focal_px,
        fy: focal_px,
        cx: 320.0,
        cy: 320.0,
        k: [0.0; 4],
        field_of_view_rad: PI,
    })?;
    // code = 500 + 60 ln L, and a frame in which every code stands for L = 2.
    let logarithmic =
        ResponseModel::Logarithmic { a: 500.0, b: 60.0, black_clip_code: 20, saturation_code: 1000 };
    let response = Response::new(logarithmic)?;
    let pixels = Pixels::Codes(vec![response.encode(2.0); 640 * 640]);
    let frame = Frame { width: 640, height: 640, channels: 1, pixels, ..Frame::default() };

    let shape = PolarShape::hemisphere(360, 90);
    let mut to_polar = FrameToPolar::new(&Projection::Fisheye(lens), LOOKING_UP, shape)?;
    let mut map = PolarMap::black(shape);
    let counts = to_polar.apply(&frame, &response, &mut map)?;
    println!("{counts:?}");
    println!("radiance {:.3}, power {:.3} (2 times 2 pi)", map.luminance(45, 0), map.power()[0]);
    Ok(())
}
