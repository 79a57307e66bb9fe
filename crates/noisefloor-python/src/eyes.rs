//! Whose eyes, as `noisefloor calibrate` has measured them.

use crate::errors::{ParameterError, file_error};
use crate::params::PyViewing;
use noisefloor_eyes::{Eyes, EyesError, Person};
use pyo3::prelude::*;
use std::path::PathBuf;

/// What `noisefloor calibrate` has measured of somebody's eyes and display, from eyes():
///
///     seen = noisefloor.eyes()
///     params = noisefloor.Params(viewing=seen.viewing, audience=seen.audience) if seen else None
#[pyclass(frozen, name = "Eyes", module = "noisefloor")]
pub(crate) struct PyEyes(Person);

#[pymethods]
impl PyEyes {
    /// Who.
    #[getter]
    fn name(&self) -> &str {
        &self.0.name
    }

    /// How many times the samples of the model's observers they need.
    #[getter]
    fn factor(&self) -> f64 {
        self.0.factor
    }

    /// 80 % interval of the factor.
    #[getter]
    fn interval(&self) -> (f64, f64) {
        (self.0.interval[0], self.0.interval[1])
    }

    /// Day of the measurement, as 2026-11-24.
    #[getter]
    fn date(&self) -> &str {
        &self.0.date
    }

    /// For Params.
    #[getter]
    fn audience(&self) -> (f64, f64) {
        let audience = self.0.audience();
        (audience.slope, audience.offset)
    }

    /// For Params.
    #[getter]
    fn viewing(&self) -> PyViewing {
        PyViewing(self.0.viewing())
    }

    fn __repr__(&self) -> String {
        format!("<Eyes of {}: {:.2} times the samples>", self.0.name, self.0.factor)
    }
}

/// eyes(path=None) --
///
/// Reads what `noisefloor calibrate` has measured: Eyes of whoever needs so many samples that nine of ten
/// people of the file are content. Without a path the user's own file, and None if nobody is calibrated.
///
/// Raises OSError if the file cannot be read, ParameterError if it holds something else.
#[pyfunction]
#[pyo3(signature = (path = None))]
pub(crate) fn eyes(path: Option<PathBuf>) -> PyResult<Option<PyEyes>> {
    let read = match path {
        Some(path) => Eyes::read(&path).map(Some),
        None => Eyes::own(),
    };
    let eyes = read.map_err(|error| match &error {
        EyesError::Io { path, source } => file_error(path, source),
        other => ParameterError::new_err(other.to_string()),
    })?;
    Ok(eyes.map(|eyes| PyEyes(eyes.strictest().clone())))
}
