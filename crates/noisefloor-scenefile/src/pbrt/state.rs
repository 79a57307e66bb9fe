//! The state that directives change, and what they define.

use super::params::Params;
use crate::colour::ColourSpace;
use crate::error::{LoadError, Place};
use crate::mesh::Triangles;
use glam::DMat4;
use noisefloor::Rgb;
use noisefloor_ptwne::{Emission, ImageTexture, MaterialId, ObjectId, Texture};
use std::collections::HashMap;
use std::rc::Rc;

/// What attributes keep and restore.
#[derive(Clone, Debug)]
pub(super) struct State {
    /// From the coordinates of what comes next to the world.
    pub(super) to_world: DMat4,
    pub(super) material: Look,
    pub(super) area_light: Option<Rc<AreaLight>>,
    pub(super) reversed: bool,
    /// Of the colours that come.
    pub(super) colour_space: ColourSpace,
    /// Whether a medium is on either side of the surfaces that come.
    pub(super) in_medium: bool,
    /// Parameters that `Attribute` adds to all that come: by what they are for.
    pub(super) defaults: HashMap<String, Rc<Params>>,
    pub(super) float_textures: Rc<HashMap<String, Texture>>,
    pub(super) colour_textures: Rc<HashMap<String, Texture>>,
    /// Those of `float_textures` that are heights: pictures, and what they are multiplied with.
    pub(super) heights: Rc<HashMap<String, Height>>,
}

/// A picture of heights, and the unit of its values.
#[derive(Clone, Debug)]
pub(super) struct Height {
    pub(super) map: ImageTexture,
    pub(super) scale: f32,
}

/// What an `AreaLightSource` says of the shapes that come.
#[derive(Clone, Debug)]
pub(super) struct AreaLight {
    pub(super) emission: Emission,
    /// What the radiance is to be multiplied with, times the area of the shape, if it is to have a power.
    pub(super) power: Option<f64>,
}

impl AreaLight {
    /// The emission of a shape of that area.
    pub(super) fn of_area(&self, area: f64, place: &Place) -> Result<Emission, LoadError> {
        let Some(power) = self.power else { return Ok(self.emission.clone()) };
        let radiance = self.emission.radiance.map(|c| (f64::from(c) * power / area) as f32);
        if !radiance.iter().all(|c| c.is_finite()) {
            return Err(place.bad("`power` needs a shape that has an area"));
        }
        Ok(Emission { radiance, ..self.emission.clone() })
    }
}

/// A material, by its name or as it was given.
#[derive(Clone, Debug)]
pub(super) enum Look {
    Named(String, Place),
    Given(Rc<Definition>),
}

/// A material: its kind and parameters, with the textures that it names.
#[derive(Clone, Debug)]
pub(super) struct Definition {
    pub(super) kind: String,
    pub(super) params: Params,
    pub(super) float_textures: HashMap<String, Texture>,
    pub(super) colour_textures: HashMap<String, Texture>,
    pub(super) heights: HashMap<String, Height>,
}

/// What a surface looks like in the scene.
#[derive(Clone, Debug)]
pub(super) struct Wear {
    pub(super) material: MaterialId,
    pub(super) emission: Option<Emission>,
}

/// A shape of an object, in the coordinates of its instances.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub(super) form: Form,
    pub(super) wear: Wear,
    pub(super) place: Place,
}

#[derive(Clone, Debug)]
pub(super) enum Form {
    Mesh(Triangles),
    /// The sphere of that radius around the origin, moved.
    Ball(DMat4, f64),
}

impl Form {
    pub(super) fn surfaces(&self) -> u64 {
        match self {
            Self::Mesh(mesh) => mesh.indices.len() as u64,
            Self::Ball(..) => 1,
        }
    }
}

/// A defined object: parts that its instances do not share, and what they do.
#[derive(Clone, Debug, Default)]
pub(super) struct Object {
    /// Before the first instance all, then those that shine.
    pub(super) parts: Vec<Part>,
    pub(super) shared: Option<ObjectId>,
}

impl State {
    pub(super) fn new(place: Place) -> Self {
        let diffuse = Definition {
            kind: "diffuse".to_owned(),
            params: Params::none(place),
            float_textures: HashMap::new(),
            colour_textures: HashMap::new(),
            heights: HashMap::new(),
        };
        Self {
            to_world: DMat4::IDENTITY,
            material: Look::Given(Rc::new(diffuse)),
            area_light: None,
            reversed: false,
            colour_space: ColourSpace::default(),
            in_medium: false,
            defaults: HashMap::new(),
            float_textures: Rc::default(),
            colour_textures: Rc::default(),
            heights: Rc::default(),
        }
    }
}

pub(super) fn plain(colour: Rgb) -> Texture {
    Texture::Colour(colour.map(|c| c.clamp(0.0, 1.0)))
}
