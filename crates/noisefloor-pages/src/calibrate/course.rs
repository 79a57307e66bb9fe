//! The course of a calibration: which picture is shown next, when it ends, and what it found.

use super::tiles::CalibrationTile;
use crate::questplus::{QuestGrid, QuestPlus};
use crate::random::seeded;
use noisefloor::{Oracle, Viewing};
use std::sync::Arc;

/// Pictures of a trial. With four, an answer says twice as much about a threshold as with two.
pub(crate) const CHOICES: usize = 4;

/// Prior standard deviation of the logarithm of the factor: two people of three need between half and twice the
/// samples of the model's observers. SIN3D's two groups need 1.4 and 2.0 times as many, the students of
/// Takouachet et al. (2017, §7.3) up to 1.9.
const LN_FACTOR_SD: f64 = 0.7;
/// It ends when the interval is within this factor of the estimate, on average over both sides.
const NARROW: f64 = 1.25;
/// Probability that lies within the interval by which it ends.
const CERTAIN: f64 = 0.9;
/// Probability within the interval that is reported.
const REPORTED: f64 = 0.8;
/// Answers after which it may end, and after which it does.
const ANSWERS: [u32; 2] = [24, 60];
/// Strongest and weakest noise: ln of the samples over the threshold of the model's observers.
const LEVELS: [f64; 2] = [-2.5, 2.0];
const STEPS: usize = 46;
/// The first trials are easy, to show what is asked, and so is one trial of so many after that.
const EASY_FIRST: u32 = 2;
const EASY_EVERY: u32 = 8;
/// Share of the easy trials that somebody who looks answers rightly, at the least.
const ATTENTIVE: f64 = 0.8;
/// A factor is beyond what can be measured where so much of the posterior lies beyond the levels.
const BEYOND: f64 = 0.5;

/// What is shown: four pictures, of which one has noise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrationTrial {
    /// Its number, from 0.
    pub number: u32,
    pub tile: usize,
    /// Samples per pixel of the noisy picture.
    pub spp: f64,
    /// Which of the pictures is the noisy one, from 0.
    pub noisy: usize,
    /// Whether the noise is so strong that whoever looks finds it.
    pub easy: bool,
    level: u32,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CalibrationStage {
    /// Another trial is to be shown.
    Asking(CalibrationTrial),
    Found(Factor),
    /// It has found nothing, and says why.
    Refused(CalibrationRefusal),
}

/// What a calibration finds: how many times the samples of the model's observers somebody needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Factor {
    /// Exponential of the posterior mean.
    pub factor: f64,
    /// 80 % interval.
    pub interval: [f64; 2],
    /// Mean scale of the psychometric function, in ln(samples).
    pub scatter: f64,
    /// Answers that it rests on.
    pub answers: u32,
}

/// Why nothing is saved.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum CalibrationRefusal {
    #[error(
        "{missed} of {of} pictures with strong noise were missed, as by guessing; nothing is saved; \
         calibrate again when you have time"
    )]
    Guessed {
        /// Easy trials that were answered wrongly.
        missed: u32,
        of: u32,
    },
    /// The factor lies beyond the noise that can be shown.
    #[error(
        "noise {} than this page can show would be needed; nothing is saved; check distance and brightness of the display",
        if *.weaker { "weaker" } else { "stronger" }
    )]
    Beyond {
        /// Whether even the weakest noise was seen.
        weaker: bool,
    },
}

#[derive(Clone, Debug)]
pub struct Calibration {
    quest: QuestPlus,
    /// Thresholds of the model's observers in each tile, in samples per pixel.
    thresholds: Vec<f64>,
    /// Tiles in the order of this round.
    round: Vec<usize>,
    random: fastrand::Rng,
    stage: CalibrationStage,
    easy: u32,
    missed: u32,
}

fn level(index: u32) -> f64 {
    LEVELS[0] + (LEVELS[1] - LEVELS[0]) * f64::from(index) / (STEPS - 1) as f64
}

impl Calibration {
    /// Begins; the oracle says what its observers see in these tiles. `None` if it does not tell noise from
    /// picture, or is for other viewing conditions.
    pub fn new(oracle: &Oracle, viewing: Viewing, seed: u64) -> Option<Self> {
        Some(Self::with(CalibrationTile::thresholds(oracle, viewing)?, seed))
    }

