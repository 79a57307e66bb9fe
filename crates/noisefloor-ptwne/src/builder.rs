//! Builds scenes from meshes, spheres, materials, emitters, an environment and a camera.

mod input;
mod scene_builder;

#[cfg(test)]
mod tests;

pub use input::{Emission, MAX_INSTANCES, MAX_SURFACES, MIN_AREA, MaterialId, Mesh};
pub use scene_builder::{ObjectId, SceneBuilder};
