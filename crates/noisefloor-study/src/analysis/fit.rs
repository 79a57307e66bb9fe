//! How thresholds of a tile are spread over observers: a logistic distribution in ln(spp), fitted by
//! maximum likelihood.
//!
//! The share of observers who see no difference at n samples per pixel is then F(ln n), the psychometric
//! function of the public, and 95 % see none at ln n = μ + s·ln 19.

use crate::questplus::Posterior;
use std::f64::consts::PI;

/// Shares of stops that may be slips, anywhere in the stack: the likeliest is taken. With none, one slip
/// would widen the curve of a whole tile; with more than there are, the curve would be too narrow (Wichmann
/// and Hill 2001, "The psychometric function: I", §2).
const SLIPS: [f64; 4] = [1e-4, 0.01, 0.02, 0.05];
/// ln(95 % / 5 %): where 95 % see no difference, in scales above the median.
pub const LN_19: f64 = 2.944_438_979_166_440_3;
/// Scales that are looked for, in ln(spp). A tile whose observers all stop at one level has the smallest.
const SCALES: [f64; 2] = [0.01, 2.0];
/// What is known of one threshold, in ln(spp).
#[derive(Clone, Debug, PartialEq)]
pub enum Observation {
    /// It lies between two levels: a difference is seen at `above`, none at `to`. `None` where the stack
    /// ends.
    Between {
        /// Last level at which a difference is seen.
        above: Option<f64>,
        /// First level at which none is seen; `None` if the observer went on to the reference.
        to: Option<f64>,
        /// Levels of the stack: where a slip may end.
        levels: usize,
    },
    /// It was measured: the likelihood of each value is known.
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

    /// Where it is, roughly: what the search begins with.
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

/// Logarithm of the likelihood of all observations under a logistic distribution.
fn log_likelihood(observations: &[(Observation, f64)], centre: f64, scale: f64, slips: f64) -> f64 {
    let share = |x: f64| 1.0 / (1.0 + ((centre - x) / scale).exp());
    // Share of observers between the middles on both sides of each value of a measurement: right also for
    // curves narrower than a step. Measurements of one tile have the same values
    let mut bins: (f64, f64, Vec<f64>) = (0.0, 0.0, Vec::new());
    let mut sum = 0.0;
    for (observation, weight) in observations {
        let likelihood = match observation {
            &Observation::Between { above, to, levels } => {
                let inside = to.map_or(1.0, share) - above.map_or(0.0, share);
                (1.0 - slips) * inside + slips / levels as f64
            }
            Observation::Measured(known) => {
                if (bins.0, bins.1, bins.2.len()) != (known.low, known.step, known.weights.len()) {
                    let edge = |i: usize| share(known.low + known.step * (i as f64 - 0.5));
                    let edges: Vec<f64> = (0..=known.weights.len()).map(edge).collect();
                    bins = (known.low, known.step, edges.windows(2).map(|e| e[1] - e[0]).collect());
                }
                known.weights.iter().zip(&bins.2).map(|(w, b)| w * b).sum()
            }
        };
        sum += weight * likelihood.max(1e-300).ln();
    }
    sum
}

/// A fitted distribution of thresholds, in ln(spp).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Logistic {
    /// Median μ.
    pub centre: f64,
    /// Scale s; the standard deviation is s·π/√3.
    pub scale: f64,
    /// Share of stops taken for slips.
    pub slips: f64,
}

impl Logistic {
    /// Fits observations, each with its weight, at least one of them above 0. `None` without any.
    pub fn fit(observations: &[(Observation, f64)]) -> Option<Self> {
        let fits = SLIPS.into_iter().filter_map(|slips| Self::fit_with(observations, slips));
        let likelihood = |fit: &Self| log_likelihood(observations, fit.centre, fit.scale, fit.slips);
        // The first of equals: measured thresholds know of no slips
        fits.map(|fit| (likelihood(&fit), fit))
            .reduce(|a, b| if b.0 > a.0 + 1e-9 { b } else { a })
            .map(|(_, fit)| fit)
    }

