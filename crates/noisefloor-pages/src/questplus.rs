//! QUEST+ for one threshold: which level to show next, and what is known about the threshold (Watson 2017,
//! "QUEST+: A general multidimensional Bayesian adaptive psychometric method", Journal of Vision 17(3):10).
//!
//! Implemented here because the server chooses the trials and no crate offers it. jsQuestPlus, which
//! jsPsych users rely on, runs in the page.

use std::sync::Arc;

/// Probability of a correct answer by pure guessing between two intervals.
pub(crate) const GUESS: f64 = 0.5;
/// Assumed probability of an answer given without looking.
pub(crate) const LAPSE: f64 = 0.02;
/// Candidate scales of the psychometric function, in ln(spp).
const SCALES: [f64; 4] = [0.08, 0.16, 0.32, 0.64];
/// Number of candidate thresholds, evenly spaced in ln(spp).
const THRESHOLDS: usize = 81;
/// Candidate thresholds extend beyond the first and last level by this much, in ln(spp): a factor of three.
const MARGIN: f64 = 1.1;
/// Most levels considered as stimuli; closer ones could not be told apart by an answer.
const MOST_STIMULI: usize = 48;

/// Probability that an observer sees the noise of a picture, given threshold and scale, all in ln(spp).
/// Logistic, ½ at the threshold.
pub fn sees(ln_spp: f64, ln_threshold: f64, scale: f64) -> f64 {
    1.0 / (1.0 + ((ln_spp - ln_threshold) / scale).exp())
}

/// Probability of a correct answer in a two-interval forced choice.
pub fn right(ln_spp: f64, ln_threshold: f64, scale: f64) -> f64 {
    right_or_guessed(GUESS, sees(ln_spp, ln_threshold, scale))
}

/// Probability of a correct answer of somebody who sees with a probability of `sees`, and else guesses.
fn right_or_guessed(guess: f64, sees: f64) -> f64 {
    guess + (1.0 - guess - LAPSE) * sees
}

/// The part that does not change from trial to trial: the levels of a stack, the hypotheses, and the
/// predictions of each.
#[derive(Debug)]
pub struct QuestGrid {
    /// Levels considered as stimuli.
    levels: Vec<u32>,
    /// ln(threshold) of each hypothesis.
    thresholds: Vec<f64>,
    /// Probability of a correct answer, by level of the stack, then by hypothesis.
    right: Vec<Vec<f64>>,
}

impl QuestGrid {
    /// Builds the tables for a stack with these samples per pixel: increasing, at least two. The last level
    /// is the reference, which is never shown against itself.
    pub fn new(spp: &[u64]) -> Self {
        let ln: Vec<f64> = spp.iter().map(|&n| (n.max(1) as f64).ln()).collect();
        Self::among(&ln, ln.len() - 1, GUESS)
    }

    /// The same for the logarithms of any levels, of which the first `stimuli` are shown, at least one, in a
    /// task in which guessing is right with a probability of `guess`.
    pub fn among(ln: &[f64], stimuli: usize, guess: f64) -> Self {
        let (low, high) = (ln[0] - MARGIN, ln[ln.len() - 1] + MARGIN);
        let hypothesis = |i: usize| {
            let threshold = low + (high - low) * (i / SCALES.len()) as f64 / (THRESHOLDS - 1) as f64;
            (threshold, SCALES[i % SCALES.len()])
        };
        let hypotheses: Vec<(f64, f64)> = (0..THRESHOLDS * SCALES.len()).map(hypothesis).collect();
        let likelihood =
            |&x: &f64| hypotheses.iter().map(|&(t, s)| right_or_guessed(guess, sees(x, t, s))).collect();

        // Levels evenly in ln(spp)
        let (first, last) = (ln[0], ln[stimuli - 1]);
        let nearest = |i: usize| {
            let goal = first + (last - first) * i as f64 / (MOST_STIMULI - 1) as f64;
            let distance = |&l: &usize| (ln[l] - goal).abs();
            (0..stimuli).min_by(|a, b| distance(a).total_cmp(&distance(b))).unwrap_or(0) as u32
        };
        let mut levels: Vec<u32> = (0..MOST_STIMULI).map(nearest).collect();
        levels.dedup();
        Self {
            levels,
            thresholds: hypotheses.iter().map(|h| h.0).collect(),
            right: ln.iter().map(likelihood).collect(),
        }
    }
}

