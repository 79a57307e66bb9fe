//! The log-average luminance of a picture that is still noisy: what it will be once the picture has
//! converged.
//!
//! The mean of a logarithm is bent by noise: a pixel whose light has not been met is left out or counts
//! as nearly black, and a noisy one counts as too dark. So a logarithm is taken only of what is known. A
//! pixel that is known by itself counts by itself. Those of a block of 2×2 that are not are pooled; if
//! their mean is not known either, they go on to 4×4, 8×8 and so on. Dark pixels beside bright ones are
//! so pooled with other dark pixels. Sums are kept on the way, so that sorting pixels by their own noisy
//! values bends the result by the second order at most.

use super::{DELTA, luminance};
use crate::rgb::Rgb;
use rayon::prelude::*;

/// Squared ratio of a mean to its standard error from which it is known. With a larger one, blocks are
/// larger, and what the picture changes by within them counts as too bright; with a smaller one, pixels
/// are sorted by their noise, and count as too dark. Of 6 to 48, 6 to 9 did best
/// (docs/benchmarks/exposure.md).
const ENOUGH: f64 = 8.0;
/// Edge of the blocks that are pooled first, pixel by pixel.
const BLOCK: usize = 8;
/// Edge of the blocks that tell of the noise of a pixel. One difference of two halves says little by
/// itself: halves that met the same light once differ by nothing.
const AROUND: usize = 4;
/// Black pixels are taken for unmet light if no more than this is missing: where as much light as in the
/// pixels beside them is expected to be met three times, it is missed once in 20.
const MISSED: f64 = 3.0;
/// Blocks without any light, from [`BLOCK`] pixels on, are black unless all three beside them are lit.
const LIT_BESIDE: usize = 3;
/// Pixels that are left between known ones, below this share, are brighter by chance: a sample that few
/// paths find is spread over more pixels than those that have it.
const SCATTERED: f64 = 0.125;
/// Ratio of the two variances that the pixels around tell from which on they are another thing: a lamp.
const FAR: f64 = 100.0;
/// What the picture changes by within blocks bends the estimate as by this share of what twice as large a
/// limit changes.
const BENT: f64 = 0.5;
/// Logarithm by which a pixel may be off whose light is not known.
const UNKNOWN: f64 = 1.0;

/// Where blocks of four grids begin: what a block has of both sides of an edge is then not left to chance.
const GRIDS: [(usize, usize); 4] = [(0, 0), (21, 9), (42, 51), (11, 33)];

/// What is known of one pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NoisyPixel {
    pub(crate) luminance: f32,
    /// Standard deviation of that, from one difference; `None` to take it from the pixels beside it.
    pub(crate) deviation: Option<f32>,
}

/// A log-average, and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LogAverage {
    pub(crate) value: f64,
    /// Standard error of its logarithm.
    pub(crate) error: f64,
}

/// The pixels of a block that are not known, and what is known of the others.
#[derive(Clone, Copy, Debug, Default)]
struct Pool {
    /// Pixels that have light, or are taken to; their luminance and its variance, summed.
    lit: f64,
    sum: f64,
    variance: f64,
    /// That variance by the relative noise of the pixels around.
    expected: f64,
    /// Pixels without any.
    black: f64,
    /// Pixels that are known, and the sum of their logarithms.
    known: f64,
    logs: f64,
}

/// (mean/standard error)² of a sum.
fn certainty(sum: f64, variance: f64) -> f64 {
    if variance > 0.0 { sum * sum / variance } else { f64::INFINITY }
}

impl Pool {
    fn pixel([sum, variance]: [f64; 2], noise: Noise) -> Self {
        if sum == 0.0 {
            // Of one picture alone, the pixels beside it say that there is noise
            return Self { black: 1.0, variance, ..Self::default() };
        }
        Self { lit: 1.0, sum, variance, expected: sum * sum * noise.relative, ..Self::default() }
    }

