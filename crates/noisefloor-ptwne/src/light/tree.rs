//! A hierarchy of lights (Conty Estevez, Kulla 2018), four children to a node.

use super::node::{Importance, LEAF, NONE, Node};
use super::patch::{Patch, patches};
use super::receiver::Receiver;
use super::split::{Item, split, union};
use glam::Vec4;
use std::ops::Range;

/// The hierarchy over all lights that have a position.
#[derive(Clone, Debug, Default)]
pub(super) struct LightTree {
    nodes: Vec<Node>,
    places: Vec<Place>,
    /// Where the lights of each patch begin in `lights`, and where those of the last end.
    first: Vec<u32>,
    /// The lights by patch, each with the power of those of its patch up to it, relative to all of them.
    lights: Vec<(u32, f64)>,
}

/// Where a light is in the tree.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// Four times the node of its patch, plus the lane; [`NONE`] if it is not in the tree.
    slot: u32,
    /// Its probability within the patch.
    share: f32,
}

/// Two probabilities: by scattered light and by geometry.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pmf {
    pub(super) scattered: f32,
    pub(super) geometric: f32,
}

impl LightTree {
    /// The tree over lights, given by index; there are `lights` in all. `scale` makes intensities relative,
    /// and `extent` is the radius of the scene.
    pub(super) fn new(mut items: Vec<Item>, lights: usize, scale: f64, extent: f32) -> Self {
        // So that no importance overflows
        let least = (1e-6 * extent).max(f32::MIN_POSITIVE.sqrt());
        let patches = patches(&mut items, extent);
        let mut tree = Self::of_patches(&patches, &items, lights);
        let mut patches: Vec<Item> = (0..).zip(patches.iter().map(|patch| patch.bounds)).collect();
        if patches.is_empty() {
            return tree;
        }
        tree.nodes.push(Node::new(NONE));
        let mut todo = vec![(0usize, patches.as_mut_slice())];
        while let Some((at, patches)) = todo.pop() {
            for (lane, group) in four_groups(patches).into_iter().enumerate() {
                let slot = 4 * at as u32 + lane as u32;
                let child = match group {
                    [(patch, _)] => {
                        for (light, _) in &tree.lights[tree.of_patch(*patch)] {
                            tree.places[*light as usize].slot = slot;
                        }
                        LEAF | *patch
                    }
                    _ => tree.nodes.len() as u32,
                };
                tree.nodes[at].set(lane, &union(group), scale, least, child);
                if child & LEAF == 0 {
                    tree.nodes.push(Node::new(slot));
                    todo.push((child as usize, group));
                }
            }
        }
        tree
    }

    /// Without nodes.
    fn of_patches(patches: &[Patch], items: &[Item], lights: usize) -> Self {
        let mut tree = Self { places: vec![Place { slot: NONE, share: 1.0 }; lights], ..Self::default() };
        tree.first.push(0);
        for patch in patches {
            let (mut sum, mut before) = (0.0, 0.0);
            for (light, bounds) in &items[patch.lights.clone()] {
                sum += bounds.intensity;
                let until = sum / patch.bounds.intensity;
                tree.places[*light as usize].share = (until - before) as f32;
                tree.lights.push((*light, until));
                before = until;
            }
            tree.first.push(tree.lights.len() as u32);
        }
        tree
    }

    /// Where the lights of a patch are in `lights`.
    #[inline]
    fn of_patch(&self, patch: u32) -> Range<usize> {
        self.first[patch as usize] as usize..self.first[patch as usize + 1] as usize
    }

    /// Chooses one of the lights of a patch by `u`, uniform in [0, 1).
    #[inline]
    fn choose_in(&self, patch: u32, u: f64) -> usize {
        let lights = &self.lights[self.of_patch(patch)];
        let at = lights.partition_point(|(_, until)| *until <= u).min(lights.len() - 1);
        lights[at].0 as usize
    }

    /// Whether the light is in the tree.
    pub(super) fn contains(&self, light: usize) -> bool {
        self.places[light].slot != NONE
    }

