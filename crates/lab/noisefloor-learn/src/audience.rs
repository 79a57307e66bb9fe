//! The line from the thresholds of one public to those of another, fitted to pairs of thresholds.

use noisefloor::Audience;
use serde::Serialize;
use thiserror::Error;

/// Fewest pairs that a line is fitted to.
pub(crate) const MIN_PAIRS: usize = 3;
/// Most pairs that a line is fitted to: all slopes between two of them are held at once.
pub const MAX_PAIRS: usize = 2000;
/// Pairs are drawn anew, with replacement, so often; the percentiles of 1000 lines are known to about half a
/// percent.
const RESAMPLES: u64 = 1000;

/// A fitted line T′ = a·T + b and how far it can be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AudienceFit {
    pub line: Audience,
    /// Pearson correlation r of the pairs, in [−1, 1]; `None` if all T′ are the same.
    pub correlation: Option<f64>,
    /// 95 % interval of the slope, by bootstrap.
    pub slope_interval: [f64; 2],
    /// 95 % interval of the offset, in samples per pixel, by bootstrap.
    pub offset_interval: [f64; 2],
    /// Pairs that it is fitted to.
    pub pairs: usize,
}

#[derive(Debug, Error, Clone, Copy, PartialEq)]
pub enum AudienceFitError {
    #[error("a line needs {MIN_PAIRS} to {MAX_PAIRS} pairs of thresholds; there are {0}")]
    Pairs(usize),
    #[error(
        "thresholds are numbers of samples per pixel, 10⁻⁶ to 10¹⁵; pair {pair} is ({observers}, {audience})"
    )]
    Threshold {
        /// Number of the pair, from 1.
        pair: usize,
        observers: f64,
        audience: f64,
    },
    #[error("all thresholds of the observers are {0}: a line needs at least two different ones")]
    Constant(f64),
    #[error(
        "the line falls (T' = {slope:.3} T + {offset:.1}): this audience would see noise longest where the observers see it shortest; check which column is which"
    )]
    Falling { slope: f64, offset: f64 },
}

impl AudienceFit {
    /// Whether a number can be a threshold: 10⁻⁶ to 10¹⁵ samples per pixel, so that no slope between two of
    /// them overflows.
    pub fn accepts(threshold: f64) -> bool {
        (1e-6..=1e15).contains(&threshold)
    }

    /// Fits T′ = a·T + b to pairs (T, T′) of thresholds of the same zones: T of the observers that a model
    /// stands for, T′ of the audience. a is the median slope between two pairs, b the median of T′ − a·T
    /// (Theil 1950, Sen 1968): up to 29 % of the pairs may be wrong without spoiling the line. Intervals are
    /// percentiles over lines through pairs drawn with replacement (Efron 1979), seeded: the same pairs give
    /// the same intervals.
    ///
    /// ```
    /// use noisefloor::Audience;
    /// use noisefloor_learn::AudienceFit;
    /// let fit = AudienceFit::new(&[(100.0, 150.0), (200.0, 300.0), (300.0, 450.0), (400.0, 600.0), (800.0, 50.0)])?;
    /// assert_eq!(fit.line, Audience { slope: 1.5, offset: 0.0 });
    /// # Ok::<(), noisefloor_learn::AudienceFitError>(())
    /// ```
    pub fn new(pairs: &[(f64, f64)]) -> Result<Self, AudienceFitError> {
        if !(MIN_PAIRS..=MAX_PAIRS).contains(&pairs.len()) {
            return Err(AudienceFitError::Pairs(pairs.len()));
        }
        if let Some(i) = pairs.iter().position(|&(x, y)| !Self::accepts(x) || !Self::accepts(y)) {
            let (observers, audience) = pairs[i];
            return Err(AudienceFitError::Threshold { pair: i + 1, observers, audience });
        }
        let mut slopes = Vec::new();
        let (slope, offset) = theil_sen(pairs, &mut slopes).ok_or(AudienceFitError::Constant(pairs[0].0))?;
        if slope < 0.0 {
            return Err(AudienceFitError::Falling { slope, offset });
        }

        // Lines through pairs drawn anew. A drawing that has one T only has no line, and is left out.
        let mut state = 0;
        let mut drawn = Vec::with_capacity(pairs.len());
        let (mut all_slopes, mut all_offsets) = (Vec::new(), Vec::new());
        for _ in 0..RESAMPLES {
            drawn.clear();
            drawn.extend((0..pairs.len()).map(|_| pairs[below(&mut state, pairs.len())]));
            if let Some((slope, offset)) = theil_sen(&drawn, &mut slopes) {
                all_slopes.push(slope);
                all_offsets.push(offset);
            }
        }
        Ok(Self {
            line: Audience { slope, offset },
            correlation: pearson(pairs),
            slope_interval: interval(&mut all_slopes).unwrap_or([slope; 2]),
            offset_interval: interval(&mut all_offsets).unwrap_or([offset; 2]),
            pairs: pairs.len(),
        })
    }
}

