//! Simulated observers and the population they are drawn from.

use crate::config::{Question, QuestionKind, Study};
use crate::event::{Choice, StudyEvent, TrialTiming};
use crate::server::StackView;
use crate::session::Trial;
use crate::stack::{StudyStack, ln_spp};
use noisefloor_pages::random::{logistic, seeded};
use noisefloor_pages::viewing::{Ambient, Conditions};
use statrs::distribution::{ContinuousCDF, Normal};
use std::f64::consts::PI;

/// Share of the variance between people that is common to all places: 0.36² of 0.5².
const COMMON: f64 = 0.52;

/// The population that simulated observers are drawn from.
#[derive(Clone, Debug)]
pub struct Public {
    /// Threshold of the median observer in samples per pixel, by stack and tile; positive.
    pub thresholds: Vec<Vec<f64>>,
    /// How observers are spread around the median one.
    pub shape: SpreadShape,
    /// Scale of the spread between observers, in ln(spp), at least 0. All shapes have the standard deviation
    /// of a logistic distribution of this scale.
    pub between: f64,
    /// Scale of the logistic spread between observers that each tile has of its own, in ln(spp), at least 0; beside
    /// `between`, which an observer has in all tiles.
    pub by_place: f64,
    /// Scale of the logistic spread of one observer from showing to showing (the inverse slope of the
    /// psychometric function), in ln(spp), at least 0.
    pub within: f64,
    /// Share of answers given without looking, 0 to 1.
    pub lapse: f64,
    /// Bias of all observers, in ln(spp): above 0 they report noise they do not see. Forced choices are
    /// unaffected.
    pub bias: f64,
}

/// Shape of the spread between observers, in ln(spp), with median 0.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SpreadShape {
    #[default]
    Logistic,
    /// Lognormal with σ = ½: skewness 1.75, a long tail of demanding observers.
    Lognormal,
}

impl SpreadShape {
    /// Draws a deviation from the median observer, with the standard deviation of a logistic one of scale 1.
    fn draw(self, random: &mut fastrand::Rng) -> f64 {
        let sd = PI / 3f64.sqrt();
        let p = random.f64().clamp(1e-12, 1.0 - 1e-12);
        match self {
            Self::Logistic => (p / (1.0 - p)).ln(),
            Self::Lognormal => {
                let variance = (0.25f64.exp() - 1.0) * 0.25f64.exp();
                sd * ((0.5 * Normal::standard().inverse_cdf(p)).exp() - 1.0) / variance.sqrt()
            }
        }
    }
}

/// What a simulated observer does with the trials.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Behaviour {
    /// Answers what they see.
    #[default]
    Attentive,
    /// Passes the practice, and then gives the first answer to everything without looking.
    StraightLiner,
    /// Passes the practice, and then answers at random.
    RandomClicker,
}

#[derive(Clone, Debug)]
pub struct SimulatedObserver {
    /// This observer's ln(threshold), by stack and tile.
    ln_thresholds: Vec<Vec<f64>>,
    behaviour: Behaviour,
    within: f64,
    lapse: f64,
    bias: f64,
    random: fastrand::Rng,
}

impl Public {
    /// Observers who are all the median one, always, and never slip.
    pub fn of(thresholds: Vec<Vec<f64>>) -> Self {
        let shape = SpreadShape::Logistic;
        Self { thresholds, shape, between: 0.0, by_place: 0.0, within: 0.0, lapse: 0.0, bias: 0.0 }
    }

    /// A made-up population for rehearsals: thresholds within a factor of two of each stack's geometric
    /// middle, spreads of 0.3 between and 0.1 within observers, 1 % lapses. It predicts nothing about
    /// people.
    pub fn made_up(study: &Study) -> Self {
        let threshold = |stack: &StudyStack, tile: usize| {
            let (low, high) = (stack.levels()[0].max(1) as f64, stack.levels()[stack.last() as usize] as f64);
            (low * high).sqrt() * 2f64.powf((tile * 7 % 9) as f64 / 4.0 - 1.0)
        };
        let of_stack = |s: &StudyStack| (0..s.grid().len()).map(|tile| threshold(s, tile)).collect();
        let thresholds = study.stacks.iter().map(of_stack).collect();
        Self { between: 0.3, within: 0.1, lapse: 0.01, ..Self::of(thresholds) }
    }

