//! Random numbers for tests.

use rand::rngs::Xoshiro256PlusPlus;
use rand::{Rng as _, RngExt as _, SeedableRng as _};
use rand_distr::StandardNormal;

/// A seeded stream of random numbers: the same numbers for the same seed on every machine, however many
/// threads there are.
///
/// The generator is xoshiro256++ (Blackman and Vigna 2018), which neither repeats itself nor correlates
/// visibly within a test. It is not made for secrets.
///
/// ```
/// use noisefloor_testkit::Noise;
///
/// let mut noise = Noise::new(1);
/// let pixel = 0.5 + 0.1 * noise.normal();
/// assert_eq!(pixel, 0.5 + 0.1 * Noise::new(1).normal());
/// ```
#[derive(Clone, Debug)]
pub struct Noise(Xoshiro256PlusPlus);

impl Noise {
    /// The stream of a seed. Neighbouring seeds have unrelated streams.
    pub fn new(seed: u64) -> Self {
        Self(Xoshiro256PlusPlus::seed_from_u64(seed))
    }

    /// The stream of several numbers in this order, such as seed, pixel and sample. A source that draws each
    /// sample from a stream of its own repeats its samples however requests are cut.
    pub fn keyed(keys: &[u64]) -> Self {
        keys.iter().fold(Self::new(0), |mut noise, key| Self::new(noise.bits() ^ key))
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0.next_u64()
    }

    /// A number in [0, 1), uniformly distributed: a multiple of 2⁻⁵³.
    pub fn uniform(&mut self) -> f64 {
        self.0.random()
    }

    /// A normally distributed number of mean 0 and variance 1.
    pub fn normal(&mut self) -> f64 {
        self.0.sample(StandardNormal)
    }

    /// An index below `count`, each as likely as the others.
    ///
    /// # Panics
    /// If `count` is 0.
    pub fn below(&mut self, count: usize) -> usize {
        self.0.random_range(..count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRAWS: usize = 100_000;

    /// Mean and variance of many draws.
    fn moments(mut draw: impl FnMut() -> f64) -> (f64, f64) {
        let values: Vec<f64> = (0..DRAWS).map(|_| draw()).collect();
        let mean = values.iter().sum::<f64>() / DRAWS as f64;
        let variance = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / DRAWS as f64;
        (mean, variance)
    }

    /// Tolerances are five standard errors of 100,000 draws: by chance one of the four comparisons would fail
    /// with p < 3e-6, and the draws are seeded.
    #[test]
    fn moments_are_those_of_the_distributions() {
        let mut noise = Noise::new(2);
        let (mean, variance) = moments(|| noise.uniform());
        // Var(u) = 1/12, Var((u − 1/2)²) = 1/180
        assert!((mean - 0.5).abs() < 5.0 * (1.0 / 12.0 / DRAWS as f64).sqrt(), "{mean}");
        assert!((variance - 1.0 / 12.0).abs() < 5.0 * (1.0 / 180.0 / DRAWS as f64).sqrt(), "{variance}");
        let (mean, variance) = moments(|| noise.normal());
        // Var(z²) = 2
        assert!(mean.abs() < 5.0 * (1.0 / DRAWS as f64).sqrt(), "{mean}");
        assert!((variance - 1.0).abs() < 5.0 * (2.0 / DRAWS as f64).sqrt(), "{variance}");
    }

    /// Tests rely on the numbers that they were written with. Those of seed 0 are SplitMix64's four words
    /// (Steele et al. 2014), in the authors' own xoshiro256++.
    #[test]
    fn streams_stay_what_they_are() {
        let draw = |mut noise: Noise| [noise.bits(), noise.bits()];
        assert_eq!(draw(Noise::new(0)), [0x5317_5d61_490b_23df, 0x61da_6f3d_c380_d507]);
        assert_eq!(draw(Noise::keyed(&[])), draw(Noise::new(0)));
        assert_ne!(draw(Noise::keyed(&[1, 2])), draw(Noise::keyed(&[2, 1])));
        assert_ne!(draw(Noise::keyed(&[0])), draw(Noise::keyed(&[0, 0])));
    }

    #[test]
    fn indices_are_below_the_count_and_reach_all_of_them() {
        let mut noise = Noise::new(3);
        let mut seen = [false; 7];
        (0..1000).for_each(|_| seen[noise.below(7)] = true);
        assert_eq!(seen, [true; 7]);
    }
}
