//! One observer's way through a study: a state that events move on, and the trials it shows.

mod plan;
mod state;
mod trial;

pub use plan::Plan;
pub(crate) use state::begin;
pub use state::{EventMisfit, Haste, ParticipantSession, Stage, grids, replay};
pub use trial::{CatchKind, Class, Trial, TrialOutcome, TrialRole};
