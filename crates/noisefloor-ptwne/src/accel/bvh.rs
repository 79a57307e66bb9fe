//! A hierarchy of surfaces, and what it says of a hit.

use super::leaf::{Leaf, Pack, Round, RoundShape};
use super::tree::Tree;
use crate::geometry::NO;
use crate::math::Vec3;
use glam::Vec4;

/// Where a ray hit a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    /// Distance along the ray; infinite for a miss.
    pub(crate) t: f32,
    /// The surface, in the order of its hierarchy: see [`Bvh::shape_at`].
    pub(super) slot: u32,
    /// The instance that it is of; [`NO`] if it is of none.
    pub(super) instance: u32,
    /// Coordinates along the edges of a planar surface.
    pub(crate) uv: [f32; 2],
}

pub(super) const MISS: Hit = Hit { t: f32::INFINITY, slot: NO, instance: NO, uv: [0.0; 2] };

impl Hit {
    #[inline]
    pub(crate) fn is_miss(&self) -> bool {
        self.slot == NO
    }
}

/// Flags the slot of a round surface.
pub(super) const ROUND: u32 = 1 << 31;

/// A hierarchy over surfaces.
#[derive(Clone, Debug)]
pub(crate) struct Bvh {
    pub(super) tree: Tree,
    pub(super) leaves: Vec<Leaf>,
    pub(super) packs: Vec<Pack>,
    pub(super) rounds: Vec<Round>,
    /// Lowest and highest corner of the bounding box of all surfaces, if there are any.
    pub(super) bounds: Option<[Vec3; 2]>,
}

/// The shape that a ray hit.
#[derive(Clone, Copy, Debug)]
pub(crate) enum HitShape {
    Plane {
        /// Any point of the plane.
        point: Vec3,
        /// Unit normal of the front.
        normal: Vec3,
    },
    Sphere {
        centre: Vec3,
        radius: f32,
    },
}

impl Bvh {
    /// The index of the surface that was hit, and its shape there. The hit must not be a miss.
    #[inline]
    pub(super) fn shape_at(&self, hit: &Hit) -> (u32, HitShape) {
        if hit.slot & ROUND == 0 {
            let (pack, lane) = (&self.packs[(hit.slot >> 2) as usize], (hit.slot & 3) as usize);
            let at = |v: &[Vec4; 3]| Vec3::new(v[0][lane], v[1][lane], v[2][lane]);
            let shape = HitShape::Plane { point: at(&pack.corner), normal: at(&pack.normal) };
            return (pack.prim[lane], shape);
        }
        let round = &self.rounds[(hit.slot & !ROUND) as usize];
        let shape = match round.shape {
            RoundShape::Sphere { radius } => HitShape::Sphere { centre: round.centre, radius },
            RoundShape::Disk { normal, .. } => HitShape::Plane { point: round.centre, normal },
        };
        (round.prim, shape)
    }

    /// The edges of the planar surface or ellipse that was hit, along which its coordinates run; none for
    /// spheres.
    pub(super) fn edges(&self, hit: &Hit) -> Option<[Vec3; 2]> {
        let [normal, u, v] = if hit.slot & ROUND == 0 {
            self.packs[(hit.slot >> 2) as usize].plane((hit.slot & 3) as usize)
        } else {
            match self.rounds[(hit.slot & !ROUND) as usize].shape {
                RoundShape::Sphere { .. } => return None,
                RoundShape::Disk { normal, dual_u, dual_v } => [normal, dual_u, dual_v],
            }
        };
        // The dual basis of the dual basis
        let inverse = normal.dot(u.cross(v)).recip();
        Some([v.cross(normal) * inverse, normal.cross(u) * inverse])
    }

    /// Memory that the hierarchy takes, in bytes.
    pub(super) fn bytes(&self) -> usize {
        self.tree.bytes()
            + size_of_val(self.leaves.as_slice())
            + size_of_val(self.packs.as_slice())
            + size_of_val(self.rounds.as_slice())
    }
}
