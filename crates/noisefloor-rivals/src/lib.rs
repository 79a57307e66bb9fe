//! Alternatives to noisefloor's oracle: other stopping criteria of progressive rendering, each a
//! [`StoppingCriterion`] for the same driver, and the metrics that judge final pictures.
//!
//! This crate serves the commands: any release may change its interface.
//!
//! | criterion | spec | done when |
//! |---|---|---|
//! | [`FixedSpp`](noisefloor::FixedSpp) | `spp:256` | a tile has 256 samples per pixel |
//! | [`RelativeError`] | `relative-error:0.17` | a pixel's confidence interval is small (Mitsuba 0.6) |
//! | [`Dammertz`] | `dammertz:0.0046` | the error of a block is small (Dammertz et al. 2010) |
//! | [`CyclesAdaptive`] | `cycles:0.01` | the relative error of a pixel is small (Blender) |
//! | [`LuxCoreHalt`] | `luxcore:0.31` | few displayed pixels have changed (LuxCoreRender) |
//! | [`Myszkowski1998`] | `vdp-stages:0.94` | nobody sees a difference between successive stages |
//! | [`Takouachet2007`] | `vdp-first:0.74` | the difference from the first, noisy picture stops growing |
//! | [`ConvergedCvvdp`] | `cvvdp:0.3` | it hardly differs from the *converged* picture: a yardstick |
//!
//! [`parse`] makes a criterion from such a spec; [`RIVALS`] lists those with one open constant, to be fitted
//! to data. [`Vdp`] is Daly's visible differences predictor; [`metrics`] has ColorVideoVDP, relMSE and PSNR,
//! and FLIP and butteraugli behind features of these names.
//!
//! # Pixels and tiles
//! Renderers that judge pixels sample pixels. Here, as for noisefloor's oracle, a tile is sampled as a whole
//! until it is done. A tile meets a condition on pixels when a share of its pixels does, 95 % by default.
//! With all pixels, the one in 16,384 that a rare light path hits would decide, which would be unfair to
//! criteria that were never meant to judge tiles.
//!
//! # State
//! Most rivals remember earlier pictures, and forget them when a new film begins.
//!
//! ```
//! use noisefloor::{
//!     Batch, Driver, Params, ProgressiveSource, Request, SourceError, SourceInfo, StopReason,
//! };
//! use noisefloor_testkit::Noise;
//!
//! /// A renderer of a grey wall, lit by a flickering lamp.
//! struct Wall(Noise);
//! impl ProgressiveSource for Wall {
//!     fn info(&self) -> SourceInfo {
//!         SourceInfo::new("wall", 32, 32)
//!     }
//!     fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
//!         let mut flicker = |spp: u64| 0.2 + (self.0.uniform() - 0.5) / (spp as f64).sqrt();
//!         let batch = |r: &Request| {
//!             let mean = (0..r.tile.pixels()).map(|_| [flicker(r.spp) as f32; 3]).collect();
//!             Batch::new(r.tile, r.spp, mean)
//!         };
//!         Ok(requests.iter().map(batch).collect())
//!     }
//! }
//!
//! let criterion = noisefloor_rivals::parse("relative-error:0.1")?;
//! let mut driver = Driver::new(Wall(Noise::new(1)), criterion, Params::default().with_tile(32))?;
//! driver.run(|_, _| ())?;
//! // 1.96·σ/√n ≤ 10 % of 0.2 for σ² = 1/12 at n = 800 if σ is known; 95 % of pixels take some more.
//! let stop = driver.session().stops().next().ok_or("one tile")?;
//! assert!(stop.reason == StopReason::Converged && (800..=3000).contains(&stop.spp), "{stop:?}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![allow(missing_docs, reason = "serves the commands: any release may change what is public here")]

mod converged;
mod cycles;
mod dammertz;
mod luxcore;
pub mod metrics;
mod picture;
mod pixels;
mod relative_error;
mod spec;
mod stages;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod vdp;

pub use converged::ConvergedCvvdp;
pub use cycles::CyclesAdaptive;
pub use dammertz::Dammertz;
pub use luxcore::LuxCoreHalt;
pub use picture::{DifferenceMap, DisplayPixels, MetricError};
pub use relative_error::RelativeError;
pub use spec::{RIVALS, Rival, RivalSpec, SpecError, parse};
pub use stages::{Myszkowski1998, Takouachet2007};
pub use vdp::Vdp;

#[cfg(doc)]
use noisefloor::StoppingCriterion;
