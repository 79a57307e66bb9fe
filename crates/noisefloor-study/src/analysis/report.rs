//! The results of an analysis.

use super::agreement::{self, BetweenObservers, RepeatAgreement};
use super::classes::{self, ClassRow};
use super::groups::{self, GroupLine};
use super::listing::{self, ObserverRow};
use super::observers::{self, Observer};
use super::tiles::{self, TileRow};
use crate::config::{Study, StudyProtocol};
use crate::error::StudyError;
use crate::store::read_all;
use serde::Serialize;
use std::sync::Arc;

/// Parameters of an analysis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AnalysisOptions {
    /// Whether to keep observers whom the rules of the study exclude.
    pub keep_excluded: bool,
    /// Seed of the bootstrap.
    pub seed: u64,
    /// Whether to analyse simulated observers instead of people; they are never mixed.
    pub simulated: bool,
}

/// Everything that an analysis finds.
#[derive(Clone, Debug, Serialize)]
pub struct StudyReport {
    /// Version of noisefloor.
    pub noisefloor: &'static str,
    /// The protocol of the study.
    pub protocol: StudyProtocol,
    /// Whether the observers are simulated.
    pub simulated: bool,
    /// All sessions with an answer.
    pub observers: Vec<ObserverRow>,
    /// Thresholds of the tiles, from the observers who count; empty for a validation.
    pub tiles: Vec<TileRow>,
    /// Agreement of each observer with themselves.
    pub repeats: Option<RepeatAgreement>,
    /// Agreement of the observers with each other.
    pub between: Option<BetweenObservers>,
    /// Thresholds of each group against the first one (Takouachet et al. 2017, §7.3).
    pub groups: Vec<GroupLine>,
    /// Validation: the paper's Table 2.
    pub classes: Vec<ClassRow>,
}

/// Analyses all stored answers of a study.
///
/// # Errors
/// [`StudyError`] if the answers cannot be read, or there are none.
pub fn analyse(study: &Arc<Study>, options: AnalysisOptions) -> Result<StudyReport, StudyError> {
    let mut records = read_all(&study.database, &study.design())?;
    records.retain(|record| record.simulated == options.simulated);
    let observers = observers::replay_all(study, &records)?;
    if observers.is_empty() {
        let who = if options.simulated { "simulated observers" } else { "people" };
        let what = format!("{}: no answers of {who} yet; nothing to analyse", study.database.display());
        return Err(StudyError::Analysis(what));
    }
    Ok(report(study, &observers, options))
}

/// Analyses observers already in memory.
pub fn report(study: &Study, observers: &[Observer], options: AnalysisOptions) -> StudyReport {
    let rows = listing::rows(study, observers);
    let counts = |row: &ObserverRow| options.keep_excluded || row.excluded.is_none();
    let kept: Vec<&Observer> =
        observers.iter().zip(&rows).filter(|(_, row)| counts(row)).map(|(o, _)| o).collect();
    let thresholds = study.protocol != StudyProtocol::Validation;
    StudyReport {
        noisefloor: env!("CARGO_PKG_VERSION"),
        protocol: study.protocol,
        simulated: options.simulated,
        tiles: if thresholds { tiles::rows(study, &kept, options.seed) } else { Vec::new() },
        repeats: agreement::repeats(study, &kept),
        between: agreement::between(study, &kept),
        groups: if thresholds { groups::lines(study, &kept) } else { Vec::new() },
        classes: classes::rows(&kept, options.seed),
        observers: rows,
    }
}
