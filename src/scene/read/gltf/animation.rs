//! Animations of glTF files.

use super::accessor::{Buffers, floats};
use crate::error::{Error, Result};
use crate::scene::read::notes::add_note;
use crate::scene::{Channel, Interpolation, Keys, Scene, Transform};
use glam::{Quat, Vec3};
use gltf::animation::Property;

/// Most keys of all channels together.
const MAX_KEYS: usize = 1 << 22;

/// Reads the channels of all animations that move nodes of the scene or change weights. `places` maps every node of the file to
/// its index in the scene, `numbers` every channel
/// of an animation to its number in the file.
pub(super) fn read(
    gltf: &gltf::Document,
    numbers: &[Vec<usize>],
    buffers: &Buffers,
    places: &[Option<usize>],
    scene: &mut Scene,
) -> Result<()> {
    let mut keys_left = MAX_KEYS;
    for (animation, numbers) in gltf.animations().zip(numbers) {
        let first = scene.channels.len();
        for (channel, number) in animation.channels().zip(numbers) {
            let Some(node) = places[channel.target().node().index()] else { continue };
            let targets = targets(&channel);
            if channel.target().property() == Property::MorphTargetWeights && targets == 0 {
                add_note(&mut scene.notes, "weights of meshes without morph targets left out");
                continue;
            }
            let channel =
                read_channel(&channel, node, targets, scene, buffers, &mut keys_left).map_err(|error| {
                    error.at(format_args!("animation {}, channel {number}", animation.index()))
                })?;
            scene.channels.push(channel);
        }
        let own = &mut scene.channels[first..];
        let last = own.iter().filter_map(|channel| channel.times_s.last()).fold(0.0, |a: f32, b| a.max(*b));
        own.iter_mut().for_each(|channel| channel.duration_s = last);
    }
    // The sort is stable: of two channels that change the same property the later one stays the later one.
    scene.channels.sort_by_key(|channel| channel.node);
    let same = |a: &Channel, b: &Channel| std::mem::discriminant(&a.keys) == std::mem::discriminant(&b.keys);
    if scene.channels.chunk_by(|a, b| a.node == b.node).any(|channels| {
        // At most a handful of channels move one node, except in hostile files; for those the first few
        // suffice.
        let few = &channels[..channels.len().min(16)];
        channels.len() > 16 || (1..few.len()).any(|i| few[..i].iter().any(|other| same(other, &few[i])))
    }) {
        add_note(
            &mut scene.notes,
            "several animations move the same node; all play at once, the last one wins",
        );
    }
    Ok(())
}

fn read_channel(
    channel: &gltf::animation::Channel,
    node: usize,
    targets: usize,
    scene: &Scene,
    buffers: &Buffers,
    keys_left: &mut usize,
) -> Result<Channel> {
    let moves_node = channel.target().property() != Property::MorphTargetWeights;
    if moves_node && matches!(scene.nodes[node].transform, Transform::Matrix(_)) {
        return Err(Error::usage(
            "moves a node that has a matrix; animated nodes have translation, rotation, scale",
        ));
    }
    let sampler = channel.sampler();
    let (count, values) = (sampler.input().count(), sampler.output().count());
    let (interpolation, each): (_, usize) = match sampler.interpolation() {
        gltf::animation::Interpolation::Step => (Interpolation::Step, 1),
        gltf::animation::Interpolation::Linear => (Interpolation::Linear, 1),
        gltf::animation::Interpolation::CubicSpline => (Interpolation::CubicSpline, 3),
    };
    let each_time = if moves_node { each } else { each.saturating_mul(targets) };
    if count == 0 || count.checked_mul(each_time) != Some(values) {
        return Err(Error::usage(format!(
            "has {count} times but {values} values; {each_time} for each is needed"
        )));
    }
    *keys_left = keys_left.checked_sub(values).ok_or_else(|| {
        Error::usage(format!("is too long: at most {MAX_KEYS} values are read of all animations"))
    })?;

    let times_s: Vec<f32> = floats::<1>(&sampler.input(), buffers)?.into_iter().map(|[time]| time).collect();
    // This also rejects NaN; an infinite last key is rejected as well.
    let is_increasing = times_s.windows(2).all(|pair| pair[0] < pair[1]);
    if !(times_s[0] >= 0.0 && is_increasing && times_s[count - 1].is_finite()) {
        return Err(Error::usage(
            "is damaged: its times are not strictly increasing from 0 or later, and finite",
        ));
    }
    let vectors = || -> Result<Vec<Vec3>> {
        Ok(finite(floats::<3>(&sampler.output(), buffers)?)?.into_iter().map(Vec3::from).collect())
    };
    let keys = match channel.target().property() {
        Property::Translation => Keys::Translation(vectors()?),
        Property::Scale => Keys::Scale(vectors()?),
        Property::MorphTargetWeights => {
            let weights = finite(floats::<1>(&sampler.output(), buffers)?)?;
            Keys::Weights(weights.into_iter().map(|[weight]| weight).collect())
        }
        _ => {
            let mut keys: Vec<Quat> =
                finite(floats::<4>(&sampler.output(), buffers)?)?.into_iter().map(Quat::from_array).collect();
            for (number, key) in keys.iter_mut().enumerate().skip(each / 2).step_by(each) {
                let unit = glam::Vec4::from(*key).try_normalize();
                *key = Quat::from_vec4(unit.ok_or_else(|| {
                    Error::usage(format!("is damaged: rotation {number} (counted from 0) has no length"))
                })?);
            }
            Keys::Rotation(keys)
        }
    };
    Ok(Channel { node, duration_s: 0.0, interpolation, times_s, keys })
}

/// How many morph targets the mesh has whose node a channel changes.
fn targets(channel: &gltf::animation::Channel) -> usize {
    let node = channel.target().node();
    let mesh = node.mesh();
    let primitives = mesh.iter().flat_map(gltf::Mesh::primitives);
    primitives.map(|primitive| primitive.morph_targets().len()).max().unwrap_or(0)
}

fn finite<const N: usize>(values: Vec<[f32; N]>) -> Result<Vec<[f32; N]>> {
    match values.iter().position(|value| value.iter().any(|x| !x.is_finite())) {
        None => Ok(values),
        Some(at) => Err(Error::usage(format!("is damaged: value {at} (counted from 0) is not finite"))),
    }
}
