//! CPU twin of `shaders/brdf.wgsl`, `shaders/directional/visibility.wgsl` and
//! `shaders/directional/shade.wgsl`, function by function, on what was read back from the device.

use super::light_space::LightSpace;
use super::light_space::twin::{Window, light_basis, light_window};
use super::read_back::DirectionalFrame;
use crate::render::view::seen_twin::{SeenFrame, Surface};
use glam::{Mat3, UVec2, Vec2, Vec3};
use lightcast_core::math::cube_cell;
use std::f32::consts::PI;

fn ggx_distribution(n_h: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    let d = (n_h * a2 - n_h) * n_h + 1.0;
    a2 / (PI * d * d)
}

fn smith_visibility(n_l: f32, n_v: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    let l = n_v * ((n_l - a2 * n_l) * n_l + a2).sqrt();
    let v = n_l * ((n_v - a2 * n_v) * n_v + a2).sqrt();
    0.5 / (l + v).max(1e-6)
}

fn reflect(incident: Vec3, normal: Vec3) -> Vec3 {
    incident - 2.0 * normal.dot(incident) * normal
}

fn specular_reflectance(s: &Surface, view: Vec3, l: Vec3, spread_rad: f32, energy: f32) -> Vec3 {
    if s.gloss < 0.0 {
        let width = 2.0 / (1.0 - s.gloss) + spread_rad * spread_rad;
        let exponent = (2.0 / width - 1.0).max(0.0);
        let cosine = reflect(-view, s.normal).dot(l);
        if cosine <= 0.0 {
            return Vec3::ZERO;
        }
        return s.specular * ((exponent + 2.0) / (2.0 * PI) * cosine.powf(exponent));
    }
    let h = (view + l).normalize_or_zero();
    let n_h = s.normal.dot(h).clamp(0.0, 1.0);
    let n_l = s.normal.dot(l);
    let n_v = s.normal.dot(view).max(1e-3);
    let v_h = view.dot(h).clamp(0.0, 1.0);
    let rough = (s.gloss * s.gloss).max(1e-3);
    let alpha = (rough * rough + 0.5 * spread_rad * spread_rad).sqrt().min(1.0);
    let fresnel = s.specular + (1.0 - s.specular) * (1.0 - v_h).powf(5.0);
    let multiple = 1.0 + s.specular * (1.0 / energy - 1.0);
    fresnel * multiple * (ggx_distribution(n_h, alpha) * smith_visibility(n_l, n_v, rough))
}

fn diffuse_reflectance(s: &Surface, view: Vec3, l: Vec3) -> Vec3 {
    let mut share = Vec3::ONE;
    if s.gloss >= 0.0 {
        let v_h = view.dot((view + l).normalize_or_zero()).clamp(0.0, 1.0);
        share = 1.0 - (s.specular + (1.0 - s.specular) * (1.0 - v_h).powf(5.0));
    }
    s.diffuse * share / PI
}

fn gradient_noise(pixel: Vec2) -> f32 {
    (52.982_918 * pixel.dot(Vec2::new(0.067_110_56, 0.005_837_15)).fract()).fract()
}

fn disc_point(index: u32, count: u32, turn: f32) -> Vec2 {
    let angle = 2.399_963_2 * index as f32 + 2.0 * PI * turn.fract();
    ((index as f32 + 0.5) / count as f32).sqrt() * Vec2::new(angle.cos(), angle.sin())
}

pub(super) struct Lookup {
    pub window: Window,
    corner: Vec2,
    pub texels: Vec2,
    pub receiver: Vec3,
    slope: Vec2,
    bias: f32,
}

impl Lookup {
    pub fn new(space: &LightSpace, tile: u32, basis: &Mat3, position: Vec3, face: Vec3, bend: f32) -> Self {
        let window = light_window(basis, space);
        let (column, row) = (tile % space.tiles_per_side, tile / space.tiles_per_side);
        let texels = 0.5 * space.tile_px / window.half;
        let n = basis.transpose() * face;
        let slope = -n.truncate() / n.z.max(0.01);
        Self {
            window,
            corner: Vec2::new(column as f32, row as f32) * space.tile_px,
            texels,
            receiver: basis.transpose() * position,
            slope,
            bias: bias_texels(slope.length(), bend) * (1.0 / texels).max_element() + 1e-5 * window.range,
        }
    }
}

