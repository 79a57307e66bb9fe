//! Builds scenes from meshes, spheres, materials, emitters, an environment and a camera.

mod input;
mod materials;
mod scene_builder;

#[cfg(test)]
mod tests;

pub use input::{Emission, MAX_SURFACES, MIN_AREA, MaterialId, Mesh};
pub use scene_builder::SceneBuilder;
