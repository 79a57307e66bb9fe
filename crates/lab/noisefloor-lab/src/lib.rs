//! Experiments on stopping criteria: what each one costs, what it leaves, and how close it comes to people.
//!
//! This crate serves the commands: any release may change its interface.
//!
//! - [`compare`]: criteria that watch one render; samples, seconds and distance from the converged picture
//!   of each.
//! - [`rivals`]: other people's criteria on pictures whose noise thresholds people gave.
//! - [`reproduce`]: the protocols of Takouachet et al. 2017, at the scale of the paper.
//! - [`figures`]: plots and maps of an evaluation by [`noisefloor_learn`].
//!
//! Results come first, as plain data that `serde` writes; plots, pictures and pages are made from them by
//! functions of their own. Nothing here prints: long work reports an [`Advance`] to a [`Watch`].

#![allow(missing_docs, reason = "serves the commands: any release may change what is public here")]

mod advance;
mod drawing;
mod error;
mod files;

pub mod compare;
pub mod figures;
pub mod reproduce;
pub mod rivals;

pub use advance::{Advance, Watch};
pub use error::LabError;
