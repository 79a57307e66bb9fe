//! What loading a file yields.

use crate::error::Warning;
use glam::DMat4;
use noisefloor_ptwne::{Camera, Scene};
use std::path::Path;

/// A scene from a file, and what the file says about how to render it.
#[derive(Debug)]
pub struct Loaded {
    pub scene: Scene,
    /// Image size in pixels that the file asks for.
    pub size: Option<(usize, usize)>,
    /// Longest path, in segments, that the file asks for.
    pub max_depth: Option<u32>,
    /// Largest channel of a sample that the file asks for: brighter ones are scaled down to it.
    pub clamp: Option<f32>,
    /// What was ignored or replaced.
    pub warnings: Vec<Warning>,
}

/// What a scene is called: as its file, or as the folder if the file's name says no more than "scene".
pub(crate) fn title(path: &Path) -> String {
    let stem = path.file_stem();
    let folder = path.parent().and_then(Path::file_name).filter(|_| stem.is_some_and(|s| s == "scene"));
    folder.or(stem).unwrap_or_default().to_string_lossy().into_owned()
}

/// A camera for a scene that gets its own later, or is only checked.
pub(crate) fn anywhere() -> Camera {
    camera(DMat4::IDENTITY, 45.0)
}

/// A camera that looks along +z of its own coordinates, with +y up.
pub(crate) fn camera(to_world: DMat4, vertical_fov: f32) -> Camera {
    let [y, z, eye] = [to_world.y_axis, to_world.z_axis, to_world.w_axis].map(|axis| axis.truncate());
    // Far from 0, a target close by would be rounded
    let target = eye + z.normalize_or_zero() * eye.abs().max_element().max(1.0);
    let [eye, target, up] = [eye, target, y.normalize_or_zero()].map(|v| v.as_vec3().to_array());
    Camera { eye, target, up, vertical_fov }
}
