//! Relative standard error with confidence, as in Mitsuba 0.6.

use crate::pixels::{DEFAULT_SHARE, enough, need_of_share, verdict};
use noisefloor::{
    Film, Rgb, StoppingCriterion, Tile, TileGrid, Verdict,
    criterion::{CriterionError, Needs, View},
    display::luminance,
};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// Default of [`RelativeError::error`] (`maxError` of Mitsuba 0.6).
pub(crate) const DEFAULT_ERROR: f64 = 0.17;
/// Default of [`RelativeError::confidence`] (`pValue` 0.05 of Mitsuba 0.6).
pub(crate) const DEFAULT_CONFIDENCE: f64 = 0.95;
/// Darker pixels are compared with this share of the average luminance.
const DARK: f64 = 0.01;

/// The criterion of Mitsuba 0.6's adaptive integrator (`integrators/misc/adaptive.cpp`), on luminance.
///
/// A pixel is done when t·√(s²/n) ≤ `error`·max(mean, 1 % of the average luminance of the picture), where s²
/// estimates the variance of one sample and t is the two-sided quantile for `confidence`. A tile is done when
/// a `share` of its pixels is.
///
/// Mitsuba sees each sample; here a verdict sees the mean of the new samples of each half. For k batches of
/// n₁ … n_k samples with means b₁ … b_k and weighted mean M = Σnᵢbᵢ/Σnᵢ, E Σnᵢ(bᵢ − M)² = Σnᵢ(Var bᵢ − Var M)
/// = Σnᵢ(σ²/nᵢ − σ²/Σnᵢ) = (k − 1)·σ². So s² = Σnᵢ(bᵢ − M)²/(k − 1) is unbiased however uneven the batches
/// are. It has k − 1 degrees of freedom instead of n − 1; therefore t is Student's, while Mitsuba, with
/// hundreds of samples, can use the normal distribution. Each verdict judges all pixels anew.
///
/// Memory: 64 bytes per pixel in addition to the film.
#[derive(Clone, Debug)]
pub struct RelativeError {
    /// Largest relative half-width of the confidence interval, above 0. The default of 0.17 agrees with
    /// people on average (`noisefloor-lab evaluate --rivals`).
    pub error: f64,
    /// Confidence, in (0, 1); 0.95 by default.
    pub confidence: f64,
    /// Share of a tile's pixels that must be done, in (0, 1]; 0.95 by default.
    pub share: f64,
    /// For each pixel of each tile; empty until the tile is first judged.
    pixels: Vec<Vec<Batches>>,
}

impl RelativeError {
    /// The criterion with this constant, a confidence of 95 %, and 95 % of a tile's pixels.
    pub fn new(error: f64) -> Self {
        Self { error, confidence: DEFAULT_CONFIDENCE, share: DEFAULT_SHARE, pixels: Vec::new() }
    }
}

/// Batches of one pixel so far (West 1979: weighted mean and sum of squares, updated).
#[derive(Clone, Copy, Debug, Default)]
struct Batches {
    /// Mean and samples of each half at the last verdict.
    halves: [(f64, u64); 2],
    count: u32,
    samples: f64,
    mean: f64,
    squares: f64,
}

impl Batches {
    fn update(&mut self, halves: [(Rgb, u64); 2]) {
        let mut new = [(0.0, 0); 2];
        for ((before, (now, samples)), new) in self.halves.iter_mut().zip(halves).zip(&mut new) {
            let after = (f64::from(luminance(now)), samples);
            let more = after.1.saturating_sub(before.1);
            if more > 0 {
                let (n, m) = (after.1 as f64, before.1 as f64);
                *new = ((after.0 * n - before.0 * m) / more as f64, more);
                *before = after;
            }
        }
        // In an order that does not hang on which half is which
        new.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (batch, samples) in new.into_iter().filter(|(_, samples)| *samples > 0) {
            let samples = samples as f64;
            self.count += 1;
            self.samples += samples;
            let step = batch - self.mean;
            self.mean += step * samples / self.samples;
            self.squares += step * (batch - self.mean) * samples;
        }
    }

