//! Exceptions.

use noisefloor_image::{PictureFault, WriteFault};
use noisefloor_rivals::MetricError;
use pyo3::exceptions::{PyException, PyOSError, PyOverflowError};
use pyo3::prelude::*;
use pyo3::{PyErr, create_exception};
use std::path::Path;

create_exception!(noisefloor, Error, PyException, "Whatever goes wrong in noisefloor.");
create_exception!(noisefloor, ParameterError, Error, "A parameter is out of its range, or no such thing.");
create_exception!(
    noisefloor,
    SizeError,
    Error,
    "An array, a picture or a tile has another size than it must have."
);
create_exception!(
    noisefloor,
    BatchError,
    Error,
    "A tile that does not exist, or a batch without new samples."
);
create_exception!(
    noisefloor,
    FaultError,
    Error,
    "Samples that cannot be what they are said to be, such as a batch that contains the one before."
);
create_exception!(noisefloor, ModelError, Error, "A model file is damaged, foreign, or of another version.");
create_exception!(noisefloor, CriterionError, Error, "The model cannot judge this.");
create_exception!(noisefloor, CheckpointError, Error, "A checkpoint is damaged, foreign, or of another job.");
create_exception!(noisefloor, PictureError, Error, "Pictures cannot be judged or compared.");

/// An error of the Rust library as an exception.
pub(crate) trait Raise {
    fn raise(self) -> PyErr;
}

macro_rules! raised_as {
    ($($error:ty => $exception:ident),* $(,)?) => {
        $(impl Raise for $error {
            fn raise(self) -> PyErr {
                $exception::new_err(self.to_string())
            }
        })*
    };
}

raised_as! {
    noisefloor::params::ParamsError => ParameterError,
    noisefloor::oracle::PeopleError => ParameterError,
    noisefloor::viewing::ViewingTextError => ParameterError,
    noisefloor::tile::TileError => SizeError,
    noisefloor::film::FilmError => BatchError,
    noisefloor::model::ModelError => ModelError,
    noisefloor::criterion::CriterionError => CriterionError,
    noisefloor::checkpoint::CheckpointError => CheckpointError,
    noisefloor::stills::StillError => PictureError,
    MetricError => PictureError,
}

impl Raise for noisefloor::SessionError {
    fn raise(self) -> PyErr {
        match self {
            Self::Params(error) => error.raise(),
            Self::Tile(error) => error.raise(),
            Self::Film(error) => error.raise(),
            Self::Criterion(error) => error.raise(),
            Self::Fault(fault) => FaultError::new_err(fault.to_string()),
            Self::Background(_) => Error::new_err(self.to_string()),
            other => ParameterError::new_err(other.to_string()),
        }
    }
}

impl Raise for noisefloor_eyes::EyesError {
    fn raise(self) -> PyErr {
        match &self {
            Self::Io { path, source } => file_error(path, source),
            other => ParameterError::new_err(other.to_string()),
        }
    }
}

impl Raise for noisefloor_image::PictureError {
    fn raise(self) -> PyErr {
        match &self.fault {
            PictureFault::Io(source) => file_error(&self.path, source),
            _ => PictureError::new_err(self.to_string()),
        }
    }
}

impl Raise for noisefloor_image::WriteError {
    fn raise(self) -> PyErr {
        match &self.fault {
            WriteFault::Folder { source, .. } => std::io::Error::new(source.kind(), self.to_string()).into(),
            WriteFault::Failed(source) => {
                let kind = source.downcast_ref().map_or(std::io::ErrorKind::Other, std::io::Error::kind);
                std::io::Error::new(kind, self.to_string()).into()
            }
            WriteFault::NotAFile => PyOSError::new_err(self.to_string()),
            _ => PictureError::new_err(self.to_string()),
        }
    }
}

/// OSError, or the one of its subclasses that fits, with the name of the file.
pub(crate) fn file_error(path: &Path, error: &std::io::Error) -> PyErr {
    std::io::Error::new(error.kind(), format!("{}: {error}", path.display())).into()
}

/// A whole number that is not below 0, nor larger than its type holds.
pub(crate) fn whole<'py, T>(value: &Bound<'py, PyAny>) -> PyResult<T>
where
    T: for<'a> FromPyObject<'a, 'py, Error = PyErr>,
{
    value.extract::<T>().map_err(|error| {
        if error.is_instance_of::<PyOverflowError>(value.py()) {
            ParameterError::new_err(format!("{value} is out of range: a whole number from 0 on is needed"))
        } else {
            error
        }
    })
}
