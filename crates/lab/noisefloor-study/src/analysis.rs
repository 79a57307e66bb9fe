//! From answers to thresholds, agreement and tables.
//!
//! Sessions are replayed ([`Observer`]), observers are screened by stated rules ([`screening`]), tiles get
//! their thresholds ([`tiles`]), and agreement says how far to trust them. [`StudyReport`] holds the
//! results; [`files`] writes them.

mod agreement;
pub mod files;
mod fit;
mod interval;
pub mod observers;
mod plots;
pub mod raw;
mod report;
pub mod screening;
mod shapes;
mod spread;
mod summary;
pub mod tiles;

pub use agreement::{BetweenObservers, RepeatAgreement};
pub use observers::Observer;
pub use report::{AnalysisOptions, ClassRow, GroupLine, ObserverRow, StudyReport, analyse, report};
pub use spread::{PeopleSpread, spreads};
pub use tiles::{CorpusThreshold, TileRow};
