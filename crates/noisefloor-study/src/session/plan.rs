//! The order of trials: drawn once per session from the seeds of the study and of the session.

use super::trial::Class;
use crate::config::{Study, StudyProtocol};

/// A forced choice begins with this many practice trials at the noisiest level.
const PRACTICE_CHOICES: u32 = 4;

/// What a trial is planned to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum PlannedTrial {
    Acquisition { stack: u32 },
    Validation { stack: u32, class: Class, reference_left: bool },
    ForcedChoice { stack: u32, tile: u32, noise_first: bool },
}

/// All trials in order, practice first, and how many of them are practice.
pub(super) fn draw_trials(study: &Study, random: &mut fastrand::Rng) -> (u32, Vec<PlannedTrial>) {
    match study.protocol {
        StudyProtocol::Acquisition => acquisition(study, random),
        StudyProtocol::Validation => validation(study, random),
        StudyProtocol::ForcedChoice => forced_choice(study, random),
    }
}

/// Each pair `repeats` times in random order, after one for practice.
fn acquisition(study: &Study, random: &mut fastrand::Rng) -> (u32, Vec<PlannedTrial>) {
    let stacks = study.stacks.len() as u32;
    let mut plan: Vec<PlannedTrial> =
        (0..study.repeats).flat_map(|_| 0..stacks).map(|stack| PlannedTrial::Acquisition { stack }).collect();
    random.shuffle(&mut plan);
    plan.insert(0, PlannedTrial::Acquisition { stack: random.u32(0..stacks) });
    (1, plan)
}

/// Each pair of each class in random order and on random sides, after two for practice.
fn validation(study: &Study, random: &mut fastrand::Rng) -> (u32, Vec<PlannedTrial>) {
    let stacks = study.stacks.len() as u32;
    let mut plan = Vec::new();
    for stack in (0..study.repeats).flat_map(|_| 0..stacks) {
        for class in [Class::Reference, Class::Test, Class::Noisy] {
            plan.push(PlannedTrial::Validation { stack, class, reference_left: random.bool() });
        }
    }
    random.shuffle(&mut plan);
    for class in [Class::Reference, Class::Noisy] {
        let stack = random.u32(0..stacks);
        plan.insert(0, PlannedTrial::Validation { stack, class, reference_left: random.bool() });
    }
    (2, plan)
}

/// Rounds, each of which asks once about every tile, after [`PRACTICE_CHOICES`].
fn forced_choice(study: &Study, random: &mut fastrand::Rng) -> (u32, Vec<PlannedTrial>) {
    let tiles = |(stack, s): (usize, &crate::stack::StudyStack)| {
        (0..s.grid().len() as u32).map(move |tile| (stack as u32, tile)).collect::<Vec<_>>()
    };
    let all: Vec<(u32, u32)> = study.stacks.iter().enumerate().flat_map(tiles).collect();
    let mut plan = Vec::new();
    for _ in 0..PRACTICE_CHOICES {
        let (stack, tile) = all[random.usize(0..all.len())];
        plan.push(PlannedTrial::ForcedChoice { stack, tile, noise_first: random.bool() });
    }
    for _ in 0..study.trials {
        let mut round = all.clone();
        random.shuffle(&mut round);
        for (stack, tile) in round {
            plan.push(PlannedTrial::ForcedChoice { stack, tile, noise_first: random.bool() });
        }
    }
    (PRACTICE_CHOICES, plan)
}
