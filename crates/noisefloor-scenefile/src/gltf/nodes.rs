//! The hierarchy of nodes (glTF 2.0, §3.5).

use super::accessor::floats;
use super::asset::Asset;
use super::parts::{INSTANCES, VISIBILITY, name};
use crate::{LoadError, Place};
use glam::{DAffine3, DMat4, DQuat, DVec3};
use gltf::json::{Accessor, Index, Node, Value};

/// A node in its place in the world.
#[derive(Clone, Debug)]
pub(super) struct Placed<'a> {
    pub(super) node: &'a Node,
    pub(super) index: usize,
    /// What to call it.
    pub(super) place: Place,
    pub(super) to_world: DAffine3,
    /// Whether its mesh and light are seen.
    pub(super) visible: bool,
    /// Where its mesh is seen: once, or as often as it has instances.
    pub(super) shown: Vec<DAffine3>,
}

/// The nodes of the default scene, parents before children, in the order of the file.
pub(super) fn placed<'a>(asset: &'a Asset<'a>) -> Result<Vec<Placed<'a>>, LoadError> {
    let file = Place::file(asset.path);
    let root = &asset.root;
    let scene = match root.scene {
        Some(index) => asset.get(index, "scene", &file)?,
        None => {
            let none = || file.bad("it has no scene, only parts for other files");
            root.scenes.first().ok_or_else(none)?
        }
    };
    let mut reached = vec![false; root.nodes.len()];
    let mut waiting: Vec<(Index<Node>, DAffine3, bool)> =
        scene.nodes.iter().rev().map(|node| (*node, DAffine3::IDENTITY, true)).collect();
    let mut placed = vec![];
    while let Some((index, parent, visible)) = waiting.pop() {
        let node = asset.get(index, "node", &file)?;
        let place = Place::part(asset.path, name("node", index.value(), node.name.as_deref()));
        // Each node has one parent, so that a second visit means a cycle or worse
        if std::mem::replace(&mut reached[index.value()], true) {
            let what =
                "it is reached twice; a node must have one parent, and none of its descendants as a child";
            return Err(place.bad(what));
        }
        let to_world = parent
            * local(node)
                .ok_or_else(|| place.bad("its rotation is zero or not finite, not a unit quaternion"))?;
        let extension = |name: &str| node.extensions.as_ref().and_then(|e| e.others.get(name));
        let hidden = extension(VISIBILITY).and_then(|e| e.get("visible")) == Some(&Value::Bool(false));
        let visible = visible && !hidden;
        let shown = match (visible && node.mesh.is_some(), extension(INSTANCES)) {
            (false, _) => vec![],
            (true, None) => vec![to_world],
            (true, Some(instances)) => instances_of(asset, instances, to_world, &place)?,
        };
        let children = node.children.as_deref().unwrap_or_default();
        waiting.extend(children.iter().rev().map(|child| (*child, to_world, visible)));
        placed.push(Placed { node, index: index.value(), place, to_world, visible, shown });
    }
    Ok(placed)
}

fn local(node: &Node) -> Option<DAffine3> {
    if let Some(matrix) = node.matrix {
        return Some(affine(matrix));
    }
    let rotation = node.rotation.unwrap_or_default().0;
    composed(node.translation.unwrap_or([0.0; 3]), rotation, node.scale.unwrap_or([1.0; 3]))
}

/// A matrix column by column, whose last row is 0 0 0 1.
pub(super) fn affine(matrix: [f32; 16]) -> DAffine3 {
    DAffine3::from_mat4(DMat4::from_cols_array(&matrix.map(f64::from)))
}

/// Scaled, rotated and moved; none if that is no rotation.
fn composed(translation: [f32; 3], rotation: [f32; 4], scale: [f32; 3]) -> Option<DAffine3> {
    let [translation, scale] = [translation, scale].map(|v| DVec3::from_array(v.map(f64::from)));
    let rotation = DQuat::from_array(rotation.map(f64::from));
    let length = rotation.length();
    (length > 0.0 && length.is_finite())
        .then(|| DAffine3::from_scale_rotation_translation(scale, rotation / length, translation))
}

/// Where the instances of a mesh are that a node at `to_world` has (EXT_mesh_gpu_instancing).
fn instances_of(
    asset: &Asset<'_>,
    extension: &Value,
    to_world: DAffine3,
    place: &Place,
) -> Result<Vec<DAffine3>, LoadError> {
    let bad = |what: &str| place.bad(format_args!("{INSTANCES}: {what}"));
    let attributes = extension.get("attributes").and_then(Value::as_object);
    let attributes = attributes.ok_or_else(|| bad("it needs `attributes`"))?;
    let accessor = |index: &Value| {
        Index::<Accessor>::new(index.as_u64().and_then(|i| u32::try_from(i).ok()).unwrap_or(u32::MAX))
    };
    let mut count = None;
    for index in attributes.values() {
        let found = asset.get(accessor(index), "accessor", place)?.count.0;
        if *count.get_or_insert(found) != found {
            return Err(bad("its attributes differ in number"));
        }
    }
    // Accessors without data have any count, and any number of nodes may name one
    let bytes = count.unwrap_or(0).saturating_mul(size_of::<DAffine3>() as u64);
    asset.load.folder.inflate(bytes, place)?;
    let rows = |key: &str| attributes.get(key).map(accessor);
    let translations = rows("TRANSLATION").map(|index| floats::<3>(asset, index, place)).transpose()?;
    let rotations = rows("ROTATION").map(|index| floats::<4>(asset, index, place)).transpose()?;
    let scales = rows("SCALE").map(|index| floats::<3>(asset, index, place)).transpose()?;
    let instance = |i: usize| {
        let translation = translations.as_ref().map_or([0.0; 3], |rows| rows[i]);
        let rotation = rotations.as_ref().map_or([0.0, 0.0, 0.0, 1.0], |rows| rows[i]);
        let own = composed(translation, rotation, scales.as_ref().map_or([1.0; 3], |rows| rows[i]));
        Ok(to_world * own.ok_or_else(|| bad("a rotation is no unit quaternion"))?)
    };
    (0..count.unwrap_or(0) as usize).map(instance).collect()
}
