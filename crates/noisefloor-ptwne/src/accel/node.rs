//! A ray spread over four lanes, and the four boxes of a node.

use crate::math::{Ray, Vec3};
use glam::Vec4;

/// Flags a child that is a leaf; the other bits are its index.
pub(super) const LEAF: u32 = 1 << 31;

/// Four boxes: the lower and upper bounds along each axis.
#[derive(Clone, Debug)]
pub(super) struct Node {
    pub(super) bounds: [[Vec4; 2]; 3],
    pub(super) child: [u32; 4],
}

/// A ray, each of its numbers broadcast to all lanes.
pub(super) struct WideRay {
    pub(super) origin: [Vec4; 3],
    pub(super) dir: [Vec4; 3],
    inverse: [Vec4; 3],
    /// `origin`·`inverse`.
    shift: [Vec4; 3],
    /// Along each axis, the bound by which the ray enters.
    enter: [usize; 3],
}

impl WideRay {
    #[inline]
    pub(super) fn new(ray: &Ray) -> Self {
        // Keep inverses finite, so that 0·∞ cannot arise
        let tiny = ray.dir.abs().cmplt(Vec3::splat(1e-18));
        let inverse = Vec3::select(tiny, Vec3::splat(1e-18).copysign(ray.dir), ray.dir).recip();
        let (o, d, shift) = (ray.origin.to_array(), ray.dir.to_array(), (ray.origin * inverse).to_array());
        Self {
            origin: o.map(Vec4::splat),
            dir: d.map(Vec4::splat),
            inverse: inverse.to_array().map(Vec4::splat),
            shift: shift.map(Vec4::splat),
            enter: d.map(|d| usize::from(d.is_sign_negative())),
        }
    }
}

impl Node {
    pub(super) const EMPTY: Self =
        Self { bounds: [[Vec4::splat(f32::MAX), Vec4::splat(f32::MIN)]; 3], child: [LEAF; 4] };

    /// Where the ray enters each box, and a mask of the boxes that it meets before `t_max`.
    #[inline]
    pub(super) fn intersect(&self, ray: &WideRay, t_max: f32) -> (Vec4, u32) {
        let near = |i: usize| self.bounds[i][ray.enter[i]] * ray.inverse[i] - ray.shift[i];
        let far = |i: usize| self.bounds[i][1 - ray.enter[i]] * ray.inverse[i] - ray.shift[i];
        let enter = near(0).max(near(1)).max(near(2).max(Vec4::ZERO));
        // Rounding must not miss a box: Ize 2013, "Robust BVH Ray Traversal"
        let leave = far(0).min(far(1)).min(far(2)) * 1.000_001;
        (enter, enter.cmple(leave.min(Vec4::splat(t_max))).bitmask())
    }
}
