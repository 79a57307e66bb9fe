//! glTF 2.0, as JSON or GLB.
//!
//! The crate `gltf` gives the types of the JSON. Its own checks and readers are not used: they index and
//! unwrap what a file says. Here each index is looked up, and each length checked, where it is used.

mod accessor;
mod asset;
mod camera;
mod light;
mod material;
mod mesh;
mod nodes;
mod notes;
mod texture;
mod uri;

use crate::files::Folder;
use crate::{LoadError, Loaded, Place};
use asset::{Asset, MAX_BYTES, name};
use glam::DVec3;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index};
use material::Materials;
use nodes::Placed;
use noisefloor_ptwne::{Environment, MAX_SURFACES, Mesh, SceneBuilder, SceneError};
use notes::Notes;
use std::collections::HashSet;
use std::path::Path;

pub(crate) fn load(path: &Path) -> Result<Loaded, LoadError> {
    let folder = Folder::of(path, None, String::new());
    let file = folder.read(path, MAX_BYTES, &Place::file(path))?;
    let asset = Asset::parse(path, &folder, &file)?;
    notes::check_required(&asset)?;
    let placed = nodes::placed(&asset)?;
    check_size(&asset, &placed)?;

    let mut notes = Notes::default();
    let whole = Place::file(path);
    let camera = match camera::first(&asset, &placed, &mut notes)? {
        Some(camera) => camera,
        None => {
            notes.warn(&whole, "it has no camera: all of it is seen from the front, above and to the right");
            camera::framing(bounds(&asset, &placed)?)
        }
    };
    let title = crate::title(path);
    let refused = |cause| LoadError::Scene { place: whole.clone(), cause };
    let builder = SceneBuilder::new(title, camera).map_err(refused)?;

    let mut loader = Loader {
        asset: &asset,
        builder,
        materials: Materials::new(&asset),
        notes,
        meshes: HashSet::new(),
        lit: false,
    };
    for placed in &placed {
        loader.node(placed)?;
    }
    let Loader { mut builder, mut notes, lit, .. } = loader;
    for (index, animation) in asset.root.animations.iter().enumerate() {
        let place = Place::part(path, name("animation", index, animation.name.as_deref()));
        notes.warn(&place, "it is ignored: everything stays where its node is");
    }
    if !lit {
        notes.warn(&whole, "it has no light: a radiance of 1 comes from all directions");
        builder.environment(Environment::constant([1.0; 3])).map_err(refused)?;
    }
    let scene = builder.build().map_err(refused)?.with_identity(folder.contents());
    Ok(Loaded { scene, size: None, max_depth: None, warnings: notes.finish(&asset) })
}

/// Fills a scene node by node.
struct Loader<'a> {
    asset: &'a Asset<'a>,
    builder: SceneBuilder,
    materials: Materials<'a>,
    notes: Notes,
    /// Meshes that some node has shown already: warnings come with the first.
    meshes: HashSet<usize>,
    lit: bool,
}

