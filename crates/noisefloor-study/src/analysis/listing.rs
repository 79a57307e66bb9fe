//! The table of observers, with the reasons of those who are excluded.

use super::observers::Observer;
use super::screening;
use crate::config::Study;
use crate::session::Stage;
use serde::Serialize;

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
    /// Catch trials answered.
    pub catch_trials: usize,
    /// Catch trials failed.
    pub catch_errors: usize,
    /// Ratio of this observer's thresholds to the median of the others' (median over tiles).
    pub sensitivity: Option<f64>,
    /// Pixels per degree of visual angle.
    pub pixels_per_degree: Option<f64>,
    /// Gamma of the screen, as matched by the observer.
    pub gamma: Option<f64>,
    /// Why the rules of the study exclude this observer, if they do.
    pub excluded: Option<String>,
}

/// One row per observer.
pub(super) fn rows(study: &Study, observers: &[Observer]) -> Vec<ObserverRow> {
    let all: Vec<&Observer> = observers.iter().collect();
    let sensitivities = screening::sensitivities(&all, study);
    let exclusions = screening::exclusions(observers, study);
    let row = |((o, sensitivity), reasons): ((&Observer, Option<f64>), Vec<String>)| ObserverRow {
        code: o.code.clone(),
        group: o.group.clone(),
        finished: o.stage == Stage::Finished,
        clicks: o.clicks,
        tiles: o.stops.len().max(o.measured.len()),
        catch_trials: o.caught.len(),
        catch_errors: o.caught.iter().filter(|(_, passed)| !passed).count(),
        sensitivity,
        pixels_per_degree: o.conditions.map(|c| c.pixels_per_degree()),
        gamma: o.conditions.map(|c| c.gamma),
        excluded: (!reasons.is_empty()).then(|| reasons.join("; ")),
    };
    observers.iter().zip(sensitivities).zip(exclusions).map(row).collect()
}
