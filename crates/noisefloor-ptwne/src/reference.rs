//! The ray-traced reference: direct light, and what mirrors and glass show of it (Takouachet et al. 2017, §4.3). Light that was
//! scattered by a diffuse surface on its way is missing, as in the paper. Samples of it are in [`direct`](crate::direct).
//!
//! # How free of noise
//! Blocks of [`BLOCK`]² pixels are worked on each on its own. A block first learns which lights it sees. Then its pixels take samples
//! in two halves, with scrambles of their own, so that half of what the halves differ by is an estimate of the error of their mean.
//! The block goes on learning from them.
//! Pixels are shown as the path-traced picture would be, and those whose samples do most against the error take twice as many, until
//! the root mean square over the block is below [`BOUND`], or pixels have [`MOST`] samples in each half: [`ReferenceNoise`] says what
//! noise was left.
//!
//! The pixels have scrambles of their own too. With one for all, neighbours err alike: the mask has less noise at full resolution, and
//! more at the coarser scales that the oracle looks at too (`docs/benchmarks/renderer.md` of the project).
//!
//! No block knows of another, and nothing depends on threads. What two halves cannot tell is what both miss: an edge that both see
//! alike. So where neighbours differ, an error is assumed that the samples of a pixel would leave of such an edge. A highlight much
//! smaller than a pixel, which no sample of either half met, is not told.

use crate::camera::Lens;
use crate::direct::Tracer;
use crate::guide::{Found, Guide, Parts};
use crate::math::Vec3;
use crate::rng::{Key, Rng};
use crate::scene::Scene;
use glam::DVec3;
use noisefloor::{Display, NoiseMask, Rgb};
use rayon::prelude::*;
use std::ops::{ControlFlow, Range};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Side of a block: small enough that its pixels see much the same lights.
const BLOCK: usize = 16;
/// Root mean square of the errors of a block's pixels, in display values. The noise mask (σ = 1) lets 0.85 of it through: 0.3/255,
/// less than a tenth of the energy that the keenest observers see.
const BOUND: f32 = 0.36 / 255.0;
/// Fewest and most samples of each half of a pixel. With half as many, highlights smaller than a pixel were missed; its points
/// have twice as many.
const FEWEST: u32 = 32;
const MOST: u32 = 8_192;
/// Samples of each pixel from which its block learns about the lights, and how often: each time it looks where it saw some before.
const LEARNING: u32 = 8;
const LESSONS: u32 = 2;
/// What n points of a pixel leave of the contrast of an edge through it: about this times n^−¾ (measured).
const EDGE: f32 = 0.25;

/// A reference.
pub(crate) struct Picture {
    /// Row-major.
    pub(crate) pixels: Vec<Rgb>,
    pub(crate) noise: ReferenceNoise,
}

/// What a reference estimates of its own noise, from what its two halves differ by: what both miss, such as a highlight much smaller
/// than a pixel, it does not know. Units are display values: 1/255 is a step of 8 bits.
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceNoise {
    /// Samples of a pixel, both halves together, on average. Each costs a ray to a surface and up to eight from each surface on its way.
    pub samples: f64,
    /// Blocks of 16×16 pixels in a row; those at the right and bottom edges may be smaller.
    pub columns: usize,
    /// Deviation of the noise mask (σ = 1) of each block, row-major, at least 0.
    pub deviations: Vec<f32>,
    /// Blocks that have more noise than the reference promises, 0.305/255, after 16,384 samples of pixels that needed them.
    pub unsettled: usize,
}

impl ReferenceNoise {
    /// Root mean square over all blocks.
    pub fn deviation(&self) -> f32 {
        let sum: f32 = self.deviations.iter().map(|d| d * d).sum();
        (sum / self.deviations.len().max(1) as f32).sqrt()
    }

    /// The largest deviation of a block.
    pub fn worst(&self) -> f32 {
        self.deviations.iter().copied().fold(0.0, f32::max)
    }
}

