//! Support vector machine: prediction here; training behind the feature `train`.

mod platt;
mod predict;
#[cfg(feature = "train")]
mod train;

pub use platt::Platt;
pub use predict::{Scaler, Svm};
#[cfg(feature = "train")]
pub use train::{SvmParams, SvmTrainError, fit_platt, fit_svm};
