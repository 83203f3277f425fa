//! Exact shadows of one directional light, for tests, from the heights of all triangles along the light.

use super::light_space::twin::light_basis;
use crate::scene::{Pose, Scene};
use glam::{DVec2, DVec3, Mat3, Vec3};

/// Cells along a side of the acceleration grid.
const GRID: usize = 96;

/// The triangles of a scene as a light sees them.
pub(super) struct Sheets {
    pub basis: Mat3,
    /// Corners in light space, and whether the triangle casts shadows.
    triangles: Vec<([DVec3; 3], bool)>,
    /// Triangles that may cover each cell.
    grid: Vec<Vec<u32>>,
    low: DVec2,
    cell: DVec2,
}

impl Sheets {
    pub fn new(scene: &Scene, direction: Vec3) -> Self {
        let basis = light_basis(direction);
        let mut pose = Pose::default();
        scene.pose(0.0, &mut pose);
        let mut triangles = Vec::new();
        for (number, (instance, matrix)) in scene.instances.iter().zip(pose.world_from_mesh()).enumerate() {
            let vertices = pose.vertices_of(scene, number);
            let mesh = &scene.meshes[instance.mesh];
            for corners in mesh.indices.chunks_exact(3) {
                let corner = |index: u32| {
                    let world = matrix.transform_point3(Vec3::from(vertices[index as usize].position));
                    basis.as_dmat3().transpose() * world.as_dvec3()
                };
                triangles.push((
                    [corner(corners[0]), corner(corners[1]), corner(corners[2])],
                    instance.roles.casts,
                ));
            }
        }
        let corners = || triangles.iter().flat_map(|(corners, _)| corners);
        let low = corners().fold(DVec2::INFINITY, |low, corner| low.min(corner.truncate()));
        let high = corners().fold(DVec2::NEG_INFINITY, |high, corner| high.max(corner.truncate()));
        let cell = ((high - low) / GRID as f64).max(DVec2::splat(1e-9));
        let mut sheets =
            Self { basis, triangles: Vec::new(), grid: vec![Vec::new(); GRID * GRID], low, cell };
        for (number, (corners, _)) in triangles.iter().enumerate() {
            let place = corners.map(|corner| (corner.truncate() - low) / cell);
            let first = place[0].min(place[1]).min(place[2]) - 1e-6;
            let last = place[0].max(place[1]).max(place[2]) + 1e-6;
            for row in first.y as usize..=(last.y as usize).min(GRID - 1) {
                for column in first.x as usize..=(last.x as usize).min(GRID - 1) {
                    sheets.grid[row * GRID + column].push(number as u32);
                }
            }
        }
        sheets.triangles = triangles;
        sheets
    }

    /// Whether the surface nearest to `height` at a position across the light is lit; `None` where there is
    /// no surface.
    pub fn is_lit(&self, across: DVec2, height: f64) -> Option<bool> {
        let place = (across - self.low) / self.cell;
        if place.cmplt(DVec2::ZERO).any() || place.cmpge(DVec2::splat(GRID as f64)).any() {
            return None;
        }
        let cell = &self.grid[place.y as usize * GRID + place.x as usize];
        let (mut nearest, mut top) = (f64::INFINITY, f64::NEG_INFINITY);
        for &number in cell {
            let (corners, casts) = &self.triangles[number as usize];
            if let Some(found) = height_of(corners, across) {
                if (found - height).abs() < (nearest - height).abs() {
                    nearest = found;
                }
                if *casts {
                    top = top.max(found);
                }
            }
        }
        // Triangles that share an edge differ there by rounding errors.
        nearest.is_finite().then_some(top <= nearest + 1e-6)
    }
}

/// Height of a triangle at a position that it covers.
fn height_of(corners: &[DVec3; 3], across: DVec2) -> Option<f64> {
    let [a, b, c] = corners;
    let (p, q, r) = (b.truncate() - a.truncate(), c.truncate() - a.truncate(), across - a.truncate());
    let area = p.perp_dot(q);
    if area.abs() < 1e-14 {
        return None; // seen edge-on
    }
    let (u, v) = (r.perp_dot(q) / area, p.perp_dot(r) / area);
    let inside = u >= -1e-9 && v >= -1e-9 && u + v <= 1.0 + 1e-9;
    inside.then_some(a.z + u * (b.z - a.z) + v * (c.z - a.z))
}
