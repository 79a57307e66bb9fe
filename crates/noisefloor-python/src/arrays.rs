//! Between numpy arrays and slices of pixels.

use crate::errors::SizeError;
use noisefloor::Rgb;
use numpy::ndarray::{Array2, Array3};
use numpy::{AllowTypeChange, IntoPyArray, PyArray2, PyArray3, PyArrayLike3};
use pyo3::prelude::*;
use std::borrow::Cow;

/// An array of shape (height, width, 3), or whatever numpy makes one of.
pub(crate) type Pixels<'py> = PyArrayLike3<'py, f32, AllowTypeChange>;

/// The pixels of an array, row-major; where they lie, if float32 and C-contiguous.
pub(crate) fn pixels<'a>(array: &'a Pixels<'_>, what: &str) -> PyResult<(usize, usize, Cow<'a, [Rgb]>)> {
    let view = array.as_array();
    let (height, width, channels) = view.dim();
    if channels != 3 {
        let message =
            format!("{what} has shape ({height}, {width}, {channels}); (height, width, 3) is needed");
        return Err(SizeError::new_err(message));
    }
    let pixels = match array.as_slice() {
        Ok(values) => Cow::Borrowed(values.as_chunks().0),
        Err(_) => Cow::Owned(view.iter().copied().collect::<Vec<f32>>().as_chunks().0.to_vec()),
    };
    Ok((width, height, pixels))
}

/// A new array of shape (height, width, 3), made of pixels without copying them.
pub(crate) fn picture<'py>(
    py: Python<'py>,
    (width, height): (usize, usize),
    pixels: Vec<Rgb>,
) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let shaped = Array3::from_shape_vec((height, width, 3), pixels.into_flattened());
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
