//! How the same pictures look once they are denoised, which is how people will see them.

use super::quality::Yardstick;
use crate::error::LabError;
use noisefloor::Rgb;
use noisefloor_denoise::{Denoiser, NoisyPicture};
use std::time::Instant;

/// JODs that the worst tile of a denoised picture may have lost to count as converged: what pages and tables ask
/// for. At 0.3, 58 % of people would prefer the converged picture, by the definition of the unit.
pub(crate) const DENOISED_LIMIT: f64 = 0.3;

/// A picture after denoising, against the converged one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AfterDenoising {
    /// Seconds that denoising took, once.
    pub seconds: f64,
    /// ColorVideoVDP of the denoised picture.
    pub jod: f64,
    /// Of its worst tile, each compared as a picture of its own.
    pub jod_worst: f64,
}

impl AfterDenoising {
    pub(super) fn of(
        image: &[Rgb],
        denoiser: &mut dyn Denoiser,
        yardstick: &Yardstick,
    ) -> Result<Self, LabError> {
        let grid = yardstick.grid();
        let began = Instant::now();
        let made = denoiser.denoise(&NoisyPicture::new(grid.size(), image))?;
        let seconds = began.elapsed().as_secs_f64();
        let (jod, tiles) = yardstick.jods(&yardstick.encode(&made))?;
        Ok(Self { seconds, jod, jod_worst: tiles.into_iter().fold(10.0, f64::min) })
    }
}
