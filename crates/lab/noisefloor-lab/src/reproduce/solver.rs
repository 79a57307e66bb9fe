//! Training from distances that are there already: sequential minimal optimisation on a kernel matrix.
//!
//! linfa-svm computes its kernel matrix from rows, one scalar after another in one thread, and takes no
//! other: neither its kernel trait nor its fitting functions are public. For the paper's descriptor, 9,600
//! rows of 32,768 numbers, that would take hours a machine.

use ndarray::{Array2, ArrayView2};
use noisefloor::svm::Svm;
use noisefloor_learn::{SvmParams, SvmTrainError, check_examples};
use rayon::prelude::*;

/// Duality gap at which the solver ends; LIBSVM's default, and linfa's here.
const SOLVER_EPS: f64 = 1e-3;
/// linfa drops support vectors lighter than this from its decision function; the same are left out here.
const LIGHTEST: f64 = 100.0 * f64::EPSILON;

/// Steps after which the solver gives up; linfa's limit.
const MAX_STEPS: usize = 10_000_000;
/// Curvature that a pair of coinciding examples is given, so that the step stays finite.
const LEAST_CURVATURE: f64 = 1e-10;

/// What a machine has learned of its examples.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Weights {
    /// αᵢ·yᵢ of each example, in their order; 0 for those that are no support vectors.
    pub(super) alpha: Vec<f64>,
    /// ρ: subtracted from the weighted sum.
    pub(super) rho: f64,
}

/// Trains on examples whose squared distances are given, n×n and symmetric; `converged[i]` is the class of
/// example i.
pub(super) fn fit_weights(
    squared: ArrayView2<'_, f64>,
    converged: &[bool],
    params: SvmParams,
) -> Result<Weights, SvmTrainError> {
    check_examples(squared, converged, params)?;
    if squared.nrows() != squared.ncols() {
        let what = format!("{}×{} distances are not a square", squared.nrows(), squared.ncols());
        return Err(SvmTrainError::Examples(what));
    }
    let mut kernel = Array2::zeros(squared.dim());
    let rows: Vec<_> = kernel.rows_mut().into_iter().zip(squared.rows()).collect();
    rows.into_par_iter().for_each(|(mut to, from)| {
        to.iter_mut().zip(from).for_each(|(to, &from): (&mut f64, _)| *to = (-params.gamma * from).exp());
    });
    Ok(solve(kernel.view(), converged, params.c))
}

impl Weights {
    /// Places of the support vectors among the examples, and their weights.
    pub(super) fn support(&self) -> impl Iterator<Item = (usize, f64)> {
        self.alpha.iter().copied().enumerate().filter(|(_, alpha)| *alpha != 0.0)
    }

    /// The machine; `row` is an example's.
    pub(super) fn machine<R: IntoIterator<Item = f32>>(
        &self,
        params: SvmParams,
        row: impl Fn(usize) -> R,
    ) -> Svm {
        Svm {
            gamma: params.gamma as f32,
            rho: self.rho as f32,
            coefficients: self.support().map(|(_, alpha)| alpha as f32).collect(),
            vectors: self.support().flat_map(|(i, _)| row(i)).collect(),
        }
    }
}

