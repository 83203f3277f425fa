//! Animation of nodes as glTF 2.0 defines it (section 3.11 and appendix C).

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
}

/// How one property of one node changes over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Index of the node, whose transform is a [`Transform::Trs`].
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
