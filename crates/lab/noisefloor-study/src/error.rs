//! Errors. Every message says what happened, where, and what to do.

use axum::http::StatusCode;
use noisefloor::tile::TileError;
use noisefloor_image::{PictureError, StackError, WriteError};
use noisefloor_pages::PagesError;
use noisefloor_pages::http::Refusal;
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a study cannot be run as its file asks.
#[derive(Debug, Error)]
pub enum StudyError {
    #[error("{}: {fault}", path.display())]
    File { path: PathBuf, fault: FileFault },
    #[error("stack {name}: {levels} pictures named by their samples per pixel; a stack needs 2 to {max}")]
    Levels { name: String, levels: usize, max: usize },
    /// A picture cannot be cut into tiles.
    #[error("stack {name}: {source}")]
    Tile { name: String, source: TileError },
    #[error(transparent)]
    Stack(#[from] StackError),
    #[error(transparent)]
    Picture(#[from] PictureError),
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error(transparent)]
    Pages(#[from] PagesError),
    /// Anything else, in words: there are no answers to analyse, say.
    #[error("{0}")]
    Other(String),
}

/// What is wrong with a file of a study.
#[derive(Debug, Error)]
pub enum FileFault {
    #[error("cannot be read: {0}; check the path and its permissions")]
    Io(#[from] io::Error),
    /// With the line number if known.
    #[error("{0}; docs/studies.md lists what a study file holds")]
    Content(String),
    #[error(
        "{got:?} pixels, but the most converged picture of the stack has {want:?}; \
         render it again at that size"
    )]
    Size {
        /// Its width and height in pixels.
        got: (usize, usize),
        want: (usize, usize),
    },
    #[error("has pixels that are not finite; fix the render")]
    NotFinite,
}

impl From<String> for FileFault {
    fn from(what: String) -> Self {
        Self::Content(what)
    }
}

impl StudyError {
    /// A fault of the file at `path`.
    pub(crate) fn at(path: &Path, fault: impl Into<FileFault>) -> Self {
        Self::File { path: path.to_owned(), fault: fault.into() }
    }
}

/// Why answers could not be stored or found. Acknowledged answers are never lost.
#[derive(Debug, Error)]
pub enum StoreError {
    /// A fault of the database as a whole.
    #[error("{}: {fault}", path.display())]
    File { path: PathBuf, fault: Box<StoreError> },
    #[error("{0}; check the free space and that the file is a database of `noisefloor-lab study`")]
    Database(#[from] rusqlite::Error),
    #[error(
        "holds answers to another study, or to an earlier design of this one; \
         name another `database` in the study file"
    )]
    OtherStudy,
    #[error("is not a database of `noisefloor-lab explore`; name another with --database")]
    NotDisagreements,
    #[error("no session has the code {0}; check it, or begin a new session")]
    Unknown(String),
    #[error("no participant was invited by this link; check that it was copied in full")]
    NoLink,
    #[error("event {seq} of session {code} already exists with other content; reload the session")]
    Conflict { code: String, seq: u64 },
    #[error("answers can no longer be stored because the database thread has ended; restart the server")]
    Closed,
    #[error("the trials stored for session {code} do not fit the study; was the database edited by hand?")]
    Plan { code: String },
    #[error("event {seq} of session {code} does not fit the study: {what}; was the database edited by hand?")]
    Event { code: String, seq: u64, what: String },
}

impl StoreError {
    /// Names the database, where the fault is one of it.
    pub(crate) fn at(self, path: &Path) -> Self {
        match self {
            Self::Database(_) | Self::OtherStudy | Self::NotDisagreements => {
                Self::File { path: path.to_owned(), fault: Box::new(self) }
            }
            other => other,
        }
    }
}

impl From<StoreError> for Refusal {
    fn from(error: StoreError) -> Self {
        match error {
            StoreError::Unknown(_) => Self::unknown_code(),
            StoreError::NoLink => {
                let do_ = "copy the whole link, or ask who invited you";
                Self::new(StatusCode::NOT_FOUND, "nobody was invited by this link", "link", do_)
            }
            StoreError::Conflict { seq, .. } => conflict(seq, seq + 1),
            error => {
                // Paths of the machine are for who runs the server, not for who answers
                eprintln!("error: {error}");
                let what = "the answer could not be kept";
                let do_ = "tell who runs the study; answers that were acknowledged are safe";
                Self::new(StatusCode::INTERNAL_SERVER_ERROR, what, "database", do_)
            }
        }
    }
}

/// The number of an event is taken by another one, or leaves a gap.
pub(crate) fn conflict(seq: u64, next: u64) -> Refusal {
    let what = if seq < next {
        format!("event {seq} is there already, and is another one")
    } else {
        format!("event {seq} leaves a gap: the next one is {next}")
    };
    let do_ = "load the session again, and continue from its next_seq";
    Refusal::new(StatusCode::CONFLICT, what, "seq", do_).with_next_seq(next)
}
