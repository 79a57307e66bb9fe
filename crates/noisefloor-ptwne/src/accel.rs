//! Ray intersection: a bounding volume hierarchy, built by `obvhs` and traversed four boxes and four
//! surfaces at a time. `docs/benchmarks/bvh.md` says why.
//!
//! [`shape`] is what goes in, [`leaf`] and [`node`] are what a ray is tested against, [`tree`] is a hierarchy of
//! boxes. [`bvh`] is one over surfaces, [`build`] makes it and [`traverse`] walks it. [`hierarchy`] is a scene's:
//! its own surfaces, and instances of objects, each of which has a hierarchy in coordinates of its own.

mod build;
mod bvh;
mod hierarchy;
mod leaf;
mod median;
mod node;
mod shape;
mod traverse;
mod tree;

#[cfg(test)]
mod speed;
#[cfg(test)]
mod tests;

pub(crate) use bvh::{Bvh, HitShape};
pub(crate) use hierarchy::{Hierarchy, Hit, Instance, Stack};
pub(crate) use leaf::Spot;
pub(crate) use shape::{Shape, bounds};
