//! What a builder collects, and a scene is made of.

use crate::accel::{Instance, Surface};
use crate::camera::Optics;
use crate::environment::{Environment, EnvironmentMap};
use crate::geometry::Geometry;
use crate::light::Light;
use crate::material::CompiledMaterial;
use crate::math::Vec3;
use crate::texture::Texture;
use std::ops::Range;

#[derive(Clone, Debug)]
pub(crate) enum Surroundings {
    Sky(Environment),
    Map(EnvironmentMap),
}

/// Surfaces that are seen only through instances.
#[derive(Clone, Debug)]
pub(crate) struct Object {
    pub(crate) surfaces: Range<u32>,
    /// Lowest and highest corner of their bounding box.
    pub(crate) bounds: [Vec3; 2],
    /// The origin of their coordinates, in those of the caller.
    pub(crate) origin: glam::Vec3,
}

#[derive(Clone, Debug, Default)]
pub(crate) struct Parts {
    pub(crate) surroundings: Option<Surroundings>,
    pub(crate) optics: Optics,
    pub(crate) materials: Vec<CompiledMaterial>,
    /// Of objects in coordinates of their own.
    pub(crate) surfaces: Vec<Surface>,
    /// In the order of their surfaces.
    pub(crate) objects: Vec<Object>,
    pub(crate) instances: Vec<Instance>,
    pub(crate) geometry: Geometry,
    pub(crate) lights: Vec<Light>,
    /// Factors on emitted radiance.
    pub(crate) emission_textures: Vec<Texture>,
}
