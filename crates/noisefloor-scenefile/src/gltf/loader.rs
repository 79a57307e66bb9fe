//! Fills a scene with what the nodes of a file show.

use super::asset::Asset;
use super::material::Materials;
use super::mesh::{self, Triangles};
use super::nodes::Placed;
use super::parts::{INSTANCES, VISIBILITY, name};
use super::rest::{self, Joints};
use super::shared::Shared;
use super::{camera, light};
use crate::mesh::rows;
use crate::{LoadError, Place};
use glam::{DAffine3, DMat4, DVec3};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::{self, Index, Skin};
use noisefloor_ptwne::{Camera, Mesh, SceneBuilder, SceneError};
use std::collections::{HashMap, HashSet};
use std::rc::Rc;

/// Fills a scene node by node.
pub(super) struct Loader<'a> {
    pub(super) asset: &'a Asset<'a>,
    pub(super) builder: SceneBuilder,
    pub(super) materials: Materials<'a>,
    /// Meshes that some node has shown already: warnings come with the first.
    pub(super) meshes: HashSet<usize>,
    /// Where nodes are, by their index.
    pub(super) nodes: HashMap<usize, DAffine3>,
    pub(super) skins: HashMap<usize, Rc<Joints>>,
    /// Nodes that show a mesh which others show, too.
    pub(super) sharing: HashSet<usize>,
    /// What such nodes share, by the index of the mesh.
    pub(super) shared: HashMap<usize, Rc<Shared>>,
    /// Whether there is anything that light can show.
    pub(super) needs_light: bool,
    /// Whether there are points or lines.
    pub(super) undrawn: bool,
    /// The smallest and largest coordinates of what was added.
    pub(super) bounds: [DVec3; 2],
}