    /// The same with a spread of people in one place of this standard deviation of ln(spp). About half of its
    /// variance is common to all tiles, as it is in what P counts (`noisefloor::oracle::Spread`).
    pub fn spread_by(self, deviation: f64) -> Self {
        // A logistic distribution of scale s has the standard deviation s·π/√3
        let scale = deviation * 3f64.sqrt() / PI;
        Self { between: scale * COMMON.sqrt(), by_place: scale * (1.0 - COMMON).sqrt(), ..self }
    }

    /// Standard deviation of ln(threshold) between people in one place.
    pub fn deviation(&self) -> f64 {
        self.between.hypot(self.by_place) * PI / 3f64.sqrt()
    }

    /// Draws an observer; the same seed gives the same one.
    pub fn draw(&self, seed: u64) -> SimulatedObserver {
        self.draw_as(seed, Behaviour::Attentive)
    }

    /// Draws an observer who behaves in this way.
    pub fn draw_as(&self, seed: u64, behaviour: Behaviour) -> SimulatedObserver {
        let mut random = seeded(seed);
        let own = self.between * self.shape.draw(&mut random);
        let (shape, by_place) = (self.shape, self.by_place);
        let mut here = || if by_place > 0.0 { by_place * shape.draw(&mut random) } else { 0.0 };
        let mut ln = |tiles: &Vec<f64>| tiles.iter().map(|t| t.ln() + own + here()).collect();
        SimulatedObserver {
            ln_thresholds: self.thresholds.iter().map(&mut ln).collect(),
            behaviour,
            within: self.within,
            lapse: self.lapse,
            bias: self.bias,
            random,
        }
    }

    /// Samples per pixel at which a share of observers (0 to 1, exclusive) see no difference from the
    /// reference, over observers and showings, without bias and lapses. Found from 400 001 draws; accurate
    /// to about 0.4 % at 95 %.
    pub fn quantile(&self, stack: usize, tile: usize, share: f64) -> f64 {
        self.thresholds[stack][tile] * self.spread()[(share * 400_000.0).round() as usize].exp()
    }

    /// What an analysis should find of a tile: the median over observers and showings, the mean over observers, which
    /// `train` gets, and the level where 95 % see no difference. The mean lies above the median: few need much more.
    pub fn levels(&self, stack: usize, tile: usize) -> [f64; 3] {
        let median = self.thresholds[stack][tile];
        let mut random = seeded(0);
        let own = (0..400_001).map(|_| self.own(&mut random).exp());
        [median, median * own.sum::<f64>() / 400_001.0, self.quantile(stack, tile, 0.95)]
    }

    /// How far an observer lies from the median in a tile.
    fn own(&self, random: &mut fastrand::Rng) -> f64 {
        let here = if self.by_place > 0.0 { self.by_place * self.shape.draw(random) } else { 0.0 };
        self.between * self.shape.draw(random) + here
    }

    /// How far observers and showings lie from the median, in ln(spp), in ascending order.
    fn spread(&self) -> Vec<f64> {
        let mut random = seeded(0);
        let mut draw = |_| self.own(&mut random) + logistic(&mut random, self.within);
        let mut sums: Vec<f64> = (0..400_001).map(&mut draw).collect();
        sums.sort_by(f64::total_cmp);
        sums
    }
}

impl SimulatedObserver {
    /// The events before the trials: consent, an answer to every question, viewing conditions.
    pub fn arrive(&self, language: &str, questions: &[Question]) -> Vec<StudyEvent> {
        let mut events = vec![StudyEvent::Consent { language: language.to_owned() }];
        if !questions.is_empty() {
            let answers = questions.iter().map(|q| (q.id.clone(), answer(q))).collect();
            events.push(StudyEvent::Questions { answers });
        }
        events.push(StudyEvent::Conditions(CONDITIONS));
        events
    }

