//! One's own eyes and display, in two minutes: how many times the samples of a model's observers somebody needs.
//!
//! Four pictures are shown, of which one has noise; which one? [`Calibration`] chooses how strong the noise is
//! (QUEST+), and ends when the factor is known well enough. [`CalibrateServer`] shows it in the browser,
//! [`SimulatedEyes`] answer without one.

mod course;
mod server;
mod simulate;
mod tiles;

pub use course::{Calibration, CalibrationRefusal, CalibrationStage, CalibrationTrial, Factor};
pub use server::{CalibrateServer, CalibrateSetup};
pub use simulate::SimulatedEyes;
pub use tiles::{CalibrationTile, EDGE};
