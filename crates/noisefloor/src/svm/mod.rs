//! Support vector machine: prediction here; training behind the feature `train`.

#[cfg(feature = "train")]
mod gram;
mod platt;
mod predict;
#[cfg(feature = "train")]
mod solver;
#[cfg(feature = "train")]
mod train;

pub use platt::Platt;
pub use predict::{Scaler, Svm};
#[cfg(feature = "train")]
pub use {
    gram::squared_distances,
    solver::{Weights, fit_weights},
    train::{SvmParams, SvmTrainError, fit_platt, fit_svm},
};