/// Minimises ½ αᵀQα − Σα, 0 ≤ α ≤ C, Σ yα = 0, Q = yᵢyⱼK, two variables at a time, chosen by second-order
/// information (Fan, Chen and Lin 2005, "Working set selection using second order information", WSS 2).
fn solve(kernel: ArrayView2<'_, f64>, converged: &[bool], c: f64) -> Weights {
    let n = converged.len();
    let sign = |t: usize| if converged[t] { 1.0 } else { -1.0 };
    let mut alpha = vec![0.0; n];
    // −yₜ∇ₜ: yₜ less the weighted sum at example t.
    let mut error: Vec<f64> = (0..n).map(sign).collect();
    // Whether yα may grow, and whether it may shrink.
    let may_grow = |t: usize, alpha: &[f64]| if converged[t] { alpha[t] < c } else { alpha[t] > 0.0 };
    let may_shrink = |t: usize, alpha: &[f64]| if converged[t] { alpha[t] > 0.0 } else { alpha[t] < c };

    let (mut most, mut least) = (0.0, 0.0);
    for _ in 0..MAX_STEPS {
        // The example that violates its condition most, and how far the two sides are apart
        let mut first = None;
        (most, least) = (f64::NEG_INFINITY, f64::INFINITY);
        for (t, &error) in error.iter().enumerate() {
            if error >= most && may_grow(t, &alpha) {
                (most, first) = (error, Some(t));
            }
            if error < least && may_shrink(t, &alpha) {
                least = error;
            }
        }
        let Some(i) = first.filter(|_| most - least >= SOLVER_EPS) else { break };

        // The partner with which the objective falls most
        let (row_i, mut second) = (kernel.row(i), None);
        let mut lowest = f64::INFINITY;
        for (t, error) in error.iter().enumerate() {
            let violation = most - error;
            if violation > 0.0 && may_shrink(t, &alpha) {
                let curvature = (row_i[i] + kernel[(t, t)] - 2.0 * row_i[t]).max(LEAST_CURVATURE);
                let change = -violation * violation / curvature;
                if change <= lowest {
                    (lowest, second) = (change, Some((t, violation / curvature)));
                }
            }
        }
        let Some((j, step)) = second else { break };

        // Both move by the same, until one meets a bound
        let room_i = if converged[i] { c - alpha[i] } else { alpha[i] };
        let room_j = if converged[j] { alpha[j] } else { c - alpha[j] };
        let step = step.min(room_i).min(room_j);
        let bound = |up: bool| if up { c } else { 0.0 };
        alpha[i] = if step == room_i { bound(converged[i]) } else { alpha[i] + sign(i) * step };
        alpha[j] = if step == room_j { bound(!converged[j]) } else { alpha[j] - sign(j) * step };
        for ((error, a), b) in error.iter_mut().zip(row_i).zip(kernel.row(j)) {
            *error -= step * (a - b);
        }
    }

    // ρ from the examples on the margin; without any, from the middle between the two sides
    let free: Vec<f64> = (0..n).filter(|&t| alpha[t] > 0.0 && alpha[t] < c).map(|t| error[t]).collect();
    let rho =
        if free.is_empty() { -0.5 * (most + least) } else { -free.iter().sum::<f64>() / free.len() as f64 };
    let weight = |t: usize| if alpha[t] > LIGHTEST { sign(t) * alpha[t] } else { 0.0 };
    Weights { alpha: (0..n).map(weight).collect(), rho }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reproduce::gram::squared_distances;
    use ndarray::array;
    use noisefloor_learn::fit_svm;
    use noisefloor_testkit::Noise;

    fn params(c: f64) -> SvmParams {
        SvmParams { c, gamma: 0.5 }
    }

    /// Two examples: α = 1/(1 − K) for both, if C allows it.
    #[test]
    fn two_examples_have_a_known_solution() {
        let squared = array![[0.0, 3.0], [3.0, 0.0]];
        let k = (-1.5f64).exp();
        let free = fit_weights(squared.view(), &[true, false], params(5.0)).unwrap();
        assert!((free.alpha[0] - 1.0 / (1.0 - k)).abs() < 1e-12 && free.rho.abs() < 1e-12);
        assert_eq!(free.alpha[0], -free.alpha[1]);
        let bound = fit_weights(squared.view(), &[true, false], params(0.5)).unwrap();
        assert_eq!(bound.alpha, [0.5, -0.5]);
        assert!(bound.rho.abs() < 1e-12);
    }

    /// Far from everything, an example weighs on itself alone, and the smaller class is bound by what
    /// balances it.
    #[test]
    fn far_examples_have_a_known_solution() {
        let squared = Array2::from_shape_fn((4, 4), |(i, j)| if i == j { 0.0 } else { 1e6 });
        let weights = fit_weights(squared.view(), &[true, true, true, false], params(2.0)).unwrap();
        // α = 1 + ρ for the three and 1 − ρ for the one; 3(1 + ρ) = 1 − ρ
        let known = [0.5, 0.5, 0.5, -1.5];
        assert!(weights.alpha.iter().zip(known).all(|(a, k)| (a - k).abs() < 1e-3), "{weights:?}");
        assert!((weights.rho + 0.5).abs() < 1e-3, "{weights:?}");
    }

    #[test]
    fn examples_that_coincide_in_both_classes_are_bound() {
        let weights = fit_weights(Array2::zeros((2, 2)).view(), &[true, false], params(2.0)).unwrap();
        assert_eq!(weights.alpha, [2.0, -2.0]);
    }

    #[test]
    fn bad_distances_are_an_error() {
        let oblong = Array2::zeros((2, 3));
        assert!(matches!(
            fit_weights(oblong.view(), &[true, false], params(1.0)),
            Err(SvmTrainError::Examples(_))
        ));
    }

    /// Two seeded, overlapping clouds.
    fn clouds(examples: usize, dimensions: usize) -> (Array2<f64>, Vec<bool>) {
        let mut noise = Noise::new(42);
        let labels: Vec<bool> = (0..examples).map(|i| i % 2 == 0).collect();
        let rows = Array2::from_shape_fn((examples, dimensions), |(i, _)| {
            3.0 * noise.uniform() - 1.5 + if labels[i] { 0.5 } else { -0.5 }
        });
        (rows, labels)
    }

    /// The solver on a kernel matrix takes the steps that linfa's takes: the same support vectors and weights,
    /// but for rounding, 2⁻²⁴ of them in f32.
    #[test]
    fn weights_equal_linfa_s() {
        for (dimensions, c, gamma) in [
            (20, 1.0, 0.02),
            (20, 100.0, 0.05),
            (20, 2.0, 2.0),
            (20, 1e3, 1e-4),
            (300, 2.0, 0.002),
            (300, 2.0, 2.0),
        ] {
            let (rows, labels) = clouds(300, dimensions);
            let params = SvmParams { c, gamma };
            let squared = squared_distances(rows.view(), |_, _| ());
            let weights = fit_weights(squared.view(), &labels, params).unwrap();
            let ours = weights.machine(params, |i| rows.row(i).mapv(|v| v as f32));
            let theirs = fit_svm(rows.view(), &labels, params).unwrap();
            assert_eq!(ours.vectors, theirs.vectors, "{params:?}");
            let pairs = ours.coefficients.iter().zip(&theirs.coefficients);
            let worst = pairs.map(|(a, b)| f64::from((a - b).abs())).fold(0.0, f64::max);
            let rho = f64::from((ours.rho - theirs.rho).abs());
            assert!(worst < 1e-6 * c && rho < 1e-6 * c.max(1.0), "{params:?}: {worst}, {rho}");
        }
    }
}
