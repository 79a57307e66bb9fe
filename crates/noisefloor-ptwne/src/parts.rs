//! What a builder collects, and a scene is made of.

use crate::accel::Shape;
use crate::camera::Optics;
use crate::environment::{Environment, EnvironmentMap};
use crate::geometry::Geometry;
use crate::light::Light;
use crate::material::CompiledMaterial;
use crate::texture::Texture;

/// What surrounds a scene.
#[derive(Clone, Debug)]
pub(crate) enum Surroundings {
    Sky(Environment),
    Map(EnvironmentMap),
}

/// The parts of a scene.
#[derive(Clone, Debug, Default)]
pub(crate) struct Parts {
    pub(crate) surroundings: Option<Surroundings>,
    pub(crate) optics: Optics,
    pub(crate) materials: Vec<CompiledMaterial>,
    pub(crate) shapes: Vec<Shape>,
    pub(crate) geometry: Geometry,
    pub(crate) lights: Vec<Light>,
    /// Factors on emitted radiance.
    pub(crate) emission_textures: Vec<Texture>,
}
