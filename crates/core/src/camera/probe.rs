//! Light probes: panoramas of the whole sphere that are not lat-long pictures.

use super::PixelCounts;
use crate::error::{Error, Result};
use crate::image::{Frame, Pixels, PolarMap, PolarShape};
use crate::math::polar;
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// How the sphere of directions lies in the picture of a light probe. Up in the picture is +Y. The middle of
/// an angular map, and of the cross's front face, is +Z with +X on its left, as in a lat-long picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Probe {
    /// Angular map (Debevec 1998): a disc that fills a square, the distance from its middle in proportion to
    /// the angle from +Z; the rim is -Z.
    Angular,
    /// A mirror ball that fills a square, photographed along +Z from far away: its middle shows -Z, behind
    /// the camera, its rim +Z.
    MirrorBall,
    /// The faces of a cube as a cross, four by three or three by four of them: above and below the front face
    /// up and down, beside it left and right, and behind the right one or below the lower one, then upside
    /// down, the back.
    CubeCross,
}

/// Samples of the picture for a pixel of the map, on average. Their number in a pixel of the map differs by
/// few from that of its solid angle then.
const SAMPLES_PER_MAP_PIXEL: f64 = 64.0;

/// Most samples along a side of a pixel of the picture.
const MOST_SAMPLES: usize = 64;

impl Probe {
    /// Whether a picture of this size can be one.
    pub fn fits(&self, width: usize, height: usize) -> bool {
        match self {
            Self::Angular | Self::MirrorBall => width == height && width > 0,
            Self::CubeCross => width > 0 && (3 * width == 4 * height || 4 * width == 3 * height),
        }
    }

    /// The direction, a unit vector, in which a place of a `width` x `height` picture looks, and the solid
    /// angle of the picture there per pixel, in steradians. Places count pixels from the upper left corner.
    /// `None` where the picture shows nothing.
    pub fn unproject(&self, [x, y]: [f64; 2], [width, height]: [usize; 2]) -> Option<(DVec3, f64)> {
        match self {
            Self::Angular | Self::MirrorBall => {
                let half = 0.5 * width as f64;
                let (right, up) = (x / half - 1.0, 1.0 - y / half);
                let r = right.hypot(up);
                if r >= 1.0 {
                    return None;
                }
                // Of a square of side 1 in units of the radius.
                let (angle_rad, density, middle) = match self {
                    Self::MirrorBall => (2.0 * r.asin(), 4.0, -1.0),
                    _ => (PI * r, if r > 0.0 { PI * (PI * r).sin() / r } else { PI * PI }, 1.0),
                };
                let across = if r > 0.0 { angle_rad.sin() / r } else { 0.0 };
                let direction = DVec3::new(-right * across, up * across, middle * angle_rad.cos());
                Some((direction, density / (half * half)))
            }
            Self::CubeCross => {
                let is_wide = width > height;
                let side = if is_wide { width as f64 / 4.0 } else { width as f64 / 3.0 };
                let (column, row) = ((x / side).floor(), (y / side).floor());
                // From -1 to 1 over the face, to the right and down.
                let s = 2.0 * (x / side - column) - 1.0;
                let t = 2.0 * (y / side - row) - 1.0;
                let point = match (column as i64, row as i64) {
                    (0, 1) => DVec3::new(1.0, -t, s),
                    (1, 0) => DVec3::new(-s, 1.0, t),
                    (1, 1) => DVec3::new(-s, -t, 1.0),
                    (1, 2) => DVec3::new(-s, -1.0, -t),
                    (2, 1) => DVec3::new(-1.0, -t, -s),
                    (3, 1) if is_wide => DVec3::new(s, -t, -1.0),
                    (1, 3) if !is_wide => DVec3::new(-s, t, -1.0),
                    _ => return None,
                };
                let density = point.length_squared().powf(-1.5);
                // One coordinate is 1 or -1.
                Some((point / point.length(), density * 4.0 / (side * side)))
            }
        }
    }

