//! How groups of lights are split in two.

use super::cluster::Cluster;

/// Buckets along each axis in which splits are tried.
const BUCKETS: usize = 12;

/// The index of a light, or a patch of lights, with its bounds.
pub(super) type Item = (u32, Cluster);

/// The bounds of a group, which must not be empty.
pub(super) fn union(items: &[Item]) -> Cluster {
    let rest = items[1..].iter();
    rest.fold(items[0].1, |all, (_, cluster)| all.union(cluster))
}

/// Orders a group of at least two lights so that the first `split` and the others have the least cost, by the
/// surface area orientation heuristic (§4.4).
pub(super) fn split(items: &mut [Item]) -> usize {
    let centres = || items.iter().map(|(_, cluster)| cluster.centre);
    let low = centres().fold(items[0].1.centre, |a, b| a.min(b));
    let high = centres().fold(items[0].1.centre, |a, b| a.max(b));
    let (extent, size) = (high - low, union(items).size());
    let longest = size.max_element();
    let bucket = |cluster: &Cluster, axis: usize| {
        let at = (cluster.centre[axis] - low[axis]) / extent[axis] * BUCKETS as f32;
        (at as usize).min(BUCKETS - 1)
    };
    let mut best: Option<(f64, usize, usize)> = None;
    for axis in (0..3).filter(|axis| extent[*axis] > 0.0) {
        let mut buckets: [Option<Cluster>; BUCKETS] = [None; BUCKETS];
        for (_, cluster) in items.iter() {
            let to = &mut buckets[bucket(cluster, axis)];
            *to = merged(*to, Some(*cluster));
        }
        // Costs of all that comes before an edge, and of all that comes after it
        let mut before = [None; BUCKETS];
        let mut all = None;
        for (to, cluster) in before.iter_mut().zip(buckets) {
            *to = all;
            all = merged(all, cluster);
        }
        let mut after = None;
        for edge in (1..BUCKETS).rev() {
            after = merged(after, buckets[edge]);
            if let (Some(a), Some(b)) = (before[edge], after) {
                // Thin boxes are split along their length
                let cost = f64::from(longest / size[axis]) * (a.cost() + b.cost());
                if best.is_none_or(|(least, ..)| cost < least) {
                    best = Some((cost, axis, edge));
                }
            }
        }
    }
    let Some((_, axis, edge)) = best else { return items.len() / 2 };
    let mut middle = 0;
    for i in 0..items.len() {
        if bucket(&items[i].1, axis) < edge {
            items.swap(i, middle);
            middle += 1;
        }
    }
    middle
}

fn merged(a: Option<Cluster>, b: Option<Cluster>) -> Option<Cluster> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.union(&b)),
        (a, b) => a.or(b),
    }
}
