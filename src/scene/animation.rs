//! Animation of nodes and of morph targets as glTF 2.0 defines it (section 3.11 and appendix C).

use super::Transform;
use glam::{Quat, Vec3, Vec4};
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

/// What a channel changes, with one value for every key, or, for [`Interpolation::CubicSpline`], three:
/// in-tangent (per second), value, out-tangent.
#[derive(Clone, Debug, PartialEq)]
pub enum Keys {
    /// In the parent's units.
    Translation(Vec<Vec3>),
    /// Unit quaternions (tangents are of any length).
    Rotation(Vec<Quat>),
    /// Factors along the node's axes.
    Scale(Vec<Vec3>),
    /// Weights of the morph targets of the meshes at the node: for every value, one of each target. Not
    /// empty.
    Weights(Vec<f32>),
}

/// How one property of one node changes over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Index of the node; its transform is a [`Transform::Trs`] if the channel changes it.
    pub node: usize,
    /// Duration of the animation that the channel belongs to: the time of the last key of all its channels.
    /// The animation then starts again. >= 0.
    pub duration_s: f32,
    /// How values between keys are found.
    pub interpolation: Interpolation,
    /// Times of the keys, strictly increasing, >= 0, at least one. Before the first key and after the last
    /// one the value is constant.
    pub times_s: Vec<f32>,
    /// The values.
    pub keys: Keys,
}

impl Channel {
    /// Puts the value at `time_s` into `transform`, which is left unchanged if it is a matrix.
    pub(super) fn apply(&self, time_s: f64, transform: &mut Transform) {
        let Transform::Trs { translation, rotation, scale } = transform else { return };
        match &self.keys {
            Keys::Translation(keys) => *translation = self.value(|i| keys[i], time_s, Vec3::lerp),
            Keys::Scale(keys) => *scale = self.value(|i| keys[i], time_s, Vec3::lerp),
            Keys::Weights(_) => {}
            Keys::Rotation(keys) => {
                let value = self.value(|i| keys[i], time_s, Quat::slerp);
                // A spline may pass through zero, where it has no direction.
                *rotation = Vec4::from(value).try_normalize().map_or(Quat::IDENTITY, Quat::from_vec4);
            }
        }
    }

    /// Puts the weights at `time_s` into `weights`, if they are what the channel changes: of as many targets
    /// as there are in both.
    pub(super) fn apply_weights(&self, time_s: f64, weights: &mut [f32]) {
        let Keys::Weights(keys) = &self.keys else { return };
        let stride = if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let targets = keys.len() / (stride * self.times_s.len());
        for (target, weight) in weights.iter_mut().enumerate().take(targets) {
            let value = self.value(|i| keys[i * targets + target], time_s, |a, b, t| a + (b - a) * t);
            *weight = if value.is_finite() { value } else { 0.0 };
        }
    }

    /// The value at `time_s`, of those that `keys` gives by their places.
    fn value<T>(&self, keys: impl Fn(usize) -> T, time_s: f64, between: impl Fn(T, T, f32) -> T) -> T
    where
        T: Copy + Add<Output = T> + Mul<f32, Output = T>,
    {
        let duration = f64::from(self.duration_s);
        let time = if duration > 0.0 { time_s.rem_euclid(duration) } else { 0.0 };
        let stride = if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let value = |key: usize| keys(key * stride + stride / 2);
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
                    + keys(later * 3 - 1) * (step * (t3 - 2.0 * t2 + t)) as f32
                    + value(later) * (3.0 * t2 - 2.0 * t3) as f32
                    + keys(later * 3) * (step * (t3 - t2)) as f32
            }
        }
    }
}