    /// The place that shows a direction: the inverse of [`Self::unproject`].
    fn project(&self, direction: DVec3, [width, height]: [usize; 2]) -> [f64; 2] {
        let DVec3 { x, y, z } = direction;
        match self {
            Self::Angular | Self::MirrorBall => {
                let across = x.hypot(y);
                let r = match self {
                    Self::MirrorBall => (0.5 * across.atan2(-z)).sin(),
                    _ => across.atan2(z) / PI,
                };
                let half = 0.5 * width as f64;
                let scale = if across > 0.0 { r / across } else { 0.0 };
                [half * (1.0 - x * scale), half * (1.0 - y * scale)]
            }
            Self::CubeCross => {
                let is_wide = width > height;
                let side = if is_wide { width as f64 / 4.0 } else { width as f64 / 3.0 };
                let most = direction.abs().max_element();
                let ([column, row], [s, t]) = match () {
                    () if x == most => ([0.0, 1.0], [z, -y]),
                    () if -x == most => ([2.0, 1.0], [-z, -y]),
                    () if y == most => ([1.0, 0.0], [-x, z]),
                    () if -y == most => ([1.0, 2.0], [-x, -z]),
                    () if z == most => ([1.0, 1.0], [-x, -y]),
                    () if is_wide => ([3.0, 1.0], [x, -y]),
                    () => ([1.0, 3.0], [-x, y]),
                };
                let place = |face: f64, along: f64| side * (face + 0.5 * (along / most + 1.0));
                [place(column, s).min(width as f64), place(row, t).min(height as f64)]
            }
        }
    }

    /// The pixel that shows a direction, or, at the rim, the next one further in.
    fn nearest_pixel(&self, direction: DVec3, size: [usize; 2]) -> [usize; 2] {
        let mut place = self.project(direction, size);
        loop {
            let pixel = [0, 1].map(|axis| (place[axis].max(0.0) as usize).min(size[axis] - 1));
            let middle = pixel.map(|at| at as f64 + 0.5);
            let inwards = [0, 1].map(|axis| 0.5 * size[axis] as f64 - place[axis]);
            let distance = inwards[0].hypot(inwards[1]);
            if self.unproject(middle, size).is_some() || distance < 1.0 {
                return pixel;
            }
            for (at, inwards) in place.iter_mut().zip(inwards) {
                *at += 0.5 * inwards / distance;
            }
        }
    }

    /// Averages a picture of radiance over the pixels of a map; one channel fills all three. Pixels without a
    /// usable value count as black, see the counts. The average is over samples within the pixels of the
    /// picture, by their solid angles, so that even light stays even; other light keeps its power to about a
    /// per cent.
    ///
    /// # Errors
    /// `BadFrame` for codes and for pictures of a shape that this is not.
    pub fn average(&self, frame: &Frame, shape: PolarShape) -> Result<(PolarMap, PixelCounts)> {
        let size @ [width, height] = [frame.width, frame.height];
        if !self.fits(width, height) {
            let wanted = match self {
                Self::CubeCross => "four by three or three by four squares",
                _ => "a square",
            };
            return Err(Error::bad_frame(format!("is {width} x {height}; this layout is {wanted}")));
        }
        let Pixels::Radiance(values) = &frame.pixels else {
            return Err(Error::bad_frame("holds codes; a light probe holds radiance"));
        };
        if !matches!(frame.channels, 1 | 3 | 4) || values.len() != width * height * frame.channels {
            return Err(Error::bad_frame(format!("has {} channels; 1 or 3 are wanted", frame.channels)));
        }
        let mut counts = PixelCounts::default();
        let wanted = SAMPLES_PER_MAP_PIXEL * shape.len() as f64 / (width * height) as f64;
        let samples = (wanted.sqrt().ceil() as usize).clamp(1, MOST_SAMPLES);
        let mut sums = vec![[0.0; 4]; shape.len()];
        for (index, pixel) in values.chunks_exact(frame.channels).enumerate() {
            let corner = [index % width, index / width].map(|at| at as f64);
            let middle = corner.map(|at| at + 0.5);
            // A pixel at the rim whose middle lies outside holds nothing, although a part of it lies inside.
            if self.unproject(middle, size).is_none() {
                continue;
            }
            let radiance = usable(pixel, Some(&mut counts));
            for sample in 0..samples * samples {
                let at = |along: usize| (along as f64 + 0.5) / samples as f64;
                let place = [corner[0] + at(sample % samples), corner[1] + at(sample / samples)];
                let Some((direction, density_sr)) = self.unproject(place, size) else { continue };
                let Some(cell) = cell(shape, direction) else { continue };
                let sum: &mut [f64; 4] = &mut sums[cell];
                for (sum, value) in sum.iter_mut().zip(radiance) {
                    *sum += density_sr * value;
                }
                sum[3] += density_sr;
            }
        }
        let map = PolarMap::from_fn(shape, |row, column| {
            let sum = sums[row * shape.columns() + column];
            if sum[3] > 0.0 {
                return [sum[0], sum[1], sum[2]]
                    .map(|value| (value / sum[3]).min(f64::from(f32::MAX)) as f32);
            }
            // No sample has met this pixel, where the picture is squeezed: the nearest one is as good.
            let [x, y] = self.nearest_pixel(shape.pixel_direction(row, column), size);
            let at = (y * width + x) * frame.channels;
            let radiance = usable(&values[at..at + frame.channels], None);
            [radiance[0], radiance[1], radiance[2]].map(|value| value as f32)
        });
        Ok((PolarMap { stamp: frame.stamp, ..map }, counts))
    }
}

