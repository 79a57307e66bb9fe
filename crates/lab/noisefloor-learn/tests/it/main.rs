//! Tests of noisefloor-learn, one module a subject.
#![allow(clippy::unwrap_used, reason = "a panic in a test is how a test fails")]

/// Thresholds and the images they belong to.
mod corpus;
/// The human data in `../shared`, where they are.
mod shared;
