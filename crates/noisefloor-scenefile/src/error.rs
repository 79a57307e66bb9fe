//! What can be wrong with a scene file.

use noisefloor_ptwne::SceneError;
use std::collections::{HashMap, HashSet};
use std::error::Error;
use std::fmt;
use std::path::{Path, PathBuf};

/// Where in a file something is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    pub path: PathBuf,
    /// What part of it: a line (`line 12`), or the name of an element (`mesh 3 "Table", primitive 0`).
    pub part: Option<String>,
}

impl Place {
    pub(crate) fn file(path: &Path) -> Self {
        Self { path: path.to_owned(), part: None }
    }

    pub(crate) fn part(path: &Path, part: impl fmt::Display) -> Self {
        Self { path: path.to_owned(), part: Some(part.to_string()) }
    }

    pub(crate) fn line(path: &Path, line: impl fmt::Display) -> Self {
        Self::part(path, format_args!("line {line}"))
    }

    pub(crate) fn error(&self, fault: LoadFault) -> LoadError {
        LoadError { place: self.clone(), fault }
    }

    pub(crate) fn bad(&self, what: impl fmt::Display) -> LoadError {
        self.error(LoadFault::Bad(what.to_string()))
    }

    pub(crate) fn unsupported(&self, what: impl fmt::Display) -> LoadError {
        self.error(LoadFault::Unsupported(what.to_string()))
    }

    /// The error that the renderer does not take what is here.
    pub(crate) fn refused(&self) -> impl Fn(SceneError) -> LoadError + use<> {
        let place = self.clone();
        move |cause| place.error(cause.into())
    }

    /// [`LoadFault::TooLarge`] here, if `found` is above `limit`.
    pub(crate) fn at_most(&self, what: &'static str, found: u64, limit: u64) -> Result<(), LoadError> {
        if found > limit { Err(self.error(LoadFault::TooLarge { what, found, limit })) } else { Ok(()) }
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.part {
            Some(part) => write!(f, "{}: {part}", self.path.display()),
            None => write!(f, "{}", self.path.display()),
        }
    }
}

/// What becomes of something in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Treatment {
    /// It stops the load.
    Refused,
    /// It is replaced by something that looks much the same.
    Approximated,
    /// It is left out.
    Ignored,
}

/// Something in a file that the renderer leaves out or replaces.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Warning {
    pub place: Place,
    /// Whether it is left out or replaced.
    pub treatment: Treatment,
    /// What is left out, or by what it is replaced.
    pub what: String,
}

impl Warning {
    /// Something at `place` is left out.
    pub(crate) fn ignored(place: Place, what: impl fmt::Display) -> Self {
        Self { place, treatment: Treatment::Ignored, what: what.to_string() }
    }

    /// Something at `place` is replaced.
    pub(crate) fn approximated(place: Place, what: impl fmt::Display) -> Self {
        Self { place, treatment: Treatment::Approximated, what: what.to_string() }
    }
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.what)
    }
}

/// The same thing in one or more places.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Finding {
    /// What becomes of it.
    pub treatment: Treatment,
    pub what: String,
    /// Where it is, in the order of the file.
    pub places: Vec<Place>,
}

/// Most places that the text of a finding lists.
const LISTED_PLACES: usize = 5;

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.places.as_slice() {
            [] => write!(f, "{}", self.what),
            [place] => write!(f, "{place}: {}", self.what),
            places => {
                write!(f, "{} ({} times: {}", self.what, places.len(), places[0])?;
                for (before, place) in places.iter().zip(&places[1..]).take(LISTED_PLACES - 1) {
                    match &place.part {
                        Some(part) if place.path == before.path => write!(f, ", {part}")?,
                        _ => write!(f, ", {place}")?,
                    }
                }
                f.write_str(if places.len() > LISTED_PLACES { ", …)" } else { ")" })
            }
        }
    }
}

