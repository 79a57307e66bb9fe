//! What can go wrong with a renderer in another process. Every message says what, where, and what to do. What
//! others wrote is safe to print.

use crate::renderer::Renderer;
use noisefloor::watch::ImpossibleLight;
use noisefloor_image::{PictureError, WriteError};
use std::io;
use std::path::PathBuf;
use std::process::ExitStatus;
use std::time::Duration;
use thiserror::Error;

/// A failure of a renderer in another process.
#[derive(Debug, Error)]
#[error("{renderer}, {doing}: {cause}{}", if cause.is_told() { String::new() } else { quote(.last_words) })]
pub struct SidecarError {
    /// The renderer.
    pub renderer: String,
    /// What it was doing: `"sampling tile 3"`.
    pub doing: String,
    /// The tile to blame: the only one requested, or the one that the renderer names.
    pub tile: Option<usize>,
    /// What went wrong.
    pub cause: Box<SidecarCause>,
    /// The end of its output on standard error, at most 4 KiB before control characters are escaped; may be
    /// empty.
    pub last_words: String,
}

impl SidecarError {
    /// Before there was a process.
    pub(crate) fn at_the_start(renderer: &Renderer, cause: SidecarCause) -> Self {
        let (renderer, doing) = (renderer.title.to_owned(), "starting".to_owned());
        Self { renderer, doing, tile: None, cause: Box::new(cause), last_words: String::new() }
    }
}

impl SidecarCause {
    /// Whether the renderer itself has said what is wrong: its last words are then a traceback of that.
    fn is_told(&self) -> bool {
        matches!(self, Self::Refused(_))
    }
}

/// What went wrong with a renderer in another process.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SidecarCause {
    /// The scene cannot be passed to a renderer.
    #[error("{}: {why}", path.display())]
    Scene {
        /// The scene.
        path: PathBuf,
        /// What is wrong with it, and what to do.
        why: String,
    },
    /// The host scripts could not be written into the cache folder.
    #[error(transparent)]
    Setup(#[from] SetupError),
    /// The interpreter could not be started.
    #[error(
        "{} could not be started: {source}; run `noisefloor doctor` to see what is installed",
        python.display()
    )]
    Start {
        /// The Python interpreter.
        python: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The process ended, or closed its stream, before it replied.
    #[error("its process ended{}", .status.map(|s| format!(" ({s})")).unwrap_or_default())]
    Died {
        /// How, if it is known.
        status: Option<ExitStatus>,
    },
    /// No reply in time. The process was killed.
    #[error(
        "no answer in {} s; if it is slow but not stuck, allow more time with --timeout",
        limit.as_secs_f64()
    )]
    Silent {
        /// The time allowed.
        limit: Duration,
    },
    /// The caller gave up before it answered ([`PictureFilter::give_up_when`]). The process was killed.
    ///
    /// [`PictureFilter::give_up_when`]: crate::PictureFilter::give_up_when
    #[error("it was interrupted before it answered")]
    GivenUp,
    /// A reply that does not match the request. The process was killed.
    #[error("its answer is wrong: {what}")]
    Wrong {
        /// What is wrong with it.
        what: String,
    },
    /// The renderer refused.
    #[error("{0}")]
    Refused(String),
    /// A batch cannot be the light of a scene.
    #[error(transparent)]
    Light(#[from] ImpossibleLight),
}

impl SidecarCause {
    /// Whether a new process may succeed: the old one is gone or cannot be trusted.
    pub(crate) fn deserves_a_restart(&self) -> bool {
        matches!(self, Self::Died { .. } | Self::Silent { .. } | Self::Wrong { .. })
    }
}

