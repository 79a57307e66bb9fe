//! glTF 2.0, as JSON or GLB.
//!
//! The crate `gltf` gives the types of the JSON. Its own checks and readers are not used: they index and
//! unwrap what a file says. Here each index is looked up, and each length checked, where it is used.

mod accessor;
mod asset;
mod camera;
mod clearcoat;
#[cfg(feature = "draco")]
mod draco;
mod gloss;
mod light;
mod material;
mod mesh;
mod meshopt;
mod nodes;
mod notes;
mod properties;
mod rest;
mod shared;
mod texture;
mod uri;

use crate::files::{Folder, has_memory};
use crate::{LoadError, Loaded, Place};
use asset::{Asset, MAX_BYTES, name};
use glam::{DAffine3, DVec3};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index, Skin};
use material::Materials;
use mesh::Triangles;
use nodes::Placed;
use noisefloor_ptwne::{Camera, MAX_SURFACES, Mesh, SceneBuilder, SceneError};
use notes::Notes;
use rest::Joints;
use shared::Shared;
use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::rc::Rc;

/// Most primitives of meshes, each counted as often as nodes show it without sharing it.
const MAX_PRIMITIVES: u64 = 1 << 20;
/// Bytes that a vertex or a triangle takes at least, while a scene is made.
const BYTES_EACH: u64 = 64;

pub(crate) fn load(path: &Path, root: Option<&Path>) -> Result<Loaded, LoadError> {
    let folder = Folder::of(path, root, String::new());
    let file = folder.read(path, MAX_BYTES, &Place::file(path))?;
    let mut asset = Asset::parse(path, &folder, &file)?;
    notes::check_required(&asset)?;
    meshopt::inflate(&mut asset)?;
    #[cfg(feature = "draco")]
    draco::inflate(&mut asset)?;
    let placed = nodes::placed(&asset)?;
    let sharing = shared::sharing(&placed);
    check_size(&asset, &placed, &sharing)?;

    let mut notes = Notes::default();
    let whole = Place::file(path);
    let (camera, optics) = camera::first(&asset, &placed, &mut notes)?.unzip();
    if camera.is_none() {
        notes.warn(&whole, "it has no camera: all of it is seen from the front, above and to the right");
    }
    let title = crate::title(path);
    let refused = |cause| LoadError::Scene { place: whole.clone(), cause };
    let mut builder = SceneBuilder::new(title, camera.unwrap_or_else(camera::anywhere)).map_err(refused)?;
    builder.optics(optics.unwrap_or_default()).map_err(refused)?;

    let mut loader = Loader {
        asset: &asset,
        builder,
        materials: Materials::new(&asset),
        notes,
        meshes: HashSet::new(),
        nodes: rest::by_index(&placed),
        skins: HashMap::new(),
        sharing,
        shared: HashMap::new(),
        needs_light: false,
        undrawn: false,
        bounds: [DVec3::INFINITY, DVec3::NEG_INFINITY],
    };
    for placed in &placed {
        loader.node(placed)?;
    }
    let camera = match camera {
        Some(camera) => camera,
        None => loader.framing()?,
    };
    let Loader { builder, mut notes, needs_light, .. } = loader;
    for (index, animation) in asset.root.animations.iter().enumerate() {
        let place = Place::part(path, name("animation", index, animation.name.as_deref()));
        notes.warn(&place, "it is ignored: everything stays at rest, where its node is");
    }
    let mut scene = builder.build().and_then(|scene| scene.with_camera(camera)).map_err(refused)?;
    if needs_light {
        const DAYLIGHT: &str = "it gets a grey sky, and a sun over the viewer's left shoulder";
        let sky = match scene.lights() {
            0 => {
                notes.warn(&whole, format_args!("it has no light: {DAYLIGHT}"));
                Some(light::daylight(&camera))
            }
            _ => {
                let sky = light::missing_daylight(&scene, &camera);
                if sky.is_some() {
                    let what = format_args!("its own lights show next to nothing of it: {DAYLIGHT}");
                    notes.warn(&whole, what);
                }
                sky
            }
        };
        if let Some(sky) = sky {
            scene = scene.with_environment(sky).map_err(refused)?;
        }
    }
    let scene = scene.with_identity(folder.contents());
    Ok(Loaded { scene, size: None, max_depth: None, clamp: None, warnings: notes.finish(&asset) })
}

/// Fills a scene node by node.
struct Loader<'a> {
    asset: &'a Asset<'a>,
    builder: SceneBuilder,
    materials: Materials<'a>,
    notes: Notes,
    /// Meshes that some node has shown already: warnings come with the first.
    meshes: HashSet<usize>,
    /// Where nodes are, by their index.
    nodes: HashMap<usize, DAffine3>,
    skins: HashMap<usize, Rc<Joints>>,
    /// Nodes that show a mesh which others show, too.
    sharing: HashSet<usize>,
    /// What such nodes share, by the index of the mesh.
    shared: HashMap<usize, Rc<Shared>>,
    /// Whether there is anything that light can show.
    needs_light: bool,
    /// Whether there are points or lines.
    undrawn: bool,
    /// The smallest and largest coordinates of what was added.
    bounds: [DVec3; 2],
}

