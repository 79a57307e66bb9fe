//! What can go wrong with shards and farms. Every message says what, where, and what to do.

use noisefloor::{
    SessionError, SourceError, checkpoint::CheckpointError, internal::FileFault, source::IdentityChange,
    tile::TileError,
};
use noisefloor_image::WriteError;
use std::error::Error;
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Version of the format of shards.
pub(crate) const VERSION: u32 = 4;
/// Longest header of a shard that is read: some 300,000 batches.
pub(crate) const MAX_HEADER: u64 = 64 << 20;
/// Version of the format of plans; the first one held words of a command line.
pub(crate) const PLAN_VERSION: u64 = 5;

/// Why a shard cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ShardError {
    #[error("it cannot be read: {0}")]
    Io(#[from] io::Error),
    #[error("it is not a shard: its first bytes are not those of one")]
    Foreign,
    #[error("it has format version {0}, and this release reads version {VERSION}: render it again")]
    Version(u32),
    #[error("it is damaged: {0}")]
    Damaged(String),
    #[error("it belongs to another job: its {what} is {kept}, not {now}")]
    Other {
        what: String,
        /// What the shard says of it.
        kept: String,
        now: String,
    },
    #[error("it belongs to another job: {0}")]
    Changed(#[from] IdentityChange),
    #[error(transparent)]
    Tile(#[from] TileError),
}

impl From<FileFault> for ShardError {
    fn from(fault: FileFault) -> Self {
        match fault {
            FileFault::Io(error) => Self::Io(error),
            FileFault::Foreign => Self::Foreign,
            FileFault::Version(found) => Self::Version(found),
            FileFault::Damaged(what) => Self::Damaged(what),
            FileFault::Oversized(bytes) => {
                Self::Damaged(format!("its header has {bytes} bytes, more than the limit of {MAX_HEADER}"))
            }
        }
    }
}

/// What a [`Studio`](crate::Studio) has to say of its failures.
pub type StudioError = Box<dyn Error + Send + Sync>;

/// Why a farm cannot go on.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FarmError {
    #[error("{}: {fault}", path.display())]
    Path { path: PathBuf, fault: PathFault },
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error(
        "{0} cannot be rendered on a farm: it does not promise that the same seed repeats its samples; \
         `noisefloor render` renders it on one machine"
    )]
    Repeats(String),
    #[error(
        "the plan asks for {spp} samples of tile {tile} from sample {first} on, which no plan of a farm does: \
         it is damaged; plan the farm anew in another folder"
    )]
    Plan {
        tile: usize,
        /// Index of the first sample.
        first: u64,
        spp: u64,
    },
    #[error(transparent)]
    Source(#[from] SourceError),
    /// The criterion does not fit, or samples cannot be what they are said to be.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The scene or the options have changed since the plan.
    #[error(
        "the frame is not the one that was planned: {0}; restore it, or plan the farm anew in another folder"
    )]
    Edited(ShardError),
    #[error("`{program}` {what}")]
    Program {
        program: String,
        /// What it did, and what to do.
        what: String,
    },
    #[error("round {number} has been superseded by round {now}: nothing to do")]
    Superseded { number: usize, now: usize },
    #[error(
        "this model needs a reference, which a farm does not render; use a model trained on half buffers"
    )]
    Reference,
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    #[error("none of these files is a shard; {}: {source}", path.display())]
    NoShard { path: PathBuf, source: ShardError },
    #[error(transparent)]
    Studio(#[from] StudioError),
    #[error("{name}: {source}")]
    Frame { name: String, source: Box<Self> },
}

/// What is wrong with a file or folder of a farm.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PathFault {
    #[error("cannot be read: {0}")]
    Read(#[from] io::Error),
    #[error("is not what a farm writes: {0}; plan the farm anew in another folder")]
    Json(#[from] serde_json::Error),
    #[error(
        "has format version {0}, and this release reads version {PLAN_VERSION}; \
         finish it with the release that planned it, or plan the farm anew in another folder"
    )]
    Version(u64),
    /// The folder is not a farm's, or already one. What is wrong, and what to do.
    #[error("{0}")]
    Folder(String),
    #[error(
        "another noisefloor plans or merges in this folder; wait for it, or see `noisefloor farm status`"
    )]
    Locked,
    #[error(
        "round {number} is under way as Slurm jobs {tasks} and {step} ({left} left); \
         `noisefloor farm status` shows how far it is, `scancel {tasks} {step}` ends it"
    )]
    UnderWay {
        number: usize,
        /// Slurm's number of its tasks.
        tasks: String,
        /// Slurm's number of the job that merges them.
        step: String,
        left: usize,
    },
    #[error(
        "{rounds} rounds in a row brought no samples; see {}, mend what is wrong, and run again",
        log.display()
    )]
    Barren {
        rounds: usize,
        /// What the first task of the last one said.
        log: PathBuf,
    },
    #[error("round {number} has no task {task} (any more): nothing to do")]
    NoTask { number: usize, task: usize },
    #[error(
        "holds a picture of another job than the farm's; move it away, or plan the farm in another folder"
    )]
    OtherPicture,
    #[error("does not say which render it is of: {0}; render it again")]
    Unknown(#[source] serde_json::Error),
}

impl From<String> for PathFault {
    fn from(what: String) -> Self {
        Self::Folder(what)
    }
}

impl FarmError {
    /// A fault of what is at `path`.
    pub(crate) fn at(path: &Path, fault: impl Into<PathFault>) -> Self {
        Self::Path { path: path.to_owned(), fault: fault.into() }
    }

    /// Says which frame it is about.
    pub(crate) fn of(name: &str) -> impl FnOnce(Self) -> Self {
        move |error| Self::Frame { name: name.to_owned(), source: Box::new(error) }
    }
}
