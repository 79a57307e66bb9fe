//! The log-average luminance of a picture that is still noisy: what it will be once the picture has
//! converged.
//!
//! The mean of a logarithm is bent by noise: a pixel whose light has not been met is left out or counts
//! as nearly black, and a noisy one counts as too dark. So a logarithm is taken only of what is known. A
//! pixel that is known by itself counts by itself. Those of a block of 2×2 that are not are pooled; if
//! their mean is not known either, they go on to 4×4, 8×8 and so on. Dark pixels beside bright ones are
//! so pooled with other dark pixels. Sums are kept on the way, so that sorting pixels by their own noisy
//! values bends the result by the second order at most.

use crate::rgb::{Rgb, luminance};
use multiversion::multiversion;
use rayon::prelude::*;

mod block;
pub(crate) use block::{NoisyBlock, PIXELS};

/// δ of the log-average (Reinhard et al. 2002, eq. 1), as a share of the geometric mean of the luminances
/// above zero. There it keeps black pixels from a logarithm of 0; here, those do not count. The paper leaves δ absolute; a relative one makes the unit of radiance irrelevant, and a
/// geometric mean withstands fireflies.
pub(super) const DELTA: f64 = 1e-4;

/// Less than this share of a picture's light, which is its mean of square roots, squared, counts as none, as black does: the
/// highlight of a smooth metal falls off by thirty decades, and most of its geometric mean would be of light that no
/// screen shows. Fireflies hardly lift a mean of roots.
const FAINT: f64 = 1e-4;

/// Squared ratio of a mean to its standard error from which it is known. With a larger one, blocks are
/// larger, and what the picture changes by within them counts as too bright; with a smaller one, pixels
/// are sorted by their noise, and count as too dark. Of 6 to 48, 6 to 9 did best.
const ENOUGH: f64 = 8.0;
/// Edge of the blocks that are pooled first, pixel by pixel.
pub(crate) const BLOCK: usize = 8;
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

/// Blocks of each grid that are looked at first, of a picture that has more.
const LOOKED_AT: usize = 2048;
/// Standard error of the logarithm, by looking at so few, from which four times as many are looked at: half of what
/// sessions let it have in all. A checkerboard whose squares are as large as blocks has it, and few pictures.
const SAMPLED: f64 = 0.0075;

/// Where blocks of four grids begin: what a block has of both sides of an edge is then not left to chance.
const GRIDS: [(usize, usize); 4] = [(0, 0), (21, 9), (42, 51), (11, 33)];

/// Logarithm of the least light that counts beside light with this mean of square roots.
pub(super) fn faintest(mean_root: f64) -> f64 {
    (FAINT * mean_root * mean_root).ln()
}

