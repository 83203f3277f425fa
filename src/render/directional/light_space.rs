//! The projections of lights to shadow maps: CPU twin of `shaders/directional/light_space.wgsl`, function by
//! function.

use crate::scene::Bounds;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;

/// Source of the functions that the passes share.
pub(super) const SOURCE: &str = include_str!("../../../shaders/directional/light_space.wgsl");

/// The parameters of the scene and the atlas for both passes.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
pub(in crate::render) struct LightSpace {
    pub caster_centre: Vec3,
    pub tile_px: f32,
    pub caster_half: Vec3,
    pub tiles_per_side: u32,
}

impl LightSpace {
    /// Light space for a non-empty box around the casters.
    pub fn new(casters: &Bounds, tile_px: u32, tiles_per_side: u32) -> Self {
        Self {
            caster_centre: casters.centre(),
            tile_px: tile_px as f32,
            caster_half: casters.half_extents(),
            tiles_per_side,
        }
    }
}

#[cfg(test)]
pub(super) mod twin {
    use super::LightSpace;
    use glam::{Mat3, Vec2, Vec3};

    #[derive(Clone, Copy, Debug)]
    pub(in crate::render) struct Window {
        pub centre: Vec2,
        pub half: Vec2,
        pub top: f32,
        pub range: f32,
    }

    pub(in crate::render) fn light_basis(d: Vec3) -> Mat3 {
        let s = if d.y > -0.5 { 1.0 } else { -1.0 };
        let a = -1.0 / (s + d.y);
        let b = d.x * d.z * a;
        Mat3::from_cols(
            Vec3::new(1.0 + s * d.x * d.x * a, -s * d.x, s * b),
            Vec3::new(b, -d.z, s + d.z * d.z * a),
            d,
        )
    }

    pub(in crate::render) fn light_window(basis: &Mat3, space: &LightSpace) -> Window {
        let across = basis.transpose();
        let extent = Mat3::from_cols(basis.x_axis.abs(), basis.y_axis.abs(), basis.z_axis.abs()).transpose();
        let (caster, half) = (across * space.caster_centre, extent * space.caster_half);
        let margin = 1e-3 * half.z + 1e-6 * (caster.z.abs() + half.x + half.y);
        let border = space.tile_px / (space.tile_px - 4.0);
        Window {
            centre: caster.truncate(),
            half: (half.truncate() * border).max(Vec2::splat(1e-6)),
            top: caster.z + half.z + margin,
            range: (2.0 * (half.z + margin)).max(1e-6),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::twin::{light_basis, light_window};
    use super::*;
    use crate::gpu::layout::{assert_layout, members};
    use lightcast_core::math::fibonacci_sphere;
    use lightcast_core::sampling::halton;

    #[test]
    fn the_struct_lies_as_the_shader_reads_it() {
        assert_layout(
            SOURCE,
            "LightSpace",
            size_of::<LightSpace>(),
            members!(LightSpace: caster_centre, tile_px, caster_half, tiles_per_side),
        );
    }

    #[test]
    fn axes_are_orthonormal_and_turn_smoothly_down_to_30_degrees_below_the_horizon() {
        for d in
            fibonacci_sphere(5000).map(|d| d.as_vec3()).chain([Vec3::Y, Vec3::NEG_Y, Vec3::X, Vec3::NEG_Z])
        {
            let basis = light_basis(d);
            let identity = basis.transpose() * basis;
            assert!(identity.abs_diff_eq(glam::Mat3::IDENTITY, 2e-6), "{d}: {identity}");
            let near = (d + 1e-3 * Vec3::new(0.6, -0.64, 0.48)).try_normalize().expect("not zero");
            if d.y > -0.49 && near.y > -0.49 {
                assert!(basis.abs_diff_eq(light_basis(near), 5e-3), "{d}");
            }
        }
    }

    #[test]
    fn the_window_holds_every_caster_and_no_more_than_it_must() {
        let casters = Bounds { min: Vec3::new(-1.0, 0.0, -2.0), max: Vec3::new(0.5, 3.0, 1.0) };
        let space = LightSpace::new(&casters, 256, 9);
        for d in fibonacci_sphere(500).map(|d| d.as_vec3()) {
            let basis = light_basis(d);
            let window = light_window(&basis, &space);
            let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
            for corner in casters.corners() {
                let light = basis.transpose() * corner;
                (low, high) = (low.min(light), high.max(light));
                let place = (light.truncate() - window.centre) / window.half;
                assert!(place.abs().max_element() < 0.99, "{d}: {place}");
            }
            let tight = 0.5 * (high - low).truncate() * (256.0 / 252.0);
            assert!(window.half.abs_diff_eq(tight, 1e-5), "{d}: {} {tight}", window.half);
            assert!((window.range / (high.z - low.z) - 1.001).abs() < 1e-4, "{d}: {window:?}");
        }
    }

    #[test]
    fn rounding_clips_no_caster() {
        for i in 1..3000 {
            let number = |base| halton(i, base) as f32;
            let first = Vec3::new(number(2), number(3), number(5));
            let casters = Bounds::of([first, Vec3::new(number(7), number(11), number(13))]);
            let space = LightSpace::new(&casters, 256, 9);
            for d in [Vec3::Y, Vec3::X, Vec3::NEG_Z, Vec3::NEG_Y, Vec3::new(0.6, 0.8, 0.0)] {
                let basis = light_basis(d);
                let window = light_window(&basis, &space);
                for place in casters.corners() {
                    let depth = (window.top - (basis.transpose() * place).z) / window.range;
                    assert!(depth > 0.0 && depth < 1.0, "{casters:?} {d}: {depth}");
                }
            }
        }
    }
}