/// Slope and offset; `None` if all T are the same. `slopes` is room to work in.
fn theil_sen(pairs: &[(f64, f64)], slopes: &mut Vec<f64>) -> Option<(f64, f64)> {
    slopes.clear();
    for (i, (x0, y0)) in pairs.iter().enumerate() {
        slopes.extend(pairs[..i].iter().filter(|(x, _)| x != x0).map(|(x, y)| (y - y0) / (x - x0)));
    }
    let slope = median(slopes)?;
    let mut offsets: Vec<f64> = pairs.iter().map(|(x, y)| y - slope * x).collect();
    Some((slope, median(&mut offsets)?))
}

/// The middle value, or the mean of the two middle ones; `None` without values.
fn median(values: &mut [f64]) -> Option<f64> {
    let (middle, odd) = (values.len() / 2, values.len() % 2 == 1);
    if values.is_empty() {
        return None;
    }
    let (below, &mut high, _) = values.select_nth_unstable_by(middle, f64::total_cmp);
    if odd {
        return Some(high);
    }
    let low = below.iter().copied().max_by(f64::total_cmp)?;
    Some(low + 0.5 * (high - low))
}

/// The 2.5th and 97.5th percentiles; `None` without values.
fn interval(values: &mut [f64]) -> Option<[f64; 2]> {
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    Some([0.025, 0.975].map(|share| values[(share * last as f64).round() as usize]))
}

/// Pearson correlation; `None` if a side is constant.
fn pearson(pairs: &[(f64, f64)]) -> Option<f64> {
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| pairs.iter().map(f).sum::<f64>() / pairs.len() as f64;
    let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
    let covariance = mean(&|p| (p.0 - x) * (p.1 - y));
    let r = covariance / (mean(&|p| (p.0 - x).powi(2)) * mean(&|p| (p.1 - y).powi(2))).sqrt();
    r.is_finite().then(|| r.clamp(-1.0, 1.0))
}

