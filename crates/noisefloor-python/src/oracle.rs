//! Oracles.

use crate::errors::{Raise, file_error};
use crate::pickle::reduced;
use noisefloor::{Model, Oracle, People, StoppingCriterion, evidence::Evidence};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyType};
use std::fs::File;
use std::path::PathBuf;

/// A trained model with the share of people who are to see no noise. It never changes; any number
/// of sessions can be made from it.
///
/// people: the share of people who see no noise where a tile stops, in a scene like those that people were asked
///     about, between 0 and 1; 0.95 is that of the paper. model: path of a model that "noisefloor-lab train" has
/// written; None is the model inside the library, trained on
///     human data.
///
/// Raises ParameterError, ModelError, and OSError if the file cannot be read.
#[pyclass(frozen, name = "Oracle", module = "noisefloor")]
pub(crate) struct PyOracle(pub(crate) Oracle);

#[pymethods]
impl PyOracle {
    #[new]
    #[pyo3(signature = (people = 0.95, *, model = None))]
    fn new(people: f32, model: Option<PathBuf>) -> PyResult<Self> {
        let people = People::new(people).map_err(Raise::raise)?;
        let model = match model {
            None => Model::bundled(),
            Some(path) => {
                let file = File::open(&path).map_err(|error| file_error(&path, &error))?;
                Model::read(file).map_err(Raise::raise)?
            }
        };
        Ok(Self(Oracle::new(model, people)))
    }

    /// Share of people who are to see no noise.
    #[getter]
    fn people(&self) -> f32 {
        self.0.people().share()
    }

    /// BLAKE3 of the model, hexadecimal: identifies it in reports.
    #[getter]
    fn digest(&self) -> String {
        self.0.model().digest()
    }

    /// What tiles are compared with: "halves" or "reference". Sessions and judge() serve the first.
    #[getter]
    fn evidence(&self) -> &'static str {
        match self.0.model().evidence() {
            Evidence::Halves => "halves",
            Evidence::Reference => "reference",
        }
    }

    /// What pickle makes it from in another process, which has no file of the model.
    #[classmethod]
    fn _restore(_class: &Bound<'_, PyType>, people: f32, model: &[u8]) -> PyResult<Self> {
        let people = People::new(people).map_err(Raise::raise)?;
        Ok(Self(Oracle::new(Model::read(model).map_err(Raise::raise)?, people)))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let mut model = Vec::new();
        self.0.model().write(&mut model).map_err(Raise::raise)?;
        reduced::<Self>(py, (self.people(), PyBytes::new(py, &model)))
    }

    fn __repr__(&self) -> String {
        format!("<noisefloor.Oracle: {}, {} of people>", self.0.name(), self.0.people())
    }
}
