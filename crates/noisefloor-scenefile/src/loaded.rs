//! What loading a file yields.

use crate::error::Warning;
use noisefloor_ptwne::Scene;
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
