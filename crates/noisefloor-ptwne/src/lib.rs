//! The reference renderer of `noisefloor`: path tracing with next event estimation.

mod accel;
mod bsdf;
mod builder;
mod camera;
mod environment;
mod error;
mod integrator;
mod light;
mod material;
mod math;
mod reference;
mod renderer;
mod rng;
mod scene;
pub mod scenes;
mod texture;

pub use builder::{Emission, MAX_COORDINATE, MAX_SURFACES, MIN_AREA, MaterialId, Mesh, SceneBuilder};
pub use camera::Camera;
pub use environment::{Environment, Sun};
pub use error::{RenderError, SceneError};
pub use material::{MIN_ROUGHNESS, Material};
pub use renderer::{MAX_DEPTH, MAX_THREADS, Options, Ptwne};
pub use scene::Scene;
pub use texture::{ImageTexture, MAX_TEXTURE_PIXELS, Texture};
