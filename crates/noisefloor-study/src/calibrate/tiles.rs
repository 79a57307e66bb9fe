//! The pictures of a calibration: small converged ones, and how noisy each of their pixels is.
//!
//! They are crops of the built-in scenes, rendered by `examples/calibration_tiles.rs`. Of each pixel, a file has
//! the converged colour as displayed and the standard deviation of one sample, relative to its light. From
//! these, pictures of any number of samples are made on the spot.

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

const FILES: [(&str, &[u8]); 4] = [
    ("smooth", include_bytes!("../../tiles/smooth.png")),
    ("dark", include_bytes!("../../tiles/dark.png")),
    ("textured", include_bytes!("../../tiles/textured.png")),
    ("edge", include_bytes!("../../tiles/edge.png")),
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
    deviation: Vec<f32>,
}

impl CalibrationTile {
    /// All of them.
    pub fn all() -> &'static [Self] {
        static TILES: OnceLock<Vec<CalibrationTile>> = OnceLock::new();
        TILES.get_or_init(|| FILES.into_iter().filter_map(|(name, png)| Self::read(name, png)).collect())
    }

    fn read(name: &'static str, png: &[u8]) -> Option<Self> {
        let image = image::load_from_memory(png).ok()?.into_rgba8();
        let mut random = seeded(name.len() as u64);
        // In a picture that was not rounded, fractions are evenly spread; without noise, rounding gives the
        // picture back, and with noise it does to it what it does to a rendering
        let mut light = |[r, g, b, _]: [u8; 4]| {
            [r, g, b]
                .map(|code| srgb_decode((f32::from(code) + 0.998 * (random.f32() - 0.5)).max(0.0) / 255.0))
        };
        Some(Self {
            name,
            clean: image.pixels().map(|p| [p[0], p[1], p[2]]).collect(),
            light: image.pixels().map(|p| light(p.0)).collect(),
            deviation: image.pixels().map(|p| ((f32::from(p[3]) - CODES.1) / CODES.0).exp2()).collect(),
        })
    }

    /// The converged picture, sRGB code values, row-major.
    pub fn clean(&self) -> &[[u8; 3]] {
        &self.clean
    }

    /// A picture of `spp` samples per pixel, sRGB code values, row-major; each seed has noise of its own.
    pub fn noisy(&self, spp: f64, seed: u64) -> Vec<[u8; 3]> {
        let round = |code: f32| (255.0 * code).round() as u8;
        self.rendered(spp, seed).into_iter().map(|pixel| pixel.map(round)).collect()
    }

    /// The same before rounding, display values in [0, 1]. A pixel's light is multiplied by a log-normal number
    /// of mean 1: noise of the right variance that is never negative and has no colour, as that of light on
    /// surfaces has none.
    fn rendered(&self, spp: f64, seed: u64) -> Vec<Rgb> {
        let mut random = seeded(seed);
        let noisy = |(light, deviation): (&Rgb, &f32)| {
            let variance = (f64::from(*deviation).powi(2) / spp).ln_1p();
            let factor = (variance.sqrt() * normal(&mut random) - 0.5 * variance).exp() as f32;
            light.map(|value| srgb_encode((value * factor).min(1.0)))
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

    fn told(&self, oracle: &Oracle, viewing: Viewing, spp: f64, seed: u64) -> Option<f64> {
        let still = |seed| Still {
            size: (EDGE, EDGE),
            pixels: self.rendered(spp, seed),
            spp,
            display_referred: true,
            rounding: 0.0,
            origin: None,
        };
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

/// Box and Muller 1958.
fn normal(random: &mut fastrand::Rng) -> f64 {
    let radius = (-2.0 * (1.0 - random.f64()).ln()).sqrt();
    radius * (std::f64::consts::TAU * random.f64()).cos()
}

#[cfg(test)]
mod tests {
    use super::*;
    use noisefloor::display::luminance;

    #[test]
    fn all_are_there_and_small() {
        assert_eq!(CalibrationTile::all().len(), FILES.len());
        assert!(FILES.iter().map(|(_, png)| png.len()).sum::<usize>() <= 200_000);
        assert!(CalibrationTile::all().iter().all(|tile| tile.clean.len() == EDGE * EDGE));
    }

    /// Without noise, rounding gives the picture back: the fractions that were added are below half a code.
    #[test]
    fn no_noise_is_the_clean_picture() {
        for tile in CalibrationTile::all() {
            assert_eq!(tile.noisy(1e18, 1), tile.clean, "{}", tile.name);
        }
    }

    /// Over 200 pictures the light of every pixel has the mean of the converged picture and a variance of
    /// σ²/n. Each pixel errs by √(2/200) = 10 % of its variance, more for a skewed distribution, and all 16384 of
    /// them by 0.1 %; of their standardised means, the mean square is 1 within √(2/16384) = 1.1 %. Tolerances are
    /// four times that.
    #[test]
    fn noise_has_the_variance_of_its_samples() {
        for tile in CalibrationTile::all() {
            for spp in [50.0, 800.0] {
                let (count, mut ratio, mut means) = (200, 0.0, 0.0);
                let mut moments = vec![[0.0f64; 2]; EDGE * EDGE];
                for seed in 0..count {
                    for (m, code) in moments.iter_mut().zip(tile.rendered(spp, seed)) {
                        let light = f64::from(luminance(code.map(srgb_decode)));
                        m[0] += light / count as f64;
                        m[1] += light * light / count as f64;
                    }
                }
                let dark = |light: &Rgb| luminance(*light) < 1e-3; // f32 has no digits for their squares
                let mut used = 0.0;
                for ((m, light), deviation) in moments.iter().zip(&tile.light).zip(&tile.deviation) {
                    if dark(light) {
                        continue;
                    }
                    let light = f64::from(luminance(*light));
                    let variance = (light * f64::from(*deviation)).powi(2) / spp;
                    ratio += (m[1] - m[0] * m[0]) * count as f64 / (count - 1) as f64 / variance;
                    means += (m[0] - light).powi(2) / (variance / count as f64);
                    used += 1.0;
                }
                let (ratio, means) = (ratio / used, means / used);
                println!("{} at {spp} spp: variance {ratio:.4}, means {means:.4}, {used} pixels", tile.name);
                assert!((ratio - 1.0).abs() < 0.01, "{} at {spp}: {ratio}", tile.name);
                assert!((means - 1.0).abs() < 0.045, "{} at {spp}: {means}", tile.name);
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
