//! The probability from which a tile counts as converged.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// P from which two pictures count as identical, strictly between 0 and 1.
///
/// ```
/// use noisefloor::Threshold;
///
/// assert!(Threshold::PAPER.is_reached_by(0.93));
/// assert!(Threshold::new(1.0).is_err());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Serialize, Deserialize)]
#[serde(try_from = "f32", into = "f32")]
pub struct Threshold(f32);

/// A probability threshold outside (0, 1).
#[derive(Debug, Error, Clone, PartialEq)]
#[error("the probability threshold must be a number between 0 and 1, not {0}")]
pub struct ThresholdError(String);

impl Threshold {
    /// P ≥ 0.9 (Takouachet et al. 2017, §4.4).
    pub const PAPER: Self = Self(0.9);

    /// A threshold of one's own.
    ///
    /// # Errors
    /// [`ThresholdError`] unless 0 < `p` < 1.
    pub fn new(p: f32) -> Result<Self, ThresholdError> {
        if p > 0.0 && p < 1.0 { Ok(Self(p)) } else { Err(ThresholdError(p.to_string())) }
    }

    /// The probability.
    pub fn get(self) -> f32 {
        self.0
    }

    /// Whether a tile of this probability has converged.
    pub fn is_reached_by(self, probability: f32) -> bool {
        probability >= self.0
    }
}

impl Default for Threshold {
    fn default() -> Self {
        Self::PAPER
    }
}

impl TryFrom<f32> for Threshold {
    type Error = ThresholdError;

    fn try_from(p: f32) -> Result<Self, ThresholdError> {
        Self::new(p)
    }
}

impl From<Threshold> for f32 {
    fn from(threshold: Threshold) -> Self {
        threshold.0
    }
}

impl FromStr for Threshold {
    type Err = ThresholdError;

    fn from_str(text: &str) -> Result<Self, ThresholdError> {
        text.parse().map_err(|_| ThresholdError(text.to_owned())).and_then(Self::new)
    }
}

impl fmt::Display for Threshold {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_probabilities_between_none_and_certainty() {
        assert_eq!("0.9".parse(), Ok(Threshold::PAPER));
        for wrong in ["0", "1", "-0.5", "90", "NaN", "inf", "often"] {
            let error = wrong.parse::<Threshold>().unwrap_err();
            assert!(error.to_string().ends_with(wrong), "{error}");
        }
    }
}
