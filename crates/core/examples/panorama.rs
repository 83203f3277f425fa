//! A panorama in memory to lights: `cargo run --example panorama`.

use lightcast_core::camera::{FrameToPolar, Projection, Response};
use lightcast_core::error::Result;
use lightcast_core::image::{Frame, LatLongCentres, Pixels, PolarMap, PolarShape};
use lightcast_core::light::{Extractor, LightList, Options};

fn main() -> Result<()> {
    // A sky that is brighter towards the zenith, and a sun of 3 x 3 pixels: 512 x 256, linear RGB.
    let (width, height) = (512, 256);
    let mut radiance = vec![0.05; 3 * width * height];
    for (row, pixels) in radiance.chunks_mut(3 * width).enumerate().take(height / 2) {
        for (column, pixel) in pixels.chunks_mut(3).enumerate() {
            let zenith = 1.0 - row as f32 / 128.0;
            let sun = (60..63).contains(&row) && (130..133).contains(&column);
            pixel.copy_from_slice(&[0.3 + 0.2 * zenith, 0.4 + 0.3 * zenith, 0.6 + 0.6 * zenith]);
            pixel.iter_mut().for_each(|value| *value += if sun { 5000.0 } else { 0.0 });
        }
    }
    let frame = Frame { width, height, channels: 3, pixels: Pixels::Radiance(radiance), ..Frame::default() };

    let shape = PolarShape::sphere(360, 180);
    let projection = Projection::LatLong { width, height, centres: LatLongCentres::Half };
    let mut to_polar = FrameToPolar::new(&projection, glam::DMat3::IDENTITY, shape)?;
    let mut extractor = Extractor::new(shape, &Options { count: 16, ..Options::default() })?;
    let (mut map, mut list) = (PolarMap::black(shape), LightList::default());
    to_polar.apply(&frame, &Response::default(), &mut map)?;
    extractor.step(&map, &mut list);

    println!("{} lights, power {:.2?}", list.lights.len(), list.power);
    for light in list.lights.iter().filter(|light| light.luminance() > 0.0) {
        println!("towards {:6.3?}: irradiance {:7.4?}", light.direction, light.irradiance);
    }
    Ok(())
}
