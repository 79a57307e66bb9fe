//! How scene files are loaded.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

/// What a scene file leaves to the caller.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LoadOptions {
    /// Values of `$parameters` of Mitsuba files by name, without the `$`. They override the file's own
    /// defaults.
    pub parameters: BTreeMap<String, String>,
    /// Whether participating media are left out with a warning. Without it a scene that has any is refused:
    /// its picture would be another one.
    pub ignore_volumes: bool,
    /// The folder that files named by the scene must lie in. By default that of the scene file, or one of
    /// the two above it that it shares with other scenes: not the user's own folder nor one right below it,
    /// and none of the first three levels from the top of the file system, where things lie that are no part
    /// of a scene.
    pub root: Option<PathBuf>,
}

/// What is not supported, and what to do.
pub(crate) const NO_MEDIA: &str = "a participating medium (`--ignore volumes` leaves them all out)";

impl LoadOptions {
    /// What of it changes the scene.
    pub(crate) fn identity(&self) -> String {
        let Self { parameters, ignore_volumes, .. } = self;
        format!("parameters {parameters:?}, volumes {}", if *ignore_volumes { "left out" } else { "refused" })
    }
}
