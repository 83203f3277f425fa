//! Lighting by the ground, which a capture does not see: with a lens that looks up, undersides would be
//! black.
//!
//! An unoccluded ground of albedo A, lit by all lights, has the radiance A E_up / pi, where E_up is the sum
//! of E_i max(0, d_i.y); a surface of normal n sees a fraction (1 - n.y) / 2 of its hemisphere filled by the
//! ground, weighted by the cosine, and receives the irradiance A E_up (1 - n.y) / 2. This is diffuse light
//! only: reflections of the ground in glossy surfaces are not included.

use super::view::{SEEN, Seen};
use crate::gpu::{Array, Gpu, Timer, UNIFORM};
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use lightcast_core::light::Light;

#[cfg(test)]
mod tests;

const SOURCES: [&str; 2] = [SEEN, include_str!("../../../shaders/ambient/shade.wgsl")];

#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
struct GroundUniform {
    radiance: Vec3,
    pad: u32,
}

/// The lighting.
pub(super) struct Ambient {
    albedo: f32,
    ground: Array<GroundUniform>,
    pipeline: wgpu::ComputePipeline,
    group: wgpu::BindGroup,
}

impl Ambient {
    /// Lighting by a ground of this albedo, for views with the layout of `seen`.
    pub fn new(gpu: &Gpu, seen: &Seen, albedo: f32) -> Self {
        let layout = gpu.bind_group_layout(&[(0, wgpu::ShaderStages::COMPUTE, UNIFORM)]);
        let groups = gpu.pipeline_layout(&[seen.layout(), &layout]);
        let ground = Array::new(gpu, "ground", wgpu::BufferUsages::UNIFORM, 1);
        Self {
            albedo,
            pipeline: gpu.compute_pipeline("ambient", &SOURCES, &[], Some(&groups)),
            group: gpu.bind_group(&layout, &[(0, ground.binding())]),
            ground,
        }
    }

    /// Sets the lights that light the ground, until the next call.
    pub fn prepare(&mut self, gpu: &Gpu, lights: &[Light]) {
        let radiance = ground_radiance(lights, self.albedo);
        self.ground.write(gpu, &[GroundUniform { radiance, pad: 0 }]);
    }

    /// Adds the ground's light to a sample of a view.
    pub fn shade(&self, encoder: &mut wgpu::CommandEncoder, timer: &mut Timer, seen: &Seen) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("ambient"),
            timestamp_writes: timer.compute("ambient"),
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(1, &self.group, &[]);
        seen.dispatch(&mut pass);
    }
}

/// A E_up / pi.
fn ground_radiance(lights: &[Light], albedo: f32) -> Vec3 {
    let sum = |channel: usize| -> f64 {
        let shares = lights
            .iter()
            .map(|light| f64::from(light.irradiance[channel]) * f64::from(light.direction[1].max(0.0)));
        shares.sum()
    };
    let scale = f64::from(albedo) / std::f64::consts::PI;
    // Not infinite: the shader multiplies it by 0 on level ground.
    Vec3::from_array([0, 1, 2].map(|channel| (scale * sum(channel)).min(f64::from(f32::MAX)) as f32))
}

/// CPU twin of `shaders/ambient/shade.wgsl`.
#[cfg(test)]
mod twin {
    use glam::Vec3;

    pub(super) fn irradiance_over_pi(radiance: Vec3, normal: Vec3) -> Vec3 {
        radiance * (0.5 * (1.0 - normal.y))
    }
}
