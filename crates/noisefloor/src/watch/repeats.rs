//! Whether a batch of a tile was there before.

use super::points;
use crate::display::luminance;
use crate::tile::{Tile, TilePixels};
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};

/// Values that differ by less, relative to their size, are the same but for rounding.
pub(super) const ROUNDING: f32 = 1.0 / (1 << 18) as f32;
/// Differences below this, relative to the pixels, are no noise.
pub(super) const ROUGH: f32 = 1e-3;
/// What a difference of two running means may err by, relative to the later one times its samples over the new ones.
const OF_RUNNING: f32 = 8.0 / (1 << 24) as f32;
/// Batches from the beginning that are remembered, and as many of the last ones: seeds that count up to a number and
/// begin again give the first batch again, and those that are stuck the last.
const REMEMBERED: usize = 64;
/// Pixels that a batch which came twice and another one differ in, from which it is no chance.
///
/// If a, b and c are independent batches whose pixels are independent, let D be how many pixels of another batch differ
/// from a on average. Then c equals a with p = Π(1 − pᵢ) ≤ exp(−D), and b differs from it in N pixels, for which E 2ᴺ =
/// Π(1 + pᵢ) ≤ exp(D). So N ≥ n and a = c with p ≤ 2⁻ⁿ, however noise is distributed: also where most pixels have none,
/// or samples are 0 or 1. In 10⁴ tiles of 10⁴ batches, each beside those remembered, that is 5·10⁻⁵.
const TELLING: u32 = 48;
/// The pixels that a pixel filter of three by three correlates.
const FILTERED: u32 = 9;

/// What a tile's batches have in common with those before.
#[derive(Clone, Debug, Default)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub(super) struct Repeats {
    /// Luminance of the first batch where batches are compared, and its samples.
    first: Vec<f32>,
    size: u64,
    /// Digests of batches.
    known: Vec<u64>,
    /// Most pixels in which a batch differed from the first, and from the line between their neighbours.
    noisy: u32,
    /// Most pixels in which a batch that had come before differed from the first.
    again: u32,
    /// Whether most lit pixels of a batch differed from that line.
    pub(super) rough: bool,
    /// Whether the first batch came again, but for rounding.
    pub(super) first_again: bool,
    /// Whether it came of two numbers of samples.
    still: bool,
}

impl Repeats {
    /// Whether what was read can be of a tile that got so many batches.
    #[cfg(feature = "files")]
    pub(super) fn fits(&self, tile: Tile, batches: u64) -> bool {
        let points = if batches == 0 { 0 } else { points::compared(tile).count() };
        self.first.len() == points && self.known.len() as u64 == batches.min(2 * REMEMBERED as u64)
    }

    /// Takes notice of the next batch, after so many. `given` is what the caller gave, a running mean of `growth` times
    /// as many samples as are new, or the batch itself, with a growth of 0.
    pub(super) fn see(
        &mut self,
        tile: Tile,
        batches: u64,
        spp: u64,
        [mean, given]: [TilePixels<'_>; 2],
        growth: f32,
    ) {
        let finite = |value: f32| if value.is_finite() { value } else { 0.0 };
        let read = |(x, y): (usize, usize)| finite(luminance(mean.row(y)[x]));
        let (mut digest, mut others, mut same, mut lit, mut roughs) = (0u64, 0, true, 0, 0);
        if batches == 0 {
            (self.first, self.size) = (points::compared(tile).map(read).collect(), spp);
        }
        for ((x, y), &first) in points::compared(tile).zip(&self.first) {
            let light = read((x, y));
            // 2⁶⁴ over the golden ratio: each bit of a value moves half of those that follow
            digest =
                (digest ^ u64::from(light.to_bits())).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
            let (difference, size) = ((light - first).abs(), light.abs().max(first.abs()));
            let lost = if growth > 0.0 {
                OF_RUNNING * growth * finite(luminance(given.row(y)[x])).abs()
            } else {
                0.0
            };
            same &= difference <= (ROUNDING * size).max(lost);
            // What lies on the line between its neighbours is light that was switched on, say, and no noise
            let [left, right] = [x.saturating_sub(1), (x + 1).min(tile.width - 1)].map(|x| read((x, y)));
            let all = left.abs() + 2.0 * light.abs() + right.abs();
            let rough = (left - 2.0 * light + right).abs() > ROUGH * all;
            (lit, roughs) = (lit + u32::from(all > 0.0), roughs + u32::from(rough));
            others += u32::from(rough && difference > (ROUGH * size).max(8.0 * lost));
        }
        self.rough |= roughs >= TELLING && 2 * roughs > lit;
        if batches > 0 {
            self.noisy = self.noisy.max(others);
            if self.known.contains(&digest) {
                self.again = self.again.max(others);
            }
            self.first_again |= same;
            self.still |= same && spp != self.size;
        }
        match self.known.len() {
            kept if kept < 2 * REMEMBERED => self.known.push(digest),
            _ => self.known[REMEMBERED + (batches % REMEMBERED as u64) as usize] = digest,
        }
    }

    /// Whether the first batch, if there is one, had as many samples.
    pub(super) fn is_size(&self, spp: u64) -> bool {
        [0, spp].contains(&self.size)
    }

    /// Whether a pixel differs from batch to batch by more than rounding.
    pub(super) fn varies(&self) -> bool {
        self.noisy > 0
    }

    /// Whether the same random numbers came twice.
    pub(super) fn are_certain(&self, shared: bool) -> bool {
        let pixels = if self.first_again { self.noisy } else { self.again };
        pixels >= if shared { FILTERED * TELLING } else { TELLING }
    }

    /// Whether all that came is one rough picture of one number of samples, so that nothing tells whether it has noise.
    pub(super) fn is_one_picture(&self) -> bool {
        self.first_again && self.rough && !self.varies() && !self.still
    }

    /// Whether a picture has no noise here, or has it as it should.
    pub(super) fn is_told(&self) -> bool {
        self.still || self.varies()
    }

    /// The number of samples of each batch, if [`Repeats::is_one_picture`].
    pub(super) fn only_size(&self) -> Option<u64> {
        self.is_one_picture().then_some(self.size)
    }
}
