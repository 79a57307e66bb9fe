//! The pictures of a calibration: small converged ones, and how noisy each of their pixels is.
//!
//! They are crops of the built-in scenes, rendered by `examples/calibration_tiles.rs`. One file has the converged
//! colours as displayed, the other the standard deviation of one sample of each pixel and channel, relative to
//! its light. From these, pictures of any number of samples are made on the spot. Noise has the colour that it has there:
//! where light comes from coloured walls, channels correlate by as little as 0.58, and grey noise of the same strength
//! would ask for a fifth more samples.

use crate::random::seeded;
use noisefloor::display::{ToneMapping, srgb_decode, srgb_encode};
use noisefloor::evidence::{Evidence, Samples};
use noisefloor::stills::{SnapshotPair, Still};
use noisefloor::{Oracle, Rgb, TileGrid, Viewing};
use std::sync::OnceLock;

/// Edge of the pictures in pixels.
pub const EDGE: usize = 128;
/// Deviations are stored as powers of two in so many steps, with this code for 1.
const CODES: (f32, f32) = (16.0, 128.0);
/// Pictures from which a threshold is told, and samples per pixel of the first guess.
const LOOKS: u64 = 8;
const GUESS_SPP: f64 = 200.0;

/// A tile as it is kept: its name, the two files, and how the noise of its channels correlates (red with green,
/// red with blue, green with blue).
type Files = (&'static str, [&'static [u8]; 2], [f64; 3]);

macro_rules! files {
    ($name:literal, $correlations:expr) => {
        (
            $name,
            [
                include_bytes!(concat!("../../tiles/", $name, ".png")) as &[u8],
                include_bytes!(concat!("../../tiles/", $name, "-noise.png")) as &[u8],
            ],
            $correlations,
        )
    };
}

const FILES: [Files; 4] = [
    files!("smooth", [0.58, 0.80, 0.76]),
    files!("dark", [0.76, 0.79, 0.96]),
    files!("textured", [0.82, 0.65, 0.95]),
    files!("edge", [0.96, 0.89, 0.96]),
];

/// A converged picture of [`EDGE`]² pixels, and its noise.
#[derive(Debug)]
pub struct CalibrationTile {
    /// What it is like.
    pub name: &'static str,
    /// Code values, row-major.
    clean: Vec<[u8; 3]>,
    /// The same as light, linear in [0, 1], with the fractions of a code value that rounding has taken.
    light: Vec<Rgb>,
    /// Standard deviation of one sample, relative to the light.
    deviation: Vec<Rgb>,
    /// Lower triangle by rows: what makes independent numbers correlate as the channels do (Cholesky).
    triangle: [f64; 6],
}

