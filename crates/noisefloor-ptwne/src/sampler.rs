//! Where the random numbers of a path come from.

use crate::rng::{GOLDEN, Key, Rng, mix, unit};
use noisefloor::source::Sequence;
use serde::{Deserialize, Serialize};

/// How the samples of a pixel are distributed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Sampling {
    Independent,
    /// Owen-scrambled Sobol points (Burley 2020, "Practical Hash-based Owen Scrambling"), two dimensions at
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
    /// Point `index` of the sequences of `seed`, which changes every four numbers.
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
        let Sequence { number, first, .. } = self.sequence;
        let first = first.wrapping_add(k);
        Self { sample: self.sample.wrapping_add(k), sequence: Sequence::new(number, first) }
    }

    /// A sample of a pixel that has only one sequence.
    pub(crate) fn only(sample: u64) -> Self {
        Self { sample, sequence: Sequence::new(0, sample) }
    }
}

impl Sampler {
    #[inline]
    pub(crate) fn new(sampling: Sampling, key: Key, pixel: u64, place: Place) -> Self {
        match sampling {
            Sampling::Independent => Self::Independent(Rng::new(key, pixel, place.sample)),
            Sampling::Sobol => {
                let Sequence { number, first, .. } = place.sequence;
                // Odd numbers are the sequences of half B; those from 2 on, which no session asks for, have
                // the upper bits
                let (half, others) = (u64::from(number & 1), u64::from(number >> 1) << 33);
                let scrambling = (2 * (first / POINTS) + half).wrapping_add(others);
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
            Self::Sobol { index, seed } => {
                *seed = mix(seed.wrapping_add(GOLDEN));
                sobol(*index, *seed)
            }
        }
    }

    /// The numbers of what rays of this path may meet on their way. They use up none of the path's own, so that paths
    /// are the same with and without them.
    #[inline]
    pub(crate) fn draws(&self) -> Draws {
        match self {
            Self::Independent(rng) => Draws { index: 0, seed: rng.clone().next() },
            Self::Sobol { index, seed } => Draws { index: *index, seed: !seed },
        }
    }
}

/// A number for each surface that a ray may meet: whether a partly transparent one stops it, and which part of a mix
/// it is. A surface has a Sobol sequence of its own, so that its choices are stratified over the rays of a sequence,
/// and independent of those of all other surfaces.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Draws {
    /// The point of the sequences.
    pub(crate) index: u32,
    /// What they are scrambled and shuffled by.
    pub(crate) seed: u64,
}

impl Draws {
    /// The number of a surface, or of another choice, in [0, 1).
    #[inline]
    pub(crate) fn number(self, of: u64) -> f32 {
        let seed = mix(self.seed ^ of);
        let place = laine_karras(self.index.reverse_bits(), seed as u32).reverse_bits();
        unit(laine_karras(place, (seed >> 32) as u32).reverse_bits() >> 8)
    }

    /// Those of the next ray.
    #[inline]
    pub(crate) fn next(self) -> Self {
        Self { seed: self.seed.wrapping_add(GOLDEN), ..self }
    }
}

/// Two points, by padding (Burley 2020): the same two dimensions, shuffled and scrambled with other seeds.
#[inline]
fn sobol(index: u32, seed: u64) -> [f32; 4] {
    let ([a, b], [c, d]) = (sobol_2d(index, seed), sobol_2d(index, !seed));
    [a, b, c, d]
}

/// Point `index` of the first two dimensions of the Sobol sequence, shuffled and scrambled by a seed whose bits are
/// random.
#[inline]
fn sobol_2d(index: u32, seed: u64) -> [f32; 2] {
    let word = mix(seed ^ GOLDEN);
    let place = laine_karras(index.reverse_bits(), seed as u32).reverse_bits();
    // Both without the reversal of bits that Owen scrambling begins with
    [(place, word as u32), (pascal(place), (word >> 32) as u32)]
        .map(|(bits, seed)| unit(laine_karras(bits, seed).reverse_bits() >> 8))
}

/// The hash of Laine and Karras (2011) with Burley's constants: each bit changes by those below it.
#[inline]
fn laine_karras(bits: u32, seed: u32) -> u32 {
    let factors = [0x6c50_b47c, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6];
    factors.into_iter().fold(bits.wrapping_add(seed), |x: u32, factor| x ^ x.wrapping_mul(factor))
}

/// The generator matrix of Sobol's second dimension is Pascal's triangle modulo 2, the fifth Kronecker power of one
/// of 2×2: so five steps multiply it with the bits of an index.
#[inline]
fn pascal(index: u32) -> u32 {
    let steps = [(1, 0x5555_5555), (2, 0x3333_3333), (4, 0x0f0f_0f0f), (8, 0x00ff_00ff), (16, 0x0000_ffff)];
    steps.into_iter().fold(index, |x, (shift, mask)| x ^ ((x >> shift) & mask))
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

    /// Whoever asks for more than a session's two gets new ones.
    #[test]
    fn no_sequence_repeats_another() {
        let seed = |number, first| {
            let place = Place { sample: 0, sequence: Sequence::new(number, first) };
            Sampler::new(Sampling::Sobol, Key::new(3), 17, place).draws().seed
        };
        let mut seeds = Vec::new();
        for number in [0, 1, 2, 3, 4, 5, 1 << 16, u32::MAX] {
            seeds.extend([0, 1, 2, 1 << 20].map(|part| seed(number, part * POINTS)));
        }
        let all = seeds.len();
        seeds.sort_unstable();
        seeds.dedup();
        assert_eq!(seeds.len(), all);
    }

    /// Sobol's second dimension by its direction numbers, vⱼ = vⱼ₋₁ xor vⱼ₋₁/2 (Joe and Kuo 2008).
    #[test]
    fn pascal_s_triangle_is_the_second_dimension() {
        let mut directions = [1u32 << 31; 32];
        for j in 1..32 {
            directions[j] = directions[j - 1] ^ (directions[j - 1] >> 1);
        }
        for index in [0, 1, 2, 3, 77, 123_456, u32::MAX] {
            let of_bits = (0..32).filter(|j| index >> j & 1 == 1).map(|j| directions[j]);
            assert_eq!(pascal(index).reverse_bits(), of_bits.fold(0, |x, v| x ^ v), "{index}");
        }
    }

    /// Of the first 64 points, each of the 64 elementary intervals of every shape has one.
    #[test]
    fn scrambled_points_stay_a_net() {
        for seed in 0..20 {
            for wide in 0..=6 {
                let cell = |index| {
                    let [x, y] = sobol_2d(index, mix(seed));
                    ((x * (1 << wide) as f32) as u32, (y * (64 >> wide) as f32) as u32)
                };
                let cells: std::collections::BTreeSet<_> = (0..64).map(cell).collect();
                assert_eq!(cells.len(), 64, "seed {seed}, {wide}");
            }
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
