//! Built-in scenes, all procedural: they differ in light, shapes and textures, and are framed for square images. Exposed so
//! that both plain sRGB and Reinhard's operator show them well.
//!
//! ```
//! use noisefloor_ptwne::scenes;
//! for entry in scenes::list() {
//!     println!("{:15} {}", entry.name, entry.description);
//!     assert!(scenes::by_name(entry.name).is_some());
//! }
//! ```

mod cornell;
mod glass;
mod halls;
mod kit;
mod outdoors;
mod rooms;

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

const ALL: &[(Entry, Make)] = &[
    (
        Entry { name: "cornell-box", description: "two boxes in a box: one area light, colour bleeding" },
        cornell::cornell_box,
    ),
    (
        Entry { name: "bulb", description: "a desk in a dim room under one very small light: hard shadows" },
        rooms::bulb,
    ),
    (
        Entry { name: "softbox", description: "metals of three roughnesses under a large soft light" },
        rooms::softbox,
    ),
    (
        Entry { name: "courtyard", description: "outdoors in sun and sky: brick, plaster, clipped trees" },
        outdoors::courtyard,
    ),
    (
        Entry {
            name: "door-ajar",
            description: "a room lit through a door that stands ajar: mostly indirect light",
        },
        rooms::door,
    ),
    (
        Entry { name: "glass-spheres", description: "glass and mirror balls in a box: caustics" },
        glass::caustics,
    ),
    (
        Entry { name: "arcade", description: "a hall of columns, brick and checkers under an open roof" },
        halls::arcade,
    ),
    (Entry { name: "lanterns", description: "a market street at night: 120 small lights" }, halls::lanterns),
    (
        Entry {
            name: "plates",
            description: "metal plates of four roughnesses that mirror lights of four sizes",
        },
        glass::plates,
    ),
];

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

#[cfg(test)]
mod tests {
    #[test]
    fn every_scene_builds_and_names_are_unique() {
        let names: std::collections::HashSet<_> = super::list().map(|entry| entry.name).collect();
        assert_eq!(names.len(), super::ALL.len());
        for (entry, make) in super::ALL {
            let scene = make(entry.name).unwrap();
            assert_eq!(scene.name(), entry.name);
            assert!(scene.lights() > 0 && scene.surfaces() > 10);
        }
        assert!(super::by_name("no-such-scene").is_none());
    }
}
