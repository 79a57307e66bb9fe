//! Scenes of all formats, that the tests write themselves: one module a format.
//!
//! Renders are seeded; where they have noise, a tolerance is at least four standard errors.

#![allow(clippy::unwrap_used, reason = "a panic in a test is how a test fails")]

mod damage; // damaged files are errors or scenes, never a panic
mod gltf;
mod mitsuba;
mod pbrt;
mod util; // scenes to write, load and look at
