//! What is shown in a trial, and what came of it.

use serde::{Deserialize, Serialize};

/// Class of a validation pair (Takouachet et al. 2017, §7.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Class {
    /// Two references.
    Reference,
    /// A reference, and the picture put together from where tiles stopped.
    Test,
    /// A reference, and the picture put together from 30 % of that.
    Noisy,
}

/// A trial as the page shows it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Trial {
    /// The reference beside a picture of tiles at these levels.
    Acquisition {
        /// Number of the trial, from 0.
        number: u32,
        /// Whether it does not count.
        practice: bool,
        /// The stack.
        stack: u32,
        /// Level of each tile.
        levels: Vec<u32>,
    },
    /// Two pictures side by side.
    Validation {
        /// Number of the trial, from 0.
        number: u32,
        /// Whether it does not count.
        practice: bool,
        /// The stack.
        stack: u32,
        /// Level of each tile of the picture at the left.
        left: Vec<u32>,
        /// And of that at the right.
        right: Vec<u32>,
    },
    /// Two pictures one after the other, which differ in one tile.
    ForcedChoice {
        /// Number of the trial, from 0.
        number: u32,
        /// Whether it does not count.
        practice: bool,
        /// The stack.
        stack: u32,
        /// The tile.
        tile: u32,
        /// Its level in the first interval. All other tiles are those of the reference.
        first: u32,
        /// And in the second.
        second: u32,
    },
}

/// What came of a trial.
#[derive(Clone, Debug, PartialEq)]
pub enum TrialOutcome {
    /// Acquisition: where the observer left each tile.
    Stops {
        /// The stack.
        stack: u32,
        /// Which showing of it, from 0.
        repeat: u32,
        /// Level of each tile.
        levels: Vec<u32>,
        /// Clicks on the way.
        clicks: u64,
    },
    /// Validation.
    Judged {
        /// The stack.
        stack: u32,
        /// What was shown.
        class: Class,
        /// What was said.
        identical: bool,
    },
    /// Forced choice.
    Chosen {
        /// The stack.
        stack: u32,
        /// The tile.
        tile: u32,
        /// Its level.
        level: u32,
        /// Whether the noise was found.
        right: bool,
    },
}
