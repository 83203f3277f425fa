//! Kannala-Brandt 2004 fisheye lens, METHODS section 3 (the form of OpenCV `fisheye` and Kalibr
//! `equidistant`).
//!
//! `pixel = (cx + fx r(theta) cos psi, cy + fy r(theta) sin psi)` with theta the angle from the optical axis
//! and psi the angle about it, from +X (right) towards +Y (down). Pixel coordinates have half-pixel centres:
//! the centre of the first pixel is (0.5, 0.5).

use super::radial_polynomial::RadialPolynomial;
use crate::error::{Error, Result};
use glam::{DVec2, DVec3};
use std::f64::consts::{PI, TAU};

/// Parameters of a lens, as a calibration file gives them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LensParameters {
    /// Columns of the image.
    pub width: usize,
    /// Rows of the image.
    pub height: usize,
    /// Focal length along x in pixels per radian at the axis.
    pub fx: f64,
    /// The same along y.
    pub fy: f64,
    /// Principal point in pixels, half-pixel centres (OpenCV's cx + 0.5).
    pub cx: f64,
    /// The same along y.
    pub cy: f64,
    /// k1 to k4.
    pub k: [f64; 4],
    /// Full opening angle: rays up to half of it from the axis are seen. In (0, 2 pi].
    pub field_of_view_rad: f64,
}

impl LensParameters {
    /// The field of view of a calibration that declares none, in radians (full angle), and in words what
    /// limits it: the angle at which r stops increasing, or the farthest corner of the image, whichever comes
    /// first, so that no pixel of the image is cut off; at most the full sphere. [`Self::field_of_view_rad`]
    /// is ignored.
    pub fn default_field_of_view(&self) -> (f64, &'static str) {
        let polynomial = RadialPolynomial { k: self.k };
        let turning_rad = polynomial.turning_angle_rad();
        // A millionth of a radian from the turning angle: closer to it the inverse loses its accuracy of 1e-9
        // rad.
        let limit_rad = turning_rad.map_or(PI, |turn_rad| turn_rad - 1e-6);
        let (width, height) = (self.width as f64, self.height as f64);
        let corner_radius = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)]
            .map(|(x, y)| ((x - self.cx) / self.fx).hypot((y - self.cy) / self.fy))
            .into_iter()
            .fold(0.0, f64::max);
        if corner_radius < polynomial.radius(limit_rad) {
            let theta_rad = polynomial.invert(corner_radius, limit_rad, 0.5 * limit_rad);
            (2.0 * theta_rad, "to the farthest corner of the image")
        } else if turning_rad.is_some() {
            (2.0 * limit_rad, "to the angle at which r(theta) stops increasing")
        } else {
            (2.0 * limit_rad, "the whole sphere")
        }
    }
}

/// A lens whose parameters were checked: r increases over the whole field of view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens {
    parameters: LensParameters,
    polynomial: RadialPolynomial,
    theta_max_rad: f64,
    radius_max: f64,
}

/// Limits beyond which a number in a file is a mistake and not a lens. 65,535 columns keep a column number in
/// 16 bits and are three times what sensors have.
const SIZE_MAX_PX: usize = 65_535;
const FOCAL_MAX_PX: f64 = 1e6;
const COEFFICIENT_MAX: f64 = 1e3;