fn bias_texels(slope: f32, bend: f32) -> f32 {
    0.25 + slope / 64.0 + (2.0 * bend * (1.0 + slope * slope)).min(8.0)
}

pub(super) fn terminator(n_l: f32, face_l: f32, face_n: f32) -> f32 {
    let g = (face_l / (n_l * face_n).max(1e-6)).clamp(0.0, 1.0);
    g * (1.0 + g * (1.0 - g))
}

impl DirectionalFrame {
    fn directional_albedo(&self, n_v: f32, roughness: f32) -> f32 {
        const SIDE: u32 = super::energy::SIDE as u32;
        let at =
            (Vec2::new(n_v, roughness) * SIDE as f32 - 0.5).clamp(Vec2::ZERO, Vec2::splat(SIDE as f32 - 1.0));
        let low = at.as_uvec2();
        let high = (low + 1).min(UVec2::splat(SIDE - 1));
        let f = at - low.as_vec2();
        let entry = |x: u32, y: u32| self.energies[(y * SIDE + x) as usize];
        let mix = |a: f32, b: f32, t: f32| a * (1.0 - t) + b * t;
        let first = mix(entry(low.x, low.y), entry(high.x, low.y), f.x);
        let second = mix(entry(low.x, high.y), entry(high.x, high.y), f.x);
        mix(first, second, f.y)
    }

    fn caster_over_plane(&self, at: &Lookup, texel: Vec2) -> f32 {
        let space = &self.space;
        let inside = texel.clamp(Vec2::ZERO, Vec2::splat(space.tile_px - 1.0));
        let place = (at.corner + inside).as_uvec2();
        let depth = self.atlas[(place.y * space.tiles_per_side * space.tile_px as u32 + place.x) as usize];
        if depth >= 1.0 {
            return -1.0;
        }
        let across = (inside + 0.5) / at.texels + at.window.centre - at.window.half;
        let plane = at.receiver.z + at.slope.dot(across - at.receiver.truncate());
        at.window.top - depth * at.window.range - plane - at.bias
    }

    fn compare(&self, at: &Lookup, across: Vec2) -> f32 {
        let texel = (across - at.window.centre + at.window.half) * at.texels - 0.5;
        if texel.cmplt(Vec2::splat(-0.5)).any() || texel.cmpgt(Vec2::splat(self.space.tile_px - 0.5)).any() {
            return 1.0;
        }
        let corner = texel.floor();
        let f = texel - corner;
        let lit =
            |x: f32, y: f32| f32::from(u8::from(self.caster_over_plane(at, corner + Vec2::new(x, y)) <= 0.0));
        let mix = |a: f32, b: f32, t: f32| a * (1.0 - t) + b * t;
        mix(mix(lit(0.0, 0.0), lit(1.0, 0.0), f.x), mix(lit(0.0, 1.0), lit(1.0, 1.0), f.x), f.y)
    }

    fn visibility(&self, tile: u32, radius: f32, position: Vec3, s: &Surface, turn: f32) -> f32 {
        if tile == u32::MAX || !s.receives {
            return 1.0;
        }
        let [x, y, z, _] = self.tiles[tile as usize];
        let at = &Lookup::new(&self.space, tile, &light_basis(Vec3::new(x, y, z)), position, s.face, s.bend);
        let receiver = at.receiver.truncate();
        let above = at.window.top - at.receiver.z;
        if above <= at.bias {
            return 1.0;
        }
        let samples = self.shade.soft_samples;
        let reach = (above * radius).min(0.5 * at.window.half.min_element());
        if samples <= 1 || reach * at.texels.max_element() < 0.5 {
            return self.compare(at, receiver);
        }
        let (mut height, mut found) = (0.0, 0.0);
        for i in 0..samples {
            let across = receiver + reach * disc_point(i, samples, turn);
            let texel = ((across - at.window.centre + at.window.half) * at.texels).floor();
            if texel.cmpge(Vec2::ZERO).all() && texel.cmplt(Vec2::splat(self.space.tile_px)).all() {
                let over = self.caster_over_plane(at, texel);
                height += over.max(0.0);
                found += f32::from(u8::from(over > 0.0));
            }
        }
        if found == 0.0 {
            return 1.0;
        }
        let penumbra = (height / found * radius).max((0.5 / at.texels.max_element()).min(reach)).min(reach);
        let lit: f32 =
            (0..samples).map(|i| self.compare(at, receiver + penumbra * disc_point(i, samples, turn))).sum();
        lit / samples as f32
    }

