//! From raw descriptors to probabilities.

use super::line::Line;
use super::platt::Platt;
use super::predict::{Scaler, Svm};
use serde::{Deserialize, Serialize};

/// What decides on scaled descriptors.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Machine {
    /// A straight line, by logistic regression: the bundled model's.
    Line(Line),
    /// A support vector machine: the paper's.
    Svm(Svm),
}

impl Machine {
    /// What it is called: `line` or `svm`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Line(_) => "line",
            Self::Svm(_) => "svm",
        }
    }

    /// Decision value of a scaled descriptor: positive for "converged".
    ///
    /// # Panics
    /// If `x` does not have the machine's dimensionality.
    pub fn decision(&self, x: &[f32]) -> f32 {
        match self {
            Self::Line(line) => line.decision(x),
            Self::Svm(svm) => svm.decision(x),
        }
    }
}

/// Scaling, machine and calibration, as they were trained together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Classifier {
    /// From raw to scaled descriptors.
    pub scaler: Scaler,
    /// The machine.
    pub machine: Machine,
    /// From decision values to probabilities.
    pub platt: Platt,
}

impl Classifier {
    /// Probability in [0, 1] that the mean observer sees no difference.
    ///
    /// # Panics
    /// If `raw` does not have the machine's dimensionality.
    pub fn probability(&self, raw: &[f32]) -> f32 {
        crate::svm::platt::from_log_odds(self.log_odds_in_place(&mut raw.to_vec()))
    }

    /// The log-odds of that, for a descriptor that is scaled in place.
    pub(crate) fn log_odds_in_place(&self, raw: &mut [f32]) -> f64 {
        self.scaler.apply(raw);
        self.platt.log_odds(self.machine.decision(raw))
    }
}