impl Loader<'_> {
    fn node(&mut self, placed: &Placed<'_>) -> Result<(), LoadError> {
        let Placed { node, place, .. } = placed;
        self.notes.extensions(place, node.extensions.iter().flat_map(|e| e.others.keys()));
        if let Some(light) = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref()) {
            light::add(self.asset, placed, light.light, &mut self.builder, &mut self.notes)?;
        }
        let Some(index) = node.mesh else { return Ok(()) };
        let mesh = self.asset.get(index, "mesh", place)?;
        let called = name("mesh", index.value(), mesh.name.as_deref());
        let first = self.meshes.insert(index.value());
        if first {
            let place = Place::part(self.asset.path, &called);
            self.notes.extensions(&place, mesh.extensions.iter().flat_map(|e| e.others.keys()));
        }
        let joints = match node.skin {
            Some(skin) => Some(self.joints(skin, place)?),
            None => None,
        };
        let weights = node.weights.as_ref().or(mesh.weights.as_ref()).map(Vec::as_slice).unwrap_or_default();
        let pose = Pose { to_world: &placed.to_world, joints: joints.as_deref(), weights };
        let shining = match self.sharing.contains(&placed.index) {
            true => self.instance(placed, index.value(), mesh, &called)?,
            false => None,
        };
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            if shining.as_ref().is_none_or(|shared| shared.shining.contains(&number)) {
                let place = Place::part(self.asset.path, format_args!("{called}, primitive {number}"));
                self.primitive(primitive, &pose, first, false, &place)?;
            }
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
    fn framing(&self) -> Result<Camera, LoadError> {
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
        self.notes.extensions(place, primitive.extensions.iter().flat_map(|e| e.others.keys()));
        let has = |semantic| mesh::attribute(primitive, semantic).is_some();
        for (there, what) in [
            (!drawn, "its points or lines are ignored"),
            (!has(Semantic::Positions), "it is ignored: it has no positions"),
            (has(Semantic::Colors(1)), "its second set of vertex colours is ignored"),
            (has(Semantic::Joints(1)), "its joints beyond four a vertex are ignored"),
        ] {
            if there {
                self.notes.warn(place, what);
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
            [] => place.clone().bad(format_args!("its positions, accessor {}, have no data", index.value())),
            names => place.clone().unsupported(format_args!("a mesh of only {}", names.join(", "))),
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
        let mode = mode(primitive, place)?;
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
        let (builder, notes) = (&mut self.builder, &mut self.notes);
        let material = self.materials.material(primitive.material, corners, place, builder, notes)?;
        let shines = material.emission.is_some();
        if shines && in_object {
            return Ok(true);
        }
        let mut triangles = mesh::triangles(self.asset, primitive, mode, &material, place)?;
        if triangles.indices.is_empty() {
            if first && mesh::attribute(primitive, Semantic::Positions).is_some() {
                self.notes.warn(place, "it has no whole triangle");
            }
            return Ok(false);
        }
        let count = triangles.positions.len();
        for (set, uvs) in material.sets.iter().zip([&mut triangles.uvs, &mut triangles.second_uvs]) {
            if let Some(set) = set.filter(|_| uvs.is_empty()) {
                if first {
                    let what = format_args!("it has no set {set} of texture coordinates: all are 0");
                    self.notes.warn(place, what);
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
                    self.notes.warn(place, format_args!("triangles without area are left out: {count}"));
                }
            }
            Err(SceneError::EmptyEmitter) => {
                self.notes.warn(place, "it is left out: it shines, but has no area");
            }
            Err(cause) => return Err(LoadError::Scene { place: place.clone(), cause }),
        }
        Ok(shines)
    }
}

/// Where a mesh is.
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
        triangles.place(self.to_world);
        Ok(())
    }
}

fn mode(primitive: &Primitive, place: &Place) -> Result<Mode, LoadError> {
    match primitive.mode {
        Checked::Valid(mode) => Ok(mode),
        Checked::Invalid => Err(place.clone().bad("its mode is not one of glTF's")),
    }
}

/// Checks what the scene would come to, by the counts that its accessors have: a small file can show a mesh
/// many times. What nodes share counts once.
fn check_size(asset: &Asset<'_>, placed: &[Placed<'_>], sharing: &HashSet<usize>) -> Result<(), LoadError> {
    let (mut primitives, mut vertices, mut triangles) = (0u64, 0u64, 0u64);
    let mut seen = HashSet::new();
    for placed in placed {
        let Some(index) = placed.node.mesh else { continue };
        let mesh = asset.get(index, "mesh", &placed.place)?;
        let again = sharing.contains(&placed.index) && !seen.insert(index.value());
        if again && !shared::may_shine(asset, mesh) {
            continue;
        }
        let called = name("mesh", index.value(), mesh.name.as_deref());
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            let place = Place::part(asset.path, format_args!("{called}, primitive {number}"));
            let count = |index: Option<Index<Accessor>>| match index {
                Some(index) => asset.get(index, "accessor", &place).map(|accessor| accessor.count.0),
                None => Ok(0),
            };
            let corners = count(mesh::attribute(primitive, Semantic::Positions))?;
            let indices = if primitive.indices.is_some() { count(primitive.indices)? } else { corners };
            // Each morph target takes as much
            let shapes = 1 + primitive.targets.as_ref().map_or(0, Vec::len) as u64;
            primitives += shapes;
            vertices = vertices.saturating_add(corners.saturating_mul(shapes));
            triangles = triangles.saturating_add(mesh::count(mode(primitive, &place)?, indices));
            place.clone().at_most("primitives of nodes up to here", primitives, MAX_PRIMITIVES)?;
            place.clone().at_most("vertices up to here", vertices, 3 * MAX_SURFACES as u64)?;
            place.clone().at_most("triangles up to here", triangles, MAX_SURFACES as u64)?;
        }
    }
    has_memory(vertices + triangles, BYTES_EACH, &Place::file(asset.path))
}
