//! What is known of a block of 8×8 pixels, pixel by pixel and in blocks of 2×2, 4×4 and 8×8.

use super::{AROUND, BLOCK, FAR, Noise, NoisyPixel, Pool, Tally, certainty};
use multiversion::multiversion;

/// Pixels of a block.
pub(crate) const PIXELS: usize = BLOCK * BLOCK;

/// Parts of a block that tell of the noise of a pixel.
const PARTS: usize = (BLOCK / AROUND) * (BLOCK / AROUND);

/// The part that a pixel lies in.
const fn part_of(at: usize) -> usize {
    at / BLOCK / AROUND * (BLOCK / AROUND) + at % BLOCK / AROUND
}

/// A number for each pixel, row by row, as vector instructions want them.
type Numbers = [f64; PIXELS];

/// The pixels of a block.
pub(crate) struct NoisyBlock {
    pub(crate) luminance: [f32; PIXELS],
    /// [`NoisyPixel::deviation`]; NaN for `None`.
    pub(crate) deviation: [f32; PIXELS],
    /// Which pixels there are, with a sample.
    pub(crate) there: [bool; PIXELS],
}

impl NoisyBlock {
    /// The block that begins at this pixel of a picture, which may lie before its first.
    pub(crate) fn gather(
        [left, top]: [isize; 2],
        (width, height): (usize, usize),
        pixel: impl Fn(usize, usize) -> Option<NoisyPixel>,
    ) -> Self {
        let nothing = [0.0; PIXELS];
        let mut block = Self { luminance: nothing, deviation: nothing, there: [false; PIXELS] };
        let place = |from: isize, by: usize, edge: usize| {
            let at = from.checked_add_unsigned(by).and_then(|at| usize::try_from(at).ok());
            at.filter(|&at| at < edge)
        };
        for at in 0..PIXELS {
            let (x, y) = (place(left, at % BLOCK, width), place(top, at / BLOCK, height));
            let (Some(x), Some(y)) = (x, y) else { continue };
            let Some(NoisyPixel { luminance, deviation }) = pixel(x, y) else { continue };
            block.luminance[at] = luminance;
            block.deviation[at] = deviation.unwrap_or(f32::NAN);
            block.there[at] = luminance.is_finite();
        }
        block
    }

    /// Luminances and their variances; 0 for pixels that are not there.
    fn with_variances(&self) -> [Numbers; 2] {
        let [mut light, mut variance] = [[0.0; PIXELS]; 2];
        for at in 0..PIXELS {
            if self.there[at] {
                light[at] = f64::from(self.luminance[at]);
                let deviation = f64::from(self.deviation[at]);
                variance[at] = if deviation.is_nan() { self.varies_at(at) } else { deviation * deviation };
            }
        }
        [light, variance]
    }

    /// The sample variance of 2×2 pixels: where the picture changes as much as it does from pixel to pixel, it counts
    /// as noise, and is known in larger blocks only.
    fn varies_at(&self, at: usize) -> f64 {
        let first = at / BLOCK / 2 * 2 * BLOCK + at % BLOCK / 2 * 2;
        let four = [first, first + 1, first + BLOCK, first + BLOCK + 1];
        let there = || four.into_iter().filter(|&at| self.there[at]).map(|at| f64::from(self.luminance[at]));
        let count = there().count() as f64;
        let mean = there().sum::<f64>() / count;
        there().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0).max(1.0)
    }

    /// Counts what is known, for either tally; what is left is pooled.
    pub(super) fn pool(&self, tallies: &mut [Tally; 2]) -> [Pool; 2] {
        let [light, variance] = self.with_variances();
        let noise = noise_of_parts(&light, &variance);
        let [certain, relative] = weigh(&light, &variance, &noise);
        // The logarithms are the same for both
        let mut logs = [0.0; PIXELS];
        let least = tallies[0].enough.min(tallies[1].enough);
        for at in 0..PIXELS {
            if light[at] > 0.0 && certain[at] >= least {
                logs[at] = light[at].ln() + 0.5 * relative[at];
            }
        }
        tallies.each_mut().map(|tally| {
            let mut known = [false; PIXELS];
            for at in 0..PIXELS {
                known[at] = light[at] > 0.0 && certain[at] >= tally.enough;
            }
            tally.add_pixels(&known, &logs, &relative);
            if known == self.there {
                return sum_up(&known, &logs);
            }
            let mut pools = [Pool::default(); PIXELS];
            for (at, pool) in pools.iter_mut().enumerate() {
                if known[at] {
                    (pool.known, pool.logs) = (1.0, logs[at]);
                } else if self.there[at] {
                    *pool = Pool::pixel([light[at], variance[at]], noise[part_of(at)]);
                }
            }
            pool_up(&mut pools, &noise, tally)
        })
    }
}

