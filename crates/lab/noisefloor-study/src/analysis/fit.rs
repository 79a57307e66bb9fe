//! How the thresholds of a tile are spread over observers, and where 95 % of them see no difference.
//!
//! With thirty observers nobody sees the shape of the spread, but the 95 % level depends on it. The posterior
//! is therefore taken over median, width and shape (`shapes`) and a share of slips, on a grid;
//! estimates are posterior medians, intervals hold 95 % of the posterior. How often they hold the truth is
//! tested in `tests/it/coverage.rs`.

use super::shapes::{SHAPES, Shape};
use noisefloor_pages::questplus::Posterior;
use statrs::distribution::{ChiSquared, ContinuousCDF};

/// Shares of stops that may be slips, anywhere in the stack (Wichmann and Hill 2001, "The psychometric
/// function: I", §2): without any, one slip would widen the curve of a whole tile.
const SLIPS: [f64; 3] = [5e-4, 0.02, 0.06];
/// Distances between the quartiles that are considered, in ln(spp).
const WIDTHS: [f64; 2] = [0.02, 4.0];
/// Medians and widths of the first, coarse grid, and of the second one, around what the first one leaves.
const COARSE: [usize; 2] = [24, 14];
const FINE: [usize; 2] = [36, 20];
/// Hypotheses less likely than the best one by e to this power are left out of the second grid.
const NEGLIGIBLE: f64 = 10.0;
/// Fewest expected stops in a cell of the test of fit.
const CELL: f64 = 5.0;

/// What is known about one threshold, in ln(spp).
#[derive(Clone, Debug, PartialEq)]
pub enum Observation {
    /// It lies between two levels: a difference is seen at `above`, none at `to`. `None` where the stack
    /// ends.
    Between {
        /// Last level at which a difference is seen.
        above: Option<f64>,
        /// First level at which none is seen; `None` if the observer went on to the reference.
        to: Option<f64>,
        /// Number of levels of the stack: where a slip may end.
        levels: usize,
    },
    /// It was measured: a posterior.
    Measured(Posterior),
}

impl Observation {
    /// A stop at `level` of a stack with samples per pixel `spp`.
    pub fn stop(level: u32, spp: &[u64]) -> Self {
        let (level, last) = (level as usize, spp.len() - 1);
        let ln = |level: usize| spp.get(level).map(|&n| (n.max(1) as f64).ln());
        let above = level.checked_sub(1).and_then(ln);
        Self::Between { above, to: if level < last { ln(level) } else { None }, levels: spp.len() }
    }