/// Told after each block how many of how many are there; breaks off the work.
pub(crate) type Watch = dyn Fn(usize, usize) -> ControlFlow<()> + Send + Sync;

/// Renders the reference, or nothing if it is broken off. `display` is how the path-traced picture would be shown.
pub(crate) fn render(
    scene: &Scene,
    [width, height]: [usize; 2],
    key: Key,
    display: &Display,
    watch: &Watch,
) -> Option<Picture> {
    let lens = scene.lens(width, height);
    let parts = Parts::new(scene);
    let columns = width.div_ceil(BLOCK);
    let count = columns * height.div_ceil(BLOCK);
    let done = AtomicUsize::new(0);
    let blocks: Option<Vec<(Block<'_>, f32)>> = (0..count)
        .into_par_iter()
        .with_max_len(1)
        .map(|i| {
            let at = [i % columns * BLOCK, i / columns * BLOCK];
            let size = [BLOCK.min(width - at[0]), BLOCK.min(height - at[1])];
            let first = (at[1] * width + at[0]) as u64;
            let pixels = vec![Pixel::default(); size[0] * size[1]];
            let mut block = Block { lens: &lens, key, display, at, size, first, pixels };
            let error = block.render(&mut Tracer::new(scene, Guide::by_power(&parts)), &parts);
            match watch(done.fetch_add(1, Ordering::Relaxed) + 1, count) {
                ControlFlow::Continue(()) => Some((block, error)),
                ControlFlow::Break(()) => None,
            }
        })
        .collect();

    let through = NoiseMask::default().white_noise_gain().sqrt();
    let mut noise = ReferenceNoise { samples: 0.0, columns, deviations: vec![], unsettled: 0 };
    let mut pixels = vec![[0.0; 3]; width * height];
    let mut samples = 0;
    for (block, error) in blocks? {
        for (row, from) in block.pixels.chunks(block.size[0]).enumerate() {
            let start = (block.at[1] + row) * width + block.at[0];
            for (to, pixel) in pixels[start..].iter_mut().zip(from) {
                *to = pixel.mean();
                samples += 2 * u64::from(pixel.count);
            }
        }
        noise.deviations.push(error * through);
        noise.unsettled += usize::from(error > BOUND);
    }
    noise.samples = samples as f64 / pixels.len() as f64;
    Some(Picture { pixels, noise })
}

/// Sums of samples, of two halves that have the same number.
#[derive(Clone, Copy, Debug, Default)]
struct Pixel {
    halves: [DVec3; 2],
    count: u32,
}

impl Pixel {
    fn mean(&self) -> Rgb {
        ((self.halves[0] + self.halves[1]) / f64::from(2 * self.count)).as_vec3().to_array()
    }

    /// What is shown of each half.
    fn shown(&self, display: &Display) -> [f32; 2] {
        self.halves.map(|sum| display.luma((sum / f64::from(self.count)).as_vec3().to_array()))
    }
}

/// A block of pixels.
struct Block<'a> {
    lens: &'a Lens,
    key: Key,
    display: &'a Display,
    /// Its corner in the image.
    at: [usize; 2],
    size: [usize; 2],
    /// Number of its first pixel, for random numbers.
    first: u64,
    /// Row-major.
    pixels: Vec<Pixel>,
}

