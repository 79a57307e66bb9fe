//! Oracles.

use crate::errors::{Raise, file_error};
use crate::pickle::reduced;
use noisefloor::{Model, Oracle, StoppingCriterion, Threshold, evidence::Evidence};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyType};
use std::fs::File;
use std::path::PathBuf;

/// A trained model with the probability from which a tile counts as converged. It never changes; any number
/// of sessions can be made from it.
///
/// threshold: between 0 and 1; 0.9 is that of the paper. model: path of a model that "noisefloor-lab train" has
/// written; None is the model inside the library, trained on
///     human data.
///
/// Raises ParameterError, ModelError, and OSError if the file cannot be read.
#[pyclass(frozen, name = "Oracle", module = "noisefloor")]
pub(crate) struct PyOracle(pub(crate) Oracle);

#[pymethods]
impl PyOracle {
    #[new]
    #[pyo3(signature = (threshold = 0.9, *, model = None))]
    fn new(threshold: f32, model: Option<PathBuf>) -> PyResult<Self> {
        let threshold = Threshold::new(threshold).map_err(Raise::raise)?;
        let model = match model {
            None => Model::bundled(),
            Some(path) => {
                let file = File::open(&path).map_err(|error| file_error(&path, &error))?;
                Model::read(file).map_err(Raise::raise)?
            }
        };
        Ok(Self(Oracle::new(model, threshold)))
    }

    /// P from which a tile counts as converged.
    #[getter]
    fn threshold(&self) -> f32 {
        self.0.threshold().get()
    }

    /// BLAKE3 of the model, hexadecimal: identifies it in reports.
    #[getter]
    fn digest(&self) -> String {
        self.0.model().digest()
    }

    /// What tiles are compared with: "halves", "reference" or "alone". Sessions and judge() serve the first.
    #[getter]
    fn evidence(&self) -> &'static str {
        match self.0.model().evidence() {
            Evidence::Halves => "halves",
            Evidence::Reference => "reference",
            Evidence::Alone => "alone",
        }
    }

    /// What pickle makes it from in another process, which has no file of the model.
    #[classmethod]
    fn _restore(_class: &Bound<'_, PyType>, threshold: f32, model: &[u8]) -> PyResult<Self> {
        let threshold = Threshold::new(threshold).map_err(Raise::raise)?;
        Ok(Self(Oracle::new(Model::read(model).map_err(Raise::raise)?, threshold)))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let mut model = Vec::new();
        self.0.model().write(&mut model).map_err(Raise::raise)?;
        reduced::<Self>(py, (self.threshold(), PyBytes::new(py, &model)))
    }

    fn __repr__(&self) -> String {
        format!("<noisefloor.Oracle: {}, P ≥ {}>", self.0.name(), self.0.threshold())
    }
}
