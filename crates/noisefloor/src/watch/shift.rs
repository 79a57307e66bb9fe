//! Whether larger batches are brighter.

use super::points::level;
use super::said::CERTAIN;
use crate::display::luminance;
use crate::film::Film;
use crate::tile::{Tile, TilePixels};
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};

/// How many times as many samples as the batches before a batch has, on average, to be compared with them.
const LARGER: f64 = 1.5;
/// Edge of the squares of pixels that are one term: what a pixel filter correlates lies mostly within.
const BLOCK: usize = 4;
/// Relative brightness that is no rounding, as sums of a thousand samples in single precision have it.
const LEAST: f64 = 5e-4;

/// The expected mean of linear radiance is the same for any number n of samples. That of a curve f of it is
/// not: E f(mean) − f(E) ≈ f″·σ²/2n (Jensen 1906), which is below 0 for curves that brighten the dark or cut
/// off light, so that larger batches are brighter. Sums grow with n itself.
///
/// Watched is Σd, where d is a batch less the picture before it, of batches much larger than those that the
/// picture is made of. If all samples are alike and independent, d has the mean 0 at each pixel, whatever the
/// mean of both. Fireflies skew it, but not towards an alarm: if N of them make all noise, the batch, which has
/// at most as many samples as the picture, has them all with p ≤ 2⁻ᴺ, and then z = √N.
#[derive(Clone, Copy, Debug, Default)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub(crate) struct Shift {
    sum: f64,
    squares: f64,
    light: f64,
}

impl Shift {
    /// Of a batch before it is added; of its tile, the film has the mean of so many batches.
    pub(super) fn of(film: &Film, tile: Tile, batches: u64, spp: u64, mean: TilePixels<'_>) -> Option<Self> {
        let (had, new) = (film.spp(tile.index) as f64, spp as f64);
        if batches == 0 || new * (batches as f64) < LARGER * had || new > had {
            return None;
        }
        let share = new / (had + new);
        let pixels = tile.rows(film.grid().width()).flatten().zip(mean.iter()).map(|(pixel, batch)| {
            let (before, batch) =
                (f64::from(luminance(film.pixel(tile.index, pixel))), f64::from(luminance(batch)));
            let difference = batch - before;
            (difference, (before + difference * share).abs())
        });
        let pixels: Vec<(f64, f64)> = pixels.collect();
        // As displayed, more or less: see `group::weights`
        let means: Vec<f64> = pixels.iter().map(|pixel| pixel.1).collect();
        let typical = level(&means);
        let mut shift = Self::default();
        let across = tile.width.div_ceil(BLOCK);
        for rows in pixels.chunks(BLOCK * tile.width) {
            let mut blocks = vec![0.0; across];
            for (i, &(difference, mean)) in rows.iter().enumerate() {
                let weighted = difference / (typical + mean);
                if weighted.is_finite() {
                    blocks[i % tile.width / BLOCK] += weighted;
                    shift.light += mean / (typical + mean);
                }
            }
            shift.sum += blocks.iter().sum::<f64>();
            shift.squares += blocks.iter().map(|block| block * block).sum::<f64>();
        }
        Some(shift)
    }

    pub(super) fn add(&mut self, more: &Self) {
        self.sum += more.sum;
        self.squares += more.squares;
        self.light += more.light;
    }

    /// By how many per cent larger batches are brighter, if that is neither chance nor rounding; with z
    /// divided by what pixels that are not independent widen it by.
    pub(super) fn brighter(&self, widening: f64) -> Option<f64> {
        let share = self.sum / self.light;
        (self.sum / self.squares.sqrt() / widening > CERTAIN && share > LEAST).then_some(100.0 * share)
    }
}