    /// Begins with known thresholds of the model's observers, one of each tile.
    pub(super) fn with(thresholds: Vec<f64>, seed: u64) -> Self {
        let levels: Vec<f64> = (0..STEPS as u32).map(level).collect();
        let grid = Arc::new(QuestGrid::among(&levels, STEPS, 1.0 / CHOICES as f64));
        let mut begun = Self {
            quest: QuestPlus::about_zero(grid, LN_FACTOR_SD),
            thresholds,
            round: Vec::new(),
            random: seeded(seed),
            stage: CalibrationStage::Refused(CalibrationRefusal::Guessed { missed: 0, of: 0 }),
            easy: 0,
            missed: 0,
        };
        begun.ask(0);
        begun
    }

    pub fn stage(&self) -> CalibrationStage {
        self.stage
    }

    /// Trials expected in all, for a bar of progress.
    pub fn expected(&self) -> u32 {
        let CalibrationStage::Asking(trial) = self.stage else { return 0 };
        // The interval narrows as the root of the number of answers
        let wide = self.width() / NARROW.ln();
        let need = f64::from(trial.number.max(8)) * wide * wide;
        (need.ceil() as u32).clamp(ANSWERS[0].max(trial.number + 1), ANSWERS[1])
    }

    /// Takes the answer to the trial that was asked last: which picture has noise. `false` if no such trial is
    /// open, and nothing happens.
    pub fn answer(&mut self, trial: u32, chosen: usize) -> bool {
        let CalibrationStage::Asking(asked) = self.stage else { return false };
        if asked.number != trial {
            return false;
        }
        let right = chosen == asked.noisy;
        self.easy += u32::from(asked.easy);
        self.missed += u32::from(asked.easy && !right);
        self.quest.learn(asked.level, right);
        let answers = asked.number + 1;
        let certain = answers >= ANSWERS[0] && self.width() <= NARROW.ln();
        if certain || answers >= ANSWERS[1] {
            self.end(answers)
        } else {
            self.ask(answers)
        }
        true
    }

    /// Half of the interval's width, in ln.
    fn width(&self) -> f64 {
        let posterior = self.quest.posterior();
        0.5 * (posterior.quantile(0.5 + 0.5 * CERTAIN) - posterior.quantile(0.5 - 0.5 * CERTAIN))
    }

    fn ask(&mut self, number: u32) {
        if self.round.is_empty() {
            self.round.extend(0..self.thresholds.len());
            self.random.shuffle(&mut self.round);
        }
        let tile = self.round.pop().unwrap_or(0);
        let easy = number < EASY_FIRST || number % EASY_EVERY == EASY_EVERY - 1;
        let chosen = if easy { 0 } else { self.quest.next_level() };
        self.stage = CalibrationStage::Asking(CalibrationTrial {
            number,
            tile,
            spp: self.thresholds[tile] * level(chosen).exp(),
            noisy: self.random.usize(..CHOICES),
            easy,
            level: chosen,
        });
    }

    fn end(&mut self, answers: u32) {
        let posterior = self.quest.posterior();
        let share = |beyond: &dyn Fn(f64) -> bool| -> f64 {
            posterior.weights.iter().zip(posterior.values()).filter(|(_, v)| beyond(*v)).map(|(p, _)| p).sum()
        };
        let found = f64::from(self.easy - self.missed) / f64::from(self.easy.max(1));
        self.stage = if found < ATTENTIVE {
            let (missed, of) = (self.missed, self.easy);
            CalibrationStage::Refused(CalibrationRefusal::Guessed { missed, of })
        } else if share(&|v| v > LEVELS[1]) > BEYOND || share(&|v| v < LEVELS[0]) > BEYOND {
            let weaker = posterior.moments().0 > 0.0;
            CalibrationStage::Refused(CalibrationRefusal::Beyond { weaker })
        } else {
            CalibrationStage::Found(Factor {
                factor: posterior.moments().0.exp(),
                interval: [0.5 - 0.5 * REPORTED, 0.5 + 0.5 * REPORTED].map(|p| posterior.quantile(p).exp()),
                scatter: self.quest.scale(),
                answers,
            })
        };
    }
}
