//! What can go wrong with a renderer in another process. Every message says what, where, and what to do.

use crate::renderer::Renderer;
use noisefloor_image::PictureError;
use std::io;
use std::path::PathBuf;
use std::process::ExitStatus;
use std::time::Duration;
use thiserror::Error;

/// A failure of a renderer in another process.
#[derive(Debug, Error)]
#[error("{renderer}, {doing}: {cause}{}", quote(.last_words))]
pub struct SidecarError {
    /// The renderer.
    pub renderer: String,
    /// What it was at, tiles named: `"sampling tile 3"`.
    pub doing: String,
    /// The tile to blame: the only one asked for, or the one that the renderer names.
    pub tile: Option<usize>,
    /// What went wrong.
    pub cause: Box<SidecarCause>,
    /// The end of what it said on standard error, at most 4 KiB; may be empty.
    pub last_words: String,
}

impl SidecarError {
    /// Before there was a process.
    pub(crate) fn at_the_start(renderer: &Renderer, cause: SidecarCause) -> Self {
        let (renderer, doing) = (renderer.title.to_owned(), "starting".to_owned());
        Self { renderer, doing, tile: None, cause: Box::new(cause), last_words: String::new() }
    }
}

/// What went wrong with a renderer in another process.
#[derive(Debug, Error)]
pub enum SidecarCause {
    /// The scene, or the way to it, cannot be given to a renderer.
    #[error("{}: {why}", path.display())]
    Scene {
        /// The scene.
        path: PathBuf,
        /// What is wrong with it, and what to do.
        why: String,
    },
    /// The scripts of the host could not be put into the cache folder.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// The interpreter could not be started.
    #[error("{} could not be started: {source}; `noisefloor doctor` says what is there", python.display())]
    Start {
        /// The Python interpreter.
        python: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The process ended, or closed its stream, where a reply was due.
    #[error("its process ended{}", .status.map(|s| format!(" ({s})")).unwrap_or_default())]
    Died {
        /// How, if it is known.
        status: Option<ExitStatus>,
    },
    /// No reply in time. The process was killed.
    #[error("no answer in {} s; allow more time with --timeout if it is slow and not stuck", limit.as_secs_f64())]
    Silent {
        /// The time allowed.
        limit: Duration,
    },
    /// A reply that is not what was asked for. The process was killed.
    #[error("its answer is wrong: {what}")]
    Wrong {
        /// What is wrong with it.
        what: String,
    },
    /// The renderer said that it cannot.
    #[error("{0}")]
    Refused(String),
    /// No value of a tile is a finite number.
    #[error("no value of the tile is a finite number; look for a broken material, texture or light there")]
    NotFinite,
}

impl SidecarCause {
    /// Whether a new process may do better: where the old one is gone or not to be trusted.
    pub(crate) fn deserves_a_restart(&self) -> bool {
        matches!(self, Self::Died { .. } | Self::Silent { .. } | Self::Wrong { .. })
    }
}

/// Why a renderer could not be set up, or found.
#[derive(Debug, Error)]
pub enum SetupError {
    /// Nobody has installed it.
    #[error(
        "{title} is not installed; `noisefloor doctor --install {name}` does it, or set {variable} to a Python that has it"
    )]
    Missing {
        /// The renderer, for people.
        title: &'static str,
        /// The renderer's short name.
        name: &'static str,
        /// The environment variable that names another interpreter.
        variable: String,
    },
    /// The interpreter is there and the renderer does not load in it.
    #[error("{title} does not load in {}: {why}", python.display())]
    Broken {
        /// The renderer, for people.
        title: &'static str,
        /// The interpreter.
        python: PathBuf,
        /// What it said.
        why: String,
    },
    /// There is no home, and so no cache folder.
    #[error("there is no folder for caches: {0}; set HOME, or XDG_CACHE_HOME, to a folder")]
    NoCache(String),
    /// A file or folder could not be made.
    #[error("{}: {source}; check permissions and free space, or set XDG_CACHE_HOME to another folder", path.display())]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// No interpreter of a version that the renderer has packages for.
    #[error("{title} needs CPython {wanted}, found {found}; install one of them so that it is on the path")]
    NoPython {
        /// The renderer, for people.
        title: &'static str,
        /// Versions that will do: `3.11, 3.12`.
        wanted: String,
        /// What is on the path: `3.9.2`, or `none`.
        found: String,
    },
    /// A step of an installation failed.
    #[error("{title}: {step} failed{}", quote(.said))]
    Step {
        /// The renderer, for people.
        title: &'static str,
        /// The step.
        step: &'static str,
        /// Its last lines.
        said: String,
    },
}

/// The last lines of what somebody said, as the end of a message.
fn quote(said: &str) -> String {
    const LINES: usize = 8;
    let lines: Vec<&str> = said.lines().map(str::trim_end).filter(|line| !line.is_empty()).collect();
    let last = &lines[lines.len().saturating_sub(LINES)..];
    if last.is_empty() { String::new() } else { format!("; its last words: {}", last.join("\n")) }
}

/// Why a command gave no samples.
#[derive(Debug, Error)]
pub enum CommandError {
    /// The template is not a command.
    #[error("the command {template:?}: {why}")]
    Template {
        /// The command with its placeholders.
        template: String,
        /// What is wrong with it, and what to do.
        why: String,
    },
    /// The size of the picture is not known.
    #[error("the size of the picture is not known: {0}; say it with --size")]
    Size(String),
    /// No scratch folder.
    #[error("{}: no folder for its pictures: {source}; set TMPDIR to a folder that you may write to", folder.display())]
    Folder {
        /// The folder for temporary files.
        folder: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The program could not be started.
    #[error("{program}: cannot be started: {source}; check its name and the path")]
    Start {
        /// The program.
        program: String,
        /// What the system said.
        source: io::Error,
    },
    /// The program ended with an error, or took too long and was killed.
    #[error("{command}: {how}; its last words: {said}")]
    Failed {
        /// The whole command.
        command: String,
        /// How it ended.
        how: String,
        /// The last lines of its output.
        said: String,
    },
    /// The program left no picture, or several.
    #[error(
        "{command}: it left {found} where one picture is expected; write to {{out}}.exr or {{out}}.pfm; its last words: {said}"
    )]
    Output {
        /// The whole command.
        command: String,
        /// `no file`, or names of several.
        found: String,
        /// The last lines of its output.
        said: String,
    },
    /// The picture has neither the size of the tile nor that of the whole.
    #[error(
        "{command}: its picture has {got_width}×{got_height} pixels, neither {width}×{height} as asked for nor those of the whole image"
    )]
    Picture {
        /// The whole command.
        command: String,
        /// Width asked for, in pixels.
        width: usize,
        /// Height asked for, in pixels.
        height: usize,
        /// The picture's width in pixels.
        got_width: usize,
        /// The picture's height in pixels.
        got_height: usize,
    },
    /// The picture is display-encoded.
    #[error("{command}: its picture is a PNG, whose values are clipped and encoded; write EXR or PFM")]
    Display {
        /// The whole command.
        command: String,
    },
    /// The picture could not be read.
    #[error(transparent)]
    Read(#[from] PictureError),
}
