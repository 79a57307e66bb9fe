//! What people saw: the difference from a last picture that has noise of its own.
//!
//! Observers compare a picture of n samples with the last one of its scene, of N samples, which contains them.
//! The variance of that difference is σ²(1/n − 1/N), not σ²/n: near the last picture there is hardly anything to
//! see, however noisy both are. A rendering has no last picture beside it. What is learned from the difference is
//! therefore kept as the samples m at which noise itself is as strong: 1/m = 1/n − 1/N.

/// The samples per pixel whose noise is as strong as the difference between a picture of `spp` samples and one of
/// `reference_spp` that contains them. Infinite if the two are one; `spp` if the reference is clean (infinite).
pub fn as_noise(spp: f64, reference_spp: f64) -> f64 {
    1.0 / (1.0 / spp - 1.0 / reference_spp).max(0.0)
}

/// The inverse of [`as_noise`]: the samples per pixel of a picture that differs from one of `reference_spp` samples,
/// which contains them, as strongly as the noise of `noise_spp` samples is.
pub fn as_difference(noise_spp: f64, reference_spp: f64) -> f64 {
    1.0 / (1.0 / noise_spp + 1.0 / reference_spp)
}

/// The column of thresholds and tables that says what people compared with.
pub(crate) const REFERENCE: &str = "reference_spp";

/// `inf` is a reference without noise.
pub(crate) fn parse_reference(text: &str) -> Result<f64, String> {
    let spp = text.parse::<f64>().ok().filter(|spp| *spp > 0.0);
    spp.ok_or_else(|| format!("{REFERENCE} is {text:?}, neither a number of samples nor inf"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use noisefloor_testkit::Noise;

    /// The measured difference of nested means has the variance of the noise that it is worth.
    #[test]
    fn a_difference_is_as_strong_as_the_noise_that_it_is_said_to_be() {
        let mut noise = Noise::new(7);
        let (n, all, draws) = (30u32, 50u32, 20_000);
        let mut squares = 0.0;
        for _ in 0..draws {
            let samples: Vec<f64> = (0..all).map(|_| noise.normal()).collect();
            let mean = |count: u32| samples[..count as usize].iter().sum::<f64>() / f64::from(count);
            squares += (mean(n) - mean(all)).powi(2);
        }
        let variance = squares / f64::from(draws);
        // 1/75; a variance of 20,000 draws errs by 1 %, so 4 % is four standard errors
        let expected = 1.0 / as_noise(f64::from(n), f64::from(all));
        assert!((expected * 75.0 - 1.0).abs() < 1e-12);
        assert!((variance / expected - 1.0).abs() < 0.04, "{variance} {expected}");
    }

    #[test]
    fn each_undoes_the_other_up_to_a_clean_reference_and_the_last_picture() {
        assert!((as_difference(as_noise(300.0, 900.0), 900.0) - 300.0).abs() < 1e-9);
        assert_eq!(as_noise(300.0, f64::INFINITY), 300.0);
        assert_eq!(as_noise(900.0, 900.0), f64::INFINITY);
        assert_eq!(as_difference(f64::INFINITY, 900.0), 900.0);
    }
}
