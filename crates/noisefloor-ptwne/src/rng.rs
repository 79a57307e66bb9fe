//! Random numbers that depend only on (seed, pixel, sample index).

/// The key of a render: two words hashed from its seed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Key(u64, u64);

impl Key {
    pub(crate) fn new(seed: u64) -> Self {
        let first = mix(seed ^ 0x6e6f_6973_6566_6c6f);
        Self(first, mix(first.wrapping_add(GOLDEN)))
    }
}

/// Increment of SplitMix64: 2⁶⁴ over the golden ratio, made odd.
pub(crate) const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// The finaliser of SplitMix64, a bijection on 64 bits (Steele, Lea, Flood 2014; constants of Stafford's
/// variant 13).
#[inline]
pub(crate) fn mix(mut z: u64) -> u64 {
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// xoroshiro128++ (Blackman, Vigna 2021), seeded with a hash of (seed, pixel, sample index): one short stream
/// per path, so that pictures do not depend on threads or batches.
#[derive(Clone, Debug)]
pub(crate) struct Rng(u64, u64);

impl Rng {
    /// The stream of one path. `pixel` is below 2²⁸ (`noisefloor::tile::MAX_PIXELS`), so that the packed word and
    /// thus the state differ between any two paths of a render, for the first 2³⁶ samples of a pixel.
    #[inline]
    pub(crate) fn new(key: Key, pixel: u64, sample: u64) -> Self {
        let first = mix(key.0 ^ (pixel | (sample << 28)));
        let second = mix(key.1 ^ first.rotate_left(32) ^ (sample >> 36).wrapping_mul(GOLDEN));
        // The state must not be all zero.
        Self(first, second | u64::from(first == 0))
    }

    #[inline]
    pub(crate) fn next(&mut self) -> u64 {
        let (a, mut b) = (self.0, self.1);
        let out = a.wrapping_add(b).rotate_left(17).wrapping_add(a);
        b ^= a;
        self.0 = a.rotate_left(49) ^ b ^ (b << 21);
        self.1 = b.rotate_left(28);
        out
    }

    /// Uniform in [0, 1), a multiple of 2⁻²⁴.
    #[cfg(test)]
    pub(crate) fn one(&mut self) -> f32 {
        unit((self.next() >> 40) as u32)
    }

    /// Two independent uniforms in [0, 1), from one word.
    #[inline]
    pub(crate) fn two(&mut self) -> [f32; 2] {
        let word = self.next();
        [unit((word >> 40) as u32), unit((word >> 8) as u32 & 0xff_ffff)]
    }
}

/// 24 bits as a number in [0, 1).
#[inline]
pub(crate) fn unit(bits: u32) -> f32 {
    bits as i32 as f32 * (1.0 / (1 << 24) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean and neighbour correlation of the first numbers of 2²⁰ neighbouring paths. Each z is standard
    /// normal; |z| < 5 fails by chance with p = 6e-7.
    #[test]
    fn neighbouring_paths_are_uncorrelated() {
        let key = Key::new(1);
        let n = 1 << 20;
        let (mut mean, mut cross) = (0.0, 0.0);
        let mut last = 0.0;
        for i in 0..n {
            let x = f64::from(Rng::new(key, i & 1023, i >> 10).one()) - 0.5;
            mean += x;
            cross += x * last;
            last = x;
        }
        let root = (n as f64).sqrt();
        assert!((mean / root * 12f64.sqrt()).abs() < 5.0);
        assert!((cross / root * 12.0).abs() < 5.0);
    }
}
