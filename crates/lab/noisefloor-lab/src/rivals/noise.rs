//! The noise of a zone, told from its pictures.
//!
//! A criterion that follows a rendering looks at the film's mean, at the difference of its halves, at the
//! variance between batches, or at the difference of snapshots. All of these are sums of batches with weights,
//! so all have the noise of their samples if batches have it and do not correlate. There are only K realisations
//! of it, two to six in practice, and many more batches. In turn, with or without a change of sign, they add up
//! or cancel each other in the film. So each batch is a mixture of all K:
//!
//! > batch i = converged + Σₖ sᵢₖ(block)·realisation k / √(K·samples),   sᵢₖ = ±1 at random,
//!
//! with signs of their own in each block of 8×8 pixels, the same for all channels.
//!
//! - **In a batch** Σₖ(sᵢₖ/√K)² = 1 in every block: its noise is σ²/samples.
//! - **In any weighted sum of batches** the signs of different batches are independent, so its variance is
//!   Σwᵢ²σ²/nᵢ on average: σ²/n for the film and for each half, and the halves do not correlate. In a single
//!   block it scatters by √(2/K), as χ² with K degrees of freedom does; over the M blocks of a tile by √(2/(KM)):
//!   3 to 4 % of the variance, or of samples, in a zone of 200×200 pixels, at every stage.
//! - **Noise stays where it is**, and as strong and as coloured as it is there: a realisation is never shifted.
//!   Neighbours keep their correlation within a block. Across its borders, between one in eight pairs, it is
//!   lost. In pictures of the human data neighbours correlate by 0 to 0.2, and pixels that are further apart by
//!   less than 0.02, but where 8-bit rounding is as strong as the noise.
//! - **Noise has no mean**: the local mean of a realisation, over 33×33 pixels, is taken off. Early pictures of
//!   the data are darker than the converged one by up to 8/255, in proportion to 1/n, since clipping and tone
//!   mapping bend noise; scaled by 1/√n and with signs by block, that would become a pattern of squares. White
//!   noise loses a thousandth of its variance.
//! - **A pixel** knows only K numbers. Its variance between batches is right on average over pixels, but
//!   scatters between them by √(2/K) however many batches there are, where that of a rendering settles. A
//!   criterion that looks at a high quantile of it gets a laxer constant, by about the same factor in each scene.

use noisefloor::{Rgb, display::srgb_decode};
use noisefloor_learn::{Encoding, JudgedImage, combine};

/// The mean of some of the samples may amplify the rounding of 8-bit pictures by no more than this.
const AMPLIFICATION: f64 = 8.0;
/// Edge of the blocks that have signs of their own, in pixels.
const BLOCK: usize = 8;
/// Reach of the mean that is taken off a realisation, in pixels to each side.
const REACH: usize = 16;

/// What the pictures of a zone say of its noise, in linear light.
pub(super) struct Noise {
    pub(super) converged: Vec<Rgb>,
    /// Differences from the converged picture, scaled to the variance of a single sample.
    realisations: Vec<Vec<Rgb>>,
    /// Of the zone, in pixels.
    width: usize,
    /// Number of the zone, so that each has signs of its own.
    zone: u32,
}

impl Noise {
    /// From images by increasing samples.
    pub(super) fn of(levels: &[JudgedImage]) -> Option<Self> {
        let linear = |level: &JudgedImage| -> Vec<Rgb> {
            let decode = |pixel: Rgb| match level.encoding {
                Encoding::Display => pixel.map(srgb_decode),
                Encoding::Linear => pixel,
            };
            level.patch.inner_pixels().map(decode).collect()
        };
        // Means of separate samples, and how many these are.
        let mut parts: Vec<(f64, Vec<Rgb>)> = Vec::new();
        let (mut total, mut running) = (0.0f64, Vec::new());
        for level in levels {
            let image = linear(level);
            let last = level.last as f64;
            let samples = last - total;
            if running.is_empty() {
                running.clone_from(&image);
                parts.push((last - level.first as f64, image));
            } else if level.first > 0 {
                running = combine(&running, total / last, &image, samples / last);
                parts.push((samples, image));
            } else {
                if last / samples <= AMPLIFICATION {
                    parts.push((samples, combine(&image, last / samples, &running, -total / samples)));
                }
                running = image;
            }
            total = last;
        }
        // The converged picture contains them: Var(part − converged) = σ²(1/samples − 1/total).
        let JudgedImage { zone, ref patch, .. } = *levels.first()?;
        let width = patch.inner.width;
        let realisation = |(samples, mean): &(f64, Vec<Rgb>)| {
            let scale = (1.0 / samples - 1.0 / total).max(0.0).sqrt().recip();
            let difference = combine(mean, scale, &running, -scale);
            combine(&difference, 1.0, &local_means(&difference, width), -1.0)
        };
        let usable = parts.iter().filter(|(samples, _)| *samples <= 0.5 * total);
        // Each block has 64 signs for a batch
        let realisations: Vec<Vec<Rgb>> = usable.map(realisation).take(64).collect();
        (realisations.len() >= 2).then_some(Self { converged: running, realisations, width, zone })
    }

    /// The mean of so many new samples; `turn` numbers the batches.
    pub(super) fn batch(&self, turn: usize, samples: u64) -> Vec<Rgb> {
        let strength = (self.realisations.len() as f64 * samples as f64).sqrt().recip();
        let mut pixels = Vec::with_capacity(self.converged.len());
        for (y, row) in self.converged.chunks(self.width).enumerate() {
            for (x, converged) in row.iter().enumerate() {
                let signs = signs(self.zone, turn, [x / BLOCK, y / BLOCK]);
                let mut noise = [0.0f64; 3];
                for (k, realisation) in self.realisations.iter().enumerate() {
                    let sign = if signs >> k & 1 == 0 { strength } else { -strength };
                    let value = realisation[y * self.width + x];
                    noise.iter_mut().zip(value).for_each(|(noise, value)| *noise += sign * f64::from(value));
                }
                pixels.push(std::array::from_fn(|c| (f64::from(converged[c]) + noise[c]) as f32));
            }
        }
        pixels
    }
}

/// 64 random bits for a block of a zone in a batch: SplitMix64 (Steele et al. 2014) of each in turn.
fn signs(zone: u32, turn: usize, [column, row]: [usize; 2]) -> u64 {
    [u64::from(zone), turn as u64, column as u64, row as u64].into_iter().fold(0, |state, key| {
        let mut z = (state ^ key).wrapping_add(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    })
}

/// The mean over the pixels within [`REACH`] of each, as far as there are any.
fn local_means(pixels: &[Rgb], width: usize) -> Vec<Rgb> {
    let transposed = |rows: &[Rgb], width: usize| -> Vec<Rgb> {
        (0..width).flat_map(|x| rows.iter().skip(x).step_by(width).copied()).collect()
    };
    let across = |rows: &[Rgb], width: usize| -> Vec<Rgb> {
        let mean = |row: &[Rgb], x: usize| {
            let near = &row[x.saturating_sub(REACH)..(x + REACH + 1).min(width)];
            std::array::from_fn(|c| near.iter().map(|p| p[c]).sum::<f32>() / near.len() as f32)
        };
        rows.chunks(width).flat_map(|row| (0..width).map(move |x| mean(row, x))).collect()
    };
    let height = pixels.len() / width;
    transposed(&across(&transposed(&across(pixels, width), width), height), height)
}

#[cfg(test)]
mod tests;
