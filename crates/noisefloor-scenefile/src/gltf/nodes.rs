//! The hierarchy of nodes (glTF 2.0, §3.5).

use super::asset::Asset;
use super::parts::name;
use crate::{LoadError, Place};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use gltf::json::{Index, Node};

/// A node in its place in the world.
#[derive(Clone, Debug)]
pub(super) struct Placed<'a> {
    pub(super) node: &'a Node,
    pub(super) index: usize,
    /// What to call it.
    pub(super) place: Place,
    pub(super) to_world: DAffine3,
}

/// The nodes of the default scene, parents before children, in the order of the file.
pub(super) fn placed<'a>(asset: &'a Asset<'a>) -> Result<Vec<Placed<'a>>, LoadError> {
    let file = Place::file(asset.path);
    let root = &asset.root;
    let scene = match root.scene {
        Some(index) => asset.get(index, "scene", &file)?,
        None => {
            let none = || file.clone().bad("it has no scene, only parts for other files");
            root.scenes.first().ok_or_else(none)?
        }
    };
    let mut reached = vec![false; root.nodes.len()];
    let mut waiting: Vec<(Index<Node>, DAffine3)> =
        scene.nodes.iter().rev().map(|node| (*node, DAffine3::IDENTITY)).collect();
    let mut placed = vec![];
    while let Some((index, parent)) = waiting.pop() {
        let node = asset.get(index, "node", &file)?;
        let place = Place::part(asset.path, name("node", index.value(), node.name.as_deref()));
        // Each node has one parent, so that a second visit means a cycle or worse
        if std::mem::replace(&mut reached[index.value()], true) {
            let what =
                "it is reached twice; a node must have one parent, and none of its descendants as a child";
            return Err(place.bad(what));
        }
        let to_world = parent
            * local(node).ok_or_else(|| {
                place.clone().bad("its rotation is zero or not finite, not a unit quaternion")
            })?;
        let children = node.children.as_deref().unwrap_or_default();
        waiting.extend(children.iter().rev().map(|child| (*child, to_world)));
        placed.push(Placed { node, index: index.value(), place, to_world });
    }
    Ok(placed)
}

fn local(node: &Node) -> Option<DAffine3> {
    if let Some(matrix) = node.matrix {
        let [x, y, z, w]: [DVec3; 4] =
            std::array::from_fn(|i| DVec3::from_array(std::array::from_fn(|j| f64::from(matrix[4 * i + j]))));
        return Some(DAffine3::from_mat3_translation(DMat3::from_cols(x, y, z), w));
    }
    let [translation, scale] = [(node.translation, 0.0), (node.scale, 1.0)]
        .map(|(v, default)| DVec3::from_array(v.map_or([default; 3], |v| v.map(f64::from))));
    let rotation = DQuat::from_array(node.rotation.unwrap_or_default().0.map(f64::from));
    let length = rotation.length();
    (length > 0.0 && length.is_finite())
        .then(|| DAffine3::from_scale_rotation_translation(scale, rotation / length, translation))
}
