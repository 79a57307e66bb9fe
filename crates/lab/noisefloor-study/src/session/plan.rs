//! The order of trials, drawn once per session from the seeds of the study and of the session, and stored
//! with it: another version of the random generator may draw another one.

use super::trial::{CatchKind, Class, TrialRole};
use crate::config::{Study, StudyProtocol};
use crate::stack::StudyStack;
use serde::{Deserialize, Serialize};

/// Practice trials of a forced choice, all at the noisiest level.
const PRACTICE_CHOICES: u32 = 4;

/// The trials of a session. In JSON an object with `practice`, one round of it, and `trials`, all others in
/// order.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    pub(super) practice: Vec<PlannedTrial>,
    pub(super) trials: Vec<PlannedTrial>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlannedTrial {
    pub(super) task: Task,
    pub(super) role: TrialRole,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(super) enum Task {
    Acquisition {
        stack: u32,
        identical: bool,
    },
    Validation {
        stack: u32,
        pair: Pair,
        reference_left: bool,
    },
    /// At the noisiest level if `obvious`, else at the level that QUEST+ chooses.
    ForcedChoice {
        stack: u32,
        tile: u32,
        noise_first: bool,
        obvious: bool,
    },
}

/// What a validation shows beside the reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Pair {
    Class(Class),
    Obvious,
}

impl Plan {
    /// Draws the trials of a session. The order depends on the seed of the study and this one.
    pub fn draw(study: &Study, seed: u64) -> Self {
        let random = &mut noisefloor_pages::random::seeded(study.seed.rotate_left(32) ^ seed);
        let (practice, mut trials) = match study.protocol {
            StudyProtocol::Acquisition => acquisition(study, random),
            StudyProtocol::Validation => validation(study, random),
            StudyProtocol::ForcedChoice => forced_choice(study, random),
        };
        for (task, kind) in catch_trials(study, random) {
            // Never the first: nothing is expected there yet
            let place = random.usize(1..=trials.len());
            trials.insert(place, PlannedTrial { task, role: TrialRole::Catch(kind) });
        }
        let practice = practice.into_iter().map(|task| PlannedTrial { task, role: TrialRole::Practice });
        Self { practice: practice.collect(), trials }
    }

    /// Whether every trial shows what the study has: a stored plan may have been edited.
    pub(crate) fn fits(&self, study: &Study) -> bool {
        let shown = |planned: &PlannedTrial| {
            let (stack, tile, protocol) = match planned.task {
                Task::Acquisition { stack, .. } => (stack, 0, StudyProtocol::Acquisition),
                Task::Validation { stack, .. } => (stack, 0, StudyProtocol::Validation),
                Task::ForcedChoice { stack, tile, .. } => (stack, tile, StudyProtocol::ForcedChoice),
            };
            let tiles = study.stacks.get(stack as usize).map_or(0, |stack| stack.grid().len());
            protocol == study.protocol && (tile as usize) < tiles
        };
        let practice = |planned: &PlannedTrial| planned.role == TrialRole::Practice;
        self.practice.iter().all(|planned| shown(planned) && practice(planned))
            && self.trials.iter().all(|planned| shown(planned) && !practice(planned))
    }
}

fn data(task: Task) -> PlannedTrial {
    PlannedTrial { task, role: TrialRole::Data }
}

fn any_stack(study: &Study, random: &mut fastrand::Rng) -> u32 {
    random.u32(0..study.stacks.len() as u32)
}

/// Each pair `repeats` times in random order.
fn acquisition(study: &Study, random: &mut fastrand::Rng) -> (Vec<Task>, Vec<PlannedTrial>) {
    let stacks = 0..study.stacks.len() as u32;
    let mut plan: Vec<PlannedTrial> = (0..study.repeats)
        .flat_map(|_| stacks.clone())
        .map(|stack| data(Task::Acquisition { stack, identical: false }))
        .collect();
    random.shuffle(&mut plan);
    let practice =
        [false, true].map(|identical| Task::Acquisition { stack: any_stack(study, random), identical });
    (practice.to_vec(), plan)
}

/// Each pair of each class in random order and on random sides.
fn validation(study: &Study, random: &mut fastrand::Rng) -> (Vec<Task>, Vec<PlannedTrial>) {
    let stacks = 0..study.stacks.len() as u32;
    let mut plan = Vec::new();
    for stack in (0..study.repeats).flat_map(|_| stacks.clone()) {
        for class in [Class::Reference, Class::Test, Class::Noisy] {
            let pair = Pair::Class(class);
            plan.push(data(Task::Validation { stack, pair, reference_left: random.bool() }));
        }
    }
    random.shuffle(&mut plan);
    let practice = [Pair::Obvious, Pair::Class(Class::Reference)].map(|pair| Task::Validation {
        stack: any_stack(study, random),
        pair,
        reference_left: random.bool(),
    });
    (practice.to_vec(), plan)
}

/// Rounds, each of which asks once about every tile.
fn forced_choice(study: &Study, random: &mut fastrand::Rng) -> (Vec<Task>, Vec<PlannedTrial>) {
    let tiles = |(stack, s): (usize, &StudyStack)| {
        (0..s.grid().len() as u32).map(move |tile| (stack as u32, tile)).collect::<Vec<_>>()
    };
    let all: Vec<(u32, u32)> = study.stacks.iter().enumerate().flat_map(tiles).collect();
    let mut plan = Vec::new();
    for _ in 0..study.trials {
        let mut round = all.clone();
        random.shuffle(&mut round);
        for (stack, tile) in round {
            plan.push(data(Task::ForcedChoice { stack, tile, noise_first: random.bool(), obvious: false }));
        }
    }
    let practice = (0..PRACTICE_CHOICES).map(|_| obvious_choice(study, random));
    (practice.collect(), plan)
}

fn obvious_choice(study: &Study, random: &mut fastrand::Rng) -> Task {
    let stack = any_stack(study, random);
    let tile = random.u32(0..study.stacks[stack as usize].grid().len() as u32);
    Task::ForcedChoice { stack, tile, noise_first: random.bool(), obvious: true }
}

/// The catch trials that the protocol has. In an acquisition every trial begins with obvious noise, so that
/// only identical pairs are added; two intervals cannot both be the reference, so that a forced choice has
/// obvious ones.
fn catch_trials(study: &Study, random: &mut fastrand::Rng) -> Vec<(Task, CatchKind)> {
    let mut trials = Vec::new();
    for _ in 0..study.screening.catch_trials(study.protocol) {
        let stack = any_stack(study, random);
        match study.protocol {
            StudyProtocol::Acquisition => {
                trials.push((Task::Acquisition { stack, identical: true }, CatchKind::Identical));
            }
            StudyProtocol::Validation => {
                for (pair, kind) in [
                    (Pair::Class(Class::Reference), CatchKind::Identical),
                    (Pair::Obvious, CatchKind::Obvious),
                ] {
                    let reference_left = random.bool();
                    trials.push((Task::Validation { stack, pair, reference_left }, kind));
                }
            }
            StudyProtocol::ForcedChoice => {
                trials.push((obvious_choice(study, random), CatchKind::Obvious));
            }
        }
    }
    trials
}
