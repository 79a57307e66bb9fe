//! How a picture is shown by more than a curve: a table of colours, or a file of one.

use crate::arrays::{dtype, refuse_masked};
use crate::errors::{ParameterError, PictureError, Raise, SizeError, file_error, whole};
use crate::pickle::reduced;
use noisefloor::Rgb;
use noisefloor::display::{LutInput, LutInputError, ToneCurve, ToneTableError, parse_cube};
use noisefloor_image::read_cube;
use numpy::ndarray::Array4;
use numpy::{IntoPyArray, PyArray1, PyArray4, PyArrayMethods, PyReadonlyArray4};
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyType};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

/// What a curve of this module was made of.
#[derive(Clone)]
enum Origin {
    Table(Arc<Table>),
    Lut(Arc<LutText>),
}

/// A table, and the range of its axes.
struct Table {
    edge: usize,
    toe: f32,
    top: f32,
    values: Vec<Rgb>,
}

/// A `.cube` file.
struct LutText {
    text: Vec<u8>,
    input: LutInput,
}

/// All that was made so far by the digest of its curve, which is kept as long: parameters hold only the curve.
static MADE: Mutex<BTreeMap<String, Origin>> = Mutex::new(BTreeMap::new());

fn keep(curve: &ToneCurve, origin: Origin) {
    let mut made = MADE.lock().unwrap_or_else(PoisonError::into_inner);
    made.entry(curve.digest()).or_insert(origin);
}

/// The object that this module has made the curve of; None if it has not.
pub(crate) fn made<'py>(py: Python<'py>, curve: &ToneCurve) -> PyResult<Option<Bound<'py, PyAny>>> {
    let made = MADE.lock().unwrap_or_else(PoisonError::into_inner).get(&curve.digest()).cloned();
    let curve = curve.clone();
    Ok(match made {
        None => None,
        Some(Origin::Table(table)) => Some(PyToneTable { curve, table }.into_bound_py_any(py)?),
        Some(Origin::Lut(file)) => Some(PyLut { curve, file }.into_bound_py_any(py)?),
    })
}

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
/// Raises SizeError or ParameterError if there is no such table, PictureError if it holds integers.
#[pyclass(frozen, eq, name = "ToneTable", module = "noisefloor", from_py_object)]
#[derive(Clone)]
pub(crate) struct PyToneTable {
    pub(crate) curve: ToneCurve,
    table: Arc<Table>,
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

#[pymethods]
impl PyToneTable {
    #[new]
    #[pyo3(signature = (table, toe = 0.001, top = 1000.0))]
    fn new(table: &Bound<'_, PyAny>, toe: f32, top: f32) -> PyResult<Self> {
        refuse_masked(table.as_borrowed())?;
        let array = table.py().import("numpy")?.call_method1("asarray", (table,));
        let array = array.map_err(|error| SizeError::new_err(format!("no array of colours: {error}")))?;
        let (kind, name) = dtype(&array)?;
        if kind != 'f' {
            return Err(PictureError::new_err(format!(
                "a tone table of dtype {name} holds no display values: pass floats from 0 to 1, those of 8 bits divided by 255"
            )));
        }
        let array = array.call_method1("astype", ("float32",))?;
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
        let curve = ToneCurve::of_table(edge, toe, top, values.clone()).map_err(raise)?;
        let table = Arc::new(Table { edge, toe, top, values });
        keep(&curve, Origin::Table(Arc::clone(&table)));
        Ok(Self { curve, table })
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
        Ok(ToneCurve::table_radiances(n, toe, top).map_err(raise)?.into_pyarray(py))
    }

    fn __getnewargs__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyArray4<f32>>, f32, f32)> {
        let &Table { edge, toe, top, ref values } = &*self.table;
        let values = values.as_flattened().to_vec();
        let array = Array4::from_shape_vec((edge, edge, edge, 3), values);
        let array = array.map_err(|error| SizeError::new_err(error.to_string()))?.into_pyarray(py);
        Ok((array, toe, top))
    }

    fn __repr__(&self) -> String {
        let (Table { edge, toe, top, .. }, digest) = (&*self.table, self.curve.digest());
        format!("<ToneTable {} of edge {edge}, toe {toe}, top {top}>", &digest[..8])
    }
}

/// Lut(path, input="linear") --
///
/// How a picture is shown, as a .cube file: a 1D LUT, a 3D LUT, or a 1D one before a 3D one. What it returns is taken for
/// sRGB-encoded display values. The verdicts are those of `--tone-mapping lut:FILE`.
///
/// path: of the file. input: how radiance is encoded before it: "linear", "srgb", "acescct", or "log2:LOW,HIGH" for stops
///     from middle grey (0.18) that become 0 and 1. Files are kept until the program ends, each once.
///
/// Raises OSError if the file cannot be read, PictureError if it is broken, ParameterError for another input.
#[pyclass(frozen, eq, name = "Lut", module = "noisefloor", from_py_object)]
#[derive(Clone)]
pub(crate) struct PyLut {
    pub(crate) curve: ToneCurve,
    file: Arc<LutText>,
}

impl PartialEq for PyLut {
    fn eq(&self, other: &Self) -> bool {
        self.curve == other.curve
    }
}

impl PyLut {
    fn of(text: Vec<u8>, input: &str) -> PyResult<Self> {
        let input: LutInput =
            input.parse().map_err(|error: LutInputError| ParameterError::new_err(error.to_string()))?;
        let lut = parse_cube(&text).map_err(|error| PictureError::new_err(error.to_string()))?;
        let (curve, file) = (lut.into_tone_curve(input), Arc::new(LutText { text, input }));
        keep(&curve, Origin::Lut(Arc::clone(&file)));
        Ok(Self { curve, file })
    }
}

#[pymethods]
impl PyLut {
    #[new]
    #[pyo3(signature = (path, input = "linear"))]
    fn new(path: PathBuf, input: &str) -> PyResult<Self> {
        // Checked as a file is, for its length among others
        read_cube(&path).map_err(Raise::raise)?;
        Self::of(std::fs::read(&path).map_err(|error| file_error(&path, &error))?, input)
    }

    #[classmethod]
    fn _restore(_class: &Bound<'_, PyType>, text: Vec<u8>, input: &str) -> PyResult<Self> {
        Self::of(text, input)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        reduced::<Self>(py, (PyBytes::new(py, &self.file.text), self.file.input.to_string()))
    }

    fn __repr__(&self) -> String {
        format!("<Lut {} of {} light>", &self.curve.digest()[..8], self.file.input)
    }
}
