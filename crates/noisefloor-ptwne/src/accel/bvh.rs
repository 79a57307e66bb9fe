//! A hierarchy of surfaces, and what it says of a hit.

use super::leaf::{Leaf, Pack, Round, RoundShape};
use super::tree::Tree;
use crate::math::Vec3;
use glam::Vec4;

/// Where a ray hit a surface of a hierarchy. Of 16 bytes, which are returned in registers: a few percent of a
/// render.
#[derive(Clone, Copy, Debug)]
pub(super) struct LocalHit {
    /// Distance along the ray.
    pub(super) t: f32,
    /// The surface, in the order of the hierarchy: see [`Bvh::shape_at`]. `NO` for a miss.
    pub(super) slot: u32,
    /// Coordinates along the edges of a planar surface.
    pub(super) uv: [f32; 2],
}

/// Flags the slot of a round surface.
pub(super) const ROUND: u32 = 1 << 31;

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
    /// The index of the surface that was hit, and its shape there. The slot must not be that of a miss.
    #[inline]
    pub(super) fn shape_at(&self, slot: u32) -> (u32, HitShape) {
        if slot & ROUND == 0 {
            let (pack, lane) = (&self.packs[(slot >> 2) as usize], (slot & 3) as usize);
            let at = |v: &[Vec4; 3]| Vec3::new(v[0][lane], v[1][lane], v[2][lane]);
            let shape = HitShape::Plane { point: at(&pack.corner), normal: at(&pack.normal) };
            return (pack.prim[lane], shape);
        }
        let round = &self.rounds[(slot & !ROUND) as usize];
        let shape = match round.shape {
            RoundShape::Sphere { radius } => HitShape::Sphere { centre: round.centre, radius },
            RoundShape::Disk { normal, .. } => HitShape::Plane { point: round.centre, normal },
        };
        (round.prim, shape)
    }

    /// The edges of the planar surface or ellipse that was hit, along which its coordinates run; none for
    /// spheres.
    pub(super) fn edges(&self, slot: u32) -> Option<[Vec3; 2]> {
        let [normal, u, v] = if slot & ROUND == 0 {
            self.packs[(slot >> 2) as usize].plane((slot & 3) as usize)
        } else {
            match self.rounds[(slot & !ROUND) as usize].shape {
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