impl Loader<'_> {
    pub(super) fn node(&mut self, placed: &Placed<'_>) -> Result<(), LoadError> {
        let Placed { node, place, .. } = placed;
        let read = |name: &&String| [INSTANCES, VISIBILITY].contains(&name.as_str());
        let others = node.extensions.iter().flat_map(|e| e.others.keys());
        self.asset.leave_out(place, others.filter(|name| !read(name)));
        let light = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref());
        if let Some(light) = light.filter(|_| placed.visible) {
            light::add(self.asset, placed, light.light, &mut self.builder)?;
        }
        let Some(index) = node.mesh.filter(|_| !placed.shown.is_empty()) else { return Ok(()) };
        let mesh = self.asset.get(index, "mesh", place)?;
        let called = name("mesh", index.value(), mesh.name.as_deref());
        let mut first = self.meshes.insert(index.value());
        if first {
            let place = Place::part(self.asset.path, &called);
            self.asset.leave_out(&place, mesh.extensions.iter().flat_map(|e| e.others.keys()));
        }
        let joints = match node.skin {
            Some(skin) => Some(self.joints(skin, place)?),
            None => None,
        };
        let weights = node.weights.as_ref().or(mesh.weights.as_ref()).map(Vec::as_slice).unwrap_or_default();
        for to_world in &placed.shown {
            let pose = Pose { to_world, joints: joints.as_deref(), weights };
            let shining = match self.sharing.contains(&placed.index) {
                true => self.instance(place, to_world, index.value(), mesh, &called)?,
                false => None,
            };
            for (number, primitive) in mesh.primitives.iter().enumerate() {
                if shining.as_ref().is_none_or(|shared| shared.shining.contains(&number)) {
                    let place = Place::part(self.asset.path, format_args!("{called}, primitive {number}"));
                    self.primitive(primitive, &pose, first, false, &place)?;
                }
            }
            first = false;
        }
        Ok(())
    }

    /// The joints of a skin, found once.
    fn joints(&mut self, skin: Index<Skin>, place: &Place) -> Result<Rc<Joints>, LoadError> {
        if let Some(known) = self.skins.get(&skin.value()) {
            return Ok(known.clone());
        }
        let joints = Rc::new(rest::joints(self.asset, skin, &self.nodes, place)?);
        self.skins.insert(skin.value(), joints.clone());
        Ok(joints)
    }

    /// A camera that sees all that was added.
    pub(super) fn framing(&self) -> Result<Camera, LoadError> {
        let place = Place::file(self.asset.path);
        if self.bounds[0].cmple(self.bounds[1]).all() {
            return Ok(camera::framing(self.bounds));
        }
        Err(if self.undrawn {
            place.unsupported("a scene of only points and lines")
        } else {
            place.bad("its scene has neither a camera nor a mesh")
        })
    }

    /// Warns of what a primitive has and nobody reads.
    fn warn_of_what_is_ignored(&mut self, primitive: &Primitive, drawn: bool, place: &Place) {
        self.asset.leave_out(place, primitive.extensions.iter().flat_map(|e| e.others.keys()));
        let has = |semantic| mesh::attribute(primitive, semantic).is_some();
        for (there, what) in [
            (!drawn, "its points or lines are ignored"),
            (!has(Semantic::Positions), "it is ignored: it has no positions"),
            (has(Semantic::Colors(1)), "its second set of vertex colours is ignored"),
            (has(Semantic::Joints(1)), "its joints beyond four a vertex are ignored"),
        ] {
            if there {
                self.asset.load.ignored(place, what);
            }
        }
    }

    /// Checks that positions are there: without data they would all be 0, and the mesh gone.
    fn has_data(&self, primitive: &Primitive, place: &Place) -> Result<(), LoadError> {
        let Some(index) = mesh::attribute(primitive, Semantic::Positions) else { return Ok(()) };
        let accessor = self.asset.get(index, "accessor", place)?;
        if accessor.buffer_view.is_some() || accessor.sparse.is_some() || accessor.count.0 == 0 {
            return Ok(());
        }
        let extensions = primitive.extensions.iter().flat_map(|e| e.others.keys());
        let names: Vec<&str> = extensions.map(String::as_str).collect();
        Err(match names.as_slice() {
            [] => place.bad(format_args!("its positions, accessor {}, have no data", index.value())),
            names => place.unsupported(format_args!("a mesh of only {}", names.join(", "))),
        })
    }

    /// Adds a primitive; warns only if it is the `first` time. The result is whether it shines; then it is not
    /// added `in_object`.
    fn primitive(
        &mut self,
        primitive: &Primitive,
        pose: &Pose<'_>,
        first: bool,
        in_object: bool,
        place: &Place,
    ) -> Result<bool, LoadError> {
        let mode = mesh::mode(primitive, place)?;
        let drawn = matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan);
        if first {
            self.warn_of_what_is_ignored(primitive, drawn, place);
        }
        if !drawn {
            self.undrawn = true;
            return Ok(false);
        }
        self.has_data(primitive, place)?;
        let corners = mesh::corners(self.asset, primitive, place)?;
        let material = self.materials.material(primitive.material, corners, place, &mut self.builder)?;
        let shines = material.emission.is_some();
        if shines && in_object {
            return Ok(true);
        }
        let mut triangles = mesh::triangles(self.asset, primitive, mode, &material, place)?;
        if triangles.indices.is_empty() {
            if first && mesh::attribute(primitive, Semantic::Positions).is_some() {
                self.asset.load.ignored(place, "it has no whole triangle");
            }
            return Ok(false);
        }
        let count = triangles.positions.len();
        for (set, uvs) in material.sets.iter().zip([&mut triangles.uvs, &mut triangles.second_uvs]) {
            if let Some(set) = set.filter(|_| uvs.is_empty()) {
                if first {
                    let what = format_args!("it has no set {set} of texture coordinates: all are 0");
                    self.asset.load.ignored(place, what);
                }
                *uvs = vec![[0.0, 1.0]; count];
            }
        }
        pose.strike(self.asset, primitive, &mut triangles, place)?;
        for p in &triangles.positions {
            let p = DVec3::from_array(p.map(f64::from));
            self.bounds = [self.bounds[0].min(p), self.bounds[1].max(p)];
        }
        self.needs_light |= !material.unlit;
        let mesh = Mesh {
            positions: &triangles.positions,
            normals: &triangles.normals,
            uvs: &triangles.uvs,
            colours: &triangles.colours,
            alphas: &triangles.alphas,
            second_uvs: &triangles.second_uvs,
            tangents: &triangles.tangents,
            indices: &triangles.indices,
        };
        match self.builder.mesh(&mesh, material.id, material.emission) {
            Ok(0) => {}
            Ok(count) => {
                if first {
                    self.asset
                        .load
                        .ignored(place, format_args!("triangles without area are left out: {count}"));
                }
            }
            Err(SceneError::EmptyEmitter) => {
                self.asset.load.ignored(place, "it is left out: it shines, but has no area");
            }
            Err(cause) => return Err(place.refused()(cause)),
        }
        Ok(shines)
    }

    /// Shows a mesh that others show, too; none if that must be done without an instance.
    fn instance(
        &mut self,
        place: &Place,
        to_world: &DAffine3,
        index: usize,
        mesh: &json::Mesh,
        called: &str,
    ) -> Result<Option<Rc<Shared>>, LoadError> {
        let shared = match self.shared.get(&index) {
            Some(shared) => shared.clone(),
            None => {
                let shared = Rc::new(self.object(mesh, called, place)?);
                self.shared.insert(index, shared.clone());
                shared
            }
        };
        match self.builder.instance(shared.object, rows(DMat4::from(*to_world))) {
            Err(SceneError::Singular) => return Ok(None),
            shown => shown.map_err(place.refused())?,
        }
        let [low, high] = shared.bounds;
        if low.cmple(high).all() {
            for corner in 0..8 {
                let at = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
                let p = to_world.transform_point3(DVec3::new(at(0), at(1), at(2)));
                self.bounds = [self.bounds[0].min(p), self.bounds[1].max(p)];
            }
        }
        Ok(Some(shared))
    }

    /// Adds what the nodes that show a mesh share.
    fn object(&mut self, mesh: &json::Mesh, called: &str, place: &Place) -> Result<Shared, LoadError> {
        let refused = place.refused();
        let weights = mesh.weights.as_deref().unwrap_or_default();
        let pose = Pose { to_world: &DAffine3::IDENTITY, joints: None, weights };
        let outside = std::mem::replace(&mut self.bounds, [DVec3::INFINITY, DVec3::NEG_INFINITY]);
        let mut shining = HashSet::new();
        self.builder.begin_object().map_err(&refused)?;
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            let place = Place::part(self.asset.path, format_args!("{called}, primitive {number}"));
            if self.primitive(primitive, &pose, true, true, &place)? {
                shining.insert(number);
            }
        }
        let object = self.builder.end_object().map_err(&refused)?;
        let bounds = std::mem::replace(&mut self.bounds, outside);
        Ok(Shared { object, bounds, shining })
    }
}

struct Pose<'a> {
    to_world: &'a DAffine3,
    joints: Option<&'a Joints>,
    weights: &'a [f32],
}

impl Pose<'_> {
    /// Moves triangles to where they are in the world: a skin takes no notice of the node that has it.
    fn strike(
        &self,
        asset: &Asset<'_>,
        primitive: &Primitive,
        triangles: &mut Triangles,
        place: &Place,
    ) -> Result<(), LoadError> {
        rest::morph(asset, primitive, self.weights, triangles, place)?;
        if let Some(joints) = self.joints
            && rest::skin(asset, primitive, joints, triangles, place)?
        {
            return Ok(());
        }
        triangles.place(std::iter::repeat(self.to_world));
        Ok(())
    }
}
