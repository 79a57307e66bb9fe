//! Between numpy arrays and slices of pixels.

use crate::errors::{ParameterError, PictureError, SizeError};
use noisefloor::{Rgb, display::srgb_decode};
use numpy::ndarray::{Array2, Array3, Axis};
use numpy::{IntoPyArray, PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray3};
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use std::borrow::Cow;
use std::thread;

/// Linear radiance: an array of floats of shape (height, width, 3), or whatever numpy makes one of.
pub(crate) struct Pixels<'py>(PyReadonlyArray3<'py, f32>);

impl<'py> FromPyObject<'_, 'py> for Pixels<'py> {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        let array = array(object)?;
        let (kind, name) = dtype(&array)?;
        if kind != 'f' {
            // bfloat16 and the like of ml_dtypes are void to numpy
            let instead = match kind {
                'V' => "are no floats of numpy: pass array.astype(\"float32\")",
                _ => {
                    "are no radiance: pass linear floats, or to judge() and metrics() also encoding=\"srgb\""
                }
            };
            return Err(PictureError::new_err(format!("pixels of dtype {name} {instead}")));
        }
        Ok(Self(floats(&array)?))
    }
}

impl Pixels<'_> {
    /// (width, height), and the pixels row-major; where they lie, if float32 and C-contiguous.
    pub(crate) fn get(&self) -> (usize, usize, Cow<'_, [Rgb]>) {
        let (width, height) = self.size();
        // That of ndarray: the one of numpy also takes arrays in Fortran order, as they lie
        let pixels = match self.0.as_array().to_slice() {
            Some(values) => Cow::Borrowed(values.as_chunks().0),
            None => Cow::Owned(self.copied()),
        };
        (width, height, pixels)
    }

    /// (width, height).
    pub(crate) fn size(&self) -> (usize, usize) {
        let (height, width, _) = self.0.as_array().dim();
        (width, height)
    }

    /// A copy, row-major. The interpreter's lock is kept, so that nobody changes the pixels meanwhile; threads of rayon's pool
    /// may wait for it, and are not used.
    pub(crate) fn copied(&self) -> Vec<Rgb> {
        let view = self.0.as_array();
        let (height, width, _) = view.dim();
        let mut pixels = vec![[0.0; 3]; width * height];
        if pixels.is_empty() {
            return pixels;
        }
        let threads =
            thread::available_parallelism().map_or(1, usize::from).min(pixels.len().div_ceil(AT_ONCE));
        let rows = height.div_ceil(threads);
        let copy = |(n, part): (usize, &mut [Rgb])| {
            for (y, row) in part.chunks_exact_mut(width).enumerate() {
                let from = view.index_axis(Axis(0), n * rows + y);
                for (pixel, from) in row.iter_mut().zip(from.outer_iter()) {
                    *pixel = [from[0], from[1], from[2]];
                }
            }
        };
        let mut parts = pixels.chunks_mut(rows * width).enumerate();
        let first = parts.next();
        thread::scope(|scope| {
            parts.for_each(|part| drop(scope.spawn(|| copy(part))));
            first.map(copy);
        });
        pixels
    }
}

/// Pixels that are worth a thread.
const AT_ONCE: usize = 1 << 18;

/// What the values of a picture are.
#[derive(Clone, Copy)]
pub(crate) enum Encoding {
    Linear,
    Srgb,
}

impl Encoding {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Linear => "linear",
            Self::Srgb => "srgb",
        }
    }

    fn named(name: &str) -> PyResult<Self> {
        let known = [Self::Linear, Self::Srgb].into_iter().find(|encoding| encoding.name() == name);
        known.ok_or_else(|| {
            ParameterError::new_err(format!("{name:?} is no encoding: use \"linear\" or \"srgb\""))
        })
    }
}

/// A copy of a finished picture, which nobody changes while the interpreter is released.
pub(crate) struct Picture {
    /// (width, height).
    pub(crate) size: (usize, usize),
    /// Linear radiance, row-major.
    pub(crate) pixels: Vec<Rgb>,
    /// Whether it is what a screen shows: no tone mapping then.
    pub(crate) display_referred: bool,
    /// Variance of the rounding of display values: step²/12.
    pub(crate) rounding: f32,
}

impl Picture {
    /// `encoding` is "linear" for floats, or "srgb" for floats from 0 to 1 and for 8 or 16 unsigned bits.
    pub(crate) fn new(object: &Bound<'_, PyAny>, encoding: &str) -> PyResult<Self> {
        match Encoding::named(encoding)? {
            Encoding::Linear => Ok(Self::of(&object.extract()?, 0.0, |value| value)),
            Encoding::Srgb => Self::of_display(object),
        }
    }

    fn of_display(object: &Bound<'_, PyAny>) -> PyResult<Self> {
        let array = array(object.as_borrowed())?;
        let (white, step) = match dtype(&array)? {
            ('f', _) => (1.0, 0.0),
            ('u', name) if name == "uint8" => (255.0, 1.0 / 255.0),
            ('u', name) if name == "uint16" => (65535.0, 1.0 / 65535.0),
            (_, name) => {
                return Err(PictureError::new_err(format!(
                    "pixels of dtype {name} are not sRGB: pass uint8, uint16, or floats from 0 to 1"
                )));
            }
        };
        let pixels = Pixels(floats(&array)?);
        if let Some(value) =
            pixels.get().2.as_flattened().iter().find(|value| !(0.0..=white).contains(*value))
        {
            return Err(PictureError::new_err(format!(
                "{value} is not sRGB, which lies within 0 and {white}"
            )));
        }
        let rounding = step * step / 12.0;
        Ok(Self { display_referred: true, ..Self::of(&pixels, rounding, |value| srgb_decode(value / white)) })
    }

