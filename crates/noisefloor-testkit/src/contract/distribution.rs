//! Samples have one distribution, however requests are cut.

use super::probe::Round;
use super::rounding::{LARGEST_Z, ROUNDING};
use crate::noise::Noise;
use noisefloor::{Rgb, source::PixelNoise};
use statrs::distribution::{ContinuousCDF, StudentsT};

/// Batches of 32 samples that are compared with as many in four parts.
pub(super) const LONG: usize = 12;
/// False-alarm rate of the comparison of means, and of that of noise.
const FALSE_ALARM: f64 = 1e-8;

/// The numbers of one batch, pixel by pixel.
type Values = Vec<f64>;

/// Means of a batch, pixel by pixel, each with its number of samples. A late renderer gives some tiles more.
type Means = Vec<(f64, f64)>;

/// Compares batches of 32 samples, asked for at once, with means of four batches of 8.
pub(super) fn check_distribution(long: &[Round], short: &[Round], pixels: PixelNoise) {
    let parts: Vec<Means> = short.iter().map(means).collect();
    let batches: Vec<Means> = long.iter().map(means).chain(parts.chunks(4).map(pool)).collect();
    let batches = deviations(&batches);
    if batches[0].is_empty() {
        return;
    }
    let level = |batch: &Values| batch.iter().sum::<f64>() / batch.len() as f64;
    let strength = |batch: &Values| batch.iter().map(|d| d * d).sum::<f64>() / batch.len() as f64;
    let linear = "are values encoded for a screen, tone mapped, clamped, or sums instead of means";
    compare("mean", linear, &batches.iter().map(level).collect::<Values>());
    let counted = "has each batch as many samples as were asked for";
    compare("noise", counted, &batches.iter().map(strength).collect::<Values>());
    if pixels == PixelNoise::Independent {
        check_ranks(&batches);
    }
}

/// Sums of the channels, tile after tile.
fn means(round: &Round) -> Means {
    let sum = |pixel: &Rgb| pixel.iter().map(|&c| f64::from(c)).sum();
    round.iter().flat_map(|batch| batch.mean.iter().map(move |p| (sum(p), batch.spp as f64))).collect()
}

/// The mean of all their samples.
fn pool(batches: &[Means]) -> Means {
    let pool = |pixel: usize| {
        let count: f64 = batches.iter().map(|b| b[pixel].1).sum();
        (batches.iter().map(|b| b[pixel].0 * b[pixel].1 / count).sum(), count)
    };
    (0..batches[0].len()).map(pool).collect()
}

/// Noise alone: deviations from the mean of all batches, as 32 samples have them, in units of each pixel's
/// standard deviation. Pixels without noise, or with a sample that is not finite, are left out.
fn deviations(batches: &[Means]) -> Vec<Values> {
    let centre = pool(batches);
    let deviation = |batch: &Means, pixel: usize| {
        let (mean, count) = batch[pixel];
        (mean - centre[pixel].0) * (count / 32.0).sqrt()
    };
    let mut noisy = Vec::new();
    for (pixel, &(centre, _)) in centre.iter().enumerate() {
        let squares = batches.iter().map(|batch| deviation(batch, pixel).powi(2));
        let unit = (squares.sum::<f64>() / batches.len() as f64).sqrt();
        if unit.is_finite() && unit > ROUNDING * centre.abs() {
            noisy.push((pixel, unit));
        }
    }
    let deviations = |batch| noisy.iter().map(|&(pixel, unit)| deviation(batch, pixel) / unit).collect();
    batches.iter().map(deviations).collect()
}

/// Compares one number of each long batch with that of each batch in parts.
fn compare(what: &str, question: &str, numbers: &[f64]) {
    let (long, short) = numbers.split_at(LONG);
    let mean = |numbers: &[f64]| numbers.iter().sum::<f64>() / numbers.len() as f64;
    assert!(
        welch(long, short) > FALSE_ALARM,
        "the {what} of 32 samples depends on how requests are cut: {question}? \
         It is {:.3} at once and {:.3} in four parts of 8, on average over {LONG} batches each, \
         where the noise of 32 samples is 1",
        mean(long),
        mean(short),
    );
}

/// Probability that the means of two groups differ by as much, or more, by chance: Welch's t-test (1947),
/// two-sided.
fn welch(a: &[f64], b: &[f64]) -> f64 {
    let [(mean_a, error_a, freedom_a), (mean_b, error_b, freedom_b)] = [a, b].map(|group| {
        let n = group.len() as f64;
        let mean = group.iter().sum::<f64>() / n;
        let variance = group.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (mean, variance / n, n - 1.0)
    });
    let error = error_a + error_b;
    let freedom = error * error / (error_a * error_a / freedom_a + error_b * error_b / freedom_b);
    let t = StudentsT::new(0.0, 1.0, freedom).expect("noisy batches vary");
    2.0 * t.sf((mean_a - mean_b).abs() / error.sqrt())
}

/// In no pixel are the long batches higher or lower than the others, on the whole: the Kolmogorov–Smirnov
/// comparison by pixel.
fn check_ranks(batches: &[Values]) {
    let pixels = batches[0].len() as f64;
    let all = batches.len() as f64;
    let mut below = 0.0;
    for (rank, count) in long_batches_by_rank(batches).into_iter().enumerate().take(batches.len() - 1) {
        // Of the lowest `drawn` of all batches, half of them long: hypergeometric
        below += count;
        let drawn = (rank + 1) as f64;
        let variance = drawn * 0.25 * (all - drawn) / (all - 1.0) * pixels;
        let z = (below - drawn / 2.0 * pixels) / variance.sqrt();
        assert!(
            z.abs() < LARGEST_Z,
            "the distribution of 32 samples depends on how requests are cut: z = {z} at quantile {:.2}",
            drawn / all
        );
    }
}

/// How many pixels have a long batch at each rank.
fn long_batches_by_rank(batches: &[Values]) -> Vec<f64> {
    // Equal values have no rank of their own. Their order must be as good as chance, and chance must not know
    // which are long
    let mut chance = Noise::new(0);
    let mut counts = vec![0.0; batches.len()];
    for pixel in 0..batches[0].len() {
        let mut ranked: Vec<(f64, u64, bool)> = Vec::new();
        for (batch, values) in batches.iter().enumerate() {
            ranked.push((values[pixel], chance.bits(), batch < LONG));
        }
        ranked.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (count, (.., long)) in counts.iter_mut().zip(ranked) {
            *count += f64::from(u8::from(long));
        }
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As `scipy.stats.ttest_ind(a, b, equal_var=False)` has it: t = −2.00455, ν = 6.97447.
    #[test]
    fn welch_is_as_published() {
        let p = welch(&[1.0, 2.0, 4.0, 7.0], &[3.0, 5.0, 9.0, 9.5, 12.0]);
        assert!((p - 0.085_195_899_6).abs() < 1e-9, "{p}");
    }

    /// Batches that are equal in every pixel tell nothing, and pass. By chance one of 23 comparisons fails
    /// with p < 5e-8.
    #[test]
    fn equal_values_are_ranked_by_chance() {
        check_ranks(&vec![vec![0.0; 10_000]; 2 * LONG]);
    }
}
