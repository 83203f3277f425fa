//! Scenes that need no file, and the ground.

use super::{Bounds, Instance, Material, Mesh, Node, Pose, Roles, Scene, Shading, Transform, Vertex};
use glam::{Mat4, Vec3};
use std::f64::consts::TAU;

/// Albedo of the ground.
const GROUND: f32 = 0.5;

/// Width of the ground as a multiple of the width of what stands on it.
const GROUND_WIDTHS: f32 = 8.0;

/// Number of moments of the animation whose bounds together set the size of the ground.
const POSES: usize = 32;

impl Scene {
    /// The scene shown when no file is named: a torus knot (Lambertian, warm colour) beside a sphere of rough
    /// metal, on a ground plane. 8610 triangles with exact normals; units are metres, each object about 2 m
    /// high.
    pub fn built_in() -> Self {
        let warm = Material::lambert([0.75, 0.42, 0.25]);
        let metal = Material::new(Shading::MetalRough { metallic: 1.0, roughness: 0.35 }, [0.9, 0.88, 0.85]);
        let mut scene = Self::of_meshes(
            vec![torus_knot(160, 20, 0), sphere(48, 1)],
            vec![warm, metal],
            Vec::new(),
            Vec::new(),
        );
        for (number, x) in [(0, -1.25), (1, 1.25)] {
            // Each rests on the ground.
            let height = -scene.meshes[number].bounds.min.y;
            let translation = Vec3::new(x, height, 0.0);
            scene.nodes.push(Node {
                parent: Some(0),
                transform: Transform::Matrix(Mat4::from_translation(translation)),
            });
            scene.instances[number].node = number + 1;
        }
        scene.node_names = ["", "knot", "sphere"].map(str::to_owned).to_vec();
        scene.add_ground();
        scene
    }

    /// A Lambertian sphere of radius 1 around the origin, with `segments` (at least 3) steps around and half
    /// as many from pole to pole. Its normals cover all directions, which is what measurements of culling
    /// need.
    pub fn sphere_of_normals(segments: usize) -> Self {
        Self::of_meshes(
            vec![sphere(segments, 0)],
            vec![Material::lambert([GROUND; 3])],
            Vec::new(),
            Vec::new(),
        )
    }

    /// Puts a horizontal square under everything that casts shadows, for files that have no ground. It is
    /// Lambertian with albedo 0.5, lies at the lowest point of the shadow casters, and is at least eight
    /// times as wide as they are wide and at least four times as wide as they are high. In an animated scene
    /// their bounds are taken over 32 moments of the longest animation. The ground casts no shadow; its node
    /// is called `ground`. Under an empty scene it lies at height 0 and is 8 wide.
    pub fn add_ground(&mut self) {
        let mut bounds = Bounds::EMPTY;
        let mut posed = Pose::default();
        let poses = if self.is_animated() { POSES } else { 1 };
        for pose in 0..poses {
            self.pose(self.duration_s() * pose as f64 / poses as f64, &mut posed);
            bounds = bounds.union(&self.caster_bounds(&posed));
        }
        let size = 2.0 * bounds.half_extents();
        let half = 0.5 * GROUND_WIDTHS * size.x.max(size.z).max(0.5 * size.y);
        let half = if half > 0.0 { half } else { 0.5 * GROUND_WIDTHS };
        let centre = bounds.centre();
        let height = if bounds.is_empty() { 0.0 } else { bounds.min.y };
        let vertices = [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)]
            .map(|(x, z)| Vertex {
                position: [centre.x + x * half, height, centre.z + z * half],
                normal: [0.0, 1.0, 0.0],
                uv: [0.5 + 0.5 * x, 0.5 + 0.5 * z],
                colour: [1.0; 4],
            })
            .to_vec();
        self.materials.push(Material::lambert([GROUND; 3]));
        self.meshes.push(Mesh::new(vertices, vec![0, 1, 2, 0, 2, 3], self.materials.len() - 1));
        self.node_names.resize(self.nodes.len(), String::new());
        self.node_names.push("ground".to_owned());
        self.nodes.push(Node { parent: None, transform: Transform::IDENTITY });
        self.instances.push(Instance {
            mesh: self.meshes.len() - 1,
            node: self.nodes.len() - 1,
            roles: Roles::NO_SHADOW,
        });
    }
}