    /// What is left of up to four blocks. Black pixels join if light like that of the others may have
    /// missed them, and if so many blocks are lit.
    fn of(blocks: impl Iterator<Item = Self> + Clone, least: usize) -> Self {
        let mut all = blocks.clone().fold(Self::default(), |all, one| Self {
            lit: all.lit + one.lit,
            sum: all.sum + one.sum,
            variance: all.variance + one.variance,
            expected: all.expected + one.expected,
            black: 0.0,
            known: all.known + one.known,
            logs: all.logs + one.logs,
        });
        let (lit, met) = (all.lit, certainty(all.sum, all.variance));
        let among_light = blocks.clone().filter(|block| block.lit > 0.0).count() >= least;
        for Self { black, .. } in blocks.filter(|block| block.black > 0.0) {
            if among_light && black <= lit && black * met < MISSED * lit {
                all.lit += black;
            } else {
                all.black += black;
            }
        }
        all
    }

    /// Counts the pixels if their mean is known: by its own variance, and by that of the pixels around
    /// it, which grows with the light or with its square.
    fn count(&mut self, noise: Noise, tally: &mut Tally) {
        // Light of another order beside a pixel says nothing of it; rare light that it has not met does
        let by_light = self.sum * noise.of_light;
        let around = if by_light > FAR * self.expected { self.expected } else { by_light };
        let variance = self.variance.max(around);
        if !(self.lit > 0.0 && self.sum > 0.0 && certainty(self.sum, variance) >= tally.enough) {
            return;
        }
        // E ln X ≈ ln E X − Var X/(2·(E X)²)
        let relative = variance / (self.sum * self.sum);
        let mut log = (self.sum / self.lit).ln() + 0.5 * relative;
        if self.lit < SCATTERED * (self.lit + self.known) {
            log = log.min(self.logs / self.known);
        }
        tally.add(self.lit, log, relative);
        *self = Self {
            black: self.black,
            known: self.known + self.lit,
            logs: self.logs + self.lit * log,
            ..Self::default()
        };
    }
}

/// What pixels tell of the noise of those around them.
#[derive(Clone, Copy, Debug, Default)]
struct Noise {
    /// Variance for each unit of light: the same for light that is met seldom, in bright and dark pixels.
    of_light: f64,
    /// Mean of the relative variance: the same in bright and dark pixels where all have met their light.
    relative: f64,
}

impl Noise {
    /// Of luminances and their variances.
    fn of(pixels: impl Iterator<Item = [f64; 2]>) -> Self {
        let (mut light, mut variance, mut relative, mut lit) = (0.0, 0.0, 0.0, 0.0);
        for [luminance, noise] in pixels {
            light += luminance;
            variance += noise;
            if luminance == 0.0 {
                continue;
            }
            relative += (noise / (luminance * luminance)).min(1.0);
            lit += 1.0;
        }
        let of_light = if light > 0.0 { variance / light } else { 0.0 };
        Self { of_light, relative: if lit > 0.0 { relative / lit } else { 0.0 } }
    }
}

/// Bins of a logarithm: all that an f32 can have, and sums of many.
const BINS: i32 = 256;

/// Known pixels by their logarithms.
#[derive(Clone, Debug)]
struct Tally {
    /// [`ENOUGH`], or another.
    enough: f64,
    /// Pixels, and the sum of their logarithms.
    bins: Vec<[f64; 2]>,
    /// Squared standard error of the sum of all logarithms.
    variance: f64,
}

impl Tally {
    fn new(enough: f64) -> Self {
        Self { enough, bins: vec![[0.0; 2]; BINS as usize], variance: 0.0 }
    }

    fn add(&mut self, pixels: f64, log: f64, relative: f64) {
        let bin = (log.floor() as i32 + BINS / 2).clamp(0, BINS - 1);
        let [count, sum] = &mut self.bins[bin as usize];
        *count += pixels;
        *sum += pixels * log;
        self.variance += pixels * pixels * relative;
    }

    fn merge(&mut self, other: &Self) {
        for (bin, [count, sum]) in self.bins.iter_mut().zip(&other.bins) {
            bin[0] += count;
            bin[1] += sum;
        }
        self.variance += other.variance;
    }

    fn pixels(&self) -> f64 {
        self.bins.iter().map(|bin| bin[0]).sum()
    }

