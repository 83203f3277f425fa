//! CPU twin of `shaders/view/seen.wgsl` and `shaders/view/start.wgsl`, function by function, on data read
//! back from the device.

use super::View;
use super::seen::SampleUniform;
use crate::gpu::{Gpu, read_buffer, read_texture};
use exr::prelude::f16;
use glam::{UVec2, Vec2, Vec3};

pub(in crate::render) struct Surface {
    pub normal: Vec3,
    pub face: Vec3,
    pub diffuse: Vec3,
    pub specular: Vec3,
    pub gloss: f32,
    pub bend: f32,
    pub receives: bool,
}

/// Everything that the lightings of the last sample read, and the picture.
pub(in crate::render) struct SeenFrame {
    pub sample: SampleUniform,
    pub depths: Vec<f32>,
    pub normals: Vec<[u32; 4]>,
    pub reflectances: Vec<[u32; 4]>,
    pub radiance: Vec<[f32; 4]>,
}

impl View {
    /// Waits for the sample drawn last and reads it back.
    pub(in crate::render) fn read_back(&self, gpu: &Gpu) -> SeenFrame {
        let mut samples = Vec::new();
        read_buffer(gpu, self.seen.sample.buffer(), 1, &mut samples).unwrap();
        let mut frame = SeenFrame {
            sample: samples[0],
            depths: Vec::new(),
            normals: Vec::new(),
            reflectances: Vec::new(),
            radiance: Vec::new(),
        };
        let [depths, normals, reflectances] = self.surfaces.views().map(wgpu::TextureView::texture);
        read_texture(gpu, depths, &mut frame.depths).unwrap();
        read_texture(gpu, normals, &mut frame.normals).unwrap();
        read_texture(gpu, reflectances, &mut frame.reflectances).unwrap();
        let pixels = frame.depths.len();
        read_buffer(gpu, self.seen.radiance.buffer(), pixels, &mut frame.radiance).unwrap();
        frame
    }
}

fn unpack2x16snorm(packed: u32) -> Vec2 {
    let part = |bits: u32| (f32::from(bits as u16 as i16) / 32767.0).max(-1.0);
    Vec2::new(part(packed), part(packed >> 16))
}

fn unpack2x16float(packed: u32) -> [f32; 2] {
    [packed as u16, (packed >> 16) as u16].map(|bits| f16::from_bits(bits).to_f32())
}

fn octahedral_direction(packed: u32) -> Vec3 {
    let p = unpack2x16snorm(packed);
    let z = 1.0 - p.x.abs() - p.y.abs();
    let sign = Vec2::select(p.cmpge(Vec2::ZERO), Vec2::ONE, Vec2::NEG_ONE);
    let folded = (1.0 - Vec2::new(p.y, p.x).abs()) * sign;
    (if z >= 0.0 { p } else { folded }).extend(z).normalize_or_zero()
}

impl SeenFrame {
    fn index(&self, pixel: UVec2) -> usize {
        (pixel.y * self.sample.size[0] + pixel.x) as usize
    }

    /// World position of the surface that a pixel shows, `None` where there is none.
    pub fn position(&self, pixel: UVec2) -> Option<Vec3> {
        let depth = self.depths[self.index(pixel)];
        (depth > 0.0).then(|| self.sample.eye + self.offset_from_eye(pixel, depth))
    }

    pub fn offset_from_eye(&self, pixel: UVec2, depth: f32) -> Vec3 {
        let size = Vec2::new(self.sample.size[0] as f32, self.sample.size[1] as f32);
        let ndc = (pixel.as_vec2() + 0.5) / size * Vec2::new(2.0, -2.0) + Vec2::new(-1.0, 1.0);
        let homogeneous = self.sample.eye_from_clip * ndc.extend(depth).extend(1.0);
        homogeneous.truncate() / homogeneous.w
    }

    pub fn surface(&self, pixel: UVec2) -> Surface {
        let index = self.index(pixel);
        let (normals, packed) = (self.normals[index], self.reflectances[index].map(unpack2x16float));
        Surface {
            normal: octahedral_direction(normals[0]),
            face: octahedral_direction(normals[1]),
            diffuse: Vec3::new(packed[0][0], packed[0][1], packed[1][0]),
            specular: Vec3::new(packed[1][1], packed[2][0], packed[2][1]),
            gloss: packed[3][0],
            bend: packed[3][1],
            receives: unpack2x16float(normals[3])[1] > 0.0,
        }
    }

    /// Value of a pixel before any light is added, in a picture that this sample starts.
    pub fn start(&self, pixel: UVec2) -> [f32; 4] {
        if self.sample.has_emission == 0 || self.position(pixel).is_none() {
            return [0.0; 4];
        }
        let normals = self.normals[self.index(pixel)];
        let ([r, g], [b, _]) = (unpack2x16float(normals[2]), unpack2x16float(normals[3]));
        [r, g, b, 1.0].map(|v| self.sample.weight * v)
    }
}
