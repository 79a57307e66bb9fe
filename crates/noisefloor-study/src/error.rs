//! What can go wrong. Every message says what, where, and what to do.

use noisefloor::TileError;
use noisefloor_image::{PictureError, StackError, WriteError};
use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// Why a study cannot be run as its file asks.
#[derive(Debug, Error)]
pub enum StudyError {
    /// The study file cannot be read.
    #[error("{}: cannot be read: {source}; check the path and its permissions", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The study file is not what it should be.
    #[error("{}: {what}; docs/study.md lists what a study file holds", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, with the line where it is known.
        what: String,
    },
    /// A stack has too few or too many pictures.
    #[error("stack {name}: {levels} pictures named by their samples per pixel; a stack needs 2 to {max}")]
    Levels {
        /// The stack.
        name: String,
        /// Pictures found.
        levels: usize,
        /// Most that are taken.
        max: usize,
    },
    /// A picture differs in size from its stack.
    #[error("{}: {got:?} pixels, but the most converged picture of the stack has {want:?}; render it again at that size", path.display())]
    Size {
        /// The picture.
        path: PathBuf,
        /// Its width and height in pixels.
        got: (usize, usize),
        /// Those of its stack.
        want: (usize, usize),
    },
    /// A picture has pixels that are no numbers.
    #[error("{}: has pixels that are not finite; mend the render, since they would be shown", path.display())]
    NotFinite {
        /// The picture.
        path: PathBuf,
    },
    /// Pictures cannot be cut into tiles.
    #[error("stack {name}: {source}")]
    Tile {
        /// The stack.
        name: String,
        /// The limits.
        source: TileError,
    },
    /// A folder is no stack.
    #[error(transparent)]
    Stack(#[from] StackError),
    /// A picture cannot be read.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// A result cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The answers cannot be read or kept.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A server address cannot be listened on.
    #[error("{address}: cannot be listened on: {source}; choose another with --port")]
    Listen {
        /// The address.
        address: String,
        /// What the system said.
        source: io::Error,
    },
    /// Pictures that cannot be explored.
    #[error("{0}")]
    Explore(String),
    /// Nothing to analyse.
    #[error("{0}")]
    Analysis(String),
}

/// Why answers could not be kept or found. Nothing that was acknowledged before is lost.
#[derive(Debug, Error)]
pub enum StoreError {
    /// The database said no.
    #[error("{}: {source}; check the space on the disk and that the file is a database of `noisefloor study`", path.display())]
    Database {
        /// The database.
        path: PathBuf,
        /// What SQLite said.
        source: rusqlite::Error,
    },
    /// The database holds the answers to another study.
    #[error("{}: holds answers to another study, or to an earlier design of this one; name another `database` in the study file", path.display())]
    OtherStudy {
        /// The database.
        path: PathBuf,
    },
    /// The database holds something else than disagreements.
    #[error("{}: is not a database of `noisefloor explore`; name another with --database", path.display())]
    NotDisagreements {
        /// The database.
        path: PathBuf,
    },
    /// There is no session of that code.
    #[error("no session has the code {0}; check it, or begin a new session")]
    Unknown(String),
    /// Another event has that number already.
    #[error("event {seq} of session {code} is there already, and is another one; load the session again")]
    Conflict {
        /// The session.
        code: String,
        /// The number.
        seq: u64,
    },
    /// The writer has stopped.
    #[error("answers are no longer kept, since the database's thread has ended; start the server again")]
    Closed,
    /// An event in the database does not fit the study.
    #[error("event {seq} of session {code} does not fit the study: {what}; was the database edited by hand?")]
    Event {
        /// The session.
        code: String,
        /// The number.
        seq: u64,
        /// What is wrong with it.
        what: String,
    },
}