    /// exp(mean ln(δ + L)): see [`super::log_average`]. Within a bin, all are alike to δ.
    fn log_average(&self) -> f64 {
        let pixels = self.pixels();
        let mean = self.bins.iter().map(|bin| bin[1]).sum::<f64>() / pixels;
        let lifted = |&[count, sum]: &[f64; 2]| {
            if count > 0.0 { sum + count * (DELTA * (mean - sum / count).exp()).ln_1p() } else { 0.0 }
        };
        (self.bins.iter().map(lifted).sum::<f64>() / pixels).exp()
    }
}

/// The log-average of the converged picture, from one of `width`×`height` pixels; `None` if all is black.
/// `pixel(x, y)` is `None` where there is no sample.
pub(crate) fn estimate(
    (width, height): (usize, usize),
    pixel: impl Fn(usize, usize) -> Option<NoisyPixel> + Sync,
) -> Option<LogAverage> {
    let row = |y: usize| (0..width).map(|x| pixel(x, y).filter(|p| p.luminance.is_finite())).collect();
    let rows: Vec<Vec<Option<NoisyPixel>>> = (0..height).into_par_iter().map(row).collect();
    let on_grids = |enough| -> Vec<LogAverage> {
        GRIDS.iter().filter_map(|&grid| on_grid(width, &rows, grid, enough)).collect()
    };
    let (found, coarse) = (on_grids(ENOUGH), on_grids(2.0 * ENOUGH));
    let mean = mean_log(&found)?;
    let count = found.len() as f64;
    let scatter = found.iter().map(|one| (one.value.ln() - mean).powi(2)).sum::<f64>() / count;
    let error = found.iter().map(|one| one.error * one.error).sum::<f64>() / count;
    let bent = BENT * (mean_log(&coarse)? - mean);
    Some(LogAverage { value: mean.exp(), error: (error + scatter / count + bent * bent).sqrt() })
}

fn mean_log(found: &[LogAverage]) -> Option<f64> {
    let sum = found.iter().map(|one| one.value.ln()).sum::<f64>();
    (!found.is_empty()).then(|| sum / found.len() as f64)
}

/// The same by blocks that begin at (`dx`, `dy`).
fn on_grid(
    width: usize,
    rows: &[Vec<Option<NoisyPixel>>],
    (dx, dy): (usize, usize),
    enough: f64,
) -> Option<LogAverage> {
    let (mut across, mut down) = ((width + dx).div_ceil(BLOCK), (rows.len() + dy).div_ceil(BLOCK));
    let row_of_blocks = |top: usize| {
        let mut tally = Tally::new(enough);
        let block = |left: usize| {
            let at = |x: usize, y: usize| *rows.get(y.checked_sub(dy)?)?.get(x.checked_sub(dx)?)?;
            let pixels =
                std::array::from_fn(|y| std::array::from_fn(|x| at(left * BLOCK + x, top * BLOCK + y)));
            pool_block(&pixels, &mut tally)
        };
        let pools: Vec<Pool> = (0..across).map(block).collect();
        (pools, tally)
    };
    let parts: Vec<(Vec<Pool>, Tally)> = (0..down).into_par_iter().map(row_of_blocks).collect();
    // In their order, so that the sums are the same with any number of threads
    let (mut pools, mut tally) = (Vec::with_capacity(across * down), Tally::new(enough));
    for (part, counted) in parts {
        pools.extend(part);
        tally.merge(&counted);
    }
    while pools.len() > 1 {
        pools = halved(&pools, (across, down), &mut tally);
        (across, down) = (across.div_ceil(2), down.div_ceil(2));
    }
    let rest = pools.first().copied().unwrap_or_default();
    let known = tally.pixels();
    if known == 0.0 {
        let value = rest.sum / rest.lit;
        return (value > 0.0).then_some(LogAverage { value, error: UNKNOWN });
    }
    let error = (tally.variance.sqrt() / known).hypot(UNKNOWN * rest.lit / (rest.lit + known));
    Some(LogAverage { value: tally.log_average(), error })
}

