//! The orientation of a camera in the world, from marks: pixels whose world directions are known (stars, the
//! Moon, surveyed lamps).
//!
//! With two or more marks, the rotation is the one that minimises the sum of squared distances between the
//! rotated rays and the directions (Wahba 1965), found as the eigenvector of Davenport's symmetric 4 x 4
//! matrix (the q-method; Markley and Mortari 2000, equations 9 to 13).

use crate::error::{Error, Result};
use glam::{DMat3, DQuat, DVec2, DVec3};
use lightcast_core::camera::Lens;
use lightcast_core::math::angle_between;
use nalgebra::Matrix4;

/// A pixel whose world direction is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mark {
    /// Position in the frame, half-pixel centres.
    pub pixel: DVec2,
    /// World direction, of any positive length.
    pub direction_world: DVec3,
}

/// The orientation of a camera, and how well the marks agree.
#[derive(Clone, Debug, PartialEq)]
pub struct Orientation {
    /// Rotation from camera to world axes.
    pub world_from_camera: DMat3,
    /// Angle between the rotated ray and the direction of every mark, in the marks' order.
    pub residuals_rad: Vec<f64>,
}

/// Marks closer together than this leave the rotation about them undetermined: an error of a tenth of a pixel
/// at ten pixels per degree would become half a degree.
const LEAST_SEPARATION_RAD: f64 = std::f64::consts::PI / 180.0;

/// The rotation that takes the rays of `marks` to their directions.
///
/// One mark leaves the rotation about it undetermined. `prior` then gives the assumed orientation; its tilt
/// is trusted, its azimuth is not: the camera is first rotated about the vertical (+Y) until the ray has the
/// azimuth of the direction, then tilted by the smallest angle that makes them coincide. This suffices for a
/// camera that was levelled. A vertical ray or direction has no azimuth; the camera is then only tilted. With
/// more marks `prior` is not used.
///
/// # Errors
/// `Usage`, naming the mark: none at all, a pixel outside the lens's field of view, a direction of zero
/// length or not finite, and several marks that all lie within a degree of one line through the camera, in
/// the picture or in the world.
pub fn fit_orientation(lens: &Lens, marks: &[Mark], prior: DMat3) -> Result<Orientation> {
    let mut rays = Vec::with_capacity(marks.len());
    let mut directions = Vec::with_capacity(marks.len());
    for (index, mark) in marks.iter().enumerate() {
        let fault = |message: String| Error::usage(message).at(format_args!("mark {}", index + 1));
        rays.push(lens.unproject(mark.pixel).ok_or_else(|| {
            fault(format!(
                "pixel {} lies outside the lens's field of view of {:.1} degrees",
                mark.pixel,
                2.0 * lens.theta_max_rad().to_degrees()
            ))
        })?);
        let direction = mark.direction_world.try_normalize();
        directions.push(direction.ok_or_else(|| {
            fault(format!("direction {}: must be finite and not zero", mark.direction_world))
        })?);
    }
    let world_from_camera = match rays[..] {
        [] => return Err(Error::usage("marks: there are none; give at least one")),
        [ray] => turn_then_tilt(prior, ray, directions[0]),
        _ => {
            for (place, vectors) in [("in the picture", &rays), ("in the world", &directions)] {
                if !vectors.iter().any(|v| v.cross(vectors[0]).length() >= LEAST_SEPARATION_RAD.sin()) {
                    return Err(Error::usage(format!(
                        "marks: all lie within a degree of one line {place}, which leaves the turn about it open; \
                         give one farther away, or one mark only"
                    )));
                }
            }
            wahba(&rays, &directions)
        }
    };
    let residuals_rad =
        rays.iter().zip(&directions).map(|(&ray, &d)| angle_between(world_from_camera * ray, d)).collect();
    Ok(Orientation { world_from_camera, residuals_rad })
}

fn turn_then_tilt(prior: DMat3, ray_camera: DVec3, direction: DVec3) -> DMat3 {
    let ray = prior * ray_camera;
    let has_azimuth = |v: DVec3| v.x.hypot(v.z) > 1e-9;
    let turn_rad = if has_azimuth(ray) && has_azimuth(direction) {
        direction.z.atan2(direction.x) - ray.z.atan2(ray.x)
    } else {
        0.0
    };
    // Azimuth increases from +X to +Z, opposite to the right-handed sense about +Y.
    let turned = DQuat::from_rotation_y(-turn_rad) * DQuat::from_mat3(&prior);
    let tilted = DQuat::from_rotation_arc((turned * ray_camera).normalize_or(DVec3::Y), direction) * turned;
    DMat3::from_quat(tilted.normalize())
}

