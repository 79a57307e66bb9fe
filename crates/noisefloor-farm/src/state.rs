//! What a farm keeps in its folder.

use crate::error::PLAN_VERSION;
use crate::plan::Task;
use crate::shard::ShardJob;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::str::FromStr;

const MOST_FRAMES: usize = 1_000_000;

/// Frames of a sequence, each once, in ascending order; at least one.
///
/// ```
/// use noisefloor_farm::Frames;
/// let frames: Frames = "9-11".parse()?;
/// assert_eq!(frames.iter().map(Frames::folder).collect::<Vec<_>>(), ["0009", "0010", "0011"]);
/// // Steps, lists and negative numbers, as farms send them
/// assert_eq!("1-9x4,-2--1".parse::<Frames>()?.iter().collect::<Vec<_>>(), [-2, -1, 1, 5, 9]);
/// assert_eq!("5,1-4".parse::<Frames>()?.to_string(), "1-5");
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Frames(Vec<i32>);

impl Frames {
    pub fn first(&self) -> i32 {
        self.0[0]
    }

    pub fn last(&self) -> i32 {
        self.0[self.0.len() - 1]
    }

    pub fn iter(&self) -> impl Iterator<Item = i32> {
        self.0.iter().copied()
    }

    /// The frame of an index, from 0.
    pub fn get(&self, index: usize) -> Option<i32> {
        self.0.get(index).copied()
    }

    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// Whether it has this frame.
    pub fn contains(&self, frame: i32) -> bool {
        self.0.binary_search(&frame).is_ok()
    }

    /// So many of the frames at equal distances, from the first to the last; at least these two, and at most all.
    pub fn spread(&self, frames: usize) -> Vec<i32> {
        let gaps = frames.clamp(2, self.count().max(2)) - 1;
        let span = self.count() - 1;
        let mut spread: Vec<i32> = (0..=gaps).map(|i| self.0[(i * span + gaps / 2) / gaps]).collect();
        spread.dedup();
        spread
    }

    /// The folder of a frame of a sequence.
    pub fn folder(frame: i32) -> String {
        format!("{frame:04}")
    }
}

impl TryFrom<String> for Frames {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        text.parse()
    }
}

impl From<Frames> for String {
    fn from(frames: Frames) -> Self {
        frames.to_string()
    }
}

impl FromStr for Frames {
    type Err = String;

    /// Ranges, single frames and both in a list: `1-240`, `7`, `1-3,9`; each range with a step, if it has one, as in
    /// `1-100x5` or `1-100:5`. `3-1` is `1-3`, and frames that are named twice count once.
    fn from_str(text: &str) -> Result<Self, String> {
        let mut frames = Vec::new();
        for part in text.split(',') {
            let Some((from, to, step)) = range(part.trim()) else {
                let forms = "frames, such as 1-240, 1-100x5, 1,5,9 or -3--1";
                return Err(format!("{part:?} is none of the forms that are known: expected {forms}"));
            };
            let (low, high) = (from.min(to), from.max(to));
            let steps = (i64::from(high) - i64::from(low)) / i64::from(step) + 1;
            if steps as usize > MOST_FRAMES - frames.len() {
                return Err(format!("{text} has more than {MOST_FRAMES} frames, which need several farms"));
            }
            // Steps begin with the frame that is named first
            let way = if from <= to { 1 } else { -1 };
            frames.extend((0..steps).map(|i| (i64::from(from) + way * i * i64::from(step)) as i32));
        }
        frames.sort_unstable();
        frames.dedup();
        Ok(Self(frames))
    }
}

/// First and last frame and the step of `7`, `1-9`, `1-9x2` or `1-9:2`.
fn range(text: &str) -> Option<(i32, i32, u32)> {
    let (frames, step) = match text.split_once(['x', ':']) {
        Some((frames, step)) => (frames, step.trim().parse().ok().filter(|step| *step > 0)?),
        None => (text, 1),
    };
    // The first sign belongs to the number
    let dash = frames.char_indices().skip(1).find(|(_, c)| *c == '-').map(|(at, _)| at);
    let (from, to) = match dash {
        Some(at) => (&frames[..at], &frames[at + 1..]),
        None => (frames, frames),
    };
    Some((from.trim().parse().ok()?, to.trim().parse().ok()?, step))
}

impl fmt::Display for Frames {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut rest = self.0.as_slice();
        let mut comma = "";
        while let [first, ..] = *rest {
            // As far as the steps are equal; two frames alone are no range with a step
            let step = rest.get(1).map_or(1, |next| i64::from(*next) - i64::from(first));
            let even =
                rest.windows(2).take_while(|pair| i64::from(pair[1]) - i64::from(pair[0]) == step).count();
            let length = if even >= 2 || step == 1 { even + 1 } else { 1 };
            let last = rest[length - 1];
            match (length, step) {
                (1, _) => write!(f, "{comma}{first}")?,
                (_, 1) => write!(f, "{comma}{first}-{last}")?,
                _ => write!(f, "{comma}{first}-{last}x{step}")?,
            }
            (rest, comma) = (&rest[length..], ",");
        }
        Ok(())
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FarmPlan<J> {
    pub(crate) version: u64,
    /// The render; that of a frame follows from it ([`Studio::of_frame`](crate::Studio::of_frame)).
    pub job: J,
    pub frames: Option<Frames>,
    /// Most tasks of a round.
    pub tasks: usize,
    /// Whether shards are kept once they are merged.
    pub keep: bool,
    /// Frames of the sequence that the others wait for ([`Studio::after`](crate::Studio::after)).
    #[serde(default)]
    pub first: Vec<i32>,
}

impl<J> FarmPlan<J> {
    /// A render in rounds of at most about `tasks` tasks; with `keep`, shards outlive their merge.
    pub fn new(job: J, frames: Option<Frames>, tasks: usize, keep: bool) -> Self {
        Self { version: PLAN_VERSION, job, frames, tasks, keep, first: Vec::new() }
    }