impl Loader<'_> {
    fn node(&mut self, placed: &Placed<'_>) -> Result<(), LoadError> {
        let Placed { node, place, .. } = placed;
        self.notes.extensions(place, node.extensions.iter().flat_map(|e| e.others.keys()));
        if node.skin.is_some() {
            self.notes.warn(place, "its skin is ignored: its mesh is rigid");
        }
        if let Some(light) = node.extensions.as_ref().and_then(|e| e.khr_lights_punctual.as_ref()) {
            light::add(self.asset, placed, light.light, &mut self.builder, &mut self.notes)?;
            self.lit = true;
        }
        let Some(index) = node.mesh else { return Ok(()) };
        let mesh = self.asset.get(index, "mesh", place)?;
        let called = name("mesh", index.value(), mesh.name.as_deref());
        let first = self.meshes.insert(index.value());
        if first {
            let place = Place::part(self.asset.path, &called);
            self.notes.extensions(&place, mesh.extensions.iter().flat_map(|e| e.others.keys()));
        }
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            let place = Place::part(self.asset.path, format_args!("{called}, primitive {number}"));
            self.primitive(primitive, placed, first, &place)?;
        }
        Ok(())
    }

    /// Adds a primitive; warns only if it is the `first` time.
    fn primitive(
        &mut self,
        primitive: &Primitive,
        placed: &Placed<'_>,
        first: bool,
        place: &Place,
    ) -> Result<(), LoadError> {
        let mode = mode(primitive, place)?;
        let drawn = matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan);
        if first {
            self.notes.extensions(place, primitive.extensions.iter().flat_map(|e| e.others.keys()));
            let has = |semantic| mesh::attribute(primitive, semantic).is_some();
            for (there, what) in [
                (!drawn, "its points or lines are ignored"),
                (!has(Semantic::Positions), "it is ignored: it has no positions"),
                (has(Semantic::Colors(0)), "its vertex colours are ignored"),
                (primitive.targets.is_some(), "its morph targets are ignored"),
            ] {
                if there {
                    self.notes.warn(place, what);
                }
            }
        }
        if !drawn {
            return Ok(());
        }
        let look = self.materials.look(primitive.material, place, &mut self.builder, &mut self.notes)?;
        let mut triangles = mesh::triangles(self.asset, primitive, mode, look.set, place)?;
        if triangles.indices.is_empty() {
            return Ok(());
        }
        if let Some(set) = look.set.filter(|_| triangles.uvs.is_empty()) {
            if first {
                self.notes.warn(place, format_args!("it has no set {set} of texture coordinates: all are 0"));
            }
            triangles.uvs = vec![[0.0, 1.0]; triangles.positions.len()];
        }
        triangles.place(&placed.to_world);
        let mesh = Mesh {
            positions: &triangles.positions,
            normals: &triangles.normals,
            uvs: &triangles.uvs,
            indices: &triangles.indices,
        };
        let shines = look.emission.is_some();
        match self.builder.mesh(&mesh, look.id, look.emission) {
            Ok(0) => self.lit |= shines,
            Ok(count) => {
                self.lit |= shines;
                if first {
                    self.notes.warn(place, format_args!("triangles without area are left out: {count}"));
                }
            }
            Err(SceneError::EmptyEmitter) => {
                self.notes.warn(place, "it is left out: it shines, but has no area");
            }
            Err(cause) => return Err(LoadError::Scene { place: place.clone(), cause }),
        }
        Ok(())
    }
}

fn mode(primitive: &Primitive, place: &Place) -> Result<Mode, LoadError> {
    match primitive.mode {
        Checked::Valid(mode) => Ok(mode),
        Checked::Invalid => Err(place.clone().bad("its mode is not one of glTF's")),
    }
}

/// Calls `visit` for each primitive of each node that has a mesh.
fn each_primitive<'a>(
    asset: &'a Asset<'a>,
    placed: &[Placed<'_>],
    mut visit: impl FnMut(&Placed<'_>, &'a Primitive, &Place) -> Result<(), LoadError>,
) -> Result<(), LoadError> {
    for placed in placed {
        let Some(index) = placed.node.mesh else { continue };
        let mesh = asset.get(index, "mesh", &placed.place)?;
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            let called = name("mesh", index.value(), mesh.name.as_deref());
            visit(placed, primitive, &Place::part(asset.path, format_args!("{called}, primitive {number}")))?;
        }
    }
    Ok(())
}

/// Checks what the scene would come to, by the counts that its accessors have: a small file can show a mesh
/// many times.
fn check_size(asset: &Asset<'_>, placed: &[Placed<'_>]) -> Result<(), LoadError> {
    let (mut vertices, mut triangles) = (0u64, 0u64);
    each_primitive(asset, placed, |_, primitive, place| {
        let count = |index: Option<Index<Accessor>>| match index {
            Some(index) => asset.get(index, "accessor", place).map(|accessor| accessor.count.0),
            None => Ok(0),
        };
        let corners = count(mesh::attribute(primitive, Semantic::Positions))?;
        let indices = if primitive.indices.is_some() { count(primitive.indices)? } else { corners };
        // An empty primitive takes time, too
        vertices = vertices.saturating_add(corners.max(1));
        triangles = triangles.saturating_add(mesh::count(mode(primitive, place)?, indices));
        place.clone().at_most("vertices up to here", vertices, 3 * MAX_SURFACES as u64)?;
        place.clone().at_most("triangles up to here", triangles, MAX_SURFACES as u64)
    })
}

/// The smallest and largest coordinates of the scene.
fn bounds(asset: &Asset<'_>, placed: &[Placed<'_>]) -> Result<[DVec3; 2], LoadError> {
    let mut bounds = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    each_primitive(asset, placed, |placed, primitive, place| {
        for p in mesh::positions(asset, primitive, place)? {
            let p = DVec3::from_array(mesh::moved(p, &placed.to_world).map(f64::from));
            bounds = [bounds[0].min(p), bounds[1].max(p)];
        }
        Ok(())
    })?;
    if bounds[0].cmple(bounds[1]).all() {
        return Ok(bounds);
    }
    Err(Place::file(asset.path).bad("its scene has neither a camera nor a mesh"))
}
