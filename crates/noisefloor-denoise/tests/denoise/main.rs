//! Tests of the crate as others see it.
#![allow(clippy::unwrap_used, reason = "a panic in a test is how a test fails")]

mod criterion; // the criterion, in sessions
mod estimate; // the estimate, against truths that are known
mod excess;
mod guides; // albedo and normals of halves
mod kit; // synthetic scenes and simple denoisers
mod mirrored; // mirror images, and their mean
#[cfg(feature = "oidn")]
mod oidn; // Open Image Denoise itself, where it is installed
