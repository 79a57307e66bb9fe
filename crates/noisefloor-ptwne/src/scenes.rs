//! Built-in procedural scenes. They differ in light, shapes and textures, and are framed for square pictures.
//! Except for the stiff ones, both plain sRGB and Reinhard's operator show them well.
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
mod stiff;

use crate::{Scene, SceneError};

type Make = fn(&str) -> Result<Scene, SceneError>;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuiltInScene {
    pub name: &'static str,
    /// What it shows, in one line.
    pub description: &'static str,
}

const ORDINARY: &[(BuiltInScene, Make)] = &[
    (
        BuiltInScene {
            name: "cornell-box",
            description: "two boxes in a box: one area light, colour bleeding",
        },
        cornell::cornell_box,
    ),
    (
        BuiltInScene {
            name: "bulb",
            description: "a desk in a dim room under one very small light: hard shadows",
        },
        rooms::bulb,
    ),
    (
        BuiltInScene { name: "softbox", description: "metals of three roughnesses under a large soft light" },
        rooms::softbox,
    ),
    (
        BuiltInScene {
            name: "courtyard",
            description: "outdoors in sun and sky: brick, plaster, clipped trees",
        },
        outdoors::courtyard,
    ),
    (
        BuiltInScene {
            name: "door-ajar",
            description: "a room lit through a door that stands ajar: mostly indirect light",
        },
        rooms::door,
    ),
    (
        BuiltInScene { name: "glass-spheres", description: "glass and mirror balls in a box: caustics" },
        glass::caustics,
    ),
    (
        BuiltInScene {
            name: "arcade",
            description: "a hall of columns, brick and checkers under an open roof",
        },
        halls::arcade,
    ),
    (
        BuiltInScene { name: "lanterns", description: "a market street at night: 120 small lights" },
        halls::lanterns,
    ),
    (
        BuiltInScene {
            name: "plates",
            description: "metal plates of four roughnesses that mirror lights of four sizes",
        },
        glass::plates,
    ),
];

const STIFF: &[(BuiltInScene, Make)] = &[
    (
        BuiltInScene {
            name: "caustic",
            description: "light of a small lamp through glass, found only by chance",
        },
        stiff::caustic,
    ),
    (
        BuiltInScene { name: "keyhole", description: "a dark room, lit through the keyhole of its door" },
        stiff::keyhole,
    ),
    (BuiltInScene { name: "pinpoint", description: "one lamp of radius 1e-4" }, stiff::pinpoint),
    (
        BuiltInScene { name: "decades", description: "nine niches under lamps of radiance 1e-8 to 1e8" },
        stiff::decades,
    ),
    (
        BuiltInScene {
            name: "needles",
            description: "needle triangles around a bright lamp, and sheets that nearly touch",
        },
        stiff::needles,
    ),
    (
        BuiltInScene { name: "far-away", description: "columns a million units from the origin" },
        stiff::far_away,
    ),
    (BuiltInScene { name: "million", description: "hills of a million triangles" }, stiff::million),
    (
        BuiltInScene {
            name: "grazing",
            description: "camera and lamps just above plates of many roughnesses",
        },
        stiff::grazing,
    ),
    (BuiltInScene { name: "black", description: "black things under a lamp: nothing to see" }, stiff::black),
    (
        BuiltInScene { name: "unlit", description: "a still life without any light: nothing to see" },
        stiff::unlit,
    ),
];

/// The ordinary built-in scenes, in a fixed order.
pub fn list() -> impl ExactSizeIterator<Item = BuiltInScene> {
    ORDINARY.iter().map(|(entry, _)| *entry)
}

/// Scenes that are hard for a renderer, each for one reason. For tests, and for looking at known problems.
pub fn stiff() -> impl ExactSizeIterator<Item = BuiltInScene> {
    STIFF.iter().map(|(entry, _)| *entry)
}

/// The scene of this name, ordinary or stiff, if there is one.
pub fn by_name(name: &str) -> Option<Scene> {
    let (entry, make) = ORDINARY.iter().chain(STIFF).find(|(entry, _)| entry.name == name)?;
    // A test builds all of them
    make(entry.name).ok()
}

#[cfg(test)]
mod tests {
    #[test]
    fn every_scene_builds_and_names_are_unique() {
        let all = || super::ORDINARY.iter().chain(super::STIFF);
        let names: std::collections::HashSet<_> = all().map(|(entry, _)| entry.name).collect();
        assert_eq!(names.len(), all().count());
        for (entry, make) in all() {
            let scene = make(entry.name).unwrap();
            assert_eq!(scene.name(), entry.name);
            assert!(scene.surfaces() > 8);
            assert_eq!(scene.lights() > 0, entry.name != "unlit");
        }
        assert!(super::by_name("no-such-scene").is_none());
    }
}
