//! Seeded random numbers.

/// A `fastrand` generator whose seed is scrambled first (SplitMix64; Steele, Lea and Flood 2014). The first
/// numbers that wyrand draws from seeds 1, 2, 3 … are correlated, so observers drawn from consecutive seeds
/// would be spread more evenly than chance.
pub fn seeded(seed: u64) -> fastrand::Rng {
    let mut z = seed.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    fastrand::Rng::with_seed(z ^ (z >> 31))
}

/// A logistic number of mean 0.
pub fn logistic(random: &mut fastrand::Rng, scale: f64) -> f64 {
    let u = random.f64().clamp(1e-12, 1.0 - 1e-12);
    scale * (u / (1.0 - u)).ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean of the first numbers of 33 consecutive seeds varies as it would for independent numbers:
    /// its standard deviation over 300 rows is 1/√(12·33) = 0.0503. The standard error of that is 4 %
    /// (1/√600); the tolerance is four of them.
    #[test]
    fn neighbouring_seeds_are_independent() {
        let mean = |row: u64| (0..33).map(|i| seeded(1000 * row + i).f64()).sum::<f64>() / 33.0 - 0.5;
        let spread = ((0..300).map(|row| mean(row).powi(2)).sum::<f64>() / 300.0).sqrt();
        assert!((spread / 0.0503 - 1.0).abs() < 0.16, "{spread}");
    }
}