/// How much light of this logarithm counts: fully from e times the least on, so that no step bends a picture whose light falls
/// off through all decades.
pub(super) fn counted(log: f64, faintest: f64) -> f64 {
    (log - faintest).clamp(0.0, 1.0)
}

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
#[inline(always)]
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
    #[inline]
    fn of<'a>(blocks: impl Iterator<Item = &'a Self> + Clone, least: usize) -> Self {
        let (mut all, mut lit_blocks, mut any_black) = (Self::default(), 0, false);
        for one in blocks.clone() {
            all.lit += one.lit;
            all.sum += one.sum;
            all.variance += one.variance;
            all.expected += one.expected;
            all.known += one.known;
            all.logs += one.logs;
            lit_blocks += usize::from(one.lit > 0.0);
            any_black |= one.black > 0.0;
        }
        if !any_black {
            return all;
        }
        let (lit, met) = (all.lit, certainty(all.sum, all.variance));
        for &Self { black, .. } in blocks.filter(|block| block.black > 0.0) {
            if lit_blocks >= least && black <= lit && black * met < MISSED * lit {
                all.lit += black;
            } else {
                all.black += black;
            }
        }
        all
    }

    /// Counts the pixels if their mean is known: by its own variance, and by that of the pixels around
    /// it, which grows with the light or with its square.
    #[inline]
    fn count(&mut self, noise: Noise, tally: &mut Tally) {
        if self.lit == 0.0 {
            return;
        }
        // Light of another order beside a pixel says nothing of it; rare light that it has not met does
        let by_light = self.sum * noise.of_light;
        let around = if by_light > FAR * self.expected { self.expected } else { by_light };
        let variance = self.variance.max(around);
        if !(self.sum > 0.0 && certainty(self.sum, variance) >= tally.enough) {
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

/// Bins of a logarithm: all that an f32 can have, and sums of many.
const BINS: i32 = 256;

/// Known pixels by their logarithms.
#[derive(Clone, Debug)]
struct Tally {
    /// [`ENOUGH`], or another.
    enough: f64,
    /// Pixels, the sum of their logarithms, and its squared standard error.
    bins: Vec<[f64; 3]>,
}

impl Tally {
    fn new(enough: f64) -> Self {
        Self { enough, bins: vec![[0.0; 3]; BINS as usize] }
    }

    fn add(&mut self, pixels: f64, log: f64, relative: f64) {
        let [count, sum, variance] = &mut self.bins[Self::bin(log)];
        *count += pixels;
        *sum += pixels * log;
        *variance += pixels * pixels * relative;
    }

    /// The same of single pixels, those that are known.
    fn add_pixels(&mut self, known: &[bool; PIXELS], logs: &[f64; PIXELS], relative: &[f64; PIXELS]) {
        // Neighbours are mostly of one bin, which need not be written each time
        let mut bin = 0;
        let mut here = self.bins[bin];
        for ((&log, relative), _) in logs.iter().zip(relative).zip(known).filter(|(_, known)| **known) {
            let next = Self::bin(log);
            if next != bin {
                self.bins[bin] = here;
                (bin, here) = (next, self.bins[next]);
            }
            here = [here[0] + 1.0, here[1] + log, here[2] + relative];
        }
        self.bins[bin] = here;
    }

    fn bin(log: f64) -> usize {
        // The floor, without the call that `floor` is
        let whole = log as i32;
        (whole - i32::from(f64::from(whole) > log) + BINS / 2).clamp(0, BINS - 1) as usize
    }

    fn merge(&mut self, other: &Self) {
        for (bin, other) in self.bins.iter_mut().zip(&other.bins) {
            bin.iter_mut().zip(other).for_each(|(sum, other)| *sum += other);
        }
    }

    /// Over all bins, of pixels, the sum of their logarithms, or its squared standard error.
    fn sum(&self, of: usize) -> f64 {
        self.bins.iter().map(|bin| bin[of]).sum()
    }

    /// Takes out what counts as black beside the rest; the logarithm of the least light that does not. Within a bin, all are
    /// alike.
    fn drop_faint(&mut self) -> f64 {
        let root =
            |&[count, sum, _]: &[f64; 3]| if count > 0.0 { count * (0.5 * sum / count).exp() } else { 0.0 };
        let faintest = faintest(self.bins.iter().map(root).sum::<f64>() / self.sum(0));
        for bin in self.bins.iter_mut().filter(|bin| bin[0] > 0.0) {
            let weight = counted(bin[1] / bin[0], faintest);
            *bin = [weight * bin[0], weight * bin[1], weight * weight * bin[2]];
        }
        faintest
    }

    /// exp(mean ln(δ + L)): see [`super::log_average`]. Within a bin, all are alike to δ.
    fn log_average(&self) -> f64 {
        let pixels = self.sum(0);
        let mean = self.sum(1) / pixels;
        let lifted = |&[count, sum, _]: &[f64; 3]| {
            if count > 0.0 { sum + count * (DELTA * (mean - sum / count).exp()).ln_1p() } else { 0.0 }
        };
        (self.bins.iter().map(lifted).sum::<f64>() / pixels).exp()
    }
}

/// The log-average of the converged picture, from one of `width`×`height` pixels; `None` if all is black.
/// `pixel(x, y)` is `None` where there is no sample.
pub(crate) fn estimate(
    size: (usize, usize),
    pixel: impl Fn(usize, usize) -> Option<NoisyPixel> + Sync,
) -> Option<LogAverage> {
    estimate_by_blocks(size, |corner| NoisyBlock::gather(corner, size, &pixel))
}

/// The same, of a picture that gives the blocks that begin at pixels, which may lie before its first.
pub(crate) fn estimate_by_blocks(
    size: (usize, usize),
    block: impl Fn([isize; 2]) -> NoisyBlock + Sync,
) -> Option<LogAverage> {
    let mut most = LOOKED_AT;
    loop {
        match by_blocks(size, most, &block) {
            Some((found, sampled)) if sampled <= SAMPLED => return Some(found),
            None if Lattice::is_whole(size, most) => return None,
            _ => most *= 4,
        }
    }
}

/// The same by so many blocks of each grid at most, and the standard error of its logarithm by these being a sample.
fn by_blocks(
    size: (usize, usize),
    most: usize,
    block: &(impl Fn([isize; 2]) -> NoisyBlock + Sync),
) -> Option<(LogAverage, f64)> {
    let grids: Vec<[Option<LogAverage>; 2]> = (0..GRIDS.len())
        .into_par_iter()
        .map(|grid| on_grid(&Lattice::new(size, grid, most), block))
        .collect();
    let [found, coarse] = [0, 1].map(|i| grids.iter().filter_map(|of| of[i]).collect::<Vec<LogAverage>>());
    let mean = mean_log(&found)?;
    let count = found.len() as f64;
    let scatter = found.iter().map(|one| (one.value.ln() - mean).powi(2)).sum::<f64>();
    // Grids that look at all differ by where blocks begin; others are a sample
    let whole = Lattice::is_whole(size, most);
    let scatter = scatter / if whole { count } else { (count - 1.0).max(1.0) };
    let error = found.iter().map(|one| one.error * one.error).sum::<f64>() / count;
    let bent = BENT * (mean_log(&coarse)? - mean);
    let error = (error + scatter / count + bent * bent).sqrt();
    let sampled = match found.len() {
        _ if whole => 0.0,
        // A sample that met no light
        met if met < GRIDS.len() => f64::INFINITY,
        _ => (scatter / count).sqrt(),
    };
    Some((LogAverage { value: mean.exp(), error }, sampled))
}

fn mean_log(found: &[LogAverage]) -> Option<f64> {
    let sum = found.iter().map(|one| one.value.ln()).sum::<f64>();
    (!found.is_empty()).then(|| sum / found.len() as f64)
}

/// The blocks of a grid that are looked at.
///
/// Of a large picture, not all: what half a million pixels say is known well enough, as a rule, and a look at all
/// takes longer than a verdict. The places where a block may begin, up to seven pixels before the picture, are divided
/// into as many cells, and a block begins anywhere in its cell: each pixel is as likely to be met, and nothing regular
/// in the picture is met or missed regularly. What grids that look at other blocks differ by is in the error.
struct Lattice {
    size: (usize, usize),
    grid: usize,
    /// Blocks, or cells of one block each, across and down.
    cells: (usize, usize),
    whole: bool,
}

impl Lattice {
    /// With so many blocks of all pixels at most.
    fn new((width, height): (usize, usize), grid: usize, most: usize) -> Self {
        let (dx, dy) = GRIDS[grid];
        let (across, down) = ((width + dx).div_ceil(BLOCK), (height + dy).div_ceil(BLOCK));
        let whole = Self::is_whole((width, height), most);
        let share = (most as f64 * (BLOCK * BLOCK) as f64 / (width as f64 * height as f64)).sqrt();
        let cells = |edge: usize| (((edge / BLOCK) as f64 * share) as usize).max(1);
        let cells = if whole { (across, down) } else { (cells(width), cells(height)) };
        Self { size: (width, height), grid, cells, whole }
    }

    /// Whether all of a picture of this size is looked at.
    fn is_whole((width, height): (usize, usize), most: usize) -> bool {
        width * height <= most * BLOCK * BLOCK
    }

    /// Where a block begins, which may be before the picture.
    fn block(&self, column: usize, row: usize) -> [isize; 2] {
        let (dx, dy) = GRIDS[self.grid];
        if self.whole {
            return [(column, dx), (row, dy)].map(|(at, before)| (at * BLOCK) as isize - before as isize);
        }
        let somewhere = scattered((row * self.cells.0 + column) * GRIDS.len() + self.grid);
        let place = |cell: usize, cells: usize, edge: usize, somewhere: u64| {
            let [from, to] = [cell, cell + 1].map(|cell| cell * (edge + BLOCK - 1) / cells);
            (from + somewhere as usize % (to - from)) as isize - (BLOCK - 1) as isize
        };
        let x = place(column, self.cells.0, self.size.0, somewhere & 0xffff_ffff);
        let y = place(row, self.cells.1, self.size.1, somewhere >> 32);
        [x, y]
    }
}

/// A number without order: the last step of splitmix64 (Steele, Lea and Flood 2014).
fn scattered(number: usize) -> u64 {
    let mut z = (number as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The same by the blocks of one grid: with [`ENOUGH`], and with twice as much.
fn on_grid(lattice: &Lattice, block: &(impl Fn([isize; 2]) -> NoisyBlock + Sync)) -> [Option<LogAverage>; 2] {
    let row_of_cells = |row: usize| {
        let mut tallies = [ENOUGH, 2.0 * ENOUGH].map(Tally::new);
        let pool = |column: usize| block(lattice.block(column, row)).pool(&mut tallies);
        let pools: Vec<[Pool; 2]> = (0..lattice.cells.0).map(pool).collect();
        (pools, tallies)
    };
    let parts: Vec<_> = (0..lattice.cells.1).into_par_iter().map(row_of_cells).collect();
    [0, 1].map(|i| {
        // In their order, so that the sums are the same with any number of threads
        let mut tally = Tally::new(parts[0].1[i].enough);
        parts.iter().for_each(|(_, tallies)| tally.merge(&tallies[i]));
        let pools = parts.iter().flat_map(|(pools, _)| pools.iter().map(|pools| pools[i])).collect();
        over_all(pools, lattice.cells, tally)
    })
}

/// Pools blocks up to one of the whole picture.
fn over_all(
    mut pools: Vec<Pool>,
    (mut across, mut down): (usize, usize),
    mut tally: Tally,
) -> Option<LogAverage> {
    while pools.len() > 1 {
        pools = halved(&pools, (across, down), &mut tally);
        (across, down) = (across.div_ceil(2), down.div_ceil(2));
    }
    let rest = pools.first().copied().unwrap_or_default();
    let rest_mean = rest.sum / rest.lit;
    if tally.sum(0) == 0.0 {
        return (rest_mean > 0.0).then_some(LogAverage { value: rest_mean, error: UNKNOWN });
    }
    let faintest = tally.drop_faint();
    let known = tally.sum(0);
    let unknown = if rest_mean > 0.0 { rest.lit * counted(rest_mean.ln(), faintest) } else { rest.lit };
    let error = (tally.sum(2).sqrt() / known).hypot(UNKNOWN * unknown / (unknown + known));
    Some(LogAverage { value: tally.log_average(), error })
}

/// Blocks of twice the edge.
fn halved(pools: &[Pool], (columns, rows): (usize, usize), tally: &mut Tally) -> Vec<Pool> {
    let mut larger = Vec::with_capacity(columns.div_ceil(2) * rows.div_ceil(2));
    for y in (0..rows).step_by(2) {
        for x in (0..columns).step_by(2) {
            let inside = |&(x, y): &(usize, usize)| x < columns && y < rows;
            let four = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)].into_iter().filter(inside);
            let mut pool = Pool::of(four.map(|(x, y)| &pools[y * columns + x]), LIT_BESIDE);
            pool.count(Noise::default(), tally);
            larger.push(pool);
        }
    }
    larger
}

/// Two renderings of one picture, of so many samples per pixel each, at one pixel: their mean and its
/// standard deviation.
pub(crate) fn of_halves([(a, na), (b, nb)]: [(Rgb, f64); 2]) -> Option<NoisyPixel> {
    let all = na + nb;
    if all.is_nan() || all <= 0.0 {
        return None;
    }
    let [luminance, deviation] = of_luminances([a, b].map(|half| f64::from(luminance(half))), [na, nb]);
    Some(NoisyPixel { luminance, deviation: Some(deviation) })
}

/// The same of a whole block, of two renderings of so many samples per pixel.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
pub(crate) fn block_of_halves([a, b]: &[[Rgb; PIXELS]; 2], counts: &[[f64; PIXELS]; 2]) -> NoisyBlock {
    let nothing = [0.0; PIXELS];
    let mut block = NoisyBlock { luminance: nothing, deviation: nothing, there: [false; PIXELS] };
    for at in 0..PIXELS {
        let light = [f64::from(luminance(a[at])), f64::from(luminance(b[at]))];
        let counts = [counts[0][at], counts[1][at]];
        [block.luminance[at], block.deviation[at]] = of_luminances(light, counts);
        block.there[at] = counts[0] + counts[1] > 0.0 && block.luminance[at].is_finite();
    }
    block
}

/// Mean and standard deviation of two luminances, by so many samples.
#[inline(always)]
fn of_luminances([a, b]: [f64; 2], [na, nb]: [f64; 2]) -> [f32; 2] {
    let all = na + nb;
    let mean = (na * a + nb * b) / all;
    // A − B has σ²·(n_A + n_B)/(n_A·n_B), the mean of all σ²/(n_A + n_B). One half alone says nothing of
    // its noise.
    let both = (a - b).abs() * (na * nb).sqrt() / all;
    let deviation = if na > 0.0 && nb > 0.0 { both } else { mean };
    [mean as f32, deviation as f32]
}

#[cfg(test)]
mod tests;
