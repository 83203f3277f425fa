//! Scenes and lights for the tests of this room.

use super::{DirectionalOptions, Lightings, Options};
use crate::scene::{
    Bounds, Camera, Instance, Material, Mesh, Node, Roles, Scene, Shading, Transform, Vertex,
};
use glam::Vec3;
use lightcast_core::light::Light;

/// A small picture with few and small shadow maps.
pub(super) const OPTIONS: Options = Options {
    width_px: 64,
    height_px: 48,
    lighting: Lightings::ALL,
    directional: DirectionalOptions {
        lights: 72,
        shadow_maps: 8,
        shadow_map_px: 64,
        soft_samples: 8,
        culling: true,
        cone_rad: 0.7,
        region_lights: 216,
        count_lights: false,
        clusters: None,
    },
    ground_albedo: 0.0,
};

/// A sphere of radius 1 about the origin, its normals exact.
pub(super) fn sphere(segments: u32, material: usize) -> Mesh {
    let mut vertices = Vec::new();
    let mut indices = Vec::new();
    for row in 0..=segments {
        for column in 0..=2 * segments {
            let theta = std::f64::consts::PI * f64::from(row) / f64::from(segments);
            let phi = std::f64::consts::PI * f64::from(column) / f64::from(segments);
            let normal = lightcast_core::math::direction(theta, phi).as_vec3().to_array();
            vertices.push(Vertex { position: normal, normal, uv: [0.0; 2], colour: [1.0; 4] });
        }
    }
    let stride = 2 * segments + 1;
    for row in 0..segments {
        for column in 0..2 * segments {
            let at = row * stride + column;
            if row > 0 {
                indices.extend([at, at + 1, at + stride]);
            }
            if row + 1 < segments {
                indices.extend([at + 1, at + stride + 1, at + stride]);
            }
        }
    }
    Mesh { vertices, indices, material, bounds: Bounds { min: Vec3::NEG_ONE, max: Vec3::ONE } }
}

/// A square of half-width `half` at height `y`, facing up.
pub(super) fn ground(half: f32, y: f32, material: usize) -> Mesh {
    let corner = |x: f32, z: f32| Vertex {
        position: [x * half, y, z * half],
        normal: [0.0, 1.0, 0.0],
        uv: [x, z],
        colour: [1.0; 4],
    };
    Mesh {
        vertices: vec![corner(-1.0, -1.0), corner(-1.0, 1.0), corner(1.0, 1.0), corner(1.0, -1.0)],
        indices: vec![0, 1, 2, 0, 2, 3],
        material,
        bounds: Bounds { min: Vec3::new(-half, y, -half), max: Vec3::new(half, y, half) },
    }
}

/// One node at the origin with these meshes; those marked cast shadows.
pub(super) fn scene(meshes: Vec<(Mesh, bool)>, materials: Vec<Material>) -> Scene {
    let instances = meshes
        .iter()
        .enumerate()
        .map(|(mesh, &(_, casts_shadow))| Instance {
            mesh,
            node: 0,
            roles: Roles { casts: casts_shadow, ..Roles::ALL },
        })
        .collect();
    Scene {
        meshes: meshes.into_iter().map(|(mesh, _)| mesh).collect(),
        materials,
        nodes: vec![Node { parent: None, transform: Transform::IDENTITY }],
        instances,
        ..Scene::default()
    }
}

/// A sphere of `material` on a large ground of albedo 0.5.
pub(super) fn sphere_on_ground(material: Material) -> Scene {
    scene(
        vec![(sphere(48, 0), true), (ground(8.0, -1.0, 1), false)],
        vec![material, Material::lambert([0.5; 3])],
    )
}

/// A polished metal.
pub(super) fn metal(roughness: f32) -> Material {
    Material::new(Shading::MetalRough { metallic: 1.0, roughness }, [1.0; 3])
}

/// A view slightly from above, with the sphere in the middle.
pub(super) fn camera() -> Camera {
    Camera {
        eye: Vec3::new(0.0, 2.5, 6.0),
        target: Vec3::ZERO,
        up: Vec3::Y,
        vertical_fov_rad: 0.7,
        near: 0.1,
    }
}

/// A light of equal irradiance in all channels.
pub(super) fn light(id: u32, direction: Vec3, irradiance: f32) -> Light {
    let direction = direction.try_normalize().expect("a direction").to_array();
    Light { id, direction, irradiance: [irradiance; 3], spread_rad: 0.0 }
}

