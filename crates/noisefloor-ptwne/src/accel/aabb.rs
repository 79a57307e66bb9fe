//! Boxes along the axes.

use crate::math::Vec3;

/// The lowest and the highest corner of a box.
#[derive(Clone, Copy, Debug)]
pub(super) struct Aabb {
    pub(super) min: Vec3,
    pub(super) max: Vec3,
}

impl Aabb {
    /// The box of nothing.
    pub(super) const EMPTY: Self = Self { min: Vec3::splat(f32::MAX), max: Vec3::splat(f32::MIN) };

    pub(super) fn new(min: Vec3, max: Vec3) -> Self {
        Self { min, max }
    }

    pub(super) fn union(&self, other: &Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    pub(super) fn with(&self, point: Vec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// Twice its middle.
    pub(super) fn centre2(&self) -> Vec3 {
        self.min + self.max
    }

    /// Half its surface.
    pub(super) fn half_area(&self) -> f32 {
        let d = self.max - self.min;
        d.x * d.y + d.y * d.z + d.z * d.x
    }
}
