//! The ray-traced reference: direct light, also as seen in mirrors and glass (Takouachet et al. 2017, §4.3).
//! As in the paper, light that a diffuse surface scattered on its way is missing. [`direct`](crate::direct)
//! takes the samples.
//!
//! # How free of noise
//! Blocks of [`BLOCK`]² pixels are rendered independently. A block first learns which lights it sees. Its
//! pixels then take samples in two halves, each with its own scrambling, so that half the difference of the
//! halves estimates the error of their mean. The block keeps learning from these samples.
//!
//! Pixels are displayed as the path-traced picture would be. Those whose samples reduce the error most take
//! twice as many, until the root mean square error of the block is below [`BOUND`], or pixels have
//! [`MAX_SAMPLES`] samples in each half. [`ReferenceNoise`] reports the noise that was left.
//!
//! Each pixel has its own scrambling too. If all shared one, neighbours would err alike: the noise mask would
//! have less energy at full resolution, and more at the coarser scales that the oracle looks at too.
//!
//! Blocks do not depend on each other, nor on threads. Two halves cannot detect what both miss, such as an
//! edge that both see alike. Where neighbours differ, a pixel is therefore assumed to have the error that its
//! samples would leave of such an edge. A highlight much smaller than a pixel that no sample hit goes
//! undetected.

use crate::camera::Lens;
use crate::direct::Tracer;
use crate::guide::{Contributions, Guide, LightStrata};
use crate::math::Vec3;
use crate::rng::{Key, Rng};
use crate::scene::Scene;
use glam::DVec3;
use noisefloor::{Rgb, descriptor::NoiseMask, display::Display};
use rayon::prelude::*;
use std::ops::{ControlFlow, Range};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Edge of a block: small enough for its pixels to see much the same lights.
const BLOCK: usize = 16;
/// Root mean square error of a block's pixels, in display values. The noise mask (σ = 1) passes 0.85 of it:
/// 0.3/255, less than a tenth of the energy that the most demanding observers see.
const BOUND: f32 = 0.36 / 255.0;
/// Fewest and most samples of each half of a pixel. With half as many at least, highlights smaller than a
/// pixel were missed; a Sobol sequence has twice as many points as the most.
const MIN_SAMPLES: u32 = 32;
const MAX_SAMPLES: u32 = 8_192;
/// Samples of each pixel from which its block learns about the lights, and how often: each time, it looks
/// where it has found light before.
const LEARNING: u32 = 8;
const LESSONS: u32 = 2;
/// n samples of a pixel leave about this times n^−¾ of the contrast of an edge through it (measured).
const EDGE: f32 = 0.25;

pub(crate) struct Picture {
    /// Row-major.
    pub(crate) pixels: Vec<Rgb>,
    pub(crate) noise: ReferenceNoise,
}

/// A reference's estimate of its own noise, from the difference of its halves. What both halves miss, such as
/// a highlight much smaller than a pixel, is not included. Units are display values: 1/255 is one step of 8
/// bits.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ReferenceNoise {
    /// Mean number of samples per pixel, in both halves together. Each costs one camera ray, and up to eight
    /// rays from each surface on its path.
    pub samples: f64,
    /// Number of blocks of 16×16 pixels in a row. Those at the right and bottom edges may be smaller.
    pub columns: usize,
    /// Standard deviation of the noise mask (σ = 1) of each block, row-major, at least 0.
    pub deviations: Vec<f32>,
    /// Number of blocks with more noise than the reference promises, 0.305/255, although pixels that needed
    /// them took 16,384 samples.
    pub unsettled: usize,
}

impl ReferenceNoise {
    /// Root mean square of the deviations of all blocks.
    pub fn deviation(&self) -> f32 {
        let sum: f32 = self.deviations.iter().map(|d| d * d).sum();
        (sum / self.deviations.len().max(1) as f32).sqrt()
    }

    /// The largest deviation of a block.
    pub fn worst(&self) -> f32 {
        self.deviations.iter().copied().fold(0.0, f32::max)
    }
}

/// Called after each block with the number of finished blocks and that of all; can cancel the rest.
pub(crate) type Watch = dyn Fn(usize, usize) -> ControlFlow<()> + Send + Sync;

