//! A hierarchy of boxes: how it is built, and how a ray walks it. What its leaves hold is somebody else's.

use super::median;
use super::node::{LEAF, Lanes, Node, WIDTH, WideRay};
use crate::math::Vec3;
use crate::rng;
use obvhs::aabb::Aabb;
use obvhs::bvh2::{Bvh2, reinsertion::ReinsertionOptimizer};
use obvhs::ploc::{PlocBuilder, PlocSearchDistance, SortPrecision};

/// Nodes still to visit, with the distance at which each begins.
#[derive(Clone, Debug)]
pub(super) struct Waiting(Vec<(u32, f32)>);

impl Waiting {
    /// Room for walks of trees that leave at most so many nodes behind.
    pub(super) fn new(most: usize) -> Self {
        Self(vec![(0, 0.0); most])
    }
}

/// A ray meets so many boxes of a subtree at most, in the mean, if the tree is to be a good one: to find one
/// takes time in proportion to that number. Meshes have about 2, forests 20, and n equal boxes have n.
const CROWDED: f32 = 500.0;
/// Most boxes that are looked at to tell.
const SAMPLE: usize = 1 << 16;
/// Share of the nodes that are reinserted. More, and a second run, take most of the time of loading for little:
/// docs/benchmarks/bvh.md
const REINSERTED: f32 = 0.05;

#[derive(Clone, Debug)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    /// The most nodes that wait during a walk.
    pub(super) waiting: usize,
}

impl Tree {
    /// Builds the hierarchy over `boxes`. `leaf` is told which of them a leaf has, at most `most`, and numbers
    /// it.
    pub(super) fn new(boxes: &[Aabb], most: usize, mut leaf: impl FnMut(&[u32]) -> u32) -> Self {
        let mut tree = Self { nodes: vec![Node::EMPTY], waiting: WIDTH };
        if !boxes.is_empty() {
            tree.waiting = (WIDTH - 1) * tree.collapse(&binary(boxes), most, &mut leaf) + WIDTH;
            tree.nodes.shrink_to_fit();
        }
        tree
    }