    /// The same with a known share of slips.
    pub fn fit_with(observations: &[(Observation, f64)], slips: f64) -> Option<Self> {
        let weight: f64 = observations.iter().map(|(_, w)| w).sum();
        if weight <= 0.0 || !weight.is_finite() {
            return None;
        }
        let mean = observations.iter().map(|(o, w)| w * o.middle()).sum::<f64>() / weight;
        let spread = observations.iter().map(|(o, w)| w * (o.middle() - mean).powi(2)).sum::<f64>() / weight;
        let start = (spread.sqrt() * 3f64.sqrt() / PI).clamp(0.05, 1.0);

        let badness = |[centre, ln_scale]: [f64; 2]| {
            let scale = ln_scale.exp();
            // Beyond the scales looked for the likelihood is flat or falls: the search is led back
            let outside = (SCALES[0] / scale).ln().max((scale / SCALES[1]).ln()).max(0.0);
            1e3 * outside - log_likelihood(observations, centre, scale, slips)
        };
        let [centre, ln_scale] = minimum(badness, [mean, start.ln()], [start, 0.5]);
        Some(Self { centre, scale: ln_scale.exp().clamp(SCALES[0], SCALES[1]), slips })
    }

    /// Samples per pixel at which 95 % see no difference.
    pub fn level95(&self) -> f64 {
        (self.centre + self.scale * LN_19).exp()
    }

    /// Share who see no difference at so many samples per pixel.
    pub fn share(&self, spp: f64) -> f64 {
        1.0 / (1.0 + ((self.centre - spp.ln()) / self.scale).exp())
    }
}

