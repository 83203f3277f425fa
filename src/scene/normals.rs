//! Normals for files that have none.

use super::Vertex;
use super::mesh::{corners, double_area};
use glam::DVec3;
use std::collections::HashMap;

/// Computes a normal for every vertex whose normal is zero or not finite, and normalises the others. Returns
/// the number of computed normals, counting only vertices that triangles use.
///
/// A computed normal is smooth: the mean of the normals of the triangles that meet in exactly this position,
/// weighted by their angles there (Thuermer and Wuethrich 1998), whether or not they share the vertex, so
/// that seams of the texture and of the material do not show. Where they cancel out (the two sides of a
/// sheet), it is the normal of the first of the vertex's own triangles; without a triangle it is +Y. Every
/// triangle must have an area.
pub(super) fn fill_normals(vertices: &mut [Vertex], indices: &[u32]) -> usize {
    let mut missing = 0;
    for vertex in vertices.iter_mut() {
        vertex.normal = unit(DVec3::from(vertex.normal.map(f64::from))).unwrap_or_default();
        missing += usize::from(vertex.normal == [0.0; 3]);
    }
    if missing == 0 {
        return 0;
    }
    // Adding zero makes -0 and 0 the same position.
    let place = |vertex: &Vertex| vertex.position.map(|x| (x + 0.0).to_bits());
    let mut sums: HashMap<[u32; 3], DVec3> = HashMap::new();
    for vertex in vertices.iter().filter(|vertex| vertex.normal == [0.0; 3]) {
        sums.insert(place(vertex), DVec3::ZERO);
    }
    for triangle in indices.as_chunks().0 {
        let points = corners(vertices, *triangle);
        let Some(normal) = double_area(points).try_normalize() else { continue };
        for i in 0..3 {
            if let Some(sum) = sums.get_mut(&place(&vertices[triangle[i] as usize])) {
                let (one, other) = (points[(i + 1) % 3] - points[i], points[(i + 2) % 3] - points[i]);
                *sum += normal * one.cross(other).length().atan2(one.dot(other));
            }
        }
    }
    let mut given = 0;
    for triangle in indices.as_chunks().0 {
        for index in triangle {
            if vertices[*index as usize].normal != [0.0; 3] {
                continue;
            }
            let sum = sums[&place(&vertices[*index as usize])];
            // Normals that cancel out leave only rounding error.
            let smooth = if sum.length() > 1e-9 { sum } else { double_area(corners(vertices, *triangle)) };
            vertices[*index as usize].normal = unit(smooth).unwrap_or([0.0, 1.0, 0.0]);
            given += 1;
        }
    }
    for vertex in vertices.iter_mut().filter(|vertex| vertex.normal == [0.0; 3]) {
        vertex.normal = [0.0, 1.0, 0.0];
    }
    given
}

/// Unshared corners with the normals of their triangles, that is, flat shading: what glTF 2.0 (section
/// 3.7.2.1) requires where a file has no normals. Every triangle must have an area.
pub(super) fn flat(vertices: &[Vertex], indices: &[u32]) -> (Vec<Vertex>, Vec<u32>) {
    let mut apart = Vec::with_capacity(indices.len());
    for triangle in indices.as_chunks().0 {
        let normal = unit(double_area(corners(vertices, *triangle))).unwrap_or([0.0, 1.0, 0.0]);
        apart.extend(triangle.map(|index| Vertex { normal, ..vertices[index as usize] }));
    }
    (apart, (0..indices.len() as u32).collect())
}

fn unit(vector: DVec3) -> Option<[f32; 3]> {
    vector.try_normalize().map(|unit| unit.as_vec3().to_array())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::mesh::drop_zero_area;
    use glam::Vec3;

    fn vertices(positions: &[[f32; 3]]) -> Vec<Vertex> {
        positions.iter().map(|&position| Vertex { position, ..Vertex::default() }).collect()
    }

    /// A unit cube with its eight corners shared; every face is cut along one diagonal.
    fn cube() -> (Vec<Vertex>, Vec<u32>) {
        let positions: Vec<[f32; 3]> =
            (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2].map(|bit| bit as f32)).collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let indices = quads.iter().flat_map(|[a, b, c, d]| [*a, *b, *c, *a, *c, *d]).collect();
        (vertices(&positions), indices)
    }

    #[test]
    fn corners_of_a_cube_point_along_its_diagonals_however_its_faces_are_cut() {
        let (mut vertices, indices) = cube();
        assert_eq!(fill_normals(&mut vertices, &indices), 8);
        for vertex in &vertices {
            // Weights by area would favour the faces that have two triangles in the corner.
            let expected = (Vec3::from(vertex.position) - 0.5) / 0.75_f32.sqrt();
            assert!(Vec3::from(vertex.normal).abs_diff_eq(expected, 1e-6), "{vertex:?}");
        }
    }

    #[test]
    fn a_seam_does_not_show_and_given_normals_stay() {
        let (vertices, indices) = cube();
        let (mut apart, count) = flat(&vertices, &indices);
        assert_eq!((apart.len(), count.len()), (36, 36));
        for triangle in apart.chunks(3) {
            let middle: Vec3 = triangle.iter().map(|v| Vec3::from(v.position)).sum::<Vec3>() / 3.0;
            let normal = Vec3::from(triangle[0].normal);
            assert!(normal.dot(middle - 0.5) > 0.49 && normal.abs().max_element() == 1.0, "{normal}");
        }
        for vertex in apart.iter_mut().skip(1) {
            vertex.normal = [0.0; 3];
        }
        let kept = apart[0].normal;
        apart[0].normal = kept.map(|x| 3.0 * x);
        apart[1].position[0] = -0.0;
        assert_eq!(fill_normals(&mut apart, &count), 35);
        assert_eq!(apart[0].normal, kept);
        for vertex in &apart[1..] {
            let expected = (Vec3::from(vertex.position) - 0.5) / 0.75_f32.sqrt();
            assert!(Vec3::from(vertex.normal).abs_diff_eq(expected, 1e-6), "{vertex:?}");
        }
    }

    #[test]
    fn sheets_with_two_sides_and_vertices_without_triangles_get_a_unit_normal() {
        let positions = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        let mut sheet = vertices(&[positions, positions, [[f32::MAX; 3]; 3]].concat());
        sheet[0].normal = [f32::NAN, 0.0, 1.0];
        assert_eq!(fill_normals(&mut sheet, &[0, 2, 1, 3, 4, 5]), 6);
        let y: Vec<f32> = sheet.iter().map(|vertex| vertex.normal[1]).collect();
        assert_eq!(y, [1.0, 1.0, 1.0, -1.0, -1.0, -1.0, 1.0, 1.0, 1.0]);
    }

    #[test]
    fn only_triangles_without_area_are_dropped() {
        let far = 1e30;
        let points = vertices(&[
            [0.1, 0.2, 0.3],
            [1.1, 0.2, 0.3],
            [3.1, 0.2, 0.3],
            [0.1, 0.2, 0.3],
            [0.1, 1e-30, 0.3],
            [far, far, -far],
        ]);
        let mut indices = vec![0, 1, 4, 0, 1, 2, 0, 3, 1, 1, 1, 1, 0, 4, 5];
        assert_eq!(drop_zero_area(&points, &mut indices), 3);
        assert_eq!(indices, [0, 1, 4, 0, 4, 5]);
    }
}
