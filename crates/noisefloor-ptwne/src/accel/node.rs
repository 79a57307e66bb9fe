//! A ray, and the eight boxes of a node.

use crate::math::{Ray, Vec3};
use glam::Vec4;

/// Flags a child that is a leaf; the other bits are its index.
pub(super) const LEAF: u32 = 1 << 31;

/// How many boxes a node has.
pub(super) const WIDTH: usize = 8;

#[derive(Clone, Copy, Debug)]
#[repr(C, align(32))]
pub(super) struct Lanes(pub(super) [Vec4; 2]);

/// Eight boxes: the lower and upper bounds along each axis.
#[derive(Clone, Debug)]
pub(super) struct Node {
    pub(super) bounds: [[Lanes; 2]; 3],
    pub(super) child: [u32; WIDTH],
}

/// What a ray is to boxes.
pub(super) struct WideRay {
    pub(super) origin: [f32; 3],
    pub(super) dir: [f32; 3],
    inverse: [f32; 3],
    /// `origin`·`inverse`.
    shift: [f32; 3],
    /// Along each axis, the bound by which the ray enters.
    enter: [usize; 3],
}

impl WideRay {
    #[inline(always)]
    pub(super) fn new(ray: &Ray) -> Self {
        // Keep inverses finite, so that 0·∞ cannot arise
        let tiny = ray.dir.abs().cmplt(Vec3::splat(1e-18));
        let inverse = Vec3::select(tiny, Vec3::splat(1e-18).copysign(ray.dir), ray.dir).recip();
        Self {
            origin: ray.origin.to_array(),
            dir: ray.dir.to_array(),
            inverse: inverse.to_array(),
            shift: (ray.origin * inverse).to_array(),
            enter: ray.dir.to_array().map(|d| usize::from(d.is_sign_negative())),
        }
    }
}

impl Lanes {
    pub(super) const fn splat(x: f32) -> Self {
        Self([Vec4::splat(x); 2])
    }

    #[inline(always)]
    pub(super) fn at(&self, lane: usize) -> f32 {
        self.0[lane >> 2 & 1][lane & 3]
    }

    pub(super) fn set(&mut self, lane: usize, to: f32) {
        self.0[lane >> 2 & 1][lane & 3] = to;
    }

    #[inline(always)]
    pub(super) fn to_array(self) -> [f32; WIDTH] {
        let [a, b] = self.0.map(|half| half.to_array());
        [a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3]]
    }
}

/// By how much rays leave boxes later than computed, relative to the distance: rounding must not miss a box (Ize
/// 2013, "Robust BVH Ray Traversal").
const LATE: f32 = 1.000_001;

/// A box that the ray leaves where it begins has nothing ahead, as those of all surfaces in the plane of a lamp.
const AHEAD: f32 = f32::MIN_POSITIVE;

impl Node {
    pub(super) const EMPTY: Self =
        Self { bounds: [[Lanes::splat(f32::MAX), Lanes::splat(f32::MIN)]; 3], child: [LEAF; WIDTH] };

    /// Where the ray enters each box, and a mask of the boxes that it meets before `t_max`.
    #[inline(always)]
    pub(super) fn meet(&self, ray: &WideRay, t_max: f32) -> (Lanes, u32) {
        let half = |half: usize| {
            let at = |i: usize, end: usize| {
                let bound = self.bounds[i][end & 1].0[half];
                bound * Vec4::splat(ray.inverse[i]) - Vec4::splat(ray.shift[i])
            };
            let near = |i: usize| at(i, ray.enter[i]);
            let far = |i: usize| at(i, 1 - ray.enter[i]);
            let enter = near(0).max(near(1)).max(near(2).max(Vec4::splat(AHEAD)));
            let leave = far(0).min(far(1)).min(far(2)) * LATE;
            (enter, enter.cmple(leave.min(Vec4::splat(t_max))).bitmask())
        };
        let ((low, low_mask), (high, high_mask)) = (half(0), half(1));
        (Lanes([low, high]), low_mask | high_mask << 4)
    }

    /// The same with AVX, to the bit.
    #[cfg(target_arch = "x86_64")]
    #[inline]
    #[target_feature(enable = "avx2")]
    pub(super) fn meet_avx2(&self, ray: &WideRay, t_max: f32) -> (Lanes, u32) {
        use std::arch::x86_64::*;
        let wide = |lanes: &Lanes| _mm256_set_m128(lanes.0[1].into(), lanes.0[0].into());
        let at = |i: usize, end: usize| {
            let bound = wide(&self.bounds[i][end & 1]);
            _mm256_sub_ps(_mm256_mul_ps(bound, _mm256_set1_ps(ray.inverse[i])), _mm256_set1_ps(ray.shift[i]))
        };
        let near = |i: usize| at(i, ray.enter[i]);
        let far = |i: usize| at(i, 1 - ray.enter[i]);
        let enter =
            _mm256_max_ps(_mm256_max_ps(near(0), near(1)), _mm256_max_ps(near(2), _mm256_set1_ps(AHEAD)));
        let leave = _mm256_min_ps(_mm256_min_ps(far(0), far(1)), far(2));
        let leave = _mm256_mul_ps(leave, _mm256_set1_ps(LATE));
        let leave = _mm256_min_ps(leave, _mm256_set1_ps(t_max));
        let mask = _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(enter, leave));
        let halves = [_mm256_castps256_ps128(enter), _mm256_extractf128_ps::<1>(enter)];
        (Lanes(halves.map(Vec4::from)), mask as u32)
    }
}
