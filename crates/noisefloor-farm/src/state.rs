//! What a farm keeps in its folder.

use crate::error::PLAN_VERSION;
use crate::plan::Task;
use crate::shard::ShardJob;
use serde::{Deserialize, Serialize};
use std::str::FromStr;

/// Most frames of one farm.
const MOST_FRAMES: u32 = 1_000_000;

/// Frames of a sequence: first and last.
///
/// ```
/// use noisefloor_farm::FrameRange;
/// let frames: FrameRange = "9-11".parse()?;
/// assert_eq!(frames.iter().map(FrameRange::folder).collect::<Vec<_>>(), ["0009", "0010", "0011"]);
/// assert!("3-1".parse::<FrameRange>().is_err());
/// # Ok::<(), String>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "(u32, u32)", into = "(u32, u32)")]
pub struct FrameRange {
    first: u32,
    last: u32,
}

impl FrameRange {
    /// The first frame.
    pub fn first(self) -> u32 {
        self.first
    }

    /// The last frame.
    pub fn last(self) -> u32 {
        self.last
    }

    /// All frames.
    pub fn iter(self) -> impl Iterator<Item = u32> {
        self.first..=self.last
    }

    /// How many.
    pub fn count(self) -> usize {
        (self.last - self.first) as usize + 1
    }

    /// Whether it has this frame.
    pub fn contains(self, frame: u32) -> bool {
        (self.first..=self.last).contains(&frame)
    }

    /// So many frames at equal distances, from the first to the last; at least these two, and at most all.
    pub fn spread(self, frames: usize) -> Vec<u32> {
        let gaps = frames.clamp(2, self.count().max(2)) as u64 - 1;
        let span = u64::from(self.last - self.first);
        let mut spread: Vec<u32> =
            (0..=gaps).map(|i| self.first + ((i * span + gaps / 2) / gaps) as u32).collect();
        spread.dedup();
        spread
    }

    /// The folder of a frame of a sequence.
    pub fn folder(frame: u32) -> String {
        format!("{frame:04}")
    }
}

impl TryFrom<(u32, u32)> for FrameRange {
    type Error = String;

    fn try_from((first, last): (u32, u32)) -> Result<Self, String> {
        if first > last || last - first >= MOST_FRAMES {
            return Err(format!(
                "frames {first} to {last} are none, or more than {MOST_FRAMES}, which need several farms"
            ));
        }
        Ok(Self { first, last })
    }
}

impl From<FrameRange> for (u32, u32) {
    fn from(FrameRange { first, last }: FrameRange) -> Self {
        (first, last)
    }
}

impl FromStr for FrameRange {
    type Err = String;

    /// `1-240`, or one frame.
    fn from_str(text: &str) -> Result<Self, String> {
        let (first, last) = text.split_once('-').unwrap_or((text, text));
        match (first.trim().parse(), last.trim().parse()) {
            (Ok(first), Ok(last)) => Self::try_from((first, last)),
            _ => Err("expected the first and the last frame, such as 1-240".into()),
        }
    }
}

/// What a farm renders.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FarmPlan<J> {
    pub(crate) version: u64,
    /// The render; that of a frame follows from it ([`Studio::of_frame`](crate::Studio::of_frame)).
    pub job: J,
    /// Of a sequence.
    pub frames: Option<FrameRange>,
    /// Most tasks of a round.
    pub tasks: usize,
    /// Whether shards are kept once they are merged.
    pub keep: bool,
    /// Frames of the sequence that the others wait for ([`Studio::after`](crate::Studio::after)).
    #[serde(default)]
    pub first: Vec<u32>,
}

impl<J> FarmPlan<J> {
    /// A render in rounds of at most about `tasks` tasks; with `keep`, shards outlive their merge.
    pub fn new(job: J, frames: Option<FrameRange>, tasks: usize, keep: bool) -> Self {
        Self { version: PLAN_VERSION, job, frames, tasks, keep, first: Vec::new() }
    }

    /// The same, where all other frames wait for these, and take from them what they have come to: an
    /// exposure. Frames that the sequence does not have are left out.
    #[must_use]
    pub fn with_first(self, mut first: Vec<u32>) -> Self {
        first.retain(|frame| self.frames.is_some_and(|frames| frames.contains(*frame)));
        Self { first, ..self }
    }

    /// Whether the frame of this index waits for others.
    pub(crate) fn waits(&self, index: usize) -> bool {
        let from = self.frames.map_or(0, FrameRange::first);
        !self.first.is_empty() && !self.first.iter().any(|frame| frame.saturating_sub(from) as usize == index)
    }

    /// Names of the frames: of their folders.
    pub fn names(&self) -> Vec<String> {
        match self.frames {
            Some(frames) => frames.iter().map(FrameRange::folder).collect(),
            None => vec!["frame".to_owned()],
        }
    }
}

/// What a frame is, found out when it is planned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameJob {
    /// Name of the scene.
    pub scene: String,
    /// Name of the source.
    pub source: String,
    /// What its samples are of.
    pub shards: ShardJob,
    /// Whether it waits for other frames: its job is then not known in full.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub waits: bool,
}

/// How far a frame is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameState {
    /// All tiles.
    pub tiles: usize,
    /// Tiles that are still open.
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
    /// Nothing yet.
    #[default]
    Planned,
    /// Its tasks were started here, or by Slurm jobs that nobody waits for any more.
    Started,
    /// Slurm runs it.
    OnSlurm(SlurmJobs),
}

/// The tasks of a round.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Round {
    /// Counts from 1.
    pub number: usize,
    /// One process each.
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
    /// Whether its tasks were started.
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