    /// Estimate of the variance of one sample; `None` from fewer than two batches.
    fn variance(&self) -> Option<f64> {
        (self.count > 1).then(|| self.squares.max(0.0) / f64::from(self.count - 1))
    }
}

/// Two-sided quantiles of Student's t by degrees of freedom, from 1; the last one is normal, for all larger
/// numbers.
fn quantiles(confidence: f64, degrees: usize) -> Vec<f64> {
    let confidence = if confidence.is_nan() { 0.0 } else { confidence };
    let tail = 0.5 + 0.5 * confidence.clamp(0.0, 1.0 - f64::EPSILON);
    let student =
        |k: usize| StudentsT::new(0.0, 1.0, k as f64).map_or(f64::INFINITY, |t| t.inverse_cdf(tail));
    let mut all: Vec<f64> = (1..=degrees).into_par_iter().map(student).collect();
    all.push(Normal::standard().inverse_cdf(tail));
    all
}

/// Degrees of freedom above which the normal distribution is used: its quantiles are within 1 % of Student's
/// for any confidence up to 99.9 %.
const NORMAL: usize = 300;

fn average_luminance(film: &Film) -> f64 {
    let image = film.image();
    image.iter().map(|&p| f64::from(luminance(p))).sum::<f64>() / image.len() as f64
}

impl StoppingCriterion for RelativeError {
    fn name(&self) -> String {
        format!("relative error {} at {} %", self.error, 100.0 * self.confidence)
    }

    fn fingerprint(&self) -> String {
        format!("{}, share {}", self.name(), self.share)
    }

    fn begin(&mut self, grid: TileGrid) {
        self.pixels = vec![Vec::new(); grid.len()];
    }

