//! Relative standard error with confidence, as in Mitsuba 0.6.

use crate::pixels::{DEFAULT_SHARE, Seen, enough, need_of_share, verdict};
use noisefloor::{
    CriterionError, Film, Needs, Rgb, StoppingCriterion, Tile, Verdict, View, luminance,
};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// Default of [`RelativeError::error`] (`maxError` of Mitsuba 0.6).
pub const DEFAULT_ERROR: f64 = 0.05;
/// Default of [`RelativeError::confidence`] (`pValue` 0.05 of Mitsuba 0.6).
pub const DEFAULT_CONFIDENCE: f64 = 0.95;
/// Pixels darker than this share of the average luminance are held to it.
const DARK: f64 = 0.01;

/// The condition of Mitsuba 0.6's adaptive integrator (`integrators/misc/adaptive.cpp`), on luminance.
///
/// A pixel is done when t·√(s²/n) ≤ `error`·max(mean, 1 % of the average luminance of the picture), where s² estimates the
/// variance of one sample, and t is the two-sided quantile for `confidence`. A tile is done when a `share` of its pixels is.
///
/// Mitsuba sees each sample; here a verdict sees the means of the batches since the last one, one of each half. For k batches of
/// n₁ … n_k samples with means b₁ … b_k and weighted mean M = Σnᵢbᵢ/Σnᵢ, E Σnᵢ(bᵢ − M)² = Σnᵢ(Var bᵢ − Var M)
/// = Σnᵢ(σ²/nᵢ − σ²/Σnᵢ) = (k − 1)·σ², so that s² = Σnᵢ(bᵢ − M)²/(k − 1) is unbiased however uneven the batches. It has k − 1
/// degrees of freedom and not n − 1, wherefore t is Student's, which holds the confidence that is asked for, in place of the
/// normal distribution that Mitsuba's hundreds of samples warrant. A pixel is judged anew by each verdict.
///
/// Memory: 72 bytes a pixel beside the film.
#[derive(Clone, Debug)]
pub struct RelativeError {
    /// Largest relative half-width of the confidence interval, above 0.
    pub error: f64,
    /// Confidence, in (0, 1).
    pub confidence: f64,
    /// Share of a tile's pixels that have to be done, in (0, 1].
    pub share: f64,
    seen: Seen,
    /// Of each pixel of each tile; empty until the tile is judged first.
    pixels: Vec<Vec<Batches>>,
}

impl RelativeError {
    /// The condition with its own constant, a confidence of 95 %, and 95 % of a tile's pixels.
    pub fn new(error: f64) -> Self {
        Self {
            error,
            confidence: DEFAULT_CONFIDENCE,
            share: DEFAULT_SHARE,
            seen: Seen::default(),
            pixels: Vec::new(),
        }
    }
}

impl Default for RelativeError {
    fn default() -> Self {
        Self::new(DEFAULT_ERROR)
    }
}

/// Batches of one pixel so far (West 1979: weighted mean and sum of squares, updated).
#[derive(Clone, Copy, Debug, Default)]
struct Batches {
    /// Mean and samples of each half when last looked at.
    halves: [(f64, u64); 2],
    count: u32,
    samples: f64,
    mean: f64,
    squares: f64,
}

impl Batches {
    fn look(&mut self, halves: [(Rgb, u64); 2]) {
        for (before, (now, samples)) in self.halves.iter_mut().zip(halves) {
            let after = (f64::from(luminance(now)), samples);
            let new = after.1.saturating_sub(before.1);
            if new > 0 {
                let (n, m) = (after.1 as f64, before.1 as f64);
                let batch = (after.0 * n - before.0 * m) / new as f64;
                *before = after;
                self.count += 1;
                self.samples += new as f64;
                let step = batch - self.mean;
                self.mean += step * new as f64 / self.samples;
                self.squares += step * (batch - self.mean) * new as f64;
            }
        }
    }

    /// Estimate of the variance of one sample; `None` from fewer than two batches.
    fn variance(&self) -> Option<f64> {
        (self.count > 1).then(|| self.squares.max(0.0) / f64::from(self.count - 1))
    }
}

/// Two-sided quantiles of Student's t by degrees of freedom, beginning at 1; the normal one comes last, and stands for all above.
fn quantiles(confidence: f64, degrees: usize) -> Vec<f64> {
    let tail = 0.5 + 0.5 * confidence.clamp(0.0, 1.0 - f64::EPSILON);
    let student = |k: usize| StudentsT::new(0.0, 1.0, k as f64).map_or(f64::INFINITY, |t| t.inverse_cdf(tail));
    let mut all: Vec<f64> = (1..=degrees).into_par_iter().map(student).collect();
    all.push(Normal::standard().inverse_cdf(tail));
    all
}

/// Degrees of freedom from which Student's t is taken for normal: its quantiles are then within 1 % for any confidence to 99.9 %.
const NORMAL: usize = 300;

/// Mean luminance of the picture.
fn average_luminance(film: &Film) -> f64 {
    let image = film.image();
    image.iter().map(|&p| f64::from(luminance(p))).sum::<f64>() / image.len() as f64
}

impl StoppingCriterion for RelativeError {
    fn name(&self) -> String {
        format!("relative error {} at {} %", self.error, 100.0 * self.confidence)
    }

    fn needs(&self) -> Needs {
        Needs { halves: true, reference: false }
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let (film, grid) = (view.film, view.film.grid());
        if self.seen.renew(film) {
            self.pixels = vec![Vec::new(); grid.len()];
        }
        // Take in the new batches.
        let mut work: Vec<(Tile, Vec<Batches>)> =
            tiles.iter().map(|&t| (t, std::mem::take(&mut self.pixels[t.index]))).collect();
        work.par_iter_mut().for_each(|(tile, pixels)| {
            pixels.resize(tile.pixels(), Batches::default());
            for (batches, pixel) in pixels.iter_mut().zip(tile.rows(grid.width()).flatten()) {
                batches.look(film.pixel_halves(tile.index, pixel));
            }
        });

        // Judge.
        let most = work.iter().flat_map(|(_, pixels)| pixels).map(|p| p.count as usize).max().unwrap_or(0);
        let quantiles = quantiles(self.confidence, most.min(NORMAL));
        let normal = quantiles[quantiles.len() - 1];
        let dark = DARK * average_luminance(film);
        let judge = |(tile, pixels): &(Tile, Vec<Batches>)| {
            let samples = film.samples(tile.index);
            // Half-width of the confidence interval over that allowed, and samples needed for it to be 1 by the normal quantile.
            let ratio = |p: &Batches| {
                let Some(variance) = p.variance() else { return (f64::INFINITY, f64::INFINITY) };
                let deviation = (variance / p.samples).sqrt();
                let allowed = self.error * p.mean.max(dark).max(0.0);
                if deviation == 0.0 {
                    return (0.0, 0.0);
                }
                let t = quantiles.get(p.count as usize - 2).copied().unwrap_or(normal);
                (t * deviation / allowed, samples as f64 * (normal * deviation / allowed).powi(2))
            };
            let (ratios, needs): (Vec<f64>, Vec<f64>) = pixels.iter().map(ratio).unzip();
            let passed = ratios.iter().filter(|&&r| r <= 1.0).count();
            let converged = enough(passed, tile.pixels(), self.share);
            verdict(converged, if converged { Some(samples) } else { need_of_share(needs, self.share) })
        };
        let verdicts = work.par_iter().map(judge).collect();
        for (tile, pixels) in work {
            self.pixels[tile.index] = pixels;
        }
        Ok(verdicts)
    }
}