/// What is known of a threshold.
#[derive(Clone, Debug)]
pub struct QuestPlus {
    grid: Arc<QuestGrid>,
    /// Probability of each hypothesis; they sum to 1.
    posterior: Vec<f64>,
}

impl QuestPlus {
    /// Starts with all hypotheses equally likely.
    pub fn new(grid: Arc<QuestGrid>) -> Self {
        let n = grid.thresholds.len();
        Self { grid, posterior: vec![1.0 / n as f64; n] }
    }

    /// Starts with ln(threshold) normal about 0 with this standard deviation.
    pub(crate) fn about_zero(grid: Arc<QuestGrid>, sd: f64) -> Self {
        let prior: Vec<f64> = grid.thresholds.iter().map(|t| (-0.5 * (t / sd).powi(2)).exp()).collect();
        let sum: f64 = prior.iter().sum();
        Self { grid, posterior: prior.into_iter().map(|p| p / sum).collect() }
    }

    /// The level whose answer is expected to leave the least entropy about the threshold (Watson 2017, eqs.
    /// 2 to 5). The scale is marginalised first (Prins 2013, "The psi-marginal adaptive method", Journal of
    /// Vision 13(7):3), because trials spent on learning it would be wasted here.
    pub fn next_level(&self) -> u32 {
        let xlnx = |x: f64| if x > 0.0 { x * x.ln() } else { 0.0 };
        let expected_entropy = |&level: &u32| {
            let predicted =
                self.posterior.chunks(SCALES.len()).zip(self.grid.right[level as usize].chunks(SCALES.len()));
            let (mut inner, mut all_right) = (0.0, 0.0);
            for (posterior, right) in predicted {
                let known: f64 = posterior.iter().sum();
                let right: f64 = posterior.iter().zip(right).map(|(p, r)| p * r).sum();
                inner += xlnx(right) + xlnx(known - right);
                all_right += right;
            }
            xlnx(all_right) + xlnx(1.0 - all_right) - inner
        };
        let entropies: Vec<f64> = self.grid.levels.iter().map(expected_entropy).collect();
        let least = (0..entropies.len()).min_by(|&a, &b| entropies[a].total_cmp(&entropies[b]));
        self.grid.levels[least.unwrap_or(0)]
    }

    /// Updates the posterior with an answer (Bayes' rule). A level outside the stack is ignored.
    pub fn learn(&mut self, level: u32, right: bool) {
        let Some(likelihood) = self.grid.right.get(level as usize) else { return };
        for (p, r) in self.posterior.iter_mut().zip(likelihood) {
            *p *= if right { *r } else { 1.0 - r };
        }
        let sum: f64 = self.posterior.iter().sum();
        self.posterior.iter_mut().for_each(|p| *p /= sum);
    }

    pub fn scale(&self) -> f64 {
        self.posterior.iter().zip(SCALES.iter().cycle()).map(|(p, scale)| p * scale).sum()
    }

    /// The posterior of the threshold, with the scale marginalised.
    pub fn posterior(&self) -> Posterior {
        let thresholds = &self.grid.thresholds;
        let last = thresholds[thresholds.len() - 1];
        Posterior {
            low: thresholds[0],
            step: (last - thresholds[0]) / (THRESHOLDS - 1) as f64,
            weights: self.posterior.chunks(SCALES.len()).map(|of_one| of_one.iter().sum()).collect(),
        }
    }
}

/// Posterior of one observer's ln(threshold), with the threshold in samples per pixel, on evenly spaced
/// values. The prior is flat, so it is also proportional to the likelihood of the answers.
#[derive(Clone, Debug, PartialEq)]
pub struct Posterior {
    pub low: f64,
    pub step: f64,
    /// Probabilities; they sum to 1.
    pub weights: Arc<[f64]>,
}

