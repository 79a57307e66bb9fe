//! Building the hierarchy.

use super::bvh::Bvh;
use super::leaf::{EDGE, Leaf, NO_PACK, Pack, Round};
use super::node::{LEAF, Node};
use super::shape::{Shape, dual};
use crate::math::Vec3;
use obvhs::{BvhBuildParams, aabb::Aabb, bvh2::Bvh2, bvh2::builder::build_bvh2};

/// The least by which an edge is widened, relative to the scene's largest coordinate: four roundings. It
/// exceeds [`EDGE`] for narrow surfaces: needles, and small triangles far from the origin.
const MIN_WIDENING: f64 = 2.4e-7;
/// The most by which that widens a surface, in units of its edges.
const MAX_WIDENING: f64 = 0.01;

impl Bvh {
    /// Builds the hierarchy over `shapes`; planar ones must have an area.
    pub(crate) fn new(shapes: &[Shape]) -> Self {
        let (nodes, leaves, packs, rounds) = (vec![Node::EMPTY], vec![], vec![], vec![]);
        let mut bvh = Self { nodes, leaves, packs, rounds, stack: 4, bounds: [Vec3::NEG_ONE, Vec3::ONE] };
        if shapes.is_empty() {
            return bvh;
        }
        let bounds: Vec<Aabb> = shapes.iter().map(Shape::bounds).collect();
        let params = BvhBuildParams {
            pre_split: false,      // would need triangles
            max_prims_per_leaf: 1, // leaves are made below
            ..BvhBuildParams::slow_build()
        };
        let tree = build_bvh2(&bounds, params, &mut std::time::Duration::default());
        bvh.bounds = [tree.nodes[0].aabb().min, tree.nodes[0].aabb().max];
        let mut depth = 1;
        bvh.collapse(&tree, shapes, &mut depth);
        bvh.stack = 3 * depth + 4;
        // Leaves are looked up only if there are round surfaces
        if shapes.iter().all(Shape::packs) {
            bvh.leaves = vec![];
        }
        bvh.nodes.shrink_to_fit();
        bvh.packs.shrink_to_fit();
        bvh
    }

    /// Collapses the binary tree: each wide node opens the largest of its inner children until it has four.
    /// Subtrees that fit into one pack become leaves, since a pack costs no more than a node.
    fn collapse(&mut self, tree: &Bvh2, shapes: &[Shape], depth: &mut usize) {
        let mut todo = vec![(0usize, vec![0usize], 1usize)];
        while let Some((at, mut children, level)) = todo.pop() {
            *depth = level.max(*depth);
            while children.len() < 4 {
                let large = |i: &usize| at_most_four(tree, children[*i]).is_none();
                let area = |i: &usize| tree.nodes[children[*i]].aabb().half_area();
                let Some(open) = (0..children.len()).filter(large).max_by(|a, b| area(a).total_cmp(&area(b)))
                else {
                    break;
                };
                let first = tree.nodes[children.swap_remove(open)].first_index as usize;
                children.extend([first, first + 1]);
            }
            for (lane, &child) in children.iter().enumerate() {
                let node = &tree.nodes[child];
                for axis in 0..3 {
                    self.nodes[at].bounds[axis][0][lane] = node.aabb().min[axis];
                    self.nodes[at].bounds[axis][1][lane] = node.aabb().max[axis];
                }
                self.nodes[at].child[lane] = if let Some(prims) = at_most_four(tree, child) {
                    self.leaf(&prims, shapes)
                } else {
                    let first = node.first_index as usize;
                    let index = self.nodes.len();
                    self.nodes.push(Node::EMPTY);
                    todo.push((index, vec![first, first + 1], level + 1));
                    index as u32
                };
            }
        }
    }

    fn leaf(&mut self, prims: &[u32], shapes: &[Shape]) -> u32 {
        let mut leaf = Leaf { pack: NO_PACK, first_round: self.rounds.len() as u32, rounds: 0 };
        let mut pack = Pack::default();
        let mut lane = 0;
        let [low, high] = self.bounds.map(|b| b.abs().max_element());
        let by = MIN_WIDENING * f64::from(low.max(high));
        for &prim in prims {
            let shape = &shapes[prim as usize];
            if let Shape::Planar { corner, e1, e2, whole } = *shape {
                let (corner, [e1, e2]) = widened(corner, e1, e2, whole, by);
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
        LEAF | (self.leaves.len() - 1) as u32
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

/// The surfaces below a node, if there are at most four.
fn at_most_four(tree: &Bvh2, root: usize) -> Option<Vec<u32>> {
    let (mut found, mut todo) = (vec![], vec![root]);
    while let Some(index) = todo.pop() {
        let node = &tree.nodes[index];
        let first = node.first_index as usize;
        if node.is_leaf() {
            found.extend(&tree.primitive_indices[first..first + node.prim_count as usize]);
        } else {
            todo.extend([first, first + 1]);
        }
        if found.len() + todo.len() > 4 {
            return None;
        }
    }
    Some(found)
}
