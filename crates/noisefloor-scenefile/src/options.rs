//! How scene files are loaded.

use std::collections::BTreeMap;
use std::path::PathBuf;

/// What a scene file leaves to whoever loads it.
#[derive(Clone, Debug, Default)]
#[non_exhaustive]
pub struct LoadOptions {
    /// Values of `$parameters` of Mitsuba files by name, without the `$`. They override the file's own
    /// defaults.
    pub parameters: BTreeMap<String, String>,
    /// Whether participating media are left out with a warning. Without it a scene that has any is refused:
    /// its picture would be another one.
    pub ignore_volumes: bool,
    /// The folder that files named by the scene must lie in; by default the folder of the scene file.
    pub root: Option<PathBuf>,
}

impl LoadOptions {
    /// What of it changes the scene.
    pub(crate) fn identity(&self) -> String {
        let Self { parameters, ignore_volumes, .. } = self;
        format!("parameters {parameters:?}, volumes {}", if *ignore_volumes { "left out" } else { "refused" })
    }
}
