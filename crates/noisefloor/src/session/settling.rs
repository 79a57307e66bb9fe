//! When an exposure is settled again.

use crate::display::Display;
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};

/// Change of the exposure, as a share of it, from which on earlier verdicts are looked at again.
const MOVED: f64 = 0.02;
/// Growth of all samples after which it is settled again: a pass over the film, as often as its noise has
/// fallen by a tenth.
const GROWTH: f64 = 1.25;

/// What the exposure was settled from.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub(crate) struct Settling {
    /// Samples in the film, over all pixels.
    pub(crate) samples: u64,
    /// Standard error of the exposure, as a share of it.
    pub(crate) error: f64,
}

impl Settling {
    pub(super) fn is_due(&self, samples: u64) -> bool {
        samples as f64 >= GROWTH * self.samples as f64
    }
}

/// Whether pictures look another way under the two.
pub(super) fn is_another(before: &Display, now: &Display) -> bool {
    (f64::from(now.exposure()) / f64::from(before.exposure())).ln().abs() > MOVED
}

#[cfg(test)]
mod tests;
