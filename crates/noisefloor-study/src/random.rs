//! Seeded random numbers.

/// A generator of `fastrand`. Seeds that follow each other are scattered first (SplitMix64, Steele, Lea and Flood 2014): wyrand's first numbers of
/// seeds 1, 2, 3 … are not independent, and observers drawn with them would be spread more evenly than by chance.
pub(crate) fn seeded(seed: u64) -> fastrand::Rng {
    let mut z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    fastrand::Rng::with_seed(z ^ (z >> 31))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first numbers of 33 seeds in a row have a mean that varies as that of independent ones: over 300 rows, by 1/√(12·33) = 0.0503, known to 4 %
    /// (standard error of a standard deviation, 1/√600); four of these.
    #[test]
    fn neighbouring_seeds_are_independent() {
        let mean = |row: u64| (0..33).map(|i| seeded(1000 * row + i).f64()).sum::<f64>() / 33.0 - 0.5;
        let spread = ((0..300).map(|row| mean(row).powi(2)).sum::<f64>() / 300.0).sqrt();
        assert!((spread / 0.0503 - 1.0).abs() < 0.16, "{spread}");
    }
}