/// A unit sphere around the origin, with `segments` steps around and half as many from pole to pole.
fn sphere(segments: usize, material: usize) -> Mesh {
    let columns = segments.max(3);
    let rows = (columns / 2).max(2);
    // The poles have a vertex for every column and the seam has one for either side, because their texture
    // coordinates differ.
    let vertices = grid(rows, columns, |v, u| {
        let (theta, phi) = (v * TAU / 2.0, u * TAU);
        let normal = lightcast_core::math::direction(theta, phi).as_vec3();
        (normal, normal)
    });
    let indices =
        grid_triangles(rows, columns, |row, half| !(row == 0 && half == 0 || row + 1 == rows && half == 1));
    Mesh::new(vertices, indices, material)
}

/// A tube around a curve on a torus that goes twice about the axis z and three times through the hole, with
/// `along` steps along the tube and `around` steps around it.
fn torus_knot(along: usize, around: usize, material: usize) -> Mesh {
    /// Radius of the tube.
    const TUBE: f64 = 0.2;
    /// Major and minor radius of the torus. The strands stay 2 * 0.3 apart.
    const RADII: (f64, f64) = (0.65, 0.3);
    /// Turns about the axis, and through the hole.
    const TURNS: (f64, f64) = (2.0, 3.0);
    let vertices = grid(along, around, |v, u| {
        let (t, s) = (v * TAU, u * TAU);
        let ((sin_p, cos_p), (sin_q, cos_q)) = ((TURNS.0 * t).sin_cos(), (TURNS.1 * t).sin_cos());
        let radius = RADII.0 + RADII.1 * cos_q;
        let centre = glam::DVec3::new(radius * cos_p, radius * sin_p, RADII.1 * sin_q);
        let slope = -RADII.1 * TURNS.1 * sin_q;
        let tangent = glam::DVec3::new(
            slope * cos_p - radius * TURNS.0 * sin_p,
            slope * sin_p + radius * TURNS.0 * cos_p,
            RADII.1 * TURNS.1 * cos_q,
        );
        // The curve lies on a torus, whose normal is perpendicular to the curve's tangent and returns to
        // itself after a full turn.
        let up = glam::DVec3::new(cos_q * cos_p, cos_q * sin_p, sin_q);
        let side = tangent.cross(up).normalize_or_zero();
        let normal = up * s.cos() + side * s.sin();
        ((centre + normal * TUBE).as_vec3(), normal.as_vec3())
    });
    Mesh::new(vertices, grid_triangles(along, around, |_, _| true), material)
}

/// Positions and normals at `(v, u)` in [0, 1], in rows of constant v, both edges included.
fn grid(rows: usize, columns: usize, at: impl Fn(f64, f64) -> (Vec3, Vec3)) -> Vec<Vertex> {
    (0..=rows)
        .flat_map(|row| (0..=columns).map(move |column| (row, column)))
        .map(|(row, column)| {
            let (v, u) = (row as f64 / rows as f64, column as f64 / columns as f64);
            // The last column repeats the first one, bit for bit.
            let (position, normal) = at(v, if column == columns { 0.0 } else { u });
            Vertex {
                position: position.to_array(),
                normal: normal.to_array(),
                uv: [u as f32, v as f32],
                colour: [1.0; 4],
            }
        })
        .collect()
}

/// Two triangles for every cell of a grid; those for which `is_kept` (row, 0 or 1) is false are left out.
fn grid_triangles(rows: usize, columns: usize, is_kept: impl Fn(usize, usize) -> bool) -> Vec<u32> {
    let mut indices = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let a = (row * (columns + 1) + column) as u32;
            let b = a + columns as u32 + 1;
            if is_kept(row, 0) {
                indices.extend([a, a + 1, b + 1]);
            }
            if is_kept(row, 1) {
                indices.extend([a, b + 1, b]);
            }
        }
    }
    indices
}