/// Blocks of twice the edge.
fn halved(pools: &[Pool], (columns, rows): (usize, usize), tally: &mut Tally) -> Vec<Pool> {
    let mut larger = Vec::with_capacity(columns.div_ceil(2) * rows.div_ceil(2));
    for y in (0..rows).step_by(2) {
        for x in (0..columns).step_by(2) {
            let inside = |&(x, y): &(usize, usize)| x < columns && y < rows;
            let four = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)];
            let four = four.into_iter().filter(inside).map(|(x, y)| pools[y * columns + x]);
            let mut pool = Pool::of(four, LIT_BESIDE);
            pool.count(Noise::default(), tally);
            larger.push(pool);
        }
    }
    larger
}

type Block<T> = [[Option<T>; BLOCK]; BLOCK];

/// Counts what is known of a block pixel by pixel, and in blocks of 2×2, 4×4 and 8×8.
fn pool_block(pixels: &Block<NoisyPixel>, tally: &mut Tally) -> Pool {
    let pixels = with_variances(pixels);
    let around = |x: usize, y: usize| {
        let rows = pixels[y..y + AROUND].iter();
        Noise::of(rows.flat_map(|row| row[x..x + AROUND].iter().copied().flatten()))
    };
    let noise = [0, AROUND].map(|y| [0, AROUND].map(|x| around(x, y)));
    let mut pools = [Pool::default(); BLOCK * BLOCK];
    for (at, pool) in pools.iter_mut().enumerate() {
        let (x, y) = (at % BLOCK, at / BLOCK);
        let noise = noise[y / AROUND][x / AROUND];
        *pool = pixels[y][x].map_or_else(Pool::default, |pixel| Pool::pixel(pixel, noise));
        pool.count(noise, tally);
    }
    let mut edge = BLOCK;
    while edge > 1 {
        let half = edge / 2;
        for at in 0..half * half {
            let (x, y) = (at % half * 2, at / half * 2);
            // Never before what is still to be read
            let four = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| pools[y * edge + x]);
            pools[at] = Pool::of(four.into_iter(), 1);
            // From 4×4 on, a block has differences enough of its own
            let noise = if half == AROUND { noise[y / AROUND][x / AROUND] } else { Noise::default() };
            pools[at].count(noise, tally);
        }
        edge = half;
    }
    pools[0]
}

/// Luminance and its variance. Where that is not given, it is the sample variance of 2×2 pixels: where
/// the picture changes as much as it does from pixel to pixel, it counts as noise, and is known in larger
/// blocks only.
fn with_variances(pixels: &Block<NoisyPixel>) -> Block<[f64; 2]> {
    let beside = |x: usize, y: usize| {
        let (x, y) = (x & !1, y & !1);
        let four = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].map(|(x, y)| pixels[y][x]);
        let there = || four.iter().flatten().map(|pixel| f64::from(pixel.luminance));
        let count = there().count() as f64;
        let mean = there().sum::<f64>() / count;
        there().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0)
    };
    std::array::from_fn(|y| {
        std::array::from_fn(|x| {
            pixels[y][x].map(|NoisyPixel { luminance, deviation }| {
                let variance =
                    deviation.map_or_else(|| beside(x, y), |deviation| f64::from(deviation).powi(2));
                [f64::from(luminance), variance]
            })
        })
    })
}

/// Two renderings of one picture, of so many samples per pixel each, at one pixel: their mean and its
/// standard deviation.
pub(crate) fn of_halves([(a, na), (b, nb)]: [(Rgb, f64); 2]) -> Option<NoisyPixel> {
    let all = na + nb;
    if all.is_nan() || all <= 0.0 {
        return None;
    }
    let [a, b] = [a, b].map(|half| f64::from(luminance(half)));
    let mean = (na * a + nb * b) / all;
    // A − B has σ²·(n_A + n_B)/(n_A·n_B), the mean of all σ²/(n_A + n_B). One half alone says nothing of
    // its noise.
    let deviation = if na > 0.0 && nb > 0.0 { (a - b).abs() * (na * nb).sqrt() / all } else { mean };
    Some(NoisyPixel { luminance: mean as f32, deviation: Some(deviation as f32) })
}

#[cfg(test)]
mod tests;