    fn middle(&self) -> f64 {
        match *self {
            Self::Between { above, to, .. } => match (above, to) {
                (Some(a), Some(b)) => 0.5 * (a + b),
                (Some(x), None) | (None, Some(x)) => x,
                (None, None) => 0.0,
            },
            Self::Measured(ref known) => known.moments().0,
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Hypothesis {
    median: f64,
    width: f64,
    shape: &'static Shape,
    slips: f64,
}

impl Hypothesis {
    fn share(&self, x: f64) -> f64 {
        self.shape.share((x - self.median) / self.width)
    }

    fn level95(&self) -> f64 {
        self.median + self.width * self.shape.to_level95
    }

    /// Likelihood of each observation without slips.
    fn likelihoods(&self, observations: &[(Observation, f64)]) -> Vec<f64> {
        // Measurements of one tile share their values: the shares between them are computed once
        let mut bins: (f64, f64, Vec<f64>) = (0.0, 0.0, Vec::new());
        let likelihood = |(observation, _): &(Observation, f64)| match observation {
            &Observation::Between { above, to, .. } => {
                to.map_or(1.0, |x| self.share(x)) - above.map_or(0.0, |x| self.share(x))
            }
            Observation::Measured(known) => {
                if (bins.0, bins.1, bins.2.len()) != (known.low, known.step, known.weights.len()) {
                    let edge = |i: usize| self.share(known.low + known.step * (i as f64 - 0.5));
                    let edges: Vec<f64> = (0..=known.weights.len()).map(edge).collect();
                    bins = (known.low, known.step, edges.windows(2).map(|e| e[1] - e[0]).collect());
                }
                known.weights.iter().zip(&bins.2).map(|(w, b)| w * b).sum()
            }
        };
        observations.iter().map(likelihood).collect()
    }

    /// Logarithm of the likelihood of observations, each with a weight, from those without slips.
    fn ln_likelihood(&self, observations: &[(Observation, f64)], without_slips: &[f64]) -> f64 {
        let mut sum = 0.0;
        for ((observation, weight), &inside) in observations.iter().zip(without_slips) {
            let likelihood = match observation {
                Observation::Between { levels, .. } => {
                    (1.0 - self.slips) * inside + self.slips / *levels as f64
                }
                Observation::Measured(_) => inside,
            };
            sum += weight * likelihood.max(1e-12).ln();
        }
        sum
    }
}

/// An estimate with the interval that holds 95 % of the posterior.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Estimate {
    pub(super) value: f64,
    /// 2.5 % and 97.5 % of the posterior.
    pub(super) interval: [f64; 2],
}

/// The spread of the thresholds of one tile.
#[derive(Clone, Debug)]
pub(super) struct ThresholdFit {
    /// ln(spp) at which half of the observers see no difference.
    pub(super) median: Estimate,
    /// ln(spp) at which 95 % see none.
    pub(super) level95: Estimate,
    /// Distance between the quartiles of the best hypothesis, in ln(spp).
    pub(super) width: f64,
    best: Hypothesis,
}

impl ThresholdFit {
    /// Fits observations, each with a weight above 0; `None` without any. Weights below 1 say that
    /// observations repeat each other, as showings to one observer do.
    pub(super) fn new(observations: &[(Observation, f64)]) -> Option<Self> {
        let weight: f64 = observations.iter().map(|(_, w)| w).sum();
        if weight <= 0.0 || !weight.is_finite() {
            return None;
        }
        let middles = || observations.iter().map(|(o, _)| o.middle());
        let (low, high) =
            (middles().fold(f64::INFINITY, f64::min), middles().fold(f64::NEG_INFINITY, f64::max));
        let ln_widths = WIDTHS.map(f64::ln);
        let coarse = posterior(observations, [low - 1.0, high + 1.0], ln_widths, COARSE);
        let best = coarse.iter().map(|(l, _)| *l).fold(f64::NEG_INFINITY, f64::max);
        let left = || coarse.iter().filter(|(l, _)| *l > best - NEGLIGIBLE).map(|(_, h)| h);
        let span = |of: &dyn Fn(&Hypothesis) -> f64, margin: f64| {
            let (from, to) =
                left().map(of).fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
            [from - margin, to + margin]
        };
        let medians = span(&|h| h.median, (high - low + 2.0) / COARSE[0] as f64);
        let margin = (ln_widths[1] - ln_widths[0]) / COARSE[1] as f64;
        let [thin, wide] = span(&|h| h.width.ln(), margin);
        let fine = posterior(observations, medians, [thin.max(ln_widths[0]), wide.min(ln_widths[1])], FINE);
        let (_, best) = fine.iter().copied().reduce(|a, b| if b.0 > a.0 { b } else { a })?;
        Some(Self {
            median: estimate(&fine, |h| h.median),
            level95: estimate(&fine, Hypothesis::level95),
            width: best.width,
            best,
        })
    }

    /// Share of observers who see no difference at this many samples per pixel, of the best hypothesis.
    pub(super) fn share(&self, spp: f64) -> f64 {
        self.best.share(spp.ln())
    }

    /// Probability of stops at least as unlike the best hypothesis as these, if it were true (Pearson's χ²
    /// over cells of five expected stops, divided by `design`, the factor by which repeated showings raise
    /// it). `None` for fewer than five cells.
    pub(super) fn fit_probability(&self, stops: &[u32], spp: &[u64], design: f64) -> Option<f64> {
        let n = stops.len() as f64;
        let ln = |level: usize| (spp[level].max(1) as f64).ln();
        let slip = self.best.slips / spp.len() as f64;
        let (mut cells, mut cell, mut below) = (Vec::new(), [0.0, 0.0], 0.0);
        for level in 0..spp.len() {
            let share = if level + 1 < spp.len() { self.best.share(ln(level)) } else { 1.0 };
            cell[0] += stops.iter().filter(|s| **s as usize == level).count() as f64;
            cell[1] += n * ((1.0 - self.best.slips) * (share - below) + slip);
            below = share;
            if cell[1] >= CELL {
                cells.push(std::mem::take(&mut cell));
            }
        }
        // What is left joins the last cell
        let last = cells.last_mut()?;
        (last[0], last[1]) = (last[0] + cell[0], last[1] + cell[1]);
        let freedom = cells.len().checked_sub(4).filter(|f| *f > 0)?;
        let chi: f64 = cells.iter().map(|[seen, expected]| (seen - expected).powi(2) / expected).sum();
        Some(ChiSquared::new(freedom as f64).ok()?.sf(chi / design))
    }
}

/// Hypotheses on a grid of medians and ln(width), with the logarithm of their posterior.
fn posterior(
    observations: &[(Observation, f64)],
    medians: [f64; 2],
    ln_widths: [f64; 2],
    counts: [usize; 2],
) -> Vec<(f64, Hypothesis)> {
    let at = |[from, to]: [f64; 2], i: usize, n: usize| from + (to - from) * i as f64 / (n - 1) as f64;
    let slips = if observations.iter().any(|(o, _)| matches!(o, Observation::Between { .. })) {
        &SLIPS[..]
    } else {
        &SLIPS[..1]
    };
    let mut all = Vec::with_capacity(counts[0] * counts[1] * SHAPES.len() * slips.len());
    for shape in SHAPES.iter() {
        for width in 0..counts[1] {
            for median in 0..counts[0] {
                let width = at(ln_widths, width, counts[1]).exp();
                let of = |slips| Hypothesis { median: at(medians, median, counts[0]), width, shape, slips };
                let without_slips = of(0.0).likelihoods(observations);
                for &slips in slips {
                    let ln_likelihood = of(slips).ln_likelihood(observations, &without_slips);
                    all.push((shape.ln_prior + ln_likelihood, of(slips)));
                }
            }
        }
    }
    all
}

/// Quantiles of a quantity over the posterior.
fn estimate(posterior: &[(f64, Hypothesis)], of: impl Fn(&Hypothesis) -> f64) -> Estimate {
    let best = posterior.iter().map(|(l, _)| *l).fold(f64::NEG_INFINITY, f64::max);
    let mut values: Vec<(f64, f64)> = posterior.iter().map(|(l, h)| (of(h), (l - best).exp())).collect();
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = values.iter().map(|v| v.1).sum();
    let quantile = |share: f64| {
        let mut sum = 0.0;
        let found = values.iter().find(|(_, weight)| {
            sum += weight;
            sum >= share * total
        });
        found.or(values.last()).map_or(f64::NAN, |(value, _)| *value)
    };
    Estimate { value: quantile(0.5), interval: [quantile(0.025), quantile(0.975)] }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn papers() -> Vec<u64> {
        (1..=100).map(|i| 100 * i).collect()
    }

    /// Quantiles (i + ½)/n of a logistic distribution stand for a sample without chance: found again to 3 %.
    #[test]
    fn a_known_distribution_is_found_again() {
        let (centre, scale) = (2500f64.ln(), 0.3);
        let quantile = |i: usize| {
            let p = (i as f64 + 0.5) / 400.0;
            centre + scale * (p / (1.0 - p)).ln()
        };
        let spp = papers();
        let stop = |x: f64| spp.iter().position(|&n| (n as f64).ln() >= x).unwrap_or(99) as u32;
        let levels: Vec<u32> = (0..400).map(|i| stop(quantile(i))).collect();
        let stops: Vec<_> = levels.iter().map(|&l| (Observation::stop(l, &spp), 1.0)).collect();
        let fit = ThresholdFit::new(&stops).unwrap();
        let truth = centre + scale * 19f64.ln();
        assert!((fit.median.value - centre).abs() < 0.03, "{fit:?}");
        assert!((fit.level95.value - truth).abs() < 0.06, "{fit:?} {truth}");
        assert!(fit.level95.interval[0] < truth && truth < fit.level95.interval[1]);
        assert!(fit.fit_probability(&levels, &spp, 1.0).unwrap() > 0.05);
        // Two groups far apart are no spread of any of the shapes
        let two: Vec<u32> = (0..200).map(|i| if i % 2 == 0 { 4 + i % 3 } else { 80 + i % 5 }).collect();
        let stops: Vec<_> = two.iter().map(|&l| (Observation::stop(l, &spp), 1.0)).collect();
        let fit = ThresholdFit::new(&stops).unwrap();
        assert!(fit.fit_probability(&two, &spp, 1.0).unwrap() < 0.01);
    }

    #[test]
    fn single_answers_and_the_ends_of_the_stack_are_no_trouble() {
        let spp = [10, 100, 1000];
        assert!(ThresholdFit::new(&[]).is_none());
        for level in 0..3 {
            let fit = ThresholdFit::new(&[(Observation::stop(level, &spp), 1.0)]).unwrap();
            assert!(fit.level95.value.is_finite(), "{fit:?}");
        }
    }

    /// One slip to the noisiest level among twenty equal stops does not move the estimate.
    #[test]
    fn a_slip_moves_little() {
        let spp = papers();
        let level95 = |slips: usize| {
            let mut all = vec![(Observation::stop(60, &spp), 20.0)];
            all.extend((0..slips).map(|_| (Observation::stop(0, &spp), 1.0)));
            ThresholdFit::new(&all).unwrap().level95.value
        };
        assert!((level95(1) - level95(0)).abs() < 0.05, "{} {}", level95(1), level95(0));
    }

    /// A normal error that is known is taken out of the spread.
    #[test]
    fn known_errors_do_not_count_as_spread() {
        let measured = |mean: f64, sd: f64| {
            let (low, step) = (4.0, 0.01);
            let weight = |i: i32| (-0.5 * ((low + step * f64::from(i) - mean) / sd).powi(2)).exp();
            let weights: Vec<f64> = (0..700).map(weight).collect();
            let sum: f64 = weights.iter().sum();
            let weights = weights.iter().map(|w| w / sum).collect();
            Observation::Measured(Posterior { low, step, weights })
        };
        let width = |sd: f64| {
            let z = [-1.5, -1.0, -0.6, -0.3, -0.1, 0.1, 0.3, 0.6, 1.0, 1.5];
            let all: Vec<_> = z.iter().map(|z| (measured(7.0 + 0.3 * z, sd), 1.0)).collect();
            ThresholdFit::new(&all).unwrap().width
        };
        assert!(width(0.3) < 0.2 && width(0.01) > 0.25, "{} {}", width(0.3), width(0.01));
    }
}