    /// The radiance that the pass adds to a pixel, and the numbers of lights that it read and shaded.
    pub(super) fn main(&self, seen: &SeenFrame, pixel: UVec2) -> ([f32; 3], [u32; 2]) {
        let (shade, sample) = (&self.shade, &seen.sample);
        let Some(position) = seen.position(pixel) else { return ([0.0; 3], [0; 2]) };
        let s = seen.surface(pixel);
        let view = (sample.eye - position).normalize_or_zero();
        let mirrored = reflect(-view, s.normal);
        let face_n = s.face.dot(s.normal);
        let energy = self.directional_albedo(s.normal.dot(view).max(0.0), s.gloss.max(0.0));
        let is_glossy = s.specular.cmpgt(Vec3::ZERO).any();
        let noise = gradient_noise(pixel.as_vec2()) + sample.seed as f32 * 0.618_034;
        let lit = |number: u32, tile: u32, spread_rad: f32| {
            let radius = std::f32::consts::SQRT_2 * spread_rad.min(1.5).tan();
            self.visibility(tile, radius, position, &s, noise + 0.754_877_7 * number as f32)
        };
        let (mut sum, mut shaded) = (Vec3::ZERO, 0);
        let (mut first, mut count, mut factor) = (0, shade.high_count, 1.0);
        if shade.high_stride > 0 {
            let cell = cube_cell(s.normal.to_array(), shade.table_side);
            first = (self.region_tables[cell as usize] * shade.high_stride) as usize;
            count = self.region_lists[first];
            factor = f32::from_bits(self.region_lists[first + 1]);
        }
        let mut looked_at = count;
        for i in 0..count {
            let number = if shade.high_stride > 0 { self.region_lists[first + 2 + i as usize] } else { i };
            let light = &self.lights[number as usize];
            let direction = Vec3::from(light.direction);
            let (n_l, face_l) = (s.normal.dot(direction), s.face.dot(direction));
            if n_l <= 0.0 || face_l <= 0.0 {
                continue;
            }
            shaded += 1;
            let mut reflectance = diffuse_reflectance(&s, view, direction);
            if is_glossy && mirrored.dot(direction) < shade.cone_cosine {
                let spread_rad = if shade.cone_cosine <= 1.0 { 0.0 } else { light.spread_rad };
                reflectance += specular_reflectance(&s, view, direction, spread_rad, energy);
            }
            let lit = lit(number, light.tile, light.spread_rad);
            sum += factor
                * terminator(n_l, face_l, face_n)
                * n_l
                * lit
                * Vec3::from(light.irradiance)
                * reflectance;
        }
        if is_glossy && shade.cone_cosine <= 1.0 {
            let table = 6 * shade.table_side * shade.table_side;
            let cell = table + cube_cell(mirrored.to_array(), shade.low_table_side);
            first = (shade.low_first_word + self.region_tables[cell as usize] * shade.low_stride) as usize;
            count = self.region_lists[first];
            factor = f32::from_bits(self.region_lists[first + 1]);
            looked_at += count;
            for i in 0..count {
                let number = self.region_lists[first + 2 + i as usize];
                let light = &self.lights[(shade.high_count + number) as usize];
                let direction = Vec3::from(light.direction);
                let (n_l, face_l) = (s.normal.dot(direction), s.face.dot(direction));
                if mirrored.dot(direction) < shade.cone_cosine || n_l <= 0.0 || face_l <= 0.0 {
                    continue;
                }
                shaded += 1;
                let reflectance = specular_reflectance(&s, view, direction, light.spread_rad, energy);
                let lit = lit(number, light.tile, light.spread_rad);
                sum += factor
                    * terminator(n_l, face_l, face_n)
                    * n_l
                    * lit
                    * Vec3::from(light.irradiance)
                    * reflectance;
            }
        }
        ((sample.weight * sum).to_array(), [looked_at, shaded])
    }
}
