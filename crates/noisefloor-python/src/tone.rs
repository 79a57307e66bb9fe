//! How a picture is shown by more than a curve: a table of colours.

use crate::errors::{ParameterError, SizeError, whole};
use noisefloor::Rgb;
use noisefloor::display::{ToneCurve, ToneTable, ToneTableError};
use numpy::ndarray::Array4;
use numpy::{IntoPyArray, PyArray1, PyArray4, PyArrayMethods, PyReadonlyArray4};
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// All tables made so far by the digest of their curves, which are kept as long: parameters hold only the curve.
static TABLES: Mutex<BTreeMap<String, Arc<ToneTable>>> = Mutex::new(BTreeMap::new());

/// ToneTable(table, toe=0.001, top=1000.0) --
///
/// How a picture is shown, as a table: AgX, a look, a studio's own pipeline.
///
/// table: array of shape (n, n, n, 3), 2 <= n <= 65, of display values (sRGB-encoded, 0 to 1), indexed by blue, green
///     and red: table[b, g, r] is how the radiance (x[r], x[g], x[b]) is shown, with x = ToneTable.radiances(n, toe, top).
/// toe: radiance at which the axes begin to be logarithmic. top: radiance of the last entry, and of more.
///
/// Between entries values are interpolated linearly. Tables are kept until the program ends, each once.
///
/// Raises SizeError or ParameterError if there is no such table.
#[pyclass(frozen, eq, name = "ToneTable", module = "noisefloor", from_py_object)]
#[derive(Clone)]
pub(crate) struct PyToneTable {
    pub(crate) curve: ToneCurve,
    table: Arc<ToneTable>,
}

impl PartialEq for PyToneTable {
    fn eq(&self, other: &Self) -> bool {
        self.curve == other.curve
    }
}

fn raise(error: ToneTableError) -> PyErr {
    match error {
        ToneTableError::Entries { .. } => SizeError::new_err(error.to_string()),
        _ => ParameterError::new_err(error.to_string()),
    }
}

impl PyToneTable {
    /// The table of a curve that this module has made; None if it has not.
    pub(crate) fn of(curve: &ToneCurve) -> Option<Self> {
        let tables = TABLES.lock().unwrap_or_else(PoisonError::into_inner);
        Some(Self { curve: curve.clone(), table: Arc::clone(tables.get(&curve.digest())?) })
    }
}

#[pymethods]
impl PyToneTable {
    #[new]
    #[pyo3(signature = (table, toe = 0.001, top = 1000.0))]
    fn new(table: &Bound<'_, PyAny>, toe: f32, top: f32) -> PyResult<Self> {
        let array = table.py().import("numpy")?.call_method1("asarray", (table, "float32"));
        let array = array.map_err(|error| SizeError::new_err(format!("no array of colours: {error}")))?;
        let Ok(array) = array.cast::<PyArray4<f32>>() else {
            return Err(SizeError::new_err("a tone table has shape (n, n, n, 3)"));
        };
        let array: PyReadonlyArray4<'_, f32> = array.readonly();
        let view = array.as_array();
        let &[edge, g, r, channels] = view.shape() else { unreachable!("an array of four axes") };
        if (g, r, channels) != (edge, edge, 3) {
            return Err(SizeError::new_err(format!(
                "a tone table has shape (n, n, n, 3), not ({edge}, {g}, {r}, {channels})"
            )));
        }
        let values: Vec<f32> = view.iter().copied().collect();
        let values: Vec<Rgb> = values.as_chunks().0.to_vec();
        let table = Arc::new(ToneTable::new(edge, toe, top, values).map_err(raise)?);
        let curve = ToneTable::clone(&table).into_tone_curve();
        let mut tables = TABLES.lock().unwrap_or_else(PoisonError::into_inner);
        Ok(Self { curve: curve.clone(), table: Arc::clone(tables.entry(curve.digest()).or_insert(table)) })
    }

    /// radiances(n, toe=0.001, top=1000.0) --
    ///
    /// The radiances of the entries along an axis, n numbers from 0 to top.
    #[staticmethod]
    #[pyo3(signature = (n, toe = 0.001, top = 1000.0))]
    fn radiances<'py>(
        py: Python<'py>,
        #[pyo3(from_py_with = whole)] n: usize,
        toe: f32,
        top: f32,
    ) -> PyResult<Bound<'py, PyArray1<f32>>> {
        Ok(ToneTable::radiances(n, toe, top).map_err(raise)?.into_pyarray(py))
    }

    fn __getnewargs__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyArray4<f32>>, f32, f32)> {
        let edge = self.table.edge();
        let values = self.table.values().as_flattened().to_vec();
        let array = Array4::from_shape_vec((edge, edge, edge, 3), values);
        let array = array.map_err(|error| SizeError::new_err(error.to_string()))?.into_pyarray(py);
        let (toe, top) = self.table.range();
        Ok((array, toe, top))
    }

    fn __repr__(&self) -> String {
        let ((toe, top), digest) = (self.table.range(), self.curve.digest());
        format!("<ToneTable {} of edge {}, toe {toe}, top {top}>", &digest[..8], self.table.edge())
    }
}
