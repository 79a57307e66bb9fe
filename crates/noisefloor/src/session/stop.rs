//! How tiles end.

use crate::criterion::Verdict;
use crate::tile::Tile;
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};
use std::fmt;

/// Why a tile gets no more samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "files", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum StopReason {
    /// The criterion is satisfied.
    Converged,
    /// The number of samples that was asked for is there; nobody looked at the noise
    /// ([`FixedSpp`](crate::FixedSpp)).
    ReachedSpp,
    /// The largest number of samples was reached first.
    MaxSpp,
    /// The time limit was reached.
    TimeLimit,
    /// The run was cancelled.
    Cancelled,
    /// The source has no more samples (a playback came to its end).
    SourceExhausted,
    /// The source or the criterion failed.
    Failed,
}

impl StopReason {
    /// Whether the criterion has what it wanted.
    pub fn is_satisfied(self) -> bool {
        matches!(self, Self::Converged | Self::ReachedSpp)
    }

    /// Whether no later run would add samples: the criterion is satisfied, or has all it may have. Tiles that
    /// ended otherwise are open again when a session is resumed.
    pub fn is_final(self) -> bool {
        self.is_satisfied() || self == Self::MaxSpp
    }
}

/// Why a caller ends tiles that no criterion has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Interruption {
    /// The caller allows no more samples.
    MaxSpp,
    /// The time limit was reached.
    TimeLimit,
    /// The run was cancelled.
    Cancelled,
    /// The source has no more samples.
    SourceExhausted,
    /// The source or the criterion failed.
    Failed,
}

impl From<Interruption> for StopReason {
    fn from(interruption: Interruption) -> Self {
        match interruption {
            Interruption::MaxSpp => Self::MaxSpp,
            Interruption::TimeLimit => Self::TimeLimit,
            Interruption::Cancelled => Self::Cancelled,
            Interruption::SourceExhausted => Self::SourceExhausted,
            Interruption::Failed => Self::Failed,
        }
    }
}

impl fmt::Display for StopReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Converged => "converged",
            Self::ReachedSpp => "reached-spp",
            Self::MaxSpp => "max-spp",
            Self::TimeLimit => "time-limit",
            Self::Cancelled => "cancelled",
            Self::SourceExhausted => "source-exhausted",
            Self::Failed => "failed",
        })
    }
}

/// A tile that is done.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[non_exhaustive]
pub struct Stop {
    /// The tile.
    pub tile: Tile,
    /// Samples per pixel when it stopped.
    pub spp: u64,
    /// [`Verdict::probability`] of the last verdict, for the observers of the training data; `None` if never judged
    /// or not offered. Small where a tile has converged for a less demanding [audience](crate::Params::audience), who
    /// have enough where those still see noise.
    pub probability: Option<f32>,
    /// Why.
    pub reason: StopReason,
    /// Whether the last verdict said that the tile is unlike anything the criterion was made for.
    pub unfamiliar: bool,
}

impl Stop {
    /// A tile that nobody has judged.
    pub fn new(tile: Tile, spp: u64, reason: StopReason) -> Self {
        Self { tile, spp, probability: None, reason, unfamiliar: false }
    }

    /// The same with what the last verdict says.
    pub fn with_verdict(self, verdict: &Verdict) -> Self {
        Self { probability: verdict.probability, unfamiliar: verdict.unfamiliar, ..self }
    }
}

/// Where a tile stands: open for its goal, or stopped. One that stopped at a limit has its goal still, for a session
/// that is resumed.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub(crate) struct TileState {
    pub(crate) goal: Goal,
    /// The last.
    pub(crate) verdict: Option<Verdict>,
    pub(crate) stop: Option<Stop>,
}

/// What a tile gets samples for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub(crate) enum Goal {
    /// Its next verdict, at so many samples per pixel, after a streak of verdicts in a row that said "converged".
    Verdict { spp: u64, streak: u32 },
    /// What this audience wants, once the tile has converged for the trained one.
    Audience { spp: u64 },
}

impl Goal {
    /// Samples per pixel.
    pub(crate) fn spp(self) -> u64 {
        match self {
            Self::Verdict { spp, .. } | Self::Audience { spp } => spp,
        }
    }
}
