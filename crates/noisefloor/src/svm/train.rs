//! Training of support vector machines and of the curve of probability, through linfa.

use super::{Platt, Svm};
use linfa::composing::platt_scaling::{Platt as LinfaPlatt, platt_newton_method};
use linfa::prelude::*;
use ndarray::{Array1, ArrayView2};
use thiserror::Error;

/// Duality gap at which the solver ends; LIBSVM's default.
const SOLVER_EPS: f64 = 1e-3;
/// linfa drops support vectors lighter than this from its decision function; the same are left out here.
const LIGHTEST: f64 = 100.0 * f64::EPSILON;

/// Parameters of a C-SVC with RBF kernel.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SvmParams {
    /// Penalty C of a misclassified example of either class, above 0.
    pub c: f64,
    /// γ of the kernel exp(−γ‖x − y‖²), above 0.
    pub gamma: f64,
}

impl SvmParams {
    /// C = 2, γ = 2 (Takouachet et al. 2017, §4.3), for their descriptor.
    pub const PAPER: Self = Self { c: 2.0, gamma: 2.0 };
}

/// Why a machine could not be trained.
#[derive(Debug, Error)]
pub enum SvmTrainError {
    /// A parameter out of range.
    #[error("C and γ must be positive finite numbers, not C = {c}, γ = {gamma}")]
    Params {
        /// C.
        c: f64,
        /// γ.
        gamma: f64,
    },
    /// One of the two classes is missing.
    #[error("training needs examples of both classes; of {examples} examples {converged} are converged")]
    OneClass {
        /// All examples.
        examples: usize,
        /// Those that are converged.
        converged: usize,
    },
    /// Rows and labels differ in number, or a number is not finite.
    #[error("training needs one label an example and finite numbers: {0}")]
    Examples(String),
    /// linfa-svm failed.
    #[error("linfa-svm could not train the machine")]
    Linfa(#[from] linfa_svm::SvmError),
    /// Platt scaling failed.
    #[error(
        "no curve of probability fits the decision values: whether noise was seen does not follow what was measured of it; \
         check that every threshold stands beside its own zone, and that they are not all alike"
    )]
    Platt(#[from] linfa::composing::platt_scaling::PlattError),
}

/// Checks what any machine is trained on: parameters, that every row has a label, that all numbers are finite
/// and both classes there.
///
/// # Errors
/// [`SvmTrainError`] says what is wrong.
pub fn check_examples(
    rows: ArrayView2<'_, f64>,
    converged: &[bool],
    SvmParams { c, gamma }: SvmParams,
) -> Result<(), SvmTrainError> {
    if !(c.is_finite() && c > 0.0 && gamma.is_finite() && gamma > 0.0) {
        return Err(SvmTrainError::Params { c, gamma });
    }
    if rows.nrows() != converged.len() || !rows.iter().all(|v| v.is_finite()) {
        let what = format!("{} rows, {} labels", rows.nrows(), converged.len());
        return Err(SvmTrainError::Examples(what));
    }
    if rows.nrows() == 0 {
        let what = "there are no examples; do all thresholds lie outside the levels that there are?";
        return Err(SvmTrainError::Examples(what.into()));
    }
    if rows.ncols() == 0 {
        return Err(SvmTrainError::Examples("rows without numbers".into()));
    }
    let positive = converged.iter().filter(|&&c| c).count();
    if positive == 0 || positive == converged.len() {
        return Err(SvmTrainError::OneClass { examples: converged.len(), converged: positive });
    }
    Ok(())
}

/// Trains on scaled descriptors, one a row; `converged[i]` is the class of row i.
///
/// # Errors
/// [`SvmTrainError`] if parameters or examples are out of range, or the solver fails.
pub fn fit_svm(
    rows: ArrayView2<'_, f64>,
    converged: &[bool],
    params: SvmParams,
) -> Result<Svm, SvmTrainError> {
    check_examples(rows, converged, params)?;
    let linfa_svm::Svm { alpha, rho, .. } = fit_linfa(rows, converged, params)?;

    // Keep the rows that carry weight.
    let kept = || (0..rows.nrows()).filter(|&i| alpha[i].abs() > LIGHTEST);
    Ok(Svm {
        gamma: params.gamma as f32,
        rho: rho as f32,
        coefficients: kept().map(|i| alpha[i] as f32).collect(),
        vectors: kept().flat_map(|i| rows.row(i).to_vec()).map(|v| v as f32).collect(),
    })
}

fn fit_linfa(
    rows: ArrayView2<'_, f64>,
    converged: &[bool],
    SvmParams { c, gamma }: SvmParams,
) -> Result<linfa_svm::Svm<f64, bool>, SvmTrainError> {
    let data = DatasetBase::new(rows.to_owned(), Array1::from_vec(converged.to_vec()));
    // linfa's Gaussian is exp(−‖x − y‖²/ε): ε = 1/γ.
    let machine = linfa_svm::Svm::<f64, bool>::params()
        .pos_neg_weights(c, c)
        .gaussian_kernel(1.0 / gamma)
        .eps(SOLVER_EPS);
    let trained: linfa_svm::Svm<f64, bool> = machine.fit(&data)?;
    Ok(trained)
}

