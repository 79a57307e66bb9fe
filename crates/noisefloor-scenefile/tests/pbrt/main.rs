//! Tests of pbrt scenes, one module a subject.
#![allow(clippy::unwrap_used, reason = "a panic in a test is how a test fails")]

mod bad; // what is broken or not supported, and where
mod defaults; // what is taken where a parameter is not given
mod hostile; // damaged files are errors or scenes, never a panic
mod looks; // what scenes look like
mod util; // scenes to write, load and look at
