//! Walking the hierarchy along a ray.

use super::bvh::{Bvh, Hit, MISS, ROUND, Stack};
use super::leaf::{Leaf, NO_PACK, Round, Spot};
use super::node::{LEAF, WideRay};
use crate::math::{Ray, Vec3};

impl Bvh {
    /// The nearest surface along the ray. `solid` decides whether the surface of an index stops the ray at a
    /// spot or is transparent there.
    #[inline]
    pub(crate) fn closest(&self, ray: &Ray, stack: &mut Stack, solid: impl Fn(u32, Spot) -> bool) -> Hit {
        if self.rounds.is_empty() {
            self.nearest::<false>(ray, stack, solid)
        } else {
            self.nearest::<true>(ray, stack, solid)
        }
    }

    #[inline(never)]
    fn nearest<const ROUNDS: bool>(
        &self,
        ray: &Ray,
        stack: &mut Stack,
        solid: impl Fn(u32, Spot) -> bool,
    ) -> Hit {
        let wide = WideRay::new(ray);
        let mut best = MISS;
        let mut top = 0;
        let mut node = 0u32;
        loop {
            if node & LEAF == 0 {
                let n = &self.nodes[node as usize];
                let (enter, mut mask) = n.intersect(&wide, best.t);
                if mask != 0 {
                    // Descend into the nearest child, leave the others behind
                    let mut near = mask.trailing_zeros() as usize & 3;
                    mask &= mask - 1;
                    if mask != 0 {
                        let enter = enter.to_array();
                        while mask != 0 {
                            let mut other = mask.trailing_zeros() as usize & 3;
                            mask &= mask - 1;
                            if enter[other] < enter[near] {
                                std::mem::swap(&mut near, &mut other);
                            }
                            stack.0[top] = (n.child[other], enter[other]);
                            top += 1;
                        }
                    }
                    node = n.child[near];
                    continue;
                }
            } else {
                self.closest_in_leaf::<ROUNDS>(node, ray, &wide, &mut best, &solid);
            }
            // Return to what begins before the nearest surface found so far
            loop {
                if top == 0 {
                    return best;
                }
                top -= 1;
                let (next, t) = stack.0[top];
                if t < best.t {
                    node = next;
                    break;
                }
            }
        }
    }

    #[inline]
    fn closest_in_leaf<const ROUNDS: bool>(
        &self,
        node: u32,
        ray: &Ray,
        wide: &WideRay,
        best: &mut Hit,
        solid: &impl Fn(u32, Spot) -> bool,
    ) {
        let leaf = self.leaf_of::<ROUNDS>(node);
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
                        *best =
                            Hit { t: t[lane], slot: leaf.pack << 2 | lane as u32, uv: [u[lane], v[lane]] };
                    }
                }
            }
        }
        if ROUNDS {
            for index in leaf.first_round..leaf.first_round + leaf.rounds {
                let round = &self.rounds[index as usize];
                if let Some((t, spot)) = round.meets(ray, best.t, solid) {
                    let uv = if let Spot::Plane { uv, .. } = spot { uv } else { [0.0; 2] };
                    *best = Hit { t, slot: ROUND | index, uv };
                }
            }
        }
    }

    /// Without round surfaces each leaf is one pack of the same index.
    #[inline]
    fn leaf_of<const ROUNDS: bool>(&self, node: u32) -> Leaf {
        let index = node & !LEAF;
        if ROUNDS { self.leaves[index as usize] } else { Leaf { pack: index, first_round: 0, rounds: 0 } }
    }

    /// Whether any surface lies on the ray before `t_max`. `OPACITY` says whether `solid` needs to be asked.
    #[inline]
    pub(crate) fn blocked<const OPACITY: bool>(
        &self,
        ray: &Ray,
        t_max: f32,
        stack: &mut Stack,
        solid: impl Fn(u32, Spot) -> bool,
    ) -> bool {
        if self.rounds.is_empty() {
            self.any::<false, OPACITY>(ray, t_max, stack, solid)
        } else {
            self.any::<true, OPACITY>(ray, t_max, stack, solid)
        }
    }

    #[inline(never)]
    fn any<const ROUNDS: bool, const OPACITY: bool>(
        &self,
        ray: &Ray,
        t_max: f32,
        stack: &mut Stack,
        solid: impl Fn(u32, Spot) -> bool,
    ) -> bool {
        let wide = WideRay::new(ray);
        let mut top = 0;
        let mut node = 0u32;
        loop {
            if node & LEAF == 0 {
                let n = &self.nodes[node as usize];
                let (_, mut mask) = n.intersect(&wide, t_max);
                if mask != 0 {
                    // Descend into one child, leave the others behind
                    let child = |mask: u32| n.child[mask.trailing_zeros() as usize & 3];
                    node = child(mask);
                    mask &= mask - 1;
                    while mask != 0 {
                        stack.0[top].0 = child(mask);
                        top += 1;
                        mask &= mask - 1;
                    }
                    continue;
                }
            } else if self.blocked_in_leaf::<ROUNDS, OPACITY>(node, ray, &wide, t_max, &solid) {
                return true;
            }
            if top == 0 {
                return false;
            }
            top -= 1;
            node = stack.0[top].0;
        }
    }

    #[inline]
    fn blocked_in_leaf<const ROUNDS: bool, const OPACITY: bool>(
        &self,
        node: u32,
        ray: &Ray,
        wide: &WideRay,
        t_max: f32,
        solid: &impl Fn(u32, Spot) -> bool,
    ) -> bool {
        let leaf = self.leaf_of::<ROUNDS>(node);
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

    /// Whether any box of the hierarchy overlaps the pyramid of rays from `apex` between planes through it
    /// with these inward normals. Conservative: never false if a surface overlaps it.
    pub(crate) fn reaches_into(&self, apex: Vec3, inward: &[Vec3; 4]) -> bool {
        let mut todo = vec![0u32];
        while let Some(index) = todo.pop() {
            let node = &self.nodes[index as usize];
            for lane in 0..4 {
                let bound =
                    |end: usize| Vec3::from_array(std::array::from_fn(|axis| node.bounds[axis][end][lane]));
                let (low, high) = (bound(0) - apex, bound(1) - apex);
                // Empty lanes have low > high. A thousandth of size and distance covers rounding
                let slack = 1e-3 * high.abs().max(low.abs()).max_element();
                let meets = |n: &Vec3| Vec3::select(n.cmpgt(Vec3::ZERO), high, low).dot(*n) >= -slack;
                if low.cmple(high).all() && inward.iter().all(meets) {
                    match node.child[lane] {
                        child if child & LEAF == 0 => todo.push(child),
                        _ => return true,
                    }
                }
            }
        }
        false
    }
}
