//! Walking the hierarchy of surfaces along a ray.

use super::bvh::{Bvh, LocalHit, ROUND};
use super::leaf::{Leaf, NO_PACK, Round, Spot};
use super::node::{Lanes, Node, WideRay};
use super::tree::Waiting;
use crate::geometry::NO;
use crate::math::Ray;
use multiversion::multiversion;
use multiversion::target::match_target;

impl Bvh {
    /// The nearest surface along the ray before `t_max`. `solid` decides whether the surface of an index stops the
    /// ray at a spot or is transparent there.
    #[inline]
    pub(super) fn closest(
        &self,
        ray: &Ray,
        t_max: f32,
        waiting: &mut Waiting,
        solid: impl Fn(u32, Spot) -> bool,
    ) -> LocalHit {
        if self.rounds.is_empty() {
            nearest::<false>(self, ray, t_max, waiting, solid)
        } else {
            nearest::<true>(self, ray, t_max, waiting, solid)
        }
    }

    #[inline(always)]
    pub(super) fn nearest<const ROUNDS: bool>(
        &self,
        ray: &Ray,
        t_max: f32,
        waiting: &mut Waiting,
        solid: impl Fn(u32, Spot) -> bool,
        meet: impl Fn(&Node, &WideRay, f32) -> (Lanes, u32),
    ) -> LocalHit {
        let wide = WideRay::new(ray);
        let mut best = LocalHit { t: t_max, slot: NO, uv: [0.0; 2] };
        self.tree.nearest(&wide, t_max, waiting, meet, |leaf| {
            self.closest_in_leaf::<ROUNDS>(leaf, ray, &wide, &mut best, &solid);
            best.t
        });
        best
    }

    #[inline(always)]
    fn closest_in_leaf<const ROUNDS: bool>(
        &self,
        index: u32,
        ray: &Ray,
        wide: &WideRay,
        best: &mut LocalHit,
        solid: &impl Fn(u32, Spot) -> bool,
    ) {
        let leaf = self.leaf_of::<ROUNDS>(index);
        if leaf.pack != NO_PACK {
            let pack = &self.packs[leaf.pack as usize];
            let (t, u, v, mut mask) = pack.intersect(wide, best.t);
            if mask != 0 {
                let (t, u, v) = (t.to_array(), u.to_array(), v.to_array());
                while mask != 0 {
                    let lane = mask.trailing_zeros() as usize & 3;
                    mask &= mask - 1;
                    if t[lane] < best.t
                        && solid(pack.prim[lane], pack.spot(lane, [u[lane], v[lane]], ray.dir))
                    {
                        let (slot, uv) = (leaf.pack << 2 | lane as u32, [u[lane], v[lane]]);
                        *best = LocalHit { t: t[lane], slot, uv };
                    }
                }
            }
        }
        if ROUNDS {
            for index in leaf.first_round..leaf.first_round + leaf.rounds {
                let round = &self.rounds[index as usize];
                if let Some((t, spot)) = round.meets(ray, best.t, solid) {
                    let uv = if let Spot::Plane { uv, .. } = spot { uv } else { [0.0; 2] };
                    *best = LocalHit { t, slot: ROUND | index, uv };
                }
            }
        }
    }

    /// Without round surfaces each leaf is one pack of the same index.
    #[inline(always)]
    fn leaf_of<const ROUNDS: bool>(&self, index: u32) -> Leaf {
        if ROUNDS { self.leaves[index as usize] } else { Leaf { pack: index, first_round: 0, rounds: 0 } }
    }

    /// Whether any surface lies on the ray before `t_max`. `OPACITY` says whether `solid` needs to be asked.
    #[inline]
    pub(super) fn blocked<const OPACITY: bool>(
        &self,
        ray: &Ray,
        t_max: f32,
        waiting: &mut Waiting,
        solid: impl Fn(u32, Spot) -> bool,
    ) -> bool {
        if self.rounds.is_empty() {
            any::<false, OPACITY>(self, ray, t_max, waiting, solid)
        } else {
            any::<true, OPACITY>(self, ray, t_max, waiting, solid)
        }
    }

    #[inline(always)]
    pub(super) fn any<const ROUNDS: bool, const OPACITY: bool>(
        &self,
        ray: &Ray,
        t_max: f32,
        waiting: &mut Waiting,
        solid: impl Fn(u32, Spot) -> bool,
        meet: impl Fn(&Node, &WideRay, f32) -> (Lanes, u32),
    ) -> bool {
        let wide = WideRay::new(ray);
        self.tree.any(&wide, t_max, waiting, meet, |leaf| {
            self.blocked_in_leaf::<ROUNDS, OPACITY>(leaf, ray, &wide, t_max, &solid)
        })
    }

    #[inline(always)]
    fn blocked_in_leaf<const ROUNDS: bool, const OPACITY: bool>(
        &self,
        index: u32,
        ray: &Ray,
        wide: &WideRay,
        t_max: f32,
        solid: &impl Fn(u32, Spot) -> bool,
    ) -> bool {
        let leaf = self.leaf_of::<ROUNDS>(index);
        if leaf.pack != NO_PACK {
            let pack = &self.packs[leaf.pack as usize];
            let (_, u, v, mut mask) = pack.intersect(wide, t_max);
            if !OPACITY && mask != 0 {
                return true;
            }
            while mask != 0 {
                let lane = mask.trailing_zeros() as usize & 3;
                mask &= mask - 1;
                if solid(pack.prim[lane], pack.spot(lane, [u[lane], v[lane]], ray.dir)) {
                    return true;
                }
            }
        }
        let first = leaf.first_round as usize;
        let meets = |round: &Round| round.meets(ray, t_max, solid).is_some();
        ROUNDS && self.rounds[first..first + leaf.rounds as usize].iter().any(meets)
    }
}

// The walks, compiled for the vector instructions of the processor, too. The same operations in the same order, none
// of them fused, find the same bits.

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn nearest<const ROUNDS: bool>(
    bvh: &Bvh,
    ray: &Ray,
    t_max: f32,
    waiting: &mut Waiting,
    solid: impl Fn(u32, Spot) -> bool,
) -> LocalHit {
    match_target! {
        "x86_64+avx2" => bvh.nearest::<ROUNDS>(ray, t_max, waiting, solid, |node, ray, t_max| node.meet_avx2(ray, t_max)),
        _ => bvh.nearest::<ROUNDS>(ray, t_max, waiting, solid, Node::meet),
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn any<const ROUNDS: bool, const OPACITY: bool>(
    bvh: &Bvh,
    ray: &Ray,
    t_max: f32,
    waiting: &mut Waiting,
    solid: impl Fn(u32, Spot) -> bool,
) -> bool {
    match_target! {
        "x86_64+avx2" => {
            bvh.any::<ROUNDS, OPACITY>(ray, t_max, waiting, solid, |node, ray, t_max| node.meet_avx2(ray, t_max))
        }
        _ => bvh.any::<ROUNDS, OPACITY>(ray, t_max, waiting, solid, Node::meet),
    }
}
