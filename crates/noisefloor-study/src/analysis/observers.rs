//! What each observer answered, and who is unlike the others.

use super::fit::Observation;
use super::summary::median;
use crate::config::Study;
use crate::error::StudyError;
use crate::event::Conditions;
use crate::questplus::Posterior;
use crate::session::{Class, Stage, TrialOutcome, grids, replay};
use crate::store::SessionRecord;
use serde::Serialize;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Modified z-score above which an observer is an outlier (Iglewicz and Hoaglin 1993, "How to detect and
/// handle outliers", §3.3). They propose 3.5, which one normal value in 2100 exceeds. Observers are spread
/// logistically, and 3.5 would exclude one in 150 of them, along with part of the spread to be measured.
/// One logistic value in 1700 exceeds 5.
pub const OUTLYING: f64 = 5.0;
/// Fewest observers among whom outliers are looked for.
const FEWEST: usize = 5;
/// Smallest median deviation assumed, in ln(spp): where all agree to within a level, half a level is no
/// outlier.
const LEAST_DEVIATION: f64 = 0.05;
/// Standard deviation of a normal distribution in units of its median absolute deviation.
const MAD_TO_SD: f64 = 1.4826;

/// A tile: index of the stack, and row-major index in it.
pub type TileKey = (u32, u32);

/// The answers of one observer.
#[derive(Clone, Debug)]
pub struct Observer {
    /// The participant's code.
    pub code: String,
    /// Group; empty if the study has none.
    pub group: String,
    /// Whether all trials were answered.
    pub finished: bool,
    /// Viewing conditions.
    pub conditions: Option<Conditions>,
    /// Acquisition: the levels at which the observer left each tile, in order of showing.
    pub stops: BTreeMap<TileKey, Vec<u32>>,
    /// Forced choice: the posterior of ln(threshold) of each tile.
    pub measured: BTreeMap<TileKey, Posterior>,
    /// Validation: stack, class and whether it was called identical.
    pub judged: Vec<(u32, Class, bool)>,
    /// Clicks and answers that count.
    pub clicks: u64,
}

impl Observer {
    /// Collects the answers of a replayed session.
    pub fn of(code: &str, group: &str, session: &crate::session::ParticipantSession) -> Self {
        let mut observer = Self {
            code: code.to_owned(),
            group: group.to_owned(),
            finished: session.stage() == Stage::Finished,
            conditions: session.conditions().copied(),
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

    /// Whether the observer answered anything that counts.
    pub fn has_answers(&self) -> bool {
        self.clicks > 0 || !self.stops.is_empty()
    }

    /// Observations of this observer's threshold of a tile, one per showing.
    pub fn observations(&self, study: &Study, place: TileKey) -> Vec<Observation> {
        let spp = study.stacks[place.0 as usize].levels();
        let stops = self.stops.get(&place).into_iter().flatten().map(|&level| Observation::stop(level, spp));
        let measured = self.measured.get(&place).cloned().map(Observation::Measured);
        stops.chain(measured).collect()
    }

    /// This observer's threshold of a tile in samples per pixel: the mean of the stops, or of the
    /// posterior.
    pub fn threshold(&self, study: &Study, place: TileKey) -> Option<f64> {
        if let Some(stops) = self.stops.get(&place).filter(|s| !s.is_empty()) {
            let spp = study.stacks[place.0 as usize].levels();
            let sum: f64 = stops.iter().map(|&level| spp[level as usize] as f64).sum();
            return Some(sum / stops.len() as f64);
        }
        self.measured.get(&place).map(|known| known.moments().0.exp())
    }
}

/// All tiles of a study.
pub fn places(study: &Study) -> Vec<TileKey> {
    let tiles = |(s, stack): (usize, &crate::stack::StudyStack)| {
        (0..stack.grid().len()).map(move |tile| (s as u32, tile as u32)).collect::<Vec<_>>()
    };
    study.stacks.iter().enumerate().flat_map(tiles).collect()
}

/// Replays stored sessions, skipping those without an answer that counts.
///
/// # Errors
/// [`StudyError::Store`] if an event does not fit the study.
pub fn replay_all(study: &Arc<Study>, records: &[SessionRecord]) -> Result<Vec<Observer>, StudyError> {
    let grids = grids(study);
    let mut observers = Vec::with_capacity(records.len());
    for record in records {
        let session = replay(study.clone(), grids.clone(), record)?;
        let observer = Observer::of(&record.code, &record.group, &session);
        if observer.has_answers() {
            observers.push(observer);
        }
    }
    Ok(observers)
}

/// One row per observer.
#[derive(Clone, Debug, Serialize)]
pub struct ObserverRow {
    /// The participant's code.
    pub code: String,
    /// Group.
    pub group: String,
    /// Whether all trials were answered.
    pub finished: bool,
    /// Clicks and answers that count.
    pub clicks: u64,
    /// Tiles with a threshold.
    pub tiles: usize,
    /// Ratio of this observer's thresholds to the median of the others' (median over tiles).
    pub sensitivity: Option<f64>,
    /// Pixels per degree of visual angle.
    pub pixels_per_degree: Option<f64>,
    /// Gamma of the screen, as matched by the observer.
    pub gamma: Option<f64>,
    /// Why this observer is an outlier, if so.
    pub outlier: Option<String>,
}

/// Lines about all observers, with the outliers among them. The rule: an observer's sensitivity is the
/// median over tiles of ln(own threshold / median of the others'); the inconsistency the median over tiles
/// of |ln| between the showings. Whoever has a modified z-score beyond [`OUTLYING`] in the first, or above
/// it in the second, is unlike the others. In a validation, whoever calls as many noisy pairs identical as
/// reference pairs, or more, has not told them apart.
pub fn rows(study: &Study, observers: &[Observer]) -> Vec<ObserverRow> {
    let places = places(study);
    let table: Vec<Vec<Option<f64>>> = observers
        .iter()
        .map(|o| places.iter().map(|&p| o.threshold(study, p).map(f64::ln)).collect())
        .collect();
    let sensitivity = |of: usize| {
        let differences = (0..places.len()).filter_map(|p| {
            let own = table[of][p]?;
            let others = (0..table.len()).filter(|&o| o != of).filter_map(|o| table[o][p]);
            Some(own - median(others.collect())?)
        });
        median(differences.collect())
    };
    let inconsistency = |o: &Observer| {
        let apart = places.iter().filter_map(|place| {
            let spp = study.stacks[place.0 as usize].levels();
            let stops = o.stops.get(place).filter(|s| s.len() > 1)?;
            let ln = |level: &u32| (spp[*level as usize].max(1) as f64).ln();
            let (low, high) = (stops.iter().min()?, stops.iter().max()?);
            Some(ln(high) - ln(low))
        });
        median(apart.collect())
    };
    let sensitivities: Vec<Option<f64>> = (0..observers.len()).map(sensitivity).collect();
    let inconsistencies: Vec<Option<f64>> = observers.iter().map(inconsistency).collect();
    let row = |(i, o): (usize, &Observer)| {
        let odd = z_score(&sensitivities, i).filter(|z| z.abs() > OUTLYING);
        let erratic = z_score(&inconsistencies, i).filter(|z| *z > OUTLYING);
        let outlier = odd
            .map(|z| format!("thresholds unlike the others' (modified z = {z:.1})"))
            .or_else(|| erratic.map(|z| format!("showings of a tile far apart (modified z = {z:.1})")))
            .or_else(|| blind(o));
        ObserverRow {
            code: o.code.clone(),
            group: o.group.clone(),
            finished: o.finished,
            clicks: o.clicks,
            tiles: o.stops.len().max(o.measured.len()),
            sensitivity: sensitivities[i].map(f64::exp),
            pixels_per_degree: o.conditions.map(|c| c.pixels_per_degree()),
            gamma: o.conditions.map(|c| c.gamma),
            outlier,
        }
    };
    observers.iter().enumerate().map(row).collect()
}

/// Why the answers of a validation do not depend on the stimulus.
fn blind(observer: &Observer) -> Option<String> {
    let share = |class: Class| {
        let of = || observer.judged.iter().filter(|(_, c, _)| *c == class);
        (of().count() > 0)
            .then(|| of().filter(|(.., identical)| *identical).count() as f64 / of().count() as f64)
    };
    let (reference, noisy) = (share(Class::Reference)?, share(Class::Noisy)?);
    (noisy >= reference).then(|| {
        format!(
            "called {:.0} % of noisy and {:.0} % of reference pairs identical",
            100.0 * noisy,
            100.0 * reference
        )
    })
}

/// Modified z-score of a value.
fn z_score(values: &[Option<f64>], of: usize) -> Option<f64> {
    let all: Vec<f64> = values.iter().flatten().copied().collect();
    if all.len() < FEWEST {
        return None;
    }
    let middle = median(all.clone())?;
    let deviation = median(all.iter().map(|v| (v - middle).abs()).collect())?.max(LEAST_DEVIATION);
    Some((values[of]? - middle) / (MAD_TO_SD * deviation))
}
