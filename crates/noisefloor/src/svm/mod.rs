//! What decides, a line or a support vector machine: prediction; training of the latter behind the feature `train`.

mod classifier;
#[cfg(feature = "train")]
mod gram;
mod line;
#[cfg(feature = "train")]
mod params;
pub(crate) mod platt;
mod predict;
#[cfg(feature = "train")]
mod solver;
#[cfg(feature = "train")]
mod train;

pub use classifier::{Classifier, Machine};
pub use line::Line;
pub use platt::Platt;
pub use predict::{Scaler, Svm};
#[cfg(feature = "train")]
pub use {
    gram::squared_distances,
    params::{SvmParams, SvmTrainError, check_examples},
    solver::{Weights, fit_weights},
    train::{fit_platt, fit_svm},
};

/// Their errors are causes of [`SvmTrainError`].
#[cfg(feature = "train")]
pub use {linfa, linfa_svm};
