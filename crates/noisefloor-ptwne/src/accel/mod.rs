//! Ray intersection: a bounding volume hierarchy, built by `obvhs` and traversed four boxes and four
//! surfaces at a time. `docs/benchmarks/bvh.md` says why.
//!
//! [`shape`] is what goes in, [`leaf`] and [`node`] are what a ray is tested against, [`bvh`] is the
//! hierarchy and what it says of a hit, [`build`] makes it and [`traverse`] walks it.

mod build;
mod bvh;
mod leaf;
mod node;
mod shape;
mod traverse;

#[cfg(test)]
mod tests;

pub(crate) use bvh::{Bvh, Hit, HitShape, Stack};
pub(crate) use leaf::Spot;
pub(crate) use shape::{Shape, bounds};
