//! The surface in every pixel: depth, normals and reflectances.

use crate::gpu::{Array, Gpu, READ_ONLY, Timer, UNIFORM};
use crate::render::geometry::{self, Instance, VERTEX_LAYOUT};
use crate::render::material;
use crate::render::world::World;
use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3};

pub(super) const SOURCES: [&str; 2] = [geometry::SOURCE, include_str!("../../../shaders/view/surface.wgsl")];

/// Position and projection of the camera, for shaders.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(in crate::render) struct CameraUniform {
    pub clip_from_eye: Mat4,
    pub eye: Vec3,
    pub pad: u32,
}

/// The pass that draws surfaces into textures of the picture's size.
pub(in crate::render) struct SurfacePass {
    pipeline: wgpu::RenderPipeline,
    layout: wgpu::BindGroupLayout,
    targets: Targets,
}

struct Targets {
    depth: wgpu::TextureView,
    normals: wgpu::TextureView,
    reflectances: wgpu::TextureView,
}

const PACKED: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;
const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

impl SurfacePass {
    pub fn new(gpu: &Gpu, size: [u32; 2]) -> Self {
        let module = gpu.shader("surface", &SOURCES);
        let layout = gpu.bind_group_layout(&[
            (0, wgpu::ShaderStages::VERTEX_FRAGMENT, UNIFORM),
            (1, wgpu::ShaderStages::VERTEX, READ_ONLY),
        ]);
        let material_layout = material::layout(gpu);
        let target =
            Some(wgpu::ColorTargetState { format: PACKED, blend: None, write_mask: wgpu::ColorWrites::ALL });
        let pipeline = gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some("surface"),
            layout: Some(&gpu.pipeline_layout(&[&layout, &material_layout])),
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("vertex"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: &[Some(VERTEX_LAYOUT)],
            },
            // No culling: back sides are shaded too, and mirrored instances need no second pipeline.
            primitive: wgpu::PrimitiveState::default(),
            // Reversed depth: floating-point depth has the finest resolution near 0, to which most distances
            // are mapped.
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH,
                depth_write_enabled: Some(true),
                depth_compare: Some(wgpu::CompareFunction::Greater),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("fragment"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[target.clone(), target],
            }),
            multiview_mask: None,
            cache: None,
        });
        Self { pipeline, layout, targets: Targets::new(gpu, size) }
    }

    /// Switches to textures of another size.
    pub fn resize(&mut self, gpu: &Gpu, size: [u32; 2]) {
        self.targets = Targets::new(gpu, size);
    }

    /// Depth, normals and reflectances.
    pub fn views(&self) -> [&wgpu::TextureView; 3] {
        [&self.targets.depth, &self.targets.normals, &self.targets.reflectances]
    }

    pub fn bind_group(
        &self,
        gpu: &Gpu,
        camera: &Array<CameraUniform>,
        instances: &Array<Instance>,
    ) -> wgpu::BindGroup {
        gpu.bind_group(&self.layout, &[(0, camera.binding()), (1, instances.binding())])
    }

    pub fn encode(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
        bind_group: &wgpu::BindGroup,
        World { geometry, materials, .. }: &World,
    ) {
        let attachment = |view| {
            Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target: None,
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                    store: wgpu::StoreOp::Store,
                },
            })
        };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("surface"),
            color_attachments: &[attachment(&self.targets.normals), attachment(&self.targets.reflectances)],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.targets.depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(0.0),
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            timestamp_writes: timer.render("surfaces"),
            occlusion_query_set: None,
            multiview_mask: None,
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, bind_group, &[]);
        pass.set_vertex_buffer(0, geometry.vertices.slice(..));
        pass.set_index_buffer(geometry.indices.slice(..), wgpu::IndexFormat::Uint32);
        let numbered = geometry.draws.iter().enumerate();
        for (number, draw) in numbered.filter(|(_, draw)| draw.roles.seen) {
            pass.set_bind_group(1, materials.bind_group(draw.material), &[]);
            pass.draw_indexed(draw.indices.clone(), draw.base_vertex, number as u32..number as u32 + 1);
        }
    }
}

impl Targets {
    fn new(gpu: &Gpu, [width, height]: [u32; 2]) -> Self {
        let target = |label, format| {
            let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT
                    | wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            });
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        };
        Self {
            depth: target("depth", DEPTH),
            normals: target("normals", PACKED),
            reflectances: target("reflectances", PACKED),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::{assert_layout, assert_valid, members};
    use crate::render::material::{MaterialUniform, UvTransform};

    #[test]
    fn the_shader_is_valid_and_its_structs_lie_as_they_are_written() {
        let source = SOURCES.concat();
        assert_valid("surface", &source);
        assert_layout(
            &source,
            "Camera",
            size_of::<CameraUniform>(),
            members!(CameraUniform: clip_from_eye, eye),
        );
        assert_layout(
            &source,
            "Instance",
            size_of::<Instance>(),
            members!(Instance: world_from_mesh, normal_from_mesh, receives),
        );
        assert_layout(
            &source,
            "Material",
            size_of::<MaterialUniform>(),
            members!(MaterialUniform: base_colour, specular, gloss, emissive, metallic, normal_scale, alpha_cutoff, has_normal_map, base_colour_uv, metallic_roughness_uv, normal_uv, emissive_uv),
        );
        assert_layout(&source, "UvTransform", size_of::<UvTransform>(), members!(UvTransform: axes, offset));
    }
}
