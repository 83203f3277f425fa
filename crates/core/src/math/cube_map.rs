//! The cells of a cube map: a table over all directions that a few comparisons and one division address.
//!
//! Faces, their order and their axes are those of Vulkan and WebGPU (Vulkan specification, "Cube Map Face
//! Selection"):
//!
//! | face | 0 (+X) | 1 (-X) | 2 (+Y) | 3 (-Y) | 4 (+Z) | 5 (-Z) |
//! |---|---|---|---|---|---|---|
//! | a | -z | +z | +x | +x | +x | -x |
//! | b | -y | -y | +z | -z | -y | -y |
//!
//! The face is that of the coordinate m of largest magnitude; of equal ones z goes before y, and y before x.
//! A face has `side` x `side` cells of equal width in `a / |m|` and `b / |m|`, from -1 to 1: columns along a,
//! rows along b. The cell in `row` and `column` of `face` has the index `(face side + row) side + column`.

use glam::DVec3;

/// Coordinates of largest magnitude below this count as this: a vector that is zero has a cell too.
const LEAST_MAJOR: f32 = 1e-30;

/// Index of the cell that holds a vector of any length, in a cube map of `side` x `side` cells a face (`side`
/// at least 1): below `6 side^2` for every input.
///
/// The zero vector lies in the middle of face 4 (+Z), in row and column `side / 2`. Vectors with a coordinate
/// that is infinite or NaN have some cell, always the same one on the CPU. Rounding puts a direction outside
/// its cell by at most 5e-7 rad, also where a GPU divides to 2.5 units in the last place. Shaders repeat this
/// function line by line.
#[inline]
pub fn cube_cell(direction: [f32; 3], side: u32) -> u32 {
    let [x, y, z] = direction;
    let (face, m, a, b) = if z.abs() >= x.abs() && z.abs() >= y.abs() {
        if z < 0.0 { (5, z.abs(), -x, -y) } else { (4, z.abs(), x, -y) }
    } else if y.abs() >= x.abs() {
        if y < 0.0 { (3, y.abs(), x, -z) } else { (2, y.abs(), x, z) }
    } else if x < 0.0 {
        (1, x.abs(), z, -y)
    } else {
        (0, x.abs(), -z, -y)
    };
    let half = 0.5 * side as f32;
    let scale = half / m.max(LEAST_MAJOR);
    // Conversion rounds towards 0 and saturates; NaN becomes 0.
    let column = ((half + a * scale) as u32).min(side - 1);
    let row = ((half + b * scale) as u32).min(side - 1);
    (face * side + row) * side + column
}

/// Unit vector to a point on a face: `column` and `row` in [0, side], whole numbers on the borders of cells.
pub fn cube_direction(face: u32, row: f64, column: f64, side: u32) -> DVec3 {
    let [a, b] = [column, row].map(|place| 2.0 * place / f64::from(side) - 1.0);
    let v = match face {
        0 => DVec3::new(1.0, -b, -a),
        1 => DVec3::new(-1.0, -b, a),
        2 => DVec3::new(a, 1.0, b),
        3 => DVec3::new(a, -1.0, -b),
        4 => DVec3::new(a, -b, 1.0),
        _ => DVec3::new(-a, -b, -1.0),
    };
    v / v.length() // at least 1
}