/// The rotation given by the eigenvector of the largest eigenvalue of Davenport's matrix of pairs of unit
/// vectors.
fn wahba(rays: &[DVec3], directions: &[DVec3]) -> DMat3 {
    // Attitude profile matrix B, the sum of direction times ray transposed; b[column][row].
    let mut b = [[0.0; 3]; 3];
    for (ray, direction) in rays.iter().zip(directions) {
        for column in 0..3 {
            for row in 0..3 {
                b[column][row] += direction[row] * ray[column];
            }
        }
    }
    let trace = b[0][0] + b[1][1] + b[2][2];
    let mut k = [[0.0; 4]; 4];
    for i in 0..3 {
        for j in 0..3 {
            k[i][j] = b[i][j] + b[j][i] - if i == j { trace } else { 0.0 };
        }
        // z = sum of ray x direction.
        let (next, after) = ((i + 1) % 3, (i + 2) % 3);
        k[i][3] = b[next][after] - b[after][next];
        k[3][i] = k[i][3];
    }
    k[3][3] = trace;
    let eigen = Matrix4::from(k).symmetric_eigen();
    let largest = eigen.eigenvectors.column(eigen.eigenvalues.imax());
    DMat3::from_quat(DQuat::from_xyzw(largest[0], largest[1], largest[2], largest[3]).normalize())
}

#[cfg(test)]
mod tests {
    use super::*;
    use lightcast_core::camera::{LOOKING_UP, LensParameters};
    use lightcast_core::math::{direction, polar};

    fn lens() -> Lens {
        Lens::new(LensParameters {
            width: 256,
            height: 256,
            fx: 78.0,
            fy: 78.0,
            cx: 128.0,
            cy: 128.0,
            k: [0.01, 0.0, 0.0, 0.0],
            field_of_view_rad: 3.1,
        })
        .unwrap()
    }

    fn marks(pixels: &[(f64, f64)], world_from_camera: DMat3) -> Vec<Mark> {
        let mark = |&(x, y): &(f64, f64)| {
            let pixel = DVec2::new(x, y);
            Mark { pixel, direction_world: world_from_camera * lens().unproject(pixel).unwrap() }
        };
        pixels.iter().map(mark).collect()
    }

    fn turn(axis: DVec3, angle_rad: f64) -> DMat3 {
        DMat3::from_axis_angle(axis.normalize_or(DVec3::X), angle_rad)
    }

    fn distance(a: DMat3, b: DMat3) -> f64 {
        (0..3).map(|i| (a.col(i) - b.col(i)).length()).fold(0.0, f64::max)
    }

    #[test]
    fn two_marks_and_more_give_the_rotation_back() {
        let rotations = [
            DMat3::IDENTITY,
            LOOKING_UP,
            turn(DVec3::new(1.0, 2.0, -3.0), 2.9),
            // Half turns, where the quaternion's scalar is 0.
            turn(DVec3::X, std::f64::consts::PI),
            turn(DVec3::new(1.0, 1.0, 0.0), std::f64::consts::PI),
        ];
        for rotation in rotations {
            for pixels in
                [&[(30.0, 128.0), (200.0, 90.0)][..], &[(60.0, 60.0), (61.0, 200.0), (128.0, 128.0)]]
            {
                let found = fit_orientation(&lens(), &marks(pixels, rotation), DMat3::IDENTITY).unwrap();
                let off = distance(found.world_from_camera, rotation);
                assert!(off < 1e-12, "{rotation}: {off:e}");
                assert!(found.residuals_rad.iter().all(|&angle| angle < 1e-12));
            }
        }
    }

