//! Built-in scenes, all procedural.

mod cornell;
mod kit;

use crate::{Scene, SceneError};

type Make = fn(&str) -> Result<Scene, SceneError>;

/// A built-in scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Its name, for [`by_name`].
    pub name: &'static str,
    /// What it shows, in a line.
    pub description: &'static str,
}

const ALL: &[(Entry, Make)] = &[(
    Entry { name: "cornell-box", description: "two boxes in a box: one area light, colour bleeding" },
    cornell::cornell_box,
)];

/// All built-in scenes, in a fixed order.
pub fn list() -> impl ExactSizeIterator<Item = Entry> {
    ALL.iter().map(|(entry, _)| *entry)
}

/// The scene of this name, if there is one.
pub fn by_name(name: &str) -> Option<Scene> {
    let (entry, make) = ALL.iter().find(|(entry, _)| entry.name == name)?;
    // Tests build all of them
    make(entry.name).ok()
}
