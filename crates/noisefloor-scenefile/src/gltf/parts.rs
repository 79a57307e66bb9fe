//! What several readers of a file share.

use noisefloor_ptwne::{Emission, MaterialId};

pub(super) const DRACO: &str = "KHR_draco_mesh_compression";
/// The extension of textures whose image is WebP.
pub(super) const WEBP: &str = "EXT_texture_webp";

/// The extensions of nodes that hide them, or show their mesh any number of times.
pub(super) const VISIBILITY: &str = "KHR_node_visibility";
pub(super) const INSTANCES: &str = "EXT_mesh_gpu_instancing";

/// What the corners of a mesh multiply its colour with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Corners {
    Nothing,
    Colours,
    ColoursAndAlphas,
}

#[derive(Clone, Debug)]
pub(super) struct AddedMaterial {
    pub(super) id: MaterialId,
    pub(super) emission: Option<Emission>,
    /// Whether it shows its colour without any light.
    pub(super) unlit: bool,
    /// The sets of texture coordinates of its textures, if it has any.
    pub(super) sets: [Option<u32>; 2],
    /// Whether it has a map of normals, which lies along tangents.
    pub(super) normal_map: bool,
}

/// What to call an element: `mesh 3 "Table"`.
pub(super) fn name(kind: &str, index: usize, name: Option<&str>) -> String {
    match name {
        Some(name) => format!("{kind} {index} {:?}", name.chars().take(60).collect::<String>()),
        None => format!("{kind} {index}"),
    }
}
