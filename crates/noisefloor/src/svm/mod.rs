//! Support vector machine: prediction here; training behind the feature `train`.

#[cfg(feature = "train")]
mod gram;
mod platt;
mod predict;
#[cfg(feature = "train")]
mod train;

pub use platt::Platt;
pub use predict::{Scaler, Svm};
#[cfg(feature = "train")]
pub use {
    gram::{coordinates, squared_distances},
    train::{SvmParams, SvmTrainError, Weights, fit_platt, fit_svm, fit_weights},
};
