//! Building the hierarchy of surfaces.

use super::bvh::Bvh;
use super::leaf::{EDGE, Leaf, NO_PACK, Pack, Round};
use super::shape::{Shape, dual};
use super::tree::Tree;
use obvhs::aabb::Aabb;

/// The least by which an edge is widened, relative to the scene's largest coordinate: four roundings. It
/// exceeds [`EDGE`] for narrow surfaces: needles, and small triangles far from the origin.
const MIN_WIDENING: f64 = 2.4e-7;
/// The most by which that widens a surface, in units of its edges.
const MAX_WIDENING: f64 = 0.01;

impl Bvh {
    /// Builds the hierarchy over those of `shapes` that `prims` names; planar ones must have an area.
    pub(crate) fn new(shapes: &[Shape], prims: &[u32]) -> Self {
        let boxes: Vec<Aabb> = prims.iter().map(|prim| shapes[*prim as usize].bounds()).collect();
        let bounds = boxes.iter().copied().reduce(|a, b| a.union(&b)).map(|all| [all.min, all.max]);
        let mut leaves = Leaves { shapes, widening: 0.0, leaves: vec![], packs: vec![], rounds: vec![] };
        if let Some([low, high]) = bounds {
            let largest = low.abs().max_element().max(high.abs().max_element());
            leaves.widening = MIN_WIDENING * f64::from(largest);
        }
        let tree = Tree::new(&boxes, 4, |found| leaves.add(found.iter().map(|i| prims[*i as usize])));
        let Leaves { mut leaves, mut packs, rounds, .. } = leaves;
        // Leaves are looked up only if there are round surfaces
        if rounds.is_empty() {
            leaves = vec![];
        }
        packs.shrink_to_fit();
        Self { tree, leaves, packs, rounds, bounds }
    }
}

/// The leaves of a hierarchy that is being built: subtrees that fit into one pack, which costs no more than a
/// node.
struct Leaves<'a> {
    shapes: &'a [Shape],
    /// The least by which edges are widened, in scene units.
    widening: f64,
    leaves: Vec<Leaf>,
    packs: Vec<Pack>,
    rounds: Vec<Round>,
}

impl Leaves<'_> {
    /// Adds a leaf, and returns its number.
    fn add(&mut self, prims: impl Iterator<Item = u32>) -> u32 {
        let mut leaf = Leaf { pack: NO_PACK, first_round: self.rounds.len() as u32, rounds: 0 };
        let mut pack = Pack::default();
        let mut lane = 0;
        for prim in prims {
            let shape = &self.shapes[prim as usize];
            if let Shape::Planar { corner, e1, e2, whole } = *shape {
                let (corner, [e1, e2]) = widened(corner, e1, e2, whole, self.widening);
                pack.set(lane, corner, dual(e1, e2), whole, prim);
                lane += 1;
            } else {
                self.rounds.push(Round::new(shape, prim));
                leaf.rounds += 1;
            }
        }
        if lane > 0 {
            leaf.pack = self.packs.len() as u32;
            self.packs.push(pack);
        }
        self.leaves.push(leaf);
        (self.leaves.len() - 1) as u32
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