impl Lens {
    /// Checks the parameters.
    ///
    /// # Errors
    /// `Usage`, naming the parameter as calibration files do: a size of 0 or over 65,535, a focal length that
    /// is not positive, anything that is not finite or beyond what a lens can have, and coefficients with
    /// which r stops increasing inside the field of view, with the angle.
    pub fn new(parameters: LensParameters) -> Result<Self> {
        let LensParameters { width, height, fx, fy, cx, cy, k, field_of_view_rad } = parameters;
        for (name, value) in [("width", width), ("height", height)] {
            if !(1..=SIZE_MAX_PX).contains(&value) {
                return Err(
                    Error::usage(format!("must be 1 to {SIZE_MAX_PX} pixels")).in_option(name, Some(&value))
                );
            }
        }
        for (name, value) in [("fx", fx), ("fy", fy)] {
            if !(value > 0.0 && value <= FOCAL_MAX_PX) {
                return Err(Error::usage(format!("must be positive, at most {FOCAL_MAX_PX} pixels"))
                    .in_option(name, Some(&value)));
            }
        }
        for (name, value) in [("cx", cx), ("cy", cy)] {
            if value.is_nan() || value.abs() > FOCAL_MAX_PX {
                return Err(Error::usage(format!("must be finite, at most {FOCAL_MAX_PX} pixels"))
                    .in_option(name, Some(&value)));
            }
        }
        for (index, value) in k.into_iter().enumerate() {
            if value.is_nan() || value.abs() > COEFFICIENT_MAX {
                return Err(Error::usage(format!("must be finite, at most {COEFFICIENT_MAX}"))
                    .in_option(&format!("k[{index}]"), Some(&value)));
            }
        }
        let field_of_view_deg = field_of_view_rad.to_degrees();
        // Degrees to radians may round 360 degrees just past the full turn.
        if !(field_of_view_rad > 0.0 && field_of_view_rad <= TAU + 1e-12) {
            return Err(Error::usage("must be over 0, at most 360")
                .in_option("field_of_view_deg", Some(&field_of_view_deg)));
        }
        let polynomial = RadialPolynomial { k };
        let theta_max_rad = (0.5 * field_of_view_rad).min(PI);
        if let Some(turn_rad) = polynomial.turning_angle_rad()
            && turn_rad <= theta_max_rad
        {
            return Err(Error::usage(format!(
                "the coefficients k {k:?} turn at {:.3} degrees from the axis: beyond it r(theta) no longer \
                 increases; declare less than {:.3} degrees or calibrate again with marks nearer to the rim",
                turn_rad.to_degrees(),
                2.0 * turn_rad.to_degrees(),
            ))
            .in_option("field_of_view_deg", Some(&field_of_view_deg)));
        }
        let radius_max = polynomial.radius(theta_max_rad);
        Ok(Self { parameters, polynomial, theta_max_rad, radius_max })
    }

    /// The parameters it was made from.
    pub fn parameters(&self) -> &LensParameters {
        &self.parameters
    }

    /// Largest angle from the axis, half the field of view.
    pub fn theta_max_rad(&self) -> f64 {
        self.theta_max_rad
    }

    /// Pixel (half-pixel centres) of a direction of any positive length in the camera frame: +Z the axis, +X
    /// right, +Y down. `None` outside the field of view and for the zero vector; the pixel may lie outside
    /// the image. The direction opposite to the axis, where psi is undefined, goes to psi = 0.
    pub fn project(&self, direction_camera: DVec3) -> Option<DVec2> {
        let across = direction_camera.x.hypot(direction_camera.y);
        let theta_rad = across.atan2(direction_camera.z);
        if direction_camera == DVec3::ZERO || theta_rad.is_nan() || theta_rad > self.theta_max_rad {
            return None;
        }
        let psi = if across > 0.0 { direction_camera.truncate() / across } else { DVec2::X };
        Some(self.pixel(psi * self.polynomial.radius(theta_rad)))
    }

    /// Unit direction in the camera frame of a pixel position (half-pixel centres), which may lie outside the
    /// image. `None` outside the field of view.
    pub fn unproject(&self, pixel: DVec2) -> Option<DVec3> {
        let m = self.normalized(pixel);
        // What `project` gives for the rim itself may be rounded a few units beyond it.
        (m.length() <= self.radius_max * (1.0 + 1e-12))
            .then(|| self.unproject_normalized(m, &mut (0.5 * self.theta_max_rad)))
    }

    /// Position about the principal point in focal lengths: the plane in which the rim is a circle of radius
    /// [`Self::radius_max`].
    pub(super) fn normalized(&self, pixel: DVec2) -> DVec2 {
        let p = &self.parameters;
        DVec2::new((pixel.x - p.cx) / p.fx, (pixel.y - p.cy) / p.fy)
    }

    /// The inverse of [`Self::normalized`].
    pub(super) fn pixel(&self, normalized: DVec2) -> DVec2 {
        let p = &self.parameters;
        DVec2::new(p.cx + p.fx * normalized.x, p.cy + p.fy * normalized.y)
    }

