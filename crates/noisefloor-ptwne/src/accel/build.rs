//! Building the hierarchy of surfaces.

use super::aabb::Aabb;
use super::bvh::Bvh;
use super::cut::Bounded;
use super::leaf::{EDGE, Leaf, NO_PACK, Pack, Round};
use super::shape::{Shape, Surface, bounds, dual};
use super::tree::{Leaves, Tree};

/// The least by which an edge is widened, relative to the scene's largest coordinate: four roundings. It
/// exceeds [`EDGE`] for narrow surfaces: needles, and small triangles far from the origin.
const MIN_WIDENING: f64 = 2.4e-7;
/// The most by which that widens a surface, in units of its edges.
const MAX_WIDENING: f64 = 0.01;

impl Bvh {
    /// Builds the hierarchy over surfaces; planar ones must have an area.
    pub(crate) fn new(surfaces: Vec<Surface>) -> Self {
        let bounds = bounds(surfaces.iter().map(|surface| &surface.shape));
        let mut leaves = SurfaceLeaves { widening: 0.0, leaves: None, packs: vec![], rounds: vec![] };
        if let Some([low, high]) = bounds {
            let largest = low.abs().max_element().max(high.abs().max_element());
            leaves.widening = MIN_WIDENING * f64::from(largest);
        }
        // Leaves are looked up only if there are round surfaces
        if !surfaces.iter().all(|surface| matches!(surface.shape, Shape::Planar { .. })) {
            leaves.leaves = Some(vec![]);
        }
        let tree = Tree::new(surfaces, 4, &mut leaves);
        let SurfaceLeaves { leaves, mut packs, rounds, .. } = leaves;
        packs.shrink_to_fit();
        Self { tree, leaves: leaves.unwrap_or_default(), packs, rounds, bounds }
    }
}

impl Bounded for Surface {
    fn bounds(&self) -> Aabb {
        self.shape.bounds()
    }
}

/// The leaves of a hierarchy that is being built.
struct SurfaceLeaves {
    /// The least by which edges are widened, in scene units.
    widening: f64,
    /// None if each leaf is the pack of the same number.
    leaves: Option<Vec<Leaf>>,
    packs: Vec<Pack>,
    rounds: Vec<Round>,
}

impl Leaves<Surface> for SurfaceLeaves {
    fn none(&self) -> Self {
        let leaves = self.leaves.as_ref().map(|_| vec![]);
        Self { widening: self.widening, leaves, packs: vec![], rounds: vec![] }
    }

    fn add(&mut self, surfaces: &[Surface]) -> u32 {
        let mut leaf = Leaf { pack: NO_PACK, first_round: self.rounds.len() as u32, rounds: 0 };
        let mut pack = Pack::default();
        let mut lane = 0;
        for &Surface { shape, prim } in surfaces {
            if let Shape::Planar { corner, e1, e2, whole } = shape {
                let (corner, [e1, e2]) = widened(corner, e1, e2, whole, self.widening);
                pack.set(lane, corner, dual(e1, e2), whole, prim);
                lane += 1;
            } else {
                self.rounds.push(Round::new(&shape, prim));
                leaf.rounds += 1;
            }
        }
        if lane > 0 {
            leaf.pack = self.packs.len() as u32;
            self.packs.push(pack);
        }
        let Some(leaves) = &mut self.leaves else { return leaf.pack };
        leaves.push(leaf);
        leaves.len() as u32 - 1
    }

    fn append(&mut self, others: Self) -> u32 {
        let [packs, rounds] = [self.packs.len(), self.rounds.len()].map(|count| count as u32);
        self.packs.extend(others.packs);
        self.rounds.extend(others.rounds);
        let (Some(leaves), Some(others)) = (&mut self.leaves, others.leaves) else { return packs };
        let first = leaves.len() as u32;
        leaves.extend(others.into_iter().map(|leaf| Leaf {
            pack: if leaf.pack == NO_PACK { NO_PACK } else { leaf.pack + packs },
            first_round: leaf.first_round + rounds,
            ..leaf
        }));
        first
    }
}

/// Corner and edges of a planar surface whose edges are moved outward by `by`, where that is more than
/// [`EDGE`].
fn widened(
    corner: glam::Vec3,
    e1: glam::Vec3,
    e2: glam::Vec3,
    whole: bool,
    by: f64,
) -> (glam::Vec3, [glam::DVec3; 2]) {
    let [_, u, v] = dual(e1.as_dvec3(), e2.as_dvec3());
    let share = |dual: glam::DVec3| {
        let share = (by * dual.length()).min(MAX_WIDENING);
        if share > f64::from(EDGE) { share } else { 0.0 }
    };
    let (low_u, low_v) = (share(u), share(v));
    // u ≤ 1 and v ≤ 1 of a parallelogram, u + v ≤ 1 of a triangle
    let [high_u, high_v] = if whole { [low_u, low_v] } else { [low_v + share(u + v), low_u + share(u + v)] };
    let (a, b) = (e1.as_dvec3(), e2.as_dvec3());
    let corner = (corner.as_dvec3() - a * low_u - b * low_v).as_vec3();
    (corner, [a * (1.0 + low_u + high_u), b * (1.0 + low_v + high_v)])
}
