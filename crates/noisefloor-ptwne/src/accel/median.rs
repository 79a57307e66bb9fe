//! A binary tree for boxes of which many overlap: there, the tree of `obvhs` takes quadratic time.

use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;

/// A tree that halves boxes by the order of their middles, along the axis on which these spread most.
pub(super) fn tree(boxes: &[Aabb]) -> Bvh2 {
    let mut order: Vec<u32> = (0..boxes.len() as u32).collect();
    let mut nodes = Vec::with_capacity(2 * boxes.len());
    nodes.push(Bvh2Node::default());
    let mut todo = vec![(0usize, 0..boxes.len())];
    while let Some((at, range)) = todo.pop() {
        let part = &mut order[range.clone()];
        let middle = |i: u32| boxes[i as usize].min + boxes[i as usize].max;
        let all = part.iter().map(|i| boxes[*i as usize]).fold(Aabb::empty(), |a, b| a.union(&b));
        if part.len() == 1 {
            nodes[at] = Bvh2Node::new(all, 1, range.start as u32);
            continue;
        }
        let low = part.iter().map(|i| middle(*i)).reduce(|a, b| a.min(b)).unwrap_or_default();
        let high = part.iter().map(|i| middle(*i)).reduce(|a, b| a.max(b)).unwrap_or_default();
        let axis = (high - low).max_position();
        let half = part.len() / 2;
        part.select_nth_unstable_by(half, |a, b| middle(*a)[axis].total_cmp(&middle(*b)[axis]));
        let first = nodes.len();
        nodes[at] = Bvh2Node::new(all, 0, first as u32);
        nodes.extend([Bvh2Node::default(); 2]);
        let split = range.start + half;
        todo.extend([(first, range.start..split), (first + 1, split..range.end)]);
    }
    Bvh2 { nodes, primitive_indices: order, ..Bvh2::default() }
}

/// How many of the boxes of a subtree a random ray through it meets, in the mean: the largest such number of
/// all subtrees of a tree whose children come after their parents (Cauchy's formula: the mean projection of a
/// convex body is a quarter of its surface).
pub(super) fn crowding(tree: &Bvh2) -> f32 {
    let mut areas = vec![0.0; tree.nodes.len()];
    let mut most = 0f32;
    for (index, node) in tree.nodes.iter().enumerate().rev() {
        let (own, first) = (node.aabb().half_area(), node.first_index as usize);
        areas[index] = if node.is_leaf() { own } else { areas[first] + areas[first + 1] };
        if own > 0.0 {
            most = most.max(areas[index] / own);
        }
    }
    most
}
