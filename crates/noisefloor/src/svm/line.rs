//! A straight line through scaled numbers.

use serde::{Deserialize, Serialize};

/// What logistic regression learns: the decision value w·x + b.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// w, one weight for each scaled number.
    pub weights: Vec<f32>,
    /// b.
    pub bias: f32,
}

impl Line {
    /// Decision value of a scaled descriptor: positive for "converged".
    ///
    /// # Panics
    /// If `x` has not as many numbers as there are weights.
    pub fn decision(&self, x: &[f32]) -> f32 {
        assert_eq!(x.len(), self.weights.len(), "numbers in the descriptor");
        let sum: f64 = self.weights.iter().zip(x).map(|(w, x)| f64::from(*w) * f64::from(*x)).sum();
        (sum + f64::from(self.bias)) as f32
    }
}