    /// The same, where all other frames wait for these, and take from them what they have come to: an
    /// exposure. Frames that the sequence does not have are left out.
    #[must_use]
    pub fn with_first(self, mut first: Vec<i32>) -> Self {
        first.retain(|frame| self.frames.as_ref().is_some_and(|frames| frames.contains(*frame)));
        Self { first, ..self }
    }

    /// Whether the frame of this index waits for others.
    pub(crate) fn waits(&self, index: usize) -> bool {
        let frame = self.frames.as_ref().and_then(|frames| frames.get(index));
        !self.first.is_empty() && frame.is_some_and(|frame| !self.first.contains(&frame))
    }

    /// Names of the frames: of their folders.
    pub fn names(&self) -> Vec<String> {
        match &self.frames {
            Some(frames) => frames.iter().map(Frames::folder).collect(),
            None => vec!["frame".to_owned()],
        }
    }
}

/// What a frame is, found out when it is planned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameJob {
    pub scene: String,
    pub source: String,
    /// What its samples are of.
    pub shards: ShardJob,
    /// Whether it waits for other frames: its job is then not known in full.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub waits: bool,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameState {
    pub tiles: usize,
    pub open: usize,
    /// Samples in the film, over all pixels.
    pub samples: u64,
    /// Samples of all shards that are used up, over all pixels: those in the film, and those beyond a stop.
    pub sampled: u64,
    /// Samples still expected, over all pixels.
    pub to_go: Option<u64>,
    /// Seconds in the source, of all tasks together.
    pub source_seconds: f64,
    /// Seconds of merging and judging.
    pub merge_seconds: f64,
    /// Rounds that were merged.
    pub rounds: usize,
    /// Whether the picture is there, with all the samples it should have.
    pub done: bool,
}

/// What is being done about a round.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RoundState {
    #[default]
    Planned,
    /// Its tasks were started here, or by Slurm jobs that nobody waits for any more.
    Started,
    OnSlurm(SlurmJobs),
}

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Round {
    /// Counts from 1.
    pub number: usize,
    pub tasks: Vec<Task>,
    /// Seconds since 1970 when it was planned.
    pub planned: f64,
    /// Seconds that the round before took, from its plan to this one.
    pub took: f64,
    /// Samples of all films when it was planned, over all pixels.
    pub samples: u64,
    /// Samples that all films got in the round before.
    pub brought: u64,
    /// Rounds in a row that brought nothing; none where this one does not count, whatever it brings.
    pub barren: Option<usize>,
    /// What is being done about it.
    pub state: RoundState,
}

impl Round {
    pub fn is_started(&self) -> bool {
        self.state != RoundState::Planned
    }

    /// The jobs of Slurm that run it.
    pub fn slurm(&self) -> Option<&SlurmJobs> {
        match &self.state {
            RoundState::OnSlurm(jobs) => Some(jobs),
            _ => None,
        }
    }
}

/// What Slurm runs a round as.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SlurmJobs {
    /// The array of tasks; none if there was nothing to sample.
    pub tasks: String,
    /// The job that merges them, judges, and submits the next round.
    pub step: String,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_what_farms_send() {
        for (text, frames) in [
            ("1-3", &[1, 2, 3][..]),
            ("7", &[7]),
            ("-7", &[-7]),
            ("1-9x4", &[1, 5, 9]),
            ("1-10x4", &[1, 5, 9]),
            ("1-9:4", &[1, 5, 9]),
            ("1,5,9", &[1, 5, 9]),
            ("1-3,9", &[1, 2, 3, 9]),
            ("9, 1 - 3", &[1, 2, 3, 9]),
            ("3-1", &[1, 2, 3]),
            ("10-1x4", &[2, 6, 10]),
            ("-2-1", &[-2, -1, 0, 1]),
            ("-3--1", &[-3, -2, -1]),
            ("-1--3x2", &[-3, -1]),
            ("0001-0003", &[1, 2, 3]),
            ("1-3,2-4", &[1, 2, 3, 4]),
            ("2147483646-2147483647", &[2_147_483_646, 2_147_483_647]),
        ] {
            let parsed: Frames = text.parse().unwrap_or_else(|e| panic!("{text}: {e}"));
            assert_eq!(parsed.iter().collect::<Vec<_>>(), frames, "{text}");
            // What is written is read again
            assert_eq!(parsed.to_string().parse(), Ok(parsed.clone()), "{text}: {parsed}");
        }
        for wrong in
            ["", ",", "1-", "-", "--1", "1-2-3", "1-9x", "1-9x0", "1-9x-2", "x2", "1-2147483648", "1.5", "a"]
        {
            let error = wrong.parse::<Frames>().unwrap_err();
            assert!(error.contains("such as 1-240, 1-100x5"), "{wrong}: {error}");
        }
        for many in ["-2147483648-2147483647", "1-1000001", "1-1000000,2000000"] {
            assert!(many.parse::<Frames>().unwrap_err().contains("more than 1000000 frames"), "{many}");
        }
        let written = |text: &str| text.parse::<Frames>().unwrap().to_string();
        let same = ["1-240", "7", "1-9x4", "1,5", "-3--1", "1-3,9-21x4", "-2147483648"];
        assert_eq!(same.map(written), same);
    }
}
