//! How surfaces scatter light. Directions are local: the normal is +z, and both point away from the surface.

mod coat;
mod fresnel;
mod ggx;
mod glossy;

#[cfg(test)]
mod tests;

pub(crate) use coat::{Coat, Interior};
pub(crate) use fresnel::{Fresnel, fresnel, pane, refract};
pub use ggx::MIN_ROUGHNESS;
pub(crate) use glossy::Glossy;
