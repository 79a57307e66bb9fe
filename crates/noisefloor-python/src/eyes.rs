//! Whose eyes, as `noisefloor calibrate` has measured them.

use crate::errors::Raise;
use crate::params::PyViewing;
use crate::pickle::reduced;
use noisefloor_eyes::{Eyes, Person};
use pyo3::prelude::*;
use pyo3::types::PyType;
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

    /// What pickle makes it from: the text of a file.
    #[classmethod]
    fn _restore(_class: &Bound<'_, PyType>, text: &str) -> PyResult<Self> {
        Ok(Self(Eyes::parse(text).map_err(Raise::raise)?.strictest().clone()))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = Eyes::of(self.0.clone()).and_then(|eyes| eyes.to_text()).map_err(Raise::raise)?;
        reduced::<Self>(py, (text,))
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
    let eyes = read.map_err(Raise::raise)?;
    // Factors refer to the observers of a model; people of others are left out
    let eyes = eyes.map(|eyes| eyes.beside(&noisefloor::Model::bundled().digest()).unwrap_or(eyes));
    Ok(eyes.map(|eyes| PyEyes(eyes.strictest().clone())))
}
