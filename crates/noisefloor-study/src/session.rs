//! One observer's way through a study: a state that events move on. It is rebuilt by replaying them, and nothing else is kept.

use crate::config::{Protocol, Study};
use crate::event::{Choice, Conditions, Event};
use crate::questplus::{Grid, Posterior, QuestPlus};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;
use thiserror::Error;

/// Forced choice begins with so many trials at the noisiest level, which do not count.
const PRACTICE_CHOICES: u32 = 4;
/// Steps in one acquisition trial are limited: so many times all levels of all tiles.
const MAX_ROUNDS: u64 = 20;

/// Why an event does not fit the state of its session. The state has not changed.
#[derive(Debug, Error, Clone, PartialEq)]
#[error("{0}")]
pub struct Misfit(pub String);

/// How far an observer has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stage {
    /// Has not agreed yet.
    Consent,
    /// Has not said how the pictures are seen.
    Conditions,
    /// At the trials, of which the first are practice.
    Trials,
    /// All trials are answered.
    Finished,
}

/// Class of a validation pair (Takouachet et al. 2017, §7.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Class {
    /// Two references.
    Reference,
    /// A reference, and the picture put together from where tiles stopped.
    Test,
    /// A reference, and the picture put together from 30 % of that.
    Noisy,
}

/// What is planned for a trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Plan {
    Acquisition { stack: u32 },
    Validation { stack: u32, class: Class, reference_left: bool },
    ForcedChoice { stack: u32, tile: u32, noise_first: bool },
}

/// A trial as the page shows it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Trial {
    /// The reference beside a picture of tiles at these levels.
    Acquisition {
        /// Number of the trial, from 0.
        number: u32,
        /// Whether it does not count.
        practice: bool,
        /// The stack.
        stack: u32,
        /// Level of each tile.
        levels: Vec<u32>,
    },
    /// Two pictures side by side.
    Validation {
        /// Number of the trial, from 0.
        number: u32,
        /// Whether it does not count.
        practice: bool,
        /// The stack.
        stack: u32,
        /// Level of each tile of the picture at the left.
        left: Vec<u32>,
        /// And of that at the right.
        right: Vec<u32>,
    },
    /// Two pictures one after the other, which differ in one tile.
    ForcedChoice {
        /// Number of the trial, from 0.
        number: u32,
        /// Whether it does not count.
        practice: bool,
        /// The stack.
        stack: u32,
        /// The tile.
        tile: u32,
        /// Its level in the first interval. All other tiles are those of the reference.
        first: u32,
        /// And in the second.
        second: u32,
    },
}

/// What came of a trial.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// Acquisition: where the observer left each tile.
    Stops {
        /// The stack.
        stack: u32,
        /// Which showing of it, from 0.
        repeat: u32,
        /// Level of each tile.
        levels: Vec<u32>,
        /// Clicks on the way.
        clicks: u64,
    },
    /// Validation.
    Judged {
        /// The stack.
        stack: u32,
        /// What was shown.
        class: Class,
        /// What was said.
        identical: bool,
    },
    /// Forced choice.
    Chosen {
        /// The stack.
        stack: u32,
        /// The tile.
        tile: u32,
        /// Its level.
        level: u32,
        /// Whether the noise was found.
        right: bool,
    },
}

/// The state of a session.
#[derive(Clone, Debug)]
pub struct Session {
    study: Arc<Study>,
    grids: Arc<Vec<Arc<Grid>>>,
    plan: Arc<Vec<Plan>>,
    practice: u32,
    stage: Stage,
    paused: bool,
    events: u64,
    conditions: Option<Conditions>,
    language: Option<String>,
    /// Trials answered.
    at: u32,
    /// Acquisition: levels and clicks of the trial under way. Forced choice: the level shown.
    levels: Vec<u32>,
    clicks: u64,
    quests: BTreeMap<(u32, u32), QuestPlus>,
    outcomes: Vec<Outcome>,
}

/// QUEST+ tables of each stack: shared by all sessions of a study.
pub fn grids(study: &Study) -> Arc<Vec<Arc<Grid>>> {
    Arc::new(study.stacks.iter().map(|s| Arc::new(Grid::new(s.levels()))).collect())
}

impl Session {
    /// A session at its beginning. The order of trials depends on the two seeds, that of the study and its own.
    pub fn new(study: Arc<Study>, grids: Arc<Vec<Arc<Grid>>>, seed: u64) -> Self {
        let mut random = crate::random::seeded(study.seed.rotate_left(32) ^ seed);
        let (practice, plan) = plan(&study, &mut random);
        let mut session = Self {
            study,
            grids,
            plan: Arc::new(plan),
            practice,
            stage: Stage::Consent,
            paused: false,
            events: 0,
            conditions: None,
            language: None,
            at: 0,
            levels: Vec::new(),
            clicks: 0,
            quests: BTreeMap::new(),
            outcomes: Vec::new(),
        };
        session.begin_trial();
        session
    }

