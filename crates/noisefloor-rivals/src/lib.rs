//! What people would use instead of noisefloor: the other stopping criteria of progressive rendering, each a
//! [`StoppingCriterion`] for the same driver, and the metrics that judge final pictures.
//!
//! | criterion | spec | done when |
//! |---|---|---|
//! | [`FixedSpp`](noisefloor::FixedSpp) | `spp:256` | a tile has so many samples per pixel |
//! | [`TimeLimit`] | `time:30` | so many seconds have passed |
//! | [`RelativeError`] | `relative-error:0.19` | the confidence interval of a pixel is small beside its mean (Mitsuba 0.6) |
//! | [`Dammertz`] | `dammertz:0.003` | the error of a block, weighted by its area, is small; blocks split (Dammertz et al. 2010) |
//! | [`CyclesAdaptive`] | `cycles:0.01` | the error of a pixel is small beside its brightness (Blender Cycles) |
//! | [`LuxCoreHalt`] | `luxcore:0.35` | few pixels of the picture have changed on the screen (LuxCoreRender) |
//! | [`Myszkowski1998`] | `vdp-stages:0.55` | nobody sees a difference between successive stages |
//! | [`Takouachet2007`] | `vdp-first:0.66` | the visible difference from the first, noisy picture grows no more |
//!
//! [`parse`] makes a criterion of such a spec, and [`RIVALS`] lists those with one open constant, to be fitted to data.
//! [`Vdp`] is Daly's visible differences predictor; [`metrics`] has relMSE and PSNR, and behind features of their names FLIP and butteraugli.
//!
//! # Pixels and tiles
//! Renderers that judge pixels sample pixels; here a tile is sampled as a whole until it is done, as it is for noisefloor. A
//! condition on pixels is met by a tile when a share of its pixels meets it, 95 % by default: with all of them, the one pixel in
//! 16,384 that a rare light path hits would decide, and a criterion that never judged tiles would be blamed for it.
//!
//! # State
//! Most rivals remember earlier pictures. Use one of its own for each film. A film with fewer samples than before, or of another
//! size, is taken for a new one.
//!
//! ```
//! use noisefloor::*;
//!
//! /// A renderer of a grey wall, lit by a flickering lamp.
//! struct Wall(u64);
//! impl ProgressiveSource for Wall {
//!     fn info(&self) -> SourceInfo {
//!         SourceInfo { name: "wall".into(), width: 32, height: 32, unit: Unit::SamplesPerPixel, aims: true, repeats: Repeats::Nothing }
//!     }
//!     fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
//!         let mut flicker = |samples: u32| {
//!             self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
//!             0.2 + ((self.0 >> 40) as f32 / (1 << 24) as f32 - 0.5) / (samples as f32).sqrt()
//!         };
//!         Ok(requests.iter().map(|r| Batch { tile: r.tile, samples: r.samples, mean: (0..r.tile.pixels()).map(|_| [flicker(r.samples); 3]).collect() }).collect())
//!     }
//! }
//!
//! let criterion = noisefloor_rivals::parse("relative-error:0.1")?;
//! let mut driver = Driver::new(Wall(1), criterion, Params { tile: 32, ..Params::default() })?;
//! driver.run(|_, _| ())?;
//! // 1.96·σ/√n ≤ 10 % of 0.2 for σ² = 1/12 at n = 800 for a pixel whose σ is known; 95 % of pixels take some more.
//! let stop = driver.session().stops().next().ok_or("one tile")?;
//! assert!(stop.reason == StopReason::Converged && (800..=3000).contains(&stop.samples), "{stop:?}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod cycles;
mod dammertz;
mod image;
mod luxcore;
pub mod metrics;
mod pixels;
mod relative_error;
mod spec;
mod stages;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;
mod time;
mod vdp;

pub use cycles::CyclesAdaptive;
pub use dammertz::Dammertz;
pub use image::{Image, ImageError, Map};
pub use luxcore::LuxCoreHalt;
pub use relative_error::RelativeError;
pub use spec::{RIVALS, Rival, SpecError, parse};
pub use stages::{Myszkowski1998, Takouachet2007};
pub use time::TimeLimit;
pub use vdp::{Vdp, VdpViewing, VdpViewingError};

#[cfg(doc)]
use noisefloor::StoppingCriterion;
