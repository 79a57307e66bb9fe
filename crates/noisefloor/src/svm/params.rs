//! What a machine is trained with, and why it cannot be.

use ndarray::ArrayView2;
use thiserror::Error;

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
        "no curve of probability fits the decision values: whether noise was seen does not follow what was \
         measured of \
         it; check that every threshold stands beside its own zone, and that they are not all alike"
    )]
    Platt(#[from] linfa::composing::platt_scaling::PlattError),
}

/// Duality gap at which the solver ends; LIBSVM's default.
pub(super) const SOLVER_EPS: f64 = 1e-3;
/// linfa drops support vectors lighter than this from its decision function; the same are left out here.
pub(super) const LIGHTEST: f64 = 100.0 * f64::EPSILON;

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