/// The radiance of a pixel, black where it has none, and four entries for a sum with its weight.
fn usable(pixel: &[f32], counts: Option<&mut PixelCounts>) -> [f64; 3] {
    let rgb = if pixel.len() == 1 { [pixel[0]; 3] } else { [pixel[0], pixel[1], pixel[2]] };
    if let Some(counts) = counts {
        counts.nan += u64::from(rgb.iter().any(|value| value.is_nan()));
        counts.infinite += u64::from(rgb.iter().any(|value| value.is_infinite()));
        counts.negative += u64::from(rgb.iter().any(|value| *value < 0.0 && value.is_finite()));
    }
    rgb.map(|value| if value.is_finite() { f64::from(value.max(0.0)) } else { 0.0 })
}

/// The pixel of a map in which a direction lies; `None` below its rim.
fn cell(shape: PolarShape, direction: DVec3) -> Option<usize> {
    let (theta, phi) = polar(direction);
    let row = (theta / shape.theta_max_rad() * shape.rows() as f64) as usize;
    let column = ((phi.rem_euclid(TAU) / TAU * shape.columns() as f64) as usize).min(shape.columns() - 1);
    (row < shape.rows() || theta <= shape.theta_max_rad())
        .then(|| row.min(shape.rows() - 1) * shape.columns() + column)
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [(Probe, [usize; 2]); 4] = [
        (Probe::Angular, [64, 64]),
        (Probe::MirrorBall, [64, 64]),
        (Probe::CubeCross, [64, 48]),
        (Probe::CubeCross, [48, 64]),
    ];

    /// A picture of what `radiance` says of directions.
    fn picture(probe: Probe, [width, height]: [usize; 2], radiance: impl Fn(DVec3) -> f32) -> Frame {
        let value = |index: usize| {
            let place = [index % width, index / width].map(|at| at as f64 + 0.5);
            probe.unproject(place, [width, height]).map_or(0.0, |(direction, _)| radiance(direction))
        };
        let pixels = Pixels::Radiance((0..width * height).map(value).collect());
        Frame { width, height, channels: 1, pixels, ..Frame::default() }
    }

    #[test]
    fn the_picture_covers_the_sphere_once() {
        for (probe, size) in ALL {
            let mut sphere_sr = 0.0;
            let mut moment = DVec3::ZERO;
            let fine = size.map(|side| 8 * side);
            for index in 0..fine[0] * fine[1] {
                let place = [index % fine[0], index / fine[0]].map(|at| at as f64 + 0.5);
                if let Some((direction, density_sr)) = probe.unproject(place, fine) {
                    assert!((direction.length() - 1.0).abs() < 1e-12);
                    sphere_sr += density_sr;
                    moment += density_sr * direction;
                }
            }
            assert!((sphere_sr / (4.0 * PI) - 1.0).abs() < 2e-3, "{probe:?}: {sphere_sr}");
            assert!(moment.length() < 0.05, "{probe:?}: {moment}");
        }
    }

    #[test]
    fn places_and_directions_are_inverse() {
        for (probe, size) in ALL {
            for index in 0..size[0] * size[1] {
                let place = [index % size[0], index / size[0]].map(|at| at as f64 + 0.5);
                let Some((direction, _)) = probe.unproject(place, size) else { continue };
                let back = probe.project(direction, size);
                assert!(
                    back.iter().zip(place).all(|(back, place)| (back - place).abs() < 1e-9),
                    "{probe:?} {place:?}"
                );
            }
        }
    }

    #[test]
    fn axes_lie_where_the_documentation_says() {
        for (probe, place, expected) in [
            (Probe::Angular, [32.0, 32.0], DVec3::Z),
            (Probe::Angular, [16.0, 32.0], DVec3::X),
            (Probe::Angular, [32.0, 16.0], DVec3::Y),
            (Probe::MirrorBall, [32.0, 32.0], DVec3::NEG_Z),
            // The ball's right side shows what is on the camera's right, which is -X for one that looks along
            // +Z.
            (Probe::MirrorBall, [32.0 + 32.0 * 0.5f64.sqrt(), 32.0], DVec3::NEG_X),
            (Probe::MirrorBall, [32.0, 32.0 - 32.0 * 0.5f64.sqrt()], DVec3::Y),
        ] {
            let (direction, _) = probe.unproject(place, [64, 64]).unwrap();
            assert!(direction.abs_diff_eq(expected, 1e-9), "{probe:?} {place:?}: {direction}");
        }
        for (size, back) in [([64, 48], [56.0, 24.0]), ([48, 64], [24.0, 56.0])] {
            for (place, expected) in [
                ([24.0, 24.0], DVec3::Z),
                ([8.0, 24.0], DVec3::X),
                ([40.0, 24.0], DVec3::NEG_X),
                ([24.0, 8.0], DVec3::Y),
                ([24.0, 40.0], DVec3::NEG_Y),
                (back, DVec3::NEG_Z),
            ] {
                let (direction, _) = Probe::CubeCross.unproject(place, size).unwrap();
                assert!(direction.abs_diff_eq(expected, 1e-12), "{place:?}: {direction}");
            }
            // The faces meet without a seam: light changes little from pixel to pixel of neighbouring faces.
            let edge = |place| Probe::CubeCross.unproject(place, size).unwrap().0;
            let step = 1e-6;
            for (one, other) in [
                ([16.0 - step, 20.0], [16.0 + step, 20.0]),
                ([32.0 - step, 20.0], [32.0 + step, 20.0]),
                ([20.0, 16.0 - step], [20.0, 16.0 + step]),
                ([20.0, 32.0 - step], [20.0, 32.0 + step]),
            ] {
                assert!(edge(one).abs_diff_eq(edge(other), 1e-5), "{one:?}");
            }
            let (one, other) = if size[0] > size[1] {
                ([48.0 - step, 20.0], [48.0 + step, 20.0])
            } else {
                ([20.0, 48.0 - step], [20.0, 48.0 + step])
            };
            assert!(edge(one).abs_diff_eq(edge(other), 1e-5));
        }
        assert!(Probe::CubeCross.unproject([2.0, 2.0], [64, 48]).is_none());
    }

    #[test]
    fn even_light_stays_even_and_a_lamp_keeps_its_place_and_power() {
        let lamp = DVec3::new(0.48, 0.6, 0.64);
        let shape = PolarShape::sphere(72, 36);
        for (probe, size) in ALL {
            let (map, _) = probe.average(&picture(probe, size, |_| 2.5), shape).unwrap();
            assert!(map.pixels.iter().flatten().all(|value| (value - 2.5).abs() < 1e-5), "{probe:?}");
            let fine = size.map(|side| 8 * side);
            let frame = picture(probe, fine, |direction| if direction.dot(lamp) > 0.95 { 10.0 } else { 0.0 });
            let (map, counts) = probe.average(&frame, shape).unwrap();
            let (mut power, mut moment) = (0.0, DVec3::ZERO);
            for (index, pixel) in map.pixels.iter().enumerate() {
                let row = index / shape.columns();
                let share = f64::from(pixel[1]) * shape.pixel_solid_angle(row);
                power += share;
                moment += share * shape.pixel_direction(row, index % shape.columns());
            }
            let expected = 10.0 * TAU * 0.05;
            assert!((power / expected - 1.0).abs() < 0.02, "{probe:?}: {power} {expected}");
            assert!(moment.dot(lamp) / moment.length() > 0.5f64.to_radians().cos(), "{probe:?}: {moment}");
            assert_eq!(counts, PixelCounts::default());
        }
    }

    #[test]
    fn bad_values_are_counted_and_bad_shapes_refused() {
        let mut frame = picture(Probe::Angular, [32, 32], |_| 1.0);
        if let Pixels::Radiance(values) = &mut frame.pixels {
            // A corner shows nothing and counts for nothing.
            (values[0], values[16 * 32 + 16], values[16 * 32 + 17], values[16 * 32 + 18]) =
                (f32::NAN, f32::NAN, f32::INFINITY, -1.0);
        }
        let (map, counts) = Probe::Angular.average(&frame, PolarShape::hemisphere(36, 9)).unwrap();
        assert_eq!((counts.nan, counts.infinite, counts.negative), (1, 1, 1));
        assert!(map.pixels.iter().flatten().all(|value| value.is_finite()));
        let shape = PolarShape::sphere(8, 4);
        let wide = Frame { width: 64, height: 16, ..frame.clone() };
        assert!(Probe::Angular.average(&wide, shape).unwrap_err().to_string().contains("a square"));
        assert!(Probe::CubeCross.average(&frame, shape).unwrap_err().to_string().contains("three by four"));
        let codes = Frame { pixels: Pixels::Codes(vec![0; 1024]), ..frame };
        assert!(Probe::MirrorBall.average(&codes, shape).unwrap_err().to_string().contains("codes"));
    }
}