    fn needs(&self) -> Needs {
        Needs::HALVES
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let (film, grid) = (view.film, view.film.grid());
        if self.pixels.len() != grid.len() {
            self.begin(grid);
        }
        // Take in the new batches.
        let mut work: Vec<(Tile, Vec<Batches>)> =
            tiles.iter().map(|&t| (t, std::mem::take(&mut self.pixels[t.index]))).collect();
        work.par_iter_mut().for_each(|(tile, pixels)| {
            pixels.resize(tile.pixels(), Batches::default());
            for (batches, pixel) in pixels.iter_mut().zip(tile.rows(grid.width()).flatten()) {
                batches.update(film.pixel_halves(tile.index, pixel));
            }
        });

        // Judge.
        let most = work.iter().flat_map(|(_, pixels)| pixels).map(|p| p.count as usize).max().unwrap_or(0);
        let quantiles = quantiles(self.confidence, most.min(NORMAL));
        let normal = quantiles[quantiles.len() - 1];
        let dark = DARK * average_luminance(film);
        let judge = |(tile, pixels): &(Tile, Vec<Batches>)| {
            let samples = film.spp(tile.index);
            // Half-width of the confidence interval over that allowed, and samples needed for it to be 1 by
            // the normal quantile.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{empty, expose, view};
    use noisefloor_testkit::Noise;
    use statrs::distribution::ChiSquared;

    fn all(film: &Film) -> Vec<Tile> {
        film.grid().tiles().collect()
    }

    #[test]
    fn a_pixel_takes_as_many_bytes_as_stated() {
        assert_eq!(size_of::<Batches>(), 64);
    }

    #[test]
    fn quantiles_are_those_of_the_tables() {
        let table = quantiles(0.95, 30);
        for (degrees, value) in [(1, 12.706), (2, 4.303), (5, 2.571), (30, 2.042)] {
            assert!((table[degrees - 1] - value).abs() < 1e-3, "{degrees}: {}", table[degrees - 1]);
        }
        assert!((table[30] - 1.960).abs() < 1e-3);
        assert!(quantiles(1.0, 1).iter().all(|q| q.is_finite()) && quantiles(f64::NAN, 0).len() == 1);
    }

    #[test]
    fn the_variance_is_unbiased_for_uneven_batches() {
        let (mut film, mut noise, mut criterion) = (empty(), Noise::new(21), RelativeError::new(0.05));
        let (mean, sigma) = (0.5, 0.3);
        let mut batches = 0;
        for sizes in [&[10, 10][..], &[50, 7, 90], &[1], &[300, 20, 20, 20, 20], &[5, 900]] {
            let before = film.half_counts(0);
            sizes.iter().for_each(|&n| expose(&mut film, n, mean, sigma, &mut noise));
            batches += (0..2).filter(|&h| film.half_counts(0)[h] > before[h]).count();
            criterion.judge(&view(&film), &all(&film)).unwrap();
        }
        let pixels: Vec<&Batches> = criterion.pixels.iter().flatten().collect();
        assert!(
            pixels.len() == 4096 && pixels.iter().all(|p| p.count as usize == batches && p.samples == 1453.0)
        );
        assert!(pixels.iter().all(|p| (p.mean - 0.5).abs() < 0.1));
        // s²/σ² is χ² over its ν degrees of freedom, of variance 2/ν; four deviations of the mean of 4096.
        let variance = pixels.iter().map(|p| p.variance().unwrap()).sum::<f64>() / 4096.0;
        let tolerance = 4.0 * (2.0 / (batches - 1) as f64 / 4096.0).sqrt();
        assert!(
            (variance / (sigma * sigma) - 1.0).abs() < tolerance,
            "{variance} ± {tolerance} ({batches} batches)"
        );
    }

    /// With ν degrees of freedom, t·s/√n ≤ e·m for a share P(χ²_ν ≤ ν·(e·m/σ)²·n/t²) of the pixels.
    #[test]
    fn stops_where_mathematics_says() {
        let (mean, sigma, error) = (0.5, 0.2, 0.05);
        let (mut film, mut noise) = (empty(), Noise::new(2));
        let mut criterion = RelativeError::new(error);
        let mut fired = [0usize; 4];
        for step in 1..=20 {
            expose(&mut film, 50, mean, sigma, &mut noise);
            expose(&mut film, 50, mean, sigma, &mut noise);
            for (tile, verdict) in all(&film).iter().zip(criterion.judge(&view(&film), &all(&film)).unwrap())
            {
                if verdict.converged && fired[tile.index] == 0 {
                    fired[tile.index] = step;
                }
            }
        }
        let share = |step: usize| {
            let (degrees, n) = (2 * step - 1, 100.0 * step as f64);
            let t = quantiles(0.95, degrees)[degrees - 1];
            let limit = degrees as f64 * (error * mean / sigma / t).powi(2) * n;
            ChiSquared::new(degrees as f64).unwrap().cdf(limit)
        };
        // A share of 1024 pixels has a deviation of 0.7 %; three of those.
        for step in fired {
            assert!(step > 1 && share(step) > 0.93 && share(step - 1) < 0.97, "{fired:?} {}", share(step));
        }
    }

    #[test]
    fn dark_pixels_are_held_to_the_picture() {
        // Three tiles are bright and one is nearly black, with noise that is large beside it and small beside
        // 1 % of the average.
        let mut film = empty();
        let mut noise = Noise::new(4);
        for _ in 0..20 {
            for tile in 0..4 {
                let (mean, sigma) = if tile == 0 { (1e-4, 1e-4) } else { (1.0, 0.0) };
                let batch: Vec<Rgb> =
                    (0..1024).map(|_| [(mean + sigma * noise.normal()) as f32; 3]).collect();
                film.add(tile, 50, &batch).unwrap();
            }
        }
        let mut criterion = RelativeError::new(0.05);
        criterion.judge(&view(&film), &all(&film)).unwrap();
        for _ in 0..20 {
            for tile in 0..4 {
                film.add(tile, 50, &[[if tile == 0 { 1e-4 } else { 1.0 }; 3]; 1024]).unwrap();
            }
        }
        assert!(criterion.judge(&view(&film), &all(&film)).unwrap()[0].converged);
    }
}