    /// The study it is a session of.
    pub fn study(&self) -> &Arc<Study> {
        &self.study
    }

    /// How far the observer has come.
    pub fn stage(&self) -> Stage {
        self.stage
    }

    /// Whether the observer has paused.
    pub fn is_paused(&self) -> bool {
        self.paused
    }

    /// Events so far: the number that the next one has to have.
    pub fn events(&self) -> u64 {
        self.events
    }

    /// Trials answered and trials in all, practice included.
    pub fn progress(&self) -> (u32, u32) {
        (self.at, self.plan.len() as u32)
    }

    /// How the pictures are seen, as last said.
    pub fn conditions(&self) -> Option<&Conditions> {
        self.conditions.as_ref()
    }

    /// Language of the consent.
    pub fn language(&self) -> Option<&str> {
        self.language.as_deref()
    }

    /// What came of the trials that count, in the order they were shown.
    pub fn outcomes(&self) -> &[Outcome] {
        &self.outcomes
    }

    /// Forced choice: what is known of the threshold of a tile; `None` before its first trial.
    pub fn posterior(&self, stack: u32, tile: u32) -> Option<Posterior> {
        self.quests.get(&(stack, tile)).map(QuestPlus::posterior)
    }

    /// The trial to be shown; `None` unless the session is at its trials.
    pub fn trial(&self) -> Option<Trial> {
        if self.stage != Stage::Trials {
            return None;
        }
        let (number, practice) = (self.at, self.at < self.practice);
        let trial = match *self.plan.get(self.at as usize)? {
            Plan::Acquisition { stack } => {
                Trial::Acquisition { number, practice, stack, levels: self.levels.clone() }
            }
            Plan::Validation { stack, class, reference_left } => {
                let shown = &self.study.stacks[stack as usize];
                let reference = vec![shown.last(); shown.grid().len()];
                let other = match class {
                    Class::Reference => reference.clone(),
                    Class::Test => shown.stops().map_or(reference.clone(), <[u32]>::to_vec),
                    Class::Noisy => shown.noisy().map_or(reference.clone(), <[u32]>::to_vec),
                };
                let (left, right) = if reference_left { (reference, other) } else { (other, reference) };
                Trial::Validation { number, practice, stack, left, right }
            }
            Plan::ForcedChoice { stack, tile, noise_first } => {
                let (noise, last) = (self.levels[0], self.study.stacks[stack as usize].last());
                let (first, second) = if noise_first { (noise, last) } else { (last, noise) };
                Trial::ForcedChoice { number, practice, stack, tile, first, second }
            }
        };
        Some(trial)
    }

    /// Moves the state on by an event that happened.
    ///
    /// # Errors
    /// [`Misfit`] if the event cannot have happened in this state, which is then as it was.
    pub fn apply(&mut self, event: &Event) -> Result<(), Misfit> {
        let misfit = |what: &str| Err(Misfit(what.to_owned()));
        match event {
            Event::Pause if self.paused => return misfit("the session is paused already"),
            Event::Pause => self.paused = true,
            Event::Resume if !self.paused => return misfit("the session is not paused"),
            Event::Resume => self.paused = false,
            _ if self.paused => return misfit("the session is paused: resume it first"),
            Event::Consent { language } => {
                if self.stage != Stage::Consent {
                    return misfit("consent was given already");
                }
                if !self.study.text.contains_key(language) {
                    return misfit("the study has no text in that language");
                }
                (self.stage, self.language) = (Stage::Conditions, Some(language.clone()));
            }
            Event::Conditions(conditions) => {
                conditions.check().map_err(Misfit)?;
                match self.stage {
                    Stage::Consent => return misfit("consent comes first"),
                    Stage::Finished => return misfit("all trials are answered"),
                    Stage::Conditions => self.stage = Stage::Trials,
                    Stage::Trials => {}
                }
                self.conditions = Some(*conditions);
            }
            Event::Step { trial, .. } | Event::Done { trial } | Event::Answer { trial, .. } => {
                if self.stage != Stage::Trials {
                    return misfit("no trial is being shown");
                }
                if *trial != self.at {
                    return Err(Misfit(format!(
                        "trial {trial} is not being shown: the next one is {}",
                        self.at
                    )));
                }
                self.answer(event)?;
            }
        }
        self.events += 1;
        Ok(())
    }