/// Groups warnings that say the same: most important first, then in the order in which they came up.
pub fn group_warnings(warnings: &[Warning]) -> Vec<Finding> {
    group(warnings.iter().map(|w| (w.treatment, w.what.clone(), &w.place)))
}

fn group<'a>(all: impl Iterator<Item = (Treatment, String, &'a Place)>) -> Vec<Finding> {
    let mut findings: Vec<Finding> = Vec::new();
    let mut known: HashMap<(Treatment, String), usize> = HashMap::new();
    for (treatment, what, place) in all {
        let index = *known.entry((treatment, what.clone())).or_insert_with(|| {
            findings.push(Finding { treatment, what, places: vec![] });
            findings.len() - 1
        });
        findings[index].places.push(place.clone());
    }
    findings.sort_by_key(|finding| finding.treatment);
    findings
}

/// Why a scene file cannot be loaded.
#[derive(Debug)]
#[non_exhaustive]
pub struct LoadError {
    /// Where it is wrong; of several errors, the first.
    pub place: Place,
    pub fault: LoadFault,
}

/// What is wrong there.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadFault {
    #[error("it is no scene file: its name must end in .gltf, .glb, .pbrt or .xml")]
    Format,
    #[error("this build reads no scene files: run `cargo run --release --features formats -- render …`")]
    LeftOut,
    #[error("cannot be read: {0}")]
    Read(std::io::Error),
    /// Something is not what it should be.
    #[error("{0}")]
    Bad(String),
    #[error("{0} is not supported")]
    Unsupported(String),
    #[error("`{0}` lies outside the folder of the scene; allow a folder by `--scene-root DIR`")]
    Outside(String),
    #[error("{found} {what}, more than {limit}")]
    TooLarge {
        /// What there is too much of.
        what: &'static str,
        found: u64,
        limit: u64,
    },
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error("{} errors", .0.len())]
    Several(Vec<LoadError>),
}

impl LoadError {
    /// All that is wrong: errors that say the same are one finding.
    pub fn findings(&self) -> Vec<Finding> {
        let all = match &self.fault {
            LoadFault::Several(errors) => errors.as_slice(),
            _ => std::slice::from_ref(self),
        };
        group(all.iter().map(|error| (Treatment::Refused, error.what(), &error.place)))
    }

    /// What is wrong, with its causes.
    fn what(&self) -> String {
        let mut message = self.fault.to_string();
        let mut cause = self.fault.source();
        while let Some(error) = cause {
            message += &format!(": {error}");
            cause = error.source();
        }
        message
    }
}

/// A line for each finding.
impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines: Vec<String> = self.findings().iter().map(ToString::to_string).collect();
        f.write_str(&lines.join("\n"))
    }
}

impl Error for LoadError {}

/// Collects errors, so that one load says all that is wrong.
#[derive(Debug, Default)]
pub(crate) struct Errors {
    errors: Vec<LoadError>,
    seen: HashSet<String>,
}

const MAX_ERRORS: usize = 1000;

impl Errors {
    /// Keeps the error, if it is one, and continues.
    pub(crate) fn take<T>(&mut self, result: Result<T, LoadError>) -> Result<Option<T>, LoadError> {
        match result {
            Ok(value) => Ok(Some(value)),
            Err(error) => {
                let large = matches!(error.fault, LoadFault::TooLarge { .. });
                let stop = large || self.errors.len() >= MAX_ERRORS;
                // Many shapes can wear one broken material
                if self.seen.insert(error.to_string()) {
                    self.errors.push(error);
                }
                if stop { Err(std::mem::take(self).into_error()) } else { Ok(None) }
            }
        }
    }

    pub(crate) fn finish(self) -> Result<(), LoadError> {
        if self.errors.is_empty() { Ok(()) } else { Err(self.into_error()) }
    }

    fn into_error(mut self) -> LoadError {
        match self.errors.len() {
            1 => self.errors.remove(0),
            _ => self.errors[0].place.clone().error(LoadFault::Several(self.errors)),
        }
    }
}
