//! What can be wrong with a scene file.

use noisefloor_ptwne::SceneError;
use std::fmt;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Where in a file something is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file.
    pub path: PathBuf,
    /// What part of it: a line (`line 12`), or the name of an element (`mesh 3 "Table", primitive 0`).
    pub part: Option<String>,
}

impl Place {
    /// A whole file.
    pub(crate) fn file(path: &Path) -> Self {
        Self { path: path.to_owned(), part: None }
    }

    /// A part of a file.
    pub(crate) fn part(path: &Path, part: impl fmt::Display) -> Self {
        Self { path: path.to_owned(), part: Some(part.to_string()) }
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

impl Place {
    /// [`LoadError::Bad`] here.
    pub(crate) fn bad(self, what: impl fmt::Display) -> LoadError {
        LoadError::Bad { place: self, what: what.to_string() }
    }

    /// [`LoadError::Unsupported`] here.
    pub(crate) fn unsupported(self, what: impl fmt::Display) -> LoadError {
        LoadError::Unsupported { place: self, what: what.to_string() }
    }

    /// [`LoadError::TooLarge`] here, if `found` is above `limit`.
    pub(crate) fn at_most(self, what: &'static str, found: u64, limit: u64) -> Result<(), LoadError> {
        if found > limit { Err(LoadError::TooLarge { place: self, what, found, limit }) } else { Ok(()) }
    }
}

/// Something in a file that the renderer does without.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Where.
    pub place: Place,
    /// What was ignored, or by what it was replaced.
    pub what: String,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.place, self.what)
    }
}

/// Why a scene file cannot be loaded.
#[derive(Debug, Error)]
pub enum LoadError {
    /// The extension is not one of a scene file.
    #[error("{} is not a scene file: its name must end in .gltf, .glb or .xml", path.display())]
    Format {
        /// The file.
        path: PathBuf,
    },
    /// A file cannot be opened or read.
    #[error("{place} cannot be read")]
    Read {
        /// The file, or where it is named.
        place: Place,
        /// Why.
        #[source]
        cause: std::io::Error,
    },
    /// A file is not what it should be.
    #[error("{place}: {what}")]
    Bad {
        /// Where.
        place: Place,
        /// What is wrong, and what is expected.
        what: String,
    },
    /// A file asks for something that is not supported and cannot be left out.
    #[error("{place}: {what} is not supported")]
    Unsupported {
        /// Where.
        place: Place,
        /// What it asks for.
        what: String,
    },
    /// A file names a file outside its own folder.
    #[error("{place}: `{name}` lies outside the folder of the scene")]
    Outside {
        /// Where it is named.
        place: Place,
        /// The name.
        name: String,
    },
    /// Something is larger than the limit.
    #[error("{place}: {found} {what}, more than {limit}")]
    TooLarge {
        /// Where.
        place: Place,
        /// What there is too much of.
        what: &'static str,
        /// How much there is.
        found: u64,
        /// The limit.
        limit: u64,
    },
    /// The renderer does not take a part of the scene.
    #[error("{place}")]
    Scene {
        /// Where.
        place: Place,
        /// Why.
        #[source]
        cause: SceneError,
    },
}
