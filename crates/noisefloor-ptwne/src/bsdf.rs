//! How surfaces scatter light. Directions are local: the normal is +z, and both point away from the surface.

mod beckmann;
mod coat;
mod fresnel;
mod ggx;
mod glossy;
mod principled;
mod rough_glass;

#[cfg(test)]
mod tests;

pub(crate) use coat::{Coat, Interior};
pub(crate) use fresnel::{Fresnel, fresnel, pane, refract, schlick};
pub(crate) use ggx::Ggx;
pub use ggx::{Facets, MIN_ROUGHNESS};
pub(crate) use glossy::{Glossy, LobesAt, OrenNayar};
pub(crate) use rough_glass::RoughGlass;
