//! The renderer against mathematically known answers.
//!
//! Every statistical test is seeded and compares a mean over independent batches with an exact value, at five
//! standard errors, estimated from at least 64 batches. By Student's t with 63 degrees of freedom, a correct
//! renderer fails one such comparison by chance with p = 5e-6. The whole suite makes about a hundred: 5e-4.

#![allow(clippy::unwrap_used, reason = "a panic in a test is how a test fails")]

mod determinism; // threads, batches, seeds, independence
mod direct; // direct light in closed form, and the reference
mod extremes; // nothing but finite numbers
mod first_hits; // colours and normals of a known surface
mod furnace; // energy neither made nor lost
mod instances; // objects shown many times: as their copies are seen
mod kit;
mod media;
mod mis; // next events, scattering, and both
mod mixes; // choices between materials, and between a surface and what lies behind it
mod models; // glTF's, Mitsuba's and pbrt's layered surfaces
mod points; // spots and projectors
mod reference; // how free of noise the reference is
mod relief; // normal maps, bumps, coats, colours of corners
mod sampling;
mod stiff; // scenes with known trouble