/// A number below `n`, by SplitMix64 (Steele, Lea and Flood 2014).
fn below(state: &mut u64, n: usize) -> usize {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((u128::from(z ^ (z >> 31)) * n as u128) >> 64) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `n` thresholds between 250 and 4250, and 1.94·T − 346 of each with errors of standard deviation
    /// `spread`.
    fn students(n: usize, spread: f64, seed: u64) -> Vec<(f64, f64)> {
        let mut state = seed;
        let mut uniform = || below(&mut state, 1 << 30) as f64 / f64::from(1 << 30);
        let mut pair = || {
            let t = 250.0 + 4000.0 * uniform();
            let bell = (uniform() + uniform() + uniform() + uniform() - 2.0) * 3f64.sqrt();
            (t, (1.94 * t - 346.0 + spread * bell).max(1.0))
        };
        (0..n).map(|_| pair()).collect()
    }

    #[test]
    fn an_exact_line_is_found_exactly() {
        let pairs: Vec<(f64, f64)> =
            (1..=9).map(|i| (f64::from(i) * 64.0, f64::from(i) * 96.0 + 32.0)).collect();
        let fit = AudienceFit::new(&pairs).unwrap();
        assert_eq!(fit.line, Audience { slope: 1.5, offset: 32.0 });
        assert_eq!((fit.slope_interval, fit.offset_interval), ([1.5; 2], [32.0; 2]));
        assert!((fit.correlation.unwrap() - 1.0).abs() < 1e-12 && fit.pairs == 9);
    }

    #[test]
    fn a_quarter_of_wrong_pairs_does_not_spoil_it() {
        let mut pairs = students(40, 0.0, 1);
        for pair in pairs.iter_mut().step_by(4) {
            pair.1 = 20_000.0;
        }
        let fit = AudienceFit::new(&pairs).unwrap();
        assert!((fit.line.slope - 1.94).abs() < 0.1 && (fit.line.offset + 346.0).abs() < 250.0, "{fit:?}");
        assert!(fit.correlation.unwrap() < 0.5, "{fit:?}");
    }

    /// The line of Takouachet et al. 2017, §7.3, lies in the interval that 95 % of simulated studies give, as
    /// often as it says: of 40 seeded ones, 38 on average, and fewer than 33 in 4 of 1000.
    #[test]
    fn the_line_of_the_paper_is_recovered() {
        let within = |[low, high]: [f64; 2], v: f64| (low..=high).contains(&v);
        let studies = (0..40).map(|seed| AudienceFit::new(&students(60, 600.0, seed)).unwrap());
        let studies: Vec<AudienceFit> = studies.collect();
        let slopes = studies.iter().filter(|fit| within(fit.slope_interval, 1.94)).count();
        let offsets = studies.iter().filter(|fit| within(fit.offset_interval, -346.0)).count();
        assert!(slopes >= 33 && offsets >= 33, "{slopes} {offsets}");
        assert!(studies.iter().all(|fit| within(fit.slope_interval, fit.line.slope)));
        assert!(studies.iter().all(|fit| fit.slope_interval[1] - fit.slope_interval[0] < 0.6));
    }

    #[test]
    fn what_gives_no_line_is_refused() {
        use AudienceFitError::{Constant, Falling, Pairs, Threshold};
        let fit = |pairs: &[(f64, f64)]| AudienceFit::new(pairs).map(|_| ()).unwrap_err();
        assert_eq!(fit(&[(1.0, 1.0), (2.0, 2.0)]), Pairs(2));
        assert_eq!(fit(&vec![(1.0, 1.0); MAX_PAIRS + 1]), Pairs(MAX_PAIRS + 1));
        assert_eq!(fit(&[(5.0, 1.0), (5.0, 2.0), (5.0, 3.0)]), Constant(5.0));
        assert!(matches!(fit(&[(1.0, 3.0), (2.0, 2.0), (3.0, 1.0)]), Falling { slope: -1.0, .. }));
        for bad in [f64::NAN, f64::INFINITY, -1.0, 0.0, 1e300, 1e-300] {
            assert!(matches!(fit(&[(1.0, 1.0), (2.0, bad), (3.0, 1.0)]), Threshold { pair: 2, .. }));
            assert!(matches!(fit(&[(1.0, 1.0), (2.0, 1.0), (bad, 1.0)]), Threshold { pair: 3, .. }));
        }
        // All T′ the same: a flat line, and no correlation.
        let flat = AudienceFit::new(&[(1.0, 7.0), (2.0, 7.0), (3.0, 7.0)]).unwrap();
        assert_eq!((flat.line, flat.correlation), (Audience { slope: 0.0, offset: 7.0 }, None));
    }

    #[test]
    fn medians_are_in_the_middle() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&mut [4.0, 1.0, 2.0, 3.0]), Some(2.5));
        assert_eq!(median(&mut []), None);
    }
}
