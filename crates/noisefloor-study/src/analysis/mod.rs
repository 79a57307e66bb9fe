//! From answers to thresholds, agreement and tables.
//!
//! Sessions are replayed ([`Observer`]), observers are screened by stated rules ([`observers`]), tiles get
//! their thresholds ([`tiles`]), and agreement says how far to trust them. [`StudyReport`] holds the
//! results; [`files`] writes them.

mod agreement;
mod classes;
pub mod files;
pub mod fit;
mod groups;
pub mod interval;
pub mod observers;
mod plots;
mod report;
mod summary;
pub mod tiles;

pub use agreement::{BetweenObservers, RepeatAgreement};
pub use classes::ClassRow;
pub use groups::GroupLine;
pub use observers::{Observer, ObserverRow};
pub use report::{AnalysisOptions, StudyReport, analyse, report};
pub use tiles::{CorpusThreshold, TileRow};