impl CalibrationTile {
    pub fn all() -> &'static [Self] {
        static TILES: OnceLock<Vec<CalibrationTile>> = OnceLock::new();
        TILES.get_or_init(|| FILES.into_iter().filter_map(Self::read).collect())
    }

    fn read((name, files, correlations): Files) -> Option<Self> {
        let [clean, noise] = files.map(|png| image::load_from_memory(png).map(|image| image.into_rgb8()));
        let (clean, noise) = (clean.ok()?, noise.ok()?);
        let mut random = seeded(name.len() as u64);
        // In a picture that was not rounded, fractions are evenly spread; without noise, rounding gives the
        // picture back, and with noise it does to it what it does to a rendering
        let mut light =
            |code: u8| srgb_decode((f32::from(code) + 0.998 * (random.f32() - 0.5)).max(0.0) / 255.0);
        let deviation = |code: u8| ((f32::from(code) - CODES.1) / CODES.0).exp2();
        Some(Self {
            name,
            clean: clean.pixels().map(|p| p.0).collect(),
            light: clean.pixels().map(|p| p.0.map(&mut light)).collect(),
            deviation: noise.pixels().map(|p| p.0.map(deviation)).collect(),
            triangle: cholesky(correlations),
        })
    }

    /// The converged picture, sRGB code values, row-major.
    pub fn clean(&self) -> &[[u8; 3]] {
        &self.clean
    }

    /// A picture of `spp` samples per pixel, sRGB code values, row-major; each seed has noise of its own.
    pub fn noisy(&self, spp: f64, seed: u64) -> Vec<[u8; 3]> {
        let round = |light: f32| (255.0 * srgb_encode(light)).round() as u8;
        self.rendered(spp, seed).into_iter().map(|pixel| pixel.map(round)).collect()
    }

    /// The same before rounding, as light, linear in [0, 1]. A pixel's light is multiplied by log-normal numbers
    /// of mean 1, one for each channel: noise of the right variance and colour that is never negative.
    fn rendered(&self, spp: f64, seed: u64) -> Vec<Rgb> {
        let mut random = seeded(seed);
        let [a, b, c, d, e, f] = self.triangle;
        let noisy = |(light, deviation): (&Rgb, &Rgb)| {
            let [x, y, z] = [(); 3].map(|()| normal(&mut random));
            let correlated = [a * x, b * x + c * y, d * x + e * y + f * z];
            std::array::from_fn(|channel| {
                let variance = (f64::from(deviation[channel]).powi(2) / spp).ln_1p();
                let factor = (variance.sqrt() * correlated[channel] - 0.5 * variance).exp() as f32;
                (light[channel] * factor).min(1.0)
            })
        };
        self.light.iter().zip(&self.deviation).map(noisy).collect()
    }

    /// Samples per pixel at which the oracle's observers stop seeing noise in it: where as many of them do as
    /// do not. `None` if the oracle does not tell noise from picture, or is for other viewing conditions.
    pub fn threshold(&self, oracle: &Oracle, viewing: Viewing) -> Option<f64> {
        let mut spp = GUESS_SPP;
        for look in 0..LOOKS {
            let told = self.told(oracle, viewing, spp, 2 * look)?;
            // Averaged from the second look on, the first being far from it
            let weight = if look < 2 { 1.0 } else { 1.0 / look as f64 };
            spp = (spp.ln() + weight * (told.ln() - spp.ln())).exp();
        }
        Some(spp)
    }

    /// That of each tile.
    pub(super) fn thresholds(oracle: &Oracle, viewing: Viewing) -> Option<Vec<f64>> {
        Self::all().iter().map(|tile| tile.threshold(oracle, viewing)).collect()
    }

    fn told(&self, oracle: &Oracle, viewing: Viewing, spp: f64, seed: u64) -> Option<f64> {
        let still = |seed| Still::new((EDGE, EDGE), self.rendered(spp, seed), spp).displayed_as_it_is(0.0);
        let (one, other) = (still(seed), still(seed + 1));
        let pair = SnapshotPair::new(
            Evidence::Halves,
            &one,
            &[&other],
            ToneMapping::default(),
            Some(Samples::Independent),
        );
        let grid = TileGrid::new(EDGE, EDGE, EDGE).ok()?;
        let described = pair.ok()?.seen_on(viewing).describe(oracle, grid).ok()?;
        let threshold = oracle.judge_described(&described).first()?.threshold?;
        Some((threshold.median as f64).max(1.0))
    }
}

/// The lower triangle, by rows, whose product with its transpose has ones on the diagonal and these
/// correlations beside it.
fn cholesky([rg, rb, gb]: [f64; 3]) -> [f64; 6] {
    let green = (1.0 - rg * rg).sqrt();
    let shared = (gb - rg * rb) / green;
    [1.0, rg, green, rb, shared, (1.0 - rb * rb - shared * shared).max(0.0).sqrt()]
}

/// Box and Muller 1958.
fn normal(random: &mut fastrand::Rng) -> f64 {
    let radius = (-2.0 * (1.0 - random.f64()).ln()).sqrt();
    radius * (std::f64::consts::TAU * random.f64()).cos()
}

#[cfg(test)]
mod tests {
    use super::*;
    /// What `noisefloor judge` expects of real renders of the same crops, of two seeds and about as many samples as
    /// the threshold, written as PNG (2026-11-27). Two such verdicts differ by up to 7 %.
    #[test]
    fn thresholds_are_those_of_real_renders() {
        let oracle = Oracle::bundled();
        for (tile, real) in CalibrationTile::all().iter().zip([402.0, 413.0, 85.0, 366.0]) {
            let threshold = tile.threshold(&oracle, oracle.model().viewing()).unwrap();
            println!("{}: {threshold:.0}, real {real}", tile.name);
            assert!((threshold / real).ln().abs() < 0.15, "{}: {threshold:.0}, real {real}", tile.name);
        }
    }

    #[test]
    fn all_are_there_and_small() {
        assert_eq!(CalibrationTile::all().len(), FILES.len());
        assert!(FILES.iter().flat_map(|(_, files, _)| files).map(|png| png.len()).sum::<usize>() <= 200_000);
        assert!(CalibrationTile::all().iter().all(|tile| tile.clean.len() == EDGE * EDGE));
    }