impl Block<'_> {
    /// Renders the block, and estimates the root mean square of its pixels' errors.
    fn render<'s>(&mut self, tracer: &mut Tracer<'s>, parts: &'s Parts<'s>) -> f32 {
        let choosy = parts.len() > 1;
        let mut found = choosy.then(|| self.learn(tracer, parts));
        let mut todo: Vec<usize> = (0..self.pixels.len()).collect();
        loop {
            tracer.found = found;
            for p in todo {
                let range = self.pixels[p].count..(2 * self.pixels[p].count).max(FEWEST);
                self.pixels[p].count = range.end;
                for half in 0..2 {
                    let sum = self.sum(tracer, p, half as u64, range.clone());
                    self.pixels[p].halves[half] += sum;
                }
            }
            // For the next: a light that was missed so far is found seldom, and weighs much
            found = tracer.found.take();
            if let Some(found) = &found {
                tracer.guide = Guide::learned(parts, found);
            }
            let errors = self.errors();
            let total: f32 = errors.iter().sum();
            let error = (total / errors.len() as f32).sqrt();
            // Those whose next sample does most: as many as would leave half of what is allowed, were they exact
            let gain = |p: usize| errors[p] / self.pixels[p].count as f32;
            let mut order: Vec<usize> = (0..errors.len()).filter(|p| self.pixels[*p].count < MOST).collect();
            if error <= BOUND || order.is_empty() {
                return error;
            }
            order.sort_by(|a, b| gain(*b).total_cmp(&gain(*a)));
            let mut rest = total;
            order.retain(|p| {
                let needed = rest > 0.5 * BOUND * BOUND * errors.len() as f32;
                rest -= errors[*p];
                needed
            });
            todo = order;
        }
    }

    /// Learns which lights the block sees.
    fn learn<'s>(&self, tracer: &mut Tracer<'s>, parts: &'s Parts<'s>) -> Found {
        let mut found = Found::new(parts);
        for lesson in 0..LESSONS {
            tracer.found = Some(found);
            for p in 0..self.pixels.len() {
                self.sum(tracer, p, 2, lesson * LEARNING..(lesson + 1) * LEARNING);
            }
            found = tracer.found.take().unwrap_or_else(|| Found::new(parts));
            tracer.guide = Guide::learned(parts, &found);
        }
        found
    }

    /// The sum of some samples of pixel `p`, from one of several sequences.
    fn sum(&self, tracer: &mut Tracer<'_>, p: usize, sequence: u64, samples: Range<u32>) -> DVec3 {
        let at = [self.at[0] + p % self.size[0], self.at[1] + p / self.size[0]];
        // Samples of the path tracer count from the other end
        let seed = Rng::new(self.key, self.first + p as u64, !sequence).next();
        samples.map(|index| tracer.sample(self.lens, at, index, seed)).map(Vec3::as_dvec3).sum()
    }

    /// Estimates of the squared errors of all pixels. As two halves say little about one pixel, it shares with its neighbours: not
    /// the error, but the error of a single sample, as they may have more or fewer.
    fn errors(&self) -> Vec<f32> {
        let shown: Vec<[f32; 2]> = self.pixels.iter().map(|p| p.shown(self.display)).collect();
        let single = |p: usize| {
            let count = self.pixels[p].count as f32;
            let means = self.around(p).map(|q| 0.5 * (shown[q][0] + shown[q][1]));
            let (low, high) = means.fold((f32::MAX, f32::MIN), |(low, high), x| (low.min(x), high.max(x)));
            let edge = EDGE * (high - low) * count.powf(-0.75);
            let error = 0.5 * (shown[p][0] - shown[p][1]);
            error.abs().max(edge).powi(2) * count
        };
        let singles: Vec<f32> = (0..shown.len()).map(single).collect();
        let shared = |p: usize| {
            let (sum, n) = self.around(p).fold((0.0, 0.0), |(sum, n), q| (sum + singles[q], n + 1.0));
            sum / (n * self.pixels[p].count as f32)
        };
        (0..shown.len()).map(shared).collect()
    }

    /// A pixel and its neighbours in the block.
    fn around(&self, p: usize) -> impl Iterator<Item = usize> + use<> {
        let [width, height] = self.size;
        let near = |i: usize, n: usize| i.saturating_sub(1)..(i + 2).min(n);
        near(p / width, height).flat_map(move |y| near(p % width, width).map(move |x| y * width + x))
    }
}
