//! Intervals: Wilson's for shares, the bootstrap over observers for everything else.

use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

/// Two-sided normal quantile of a 95 % interval.
const Z: f64 = 1.959_963_984_540_054;
/// Number of bootstrap resamples.
pub(super) const RESAMPLES: usize = 1000;

/// The 95 % interval of a share of `yes` among `of` independent answers, one at least (Wilson 1927; Brown, Cai and
/// DasGupta 2001, eq. 4).
pub(super) fn wilson(yes: usize, of: usize) -> [f64; 2] {
    let (n, p) = (of as f64, yes as f64 / of as f64);
    let (middle, width) = (p + Z * Z / (2.0 * n), Z * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt());
    let end = |sign: f64| ((middle + sign * width) / (1.0 + Z * Z / n)).clamp(0.0, 1.0);
    // Rounding must not leave the share outside its own interval
    [end(-1.0).min(p), end(1.0).max(p)]
}

/// The 95 % intervals of some statistics over observers: observers are drawn anew, with replacement,
/// [`RESAMPLES`] times, and `statistics` is told how often each was drawn; `found` are their values for all
/// observers once. Seeded. Percentiles are bias-corrected (Efron and Tibshirani 1993, "An introduction to
/// the bootstrap", §14.3, without acceleration) and moved out by Student's t and n/(n−1), since those of
/// few observers are too narrow (Hesterberg 2015, "What teachers should know about the bootstrap", §3.3).
/// `None` for fewer than two observers, or if no drawing has finite values.
pub(super) fn bootstrap<const N: usize>(
    observers: usize,
    seed: u64,
    found: [f64; N],
    statistics: impl Fn(&[f64]) -> Option<[f64; N]>,
) -> Option<[[f64; 2]; N]> {
    if observers < 2 {
        return None;
    }
    let mut random = noisefloor_pages::random::seeded(seed);
    let mut weights = vec![0.0; observers];
    let draw = |_| {
        weights.fill(0.0);
        for _ in 0..observers {
            weights[random.usize(0..observers)] += 1.0;
        }
        statistics(&weights).filter(|values| values.iter().all(|v| v.is_finite()))
    };
    let drawn: Vec<[f64; N]> = (0..RESAMPLES).filter_map(draw).collect();
    let last = drawn.len().checked_sub(1)? as f64;

    let n = observers as f64;
    let t = StudentsT::new(0.0, 1.0, n - 1.0).ok()?.inverse_cdf(0.975);
    let (wide, normal) = (t * (n / (n - 1.0)).sqrt(), Normal::standard());
    Some(std::array::from_fn(|i| {
        let mut values: Vec<f64> = drawn.iter().map(|values| values[i]).collect();
        values.sort_by(f64::total_cmp);
        // Share of drawings below what was found; of equal ones, half
        let [below, up_to] =
            [values.partition_point(|v| *v < found[i]), values.partition_point(|v| *v <= found[i])];
        let share = (0.5 * (below + up_to) as f64 / values.len() as f64).clamp(0.01, 0.99);
        let bias = 2.0 * normal.inverse_cdf(share);
        [bias - wide, bias + wide].map(|z| values[(normal.cdf(z) * last).round() as usize])
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Known values of Wilson's interval: for 0 of 10 it ends at z²/(10 + z²); for 5 of 10 it is centred on
    /// one half.
    #[test]
    fn wilson_has_known_values() {
        let none = wilson(0, 10);
        assert!(none[0] == 0.0 && (none[1] - Z * Z / (10.0 + Z * Z)).abs() < 1e-12);
        let half = wilson(5, 10);
        assert!((half[0] - 0.2366).abs() < 1e-4 && (half[1] - 0.7634).abs() < 1e-4, "{half:?}");
        assert_eq!(wilson(10, 10)[1], 1.0);
    }

    /// The interval of a mean of 20 normal values covers the truth in 95 % of 400 seeded studies, within
    /// 3.5 standard errors of a share of 400 (±3.8 %): wrong by chance once in 2000.
    #[test]
    fn the_bootstrap_covers_a_mean_as_often_as_it_says() {
        let covered = (0..400).filter(|&seed| {
            let mut random = noisefloor_pages::random::seeded(seed);
            let values: Vec<f64> =
                (0..20).map(|_| (0..12).map(|_| random.f64()).sum::<f64>() - 6.0).collect();
            let mean = |w: &[f64]| Some([values.iter().zip(w).map(|(v, w)| v * w).sum::<f64>() / 20.0]);
            let [[low, high]] = bootstrap(20, seed, mean(&[1.0; 20]).unwrap(), mean).unwrap();
            low <= 0.0 && 0.0 <= high
        });
        let share = covered.count() as f64 / 400.0;
        assert!((share - 0.95).abs() < 0.038, "{share}");
    }

    #[test]
    fn one_observer_has_no_interval() {
        assert_eq!(bootstrap(1, 0, [1.0], |_| Some([1.0])), None);
        assert_eq!(bootstrap(5, 0, [1.0], |_| None), None);
    }
}
