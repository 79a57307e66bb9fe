//! For those who implement noisefloor's traits, and for its own tests.
//!
//! - [`check_source`] holds a source of samples to everything that
//!   [`ProgressiveSource`](noisefloor::ProgressiveSource) promises. One call in a test is enough.
//!   [`check_reference`] looks at a quick reference, where the renderer has one.
//! - [`Noise`] is a seeded stream of uniform and normal random numbers.
//! - [`bilateral`] is a denoiser of a few lines.
//! - [`require`] is for tests that need something which not every machine has, such as a renderer or Python.
//!   Such a test is skipped with a message that is always seen, or fails where `NOISEFLOOR_REQUIRE` says that
//!   the thing must be there.
//!
//! ```
//! use noisefloor::{Batch, ProgressiveSource, Repeats, Request, SourceError, SourceInfo};
//! use noisefloor_testkit::{Noise, check_source};
//!
//! /// A grey wall, as a path tracer might see it.
//! struct Wall {
//!     seed: u64,
//! }
//!
//! impl ProgressiveSource for Wall {
//!     fn info(&self) -> SourceInfo {
//!         SourceInfo::new("wall", 48, 40).with_repeats(Repeats::Samples)
//!     }
//!
//!     fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
//!         let mut batches = Vec::new();
//!         for &Request { tile, first, spp, .. } in requests {
//!             let mut mean = Vec::new();
//!             for y in tile.y..tile.y + tile.height {
//!                 for x in tile.x..tile.x + tile.width {
//!                     // A sample depends on the seed, the pixel and its own index, and on nothing else
//!                     let sample = |n| Noise::keyed(&[self.seed, x as u64, y as u64, n]).uniform();
//!                     let sum: f64 = (first..first + spp).map(sample).sum();
//!                     mean.push([(sum / spp as f64) as f32; 3]);
//!                 }
//!             }
//!             batches.push(Batch::new(tile, spp, mean));
//!         }
//!         Ok(batches)
//!     }
//! }
//!
//! check_source(|| Wall { seed: 7 });
//! ```

mod bilateral;
mod contract;
mod noise;
mod process;
mod requirement;

pub use bilateral::bilateral;
pub use contract::{broken_promise, check_reference, check_silence, check_source};
pub use noise::Noise;
#[cfg(target_os = "linux")]
pub use process::{is_running, resident_kib};
pub use requirement::{Requirement, require, require_python, require_shared};

use std::time::Duration;

/// How long a test waits for what takes seconds: ten times what the slowest machine took. Whatever lasts longer hangs;
/// nothing fails because a machine is slow.
pub const HANG: Duration = Duration::from_secs(600);
