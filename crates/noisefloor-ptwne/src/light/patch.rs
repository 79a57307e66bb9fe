//! Patches: emitting triangles that receivers see as one light.

use super::cluster::Cluster;
use super::split::{split, union};
use crate::math::Vec3;
use std::ops::Range;

/// Radius of the largest patch, relative to that of the scene. Few receivers are so near to it that it matters
/// which of its triangles they sample.
const LARGEST: f32 = 0.01;
/// Length of the mean normal of a patch, at least. Its triangles then face some 25° to both sides of the mean,
/// so that few receivers see only a part of them.
const ALIKE: f32 = 0.9;
/// Largest ratio of radiances.
const CONTRAST: f64 = 2.0;

/// Lights that are chosen as one, and one of them by its power.
#[derive(Clone, Debug)]
pub(super) struct Patch {
    /// Among the lights in the order that [`patches`] gives them.
    pub(super) lights: Range<usize>,
    /// Counts as one light.
    pub(super) bounds: Cluster,
}

/// Orders lights, so that those of each patch come one after the other. `extent` is the radius of the scene.
pub(super) fn patches(items: &mut [(u32, Cluster)], extent: f32) -> Vec<Patch> {
    let mut found = vec![];
    let mut todo = vec![(0, items.len())];
    while let Some((from, to)) = todo.pop() {
        let (part, lights) = (&mut items[from..to], from..to);
        match part {
            [] => {}
            [(_, bounds)] => found.push(Patch { bounds: *bounds, lights }),
            _ => match as_one(part, LARGEST * extent) {
                Some(bounds) => found.push(Patch { bounds, lights }),
                None => {
                    let middle = from + split(part);
                    todo.extend([(middle, to), (from, middle)]);
                }
            },
        }
    }
    found
}

/// The bounds of lights as a patch; none if they are not alike enough, or wider than `largest`.
fn as_one(items: &[(u32, Cluster)], largest: f32) -> Option<Cluster> {
    let (_, first) = items[0];
    // Before the costlier bounds
    if items.iter().any(|(_, light)| (light.centre - first.centre).length() > 2.0 * largest) {
        return None;
    }
    let radiance = |light: &Cluster| light.intensity / f64::from(light.area);
    let (mut least, mut most) = (f64::INFINITY, 0.0f64);
    let mut facing = Vec3::ZERO;
    for (_, light) in items {
        if !light.is_flat() || light.two_sided != first.two_sided {
            return None;
        }
        (least, most) = (least.min(radiance(light)), most.max(radiance(light)));
        facing += light.axis * light.area;
    }
    let mut bounds = union(items);
    bounds.count = 1;
    let alike = most <= CONTRAST * least && facing.length() >= ALIKE * bounds.area;
    (alike && bounds.radius <= largest).then_some(bounds)
}
