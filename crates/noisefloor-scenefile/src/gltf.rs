//! glTF 2.0, as JSON or GLB.
//!
//! The crate `gltf` gives the types of the JSON. Its own checks and readers are not used: they index and
//! unwrap what a file says. Here each index is looked up, and each length checked, where it is used.

mod accessor;
mod asset;
mod camera;
mod clearcoat;
mod draco;
mod gloss;
mod light;
mod loader;
mod material;
mod mesh;
mod nodes;
mod parts;
mod properties;
mod rest;
mod shared;
mod texture;
mod uri;

use crate::files::has_memory;
use crate::load::Load;
use crate::loaded::{Loaded, anywhere, title};
use crate::{LoadError, Place};
use asset::{Asset, MAX_BYTES};
use glam::DVec3;
use gltf::json::mesh::Semantic;
use gltf::json::{Accessor, Index};
use loader::Loader;
use material::Materials;
use nodes::Placed;
use noisefloor_ptwne::{MAX_SURFACES, SceneBuilder};
use parts::name;
use std::collections::{HashMap, HashSet};
use std::path::Path;

/// Most primitives of meshes, each counted as often as nodes show it without sharing it.
const MAX_PRIMITIVES: u64 = 1 << 20;
/// Bytes that a vertex or a triangle takes at least, while a scene is made.
const BYTES_EACH: u64 = 64;

pub(crate) fn load(path: &Path, root: Option<&Path>) -> Result<Loaded, LoadError> {
    let load = Load::new(path, root, String::new());
    let file = load.folder.read(path, MAX_BYTES, &Place::file(path))?;
    let asset = Asset::parse(&load, &file)?;
    asset.check_required()?;
    let asset = draco::inflated(asset)?;
    let placed = nodes::placed(&asset)?;
    let sharing = shared::sharing(&placed);
    check_size(&asset, &placed, &sharing)?;

    let whole = Place::file(path);
    let (camera, optics) = camera::first(&asset, &placed)?.unzip();
    if camera.is_none() {
        asset
            .load
            .ignored(&whole, "it has no camera: all of it is seen from the front, above and to the right");
    }
    let title = title(path);
    let refused = whole.refused();
    let mut builder = SceneBuilder::new(title, camera.unwrap_or_else(anywhere)).map_err(&refused)?;
    builder.optics(optics.unwrap_or_default()).map_err(&refused)?;

    let mut loader = Loader {
        asset: &asset,
        builder,
        materials: Materials::new(&asset),
        meshes: HashSet::new(),
        nodes: placed.iter().map(|placed| (placed.index, placed.to_world)).collect(),
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
    let Loader { builder, needs_light, .. } = loader;
    for (index, animation) in asset.root.animations.iter().enumerate() {
        let place = Place::part(path, name("animation", index, animation.name.as_deref()));
        asset.load.ignored(&place, "it is ignored: everything stays at rest, where its node is");
    }
    let mut scene = builder.build().and_then(|scene| scene.with_camera(camera)).map_err(&refused)?;
    if needs_light {
        const DAYLIGHT: &str = "it gets a grey sky, and a sun over the viewer's left shoulder";
        let sky = match scene.lights() {
            0 => {
                asset.load.ignored(&whole, format_args!("it has no light: {DAYLIGHT}"));
                Some(light::daylight(&camera))
            }
            _ => {
                let sky = light::missing_daylight(&scene, &camera);
                if sky.is_some() {
                    let what = format_args!("its own lights show next to nothing of it: {DAYLIGHT}");
                    asset.load.ignored(&whole, what);
                }
                sky
            }
        };
        if let Some(sky) = sky {
            scene = scene.with_environment(sky).map_err(&refused)?;
        }
    }
    asset.say_unread();
    let scene = scene.with_identity(load.folder.contents());
    drop(asset);
    Ok(Loaded { scene, size: None, max_depth: None, clamp: None, warnings: load.into_warnings() })
}

/// Checks what the scene would come to, by the counts that its accessors have: a small file can show a mesh
/// many times. What nodes share counts once.
fn check_size(asset: &Asset<'_>, placed: &[Placed<'_>], sharing: &HashSet<usize>) -> Result<(), LoadError> {
    let (mut primitives, mut vertices, mut triangles) = (0u64, 0u64, 0u64);
    let mut seen = HashSet::new();
    for placed in placed.iter().flat_map(|placed| placed.shown.iter().map(move |_| placed)) {
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
            let own = mesh::count(mesh::mode(primitive, &place)?, indices);
            triangles = triangles.saturating_add(own);
            place.at_most("primitives of nodes up to here", primitives, MAX_PRIMITIVES)?;
            place.at_most("vertices up to here", vertices, 3 * MAX_SURFACES as u64)?;
            asset.load.folder.build(own, &place)?;
        }
    }
    has_memory(vertices + triangles, BYTES_EACH, &Place::file(asset.path))
}
