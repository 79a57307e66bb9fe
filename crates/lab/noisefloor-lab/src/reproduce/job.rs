//! What is reproduced, and what all protocols on one representation share.

use super::descriptors::mask_pair;
use super::pairs::{Loaded, Pairs};
use crate::advance::{Advance, Watch};
use crate::error::LabError;
use ndarray::Array2;
use noisefloor::descriptor::{Descriptor, NoiseMask};
use noisefloor_learn::{Corpora, describe_pairs};
use std::path::PathBuf;
use std::time::Instant;

#[derive(Clone, Debug)]
pub struct Reproduction {
    pub corpus: Vec<PathBuf>,
    /// Edge of the tiles in pixels: each is the centre of its zone.
    pub edge: usize,
    /// Levels a zone, with equal steps up to its most converged image.
    pub levels: usize,
}

/// The distances between all pairs of one representation, and what they cost.
pub(super) struct Geometry {
    /// ‖x − y‖² of all rows: synthesised pairs, then real ones.
    pub(super) squared: Array2<f64>,
    pub(super) seconds: f64,
}

impl Geometry {
    pub(super) fn of(pairs: &Pairs, watch: Watch<'_>) -> Self {
        let begun = Instant::now();
        let squared = pairs.squared_distances(|done, all| {
            let what = "blocks of the matrix product";
            watch(Advance { what, done: done as u64, of: all as u64, detail: "" });
        });
        Self { squared, seconds: begun.elapsed().as_secs_f64() }
    }
}

impl Reproduction {
    /// Pairs of noise masks, as the paper ends with.
    pub(super) fn masks(&self) -> Descriptor {
        mask_pair(NoiseMask::default(), self.edge)
    }

    pub(super) fn load(&self, descriptor: &Descriptor, watch: Watch<'_>) -> Result<Loaded, LabError> {
        let table =
            describe_pairs(Corpora::new(&self.corpus), descriptor, self.edge, self.levels, |done, all| {
                watch(Advance {
                    what: "zones cut into pairs",
                    done: done as u64,
                    of: all as u64,
                    detail: "",
                });
            })?;
        Ok(Loaded { digest: table.digest(), table })
    }
}
