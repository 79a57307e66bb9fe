//! Meshes that several nodes show: each is in the scene once, and seen through instances.

use super::asset::Asset;
use super::nodes::Placed;
use super::{Loader, Pose};
use crate::{LoadError, Place};
use glam::{DAffine3, DVec3};
use gltf::json::Mesh;
use noisefloor_ptwne::{ObjectId, SceneError};
use std::collections::{HashMap, HashSet};
use std::rc::Rc;

/// What the nodes that show a mesh share.
#[derive(Debug)]
pub(super) struct Shared {
    object: ObjectId,
    /// The smallest and largest coordinates, in those of the mesh.
    bounds: [DVec3; 2],
    /// The primitives that shine, which they do not share.
    pub(super) shining: HashSet<usize>,
}

/// The indices of nodes that show a mesh at rest which others show, too.
pub(super) fn sharing(placed: &[Placed<'_>]) -> HashSet<usize> {
    let mesh = |placed: &&Placed<'_>| {
        let plain = placed.node.skin.is_none() && placed.node.weights.is_none();
        let flat = placed.to_world.matrix3.determinant() == 0.0;
        placed.node.mesh.filter(|_| plain && !flat).map(|mesh| (mesh.value(), placed.index))
    };
    let mut shown: HashMap<usize, usize> = HashMap::new();
    for (mesh, _) in placed.iter().filter_map(|placed| mesh(&placed)) {
        *shown.entry(mesh).or_default() += 1;
    }
    let all = placed.iter().filter_map(|placed| mesh(&placed));
    all.filter(|(mesh, _)| shown[mesh] > 1).map(|(_, node)| node).collect()
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

impl Loader<'_> {
    /// Shows a mesh that others show, too; none if that must be done without an instance.
    pub(super) fn instance(
        &mut self,
        placed: &Placed<'_>,
        index: usize,
        mesh: &Mesh,
        called: &str,
    ) -> Result<Option<Rc<Shared>>, LoadError> {
        let shared = match self.shared.get(&index) {
            Some(shared) => shared.clone(),
            None => {
                let shared = Rc::new(self.object(mesh, called, &placed.place)?);
                self.shared.insert(index, shared.clone());
                shared
            }
        };
        let DAffine3 { matrix3, translation } = placed.to_world;
        let rows = [0, 1, 2].map(|i| {
            let [x, y, z] = matrix3.row(i).to_array();
            [x, y, z, translation[i]]
        });
        match self.builder.instance(shared.object, rows) {
            Err(SceneError::Singular) => return Ok(None),
            shown => shown.map_err(|cause| LoadError::Scene { place: placed.place.clone(), cause })?,
        }
        let [low, high] = shared.bounds;
        if low.cmple(high).all() {
            for corner in 0..8 {
                let at = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
                let p = placed.to_world.transform_point3(DVec3::new(at(0), at(1), at(2)));
                self.bounds = [self.bounds[0].min(p), self.bounds[1].max(p)];
            }
        }
        Ok(Some(shared))
    }

    /// Adds what the nodes that show a mesh share.
    fn object(&mut self, mesh: &Mesh, called: &str, place: &Place) -> Result<Shared, LoadError> {
        let refused = |cause| LoadError::Scene { place: place.clone(), cause };
        let weights = mesh.weights.as_deref().unwrap_or_default();
        let pose = Pose { to_world: &DAffine3::IDENTITY, joints: None, weights };
        let outside = std::mem::replace(&mut self.bounds, [DVec3::INFINITY, DVec3::NEG_INFINITY]);
        let mut shining = HashSet::new();
        self.builder.begin_object().map_err(refused)?;
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            let place = Place::part(self.asset.path, format_args!("{called}, primitive {number}"));
            if self.primitive(primitive, &pose, true, true, &place)? {
                shining.insert(number);
            }
        }
        let object = self.builder.end_object().map_err(refused)?;
        let bounds = std::mem::replace(&mut self.bounds, outside);
        Ok(Shared { object, bounds, shining })
    }
}
