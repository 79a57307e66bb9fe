//! Commands and sources that this build does not have.
#![cfg_attr(feature = "full", allow(dead_code, reason = "a full build leaves out nothing"))]

use std::fmt;

/// What was typed is known, but was left out of this build.
#[derive(Debug)]
pub struct LeftOut {
    /// As typed: `study`.
    pub what: &'static str,
    /// The feature that has it.
    pub feature: &'static str,
    /// What to type after `--`.
    pub again: &'static str,
}

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { what, feature, again } = self;
        write!(f, "this build has no '{what}': run `cargo run --release --features {feature} -- {again}`")
    }
}

impl std::error::Error for LeftOut {}

/// Fails with [`LeftOut`].
#[cfg(any(feature = "train", not(feature = "lab")))]
pub fn left_out<T>(what: &'static str, feature: &'static str, again: &'static str) -> anyhow::Result<T> {
    Err(LeftOut { what, feature, again }.into())
}
