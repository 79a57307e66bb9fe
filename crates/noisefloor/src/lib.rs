//! Tells progressive Monte Carlo renderers, tile by tile, when people stop seeing noise.

mod criterion;
mod descriptor;
mod display;
mod driver;
pub mod evaluation;
mod evidence;
mod film;
mod mask;
mod model;
mod oracle;
mod params;
mod session;
mod source;
mod svm;
mod tile;
#[cfg(feature = "train")]
pub mod training;

pub use criterion::{CriterionError, FixedSamples, Needs, StoppingCriterion, Verdict, View};
pub use descriptor::{Descriptor, DescriptorError};
pub use display::{
    DEFAULT_KEY, DELTA, Display, ToneMapping, ToneMappingError, luminance, srgb_decode, srgb_encode,
};
pub use driver::{Clock, Driver, DriverError, Event, Progress, TimelinePoint};
pub use evidence::{APRON, Evidence, Samples, TilePlanes, residual_scale};
pub use film::{Film, FilmError};
pub use mask::{NoiseMask, SigmaError};
pub use model::{Model, ModelError, Scores, TrainingRecord};
pub use oracle::{DEFAULT_THRESHOLD, Oracle, ThresholdError};
pub use params::{Audience, Params, ParamsError, Schedule};
pub use session::{Session, SessionError, Stop, StopReason};
pub use source::{Batch, ProgressiveSource, Reference, Request, Rgb, SourceError, SourceInfo, Unit};
pub use svm::{Platt, Scaler, Svm};
#[cfg(feature = "train")]
pub use svm::{SvmParams, SvmTrainError, fit_platt, fit_svm};
pub use tile::{
    DEFAULT_TILE, MAX_EDGE, MAX_PIXELS, MAX_TILE, MIN_TILE, Tile, TileError, TileGrid, check_image,
};
