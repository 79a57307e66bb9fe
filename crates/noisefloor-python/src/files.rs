//! Pictures on disk.

use crate::arrays::{Encoding, Picture, array3, picture};
use crate::errors::{ParameterError, Raise};
use noisefloor::{Rgb, display::srgb_encode};
use noisefloor_image::{
    DisplayImage, LinearImage, ReadOptions, RenderLayers, read_picture_with, write_exr, write_png,
};
use pyo3::prelude::*;
use std::path::{Path, PathBuf};

/// Reads an EXR, PFM or PNG file: (pixels, encoding), as judge() and metrics() take them.
///
/// pixels have shape (height, width, 3): of EXR and PFM float32, linear radiance as it is in the file, and
/// encoding is "linear"; of PNG uint8 or uint16, and encoding is "srgb". The content tells the format. Alpha
/// and further layers are left out: layer names the one of an EXR that is read, as "ViewLayer.Combined" or the end of
/// it; by default the unnamed one, or one named as renderers name the picture. Pictures of more than 2**28 pixels are refused before memory is taken.
///
/// Raises OSError if the file cannot be read, PictureError if it is broken, too large, or something else.
#[pyfunction]
#[pyo3(signature = (path, *, layer = None))]
pub(crate) fn read(
    py: Python<'_>,
    path: PathBuf,
    layer: Option<String>,
) -> PyResult<(Bound<'_, PyAny>, &'static str)> {
    let options = ReadOptions { layer, ..ReadOptions::default() };
    match py.detach(|| read_picture_with(&path, &options)).map_err(Raise::raise)? {
        noisefloor_image::Picture::Linear(LinearImage { width, height, pixels }) => {
            Ok((picture(py, (width, height), pixels)?.into_any(), Encoding::Linear.name()))
        }
        noisefloor_image::Picture::Display(DisplayImage { width, height, pixels, step }) => {
            let codes = pixels.into_flattened().into_iter().map(|value| (value / step).round());
            // A step is 1/255 or 1/65535, and what is read lies within 0 and 1
            let array = if step > 1.0 / 256.0 {
                array3(py, (width, height), codes.map(|code| code as u8).collect())?.into_any()
            } else {
                array3(py, (width, height), codes.map(|code| code as u16).collect())?.into_any()
            };
            Ok((array, Encoding::Srgb.name()))
        }
    }
}

/// Writes a picture as EXR (32-bit floats, linear) or PNG (8 bits, sRGB), by the ending of its name.
///
/// image: array of shape (height, width, 3). encoding: what it holds, "linear" or "srgb" as in judge(); it is
///     converted to what the file has. A PNG ends at white: apply a tone mapping of your own before.
///
/// The file is complete or not there.
///
/// Raises OSError if it cannot be written, ParameterError for another ending, SizeError or PictureError if
/// image is no picture.
#[pyfunction]
#[pyo3(signature = (path, image, *, encoding = "linear"))]
pub(crate) fn write(py: Python<'_>, path: PathBuf, image: &Bound<'_, PyAny>, encoding: &str) -> PyResult<()> {
    let Picture { size: (width, height), pixels, .. } = Picture::new(image, encoding)?;
    let ending = path.extension().map(|ending| ending.to_ascii_lowercase());
    match ending.as_ref().and_then(|ending| ending.to_str()) {
        Some("exr") => py.detach(|| write_exr(&path, &RenderLayers::rgb(width, height, &pixels))),
        Some("png") => py.detach(|| write_png(&path, width, height, &codes(&pixels))),
        _ => return Err(unknown(&path)),
    }
    .map_err(Raise::raise)
}

/// 8-bit codes of sRGB. NaN is black.
fn codes(pixels: &[Rgb]) -> Vec<u8> {
    pixels.as_flattened().iter().map(|&linear| (srgb_encode(linear) * 255.0).round() as u8).collect()
}

fn unknown(path: &Path) -> PyErr {
    ParameterError::new_err(format!("{}: name the file .exr or .png", path.display()))
}
