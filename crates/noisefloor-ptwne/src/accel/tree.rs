//! A hierarchy of boxes: how it is built, and how a ray walks it. What its leaves hold is somebody else's.

use super::cut::{Bounded, Part};
use super::node::{LEAF, Lanes, Node, WIDTH, WideRay};
use crate::math::Vec3;
use rayon::prelude::*;

/// Nodes still to visit, with the distance at which each begins.
#[derive(Clone, Debug)]
pub(super) struct Waiting(Vec<(u32, f32)>);

impl Waiting {
    /// Room for walks of trees that leave at most so many nodes behind.
    pub(super) fn new(most: usize) -> Self {
        Self(vec![(0, 0.0); most])
    }
}

/// A large tree is built as so many branches, at most of this many surfaces. Their number does not depend on threads,
/// and neither does the tree.
const BRANCHES: usize = 64;
const MIN_BRANCH: usize = 1 << 12;

/// What the leaves of a tree hold.
pub(super) trait Leaves<T>: Send + Sync + Sized {
    /// None yet, of the same kind.
    fn none(&self) -> Self;
    /// Adds a leaf, and returns its number.
    fn add(&mut self, surfaces: &[T]) -> u32;
    /// Adds others after its own, and returns by how much their numbers grow.
    fn append(&mut self, others: Self) -> u32;
}

#[derive(Clone, Debug)]
pub(super) struct Tree {
    nodes: Vec<Node>,
    /// The most nodes that wait during a walk.
    pub(super) waiting: usize,
}

impl Tree {
    /// Builds the hierarchy over `surfaces`, of which a leaf has at most `most`.
    pub(super) fn new<T: Bounded>(mut surfaces: Vec<T>, most: usize, leaves: &mut impl Leaves<T>) -> Self {
        let mut tree = Self { nodes: vec![Node::EMPTY], waiting: WIDTH };
        if surfaces.is_empty() {
            return tree;
        }
        // The upper levels
        let small = (surfaces.len() / BRANCHES).max(MIN_BRANCH);
        let mut branches = vec![];
        let all = Part::all(&surfaces);
        let mut depth = grow(&mut tree.nodes, &mut surfaces, all, [most, small], |_, part, place| {
            branches.push((part, place));
            LEAF
        });
        branches.sort_unstable_by_key(|(part, _)| part.range.start);

        // Branches in parallel, the last ones first, so that memory of surfaces can go to nodes
        while !branches.is_empty() {
            let some = branches.len().saturating_sub(2 * rayon::current_num_threads());
            let some = branches.split_off(some);
            let first = some[0].0.range.start;
            let mut rest = &mut surfaces[first..];
            let mut jobs = vec![];
            for (part, place) in some {
                let (own, more) = rest.split_at_mut(part.range.len());
                jobs.push((own, part.from(0), place, leaves.none()));
                rest = more;
            }
            let grown: Vec<_> = jobs
                .into_par_iter()
                .map(|(own, part, place, leaves)| (Branch::new(own, part, most, leaves), place))
                .collect();
            for (branch, [node, lane, level]) in grown.into_iter().rev() {
                let by = [tree.nodes.len() as u32, leaves.append(branch.leaves)];
                tree.nodes[node].child[lane] = moved(branch.root, by);
                let child = |n: &Node| n.child.map(|child| moved(child, by));
                tree.nodes.extend(branch.nodes.into_iter().map(|n| Node { child: child(&n), ..n }));
                depth = depth.max(level + branch.depth);
            }
            surfaces.truncate(first);
            surfaces.shrink_to_fit();
        }
        tree.waiting = (WIDTH - 1) * depth + WIDTH;
        tree.nodes.shrink_to_fit();
        tree
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

/// A child after so many other nodes and leaves.
fn moved(child: u32, [nodes, leaves]: [u32; 2]) -> u32 {
    child + if child & LEAF == 0 { nodes } else { leaves }
}

/// A subtree, with nodes and leaves of its own.
struct Branch<L> {
    nodes: Vec<Node>,
    leaves: L,
    root: u32,
    depth: usize,
}

impl<L> Branch<L> {
    fn new<T: Bounded>(surfaces: &mut [T], part: Part, most: usize, mut leaves: L) -> Self
    where
        L: Leaves<T>,
    {
        if surfaces.len() <= most {
            let root = LEAF | leaves.add(surfaces);
            return Self { nodes: vec![], leaves, root, depth: 0 };
        }
        let mut nodes = vec![Node::EMPTY];
        let depth = grow(&mut nodes, surfaces, part, [most; 2], |surfaces, part, _| {
            LEAF | leaves.add(&surfaces[part.range])
        });
        Self { nodes, leaves, root: 0, depth }
    }
}

/// Grows a tree from its first node down to parts of at most `small` surfaces; `end` says which child a part becomes,
/// and is told the node, the lane and the number of levels above it. Each node opens the largest of its children that
/// have more than `most` surfaces until there are eight. Returns the number of levels.
fn grow<T: Bounded>(
    nodes: &mut Vec<Node>,
    surfaces: &mut [T],
    all: Part,
    [most, small]: [usize; 2],
    mut end: impl FnMut(&mut [T], Part, [usize; 3]) -> u32,
) -> usize {
    let mut depth = 0;
    let mut todo = vec![(0usize, all, 1usize)];
    let mut children = vec![];
    while let Some((at, part, level)) = todo.pop() {
        depth = level.max(depth);
        children.clear();
        children.push(part);
        while children.len() < WIDTH {
            let area = |i: &usize| children[*i].bounds.half_area();
            let large = (0..children.len()).filter(|i| children[*i].range.len() > most);
            let Some(open) = large.max_by(|a, b| area(a).total_cmp(&area(b))) else { break };
            let [low, high] = children[open].cut(surfaces, most);
            children[open] = low;
            children.insert(open + 1, high);
        }
        for (lane, child) in children.drain(..).enumerate() {
            for axis in 0..3 {
                nodes[at].bounds[axis][0].set(lane, child.bounds.min[axis]);
                nodes[at].bounds[axis][1].set(lane, child.bounds.max[axis]);
            }
            nodes[at].child[lane] = if child.range.len() <= small {
                end(surfaces, child, [at, lane, level])
            } else {
                nodes.push(Node::EMPTY);
                todo.push((nodes.len() - 1, child, level + 1));
                nodes.len() as u32 - 1
            };
        }
    }
    depth
}
