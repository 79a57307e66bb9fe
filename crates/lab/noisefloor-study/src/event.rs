//! What observers do, as it is sent and stored.

use noisefloor_pages::viewing::Conditions;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Largest clock reading accepted, in milliseconds since 1970: the year 2255.
const MAX_CLOCK: u64 = 9_000_000_000_000;
/// Longest time a trial may take, in milliseconds: a day.
const MAX_TIME: f64 = 86_400_000.0;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
#[non_exhaustive]
pub enum StudyEvent {
    /// Consented. Nothing is shown before.
    Consent {
        language: String,
    },
    /// Answered the questions of the study.
    Questions {
        /// Answers by the id of the question.
        answers: BTreeMap<String, String>,
    },
    /// Reported viewing conditions. Sent again when the window moves to another screen.
    Conditions(Conditions),
    /// Acquisition: moved one tile by one level.
    Step {
        trial: u32,
        /// Row-major index of the tile.
        tile: u32,
        /// Level of the tile from now on.
        level: u32,
        /// Where the click was, in image pixels.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        at: Option<[u32; 2]>,
        /// Time since the pictures appeared, in milliseconds.
        ms: f64,
    },
    /// Acquisition: sees no difference any more.
    Done {
        trial: u32,
        /// When the pictures were shown.
        timing: TrialTiming,
    },
    /// Validation or forced choice: an answer.
    Answer {
        trial: u32,
        choice: Choice,
        /// When the pictures were shown.
        timing: TrialTiming,
    },
    Pause,
    Resume,
}

/// What was on screen when, by the clock of the page.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrialTiming {
    /// When the pictures appeared, in milliseconds since 1970.
    pub onset: u64,
    /// From when an answer was possible until it came, in milliseconds.
    pub ms: f64,
    /// Forced choice: measured display time of each interval, in milliseconds.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub intervals: Vec<f64>,
    /// Of a loop: what became of its frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<LoopFrames>,
}

/// How smoothly a loop was shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoopFrames {
    /// Frames that were drawn.
    pub shown: u32,
    /// Frames whose time passed before the browser asked for a picture.
    pub dropped: u32,
}

impl TrialTiming {
    pub(crate) fn is_sane(&self) -> bool {
        let time = |ms: &f64| (0.0..=MAX_TIME).contains(ms);
        self.onset <= MAX_CLOCK
            && time(&self.ms)
            && self.intervals.len() <= 2
            && self.intervals.iter().all(time)
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Choice {
    /// Validation: the two pictures are identical.
    Identical,
    Different,
    /// Forced choice: the first interval was noisy.
    First,
    /// Forced choice: the second one was.
    Second,
}

/// An event with its place in the session.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Envelope {
    /// Number within the session, from 0 without gaps. A repeated number is the same event again.
    pub seq: u64,
    /// Clock of the page, in milliseconds since 1970.
    pub at: u64,
    pub event: StudyEvent,
}

impl Envelope {
    /// Whether the clock reading is possible.
    pub fn has_sane_clock(&self) -> bool {
        self.at <= MAX_CLOCK
    }
}
