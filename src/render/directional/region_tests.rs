//! The pass that sorts lights into angular regions against its twin, `light::Regions::assign`.

use super::lights::GpuLight;
use super::regions::{Assignment, HEAD_WORDS, RegionPass, RegionSet};
use crate::gpu::{Array, Gpu, Timer, read_buffer};
use crate::render::test_scenes::sky;
use lightcast_core::light::{Light, RegionLists, Regions};

/// Lists built on the device for lights that follow `before` others in the buffer, stored from word
/// `first_word` on.
fn lists_of_device(
    gpu: &Gpu,
    pass: &RegionPass,
    set: &mut RegionSet,
    lights: &[Light],
    capacity: u32,
) -> Vec<u32> {
    let (before, first_word) = (3, 17);
    let of_device = |light: &Light| GpuLight {
        direction: light.direction,
        spread_rad: light.spread_rad,
        irradiance: light.irradiance,
        tile: 0,
    };
    let others = [GpuLight { irradiance: [1.0; 3], ..GpuLight::default() }; 3];
    let all: Vec<GpuLight> = others.into_iter().chain(lights.iter().map(of_device)).collect();
    let usage = wgpu::BufferUsages::STORAGE;
    let mut buffer = Array::new(gpu, "lights", usage, all.len());
    buffer.write(gpu, &all);
    let assignment =
        Assignment { first_light: before, light_count: lights.len() as u32, capacity, first_word };
    set.set(gpu, assignment);
    let words = first_word as usize + set.regions.count() * assignment.stride() as usize;
    let lists: Array<u32> = Array::new(gpu, "lists", usage | wgpu::BufferUsages::COPY_SRC, words);
    let bind_group = pass.bind_group(gpu, set, &buffer, &lists);
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    pass.encode(&mut encoder, &mut Timer::new(gpu), [(&*set, &bind_group)].into_iter());
    gpu.queue.submit([encoder.finish()]);
    let mut read = Vec::new();
    read_buffer(gpu, lists.buffer(), words, &mut read).unwrap();
    assert_eq!(read[..first_word as usize], [0; 17], "words before the lists");
    read.split_off(first_word as usize)
}

#[test]
fn lists_equal_those_of_the_twin() {
    let Some(gpu) = Gpu::for_test() else { return };
    let pass = RegionPass::new(&gpu);
    let mut expected = RegionLists::default();
    for regions in [Regions::for_normals(), Regions::for_cones(0.7), Regions::new(1, 0.0)] {
        let mut set = RegionSet::new(&gpu, regions);
        for count in [0, 1, 63, 64, 65, 2000] {
            let mut lights = sky(count);
            for (index, light) in lights.iter_mut().enumerate() {
                match index % 11 {
                    3 => light.irradiance = [0.0; 3],
                    5 => light.irradiance = [0.0, 0.0, 2.0],
                    _ => {}
                }
            }
            for capacity in [count, 216, 40, 1, 0] {
                set.regions.assign(&lights, capacity as usize, &mut expected);
                let found = lists_of_device(&gpu, &pass, &mut set, &lights, capacity);
                for (region, list) in found.chunks_exact((capacity + HEAD_WORDS) as usize).enumerate() {
                    let kept = expected.kept(region);
                    let about = format!("{count} lights, capacity {capacity}, region {region}");
                    assert_eq!(list[0] as usize, kept.len(), "{about}");
                    assert_eq!(list[2..][..kept.len()], *kept, "{about}");
                    let (factor, exact) = (f32::from_bits(list[1]), expected.factors[region]);
                    assert!((factor / exact - 1.0).abs() < 1e-5, "{about}: {factor} {exact}");
                }
            }
        }
    }
}
