//! What each observer answered.

use super::fit::Observation;
use crate::config::Study;
use crate::error::StudyError;
use crate::session::{CatchKind, Class, Haste, Stage, TrialOutcome, grids, replay};
use crate::stack::ln_spp;
use crate::store::SessionRecord;
use noisefloor_pages::questplus::Posterior;
use noisefloor_pages::viewing::{Conditions, ViewingProblem};
use std::collections::BTreeMap;
use std::sync::Arc;

/// A tile: index of the stack, and row-major index in it.
pub type TileKey = (u32, u32);

#[derive(Clone, Debug)]
pub struct Observer {
    pub code: String,
    /// Group; empty if the study has none.
    pub group: String,
    pub ids: BTreeMap<String, String>,
    /// How far the observer has come.
    pub stage: Stage,
    pub conditions: Option<Conditions>,
    /// Which of them the study does not accept.
    pub viewing_problem: Option<ViewingProblem>,
    /// Catch trials, and whether they were passed.
    pub caught: Vec<(CatchKind, bool)>,
    pub haste: Haste,
    /// Acquisition: the levels at which the observer left each tile, in order of showing.
    pub stops: BTreeMap<TileKey, Vec<u32>>,
    /// Forced choice: the posterior of ln(threshold) of each tile.
    pub measured: BTreeMap<TileKey, Posterior>,
    /// Validation: stack, class and whether it was called identical.
    pub judged: Vec<(u32, Class, bool)>,
    pub clicks: u64,
}

impl Observer {
    /// Collects the answers of a replayed session.
    pub fn of(code: &str, group: &str, session: &crate::session::ParticipantSession) -> Self {
        let mut observer = Self {
            code: code.to_owned(),
            group: group.to_owned(),
            ids: BTreeMap::new(),
            stage: session.stage(),
            conditions: session.conditions().copied(),
            viewing_problem: session.viewing_problem(),
            caught: Vec::new(),
            haste: session.haste(),
            stops: BTreeMap::new(),
            measured: BTreeMap::new(),
            judged: Vec::new(),
            clicks: 0,
        };
        for outcome in session.outcomes() {
            match outcome {
                TrialOutcome::Stops { stack, levels, clicks, .. } => {
                    observer.clicks += clicks;
                    for (tile, &level) in levels.iter().enumerate() {
                        observer.stops.entry((*stack, tile as u32)).or_default().push(level);
                    }
                }
                &TrialOutcome::Caught { kind, passed } => observer.caught.push((kind, passed)),
                TrialOutcome::Judged { stack, class, identical } => {
                    observer.clicks += 1;
                    observer.judged.push((*stack, *class, *identical));
                }
                TrialOutcome::Chosen { stack, tile, .. } => {
                    observer.clicks += 1;
                    if let Some(known) = session.posterior(*stack, *tile) {
                        observer.measured.insert((*stack, *tile), known);
                    }
                }
            }
        }
        observer
    }

    /// Validation: how often pairs of a class were called identical, and how often they were judged.
    pub(super) fn called_identical(&self, class: Class) -> (usize, usize) {
        let judged = || self.judged.iter().filter(|(_, c, _)| *c == class);
        (judged().filter(|(.., identical)| *identical).count(), judged().count())
    }

    /// Whether the observer answered anything that counts.
    pub(crate) fn has_answers(&self) -> bool {
        self.clicks > 0 || !self.stops.is_empty() || self.stage == Stage::ScreenedOut
    }

    /// Observations of this observer's threshold of a tile, one per showing.
    pub fn observations(&self, study: &Study, place: TileKey) -> Vec<Observation> {
        let spp = study.stacks[place.0 as usize].levels();
        let stops = self.stops.get(&place).into_iter().flatten().map(|&level| Observation::stop(level, spp));
        let measured = self.measured.get(&place).cloned().map(Observation::Measured);
        stops.chain(measured).collect()
    }

    /// This observer's threshold of a tile in samples per pixel: the mean of the stops, or of the
    /// posterior. A stop is the first level above a threshold, which is taken to lie in the middle below it.
    pub fn threshold(&self, study: &Study, place: TileKey) -> Option<f64> {
        if let Some(stops) = self.stops.get(&place).filter(|s| !s.is_empty()) {
            let spp = study.stacks[place.0 as usize].levels();
            let middle = |&level: &u32| between(spp, level).iter().sum::<f64>() / 2.0;
            let sum: f64 = stops.iter().map(|level| middle(level).exp()).sum();
            return Some(sum / stops.len() as f64);
        }
        self.measured.get(&place).map(|known| known.moments().0.exp())
    }
}

/// The ends of where a threshold lies that was left at a level, in ln(spp): the level before, and that one. The reference
/// has no noise, so that what is left there is taken to be one more step away.
pub(super) fn between(spp: &[u64], level: u32) -> [f64; 2] {
    let (ln, last) = (|level| ln_spp(spp, level), spp.len() as u32 - 1);
    match level {
        0 => [ln(0); 2],
        _ if level == last && last > 1 => [ln(last - 1), 2.0 * ln(last - 1) - ln(last - 2)],
        _ => [ln(level - 1), ln(level)],
    }
}

pub fn places(study: &Study) -> Vec<TileKey> {
    let tiles = |(s, stack): (usize, &crate::stack::StudyStack)| {
        (0..stack.grid().len()).map(move |tile| (s as u32, tile as u32)).collect::<Vec<_>>()
    };
    study.stacks.iter().enumerate().flat_map(tiles).collect()
}

/// Replays stored sessions, skipping those without an answer that counts.
pub fn replay_all(study: &Arc<Study>, records: &[SessionRecord]) -> Result<Vec<Observer>, StudyError> {
    let grids = grids(study);
    let mut observers = Vec::with_capacity(records.len());
    for record in records {
        let session = replay(study.clone(), grids.clone(), record)?;
        let mut observer = Observer::of(&record.code, &record.group, &session);
        observer.ids.clone_from(&record.ids);
        if observer.has_answers() {
            observers.push(observer);
        }
    }
    Ok(observers)
}
