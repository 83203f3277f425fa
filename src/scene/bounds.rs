use glam::{Mat4, Vec3};

/// A box along the axes. The empty box has `min` = +infinity and `max` = -infinity, so that a union with it
/// changes nothing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest coordinates.
    pub min: Vec3,
    /// Largest coordinates.
    pub max: Vec3,
}

impl Default for Bounds {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl Bounds {
    /// The empty box, which contains no point.
    pub const EMPTY: Self = Self { min: Vec3::INFINITY, max: Vec3::NEG_INFINITY };

    /// The smallest box around `points`; empty if there are none.
    pub fn of(points: impl IntoIterator<Item = Vec3>) -> Self {
        points
            .into_iter()
            .fold(Self::EMPTY, |bounds, p| Self { min: bounds.min.min(p), max: bounds.max.max(p) })
    }

    /// Whether the box contains no point. A box of one point is not empty.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// The smallest box around both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The smallest box around the transformed box, up to rounding (centre and half extents in f32: Arvo
    /// 1990, the half extents by the absolute matrix). The transform is affine; the empty box stays empty.
    #[must_use]
    pub fn transformed(&self, transform: &Mat4) -> Self {
        if self.is_empty() {
            return Self::EMPTY;
        }
        let centre = transform.transform_point3(self.centre());
        let half = self.half_extents();
        let half = transform.x_axis.truncate().abs() * half.x
            + transform.y_axis.truncate().abs() * half.y
            + transform.z_axis.truncate().abs() * half.z;
        Self { min: centre - half, max: centre + half }
    }

    /// The middle; the origin for the empty box.
    pub fn centre(&self) -> Vec3 {
        // Halved before they are added: the sum of two large coordinates would overflow.
        if self.is_empty() { Vec3::ZERO } else { 0.5 * self.min + 0.5 * self.max }
    }

    /// Half the side lengths, >= 0; zero for the empty box.
    pub fn half_extents(&self) -> Vec3 {
        if self.is_empty() { Vec3::ZERO } else { 0.5 * self.max - 0.5 * self.min }
    }

    /// Radius of the sphere around the box, from its centre to a corner; zero for the empty box.
    pub fn radius(&self) -> f32 {
        self.half_extents().length()
    }

    /// The eight corners.
    pub fn corners(&self) -> [Vec3; 8] {
        std::array::from_fn(|i| {
            Vec3::select(glam::BVec3::new(i & 1 != 0, i & 2 != 0, i & 4 != 0), self.max, self.min)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;

    #[test]
    fn the_empty_box_changes_nothing_and_gives_no_nan() {
        let some = Bounds::of([Vec3::new(1.0, 2.0, 3.0), Vec3::new(-1.0, 5.0, 3.0)]);
        assert_eq!(some, Bounds { min: Vec3::new(-1.0, 2.0, 3.0), max: Vec3::new(1.0, 5.0, 3.0) });
        assert_eq!(some.union(&Bounds::EMPTY), some);
        assert!(Bounds::EMPTY.is_empty() && !some.is_empty());
        assert!(!Bounds::of([Vec3::ONE]).is_empty());
        assert_eq!((Bounds::EMPTY.centre(), Bounds::EMPTY.radius()), (Vec3::ZERO, 0.0));
        assert_eq!(Bounds::EMPTY.transformed(&Mat4::from_scale(Vec3::splat(-2.0))), Bounds::EMPTY);
        assert_eq!(
            (some.centre(), some.half_extents()),
            (Vec3::new(0.0, 3.5, 3.0), Vec3::new(1.0, 1.5, 0.0))
        );
    }

    #[test]
    fn a_transformed_box_is_the_box_of_its_eight_corners() {
        let some = Bounds { min: Vec3::new(-1.0, 2.0, 3.0), max: Vec3::new(1.5, 5.0, 3.25) };
        let turns = [Quat::IDENTITY, Quat::from_rotation_x(0.7), Quat::from_xyzw(0.5, -0.5, 0.1, 0.7)];
        for (turn, scale) in turns.into_iter().zip([2.0, -1.0, 0.25]) {
            let transform = Mat4::from_scale_rotation_translation(
                Vec3::new(scale, 1.0, 3.0),
                turn.normalize(),
                Vec3::new(4.0, -9.0, 0.5),
            );
            let slow = Bounds::of(some.corners().map(|corner| transform.transform_point3(corner)));
            let fast = some.transformed(&transform);
            assert!(fast.min.abs_diff_eq(slow.min, 1e-5) && fast.max.abs_diff_eq(slow.max, 1e-5), "{fast:?}");
        }
    }
}
