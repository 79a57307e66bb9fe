//! From decision values to probabilities.

use serde::{Deserialize, Serialize};

/// Platt's sigmoid P = 1/(1 + exp(a·f + b)) of a decision value f (Platt 1999).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Platt {
    /// Slope; negative where larger decision values are more likely "converged".
    pub a: f32,
    /// Offset.
    pub b: f32,
}

impl Platt {
    /// Probability in [0, 1].
    pub fn probability(&self, decision: f32) -> f32 {
        from_log_odds(self.log_odds(decision))
    }

    /// ln(P/(1 − P)).
    pub fn log_odds(&self, decision: f32) -> f64 {
        -(f64::from(self.a) * f64::from(decision) + f64::from(self.b))
    }
}

pub(crate) fn from_log_odds(log_odds: f64) -> f32 {
    (1.0 / (1.0 + (-log_odds).exp())) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_a_rising_sigmoid() {
        let platt = Platt { a: -2.0, b: 1.0 };
        assert!((platt.probability(0.5) - 0.5).abs() < 1e-6);
        assert!(platt.probability(1e9) == 1.0 && platt.probability(-1e9) == 0.0);
    }
}
