//! glTF files that the tests make themselves.
//!
//! Renders are seeded; where they have noise, a tolerance is at least four standard errors.

#![allow(clippy::unwrap_used, reason = "a panic in a test is how a test fails")]

mod bad; // bad files, and what is said of them
mod draco; // compressed meshes
mod extensions; // normal maps, coats, colours of vertices, daylight
mod fuzz; // thousands of files with damage
mod geometry; // where triangles and cameras are
mod kit;
mod lights; // lights without size
mod materials; // what surfaces look like
