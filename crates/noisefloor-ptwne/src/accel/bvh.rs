//! The hierarchy, and what it says of a hit.

use super::leaf::{Leaf, Pack, Round, RoundShape};
use super::node::Node;
use crate::math::Vec3;
use glam::Vec4;

/// Where a ray hit a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    /// Distance along the ray; infinite for a miss.
    pub(crate) t: f32,
    /// The surface, in the order of the hierarchy: see [`Bvh::shape_at`].
    pub(super) slot: u32,
    /// Coordinates along the edges of a planar surface.
    pub(crate) uv: [f32; 2],
}

pub(super) const MISS: Hit = Hit { t: f32::INFINITY, slot: u32::MAX, uv: [0.0; 2] };

impl Hit {
    #[inline]
    pub(crate) fn is_miss(&self) -> bool {
        self.slot == u32::MAX
    }
}

/// Flags the slot of a round surface.
pub(super) const ROUND: u32 = 1 << 31;

#[derive(Clone, Debug)]
pub(crate) struct Bvh {
    pub(super) nodes: Vec<Node>,
    pub(super) leaves: Vec<Leaf>,
    pub(super) packs: Vec<Pack>,
    pub(super) rounds: Vec<Round>,
    /// Entries that a [`Stack`] needs.
    pub(super) stack: usize,
    pub(super) bounds: [Vec3; 2],
}

/// Nodes still to visit, with the distance at which each begins. Allocated once per job, so that no path
/// allocates.
#[derive(Clone, Debug)]
pub(crate) struct Stack(pub(super) Vec<(u32, f32)>);

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
    /// Lowest and highest corner of the bounding box of all surfaces.
    pub(crate) fn bounds(&self) -> [Vec3; 2] {
        self.bounds
    }

    /// A stack for the nodes that a traversal of this hierarchy can leave behind.
    pub(crate) fn stack(&self) -> Stack {
        Stack(vec![(0, 0.0); self.stack])
    }

    /// The index of the surface that was hit, and its shape there. The hit must not be a miss.
    #[inline]
    pub(crate) fn shape_at(&self, hit: &Hit) -> (u32, HitShape) {
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
    pub(crate) fn edges(&self, hit: &Hit) -> Option<[Vec3; 2]> {
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
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
            + size_of_val(self.leaves.as_slice())
            + size_of_val(self.packs.as_slice())
            + size_of_val(self.rounds.as_slice())
    }
}