/// `count` lights over the whole sphere that together represent surroundings of radiance 1, in an order whose
/// prefixes also cover the sphere evenly.
pub(super) fn furnace(count: u32) -> Vec<Light> {
    let solid_angle = 4.0 * std::f32::consts::PI / count as f32;
    // RMS angle of a disc of this solid angle: its radius over the square root of two.
    let spread_rad = (solid_angle / std::f32::consts::PI / 2.0).sqrt();
    let mut lights: Vec<Light> = lightcast_core::math::fibonacci_sphere(count as usize)
        .map(|d| Light { spread_rad, ..light(0, d.as_vec3(), solid_angle) })
        .collect();
    // Neighbours on the spiral are far apart in the order.
    let order = |i: u32| lightcast_core::sampling::halton(u64::from(i), 2);
    let mut places: Vec<u32> = (0..count).collect();
    places.sort_by(|&a, &b| order(a).total_cmp(&order(b)));
    lights = places.iter().map(|&place| lights[place as usize]).collect();
    (0..).zip(&mut lights).for_each(|(id, light)| light.id = id);
    lights
}

/// A translated mesh.
pub(super) fn moved(mut mesh: Mesh, by: Vec3) -> Mesh {
    for vertex in &mut mesh.vertices {
        vertex.position = (Vec3::from(vertex.position) + by).to_array();
    }
    mesh.bounds = Bounds { min: mesh.bounds.min + by, max: mesh.bounds.max + by };
    mesh
}

/// A torus around the y axis with major radius 1 and tube radius `thickness`: convex outside, concave inside.
pub(super) fn torus(segments: u32, thickness: f32, material: usize) -> Mesh {
    let (mut vertices, mut indices) = (Vec::new(), Vec::new());
    let angle = |i: u32| std::f32::consts::TAU * i as f32 / segments as f32;
    for row in 0..=segments {
        for column in 0..=segments {
            let (across, around) = (angle(row), angle(column));
            let outward = Vec3::new(around.cos(), 0.0, around.sin());
            let normal = across.cos() * outward + across.sin() * Vec3::Y;
            let position = (outward + thickness * normal).to_array();
            vertices.push(Vertex { position, normal: normal.to_array(), uv: [0.0; 2], colour: [1.0; 4] });
        }
    }
    for at in (0..segments * (segments + 1)).filter(|at| at % (segments + 1) != segments) {
        let next = at + segments + 1;
        indices.extend([at, at + 1, next, at + 1, next + 1, next]);
    }
    let half = Vec3::new(1.0 + thickness, thickness, 1.0 + thickness);
    Mesh { vertices, indices, material, bounds: Bounds { min: -half, max: half } }
}

/// An axis-aligned box with the normals of its faces.
pub(super) fn cuboid(min: Vec3, max: Vec3, material: usize) -> Mesh {
    let (mut vertices, mut indices) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        for is_high in [false, true] {
            let first = vertices.len() as u32;
            let mut normal = [0.0; 3];
            normal[axis] = if is_high { 1.0 } else { -1.0 };
            for (i, j) in [(false, false), (true, false), (true, true), (false, true)] {
                let mut position = if is_high { max } else { min }.to_array();
                let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
                position[u] = if i { max[u] } else { min[u] };
                position[v] = if j { max[v] } else { min[v] };
                vertices.push(Vertex { position, normal, uv: [0.0; 2], colour: [1.0; 4] });
            }
            let corners = if is_high { [0, 1, 2, 0, 2, 3] } else { [0, 2, 1, 0, 3, 2] };
            indices.extend(corners.map(|corner| first + corner));
        }
    }
    Mesh { vertices, indices, material, bounds: Bounds { min, max } }
}

/// A sky that is brighter towards the zenith over a dim ground, as `count` lights in the order of
/// [`furnace`]; the first is a sun.
pub(super) fn sky(count: u32) -> Vec<Light> {
    let mut lights = furnace(count);
    for light in &mut lights {
        let height = light.direction[1];
        let (radiance, colour) =
            if height > 0.0 { (0.3 + 0.7 * height, [0.6, 0.8, 1.0]) } else { (0.1, [0.5, 0.45, 0.4]) };
        light.irradiance = std::array::from_fn(|c| light.irradiance[c] * radiance * colour[c]);
    }
    if let Some(sun) = lights.first_mut() {
        sun.direction = Vec3::new(0.5, 0.7, 0.4).normalize_or_zero().to_array();
        sun.irradiance = [3.0, 2.7, 2.1];
        sun.spread_rad = 0.0033;
    }
    lights
}