    /// The events that answer a trial.
    pub fn respond(&mut self, trial: &Trial, stacks: &[StackView]) -> Vec<StudyEvent> {
        match trial {
            Trial::Acquisition { number, practice, stack, levels, identical } => {
                let spp = &stacks[*stack as usize].levels;
                let mut order: Vec<usize> = (0..levels.len()).collect();
                self.random.shuffle(&mut order);
                let trial = *number;
                let mut events = Vec::new();
                for tile in order {
                    let goal = self.goal(*practice, *identical, *stack as usize, tile, spp);
                    let (now, tile) = (levels[tile], tile as u32);
                    let step = |level| StudyEvent::Step { trial, tile, level, at: None, ms: TIMING.ms };
                    events.extend((now + 1..=goal).map(step));
                    events.extend((goal..now).rev().map(step));
                }
                events.push(StudyEvent::Done { trial, timing: TIMING });
                events
            }
            Trial::Validation { number, practice, stack, left, right } => {
                let different = match self.behaviour {
                    _ if *practice => left != right,
                    Behaviour::StraightLiner => false,
                    Behaviour::RandomClicker => self.random.bool(),
                    Behaviour::Attentive => self.differ(*stack as usize, left, right, stacks),
                };
                let choice = if different { Choice::Different } else { Choice::Identical };
                vec![StudyEvent::Answer { trial: *number, choice, timing: TIMING }]
            }
            Trial::ForcedChoice { number, practice, stack, tile, first, second } => {
                let noisy_first = first < second;
                let spp = ln_spp(&stacks[*stack as usize].levels, *first.min(second));
                let first = match self.behaviour {
                    _ if *practice => noisy_first,
                    Behaviour::StraightLiner => true,
                    Behaviour::RandomClicker => self.random.bool(),
                    Behaviour::Attentive => {
                        let threshold = self.ln_thresholds[*stack as usize][*tile as usize];
                        let looks = self.random.f64() >= self.lapse;
                        let seen = looks && threshold + logistic(&mut self.random, self.within) > spp;
                        if seen { noisy_first } else { self.random.bool() }
                    }
                };
                let choice = if first { Choice::First } else { Choice::Second };
                vec![StudyEvent::Answer { trial: *number, choice, timing: TIMING }]
            }
        }
    }

    /// Whether two pictures look different. One look at the whole picture: all tiles share the deviation of
    /// this showing.
    fn differ(&mut self, stack: usize, left: &[u32], right: &[u32], stacks: &[StackView]) -> bool {
        if self.random.f64() < self.lapse {
            return self.random.bool();
        }
        let spp = &stacks[stack].levels;
        let last = spp.len() as u32 - 1;
        let deviation = logistic(&mut self.random, self.within) + self.bias;
        let mut noisier = left.iter().zip(right).map(|(a, b)| *a.min(b)).enumerate();
        noisier.any(|(tile, level)| {
            level < last && self.ln_thresholds[stack][tile] + deviation > ln_spp(spp, level)
        })
    }

    /// The level to which this observer takes a tile. Nobody fails the practice here.
    fn goal(&mut self, practice: bool, identical: bool, stack: usize, tile: usize, spp: &[u64]) -> u32 {
        let last = spp.len() as u32 - 1;
        match self.behaviour {
            _ if practice => u32::from(!identical),
            Behaviour::StraightLiner => 0,
            Behaviour::RandomClicker => self.random.u32(0..=last),
            Behaviour::Attentive if identical && self.random.f64() >= self.lapse => 0,
            Behaviour::Attentive if identical => self.random.u32(0..=last),
            Behaviour::Attentive => self.stop(stack, tile, spp),
        }
    }

