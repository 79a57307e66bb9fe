//! Meshes that several nodes show: each is in the scene once, and seen through instances.

use super::asset::Asset;
use super::nodes::Placed;
use glam::DVec3;
use gltf::json::Mesh;
use noisefloor_ptwne::ObjectId;
use std::collections::{HashMap, HashSet};

/// What the nodes that show a mesh share.
#[derive(Debug)]
pub(super) struct Shared {
    pub(super) object: ObjectId,
    /// The smallest and largest coordinates, in those of the mesh.
    pub(super) bounds: [DVec3; 2],
    /// The primitives that shine, which they do not share.
    pub(super) shining: HashSet<usize>,
}

/// The indices of nodes that show a mesh at rest which others show, too.
pub(super) fn sharing<'p>(placed: &'p [Placed<'_>]) -> HashSet<usize> {
    let mesh = |placed: &'p Placed<'_>| {
        let plain = placed.node.skin.is_none() && placed.node.weights.is_none();
        let flat = placed.shown.iter().any(|to_world| to_world.matrix3.determinant() == 0.0);
        placed.node.mesh.filter(|_| plain && !flat).map(|mesh| (mesh.value(), placed))
    };
    let mut shown: HashMap<usize, usize> = HashMap::new();
    for (mesh, placed) in placed.iter().filter_map(mesh) {
        *shown.entry(mesh).or_default() += placed.shown.len();
    }
    let all = placed.iter().filter_map(mesh);
    all.filter(|(mesh, _)| shown[mesh] > 1).map(|(_, placed)| placed.index).collect()
}

/// Whether a primitive of a mesh may shine.
pub(super) fn may_shine(asset: &Asset<'_>, mesh: &Mesh) -> bool {
    mesh.primitives.iter().any(|primitive| {
        let material = primitive.material.and_then(|index| asset.root.materials.get(index.value()));
        material.is_some_and(|material| {
            let unlit = material.extensions.as_ref().is_some_and(|e| e.unlit.is_some());
            unlit || material.emissive_factor.0 != [0.0; 3]
        })
    })
}
