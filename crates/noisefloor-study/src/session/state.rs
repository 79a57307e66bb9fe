//! One observer's way through a study: a state that events move on. It is rebuilt by replaying them, and
//! nothing else is kept.

use super::plan::{PlannedTrial, draw_trials};
use super::trial::{Class, Trial, TrialOutcome};
use crate::config::Study;
use crate::event::{Choice, Conditions, StudyEvent};
use crate::questplus::{Posterior, QuestGrid, QuestPlus};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;
use thiserror::Error;

/// Steps in one acquisition trial are limited: so many times all levels of all tiles.
const MAX_ROUNDS: u64 = 20;

/// Why an event does not fit the state of its session. The state has not changed.
#[derive(Debug, Error, Clone, PartialEq)]
#[error("{0}")]
pub struct EventMisfit(pub String);

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

/// The state of a session.
#[derive(Clone, Debug)]
pub struct ParticipantSession {
    study: Arc<Study>,
    grids: Arc<Vec<Arc<QuestGrid>>>,
    plan: Arc<Vec<PlannedTrial>>,
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
    outcomes: Vec<TrialOutcome>,
}

/// QUEST+ tables of each stack: shared by all sessions of a study.
pub fn grids(study: &Study) -> Arc<Vec<Arc<QuestGrid>>> {
    Arc::new(study.stacks.iter().map(|s| Arc::new(QuestGrid::new(s.levels()))).collect())
}

impl ParticipantSession {
    /// A session at its beginning. The order of trials depends on the two seeds, that of the study and its
    /// own.
    pub fn new(study: Arc<Study>, grids: Arc<Vec<Arc<QuestGrid>>>, seed: u64) -> Self {
        let mut random = crate::random::seeded(study.seed.rotate_left(32) ^ seed);
        let (practice, plan) = draw_trials(&study, &mut random);
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
    pub fn outcomes(&self) -> &[TrialOutcome] {
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
            PlannedTrial::Acquisition { stack } => {
                Trial::Acquisition { number, practice, stack, levels: self.levels.clone() }
            }
            PlannedTrial::Validation { stack, class, reference_left } => {
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
            PlannedTrial::ForcedChoice { stack, tile, noise_first } => {
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
    /// [`EventMisfit`] if the event cannot have happened in this state, which is then as it was.
    pub fn apply(&mut self, event: &StudyEvent) -> Result<(), EventMisfit> {
        let misfit = |what: &str| Err(EventMisfit(what.to_owned()));
        match event {
            StudyEvent::Pause if self.paused => return misfit("the session is paused already"),
            StudyEvent::Pause => self.paused = true,
            StudyEvent::Resume if !self.paused => return misfit("the session is not paused"),
            StudyEvent::Resume => self.paused = false,
            _ if self.paused => return misfit("the session is paused: resume it first"),
            StudyEvent::Consent { language } => {
                if self.stage != Stage::Consent {
                    return misfit("consent was given already");
                }
                if !self.study.text.contains_key(language) {
                    return misfit("the study has no text in that language");
                }
                (self.stage, self.language) = (Stage::Conditions, Some(language.clone()));
            }
            StudyEvent::Conditions(conditions) => {
                conditions.check().map_err(EventMisfit)?;
                match self.stage {
                    Stage::Consent => return misfit("consent comes first"),
                    Stage::Finished => return misfit("all trials are answered"),
                    Stage::Conditions => self.stage = Stage::Trials,
                    Stage::Trials => {}
                }
                self.conditions = Some(*conditions);
            }
            StudyEvent::Step { trial, .. }
            | StudyEvent::Done { trial }
            | StudyEvent::Answer { trial, .. } => {
                if self.stage != Stage::Trials {
                    return misfit("no trial is being shown");
                }
                if *trial != self.at {
                    return Err(EventMisfit(format!(
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

    fn answer(&mut self, event: &StudyEvent) -> Result<(), EventMisfit> {
        let misfit = |what: &str| Err(EventMisfit(what.to_owned()));
        let outcome = match (self.plan[self.at as usize], event) {
            (PlannedTrial::Acquisition { stack }, &StudyEvent::Step { tile, level, .. }) => {
                let last = self.study.stacks[stack as usize].last();
                let limit = MAX_ROUNDS * u64::from(last) * self.levels.len() as u64;
                let Some(now) = self.levels.get_mut(tile as usize) else {
                    return misfit("there is no such tile");
                };
                if level > last || now.abs_diff(level) != 1 {
                    return Err(EventMisfit(format!(
                        "tile {tile} is at level {now}: a step leads to an adjacent level, 0 to {last}, not to {level}"
                    )));
                }
                if self.clicks >= limit {
                    return misfit("more clicks than any observer needs: finish this trial");
                }
                (*now, self.clicks) = (level, self.clicks + 1);
                return Ok(());
            }
            (PlannedTrial::Acquisition { stack }, StudyEvent::Done { .. }) => {
                let same =
                    |o: &&TrialOutcome| matches!(o, TrialOutcome::Stops { stack: s, .. } if *s == stack);
                let repeat = self.outcomes.iter().filter(same).count() as u32;
                TrialOutcome::Stops {
                    stack,
                    repeat,
                    levels: std::mem::take(&mut self.levels),
                    clicks: self.clicks,
                }
            }
            (PlannedTrial::Validation { stack, class, .. }, StudyEvent::Answer { choice, .. }) => {
                match choice {
                    Choice::Identical | Choice::Different => {
                        TrialOutcome::Judged { stack, class, identical: *choice == Choice::Identical }
                    }
                    _ => return misfit("this trial is answered by identical or different"),
                }
            }
            (PlannedTrial::ForcedChoice { stack, tile, noise_first }, StudyEvent::Answer { choice, .. }) => {
                match choice {
                    Choice::First | Choice::Second => {
                        let right = noise_first == (*choice == Choice::First);
                        TrialOutcome::Chosen { stack, tile, level: self.levels[0], right }
                    }
                    _ => return misfit("this trial is answered by first or second"),
                }
            }
            _ => return misfit("this kind of answer does not belong to the protocol of the study"),
        };

        // What counts is kept; what is learned chooses the levels of later trials
        if self.at >= self.practice {
            if let TrialOutcome::Chosen { stack, tile, level, right } = outcome {
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
            Some(PlannedTrial::Acquisition { stack }) => {
                vec![0; self.study.stacks[*stack as usize].grid().len()]
            }
            Some(PlannedTrial::ForcedChoice { .. }) if self.at < self.practice => vec![0],
            Some(&PlannedTrial::ForcedChoice { stack, tile, .. }) => {
                vec![self.quest(stack, tile).next_level()]
            }
            Some(PlannedTrial::Validation { .. }) | None => Vec::new(),
        };
    }
}
