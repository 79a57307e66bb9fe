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

/// Name, description and maker of a scene.
type Entry = (&'static str, &'static str, fn(&str) -> Result<Scene, SceneError>);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuiltInScene {
    pub name: &'static str,
    /// What it shows, in one line.
    pub description: &'static str,
}

const ORDINARY: &[Entry] = &[
    ("cornell-box", "two boxes in a box: one area light, colour bleeding", cornell::cornell_box),
    ("bulb", "a desk in a dim room under one very small light: hard shadows", rooms::bulb),
    ("softbox", "metals of three roughnesses under a large soft light", rooms::softbox),
    ("courtyard", "outdoors in sun and sky: brick, plaster, clipped trees", outdoors::courtyard),
    ("door-ajar", "a room lit through a door that stands ajar: mostly indirect light", rooms::door),
    ("glass-spheres", "glass and mirror balls in a box: caustics", glass::caustics),
    ("arcade", "a hall of columns, brick and checkers under an open roof", halls::arcade),
    ("lanterns", "a market street at night: 120 small lights", halls::lanterns),
    ("plates", "metal plates of four roughnesses that mirror lights of four sizes", glass::plates),
];

const STIFF: &[Entry] = &[
    ("caustic", "light of a small lamp through glass, found only by chance", stiff::caustic),
    ("keyhole", "a dark room, lit through the keyhole of its door", stiff::keyhole),
    ("pinpoint", "one lamp of radius 1e-4", stiff::pinpoint),
    ("decades", "nine niches under lamps of radiance 1e-8 to 1e8", stiff::decades),
    ("needles", "needle triangles around a bright lamp, and sheets that nearly touch", stiff::needles),
    ("far-away", "columns a million units from the origin", stiff::far_away),
    ("million", "hills of a million triangles", stiff::million),
    ("grazing", "camera and lamps just above plates of many roughnesses", stiff::grazing),
    ("black", "black things under a lamp: nothing to see", stiff::black),
    ("unlit", "a still life without any light: nothing to see", stiff::unlit),
];

/// The ordinary built-in scenes, in a fixed order.
pub fn list() -> impl ExactSizeIterator<Item = BuiltInScene> {
    ORDINARY.iter().map(described)
}

/// Scenes that are hard for a renderer, each for one reason. For tests, and for looking at known problems.
pub fn stiff() -> impl ExactSizeIterator<Item = BuiltInScene> {
    STIFF.iter().map(described)
}

fn described(&(name, description, _): &Entry) -> BuiltInScene {
    BuiltInScene { name, description }
}

/// The scene of this name, ordinary or stiff, if there is one.
pub fn by_name(name: &str) -> Option<Scene> {
    let (name, _, make) = ORDINARY.iter().chain(STIFF).find(|entry| entry.0 == name)?;
    // A test builds all of them
    make(name).ok()
}

#[cfg(test)]
mod tests {
    #[test]
    fn every_scene_builds_and_names_are_unique() {
        let all = || super::ORDINARY.iter().chain(super::STIFF);
        let names: std::collections::HashSet<_> = all().map(|entry| entry.0).collect();
        assert_eq!(names.len(), all().count());
        for (name, _, make) in all() {
            let scene = make(name).unwrap();
            assert_eq!(scene.name(), *name);
            assert!(scene.surfaces() > 8);
            assert_eq!(scene.lights() > 0, *name != "unlit");
        }
        assert!(super::by_name("no-such-scene").is_none());
    }
}
