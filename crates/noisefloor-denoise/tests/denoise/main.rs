//! Tests of the crate as others see it.
#![allow(clippy::unwrap_used, reason = "a panic in a test is how a test fails")]

/// The criterion, in sessions.
mod criterion;
/// The estimate, against truths that are known.
mod estimate;
mod excess;
/// Albedo and normals of halves.
mod guides;
/// Synthetic scenes and simple denoisers.
mod kit;
/// Mirror images, and their mean.
mod mirrored;
/// Open Image Denoise itself, where it is installed.
#[cfg(feature = "oidn")]
mod oidn;
