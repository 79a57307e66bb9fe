//! What shapes and groups fill.

use super::xml::Element;
use crate::mesh::Triangles;
use noisefloor_ptwne::{MaterialId, ObjectId, SceneBuilder};
use std::collections::HashMap;
use std::rc::Rc;

/// The scene that is being filled.
pub(super) struct Filling<'d> {
    pub(super) builder: SceneBuilder,
    /// Materials in it, by the serial number of their element, and whether they are inside out; and whether
    /// they have a texture.
    pub(super) materials: HashMap<(usize, bool), (MaterialId, bool)>,
    /// Meshes of groups that shine, by the serial number of their element.
    pub(super) meshes: HashMap<usize, Rc<Triangles>>,
    /// Triangles that are not in a file but made of what is.
    pub(super) made: u64,
    /// Spheres that ellipsoids of a material share.
    pub(super) balls: HashMap<MaterialId, ObjectId>,
    /// Whether shapes are added to what the instances of a group share.
    pub(super) in_group: bool,
    /// Groups that have been shown, by the serial number of their element; none if one cannot be.
    pub(super) groups: HashMap<usize, Option<Group<'d>>>,
}

/// A group that has been shown.
#[derive(Clone, Debug)]
pub(super) struct Group<'d> {
    /// What its instances share.
    pub(super) shared: ObjectId,
    /// The shapes that shine, which they do not share.
    pub(super) shining: Vec<&'d Element>,
}

impl Filling<'_> {
    pub(super) fn new(builder: SceneBuilder) -> Self {
        let (materials, meshes, balls, groups) = Default::default();
        Self { builder, materials, meshes, made: 0, balls, in_group: false, groups }
    }
}
