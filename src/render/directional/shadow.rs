//! The shadow atlas: all shadow maps in one texture and one pass (Havran et al. 2005, section 5.2.1).

use super::light_space::{self, LightSpace};
use crate::gpu::{Array, Gpu, READ_ONLY, Timer, UNIFORM};
use crate::render::geometry::{self, Instance, POSITION_LAYOUT, VERTEX_LAYOUT};
use crate::render::material;
use crate::render::world::World;

pub(super) const SOURCES: [&str; 3] =
    [light_space::SOURCE, geometry::SOURCE, include_str!("../../../shaders/directional/shadow.wgsl")];

/// Draws shadow maps.
pub(super) struct ShadowPass {
    solid: wgpu::RenderPipeline,
    /// For cut-out materials, whose alpha is tested per texel.
    cut_out: wgpu::RenderPipeline,
    layout: wgpu::BindGroupLayout,
    pub atlas_view: wgpu::TextureView,
    tile_px: u32,
    /// Tiles along a side of the atlas.
    pub tiles_per_side: u32,
}

impl ShadowPass {
    pub fn new(gpu: &Gpu, tile_px: u32, tiles_per_side: u32) -> Self {
        let module = gpu.shader("shadow", &SOURCES);
        let stage = wgpu::ShaderStages::VERTEX;
        let layout =
            gpu.bind_group_layout(&[(0, stage, UNIFORM), (1, stage, READ_ONLY), (2, stage, READ_ONLY)]);
        let format = wgpu::TextureFormat::Depth32Float;
        let pipeline = |label, groups: &[&_], entry_point, buffer, fragment| {
            gpu.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(label),
                layout: Some(&gpu.pipeline_layout(groups)),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some(entry_point),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    buffers: &[Some(buffer)],
                },
                // No culling: open meshes cast shadows from both sides.
                primitive: wgpu::PrimitiveState::default(),
                depth_stencil: Some(wgpu::DepthStencilState {
                    format,
                    depth_write_enabled: Some(true),
                    depth_compare: Some(wgpu::CompareFunction::Less),
                    stencil: wgpu::StencilState::default(),
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState::default(),
                fragment,
                multiview_mask: None,
                cache: None,
            })
        };
        let solid = pipeline("shadow", &[&layout], "vertex", POSITION_LAYOUT, None);
        let cut_out = pipeline(
            "shadow of a material with holes",
            &[&layout, &material::layout(gpu)],
            "vertex_cut_out",
            VERTEX_LAYOUT,
            Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("fragment_cut_out"),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &[],
            }),
        );
        let side = tile_px * tiles_per_side;
        let atlas = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some("shadow atlas"),
            size: wgpu::Extent3d { width: side, height: side, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT
                | wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let atlas_view = atlas.create_view(&wgpu::TextureViewDescriptor::default());
        Self { solid, cut_out, layout, atlas_view, tile_px, tiles_per_side }
    }

    pub fn bind_group(
        &self,
        gpu: &Gpu,
        space: &Array<LightSpace>,
        tiles: &Array<[f32; 4]>,
        instances: &Array<Instance>,
    ) -> wgpu::BindGroup {
        gpu.bind_group(&self.layout, &[(0, space.binding()), (1, tiles.binding()), (2, instances.binding())])
    }

    /// Draws the casters into the tiles `used`.
    pub fn encode(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
        bind_group: &wgpu::BindGroup,
        World { geometry, materials, .. }: &World,
        used: impl Iterator<Item = u32>,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("shadow"),
            color_attachments: &[],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: &self.atlas_view,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Clear(1.0),
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            timestamp_writes: timer.render("shadow maps"),
            occlusion_query_set: None,
            multiview_mask: None,
        });
        pass.set_bind_group(0, bind_group, &[]);
        pass.set_vertex_buffer(0, geometry.vertices.slice(..));
        pass.set_index_buffer(geometry.indices.slice(..), wgpu::IndexFormat::Uint32);
        let count = geometry.draws.len() as u32;
        let of = |is_cut_out| {
            let draws = (0..).zip(&geometry.draws);
            draws.filter(move |(_, draw)| draw.roles.casts && draw.is_cut_out == is_cut_out)
        };
        for tile in used {
            let (column, row) = (tile % self.tiles_per_side, tile / self.tiles_per_side);
            let (x, y) = (column * self.tile_px, row * self.tile_px);
            let side = self.tile_px as f32;
            pass.set_viewport(x as f32, y as f32, side, side, 0.0, 1.0);
            pass.set_scissor_rect(x, y, self.tile_px, self.tile_px);
            pass.set_pipeline(&self.solid);
            for (number, draw) in of(false) {
                let index: u32 = tile * count + number;
                pass.draw_indexed(draw.indices.clone(), draw.base_vertex, index..index + 1);
            }
            for (nth, (number, draw)) in of(true).enumerate() {
                if nth == 0 {
                    pass.set_pipeline(&self.cut_out);
                }
                let index = tile * count + number;
                pass.set_bind_group(1, materials.bind_group(draw.material), &[]);
                pass.draw_indexed(draw.indices.clone(), draw.base_vertex, index..index + 1);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::layout::{assert_layout, assert_valid, members};

    #[test]
    fn the_shader_is_valid_and_its_structs_lie_as_they_are_written() {
        let source = SOURCES.concat();
        assert_valid("shadow", &source);
        assert_layout(
            &source,
            "Instance",
            size_of::<Instance>(),
            members!(Instance: world_from_mesh, normal_from_mesh, receives),
        );
    }
}
