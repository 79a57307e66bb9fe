//! Errors. Every message says what happened, where, and what to do.

use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// Why a page cannot be shown.
#[derive(Debug, Error)]
pub enum PagesError {
    #[error("cannot listen on {address}: {source}; choose another port with --port")]
    Listen {
        address: String,
        /// The error of the operating system.
        source: io::Error,
    },
    #[error("{}: cannot be read: {source}; check the path and its permissions", path.display())]
    Io {
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    #[error("{}: {what}; docs/studies.md says what a language file holds", path.display())]
    Language {
        path: PathBuf,
        /// What is wrong, with the line number if known.
        what: String,
    },
}