/// Why a renderer could not be installed or found.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SetupError {
    /// It is not installed.
    #[error(
        "{title} is not installed; run `noisefloor doctor --install {name}`, \
         or set {variable} to a Python that has it"
    )]
    Missing {
        /// The renderer, for people.
        title: &'static str,
        /// The renderer's short name.
        name: &'static str,
        /// The environment variable that names another interpreter.
        variable: String,
    },
    /// The interpreter exists, but the renderer does not load in it.
    #[error("{title} does not load in {}: {why}", python.display())]
    Broken {
        /// The renderer, for people.
        title: &'static str,
        /// The interpreter.
        python: PathBuf,
        /// What it said.
        why: String,
    },
    /// There is no home folder, and so no cache folder.
    #[error("there is no cache folder: {0}; set HOME or XDG_CACHE_HOME to a folder")]
    NoCache(String),
    /// A file or folder could not be made.
    #[error(
        "{}: {source}; check permissions and free space, or set XDG_CACHE_HOME to another folder",
        path.display()
    )]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// No interpreter of a version for which the renderer has packages.
    #[error("{title} needs CPython {wanted}, found {found}; install one of these and put it on the path")]
    NoPython {
        /// The renderer, for people.
        title: &'static str,
        /// Suitable versions: `3.11 or 3.12`.
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

/// The last lines of a program's output, as the end of a message.
fn quote(said: &str) -> String {
    const LINES: usize = 8;
    let lines: Vec<&str> = said.lines().map(str::trim_end).filter(|line| !line.is_empty()).collect();
    let last = &lines[lines.len().saturating_sub(LINES)..];
    if last.is_empty() { String::new() } else { format!("; its last words: {}", last.join("\n")) }
}

/// Why a command produced no samples.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CommandError {
    /// The template is not a command.
    #[error("the command {template:?}: {why}")]
    Template {
        /// The command with its placeholders.
        template: String,
        /// What is wrong with it, and what to do.
        why: String,
    },
    /// The scene, or a file that it names, cannot be read.
    #[error("{}: it, or a file that it names, cannot be read: {source}", scene.display())]
    Scene {
        /// The scene.
        scene: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The size of the picture is unknown.
    #[error("the size of the picture is unknown: {0}; give it with --size")]
    Size(String),
    /// No scratch folder.
    #[error("{}: no folder for its pictures: {source}; set TMPDIR to a writable folder", folder.display())]
    Folder {
        /// The folder for temporary files.
        folder: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The program could not be started.
    #[error("{program}: cannot be started: {source}; check its name and PATH")]
    Start {
        /// The program.
        program: String,
        /// The error of the operating system.
        source: io::Error,
    },
    /// A run of the program came to nothing.
    #[error("{command}: {fault}")]
    Run {
        /// The whole command.
        command: String,
        /// What went wrong.
        fault: RunFault,
    },
    /// The picture for the program could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The picture could not be read.
    #[error(transparent)]
    Read(#[from] PictureError),
    /// The picture cannot be the light of a scene.
    #[error(transparent)]
    Light(#[from] ImpossibleLight),
}

/// What went wrong with a run of a program. Sizes are width and height in pixels.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RunFault {
    /// It ended with an error, or took too long and was killed.
    #[error("{how}; its last words: {said}")]
    Failed {
        /// How it ended.
        how: String,
        /// The last lines of its output.
        said: String,
    },
    /// It wrote no picture, or several.
    #[error(
        "it wrote {found} where one picture is expected; write to {{out}}.exr or {{out}}.pfm; its last words: {said}"
    )]
    Output {
        /// `no file`, or names of several.
        found: String,
        /// The last lines of its output.
        said: String,
    },
    /// The picture has neither the size of the tile nor that of the whole image.
    #[error(
        "its picture has {}×{} pixels, neither {}×{} as requested nor those of the whole image",
        got.0, got.1, size.0, size.1
    )]
    Picture {
        /// Size requested.
        size: (usize, usize),
        /// The picture's size.
        got: (usize, usize),
    },
    /// The picture has another size than the one that the program was given.
    #[error("its picture has {}×{} pixels, but it was given one of {}×{}", got.0, got.1, size.0, size.1)]
    Resized {
        /// Size given.
        size: (usize, usize),
        /// The picture's size.
        got: (usize, usize),
    },
    /// The picture has pixels that are not finite.
    #[error("its picture has pixels that are not finite; check the program and its options")]
    NotFinite,
    /// The picture is display-encoded.
    #[error("its picture is a PNG, whose values are clipped and encoded; write EXR or PFM")]
    Display,
}

impl RunFault {
    pub(crate) fn of(self, command: String) -> CommandError {
        CommandError::Run { command, fault: self }
    }
}
