use super::{Canvas, ToneCurve};
use crate::error::Result;
use crate::files::encode_png8;
use glam::DVec3;
use lightcast_core::image::PolarMap;
use lightcast_core::light::Light;
use lightcast_core::math::polar;
use std::f64::consts::TAU;

/// Side of the disc and width of the panorama in pixels.
const SIZE: usize = 720;
/// Largest polar angle of a map that is drawn as a disc (as a fisheye lens sees it); a wider map becomes a
/// panorama.
const WIDEST_DISC_RAD: f64 = 2.0;
/// Colour of the lights, as in the paper's figure 1.
const GREEN: [u8; 3] = [40, 255, 60];
/// Radius of a light that has all the power, as a fraction of the width; other radii scale with the square
/// root of the light's share.
const FULL_RADIUS: f64 = 1.0 / 12.0;

/// Projection of directions to the picture.
#[derive(Clone, Copy)]
enum MapView {
    /// Azimuthal equidistant about +Y: theta from the centre, phi anticlockwise from the right, as seen from
    /// below.
    Disc { side: usize },
    /// Columns are phi, rows are theta.
    Panorama { width: usize, height: usize },
}

impl MapView {
    fn of(theta_max_rad: f64, width: usize) -> Self {
        if theta_max_rad <= WIDEST_DISC_RAD {
            Self::Disc { side: width }
        } else {
            let height = (width as f64 * theta_max_rad / TAU).round() as usize;
            Self::Panorama { width, height: height.max(1) }
        }
    }

    fn size(self) -> (usize, usize) {
        match self {
            Self::Disc { side } => (side, side),
            Self::Panorama { width, height } => (width, height),
        }
    }

    /// (theta, phi) at a picture position, theta as a fraction of the map's extent; `None` outside the map.
    fn angles(self, x: f64, y: f64) -> Option<(f64, f64)> {
        match self {
            Self::Disc { side } => {
                let half = side as f64 / 2.0;
                let (right, up) = (x / half - 1.0, 1.0 - y / half);
                let radius = right.hypot(up);
                (radius < 1.0).then(|| (radius, up.atan2(right).rem_euclid(TAU)))
            }
            Self::Panorama { width, height } => Some((y / height as f64, TAU * x / width as f64)),
        }
    }

    /// The inverse of [`Self::angles`].
    fn position(self, theta: f64, phi: f64) -> (f64, f64) {
        match self {
            Self::Disc { side } => {
                let half = side as f64 / 2.0;
                (half * (1.0 + theta * phi.cos()), half * (1.0 - theta * phi.sin()))
            }
            Self::Panorama { width, height } => (width as f64 * phi / TAU, theta * height as f64),
        }
    }
}

/// A tone-mapped map without lights, on which many lists can be drawn.
#[derive(Clone)]
pub struct MapBackground {
    canvas: Canvas,
    view: MapView,
    theta_max_rad: f64,
}

impl MapBackground {
    /// A picture `width` pixels wide, at least 1; its height follows the map.
    pub fn new(map: &PolarMap, width: usize) -> Self {
        let shape = map.shape;
        let view = MapView::of(shape.theta_max_rad(), width.max(1));
        let tone = ToneCurve::for_pixels(&map.pixels);
        let (width, height) = view.size();
        let canvas = Canvas::from_fn(width, height, |x, y| {
            let Some((theta, phi)) = view.angles(x as f64 + 0.5, y as f64 + 0.5) else {
                return [24; 3];
            };
            let row = ((theta * shape.rows() as f64) as usize).min(shape.rows() - 1);
            let column = ((phi / TAU * shape.columns() as f64) as usize).min(shape.columns() - 1);
            tone.apply(map.pixels[row * shape.columns() + column])
        });
        Self { canvas, view, theta_max_rad: shape.theta_max_rad() }
    }

    /// Its width in pixels.
    pub fn width(&self) -> usize {
        self.canvas.width
    }

    /// A copy with a ring for every light, whose area is proportional to the light's share of the power.
    /// Lights beyond the map's rim are left out.
    pub fn draw(&self, lights: &[Light]) -> Canvas {
        let mut canvas = self.canvas.clone();
        let full_radius = FULL_RADIUS * canvas.width as f64;
        let total: f64 = lights.iter().map(|light| f64::from(light.luminance())).sum();
        for light in lights.iter().filter(|light| light.luminance() > 0.0) {
            let (theta_rad, phi_rad) = polar(DVec3::from_array(light.direction.map(f64::from)));
            // Filtered directions may lie slightly beyond the rim.
            if theta_rad > 1.1 * self.theta_max_rad {
                continue;
            }
            let (x, y) = self.view.position(theta_rad / self.theta_max_rad, phi_rad);
            let radius = full_radius * (f64::from(light.luminance()) / total).sqrt();
            canvas.ring(x, y, radius.max(2.0), GREEN);
        }
        canvas
    }
}

/// The tone-mapped map with one pixel of the PNG file for each pixel of the map: columns are azimuth, rows
/// are polar angle.
///
/// # Errors
/// A map without pixels, or with more than a PNG file can have.
pub fn encode_map_png(map: &PolarMap) -> Result<Vec<u8>> {
    let tone = ToneCurve::for_pixels(&map.pixels);
    let bytes: Vec<u8> = map.pixels.iter().flat_map(|&pixel| tone.apply(pixel)).collect();
    encode_png8(map.shape.columns(), map.shape.rows(), &bytes)
}

/// The tone-mapped map with a ring for every light, whose area is proportional to the light's share of the
/// power.
pub fn draw_map(map: &PolarMap, lights: &[Light]) -> Canvas {
    MapBackground::new(map, SIZE).draw(lights)
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightcast_core::image::PolarShape;
    use lightcast_core::math::direction;

    #[test]
    fn a_light_is_drawn_where_its_pixel_is() {
        for shape in [PolarShape::hemisphere(36, 9), PolarShape::sphere(36, 18)] {
            let view = MapView::of(shape.theta_max_rad(), SIZE);
            for (theta, phi) in [(0.3, 1.0), (1.2, 4.0), (1.5, 6.2)] {
                let (x, y) = view.position(theta / shape.theta_max_rad(), phi);
                let (t, p) = view.angles(x, y).unwrap();
                assert!((t * shape.theta_max_rad() - theta).abs() < 1e-9 && (p - phi).abs() < 1e-9);
                let light = Light {
                    id: 0,
                    direction: direction(theta, phi).as_vec3().to_array(),
                    irradiance: [1.0; 3],
                    spread_rad: 0.0,
                };
                let canvas = draw_map(&PolarMap::black(shape), &[light]);
                let on_ring = canvas.pixel((x - SIZE as f64 * FULL_RADIUS) as usize, y as usize);
                assert!(on_ring[1] > 200 && on_ring[0] < 100, "{on_ring:?}");
            }
        }
    }
}
