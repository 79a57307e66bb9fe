//! What decides, a line or a support vector machine. The crate `noisefloor-learn` trains both.

mod classifier;
mod line;
pub(crate) mod platt;
mod predict;

pub use classifier::{Classifier, Machine};
pub use line::Line;
pub use platt::Platt;
pub use predict::{Scaler, Svm};