    fn of(pixels: &Pixels<'_>, rounding: f32, decode: impl Fn(f32) -> f32) -> Self {
        let (width, height, pixels) = pixels.get();
        let pixels = pixels.iter().map(|pixel| pixel.map(&decode)).collect();
        Self { size: (width, height), pixels, display_referred: false, rounding }
    }
}

/// DLPack's numbers of devices whose memory the processor reads: its own, and what is pinned for CUDA, ROCm or SYCL.
const READABLE: [i64; 3] = [1, 3, 11];

/// An array of numpy from a framework for GPUs, in memory that the processor reads: where it lies, or copied once by
/// the framework itself. `None` if the object is no such array, or one that numpy reads by itself.
///
/// What lies on a GPU is copied by the method that its framework has for that: `get` (CuPy) or `cpu` (PyTorch), and else
/// by what newer ones understand of DLPack, a request for another device. Dr.Jit and JAX convert when numpy asks.
fn from_device<'py>(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Option<Bound<'py, PyAny>>> {
    let (py, numpy) = (object.py(), object.py().import("numpy")?);
    if object.is_instance(&numpy.getattr("ndarray")?)? {
        return Ok(None);
    }
    let device = match object.hasattr("__dlpack_device__")? {
        true => Some(object.call_method0("__dlpack_device__")?.extract::<(i64, i64)>()?.0),
        false => None,
    };
    match device {
        Some(device) if READABLE.contains(&device) => {
            // Of a kind that DLPack cannot say, such as one with gradients, numpy may know more
            let array = numpy.call_method1("from_dlpack", (object,));
            return array.map(Some).or_else(|error| {
                if error.is_instance_of::<PyException>(py) { Ok(None) } else { Err(error) }
            });
        }
        None if !object.hasattr("__cuda_array_interface__")? => return Ok(None),
        _ => {}
    }
    for method in ["get", "cpu"] {
        if object.hasattr(method)? {
            return Ok(Some(numpy.call_method1("asarray", (object.call_method0(method)?,))?));
        }
    }
    if object.hasattr("__array__")? {
        return Ok(None);
    }
    let options = pyo3::types::PyDict::new(py);
    options.set_item("device", "cpu")?;
    Ok(Some(numpy.call_method("from_dlpack", (object,), Some(&options))?))
}

/// Refuses arrays with masked elements. What is under a mask is anything, and `asarray` would take it for a value.
pub(crate) fn refuse_masked(object: Borrowed<'_, '_, PyAny>) -> PyResult<()> {
    match object.py().import("numpy.ma")?.call_method1("is_masked", (object,))?.is_truthy()? {
        true => {
            let message = "some elements are masked: replace them first, with array.filled(value)";
            Err(PictureError::new_err(message))
        }
        false => Ok(()),
    }
}

/// An array of shape (height, width, 3) of any type.
fn array<'py>(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let py = object.py();
    refuse_masked(object)?;
    let array = match from_device(object) {
        Ok(Some(array)) => Ok(array),
        Ok(None) => py.import("numpy")?.call_method1("asarray", (object,)),
        Err(error) => Err(error),
    };
    // What is no `Exception`, such as Ctrl-C, says nothing of the array
    let array = array.map_err(|error| match error.is_instance_of::<PyException>(py) {
        true => SizeError::new_err(format!("no array of pixels: {error}")),
        false => error,
    })?;
    let shape = array.getattr("shape")?;
    match shape.extract::<Vec<usize>>()?[..] {
        [_, _, 3] => Ok(array),
        _ => Err(SizeError::new_err(format!("pixels have shape {shape}; (height, width, 3) is needed"))),
    }
}

/// What numpy calls the kind of the elements, and their name.
pub(crate) fn dtype(array: &Bound<'_, PyAny>) -> PyResult<(char, String)> {
    let dtype = array.getattr("dtype")?;
    Ok((dtype.getattr("kind")?.extract()?, dtype.getattr("name")?.extract()?))
}

fn floats<'py>(array: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArray3<'py, f32>> {
    let options = pyo3::types::PyDict::new(array.py());
    options.set_item("copy", false)?;
    let floats = array.call_method("astype", ("float32",), Some(&options))?;
    Ok(floats.cast_into::<PyArray3<f32>>().map_err(PyErr::from)?.readonly())
}

/// A new array of shape (height, width, 3), made of pixels without copying them.
pub(crate) fn picture<'py>(
    py: Python<'py>,
    size: (usize, usize),
    pixels: Vec<Rgb>,
) -> PyResult<Bound<'py, PyArray3<f32>>> {
    array3(py, size, pixels.into_flattened())
}

/// The same of single values.
pub(crate) fn array3<'py, T: numpy::Element>(
    py: Python<'py>,
    (width, height): (usize, usize),
    values: Vec<T>,
) -> PyResult<Bound<'py, PyArray3<T>>> {
    let shaped = Array3::from_shape_vec((height, width, 3), values);
    Ok(shaped.map_err(|error| SizeError::new_err(error.to_string()))?.into_pyarray(py))
}

/// A new array of shape (height, width).
pub(crate) fn plane<'py, T: numpy::Element>(
    py: Python<'py>,
    (width, height): (usize, usize),
    values: Vec<T>,
) -> PyResult<Bound<'py, PyArray2<T>>> {
    let shaped = Array2::from_shape_vec((height, width), values);
    Ok(shaped.map_err(|error| SizeError::new_err(error.to_string()))?.into_pyarray(py))
}
