//! From answers to thresholds, agreements and tables.
//!
//! The order: sessions are replayed ([`Observer`]), observers unlike the others are set aside by a stated rule ([`observers`]), tiles get their
//! thresholds ([`tiles`]), and the rest looks at how far all that can be trusted. [`Report`] holds everything; [`files`] writes it.

mod agreement;
mod classes;
pub mod files;
pub mod fit;
mod groups;
pub mod interval;
pub mod observers;
mod plots;
pub mod tiles;

pub use agreement::{BetweenObservers, Repeats};
pub use classes::ClassRow;
pub use groups::GroupLine;
pub use observers::{Observer, ObserverRow};
pub use tiles::TileRow;

use crate::config::{Protocol, Study};
use crate::error::StudyError;
use crate::store::read_all;
use serde::Serialize;
use std::sync::Arc;

/// What an analysis may be told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Whether observers unlike the others count all the same.
    pub keep_outliers: bool,
    /// Seed of the bootstrap.
    pub seed: u64,
    /// Whether simulated observers are analysed, instead of people; never both.
    pub simulated: bool,
}

/// Everything that an analysis finds.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of noisefloor.
    pub noisefloor: &'static str,
    /// What observers did.
    pub protocol: Protocol,
    /// Whether the observers are simulated.
    pub simulated: bool,
    /// Every session that has an answer.
    pub observers: Vec<ObserverRow>,
    /// Thresholds, of the observers who count; none for a validation.
    pub tiles: Vec<TileRow>,
    /// Agreement of each observer with himself.
    pub repeats: Option<Repeats>,
    /// Agreement of the observers with each other.
    pub between: Option<BetweenObservers>,
    /// Each group's thresholds against those of the first group (Takouachet et al. 2017, §7.3).
    pub groups: Vec<GroupLine>,
    /// Validation: the paper's Table 2.
    pub classes: Vec<ClassRow>,
}

/// Analyses all answers to a study.
///
/// # Errors
/// [`StudyError`] if the answers cannot be read, or there are none.
pub fn analyse(study: &Arc<Study>, options: Options) -> Result<Report, StudyError> {
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

/// Analyses observers whose answers are at hand.
pub fn report(study: &Study, observers: &[Observer], options: Options) -> Report {
    let rows = observers::rows(study, observers);
    let counts = |row: &ObserverRow| options.keep_outliers || row.outlier.is_none();
    let kept: Vec<&Observer> =
        observers.iter().zip(&rows).filter(|(_, row)| counts(row)).map(|(o, _)| o).collect();
    let thresholds = study.protocol != Protocol::Validation;
    Report {
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
