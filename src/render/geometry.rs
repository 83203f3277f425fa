//! A scene on the device: vertices and triangles are uploaded once, matrices and the vertices of figures in
//! every frame.

use crate::error::{Error, Result};
use crate::gpu::{Array, Gpu};
use crate::scene::{Bounds, Pose, Roles, Scene, Vertex};
use bytemuck::{Pod, Zeroable};
use glam::Mat4;
use std::collections::HashMap;
use std::ops::Range;
use wgpu::util::{BufferInitDescriptor, DeviceExt};

/// Layout of [`Vertex`] for passes that read all attributes.
pub(super) const VERTEX_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: size_of::<Vertex>() as u64,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x2, 3 => Float32x4],
};

/// Source of the WGSL counterparts of [`Instance`] and of a material.
pub(super) const SOURCE: &str = include_str!("../../shaders/scene.wgsl");

/// Layout for passes that need only positions.
pub(super) const POSITION_LAYOUT: wgpu::VertexBufferLayout<'static> = wgpu::VertexBufferLayout {
    array_stride: size_of::<Vertex>() as u64,
    step_mode: wgpu::VertexStepMode::Vertex,
    attributes: &wgpu::vertex_attr_array![0 => Float32x3],
};

/// One instance, for shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(super) struct Instance {
    pub world_from_mesh: Mat4,
    pub normal_from_mesh: Mat4,
    /// Whether shadows fall on it.
    pub receives: u32,
    pub pad: [u32; 3],
}

/// Parameters of one draw call.
#[derive(Clone, Debug)]
pub(super) struct Draw {
    pub indices: Range<u32>,
    pub base_vertex: i32,
    pub material: usize,
    pub roles: Roles,
    /// Whether the material has cut-outs (alpha test).
    pub is_cut_out: bool,
}

/// A scene's triangles and poses.
pub(super) struct Geometry {
    pub vertices: wgpu::Buffer,
    pub indices: wgpu::Buffer,
    pub instances: Array<Instance>,
    /// One for each instance, in their order.
    pub draws: Vec<Draw>,
    /// Bounding boxes of the shadow casters and of everything, as last posed.
    pub casters: Bounds,
    pub all: Bounds,
    posed: Vec<Instance>,
    /// Where the vertices of the figures begin, in bytes.
    figures_at: u64,
}

impl Geometry {
    /// # Errors
    /// When the scene is larger than the device's buffers.
    pub fn new(gpu: &Gpu, scene: &Scene) -> Result<Self> {
        let (mut vertices, mut indices) = (Vec::new(), Vec::new());
        let mut ranges = Vec::with_capacity(scene.meshes.len());
        let most = gpu.device.limits().max_buffer_size as usize;
        for mesh in &scene.meshes {
            ranges.push((indices.len(), vertices.len()));
            vertices.extend_from_slice(&mesh.vertices);
            indices.extend_from_slice(&mesh.indices);
            check_room(&vertices, &indices, most)?;
        }
        // Figures have vertices of their own, each as many as its mesh.
        let figures_at = size_of_val(&*vertices) as u64;
        let mut own_vertices = HashMap::new();
        for figure in &scene.figures {
            own_vertices.insert(figure.instance, vertices.len());
            vertices.extend_from_slice(&scene.meshes[scene.instances[figure.instance].mesh].vertices);
            check_room(&vertices, &indices, most)?;
        }
        let draws = scene
            .instances
            .iter()
            .enumerate()
            .map(|(number, instance)| {
                let mesh = &scene.meshes[instance.mesh];
                let (first_index, first_vertex) = ranges[instance.mesh];
                let first_vertex = own_vertices.get(&number).copied().unwrap_or(first_vertex);
                Draw {
                    indices: first_index as u32..(first_index + mesh.indices.len()) as u32,
                    base_vertex: first_vertex as i32,
                    material: mesh.material,
                    roles: instance.roles,
                    is_cut_out: scene.materials[mesh.material].alpha_cutoff.is_some(),
                }
            })
            .collect();
        // Empty buffers cannot be bound.
        if vertices.is_empty() {
            vertices.push(Vertex::default());
        }
        if indices.is_empty() {
            indices.push(0);
        }
        let buffer = |label, contents: &[u8], usage| {
            gpu.device.create_buffer_init(&BufferInitDescriptor { label: Some(label), contents, usage })
        };
        Ok(Self {
            vertices: buffer(
                "vertices",
                bytemuck::cast_slice(&vertices),
                wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST,
            ),
            indices: buffer("indices", bytemuck::cast_slice(&indices), wgpu::BufferUsages::INDEX),
            instances: Array::new(gpu, "instances", wgpu::BufferUsages::STORAGE, scene.instances.len()),
            draws,
            casters: Bounds::EMPTY,
            all: Bounds::EMPTY,
            posed: Vec::with_capacity(scene.instances.len()),
            figures_at,
        })
    }

    /// Poses the scene's instances, and the vertices of its figures.
    pub fn pose(&mut self, gpu: &Gpu, scene: &Scene, pose: &Pose) {
        if !pose.vertices().is_empty() {
            gpu.queue.write_buffer(&self.vertices, self.figures_at, bytemuck::cast_slice(pose.vertices()));
        }
        self.posed.clear();
        let matrices = scene.instances.iter().zip(pose.world_from_mesh());
        self.posed.extend(matrices.map(|(instance, &world_from_mesh)| {
            // Normals transform by the inverse transpose; a flattened mesh has no inverse, and is visible
            // only edge-on.
            let inverse = world_from_mesh.inverse();
            let normal_from_mesh = if inverse.is_finite() { inverse.transpose() } else { world_from_mesh };
            let receives = u32::from(instance.roles.receives);
            Instance { world_from_mesh, normal_from_mesh, receives, pad: [0; 3] }
        }));
        self.instances.write(gpu, &self.posed);
        (self.casters, self.all) = (scene.caster_bounds(pose), scene.bounds(pose));
    }
}

/// Refuses what a buffer does not hold, or what cannot be counted in it: index ranges and base vertices are 32
/// bits wide, the latter signed.
fn check_room(vertices: &[Vertex], indices: &[u32], most_bytes: usize) -> Result<()> {
    if size_of_val(vertices) <= most_bytes
        && size_of_val(indices) <= most_bytes
        && i32::try_from(vertices.len()).is_ok()
        && u32::try_from(indices.len()).is_ok()
    {
        return Ok(());
    }
    Err(Error::failed(format!(
        "the scene has more triangles than the device holds ({most_bytes} bytes a buffer)"
    )))
}
