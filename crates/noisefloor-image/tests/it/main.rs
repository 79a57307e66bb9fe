//! Tests of noisefloor-image, one module a subject.
#![allow(clippy::unwrap_used, reason = "a panic in a test is how a test fails")]

mod colours; // colours that files state
mod cube; // LUTs: known answers, and what is refused
mod facts; // what EXRs say of their samples
mod hostile; // broken files: every byte flip and cut is an error or a picture, never a panic
mod pfm; // what is read from PFM, and what is refused
mod read; // what is read from EXR and PNG
mod stack; // playback of stacks
mod util; // files that others make, for the tests to read
mod write; // round trips and atomic writing