/// Renders the reference; `None` if it was cancelled. `display` shows it as the path-traced picture would be
/// shown.
pub(crate) fn render(
    scene: &Scene,
    [width, height]: [usize; 2],
    key: Key,
    display: &Display,
    watch: &Watch,
) -> Option<Picture> {
    let lens = scene.lens(width, height);
    let strata = LightStrata::new(scene);
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
            let error = block.render(&mut Tracer::new(scene, Guide::by_power(&strata)), &strata);
            match watch(done.fetch_add(1, Ordering::Relaxed) + 1, count) {
                ControlFlow::Continue(()) => Some((block, error)),
                ControlFlow::Break(()) => None,
            }
        })
        .collect();

    let gain = NoiseMask::default().white_noise_gain().sqrt();
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
        noise.deviations.push(error * gain);
        noise.unsettled += usize::from(error > BOUND);
    }
    noise.samples = samples as f64 / pixels.len() as f64;
    Some(Picture { pixels, noise })
}

/// Sums of samples, in two halves with the same number of samples.
#[derive(Clone, Copy, Debug, Default)]
struct Pixel {
    halves: [DVec3; 2],
    count: u32,
}

impl Pixel {
    fn mean(&self) -> Rgb {
        ((self.halves[0] + self.halves[1]) / f64::from(2 * self.count)).as_vec3().to_array()
    }

    /// The display value of each half.
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
    /// Index of its first pixel, for random numbers.
    first: u64,
    /// Row-major.
    pixels: Vec<Pixel>,
}

impl Block<'_> {
    /// Renders the block, and estimates the root mean square error of its pixels.
    fn render<'s>(&mut self, tracer: &mut Tracer<'s>, strata: &'s LightStrata<'s>) -> f32 {
        let mut found = (strata.len() > 1).then(|| self.learn(tracer, strata));
        let mut todo: Vec<usize> = (0..self.pixels.len()).collect();
        loop {
            tracer.found = found;
            for p in todo {
                let range = self.pixels[p].count..(2 * self.pixels[p].count).max(MIN_SAMPLES);
                self.pixels[p].count = range.end;
                for half in 0..2 {
                    let sum = self.sum(tracer, p, half as u64, range.clone());
                    self.pixels[p].halves[half] += sum;
                }
            }
            // For the next samples: a light that was missed so far is found rarely, and weighs much
            found = tracer.found.take();
            if let Some(found) = &found {
                tracer.guide = Guide::learned(strata, found);
            }
            let errors = self.errors();
            let total: f32 = errors.iter().sum();
            let error = (total / errors.len() as f32).sqrt();
            // Choose the pixels whose next sample reduces the error most: as many as would leave half of what
            // is allowed if they were exact
            let gain = |p: usize| errors[p] / self.pixels[p].count as f32;
            let mut order: Vec<usize> =
                (0..errors.len()).filter(|p| self.pixels[*p].count < MAX_SAMPLES).collect();
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
    fn learn<'s>(&self, tracer: &mut Tracer<'s>, strata: &'s LightStrata<'s>) -> Contributions {
        let mut found = Contributions::new(strata);
        for lesson in 0..LESSONS {
            tracer.found = Some(found);
            for p in 0..self.pixels.len() {
                self.sum(tracer, p, 2, lesson * LEARNING..(lesson + 1) * LEARNING);
            }
            found = tracer.found.take().unwrap_or_else(|| Contributions::new(strata));
            tracer.guide = Guide::learned(strata, &found);
        }
        found
    }

    /// The sum of some samples of pixel `p`, from one of several sequences.
    fn sum(&self, tracer: &mut Tracer<'_>, p: usize, sequence: u64, samples: Range<u32>) -> DVec3 {
        let at = [self.at[0] + p % self.size[0], self.at[1] + p / self.size[0]];
        // The path tracer counts its samples from the other end
        let seed = Rng::new(self.key, self.first + p as u64, !sequence).next();
        samples.map(|index| tracer.sample(self.lens, at, index, seed)).map(Vec3::as_dvec3).sum()
    }

    /// Estimates of the squared errors of all pixels. Since two halves say little about one pixel, it
    /// averages with its neighbours; not the error, but the error of a single sample, since they may have
    /// more or fewer samples.
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