    fn answer(&mut self, event: &Event) -> Result<(), Misfit> {
        let misfit = |what: &str| Err(Misfit(what.to_owned()));
        let outcome = match (self.plan[self.at as usize], event) {
            (Plan::Acquisition { stack }, &Event::Step { tile, level, .. }) => {
                let last = self.study.stacks[stack as usize].last();
                let limit = MAX_ROUNDS * u64::from(last) * self.levels.len() as u64;
                let Some(now) = self.levels.get_mut(tile as usize) else {
                    return misfit("there is no such tile");
                };
                if level > last || now.abs_diff(level) != 1 {
                    return Err(Misfit(format!(
                        "tile {tile} is at level {now}: one step leads to a level beside it, 0 to {last}, not to {level}"
                    )));
                }
                if self.clicks >= limit {
                    return misfit("more clicks than any observer needs: finish this trial");
                }
                (*now, self.clicks) = (level, self.clicks + 1);
                return Ok(());
            }
            (Plan::Acquisition { stack }, Event::Done { .. }) => {
                let same = |o: &&Outcome| matches!(o, Outcome::Stops { stack: s, .. } if *s == stack);
                let repeat = self.outcomes.iter().filter(same).count() as u32;
                Outcome::Stops {
                    stack,
                    repeat,
                    levels: std::mem::take(&mut self.levels),
                    clicks: self.clicks,
                }
            }
            (Plan::Validation { stack, class, .. }, Event::Answer { choice, .. }) => match choice {
                Choice::Identical | Choice::Different => {
                    Outcome::Judged { stack, class, identical: *choice == Choice::Identical }
                }
                _ => return misfit("this trial is answered by identical or different"),
            },
            (Plan::ForcedChoice { stack, tile, noise_first }, Event::Answer { choice, .. }) => match choice {
                Choice::First | Choice::Second => {
                    let right = noise_first == (*choice == Choice::First);
                    Outcome::Chosen { stack, tile, level: self.levels[0], right }
                }
                _ => return misfit("this trial is answered by first or second"),
            },
            _ => return misfit("this kind of answer does not belong to the protocol of the study"),
        };

        // What counts is kept; what is learned chooses the levels of later trials
        if self.at >= self.practice {
            if let Outcome::Chosen { stack, tile, level, right } = outcome {
                self.quest(stack, tile).learn(level, right);
            }
            self.outcomes.push(outcome);
        }
        self.at += 1;
        if self.at as usize == self.plan.len() {
            self.stage = Stage::Finished;
        }
        self.begin_trial();
        Ok(())
    }

    fn quest(&mut self, stack: u32, tile: u32) -> &mut QuestPlus {
        let grid = &self.grids[stack as usize];
        self.quests.entry((stack, tile)).or_insert_with(|| QuestPlus::new(grid.clone()))
    }

    fn begin_trial(&mut self) {
        self.clicks = 0;
        self.levels = match self.plan.get(self.at as usize) {
            Some(Plan::Acquisition { stack }) => vec![0; self.study.stacks[*stack as usize].grid().len()],
            Some(Plan::ForcedChoice { .. }) if self.at < self.practice => vec![0],
            Some(&Plan::ForcedChoice { stack, tile, .. }) => vec![self.quest(stack, tile).next_level()],
            Some(Plan::Validation { .. }) | None => Vec::new(),
        };
    }
}

/// All trials in order, practice first, and how many are practice.
fn plan(study: &Study, random: &mut fastrand::Rng) -> (u32, Vec<Plan>) {
    let stacks = || 0..study.stacks.len() as u32;
    let mut plan = Vec::new();
    let practice = match study.protocol {
        Protocol::Acquisition => {
            // Each pair so many times, in random order; one more to get used to it
            plan.extend((0..study.repeats).flat_map(|_| stacks()).map(|stack| Plan::Acquisition { stack }));
            random.shuffle(&mut plan);
            plan.insert(0, Plan::Acquisition { stack: random.u32(0..study.stacks.len() as u32) });
            1
        }
        Protocol::Validation => {
            let classes = [Class::Reference, Class::Test, Class::Noisy];
            for (stack, class) in
                (0..study.repeats).flat_map(|_| stacks()).flat_map(|s| classes.map(|c| (s, c)))
            {
                plan.push(Plan::Validation { stack, class, reference_left: random.bool() });
            }
            random.shuffle(&mut plan);
            for class in [Class::Reference, Class::Noisy] {
                let stack = random.u32(0..study.stacks.len() as u32);
                plan.insert(0, Plan::Validation { stack, class, reference_left: random.bool() });
            }
            2
        }
        Protocol::ForcedChoice => {
            // Rounds, each of which asks once about every tile
            let tiles = |stack: u32| 0..study.stacks[stack as usize].grid().len() as u32;
            let all: Vec<(u32, u32)> = stacks().flat_map(|s| tiles(s).map(move |t| (s, t))).collect();
            for _ in 0..PRACTICE_CHOICES {
                let (stack, tile) = all[random.usize(0..all.len())];
                plan.push(Plan::ForcedChoice { stack, tile, noise_first: random.bool() });
            }
            for _ in 0..study.trials {
                let mut round = all.clone();
                random.shuffle(&mut round);
                let trial = |(stack, tile)| Plan::ForcedChoice { stack, tile, noise_first: random.bool() };
                plan.extend(round.into_iter().map(trial));
            }
            PRACTICE_CHOICES
        }
    };
    (practice, plan)
}
