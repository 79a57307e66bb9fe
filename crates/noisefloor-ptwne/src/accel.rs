//! Ray intersection: a bounding volume hierarchy, traversed eight boxes and four surfaces at a time.
//!
//! [`shape`] is what goes in, [`leaf`] and [`node`] are what a ray is tested against, [`tree`] is a hierarchy of
//! boxes, and [`cut`] how it is built. [`bvh`] is one over surfaces, [`build`] makes it and [`traverse`] walks it. [`hierarchy`] is a scene's:
//! its own surfaces, and instances of objects, each of which has a hierarchy in coordinates of its own.

mod aabb;
mod build;
mod bvh;
mod cut;
mod hierarchy;
mod leaf;
mod node;
mod shape;
mod traverse;
mod tree;

#[cfg(test)]
mod tests;

pub(crate) use bvh::{Bvh, HitShape};
pub(crate) use hierarchy::{Hierarchy, Hit, Instance, Stack};
pub(crate) use leaf::Spot;
pub(crate) use shape::{Shape, Surface, bounds};