/// The minimum of a function of two variables by the downhill simplex (Nelder and Mead 1965), from `start`
/// with steps `step`.
fn minimum(f: impl Fn([f64; 2]) -> f64, start: [f64; 2], step: [f64; 2]) -> [f64; 2] {
    let at = |x: [f64; 2]| (f(x), x);
    let mut simplex = [at(start), at([start[0] + step[0], start[1]]), at([start[0], start[1] + step[1]])];
    for _ in 0..200 {
        simplex.sort_by(|a, b| a.0.total_cmp(&b.0));
        let [best, good, worst] = simplex;
        let size = (best.1[0] - worst.1[0]).abs() + (best.1[1] - worst.1[1]).abs();
        if size < 1e-5 {
            break;
        }
        let middle = [0.5 * (best.1[0] + good.1[0]), 0.5 * (best.1[1] + good.1[1])];
        let along =
            |t: f64| at([middle[0] + t * (worst.1[0] - middle[0]), middle[1] + t * (worst.1[1] - middle[1])]);
        let reflected = along(-1.0);
        simplex[2] = if reflected.0 < best.0 {
            let expanded = along(-2.0);
            if expanded.0 < reflected.0 { expanded } else { reflected }
        } else if reflected.0 < good.0 {
            reflected
        } else {
            let contracted = along(if reflected.0 < worst.0 { -0.5 } else { 0.5 });
            if contracted.0 < worst.0.min(reflected.0) {
                contracted
            } else {
                // Nothing along the line is better: shrink towards the best
                let half = |x: [f64; 2]| at([0.5 * (x[0] + best.1[0]), 0.5 * (x[1] + best.1[1])]);
                simplex[1] = half(good.1);
                half(worst.1)
            }
        };
    }
    simplex.sort_by(|a, b| a.0.total_cmp(&b.0));
    simplex[0].1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_simplex_finds_the_valley() {
        // Rosenbrock's function has its minimum at (1, 1).
        let [x, y] =
            minimum(|[x, y]| (1.0 - x).powi(2) + 100.0 * (y - x * x).powi(2), [-1.2, 1.0], [0.5, 0.5]);
        assert!((x - 1.0).abs() < 1e-3 && (y - 1.0).abs() < 1e-3, "{x} {y}");
    }

    /// Quantiles (i + ½)/n of a logistic distribution stand for a sample without chance: fitted back to 2 %.
    #[test]
    fn a_known_distribution_is_fitted_back() {
        let (centre, scale) = (2500f64.ln(), 0.3);
        let quantile = |i: usize| {
            let p = (i as f64 + 0.5) / 400.0;
            centre + scale * (p / (1.0 - p)).ln()
        };
        let spp: Vec<u64> = (1..=100).map(|i| 100 * i).collect();
        let stop = |x: f64| spp.iter().position(|&n| (n as f64).ln() >= x).unwrap_or(99) as u32;
        let stops: Vec<_> = (0..400).map(|i| (Observation::stop(stop(quantile(i)), &spp), 1.0)).collect();
        let fit = Logistic::fit(&stops).unwrap();
        assert!((fit.centre - centre).abs() < 0.02 && (fit.scale / scale - 1.0).abs() < 0.08, "{fit:?}");
        let measured: Vec<_> = (0..400).map(|i| (measured(quantile(i), 1e-3), 1.0)).collect();
        let fit = Logistic::fit(&measured).unwrap();
        assert!((fit.centre - centre).abs() < 0.005 && (fit.scale / scale - 1.0).abs() < 0.02, "{fit:?}");
        assert!((fit.level95() / (centre + scale * LN_19).exp() - 1.0).abs() < 0.02);
        assert!((fit.share(fit.level95()) - 0.95).abs() < 1e-9);
    }

    /// A measurement with a normal error, at steps of a hundredth.
    fn measured(mean: f64, sd: f64) -> Observation {
        let (low, step) = (4.0, 0.01);
        let weight = |i: i32| (-0.5 * ((low + step * f64::from(i) - mean) / sd.max(0.005)).powi(2)).exp();
        let weights: Vec<f64> = (0..700).map(weight).collect();
        let sum: f64 = weights.iter().sum();
        Observation::Measured(Posterior { low, step, weights: weights.iter().map(|w| w / sum).collect() })
    }

    /// A normal error that is known is taken out of the spread: observers of one threshold have the
    /// smallest scale.
    #[test]
    fn known_errors_do_not_count_as_spread() {
        let z = [-1.5, -1.0, -0.6, -0.3, -0.1, 0.1, 0.3, 0.6, 1.0, 1.5];
        let spread = |sd: f64| {
            let points: Vec<_> = z.iter().map(|z| (measured(7.0 + 0.3 * z, sd), 1.0)).collect();
            Logistic::fit(&points).unwrap().scale
        };
        assert!(spread(0.3) < 0.05 && spread(0.001) > 0.12, "{} {}", spread(0.3), spread(0.001));
    }

    #[test]
    fn ends_of_the_stack_and_single_answers_are_borne() {
        let spp = [10, 100, 1000];
        assert_eq!(Logistic::fit(&[]), None);
        for level in 0..3 {
            let fit = Logistic::fit(&[(Observation::stop(level, &spp), 1.0)]).unwrap();
            assert!(fit.level95().is_finite() && fit.level95() > 0.0, "{fit:?}");
        }
        // One slip to the noisiest level among twenty equal stops does not move the curve.
        let stops = |slips: usize| {
            let mut all =
                vec![(Observation::stop(60, &(1..=100).map(|i| 100 * i).collect::<Vec<_>>()), 20.0)];
            all.extend(
                (0..slips)
                    .map(|_| (Observation::stop(0, &(1..=100).map(|i| 100 * i).collect::<Vec<_>>()), 1.0)),
            );
            Logistic::fit(&all).unwrap().level95()
        };
        assert!((stops(1) / stops(0) - 1.0).abs() < 0.05, "{} {}", stops(1), stops(0));
    }
}
