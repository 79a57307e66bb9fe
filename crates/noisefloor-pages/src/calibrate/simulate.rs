//! Observers made of numbers, who are calibrated: whether the factor that is found is theirs.

use super::course::{CHOICES, Calibration, CalibrationStage, CalibrationTrial};
use super::tiles::CalibrationTile;
use crate::random::{logistic, seeded};
use noisefloor::{Oracle, Viewing};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SimulatedEyes {
    /// How many times the samples of the model's observers they need, above 0.
    pub factor: f64,
    /// Scale of the logistic scatter of their thresholds from look to look, in ln(samples).
    pub scatter: f64,
    /// Share of answers given without looking, within 0…1; 1 guesses always.
    pub slips: f64,
}

impl SimulatedEyes {
    /// Answers all trials of a calibration. `None` as for [`Calibration::new`].
    pub fn calibrate(&self, oracle: &Oracle, viewing: Viewing, seed: u64) -> Option<CalibrationStage> {
        let thresholds = CalibrationTile::thresholds(oracle, viewing)?;
        Some(self.answer_all(Calibration::with(thresholds.clone(), seed), &thresholds, seed))
    }

    /// Answers all trials. `thresholds` are those of the model's observers in each tile on the display as it
    /// is, in samples per pixel: they differ from what the calibration believes where the display was described
    /// wrongly.
    fn answer_all(&self, mut calibration: Calibration, thresholds: &[f64], seed: u64) -> CalibrationStage {
        // Another sequence than that of the trials
        let mut random = seeded(!seed);
        while let CalibrationStage::Asking(trial) = calibration.stage() {
            let chosen = self.choose(&trial, thresholds[trial.tile], &mut random);
            calibration.answer(trial.number, chosen);
        }
        calibration.stage()
    }

    fn choose(&self, trial: &CalibrationTrial, threshold: f64, random: &mut fastrand::Rng) -> usize {
        let now = (threshold * self.factor).ln() + logistic(random, self.scatter);
        let sees = random.f64() >= self.slips && now > trial.spp.ln();
        if sees { trial.noisy } else { random.usize(..CHOICES) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Thresholds of the tiles at 60 cm before a Full HD display, and from a third nearer.
    const DESK: [f64; 4] = [307.0, 349.0, 93.0, 294.0];
    const NEARER: [f64; 4] = [718.0, 706.0, 246.0, 803.0];

    /// What calibrations of a simulated public find.
    #[derive(Debug)]
    struct Found {
        /// Share of factors within x1.25 of the truth.
        within: f64,
        /// Geometric mean of factor over truth.
        bias: f64,
        /// Median number of answers.
        answers: u32,
        /// Share of 80 % intervals that hold the truth.
        covered: f64,
        /// Share of calibrations that were refused.
        refused: f64,
    }

    /// Calibrates people whose factors are 0.5 to 3, evenly in ln. `truth` is the factor of thresholds that
    /// the display adds to theirs.
    fn public(count: u64, scatter: [f64; 2], slips: [f64; 2], on: [f64; 4], display: f64) -> Found {
        let mut found = Vec::new();
        for seed in 0..count {
            let mut random = seeded(1_000_000 + seed);
            let mut between = |[low, high]: [f64; 2]| low + (high - low) * random.f64();
            let factor = between([0.5f64.ln(), 3f64.ln()]).exp();
            let eyes = SimulatedEyes { factor, scatter: between(scatter), slips: between(slips) };
            if let CalibrationStage::Found(f) =
                eyes.answer_all(Calibration::with(DESK.to_vec(), seed), &on, seed)
            {
                found.push((f, factor * display));
            }
        }
        let n = found.len().max(1) as f64;
        let share = |yes: &dyn Fn(&(super::super::Factor, f64)) -> bool| {
            found.iter().filter(|f| yes(f)).count() as f64 / n
        };
        let error = |(f, truth): &(super::super::Factor, f64)| (f.factor / truth).ln();
        let mut answers: Vec<u32> = found.iter().map(|(f, _)| f.answers).collect();
        answers.sort_unstable();
        Found {
            within: share(&|f| error(f).abs() <= 1.25f64.ln()),
            bias: (found.iter().map(error).sum::<f64>() / n).exp(),
            answers: answers.get(answers.len() / 2).copied().unwrap_or(0),
            covered: share(&|(f, truth)| (f.interval[0]..=f.interval[1]).contains(truth)),
            refused: 1.0 - found.len() as f64 / count as f64,
        }
    }

    /// Logistic scales of standard deviations of 0.15 to 0.5.
    fn deviations() -> [f64; 2] {
        [0.15, 0.5].map(|sd| sd * 3f64.sqrt() / std::f64::consts::PI)
    }

    /// Of 600 people, a share near 0.95 has a standard error of 0.009, and the mean of errors near 0.12 in ln one
    /// of 0.005; 2000 others gave 0.96 and ×1.00, and with the larger scatter 0.87 and ×0.99.
    #[test]
    fn the_factor_is_found() {
        let found = public(600, deviations(), [0.0, 0.05], DESK, 1.0);
        println!("standard deviations of 0.15 to 0.5: {found:?}");
        assert!(found.within >= 0.9 && (found.bias.ln()).abs() < 0.05 && found.answers <= 40, "{found:?}");
        assert!((0.8..0.93).contains(&found.covered) && found.refused < 0.03, "{found:?}");
        // With scales of 0.15 to 0.5, standard deviations of 0.27 to 0.9, sixty answers are too few
        let found = public(600, [0.15, 0.5], [0.0, 0.05], DESK, 1.0);
        println!("scales of 0.15 to 0.5: {found:?}");
        assert!((0.81..0.92).contains(&found.within) && (found.bias.ln()).abs() < 0.05, "{found:?}");
    }

    /// Somebody who sits a third nearer than they say needs 2.4 times the samples in truth, and is told so.
    #[test]
    fn a_display_described_wrongly_is_in_the_factor() {
        let display = DESK.iter().zip(NEARER).map(|(d, n)| (n / d).ln()).sum::<f64>() / 4.0;
        let found = public(200, deviations(), [0.0, 0.05], NEARER, display.exp());
        println!("nearer than said: {found:?}");
        assert!(found.within > 0.8 && found.bias.ln().abs() < 0.08, "{found:?}");
    }

    #[test]
    fn guessers_are_refused() {
        let found = public(300, deviations(), [1.0, 1.0], DESK, 1.0);
        println!("guessers: {found:?}");
        assert!(found.refused >= 0.95, "{found:?}");
    }

    #[test]
    fn the_same_seed_gives_the_same() {
        let eyes = SimulatedEyes { factor: 1.7, scatter: 0.2, slips: 0.02 };
        let oracle = Oracle::bundled();
        let run = |seed| eyes.calibrate(&oracle, oracle.model().viewing(), seed).unwrap();
        assert_eq!(run(3), run(3));
        assert!(matches!(run(3), CalibrationStage::Found(f) if (1.2..2.4).contains(&f.factor)));
    }
}