    /// Collapses the binary tree: each wide node opens the largest of its inner children until it has eight.
    /// Subtrees of at most `most` boxes become leaves. Returns the depth.
    fn collapse(&mut self, tree: &Bvh2, most: usize, leaf: &mut impl FnMut(&[u32]) -> u32) -> usize {
        let mut depth = 1;
        let mut todo = vec![(0usize, vec![0usize], 1usize)];
        while let Some((at, mut children, level)) = todo.pop() {
            depth = level.max(depth);
            while children.len() < WIDTH {
                let large = |i: &usize| at_most(most, tree, children[*i]).is_none();
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
                    self.nodes[at].bounds[axis][0].set(lane, node.aabb().min[axis]);
                    self.nodes[at].bounds[axis][1].set(lane, node.aabb().max[axis]);
                }
                self.nodes[at].child[lane] = if let Some(prims) = at_most(most, tree, child) {
                    LEAF | leaf(prims.as_slice())
                } else {
                    let first = node.first_index as usize;
                    let index = self.nodes.len();
                    self.nodes.push(Node::EMPTY);
                    todo.push((index, vec![first, first + 1], level + 1));
                    index as u32
                };
            }
        }
        depth
    }

    /// Visits the leaves that begin before `t_max`, nearest first as far as boxes tell. `visit` is given the
    /// number of a leaf, and says before which distance leaves count from now on; `meet` is [`Node::meet`].
    #[inline(always)]
    pub(super) fn nearest(
        &self,
        ray: &WideRay,
        mut t_max: f32,
        waiting: &mut Waiting,
        meet: impl Fn(&Node, &WideRay, f32) -> (Lanes, u32),
        mut visit: impl FnMut(u32) -> f32,
    ) {
        let waiting = waiting.0.as_mut_slice();
        let mut top = 0;
        let mut node = 0u32;
        loop {
            if node & LEAF == 0 {
                let n = &self.nodes[node as usize];
                let (enter, mut mask) = meet(n, ray, t_max);
                if mask != 0 {
                    // Descend into the nearest child, leave the others behind in order
                    let mut near = mask.trailing_zeros() as usize & 7;
                    mask &= mask - 1;
                    if mask != 0 {
                        let enter = enter.to_array();
                        let first = top;
                        while mask != 0 {
                            let mut other = mask.trailing_zeros() as usize & 7;
                            mask &= mask - 1;
                            if enter[other] < enter[near] {
                                std::mem::swap(&mut near, &mut other);
                            }
                            let entry = (n.child[other], enter[other]);
                            let mut at = top;
                            top += 1;
                            while at > first && waiting[at - 1].1 < entry.1 {
                                waiting[at] = waiting[at - 1];
                                at -= 1;
                            }
                            waiting[at] = entry;
                        }
                    }
                    node = n.child[near];
                    continue;
                }
            } else {
                t_max = visit(node & !LEAF);
            }
            // Return to what begins before the nearest surface found so far
            loop {
                if top == 0 {
                    return;
                }
                top -= 1;
                let (next, t) = waiting[top];
                if t < t_max {
                    node = next;
                    break;
                }
            }
        }
    }

    /// Whether `visit` says so of any leaf that begins before `t_max`, of which it is given the number.
    #[inline(always)]
    pub(super) fn any(
        &self,
        ray: &WideRay,
        t_max: f32,
        waiting: &mut Waiting,
        meet: impl Fn(&Node, &WideRay, f32) -> (Lanes, u32),
        mut visit: impl FnMut(u32) -> bool,
    ) -> bool {
        let waiting = waiting.0.as_mut_slice();
        let mut top = 0;
        let mut node = 0u32;
        loop {
            if node & LEAF == 0 {
                let n = &self.nodes[node as usize];
                let (_, mut mask) = meet(n, ray, t_max);
                if mask != 0 {
                    // Descend into one child, leave the others behind
                    let child = |mask: u32| n.child[mask.trailing_zeros() as usize & 7];
                    node = child(mask);
                    mask &= mask - 1;
                    while mask != 0 {
                        waiting[top].0 = child(mask);
                        top += 1;
                        mask &= mask - 1;
                    }
                    continue;
                }
            } else if visit(node & !LEAF) {
                return true;
            }
            if top == 0 {
                return false;
            }
            top -= 1;
            node = waiting[top].0;
        }
    }

    /// Whether any box of the hierarchy overlaps the pyramid of rays from `apex` between planes through it
    /// with these inward normals. Conservative: never false if a surface overlaps it.
    pub(super) fn reaches_into(&self, apex: Vec3, inward: &[Vec3; 4]) -> bool {
        let mut todo = vec![0u32];
        while let Some(index) = todo.pop() {
            let node = &self.nodes[index as usize];
            for lane in 0..WIDTH {
                let bound = |end: usize| {
                    Vec3::from_array(std::array::from_fn(|axis| node.bounds[axis][end].at(lane)))
                };
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

    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
    }
}

/// A binary tree over boxes, of which there is at least one.
fn binary(boxes: &[Aabb]) -> Bvh2 {
    if is_crowded(boxes) {
        return median::tree(boxes);
    }
    let indices = (0..boxes.len() as u32).collect();
    // What the library calls a medium build, for leaves of one box
    let mut tree = PlocBuilder::with_capacity(boxes.len()).build(
        PlocSearchDistance::Medium,
        boxes,
        indices,
        SortPrecision::U64,
        3,
    );
    // It makes trees deeper, those of fans by a tenth, and panics where one is deeper than twice this
    tree.max_depth *= 8;
    ReinsertionOptimizer::default().run(&mut tree, REINSERTED, None);
    tree
}

/// Whether too many boxes overlap, judged by a sample of them: in a sample of one in n, a ray meets an n-th of
/// the boxes of a crowd. Crowds of less than a few n boxes are not found, and are too small to matter.
pub(super) fn is_crowded(boxes: &[Aabb]) -> bool {
    let step = boxes.len().div_ceil(SAMPLE);
    let limit = (CROWDED / step as f32).max(8.0);
    if step == 1 {
        return median::crowding(&median::tree(boxes)) > limit;
    }
    // One of each `step`, at random, so that no order of a file can hide a crowd
    let sample = boxes.chunks(step).enumerate();
    let sample: Vec<Aabb> =
        sample.map(|(i, part)| part[(rng::hash(0, i as u32) * part.len() as f32) as usize]).collect();
    median::crowding(&median::tree(&sample)) > limit
}

/// Up to four boxes, by index.
#[derive(Clone, Copy, Default)]
struct Few {
    boxes: [u32; 4],
    len: usize,
}

impl Few {
    fn as_slice(&self) -> &[u32] {
        &self.boxes[..self.len]
    }
}

/// The boxes below a node, if there are at most `most` ≤ 4.
fn at_most(most: usize, tree: &Bvh2, root: usize) -> Option<Few> {
    let mut found = Few::default();
    gather(most, tree, root, &mut found).then_some(found)
}

/// Adds the boxes below a node to `found`. Returns whether there are at most `most` in all.
fn gather(most: usize, tree: &Bvh2, root: usize, found: &mut Few) -> bool {
    let node = &tree.nodes[root];
    let first = node.first_index as usize;
    if !node.is_leaf() {
        // Each child has one box at least
        return found.len + 2 <= most
            && gather(most - 1, tree, first, found)
            && gather(most, tree, first + 1, found);
    }
    for index in &tree.primitive_indices[first..first + node.prim_count as usize] {
        if found.len >= most {
            return false;
        }
        found.boxes[found.len] = *index;
        found.len += 1;
    }
    true
}