/// Pools pixels up to the block, and counts what is known on the way.
fn pool_up(pools: &mut [Pool; PIXELS], noise: &[Noise; PARTS], tally: &mut Tally) -> Pool {
    let mut edge = BLOCK;
    while edge > 1 {
        let half = edge / 2;
        for at in 0..half * half {
            let (x, y) = (at % half * 2, at / half * 2);
            // Never before what is still to be read
            let first = y * edge + x;
            let four = [first, first + 1, first + edge, first + edge + 1];
            pools[at] = Pool::of(four.iter().map(|&at| &pools[at]), 1);
            // From 4×4 on, a block has differences enough of its own
            let noise = if half == AROUND { noise[y / AROUND * 2 + x / AROUND] } else { Noise::default() };
            pools[at].count(noise, tally);
        }
        edge = half;
    }
    pools[0]
}

/// The same of pixels that are all known, or not there: nothing is left to count.
fn sum_up(is_known: &[bool; PIXELS], logs: &Numbers) -> Pool {
    let [mut known, mut logs] = [[0.0; PIXELS], *logs];
    for at in 0..PIXELS {
        (known[at], logs[at]) = if is_known[at] { (1.0, logs[at]) } else { (0.0, 0.0) };
    }
    let mut edge = BLOCK;
    while edge > 1 {
        let half = edge / 2;
        for at in 0..half * half {
            let first = at / half * 2 * edge + at % half * 2;
            for numbers in [&mut known, &mut logs] {
                numbers[at] =
                    numbers[first] + numbers[first + 1] + numbers[first + edge] + numbers[first + edge + 1];
            }
        }
        edge = half;
    }
    Pool { known: known[0], logs: logs[0], ..Pool::default() }
}

/// What the pixels of each part tell of their noise. Those that are not there add nothing.
fn noise_of_parts(light: &Numbers, variance: &Numbers) -> [Noise; PARTS] {
    let relative = relative_variance(light, variance);
    let [mut lights, mut variances, mut relatives, mut lit] = [[0.0; PARTS]; 4];
    for within in 0..AROUND * AROUND {
        // One pixel of each part, so that their sums do not wait for each other
        for part in 0..PARTS {
            let (x, y) = (part % 2 * AROUND + within % AROUND, part / 2 * AROUND + within / AROUND);
            let at = y * BLOCK + x;
            lights[part] += light[at];
            variances[part] += variance[at];
            relatives[part] += relative[at];
            lit[part] += if light[at] == 0.0 { 0.0 } else { 1.0 };
        }
    }
    std::array::from_fn(|part| Noise {
        of_light: if lights[part] > 0.0 { variances[part] / lights[part] } else { 0.0 },
        relative: if lit[part] > 0.0 { relatives[part] / lit[part] } else { 0.0 },
    })
}

/// Variances over squares of luminances, at most 1; 0 without light.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn relative_variance(light: &Numbers, variance: &Numbers) -> Numbers {
    let mut relative = [0.0; PIXELS];
    for at in 0..PIXELS {
        let of_light = variance[at] / (light[at] * light[at]);
        let of_light = if of_light < 1.0 { of_light } else { 1.0 };
        relative[at] = if light[at] == 0.0 { 0.0 } else { of_light };
    }
    relative
}

/// How well each pixel is known by itself, and its relative variance: see [`Pool::count`].
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn weigh(light: &Numbers, variance: &Numbers, noise: &[Noise; PARTS]) -> [Numbers; 2] {
    let [mut of_light, mut of_relative, mut certain, mut relative] = [[0.0; PIXELS]; 4];
    for at in 0..PIXELS {
        let noise = &noise[part_of(at)];
        (of_light[at], of_relative[at]) = (noise.of_light, noise.relative);
    }
    for at in 0..PIXELS {
        let square = light[at] * light[at];
        let (by_light, expected) = (light[at] * of_light[at], square * of_relative[at]);
        let around = if by_light > FAR * expected { expected } else { by_light };
        let variance = if variance[at] > around { variance[at] } else { around };
        certain[at] = certainty(light[at], variance);
        relative[at] = variance / square;
    }
    [certain, relative]
}
