//! Where the random numbers of a path come from.

use crate::rng::{GOLDEN, Key, Rng, mix};
use noisefloor::source::Sequence;
use serde::{Deserialize, Serialize};

/// How the samples of a pixel are distributed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Sampling {
    /// Independent samples.
    Independent,
    /// Owen-scrambled Sobol points (Burley 2020, "Practical Hash-based Owen Scrambling"), four dimensions at
    /// a time, scrambled and shuffled differently for each pixel and each [`Sequence`]. So noise is white over
    /// the pixels and independent between the halves, as of independent samples, and falls faster with their
    /// number.
    #[default]
    Sobol,
}

/// The numbers of one path, four at a time.
#[derive(Clone, Debug)]
pub(crate) enum Sampler {
    Independent(Rng),
    /// Point `index` of the sequence of `seed`, which changes every four numbers.
    Sobol {
        index: u32,
        seed: u64,
    },
}

/// Length of a Sobol sequence. After it another one begins, with its own scrambling.
const POINTS: u64 = 1 << 16;

/// Which sample of a pixel: its index among all, and in its sequence.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub(crate) sample: u64,
    pub(crate) sequence: Sequence,
}

impl Place {
    /// The sample after this one by `k`.
    #[inline]
    pub(crate) fn plus(self, k: u64) -> Self {
        let Sequence { number, first } = self.sequence;
        let first = first.wrapping_add(k);
        Self { sample: self.sample.wrapping_add(k), sequence: Sequence { number, first } }
    }

    /// A sample of a pixel that has only one sequence.
    pub(crate) fn only(sample: u64) -> Self {
        Self { sample, sequence: Sequence { number: 0, first: sample } }
    }
}

impl Sampler {
    #[inline]
    pub(crate) fn new(sampling: Sampling, key: Key, pixel: u64, place: Place) -> Self {
        match sampling {
            Sampling::Independent => Self::Independent(Rng::new(key, pixel, place.sample)),
            Sampling::Sobol => {
                let Sequence { number, first } = place.sequence;
                // Odd numbers are the sequences of half B
                let scrambling = 2 * (first / POINTS) + u64::from(number);
                Self::Sobol { index: (first % POINTS) as u32, seed: Rng::new(key, pixel, scrambling).next() }
            }
        }
    }

    /// Four numbers in [0, 1), unrelated to all others of the path.
    #[inline]
    pub(crate) fn four(&mut self) -> [f32; 4] {
        match self {
            Self::Independent(rng) => {
                let ([a, b], [c, d]) = (rng.two(), rng.two());
                [a, b, c, d]
            }
            Self::Sobol { index, seed } => sobol(*index, seed),
        }
    }

    /// A seed that no other path has, for decisions that are hashed instead of drawn in order. It uses up no
    /// number, so that paths are the same with and without it.
    #[inline]
    pub(crate) fn seed(&self) -> u64 {
        match self {
            Self::Independent(rng) => rng.clone().next(),
            Self::Sobol { index, seed } => mix(*seed ^ (u64::from(*index) << 32)),
        }
    }
}

/// Padding (Burley 2020): the same four dimensions repeatedly, each time with another seed.
#[inline(never)]
fn sobol(index: u32, seed: &mut u64) -> [f32; 4] {
    *seed = mix(seed.wrapping_add(GOLDEN));
    sobol_burley::sample_4d(index, 0, *seed as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of the first 4ᵏ points, one lies in each of 2ᵏ×2ᵏ cells, in the planes of the first and the last two
    /// dimensions.
    #[test]
    fn sobol_points_are_stratified() {
        let key = Key::new(3);
        for (k, set) in [(3u32, 0), (4, 5)] {
            let side = 1usize << k;
            let mut cells = vec![[0; 2]; side * side];
            for sample in 0..(side * side) as u64 {
                let mut sampler = Sampler::new(Sampling::Sobol, key, 17, Place::only(sample));
                let mut point = sampler.four();
                (0..set).for_each(|_| point = sampler.four());
                for (plane, xy) in [[point[0], point[1]], [point[2], point[3]]].iter().enumerate() {
                    let cell = xy.map(|x| (x * side as f32) as usize);
                    cells[cell[1] * side + cell[0]][plane] += 1;
                }
            }
            assert!(cells.iter().all(|c| c[0] == 1), "{cells:?}");
        }
    }

    /// Pixels, and groups of four numbers, are scrambled independently: the correlation of 2¹⁶ pairs is
    /// standard normal over √n; 5σ.
    #[test]
    fn sobol_scrambles_are_unrelated() {
        let (key, n) = (Key::new(4), 1u64 << 16);
        let (mut pixels, mut fours) = (0.0, 0.0);
        for pixel in 0..n {
            let mut one = Sampler::new(Sampling::Sobol, key, pixel, Place::only(5));
            let mut other = Sampler::new(Sampling::Sobol, key, pixel + 1, Place::only(5));
            let (a, b, c) = (one.four()[0], one.four()[0], other.four()[0]);
            fours += (f64::from(a) - 0.5) * (f64::from(b) - 0.5);
            pixels += (f64::from(a) - 0.5) * (f64::from(c) - 0.5);
        }
        for sum in [pixels, fours] {
            assert!((sum * 12.0 / (n as f64).sqrt()).abs() < 5.0, "{sum}");
        }
    }
}
