//! What is shown in a trial, and what came of it.

use serde::{Deserialize, Serialize};

/// Class of a validation pair (Takouachet et al. 2017, §7.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Class {
    Reference,
    /// A reference, and the picture assembled from where tiles stopped.
    Test,
    /// A reference, and the picture assembled from 30 % of that.
    Noisy,
}

/// Kind of a catch trial: its correct answer is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CatchKind {
    /// The reference beside itself.
    Identical,
    /// The noisiest level, seen by everybody who looks.
    Obvious,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TrialRole {
    /// Practice, which has to be passed.
    Practice,
    Data,
    Catch(CatchKind),
}

/// A trial as the page shows it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case")]
pub enum Trial {
    /// The reference beside a picture of tiles at these levels.
    Acquisition {
        /// Number of the trial, from 0.
        number: u32,
        practice: bool,
        stack: u32,
        /// Level of each tile.
        levels: Vec<u32>,
        /// Whether the reference is shown on both sides, whatever the levels.
        identical: bool,
    },
    /// Two pictures side by side.
    Validation {
        /// Number of the trial, from 0.
        number: u32,
        practice: bool,
        stack: u32,
        /// Level of each tile of the left picture.
        left: Vec<u32>,
        /// Level of each tile of the right picture.
        right: Vec<u32>,
    },
    /// Two pictures in succession that differ in one tile.
    ForcedChoice {
        /// Number of the trial, from 0.
        number: u32,
        practice: bool,
        stack: u32,
        tile: u32,
        /// Its level in the first interval. All other tiles are those of the reference.
        first: u32,
        /// Its level in the second interval.
        second: u32,
    },
}

/// The result of a trial that counts.
#[derive(Clone, Debug, PartialEq)]
pub enum TrialOutcome {
    /// Acquisition: where the observer left each tile.
    Stops {
        stack: u32,
        /// Level of each tile.
        levels: Vec<u32>,
        clicks: u64,
    },
    Judged {
        stack: u32,
        class: Class,
        /// Whether it was called identical.
        identical: bool,
    },
    Chosen {
        stack: u32,
        tile: u32,
        level: u32,
        /// Whether the noise was found.
        right: bool,
    },
    Caught {
        kind: CatchKind,
        /// Whether it was answered correctly.
        passed: bool,
    },
}