    pub(super) fn radius_max(&self) -> f64 {
        self.radius_max
    }

    /// Unit direction of a position in the normalised plane; radii beyond the rim count as the rim. Newton's
    /// method starts from `theta_rad`, which becomes the angle found: from one neighbour to the next it takes
    /// two steps.
    pub(super) fn unproject_normalized(&self, normalized: DVec2, theta_rad: &mut f64) -> DVec3 {
        let radius = normalized.length();
        *theta_rad = if radius >= self.radius_max {
            self.theta_max_rad
        } else {
            self.polynomial.invert(radius, self.theta_max_rad, *theta_rad)
        };
        let (sin_theta, cos_theta) = theta_rad.sin_cos();
        let across = if radius > 0.0 { normalized * (sin_theta / radius) } else { DVec2::ZERO };
        across.extend(cos_theta)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::angle_between;
    use crate::test_data::real_folder;

    pub(crate) fn equidistant(width: usize, height: usize, field_of_view_deg: f64) -> LensParameters {
        let f = 0.5 * width.min(height) as f64 / (0.5 * field_of_view_deg).to_radians();
        LensParameters {
            width,
            height,
            fx: f,
            fy: f,
            cx: 0.5 * width as f64,
            cy: 0.5 * height as f64,
            k: [0.0; 4],
            field_of_view_rad: field_of_view_deg.to_radians(),
        }
    }

    fn round_trip(lens: &Lens) -> f64 {
        let mut worst: f64 = 0.0;
        for step in 0..=400 {
            let theta = lens.theta_max_rad() * f64::from(step) / 400.0;
            for psi in 0..16 {
                let psi = TAU * (f64::from(psi) + 0.3) / 16.0;
                let ray = DVec3::new(theta.sin() * psi.cos(), theta.sin() * psi.sin(), theta.cos());
                // Rounding of the ray may put the last one beyond the rim.
                let Some(pixel) = lens.project(ray) else {
                    assert_eq!(step, 400);
                    continue;
                };
                worst = worst.max(angle_between(lens.unproject(pixel).unwrap(), ray));
            }
        }
        worst
    }

    #[test]
    fn lens_of_220_degrees_round_trips() {
        let mut parameters = equidistant(1024, 1024, 220.0);
        parameters.k = [0.02, -0.004, 0.0008, -0.00003];
        let lens = Lens::new(parameters).unwrap();
        let worst = round_trip(&lens);
        assert!(worst < 1e-9, "{worst:e}");
        let behind = lens.unproject(lens.project(DVec3::new(0.9, 0.0, -0.3)).unwrap()).unwrap();
        assert!(behind.z < 0.0);
        assert!(lens.project(DVec3::NEG_Z).is_none());
        assert!(lens.project(DVec3::ZERO).is_none());
        assert!(lens.project(DVec3::splat(f64::NAN)).is_none());
        assert!(lens.unproject(DVec2::new(-1e4, 0.0)).is_none());
        assert_eq!(lens.unproject(DVec2::new(512.0, 512.0)).unwrap(), DVec3::Z);
    }

    #[test]
    fn lens_of_the_whole_sphere_and_one_close_to_its_turn_round_trip() {
        let full = Lens::new(equidistant(512, 512, 360.0)).unwrap();
        assert!(round_trip(&full) < 1e-9);
        let mut turning = equidistant(512, 512, 180.0);
        turning.k = [-0.1, 0.0, 0.0, 0.0];
        turning.field_of_view_rad = LensParameters { width: 4000, ..turning }.default_field_of_view().0;
        let worst = round_trip(&Lens::new(turning).unwrap());
        assert!(worst < 1e-9, "{worst:e}");
    }

    #[test]
    fn turning_coefficients_are_refused_with_the_angle() {
        // r' = 1 - 0.3 theta^2 = 0 at sqrt(10 / 3) rad = 104.607 degrees.
        let mut parameters = equidistant(512, 512, 220.0);
        parameters.k = [-0.1, 0.0, 0.0, 0.0];
        let error = Lens::new(parameters).unwrap_err();
        assert_eq!(error.option(), Some("field_of_view_deg"));
        assert!(error.message().contains("104.607 degrees"), "{error}");
        parameters.field_of_view_rad = 200f64.to_radians();
        assert!(Lens::new(parameters).is_ok());
    }

    #[test]
    fn absurd_parameters_are_refused_by_name() {
        let good = equidistant(512, 512, 180.0);
        let cases = [
            (LensParameters { width: 0, ..good }, "width"),
            (LensParameters { height: 70_000, ..good }, "height"),
            (LensParameters { fx: 0.0, ..good }, "fx"),
            (LensParameters { fy: f64::NAN, ..good }, "fy"),
            (LensParameters { cx: f64::INFINITY, ..good }, "cx"),
            (LensParameters { cy: -1e9, ..good }, "cy"),
            (LensParameters { k: [0.0, 0.0, f64::NAN, 0.0], ..good }, "k[2]"),
            (LensParameters { field_of_view_rad: 7.0, ..good }, "field_of_view_deg"),
            (LensParameters { field_of_view_rad: 0.0, ..good }, "field_of_view_deg"),
        ];
        for (parameters, name) in cases {
            let error = Lens::new(parameters).unwrap_err();
            assert_eq!(error.option(), Some(name), "{error}");
            assert!(error.value().is_some(), "{error}");
        }
    }

    #[test]
    fn default_field_of_view_reaches_the_farthest_corner_or_the_turn() {
        let parameters = equidistant(512, 512, 180.0);
        let expected = 2.0 * 2f64.sqrt() * PI / 2.0;
        assert!((parameters.default_field_of_view().0 - expected).abs() < 1e-12);
        let turning = LensParameters { k: [-0.3, 0.0, 0.0, 0.0], ..parameters };
        let turn = (1.0f64 / 0.9).sqrt();
        assert!((turning.default_field_of_view().0 - 2.0 * turn).abs() < 1e-5);
        let huge = LensParameters { width: 4096, ..parameters };
        assert!((huge.default_field_of_view().0 - TAU).abs() < 1e-12);
    }

    #[test]
    fn published_directions_project_within_1e_9_px_and_back_within_1e_9_rad() {
        let Some(folder) = real_folder("calib") else { return };
        let text = std::fs::read_to_string(folder.join("kb_vectors.csv")).unwrap();
        let cameras: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(folder.join("kb_cameras.json")).unwrap()).unwrap();
        let (mut worst_px, mut worst_rad, mut count): (f64, f64, usize) = (0.0, 0.0, 0);
        for line in text.lines().skip(1) {
            let fields: Vec<&str> = line.split(',').collect();
            let camera = &cameras[fields[0]];
            let number = |key: &str| camera[key].as_f64().unwrap();
            let lens = Lens::new(LensParameters {
                width: number("width") as usize,
                height: number("height") as usize,
                fx: number("fx"),
                fy: number("fy"),
                cx: number("cx") + 0.5,
                cy: number("cy") + 0.5,
                k: std::array::from_fn(|i| camera["k"][i].as_f64().unwrap()),
                // In the file the angle at which r stops increasing is rounded up to a step of the search for
                // it.
                field_of_view_rad: 2.0 * (number("theta_max_monotonic_deg") - 0.01).to_radians(),
            })
            .unwrap();
            let [dx, dy, dz, u, v] = std::array::from_fn(|i| fields[3 + i].parse::<f64>().unwrap());
            let (ray, expected) = (DVec3::new(dx, dy, dz), DVec2::new(u + 0.5, v + 0.5));
            worst_px = worst_px.max((lens.project(ray).unwrap() - expected).length());
            worst_rad = worst_rad.max(angle_between(lens.unproject(expected).unwrap(), ray));
            count += 1;
        }
        println!("{count} vectors: worst projection {worst_px:.2e} px, worst direction {worst_rad:.2e} rad");
        assert_eq!(count, 252);
        assert!(worst_px < 1e-9 && worst_rad < 1e-9, "{worst_px:e} px, {worst_rad:e} rad");
    }
}
