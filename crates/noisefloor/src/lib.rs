//! Tells progressive Monte Carlo renderers, tile by tile, when people stop seeing noise.
//!
//! An oracle trained on human thresholds estimates, for each tile of a progressive rendering, the probability
//! that an observer sees no difference from the converged picture, after Takouachet et al. 2017, "Perception
//! of noise and Global Illumination: toward an automatic stopping criterion based on SVM".
//!
//! - A renderer that owns its loop pushes samples into a [`Session`].
//! - A renderer behind [`ProgressiveSource`] is driven by a [`Driver`].
//! - A [`Checkpoint`] is a snapshot of either, for resuming it in another process.
//! - [`Oracle`] is the [`StoppingCriterion`] that judges by a trained [`Model`]; [`FixedSpp`] is the simplest
//!   one.
//! - [`Film`], [`Display`], [`TilePlanes`], [`NoiseMask`], [`Descriptor`] and [`Svm`] lead from samples to a
//!   verdict.
//! - [`Familiarity`] describes the textures a model has been tried on; elsewhere it asks for twice the
//!   samples.
//!
//! ```
//! use noisefloor::{Counts, Oracle, Params, Session, StopReason};
//!
//! let mut session = Session::new(64, 64, Oracle::bundled(), Params { tile: 32, ..Params::default() })?;
//! while !session.is_done() {
//!     for request in session.requests() {
//!         // A renderer of a grey wall, whose pixels differ by nothing: nobody sees noise.
//!         let mean = vec![[0.5; 3]; request.tile.pixels()];
//!         session.push(request.tile.index, request.spp, &mean)?;
//!     }
//!     session.judge()?;
//! }
//! assert!(session.stops().all(|stop| stop.reason == StopReason::Converged && stop.spp == 100));
//! # Ok::<(), noisefloor::SessionError>(())
//! ```

mod blocks;
mod checkpoint;
mod container;
mod criterion;
mod descriptor;
mod display;
mod driver;
mod evidence;
mod familiarity;
mod film;
mod identity;
mod light;
mod mask;
mod model;
mod nested;
mod oracle;
mod origin;
mod params;
mod rgb;
mod session;
mod source;
mod srgb;
mod stills;
mod stop;
mod svm;
mod text;
mod threshold;
mod tile;
mod tone_curve;

pub use blocks::{BlockRequest, BlockSamples};
pub use checkpoint::{Checkpoint, CheckpointError};
pub use criterion::{
    CriterionError, ExpectedThreshold, FixedSpp, Needs, Resumable, StoppingCriterion, Verdict, View,
};
pub use descriptor::{
    Described, Descriptor, DescriptorError, DescriptorKind, DescriptorSpec, TileDescriptor,
};
pub use display::{DEFAULT_KEY, DELTA, Display, ToneMapping, ToneMappingError, luminance};
pub use driver::{Clock, Driver, DriverError, Event, Progress, TimelinePoint};
pub use evidence::{Evidence, HALO, ROUNDING_LUMINANCE, Rendering, Samples, TilePlanes, residual_scale};
pub use familiarity::{Familiarity, nearest};
pub use film::{Film, FilmError};
pub use identity::{IdentityChange, SourceIdentity};
pub use light::{ImpossibleLight, LightCheck};
pub use mask::{NoiseMask, SigmaError};
pub use model::{Judgement, Model, ModelError, ModelParts, Scores, TrainingRecord};
/// Planes, maps and training rows are its arrays.
pub use ndarray;
/// Viewing conditions are its types.
pub use noisefloor_vision::{
    Chromaticities, ChromaticityError, Eotf, Primaries, Viewing, ViewingError, ViewingParams,
    ViewingTextError,
};
pub use oracle::Oracle;
pub use origin::{OriginRelation, SampleOrigin};
pub use params::{Audience, Params, ParamsError, Schedule};
pub use rgb::Rgb;
pub use session::{Session, SessionError};
pub use source::{
    Batch, Counts, FirstHits, ProgressiveSource, Reference, Repeats, Request, SourceError, SourceInfo, Unit,
};
pub use srgb::{srgb_decode, srgb_encode};
pub use stills::{SnapshotPair, Still, StillError};
pub use stop::{Stop, StopReason};
pub use svm::{Classifier, Platt, Scaler, Svm};
#[cfg(feature = "train")]
pub use svm::{
    SvmParams, SvmTrainError, Weights, check_examples, fit_platt, fit_svm, fit_weights, squared_distances,
};
pub use text::printable;
pub use threshold::{Threshold, ThresholdError};
#[cfg(feature = "train")]
/// Their errors are causes of [`SvmTrainError`].
pub use {linfa, linfa_svm};

pub use tile::{
    DEFAULT_TILE, MAX_EDGE, MAX_PIXELS, MAX_TILE, MIN_TILE, Tile, TileError, TileGrid, check_image,
};
pub use tone_curve::ToneCurve;