    /// The importance of the clusters at the top; none if there are no lights.
    #[inline]
    pub(super) fn root(&self, receiver: &Receiver) -> Option<Importance> {
        Some(self.nodes.first()?.importance(receiver))
    }

    /// Chooses a light by `u`, uniform in [0, 1): by geometry, or by scattered light. `root` is that of
    /// [`LightTree::root`]. Returns its index and both probabilities; none if the number leads to lights that
    /// send no light to the receiver.
    #[inline(never)]
    pub(super) fn choose(
        &self,
        receiver: &Receiver,
        root: &Importance,
        mut u: f64,
        geometric: bool,
    ) -> Option<(usize, Pmf)> {
        let mut pmf = Pmf { scattered: 1.0, geometric: 1.0 };
        let (mut node, mut importance) = (&self.nodes[0], *root);
        loop {
            let weights = if geometric { importance.geometric } else { importance.scattered };
            let (lane, rest) = pick(weights.to_array(), u)?;
            u = rest;
            pmf.times(&importance, lane);
            let child = node.child[lane];
            if child & LEAF != 0 {
                let light = self.choose_in(child & !LEAF, u);
                return Some((light, pmf.scaled(self.places[light].share)));
            }
            node = &self.nodes[child as usize];
            importance = node.importance(receiver);
        }
    }

    /// The probabilities with which [`LightTree::choose`] chooses a light.
    #[inline(never)]
    pub(super) fn pmf(&self, receiver: &Receiver, root: &Importance, light: usize) -> Pmf {
        let mut pmf = Pmf { scattered: 1.0, geometric: 1.0 };
        let Place { mut slot, share } = self.places[light];
        loop {
            let (node, lane) = (&self.nodes[(slot >> 2) as usize], (slot & 3) as usize);
            if node.parent == NONE {
                pmf.times(root, lane);
                return pmf.scaled(share);
            }
            pmf.times(&node.importance(receiver), lane);
            slot = node.parent;
        }
    }

    /// Memory that it takes, in bytes.
    pub(super) fn bytes(&self) -> usize {
        size_of_val(self.nodes.as_slice())
            + size_of_val(self.places.as_slice())
            + size_of_val(self.first.as_slice())
            + size_of_val(self.lights.as_slice())
    }
}

impl Pmf {
    #[inline]
    fn scaled(self, by: f32) -> Self {
        Self { scattered: self.scattered * by, geometric: self.geometric * by }
    }

    /// Multiplies by the shares of a lane.
    #[inline]
    fn times(&mut self, importance: &Importance, lane: usize) {
        let share = |weights: Vec4| {
            let sum = weights.element_sum();
            if sum > 0.0 { weights[lane] / sum } else { 0.0 }
        };
        self.scattered *= share(importance.scattered);
        self.geometric *= share(importance.geometric);
    }
}

/// Inverts the sum of four weights at `u` of it: the lane, and where `u` lies within its weight, 0…1. None if
/// all weights are zero.
#[inline]
fn pick(weights: [f32; 4], u: f64) -> Option<(usize, f64)> {
    let mut rest = u * weights.iter().map(|w| f64::from(*w)).sum::<f64>();
    let mut last = None;
    for (lane, weight) in weights.into_iter().enumerate().filter(|(_, weight)| *weight > 0.0) {
        let weight = f64::from(weight);
        if rest < weight {
            return Some((lane, rest / weight));
        }
        rest -= weight;
        // Rounding may exceed the sum
        last = Some((lane, 1.0 - f64::EPSILON));
    }
    last
}

/// Splits lights into up to four groups: always the one of the highest cost in two.
fn four_groups(items: &mut [Item]) -> Vec<&mut [Item]> {
    let mut groups = vec![items];
    while groups.len() < 4 {
        let cost = |i: &usize| union(groups[*i]).cost();
        let large = (0..groups.len()).filter(|i| groups[*i].len() > 1);
        let Some(open) = large.max_by(|a, b| cost(a).total_cmp(&cost(b))) else { break };
        let group = groups.swap_remove(open);
        let middle = split(group);
        let (a, b) = group.split_at_mut(middle);
        groups.extend([a, b]);
    }
    groups
}
