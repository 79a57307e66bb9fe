//! Tells progressive Monte Carlo renderers, tile by tile, when people stop seeing noise.
//!
//! An oracle trained on human thresholds estimates, for each tile of a progressive rendering, the probability
//! that an observer sees no difference from the converged picture, after Takouachet et al. 2017, "Perception
//! of noise and Global Illumination: toward an automatic stopping criterion based on SVM".
//!
//! - A renderer that owns its loop pushes samples into a [`Session`].
//! - A renderer behind [`ProgressiveSource`] is driven by a [`Driver`].
//! - A GPU hands over its passes to a [`Background`](background::Background), and goes on.
//! - A [`checkpoint`] is a snapshot of either, for resuming it in another process.
//! - [`Oracle`] is the [`StoppingCriterion`] that judges by a trained [`Model`]; [`FixedSpp`] is the simplest
//!   one.
//!
//! What these need is at the top; the rest is in modules by subject. [`stills`] judges pictures rendered elsewhere, and
//! [`tune`] finds the setting of a renderer at which nobody sees noise.
//!
//! # Features
//! - `bundled-model` (on by default): the trained model inside the library.
//! - `files` (on by default): model files, checkpoints, and serde's traits on what they hold. Without it,
//!   the library needs neither serde nor bincode nor BLAKE3.
//!
//! One more, `train`, serves the crates that train models. What is hidden from these pages serves the crates of this
//! repository, too; any release may change it.
//!
//! # Threads
//! [`Session::judge`] and [`Session::push_image`] use all threads of the rayon pool that they are called in: the global one,
//! or your own by `pool.install(|| session.judge())`. Results do not depend on their number. A verdict on a tile of 128×128
//! pixels takes 0.4 ms of one processor; a
//! [`Background`](background::Background) session judges in a thread of its own.
//!
//! ```
//! use noisefloor::{Counts, Oracle, Params, Session, StopReason};
//!
//! let mut session = Session::new(64, 64, Oracle::bundled(), Params::default().with_tile(32))?;
//! while !session.is_done() {
//!     for request in session.requests() {
//!         // A renderer of a grey wall, whose pixels differ by nothing: nobody sees noise.
//!         let mean = vec![[0.5; 3]; request.tile.pixels()];
//!         session.push(request.tile.index, request.spp, &mean)?;
//!     }
//!     session.judge()?;
//! }
//! // Few pixels of few samples may not have met all light yet: verdicts are sure of it from 100 samples on
//! assert!(session.stops().all(|stop| stop.reason == StopReason::Converged && (100..=112).contains(&stop.spp)));
//! # Ok::<(), noisefloor::SessionError>(())
//! ```

pub mod background;
#[cfg(feature = "files")]
pub mod checkpoint;
#[cfg(feature = "files")]
mod container;
pub mod criterion;
#[doc(hidden)]
pub mod descriptor;
pub mod display;
pub mod driver;
#[doc(hidden)]
pub mod evidence;
pub mod film;
#[doc(hidden)]
pub mod internal;
pub mod model;
mod nested;
pub mod oracle;
pub mod params;
mod people;
mod plane;
mod rgb;
pub mod session;
pub mod source;
pub mod stills;
#[doc(hidden)]
pub mod svm;
#[doc(hidden)]
pub mod text;
pub mod tile;
pub mod tune;
#[doc(hidden)]
pub mod unmet;
pub mod watch;

#[cfg(test)]
mod tests;

/// Displays, and how far people sit from them.
pub mod viewing {
    pub use noisefloor_vision::{
        Chromaticities, ChromaticityError, Eotf, Primaries, Viewing, ViewingError, ViewingParams,
        ViewingTextError,
    };
}

// For `Session`
#[cfg(feature = "files")]
#[doc(inline)]
pub use checkpoint::Checkpoint;
#[doc(inline)]
pub use criterion::{FixedSpp, StoppingCriterion, Verdict};
#[doc(inline)]
pub use display::ToneMapping;
#[doc(inline)]
pub use film::Film;
#[doc(inline)]
pub use model::Model;
#[doc(inline)]
pub use oracle::{Oracle, People};
#[doc(inline)]
pub use params::{Audience, Params, Schedule};
#[doc(inline)]
pub use rgb::Rgb;
#[doc(inline)]
pub use session::{Session, SessionError, Stop, StopReason};
#[doc(inline)]
pub use tile::{Tile, TileGrid};
#[doc(inline)]
pub use viewing::Viewing;

// For `Driver`
#[doc(inline)]
pub use driver::{Driver, DriverError, Event};

// For `ProgressiveSource`
#[doc(inline)]
pub use source::{Batch, Counts, ProgressiveSource, Repeats, Request, SourceError, SourceInfo, Unit};
