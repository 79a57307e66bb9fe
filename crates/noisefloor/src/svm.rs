//! What decides, a line or a support vector machine, and how sure it is. In f32 and without allocation. With the feature
//! `train`, machines are trained here, too; `noisefloor-learn` fits lines.

#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};

#[cfg(feature = "train")]
mod train;
#[cfg(feature = "train")]
pub use train::{SvmParams, SvmTrainError, check_examples, fit_platt, fit_svm};

/// Shifts and scales each number of a descriptor to mean 0 and standard deviation 1 over the training set.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub struct Scaler {
    /// Mean of each number.
    pub mean: Vec<f32>,
    /// 1/(standard deviation) of each number; 1 for a constant one.
    pub scale: Vec<f32>,
}

impl Scaler {
    /// Leaves descriptors of `dimensions` numbers as they are.
    pub fn identity(dimensions: usize) -> Self {
        Self { mean: vec![0.0; dimensions], scale: vec![1.0; dimensions] }
    }

    /// Learns from rows of equal length. A column whose standard deviation is below `least`, at least 0, is
    /// scaled as if it had that: differences that are nothing are not blown up to matter as much as the
    /// others.
    pub fn fit<'a>(rows: impl Iterator<Item = &'a [f32]> + Clone, least: f64) -> Self {
        let dimensions = rows.clone().next().map_or(0, <[f32]>::len);
        let count = rows.clone().count().max(1) as f64;
        let column =
            |c: usize, f: &dyn Fn(f64) -> f64| rows.clone().map(|r| f(f64::from(r[c]))).sum::<f64>() / count;
        let (mut mean, mut scale) = (Vec::new(), Vec::new());
        for c in 0..dimensions {
            let m = column(c, &|v| v);
            let deviation = column(c, &|v| (v - m) * (v - m)).sqrt().max(least);
            mean.push(m as f32);
            scale.push(if deviation > 1e-9 { (1.0 / deviation) as f32 } else { 1.0 });
        }
        Self { mean, scale }
    }

    /// A scaled copy of a descriptor.
    pub fn scaled(&self, descriptor: &[f32]) -> Vec<f32> {
        let mut scaled = descriptor.to_vec();
        self.apply(&mut scaled);
        scaled
    }

    /// Scales a descriptor in place.
    pub fn apply(&self, descriptor: &mut [f32]) {
        for ((value, mean), scale) in descriptor.iter_mut().zip(&self.mean).zip(&self.scale) {
            *value = (*value - mean) * scale;
        }
    }
}

/// A trained C-SVC with the kernel K(x, y) = exp(−γ‖x − y‖²) (Takouachet et al. 2017, §4.3).
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub struct Svm {
    /// γ.
    pub gamma: f32,
    /// ρ: subtracted from the weighted sum.
    pub rho: f32,
    /// αᵢ·yᵢ of each support vector.
    pub coefficients: Vec<f32>,
    /// Support vectors, row-major: `coefficients.len()` rows of [`Svm::dimensions`] scaled numbers.
    pub vectors: Vec<f32>,
}

impl Svm {
    /// Numbers in a descriptor; 0 for a machine without support vectors.
    pub fn dimensions(&self) -> usize {
        self.vectors.len().checked_div(self.coefficients.len()).unwrap_or(0)
    }

    /// Decision value f(x) = Σ αᵢyᵢ K(xᵢ, x) − ρ of a scaled descriptor: positive for "converged".
    ///
    /// # Panics
    /// If `x` has not [`Svm::dimensions`] numbers.
    pub fn decision(&self, x: &[f32]) -> f32 {
        assert_eq!(x.len(), self.dimensions(), "numbers in the descriptor");
        let term = |(vector, &coefficient): (&[f32], &f32)| {
            f64::from(coefficient) * f64::from((-self.gamma * squared_distance(vector, x)).exp())
        };
        let sum: f64 = self.vectors.chunks_exact(x.len()).zip(&self.coefficients).map(term).sum();
        (sum - f64::from(self.rho)) as f32
    }
}

/// ‖a − b‖², in eight running sums so that the compiler can use vector instructions; their order is fixed.
fn squared_distance(a: &[f32], b: &[f32]) -> f32 {
    let (mut a, mut b) = (a.chunks_exact(8), b.chunks_exact(8));
    let mut sums = [0.0f32; 8];
    for (a, b) in a.by_ref().zip(b.by_ref()) {
        for lane in 0..8 {
            let d = a[lane] - b[lane];
            sums[lane] += d * d;
        }
    }
    let rest: f32 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| (a - b) * (a - b)).sum();
    sums.iter().sum::<f32>() + rest
}

// A straight line through scaled numbers.

/// What logistic regression learns: the decision value w·x + b.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
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

// From decision values to probabilities.

/// Platt's sigmoid P = 1/(1 + exp(a·f + b)) of a decision value f (Platt 1999).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
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

// From raw descriptors to probabilities.

/// What decides on scaled descriptors.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
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
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
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
        from_log_odds(self.log_odds_in_place(&mut raw.to_vec()))
    }

    /// The log-odds of that, for a descriptor that is scaled in place.
    pub(crate) fn log_odds_in_place(&self, raw: &mut [f32]) -> f64 {
        self.scaler.apply(raw);
        self.platt.log_odds(self.machine.decision(raw))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn one_support_vector_is_one_gaussian() {
        let svm = Svm { gamma: 0.5, rho: 0.25, coefficients: vec![2.0], vectors: vec![1.0, 0.0, 0.0] };
        let f = svm.decision(&[0.0, 2.0, 0.0]);
        assert!((f - (2.0 * (-0.5f32 * 5.0).exp() - 0.25)).abs() < 1e-6);
    }

    #[test]
    fn scaler_standardises() {
        let rows = [[1.0f32, 5.0], [3.0, 5.0]];
        let scaler = Scaler::fit(rows.iter().map(|r| &r[..]), 0.0);
        let mut row = rows[1];
        scaler.apply(&mut row);
        assert_eq!(row, [1.0, 0.0]);
        // Deviations of 1 and 0 where at least 4 is taken for granted.
        let careful = Scaler::fit(rows.iter().map(|r| &r[..]), 4.0);
        let mut row = [6.0, 9.0];
        careful.apply(&mut row);
        assert_eq!(row, [1.0, 1.0]);
    }

    proptest! {
        #[test]
        fn distance_is_the_sum_of_squares(v in prop::collection::vec((-3.0f32..3.0, -3.0f32..3.0), 0..70)) {
            let (a, b): (Vec<f32>, Vec<f32>) = v.iter().copied().unzip();
            let exact: f64 = v.iter().map(|&(a, b)| f64::from(a - b).powi(2)).sum();
            prop_assert!((f64::from(squared_distance(&a, &b)) - exact).abs() <= 1e-5 * exact.max(1.0));
        }
    }

    #[test]
    fn is_a_rising_sigmoid() {
        let platt = Platt { a: -2.0, b: 1.0 };
        assert!((platt.probability(0.5) - 0.5).abs() < 1e-6);
        assert!(platt.probability(1e9) == 1.0 && platt.probability(-1e9) == 0.0);
    }
}