/// Observers that each probability is put to in [`fit_platt`]: linfa's Platt scaling takes classes, not
/// probabilities.
const OBSERVERS: usize = 40;

/// Fits the sigmoid to (decision value, probability that an observer sees no difference) of examples that the
/// machine has not been trained on: each is put to 40 observers, of whom that share agrees (Platt 1999;
/// Newton's method of Lin, Lin and Weng 2007 in linfa).
///
/// # Errors
/// [`SvmTrainError::Platt`] if the fit does not converge.
pub fn fit_platt(examples: &[(f32, f64)]) -> Result<Platt, SvmTrainError> {
    let each = |&(decision, p): &(f32, f64)| {
        (0..OBSERVERS).map(move |i| (f64::from(decision), (i as f64 + 0.5) / (OBSERVERS as f64) < p))
    };
    let (decisions, agree): (Vec<f64>, Vec<bool>) = examples.iter().flat_map(each).unzip();
    let params = LinfaPlatt::<f64, ()>::params();
    let (a, b) = platt_newton_method(
        Array1::from_vec(decisions).view(),
        Array1::from_vec(agree).view(),
        params.check_ref()?,
    )?;
    Ok(Platt { a: a as f32, b: b as f32 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, Axis};
    use noisefloor_testkit::Noise;

    /// Two seeded, overlapping clouds.
    fn clouds(examples: usize, dimensions: usize) -> (Array2<f64>, Vec<bool>) {
        let mut noise = Noise::new(42);
        let labels: Vec<bool> = (0..examples).map(|i| i % 2 == 0).collect();
        let rows = Array2::from_shape_fn((examples, dimensions), |(i, _)| {
            3.0 * noise.uniform() - 1.5 + if labels[i] { 0.5 } else { -0.5 }
        });
        (rows, labels)
    }

    /// Within 10⁻⁴ of linfa's own decision values, also with C = 100, where coefficients are large and
    /// roundings add up.
    #[test]
    fn prediction_equals_linfa() {
        for (examples, dimensions, c, gamma) in
            [(300, 20, 1.0, 0.02), (300, 20, 100.0, 0.05), (300, 20, 2.0, 2.0), (120, 300, 2.0, 0.002)]
        {
            let params = SvmParams { c, gamma };
            let (rows, labels) = clouds(examples, dimensions);
            let ours = fit_svm(rows.view(), &labels, params).unwrap();
            let theirs = fit_linfa(rows.view(), &labels, params).unwrap();
            let (probe, _) = clouds(77, dimensions);
            for x in probe.axis_iter(Axis(0)).chain(rows.axis_iter(Axis(0))) {
                let decision = theirs.weighted_sum(&x) - theirs.rho;
                let x32: Vec<f32> = x.iter().map(|&v| v as f32).collect();
                let error = (f64::from(ours.decision(&x32)) - decision).abs();
                assert!(error < 1e-4, "{params:?}: {error}");
            }
        }
    }

    /// What training may be given: examples that repeat or contradict one another, two of them, numbers that
    /// say nothing, tiny or huge ones, and classes of very different sizes.
    fn extremes() -> Vec<(&'static str, Array2<f64>, Vec<bool>)> {
        let (rows, labels) = clouds(60, 3);
        let scaled = |factor: f64| rows.mapv(|v| v * factor);
        let repeated = Array2::from_shape_fn((60, 3), |(i, j)| rows[(i % 4, j)]);
        let mut dull = rows.clone();
        dull.column_mut(1).fill(7.0);
        let few: Vec<bool> = (0..1001).map(|i| i == 500).collect();
        vec![
            ("clouds", rows.clone(), labels.clone()),
            ("repeated", repeated.clone(), labels.clone()),
            ("contradictory", repeated, (0..60).map(|i| (i / 4) % 2 == 0).collect()),
            ("two", Array2::from_shape_fn((2, 3), |(i, _)| i as f64), vec![true, false]),
            ("all the same", Array2::zeros((60, 3)), labels.clone()),
            ("a constant number", dull, labels.clone()),
            ("tiny", scaled(1e-12), labels.clone()),
            ("huge", scaled(1e12), labels),
            ("one in a thousand", clouds(1001, 3).0, few),
        ]
    }

    /// Whatever it is given, training ends in a machine that decides by finite numbers, the same in f32 as
    /// linfa's in f64.
    #[test]
    fn extremes_end_in_a_machine() {
        for (name, rows, labels) in extremes() {
            for c in [1e-6, 1.0, 1e6] {
                for gamma in [1e-8, 1.0, 1e4] {
                    let params = SvmParams { c, gamma };
                    let ours = fit_svm(rows.view(), &labels, params).unwrap();
                    let theirs = fit_linfa(rows.view(), &labels, params).unwrap();
                    assert_eq!(ours.dimensions(), 3, "{name}, {params:?}: no support vectors");
                    // Each term errs by the roundings of its coefficient and kernel, 2⁻²³ each; distances of
                    // numbers beyond 10⁹ by more, but there the kernel is 0 off the diagonal. Exponents to 16
                    // lose 2⁻²⁰ of the kernel.
                    let weight: f64 = ours.coefficients.iter().map(|a| f64::from(a.abs())).sum();
                    let bound = 2e-6 * (weight + f64::from(ours.rho.abs())) + 1e-9;
                    for x in rows.axis_iter(Axis(0)) {
                        let x32: Vec<f32> = x.iter().map(|&v| v as f32).collect();
                        let decision = f64::from(ours.decision(&x32));
                        let exact = theirs.weighted_sum(&x) - theirs.rho;
                        assert!(
                            (decision - exact).abs() <= bound,
                            "{name}, {params:?}: {decision} {exact} ± {bound}"
                        );
                    }
                    for far in [0.0, 1e-30, 1e6, -1e30, f32::MAX] {
                        assert!(ours.decision(&[far; 3]).is_finite(), "{name}, {params:?}, {far}");
                    }
                }
            }
        }
    }

    /// A kernel that has underflowed to the identity knows nothing but its examples: these it tells apart,
    /// and far from them it says the same of everything.
    #[test]
    fn a_kernel_that_is_the_identity_knows_its_examples_alone() {
        let (rows, labels) = clouds(60, 3);
        let svm = fit_svm(rows.view(), &labels, SvmParams { c: 10.0, gamma: 1e7 }).unwrap();
        for (x, &label) in rows.axis_iter(Axis(0)).zip(&labels) {
            let x: Vec<f32> = x.iter().map(|&v| v as f32).collect();
            assert_eq!(svm.decision(&x) > 0.0, label);
        }
        assert_eq!(svm.decision(&[50.0; 3]), -svm.rho);
    }

    /// Classes that do not overlap have no finite slope of greatest likelihood; Platt's targets, short of 0
    /// and 1, bound it.
    #[test]
    fn platt_on_classes_that_do_not_overlap_is_finite_and_right() {
        for distance in [1e-3f32, 1.0, 1e3] {
            let examples: Vec<(f32, f64)> = (0..40)
                .map(|i| if i % 2 == 0 { (distance, 39.0 / 40.0) } else { (-distance, 1.0 / 40.0) })
                .collect();
            let platt = fit_platt(&examples).unwrap();
            assert!(platt.a.is_finite() && platt.b.is_finite(), "{distance}: {platt:?}");
            let (high, low) = (platt.probability(distance), platt.probability(-distance));
            assert!((high - 0.975).abs() < 0.01 && (low - 0.025).abs() < 0.01, "{distance}: {high} {low}");
        }
    }

    #[test]
    fn learns_to_tell_the_clouds_apart() {
        let (rows, labels) = clouds(300, 20);
        let svm = fit_svm(rows.view(), &labels, SvmParams { c: 1.0, gamma: 0.02 }).unwrap();
        let right = rows.axis_iter(Axis(0)).zip(&labels).filter(|(x, l)| {
            let x: Vec<f32> = x.iter().map(|&v| v as f32).collect();
            (svm.decision(&x) > 0.0) == **l
        });
        assert!(right.count() > 285);
    }

    #[test]
    fn platt_recovers_a_known_sigmoid() {
        let truth = Platt { a: -1.7, b: 0.4 };
        let examples: Vec<(f32, f64)> =
            (-300..300).map(|i| i as f32 / 100.0).map(|f| (f, f64::from(truth.probability(f)))).collect();
        let fitted = fit_platt(&examples).unwrap();
        // Rounding to fortieths of observers limits the fit.
        assert!((fitted.a - truth.a).abs() < 0.05 && (fitted.b - truth.b).abs() < 0.05, "{fitted:?}");
    }

    #[test]
    fn bad_input_is_an_error() {
        let (mut rows, labels) = clouds(10, 3);
        let fit = |rows: &Array2<f64>, labels: &[bool], c| {
            fit_svm(rows.view(), labels, SvmParams { c, gamma: 1.0 })
        };
        assert!(matches!(fit(&rows, &labels, 0.0), Err(SvmTrainError::Params { .. })));
        assert!(matches!(fit(&rows, &[true; 10], 1.0), Err(SvmTrainError::OneClass { .. })));
        assert!(matches!(fit(&rows, &labels[1..], 1.0), Err(SvmTrainError::Examples(_))));
        let empty = Array2::zeros((10, 0));
        assert!(matches!(fit(&empty, &labels, 1.0), Err(SvmTrainError::Examples(_))));
        rows[(3, 1)] = f64::NAN;
        assert!(matches!(fit(&rows, &labels, 1.0), Err(SvmTrainError::Examples(_))));
    }
}
