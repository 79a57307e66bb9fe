//! Tests of Mitsuba scenes, one module a subject.
#![allow(clippy::unwrap_used, reason = "a panic in a test is how a test fails")]

mod attributes; // what is broken, unsupported or too large, and what is only warned of
mod bad;
mod files; // includes, parameters, search paths, volumes, and errors and warnings together
mod hostile; // broken files: every flip and cut is an error or a scene, never a panic
mod lights; // lights and surroundings
mod materials; // surfaces and textures
mod relief; // bump and normal maps
mod roughness; // roughness by map and direction, and transmission
mod setup; // camera, image size, path length; parameters and references
mod shapes; // shapes and their fronts
mod shared; // the scenes in `../shared`, where they are
mod util; // scenes to write, load and look at
