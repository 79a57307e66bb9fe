//! Denoisers, and how wrong a denoised picture still is: measured from half buffers, without a reference.
//!
//! - [`Denoiser`]: a linear picture in, a picture out; what an implementer promises.
//! - [`Oidn`]: Open Image Denoise in a process of its own (feature `oidn`).
//! - [`Guides`]: albedo and normals for both halves, and whether they are clean.
//! - [`MirrorMean`]: the mean of what a denoiser makes of a picture and of its mirror images.
//! - [`DenoisedError`]: what is wrong with a denoised picture, from two halves and what becomes of each.
//! - [`jods_lost_beside`]: what a finished picture has lost, beside another render of the view.
//! - [`DenoisedQuality`]: a [`noisefloor::StoppingCriterion`] that stops tiles by it, for
//!   [`noisefloor::Session`] and [`noisefloor::Driver`].
//!
//! ```
//! use noisefloor::{Params, Rgb, Schedule, Session};
//! use noisefloor_denoise::{DEFAULT_JODS_LOST, DenoiseError, DenoisedQuality, Denoiser, NoisyPicture};
//!
//! /// Each row becomes its mean.
//! struct Rows;
//! impl Denoiser for Rows {
//!     fn name(&self) -> String {
//!         "rows".into()
//!     }
//!     fn denoise(&mut self, picture: &NoisyPicture<'_>) -> Result<Vec<Rgb>, DenoiseError> {
//!         let (width, _) = picture.size;
//!         let mean = |row: &[Rgb]| [0, 1, 2].map(|c| row.iter().map(|p| p[c]).sum::<f32>() / width as f32);
//!         Ok(picture.radiance.chunks_exact(width).flat_map(|row| vec![mean(row); width]).collect())
//!     }
//! }
//!
//! let criterion = DenoisedQuality::new(Rows, DEFAULT_JODS_LOST);
//! // From 100 samples on, a picture of so few pixels does not wait for light that nothing has met
//! let params = Params::default().with_tile(32).with_min_spp(112).with_schedule(Schedule::Growing { step: 16 });
//! let mut session = Session::new(64, 64, criterion, params)?;
//! while !session.is_done() {
//!     for request in session.requests() {
//!         // A renderer of a grey wall
//!         let mean = vec![[0.5; 3]; request.tile.pixels()];
//!         session.push(request.tile.index, request.spp, &mean)?;
//!     }
//!     session.judge()?;
//! }
//! assert!(session.stops().all(|stop| stop.spp == 112));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bands;
mod beside;
mod brightness;
mod criterion;
mod denoiser;
mod estimate;
mod excess;
mod guides;
mod mirrored;
#[cfg(feature = "oidn")]
mod oidn;
mod parts;
mod record;
mod thin;
mod unmet;

pub use beside::jods_lost_beside;
pub use criterion::{
    DEFAULT_JODS_LOST, DenoisedQuality, spp_with_denoising, spp_without_denoising, stops_err_by,
};
pub use denoiser::{AuxiliaryPictures, DenoiseError, Denoiser, NoisyPicture};
pub use estimate::{DenoisedError, DenoisedHalves, ESTIMATE_ERRS_BY};
pub use guides::{GuideError, Guides};
pub use mirrored::{DenoisePasses, MirrorMean};
#[cfg(feature = "oidn")]
pub use oidn::{OIDN, Oidn};
pub use record::compose;
pub use unmet::jods_lost_unmet;
