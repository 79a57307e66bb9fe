//! Simulated observers: numbers, not people, and labelled as such everywhere.
//!
//! A [`Public`] defines the threshold of its median observer for each tile. Each [`SimulatedObserver`]
//! drawn from it has an individual sensitivity, and a threshold that varies from showing to showing, so
//! that it sees noise with the probability given by [`sees`](noisefloor_pages::questplus::sees). Both spreads
//! are logistic in ln(spp), so the correct result of an analysis is known.

mod drive;
mod observer;

pub use drive::{DriveError, drive, run};
pub use observer::{Behaviour, Public, SimulatedObserver, SpreadShape};
