//! From raw descriptors to probabilities.

use super::platt::Platt;
use super::predict::{Scaler, Svm};
use serde::{Deserialize, Serialize};

/// Scaling, machine and calibration, as they were trained together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Classifier {
    /// From raw to scaled descriptors.
    pub scaler: Scaler,
    /// The machine.
    pub svm: Svm,
    /// From decision values to probabilities.
    pub platt: Platt,
}

impl Classifier {
    /// Probability in [0, 1] that an observer sees no difference.
    ///
    /// # Panics
    /// If `raw` does not have the machine's dimensionality.
    pub fn probability(&self, raw: &[f32]) -> f32 {
        self.probability_in_place(&mut raw.to_vec())
    }

    /// The same for a descriptor that is scaled in place.
    pub(crate) fn probability_in_place(&self, raw: &mut [f32]) -> f32 {
        self.scaler.apply(raw);
        self.platt.probability(self.svm.decision(raw))
    }
}
