//! The support vector machine: prediction; training behind the feature `train`.

mod classifier;
#[cfg(feature = "train")]
mod gram;
#[cfg(feature = "train")]
mod params;
mod platt;
mod predict;
#[cfg(feature = "train")]
mod solver;
#[cfg(feature = "train")]
mod train;

pub use classifier::Classifier;
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
