//! What can go wrong with shards and farms. Every message says what, where, and what to do.

use noisefloor::{SessionError, SourceError, source::IdentityChange, tile::TileError};
use noisefloor_image::WriteError;
use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// Version of the format of shards.
pub(crate) const VERSION: u32 = 2;

/// Why a shard cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ShardError {
    /// The operating system could not read it.
    #[error("it cannot be read: {0}")]
    Io(#[from] io::Error),
    /// Not a shard.
    #[error("it is not a shard: its first bytes are not those of one")]
    Foreign,
    /// Of another release.
    #[error("it has format version {0}, and this release reads version {VERSION}: render it again")]
    Version(u32),
    /// The content is not what was written.
    #[error("it is damaged: {0}")]
    Damaged(String),
    /// It is of another job.
    #[error("it belongs to another job: its {what} is {kept}, not {now}")]
    Other {
        /// What differs.
        what: &'static str,
        /// What the shard says of it.
        kept: String,
        /// What is merged.
        now: String,
    },
    /// Its samples are of another scene, or of other options.
    #[error("it belongs to another job: {0}")]
    Changed(#[from] IdentityChange),
    /// A picture or tile size out of range.
    #[error(transparent)]
    Tile(#[from] TileError),
}

/// Why a farm cannot go on.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FarmError {
    /// A file of the folder cannot be read.
    #[error("{}: cannot be read: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// A file of the folder has another content than it should have.
    #[error("{}: is not what a farm writes: {source}; plan the farm anew in another folder", path.display())]
    Json {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: serde_json::Error,
    },
    /// A file of the folder cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The folder is not a farm's, or already one.
    #[error("{}: {what}", path.display())]
    Folder {
        /// The folder.
        path: PathBuf,
        /// What is wrong, and what to do.
        what: String,
    },
    /// Another coordinator works in the folder.
    #[error(
        "{}: another noisefloor plans or merges in this folder; wait for it, or see `noisefloor farm status`",
        .0.display()
    )]
    Locked(PathBuf),
    /// The source cannot be divided.
    #[error(
        "{0} cannot be rendered on a farm: it does not promise that the same seed repeats its samples; \
         `noisefloor render` renders it on one machine"
    )]
    Repeats(String),
    /// The source cannot sample blocks.
    #[error("{0} cannot sample blocks of a tile by their need: leave out --blocks")]
    Blocks(String),
    /// A batch that no plan asks for.
    #[error(
        "the plan asks for {spp} samples of tile {tile} from sample {first} on, which no plan of a farm does: \
         it is damaged; plan the farm anew in another folder"
    )]
    Plan {
        /// The tile.
        tile: usize,
        /// Index of the first sample.
        first: u64,
        /// Samples per pixel.
        spp: u64,
    },
    /// The source failed.
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
    /// A program could not be run, or refused.
    #[error("`{program}` {what}")]
    Program {
        /// The program.
        program: String,
        /// What it did, and what to do.
        what: String,
    },
}
