//! One observer's way through a study: a state that events move on, and the trials it shows.

mod plan;
mod replay;
mod state;
mod trial;
mod view;

pub use plan::Plan;
pub(crate) use replay::begin;
pub use replay::replay;
pub use state::{EventMisfit, Haste, ParticipantSession, Stage, grids};
pub use trial::{CatchKind, Class, Trial, TrialOutcome, TrialRole};