/// Solid angle in steradians of a cell in `row` and `column` of any face.
pub fn cube_cell_solid_angle(row: u32, column: u32, side: u32) -> f64 {
    // Solid angle of the rectangle from the middle of the face to (a, b), with its sign.
    let corner = |row: u32, column: u32| {
        let [a, b] = [column, row].map(|place| 2.0 * f64::from(place) / f64::from(side) - 1.0);
        (a * b).atan2((a * a + b * b + 1.0).sqrt())
    };
    corner(row + 1, column + 1) - corner(row, column + 1) - corner(row + 1, column) + corner(row, column)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{angle_between, fibonacci_sphere};
    use std::f64::consts::PI;

    #[test]
    fn faces_and_axes_are_those_of_vulkan() {
        // A vector a little off the middle of its face, towards growing a by 0.6 and growing b by 0.1; of 4 x
        // 4 cells that is column 3, row 2.
        for (face, v) in [
            [1.0, -0.1, -0.6],
            [-1.0, -0.1, 0.6],
            [0.6, 1.0, 0.1],
            [0.6, -1.0, -0.1],
            [0.6, -0.1, 1.0],
            [-0.6, -0.1, -1.0],
        ]
        .into_iter()
        .enumerate()
        {
            assert_eq!(cube_cell(v, 4) as usize, (face * 4 + 2) * 4 + 3, "{v:?}");
        }
    }

    #[test]
    fn ties_go_to_z_and_then_to_y() {
        assert_eq!(cube_cell([1.0, 1.0, 1.0], 1), 4);
        assert_eq!(cube_cell([-1.0, 0.5, -1.0], 1), 5);
        assert_eq!(cube_cell([1.0, -1.0, 0.5], 1), 3);
        assert_eq!(cube_cell([1.0, -0.9, 0.5], 1), 0);
    }

    #[test]
    fn every_cell_holds_its_own_middle_and_every_direction_lies_in_its_cell() {
        for side in [1, 2, 5, 48] {
            let mut index = 0;
            for face in 0..6 {
                for row in 0..side {
                    for column in 0..side {
                        let middle =
                            cube_direction(face, f64::from(row) + 0.5, f64::from(column) + 0.5, side);
                        for length in [1.0, 1e-20, 1e20] {
                            assert_eq!(cube_cell((middle * length).as_vec3().to_array(), side), index);
                        }
                        index += 1;
                    }
                }
            }
            for d in fibonacci_sphere(20_000) {
                let cell = cube_cell(d.as_vec3().to_array(), side);
                let (face, row, column) = (cell / (side * side), cell / side % side, cell % side);
                let middle = cube_direction(face, f64::from(row) + 0.5, f64::from(column) + 0.5, side);
                // In the plane of its face the direction is within half a cell of the middle.
                let axis = cube_direction(face, 0.5 * f64::from(side), 0.5 * f64::from(side), side);
                let apart = d / d.dot(axis) - middle / middle.dot(axis);
                assert!(apart.abs().max_element() <= (1.0 + 1e-5) / f64::from(side), "{d} {cell}");
                assert!(angle_between(d, middle) < 1.5 / f64::from(side));
            }
        }
    }

    #[test]
    fn solid_angles_add_up_to_the_sphere_and_shrink_towards_the_corner() {
        for side in [1, 2, 7, 48] {
            let cells = (0..side).flat_map(|row| (0..side).map(move |column| (row, column)));
            let face: f64 = cells.map(|(row, column)| cube_cell_solid_angle(row, column, side)).sum();
            assert!((6.0 * face / (4.0 * PI) - 1.0).abs() < 1e-13, "{side}: {face}");
        }
        // A small cell: its area over the cube of the distance of its middle.
        let ratio = cube_cell_solid_angle(500, 500, 1000) / cube_cell_solid_angle(0, 999, 1000);
        assert!((ratio / (1.0 + 2.0 * 0.999f64.powi(2)).powf(1.5) - 1.0).abs() < 1e-5, "{ratio}");
    }

    #[test]
    fn every_input_has_a_cell_of_the_table() {
        assert_eq!(cube_cell([0.0; 3], 32), (4 * 32 + 16) * 32 + 16);
        assert_eq!(cube_cell([-0.0; 3], 32), (4 * 32 + 16) * 32 + 16);
        let values = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            1e-40,
            -1e-40,
            f32::MAX,
            f32::MIN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::NAN,
        ];
        for side in [1, 3, 32] {
            for x in values {
                for y in values {
                    for z in values {
                        assert!(cube_cell([x, y, z], side) < 6 * side * side, "{x} {y} {z}");
                    }
                }
            }
        }
    }
}