    /// Without noise, rounding gives the picture back: the fractions that were added are below half a code.
    #[test]
    fn no_noise_is_the_clean_picture() {
        for tile in CalibrationTile::all() {
            assert_eq!(tile.noisy(1e18, 1), tile.clean, "{}", tile.name);
        }
    }

    /// Over 200 pictures the light of every pixel and channel has the mean of the converged picture and a
    /// variance of σ²/n. Each errs by √(2/200) = 10 % of its variance, more for a skewed distribution, and all
    /// 16384 of them by 0.1 %; of their standardised means, the mean square is 1 within √(2/16384) = 1.1 %, and
    /// mean correlations err by 0.01/√… = 10⁻³. Tolerances are four times that, but for correlations of strong noise,
    /// which log-normal numbers lower.
    #[test]
    fn noise_has_the_variance_and_colour_of_its_samples() {
        for (tile, (.., correlations)) in CalibrationTile::all().iter().zip(FILES) {
            for spp in [100.0, 1600.0] {
                let count = 200;
                let mut means = vec![[0.0f64; 3]; EDGE * EDGE];
                let mut products = vec![[[0.0f64; 3]; 3]; EDGE * EDGE];
                for seed in 0..count {
                    for (i, light) in tile.rendered(spp, seed).into_iter().enumerate() {
                        let light = light.map(f64::from);
                        for c in 0..3 {
                            means[i][c] += light[c] / count as f64;
                            (0..3).for_each(|d| products[i][c][d] += light[c] * light[d] / count as f64);
                        }
                    }
                }
                let covariance = |i: usize, c: usize, d: usize| products[i][c][d] - means[i][c] * means[i][d];
                let unbiased = count as f64 / (count - 1) as f64;
                for c in [0, 1, 2] {
                    // f32 has no digits for the squares of the darkest
                    let bright: Vec<usize> = (0..EDGE * EDGE).filter(|&i| tile.light[i][c] > 1e-3).collect();
                    let (mut variance, mut mean, used) = (0.0, 0.0, bright.len() as f64);
                    for i in bright {
                        let light = f64::from(tile.light[i][c]);
                        let expected = (light * f64::from(tile.deviation[i][c])).powi(2) / spp;
                        variance += covariance(i, c, c) * unbiased / expected / used;
                        mean += (means[i][c] - light).powi(2) / (expected / count as f64) / used;
                    }
                    println!("{} {c} at {spp} spp: variance {variance:.4}, means {mean:.4}", tile.name);
                    assert!((variance - 1.0).abs() < 0.01 && (mean - 1.0).abs() < 0.045, "{} {c}", tile.name);
                }
                for (k, (c, d)) in [(0, 1), (0, 2), (1, 2)].into_iter().enumerate() {
                    let all = (0..EDGE * EDGE).map(|i| {
                        covariance(i, c, d) / (covariance(i, c, c) * covariance(i, d, d)).max(1e-24).sqrt()
                    });
                    let mean = all.sum::<f64>() / (EDGE * EDGE) as f64;
                    println!("{} {c}{d} at {spp} spp: {mean:.3}, {:.3}", tile.name, correlations[k]);
                    assert!((mean - correlations[k]).abs() < 0.03, "{} {c}{d} at {spp}: {mean}", tile.name);
                }
            }
        }
    }

    /// At a twelfth of the threshold, the strongest noise that is shown, hardly a pixel is cut off at black or
    /// white that was not there.
    #[test]
    fn noise_is_not_clipped() {
        let oracle = Oracle::bundled();
        for tile in CalibrationTile::all() {
            let spp = tile.threshold(&oracle, oracle.model().viewing()).unwrap() * (-2.5f64).exp();
            let pairs = (0..4).flat_map(|seed| tile.noisy(spp, seed).into_iter().zip(&tile.clean));
            let clipped = |(noisy, clean): &([u8; 3], &[u8; 3])| {
                (0..3).any(|c| (noisy[c] == 255 && clean[c] < 255) || (noisy[c] == 0 && clean[c] > 3))
            };
            let share = pairs.filter(clipped).count() as f64 / (4 * EDGE * EDGE) as f64;
            println!("{}: {share:.5}", tile.name);
            assert!(share < 1e-3, "{}: {share}", tile.name);
        }
    }

    #[test]
    fn each_seed_has_noise_of_its_own() {
        let tile = &CalibrationTile::all()[0];
        assert_ne!(tile.noisy(100.0, 1), tile.noisy(100.0, 2));
        assert_eq!(tile.noisy(100.0, 1), tile.noisy(100.0, 1));
    }
}