    #[test]
    fn two_marks_that_disagree_share_the_residual() {
        // The rays are an angle a apart, the directions a + 2 d in the same plane: the best rotation leaves a
        // residual of d at each.
        let mut two = marks(&[(98.0, 128.0), (158.0, 128.0)], DMat3::IDENTITY);
        let d = 0.01;
        two[0].direction_world = turn(DVec3::NEG_Y, d) * two[0].direction_world;
        two[1].direction_world = turn(DVec3::Y, d) * two[1].direction_world;
        let found = fit_orientation(&lens(), &two, DMat3::IDENTITY).unwrap();
        assert!(distance(found.world_from_camera, DMat3::IDENTITY) < 1e-12, "{}", found.world_from_camera);
        for residual in found.residuals_rad {
            assert!((residual - d).abs() < 1e-12, "{residual}");
        }
    }

    #[test]
    fn no_small_turn_of_the_result_fits_noisy_marks_better() {
        let rotation = turn(DVec3::new(0.3, -1.0, 0.5), 1.2);
        let mut noisy = marks(&[(40.0, 50.0), (200.0, 60.0), (150.0, 210.0), (90.0, 130.0)], rotation);
        for (index, mark) in noisy.iter_mut().enumerate() {
            mark.direction_world = turn(DVec3::new(1.0, index as f64, -0.5), 0.02) * mark.direction_world;
        }
        let found = fit_orientation(&lens(), &noisy, DMat3::IDENTITY).unwrap().world_from_camera;
        let cost = |rotation: DMat3| -> f64 {
            let off = |mark: &Mark| rotation * lens().unproject(mark.pixel).unwrap() - mark.direction_world;
            noisy.iter().map(|mark| off(mark).length_squared()).sum()
        };
        for axis in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y, DVec3::NEG_Z] {
            assert!(cost(turn(axis, 1e-4) * found) > cost(found), "{axis}");
        }
    }

    #[test]
    fn one_mark_turns_about_the_vertical_first_and_tilts_by_what_is_left() {
        let pixel = DVec2::new(210.0, 150.0);
        let (theta, phi) = polar(LOOKING_UP * lens().unproject(pixel).unwrap());
        let (tilt, azimuth) = (0.02, 1.9);
        let mark = Mark { pixel, direction_world: 3.0 * direction(theta + tilt, phi + azimuth) };
        let found = fit_orientation(&lens(), &[mark], LOOKING_UP).unwrap();
        assert!(found.residuals_rad[0] < 1e-12);
        let axis = found.world_from_camera * DVec3::Z;
        assert!((angle_between(axis, DVec3::Y) - tilt).abs() < 1e-12, "{axis}");
        let across = angle_between(axis.with_y(0.0), direction(1.0, phi + azimuth).with_y(0.0));
        assert!(across < 1e-9, "the axis tilts towards the mark: {across}");
    }

    #[test]
    fn a_mark_overhead_only_tilts() {
        let mark = Mark { pixel: DVec2::new(140.0, 128.0), direction_world: DVec3::Y };
        let found = fit_orientation(&lens(), &[mark], LOOKING_UP).unwrap().world_from_camera;
        let ray = LOOKING_UP * lens().unproject(mark.pixel).unwrap();
        let expected = DMat3::from_quat(DQuat::from_rotation_arc(ray, DVec3::Y)) * LOOKING_UP;
        assert!(distance(found, expected) < 1e-12);
    }

    #[test]
    fn marks_that_say_too_little_are_refused_by_name() {
        let good = marks(&[(30.0, 128.0), (200.0, 90.0)], LOOKING_UP);
        let with = |change: fn(&mut Mark)| {
            let mut changed = good.clone();
            change(&mut changed[1]);
            changed
        };
        for (marks, words) in [
            (Vec::new(), "there are none"),
            (with(|mark| mark.pixel.x = 400.0), "mark 2: pixel [400, 90] lies outside"),
            (with(|mark| mark.pixel.x = f64::NAN), "mark 2: pixel"),
            (with(|mark| mark.direction_world = DVec3::ZERO), "mark 2: direction"),
            (with(|mark| mark.direction_world.y = f64::INFINITY), "mark 2: direction"),
            (with(|mark| mark.pixel = DVec2::new(30.0, 128.5)), "one line in the picture"),
            (vec![good[0], Mark { direction_world: -good[0].direction_world, ..good[1] }], "in the world"),
        ] {
            let message = fit_orientation(&lens(), &marks, LOOKING_UP).unwrap_err().to_string();
            assert!(message.contains(words), "{words}: {message}");
        }
    }
}
