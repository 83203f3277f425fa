//! Animation of nodes as glTF 2.0 defines it (section 3.11 and appendix C).

use super::{Scene, Transform};
use glam::{Mat4, Quat, Vec3, Vec4};
use std::ops::{Add, Mul};

/// How values between two keys are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Interpolation {
    /// The value of the earlier key.
    Step,
    /// A straight line; for rotations the shorter arc at constant speed.
    Linear,
    /// A cubic Hermite spline with the tangents of the file; rotations are normalised afterwards.
    CubicSpline,
}

/// What a channel changes, with one value for every key, or, for [`Interpolation::CubicSpline`], three: in-tangent
/// (per second), value, out-tangent.
#[derive(Clone, Debug, PartialEq)]
pub enum Keys {
    /// In the parent's units.
    Translation(Vec<Vec3>),
    /// Unit quaternions (tangents are of any length).
    Rotation(Vec<Quat>),
    /// Factors along the node's axes.
    Scale(Vec<Vec3>),
}

/// How one property of one node goes with time.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Index of the node, whose transform is a [`Transform::Trs`].
    pub node: usize,
    /// Duration of the animation that the channel belongs to: the last key of all its channels. It starts again
    /// after it. >= 0.
    pub duration_s: f32,
    /// How it goes between keys.
    pub interpolation: Interpolation,
    /// Times of the keys, strictly increasing, >= 0, at least one. Before the first and after the last one the value
    /// stays.
    pub times_s: Vec<f32>,
    /// The values.
    pub keys: Keys,
}

impl Scene {
    /// Whether anything moves.
    pub fn is_animated(&self) -> bool {
        !self.channels.is_empty()
    }

    /// Duration of the longest animation in seconds; 0 where nothing moves.
    pub fn duration_s(&self) -> f64 {
        self.channels.iter().map(|channel| f64::from(channel.duration_s)).fold(0.0, f64::max)
    }

    /// Where every instance stands at `time_s`: one matrix from the frame of its mesh to the world for each of
    /// [`Scene::instances`]. Allocates nothing once `world_from_mesh` has room for all nodes and instances.
    ///
    /// All animations play at the same time, each again and again over its own duration; at its end it jumps to its
    /// start. Of two channels that change the same property of a node the later one wins. A `time_s` that is not
    /// finite counts as 0, a negative one goes back from the end.
    ///
    /// A matrix may mirror (negative determinant): the winding of the mesh is then turned round, and so must be what
    /// the renderer takes for front faces. Normals go with the inverse transpose, or with the matrix of cofactors
    /// times the sign of the determinant, which exists where a scale is zero, too. A matrix that overflows is given
    /// as zeros, which draw nothing.
    pub fn pose(&self, time_s: f64, world_from_mesh: &mut Vec<Mat4>) {
        let time_s = if time_s.is_finite() { time_s } else { 0.0 };
        // First the nodes, which the instances behind them then refer to.
        world_from_mesh.clear();
        let mut channels = self.channels.iter().peekable();
        for (number, node) in self.nodes.iter().enumerate() {
            let mut transform = node.transform;
            while let Some(channel) = channels.next_if(|channel| channel.node == number) {
                channel.apply(time_s, &mut transform);
            }
            let local = transform.parent_from_node();
            let world = match node.parent {
                Some(parent) => world_from_mesh[parent] * local,
                None => local,
            };
            world_from_mesh.push(if world.is_finite() { world } else { Mat4::ZERO });
        }
        for instance in &self.instances {
            world_from_mesh.push(world_from_mesh[instance.node]);
        }
        world_from_mesh.drain(..self.nodes.len());
    }
}

impl Channel {
    /// Puts the value at `time_s` into `transform`, which stays as it is if it is a matrix.
    fn apply(&self, time_s: f64, transform: &mut Transform) {
        let Transform::Trs { translation, rotation, scale } = transform else { return };
        match &self.keys {
            Keys::Translation(keys) => *translation = self.value(keys, time_s, Vec3::lerp),
            Keys::Scale(keys) => *scale = self.value(keys, time_s, Vec3::lerp),
            Keys::Rotation(keys) => {
                let value = self.value(keys, time_s, Quat::slerp);
                // A spline may pass through zero, where it has no direction.
                *rotation = Vec4::from(value).try_normalize().map_or(Quat::IDENTITY, Quat::from_vec4);
            }
        }
    }

    fn value<T>(&self, keys: &[T], time_s: f64, between: impl Fn(T, T, f32) -> T) -> T
    where
        T: Copy + Add<Output = T> + Mul<f32, Output = T>,
    {
        let duration = f64::from(self.duration_s);
        let time = if duration > 0.0 { time_s.rem_euclid(duration) } else { 0.0 };
        let stride = if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let value = |key: usize| keys[key * stride + stride / 2];
        let later = self.times_s.partition_point(|key| f64::from(*key) <= time);
        if later == 0 {
            return value(0);
        }
        if later == self.times_s.len() {
            return value(later - 1);
        }
        let (start, end) = (f64::from(self.times_s[later - 1]), f64::from(self.times_s[later]));
        let step = end - start;
        let t = (time - start) / step;
        match self.interpolation {
            Interpolation::Step => value(later - 1),
            Interpolation::Linear => between(value(later - 1), value(later), t as f32),
            Interpolation::CubicSpline => {
                let (t2, t3) = (t * t, t * t * t);
                value(later - 1) * (2.0 * t3 - 3.0 * t2 + 1.0) as f32
                    + keys[later * 3 - 1] * (step * (t3 - 2.0 * t2 + t)) as f32
                    + value(later) * (3.0 * t2 - 2.0 * t3) as f32
                    + keys[later * 3] * (step * (t3 - t2)) as f32
            }
        }
    }
}