    /// The level at which this observer leaves a tile this time.
    fn stop(&mut self, stack: usize, tile: usize, spp: &[u64]) -> u32 {
        let last = spp.len() as u32 - 1;
        if self.random.f64() < self.lapse {
            return self.random.u32(0..=last);
        }
        let now = self.ln_thresholds[stack][tile] + logistic(&mut self.random, self.within) + self.bias;
        (0..last).find(|&level| ln_spp(spp, level) >= now).unwrap_or(last)
    }

    /// This observer's own threshold of a tile, in ln(spp).
    pub fn ln_threshold(&self, stack: usize, tile: usize) -> f64 {
        self.ln_thresholds[stack][tile]
    }
}

/// An answer that the question accepts.
fn answer(question: &Question) -> String {
    match question.kind {
        QuestionKind::Number => question.range.map_or(30.0, |[low, _]| low).to_string(),
        QuestionKind::Choice => question.option.first().map_or_else(String::new, |o| o.id.clone()),
        QuestionKind::Text => "simulated".to_owned(),
    }
}

/// A second and a half for everything.
const TIMING: TrialTiming = TrialTiming { onset: 0, ms: 1500.0, intervals: Vec::new(), frames: None };

/// A screen with 96 pixels per inch at 600 mm, in a dim room.
const CONDITIONS: Conditions = Conditions {
    pixels_per_mm: 3.78,
    distance_mm: 600.0,
    pixel_ratio: 1.0,
    zoom: 1.0,
    colour_depth: 24,
    screen_width: 1920,
    screen_height: 1080,
    gamma: 2.2,
    ambient: Ambient::Dim,
};

#[cfg(test)]
mod tests {
    use super::*;

    /// Without any spread, an observer stops at the first level at or above the threshold. In a forced
    /// choice they find all noise below it, and guess above.
    #[test]
    fn an_observer_without_spread_is_a_threshold() {
        let levels = vec![100, 200, 300, 400];
        let stacks = [StackView { width: 16, height: 16, tile: 16, levels, frames: 1, fps: None }];
        let mut observer = Public::of(vec![vec![250.0]]).draw(1);
        let trial =
            Trial::Acquisition { number: 7, practice: false, stack: 0, levels: vec![0], identical: false };
        let step = |level| StudyEvent::Step { trial: 7, tile: 0, level, at: None, ms: TIMING.ms };
        assert_eq!(
            observer.respond(&trial, &stacks),
            [step(1), step(2), StudyEvent::Done { trial: 7, timing: TIMING }]
        );
        let mut choose = |first| {
            let trial =
                Trial::ForcedChoice { number: 0, practice: false, stack: 0, tile: 0, first, second: 3 };
            let right = |_: &i32| {
                matches!(
                    observer.respond(&trial, &stacks)[..],
                    [StudyEvent::Answer { choice: Choice::First, .. }]
                )
            };
            (0..100).filter(right).count()
        };
        assert_eq!(choose(1), 100);
        // 50 of 100 with standard deviation 5.
        assert!((30..=70).contains(&choose(2)));
    }

    /// The quantile of one logistic spread is known: ln 19 scales above the median at 95 %.
    #[test]
    fn quantiles_are_those_of_the_spread() {
        let public = Public { between: 0.3, ..Public::of(vec![vec![1000.0]]) };
        let expected = 1000.0 * (0.3 * 19f64.ln()).exp();
        assert!((public.quantile(0, 0, 0.95) / expected - 1.0).abs() < 0.01);
        assert!((public.quantile(0, 0, 0.5) / 1000.0 - 1.0).abs() < 0.01);
        // The mean of exp of a logistic value of scale s is πs/sin(πs)
        let [median, mean, level95] = public.levels(0, 0);
        let above = 0.3 * std::f64::consts::PI / (0.3 * std::f64::consts::PI).sin();
        assert!((mean / median / above - 1.0).abs() < 0.02 && (level95 / expected - 1.0).abs() < 0.01);
    }
}
