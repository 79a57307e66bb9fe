//! What can be read from the state of a session.

use super::plan::Pair;
use super::state::{Haste, ParticipantSession, Practice, Shown, Stage};
use super::trial::{Class, Trial, TrialOutcome, TrialRole};
use crate::config::Study;
use noisefloor_pages::questplus::{Posterior, QuestPlus};
use noisefloor_pages::viewing::{Conditions, ViewingProblem};
use std::collections::BTreeMap;
use std::sync::Arc;

impl ParticipantSession {
    /// The study.
    pub fn study(&self) -> &Arc<Study> {
        &self.study
    }

    /// How far the observer has come.
    pub fn stage(&self) -> Stage {
        self.stage
    }

    /// Whether the observer is simulated.
    pub(crate) fn is_simulated(&self) -> bool {
        self.simulated
    }

    /// Whether the observer has paused.
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

    /// Rounds of practice begun.
    pub fn practice_rounds(&self) -> u32 {
        self.practice.rounds
    }

    /// What the current trial is for; `None` after the last one.
    pub fn role(&self) -> Option<TrialRole> {
        self.plan.get(self.at as usize).map(|planned| planned.role)
    }

    /// Viewing conditions, as last reported.
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
        Some(match *self.shown.as_ref()? {
            Shown::Acquisition { stack, identical, ref levels, .. } => {
                Trial::Acquisition { number, practice, stack, levels: levels.clone(), identical }
            }
            Shown::Validation { stack, pair, reference_left } => {
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
            Shown::ForcedChoice { stack, tile, level, noise_first } => {
                let last = self.study.stacks[stack as usize].last();
                let (first, second) = if noise_first { (level, last) } else { (last, level) };
                Trial::ForcedChoice { number, practice, stack, tile, first, second }
            }
        })
    }
}
