//! The state of a session. Events move it on; replaying them rebuilds it, and nothing else is stored.

use super::plan::{Pair, Plan, PlannedTrial, Task};
use super::trial::{Class, Trial, TrialOutcome, TrialRole};
use crate::config::Study;
use crate::error::StoreError;
use crate::event::{Choice, StudyEvent, TrialTiming};
use crate::store::SessionRecord;
use noisefloor_pages::questplus::{Posterior, QuestGrid, QuestPlus};
use noisefloor_pages::viewing::{Conditions, ViewingProblem};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::Arc;
use thiserror::Error;

/// Most steps of one acquisition trial, in multiples of all levels of all tiles.
const MAX_ROUNDS: u64 = 20;
/// Largest share of tiles that may be clicked in an identical pair, and smallest in a noisy practice.
const CLICKED_SHARES: [f64; 2] = [0.25, 0.5];

/// Why an event does not fit the state of its session, which is unchanged.
#[derive(Debug, Error, Clone, PartialEq)]
#[error("{0}")]
pub struct EventMisfit(pub String);

/// How far an observer has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Stage {
    Consent,
    /// The questions of the study are open.
    Questions,
    /// The viewing conditions are missing, or outside the limits of the study.
    Conditions,
    /// Trials, of which the first are practice.
    Trials,
    /// All trials are answered.
    Finished,
    /// The practice was not passed.
    ScreenedOut,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Practice {
    /// Trials of the current round.
    pub(super) first: u32,
    /// The first trial after it.
    pub(super) end: u32,
    pub(super) rounds: u32,
    /// Trials passed in the current round.
    passed: u32,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Haste {
    /// Trials after the practice.
    pub trials: u32,
    /// How many of them were answered hastily.
    pub hasty: u32,
}

/// What the plan does not say of the trial that is being shown.
#[derive(Clone, Debug, Default)]
pub(super) struct Shown {
    /// Acquisition: of each tile; forced choice: of the tile that it asks about.
    levels: Vec<u32>,
    clicks: u64,
}

#[derive(Clone, Debug)]
pub struct ParticipantSession {
    pub(super) study: Arc<Study>,
    pub(super) grids: Arc<Vec<Arc<QuestGrid>>>,
    /// All trials, the rounds of practice first.
    pub(super) plan: Arc<Vec<PlannedTrial>>,
    pub(super) practice: Practice,
    pub(super) stage: Stage,
    pub(super) paused: bool,
    pub(super) events: u64,
    pub(super) conditions: Option<Conditions>,
    pub(super) problem: Option<ViewingProblem>,
    pub(super) language: Option<String>,
    pub(super) answers: BTreeMap<String, String>,
    pub(super) at: u32,
    pub(super) shown: Shown,
    pub(super) haste: Haste,
    pub(super) quests: BTreeMap<(u32, u32), QuestPlus>,
    pub(super) outcomes: Vec<TrialOutcome>,
    pub(super) simulated: bool,
}

/// QUEST+ tables of each stack, shared by all sessions of a study.
pub fn grids(study: &Study) -> Arc<Vec<Arc<QuestGrid>>> {
    Arc::new(study.stacks.iter().map(|s| Arc::new(QuestGrid::new(s.levels()))).collect())
}

fn misfit<T>(what: &str) -> Result<T, EventMisfit> {
    Err(EventMisfit(what.to_owned()))
}

impl ParticipantSession {
    /// Starts a session. `plan` is of the same study.
    pub fn new(study: Arc<Study>, grids: Arc<Vec<Arc<QuestGrid>>>, plan: Plan) -> Self {
        let Plan { practice, trials } = plan;
        let begin = practice.len() as u32;
        let mut session = Self {
            study,
            grids,
            plan: Arc::new([practice, trials].concat()),
            practice: Practice { first: 0, end: begin, rounds: 1, passed: 0 },
            stage: Stage::Consent,
            paused: false,
            events: 0,
            conditions: None,
            problem: None,
            language: None,
            answers: BTreeMap::new(),
            at: 0,
            shown: Shown::default(),
            haste: Haste::default(),
            quests: BTreeMap::new(),
            outcomes: Vec::new(),
            simulated: false,
        };
        session.begin_trial();
        session
    }

    /// A session of a simulated observer, who takes no code away.
    #[must_use]
    pub fn simulated(self, simulated: bool) -> Self {
        Self { simulated, ..self }
    }

    pub fn apply(&mut self, event: &StudyEvent) -> Result<(), EventMisfit> {
        match event {
            StudyEvent::Pause if self.paused => return misfit("the session is paused already"),
            StudyEvent::Pause => self.paused = true,
            StudyEvent::Resume if !self.paused => return misfit("the session is not paused"),
            StudyEvent::Resume => self.paused = false,
            _ if self.paused => return misfit("the session is paused: resume it first"),
            StudyEvent::Consent { language } => self.consent(language)?,
            StudyEvent::Questions { answers } => self.take_answers(answers)?,
            StudyEvent::Conditions(conditions) => self.take_conditions(*conditions)?,
            StudyEvent::Step { trial, .. }
            | StudyEvent::Done { trial, .. }
            | StudyEvent::Answer { trial, .. } => self.take_response(*trial, event)?,
        }
        self.events += 1;
        Ok(())
    }

    fn consent(&mut self, language: &str) -> Result<(), EventMisfit> {
        if self.stage != Stage::Consent {
            return misfit("consent was given already");
        }
        if !self.study.text.contains_key(language) {
            return misfit("the study has no text in that language");
        }
        let asks = !self.study.questions.is_empty();
        self.stage = if asks { Stage::Questions } else { Stage::Conditions };
        self.language = Some(language.to_owned());
        Ok(())
    }

    fn take_answers(&mut self, answers: &BTreeMap<String, String>) -> Result<(), EventMisfit> {
        if self.stage != Stage::Questions {
            return misfit("the questions are not being asked");
        }
        for question in &self.study.questions {
            if !question.accepts(answers.get(&question.id).map_or("", String::as_str)) {
                return Err(EventMisfit(format!("question {:?} does not accept that answer", question.id)));
            }
        }
        let asked = |id: &String| self.study.questions.iter().any(|q| q.id == *id);
        if !answers.keys().all(asked) {
            return misfit("an answer belongs to no question of the study");
        }
        (self.stage, self.answers) = (Stage::Conditions, answers.clone());
        Ok(())
    }

    fn take_conditions(&mut self, conditions: Conditions) -> Result<(), EventMisfit> {
        conditions.check().map_err(EventMisfit)?;
        match self.stage {
            Stage::Conditions | Stage::Trials => {}
            Stage::Consent => return misfit("consent comes first"),
            Stage::Questions => return misfit("the questions come first"),
            Stage::Finished | Stage::ScreenedOut => return misfit("the session has ended"),
        }
        self.problem = conditions.outside(&self.study.viewing);
        self.stage = if self.problem.is_some() { Stage::Conditions } else { Stage::Trials };
        self.conditions = Some(conditions);
        Ok(())
    }

    fn take_response(&mut self, trial: u32, event: &StudyEvent) -> Result<(), EventMisfit> {
        if self.stage != Stage::Trials {
            return misfit("no trial is being shown");
        }
        if trial != self.at {
            return Err(EventMisfit(format!(
                "trial {trial} is not being shown: the current one is {}",
                self.at
            )));
        }
        if let StudyEvent::Step { tile, level, ms, .. } = *event {
            return self.step(tile, level, ms);
        }
        let (StudyEvent::Done { timing, .. } | StudyEvent::Answer { timing, .. }) = event else {
            return misfit("this event is no answer");
        };
        self.check_time(timing)?;
        let (outcome, passed) = self.outcome(event)?;
        self.finish_trial(outcome, passed, timing);
        Ok(())
    }

    /// What the answer to the trial that is shown says, and whether it is the expected one, as far as that is
    /// known.
    fn outcome(&self, event: &StudyEvent) -> Result<(TrialOutcome, bool), EventMisfit> {
        let Shown { levels, clicks } = &self.shown;
        match (self.task(), event) {
            (Some(Task::Acquisition { stack, identical }), StudyEvent::Done { .. }) => {
                let moved = levels.iter().filter(|level| **level > 0).count() as f64;
                let share = moved / levels.len() as f64;
                let [most, least] = CLICKED_SHARES;
                let passed = if identical { share <= most } else { share >= least };
                Ok((TrialOutcome::Stops { stack, levels: levels.clone(), clicks: *clicks }, passed))
            }
            (Some(Task::Validation { stack, pair, .. }), StudyEvent::Answer { choice, .. }) => {
                let identical = match choice {
                    Choice::Identical => true,
                    Choice::Different => false,
                    _ => return misfit("this trial is answered by identical or different"),
                };
                // A pair of references is identical; of others only the obvious ones have a known answer
                let passed = identical == (pair == Pair::Class(Class::Reference));
                let class = if let Pair::Class(class) = pair { class } else { Class::Noisy };
                Ok((TrialOutcome::Judged { stack, class, identical }, passed))
            }
            (
                Some(Task::ForcedChoice { stack, tile, noise_first, .. }),
                StudyEvent::Answer { choice, .. },
            ) => {
                let right = match choice {
                    Choice::First => noise_first,
                    Choice::Second => !noise_first,
                    _ => return misfit("this trial is answered by first or second"),
                };
                Ok((TrialOutcome::Chosen { stack, tile, level: levels[0], right }, right))
            }
            _ => misfit("this kind of answer does not belong to the protocol of the study"),
        }
    }

    /// An answer needs time to look: what comes sooner was meant for the trial before.
    fn check_time(&self, timing: &TrialTiming) -> Result<(), EventMisfit> {
        let least = f64::from(self.study.screening.minimum_ms);
        if !timing.is_sane() {
            return misfit("the times of the trial are impossible");
        }
        if timing.ms < least {
            return Err(EventMisfit(format!(
                "answered {:.0} ms after onset; {least} is the least",
                timing.ms
            )));
        }
        Ok(())
    }

    fn step(&mut self, tile: u32, level: u32, ms: f64) -> Result<(), EventMisfit> {
        self.check_time(&TrialTiming { onset: 0, ms, intervals: Vec::new(), frames: None })?;
        let Some(Task::Acquisition { stack, .. }) = self.task() else {
            return misfit("this kind of answer does not belong to the protocol of the study");
        };
        let Shown { levels, clicks } = &mut self.shown;
        let last = self.study.stacks[stack as usize].last();
        let limit = MAX_ROUNDS * u64::from(last) * levels.len() as u64;
        let Some(now) = levels.get_mut(tile as usize) else {
            return misfit("there is no such tile");
        };
        if level > last || now.abs_diff(level) != 1 {
            return Err(EventMisfit(format!(
                "tile {tile} is at level {now}: a step leads to an adjacent level, 0 to {last}, not to {level}"
            )));
        }
        if *clicks >= limit {
            return misfit("more clicks than any observer needs: finish this trial");
        }
        (*now, *clicks) = (level, *clicks + 1);
        Ok(())
    }

    /// Stores the result of a trial and shows the next one.
    fn finish_trial(&mut self, outcome: TrialOutcome, passed: bool, timing: &TrialTiming) {
        let role = self.plan[self.at as usize].role;
        match role {
            TrialRole::Practice => self.practice.passed += u32::from(passed),
            TrialRole::Catch(kind) => self.outcomes.push(TrialOutcome::Caught { kind, passed }),
            TrialRole::Data => {
                if let TrialOutcome::Chosen { stack, tile, level, right } = outcome {
                    self.quest(stack, tile).learn(level, right);
                }
                self.outcomes.push(outcome);
            }
        }
        if role != TrialRole::Practice {
            self.haste.trials += 1;
            self.haste.hasty += u32::from(timing.ms < f64::from(self.study.screening.hasty_ms));
        }
        self.at += 1;
        if self.at == self.practice.end && role == TrialRole::Practice {
            self.end_practice();
        }
        if self.at as usize == self.plan.len() {
            self.stage = Stage::Finished;
        }
        self.begin_trial();
    }

    /// After a round of practice: the data if all of it was passed, else another round, if there is one.
    fn end_practice(&mut self) {
        let Practice { first, end, rounds, passed } = self.practice;
        let most = self.study.screening.practice_attempts;
        if passed == end - first || most == 0 {
            return;
        }
        if rounds >= most {
            self.stage = Stage::ScreenedOut;
            return;
        }
        let round = self.plan[first as usize..end as usize].to_vec();
        Arc::make_mut(&mut self.plan).splice(end as usize..end as usize, round);
        self.practice = Practice { first: end, end: end + (end - first), rounds: rounds + 1, passed: 0 };
    }

    fn quest(&mut self, stack: u32, tile: u32) -> &mut QuestPlus {
        let grid = &self.grids[stack as usize];
        self.quests.entry((stack, tile)).or_insert_with(|| QuestPlus::new(grid.clone()))
    }

    fn task(&self) -> Option<Task> {
        self.plan.get(self.at as usize).map(|planned| planned.task)
    }

    fn begin_trial(&mut self) {
        let levels = match self.task() {
            Some(Task::Acquisition { stack, .. }) => vec![0; self.study.stacks[stack as usize].grid().len()],
            Some(Task::ForcedChoice { stack, tile, obvious: false, .. }) => {
                vec![self.quest(stack, tile).next_level()]
            }
            Some(Task::ForcedChoice { .. }) => vec![0],
            Some(Task::Validation { .. }) | None => Vec::new(),
        };
        self.shown = Shown { levels, clicks: 0 };
    }
}

// What can be read from the state of a session.

impl ParticipantSession {
    pub fn study(&self) -> &Arc<Study> {
        &self.study
    }

    /// How far the observer has come.
    pub fn stage(&self) -> Stage {
        self.stage
    }

    pub(crate) fn is_simulated(&self) -> bool {
        self.simulated
    }

    pub(crate) fn is_paused(&self) -> bool {
        self.paused
    }

    /// Number of events so far, which is the number of the next one.
    pub fn events(&self) -> u64 {
        self.events
    }

    /// Trials answered and trials in total, practice included.
    pub fn progress(&self) -> (u32, u32) {
        (self.at, self.plan.len() as u32)
    }

    /// Number of the current trial among those of practice or of data, from 1, and how many there are.
    pub fn ordinal(&self) -> (u32, u32) {
        let Practice { first, end, .. } = self.practice;
        if self.at < end {
            (self.at - first + 1, end - first)
        } else {
            (self.at - end + 1, self.plan.len() as u32 - end)
        }
    }

    pub fn practice_rounds(&self) -> u32 {
        self.practice.rounds
    }

    /// What the current trial is for; `None` after the last one.
    pub fn role(&self) -> Option<TrialRole> {
        self.plan.get(self.at as usize).map(|planned| planned.role)
    }

    pub fn conditions(&self) -> Option<&Conditions> {
        self.conditions.as_ref()
    }

    /// Which of them the study does not accept.
    pub fn viewing_problem(&self) -> Option<ViewingProblem> {
        self.problem
    }

    /// Language of the consent.
    pub fn language(&self) -> Option<&str> {
        self.language.as_deref()
    }

    /// Answers to the questions of the study.
    pub fn answers(&self) -> &BTreeMap<String, String> {
        &self.answers
    }

    /// How carefully trials were answered so far.
    pub fn haste(&self) -> Haste {
        self.haste
    }

    /// Results of all trials after the practice, in order.
    pub fn outcomes(&self) -> &[TrialOutcome] {
        &self.outcomes
    }

    /// Forced choice: the posterior of the threshold of a tile; `None` before its first trial.
    pub fn posterior(&self, stack: u32, tile: u32) -> Option<Posterior> {
        self.quests.get(&(stack, tile)).map(QuestPlus::posterior)
    }

    /// The trial to show; `None` unless the session is at its trials.
    pub fn trial(&self) -> Option<Trial> {
        if self.stage != Stage::Trials {
            return None;
        }
        let (number, practice) = (self.at, self.role()? == TrialRole::Practice);
        let levels = &self.shown.levels;
        Some(match self.task()? {
            Task::Acquisition { stack, identical } => {
                Trial::Acquisition { number, practice, stack, levels: levels.clone(), identical }
            }
            Task::Validation { stack, pair, reference_left } => {
                let shown = &self.study.stacks[stack as usize];
                let reference = vec![shown.last(); shown.grid().len()];
                let other = match pair {
                    Pair::Class(Class::Test) => shown.stops().map(<[u32]>::to_vec),
                    Pair::Class(Class::Noisy) => shown.noisy().map(<[u32]>::to_vec),
                    Pair::Class(Class::Reference) => None,
                    Pair::Obvious => Some(vec![0; reference.len()]),
                };
                let other = other.unwrap_or_else(|| reference.clone());
                let (left, right) = if reference_left { (reference, other) } else { (other, reference) };
                Trial::Validation { number, practice, stack, left, right }
            }
            Task::ForcedChoice { stack, tile, noise_first, .. } => {
                let (level, last) = (levels[0], self.study.stacks[stack as usize].last());
                let (first, second) = if noise_first { (level, last) } else { (last, level) };
                Trial::ForcedChoice { number, practice, stack, tile, first, second }
            }
        })
    }
}

// A session rebuilt from its events.

/// Replays a session from the database.
pub fn replay(
    study: Arc<Study>,
    grids: Arc<Vec<Arc<QuestGrid>>>,
    record: &SessionRecord,
) -> Result<ParticipantSession, StoreError> {
    let mut session = begin(study, grids, record)?;
    for (seq, envelope) in record.events.iter().enumerate() {
        let misfit = |what: String| StoreError::Event { code: record.code.clone(), seq: seq as u64, what };
        if envelope.seq != seq as u64 {
            return Err(misfit("its number leaves a gap".to_owned()));
        }
        session.apply(&envelope.event).map_err(|e| misfit(e.to_string()))?;
    }
    Ok(session)
}

/// A session from the database before its first event.
pub(crate) fn begin(
    study: Arc<Study>,
    grids: Arc<Vec<Arc<QuestGrid>>>,
    record: &SessionRecord,
) -> Result<ParticipantSession, StoreError> {
    if !record.plan.fits(&study) {
        return Err(StoreError::Plan { code: record.code.clone() });
    }
    Ok(ParticipantSession::new(study, grids, record.plan.clone()).simulated(record.simulated))
}