impl Posterior {
    pub fn values(&self) -> impl Iterator<Item = f64> + '_ {
        (0..self.weights.len()).map(|i| self.low + self.step * i as f64)
    }

    /// The value below which ln(threshold) lies with this probability, within 0…1; the weight of a value is
    /// spread evenly over its step.
    pub fn quantile(&self, probability: f64) -> f64 {
        let mut below = 0.0;
        for (weight, value) in self.weights.iter().zip(self.values()) {
            if below + weight >= probability && *weight > 0.0 {
                return value + self.step * ((probability - below) / weight - 0.5);
            }
            below += weight;
        }
        self.low + self.step * (self.weights.len() as f64 - 0.5)
    }

    /// Mean and standard deviation.
    pub fn moments(&self) -> (f64, f64) {
        let weighted = || self.weights.iter().zip(self.values());
        let mean: f64 = weighted().map(|(p, t)| p * t).sum();
        let variance: f64 = weighted().map(|(p, t)| p * (t - mean).powi(2)).sum();
        (mean, variance.sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stack() -> Arc<QuestGrid> {
        Arc::new(QuestGrid::new(&(1..=100).map(|i| 100 * i).collect::<Vec<_>>()))
    }

    #[test]
    fn known_values() {
        assert!((sees(5.0, 5.0, 0.3) - 0.5).abs() < 1e-12);
        // 95 % see nothing ln 19 scales above the threshold.
        assert!((sees(5.0 + 0.3 * 19f64.ln(), 5.0, 0.3) - 0.05).abs() < 1e-12);
        assert!((right(0.0, 20.0, 0.1) - 0.98).abs() < 1e-9 && (right(40.0, 20.0, 0.1) - 0.5).abs() < 1e-9);
    }

    #[test]
    fn one_answer_is_bayes_rule() {
        let grid = stack();
        let mut quest = QuestPlus::new(grid.clone());
        quest.learn(10, true);
        let sum: f64 = grid.right[10].iter().sum();
        for (p, r) in quest.posterior.iter().zip(&grid.right[10]) {
            assert!((p - r / sum).abs() < 1e-15);
        }
        let before = quest.posterior.clone();
        quest.learn(100_000, false);
        assert_eq!(quest.posterior, before);
    }

    /// The chosen level is also found by brute force: the entropy of each posterior, weighted by its
    /// probability.
    #[test]
    fn the_level_chosen_leaves_least_entropy() {
        let mut quest = QuestPlus::new(stack());
        for answer in [true, false, true, true] {
            let chosen = quest.next_level();
            let entropy_term = |p: f64| -p * p.max(1e-300).ln();
            let entropy = |q: &QuestPlus| -> f64 {
                q.posterior.chunks(SCALES.len()).map(|of_one| entropy_term(of_one.iter().sum())).sum()
            };
            let expected = |level: u32| {
                let p: f64 =
                    quest.posterior.iter().zip(&quest.grid.right[level as usize]).map(|(p, r)| p * r).sum();
                let after = |right| {
                    let mut q = quest.clone();
                    q.learn(level, right);
                    entropy(&q)
                };
                p * after(true) + (1.0 - p) * after(false)
            };
            let best = quest.grid.levels.iter().map(|&l| expected(l)).fold(f64::INFINITY, f64::min);
            assert!((expected(chosen) - best).abs() < 1e-9);
            quest.learn(chosen, answer);
        }
    }

    /// A uniform posterior on 0, 1, 2, 3 reaches from −½ to 3½.
    #[test]
    fn quantiles_lie_between_the_values() {
        let even = Posterior { low: 0.0, step: 1.0, weights: [0.25; 4].into() };
        for (probability, value) in [(0.0, -0.5), (0.5, 1.5), (0.125, 0.0), (1.0, 3.5)] {
            assert!((even.quantile(probability) - value).abs() < 1e-12);
        }
    }

    /// After 32 trials of a known observer, repeated 60 times, errors are as large as the posterior says.
    /// For errors z = (estimate − truth)/sd that are standard normal, the mean of 60 z² lies in 0.4…1.9
    /// except once in 1000 (χ² with 60 degrees of freedom: 0.53…1.66).
    #[test]
    fn estimates_err_as_much_as_they_say() {
        let (truth, scale) = (2500f64.ln(), 0.16);
        let mut squares = 0.0;
        for seed in 0..60 {
            let mut random = fastrand::Rng::with_seed(seed);
            let mut quest = QuestPlus::new(stack());
            for _ in 0..32 {
                let level = quest.next_level();
                let ln_spp = f64::from(100 * (level + 1)).ln();
                quest.learn(level, random.f64() < right(ln_spp, truth, scale));
            }
            let (mean, sd) = quest.posterior().moments();
            squares += ((mean - truth) / sd).powi(2) / 60.0;
        }
        assert!((0.4..1.9).contains(&squares), "{squares}");
    }
}
