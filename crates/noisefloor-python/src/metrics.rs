//! Metrics of a picture against a reference.

use crate::arrays::{Picture, plane};
use crate::errors::{Raise, SizeError};
use crate::params::{ToneLike, ViewingLike, tone_mapping};
use crate::pickle::reduced;
use crate::pool;
use noisefloor::{ToneMapping, Viewing, display::Display};
use noisefloor_rivals::{
    DifferenceMap,
    metrics::{MetricPair, MetricScores},
};
use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyType;

/// How far a picture is from a reference.
#[pyclass(frozen, name = "Metrics", module = "noisefloor")]
pub(crate) struct PyMetrics {
    scores: MetricScores,
    /// JODs lost.
    cvvdp: DifferenceMap,
    flip: Option<DifferenceMap>,
}

#[pymethods]
impl PyMetrics {
    /// ColorVideoVDP in JOD: 10 is no visible difference; at 9, three of four people prefer the reference.
    #[getter]
    fn cvvdp_jod(&self) -> f64 {
        self.scores.cvvdp_jod
    }

    /// Peak signal-to-noise ratio of display values in dB; infinite for equal pictures.
    #[getter]
    fn psnr(&self) -> f64 {
        self.scores.psnr
    }

    /// Mean of (x - r)² / (r² + 0.01) of linear radiance.
    #[getter]
    fn rel_mse(&self) -> f64 {
        self.scores.rel_mse
    }

    /// Mean of FLIP in 0 to 1; None if the module was built without the feature "flip".
    #[getter]
    fn flip(&self) -> Option<f64> {
        self.scores.flip
    }

    /// Largest value of butteraugli; None if the module was built without the feature "butteraugli".
    #[getter]
    fn butteraugli(&self) -> Option<f64> {
        self.scores.butteraugli
    }

    /// The JODs that ColorVideoVDP takes off at each pixel: float32 of shape (height, width).
    fn cvvdp_map<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        map(py, &self.cvvdp)
    }

    /// FLIP of each pixel, 0 to 1: float32 of shape (height, width); None without the feature "flip".
    fn flip_map<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f32>>>> {
        self.flip.as_ref().map(|flip| map(py, flip)).transpose()
    }

    #[classmethod]
    fn _restore(
        _class: &Bound<'_, PyType>,
        scores: (f64, Option<f64>, Option<f64>, Option<f64>, f64, f64),
        cvvdp: PyReadonlyArray2<'_, f32>,
        flip: Option<PyReadonlyArray2<'_, f32>>,
    ) -> Self {
        let (cvvdp_jod, flip_mean, butteraugli, butteraugli_norm3, psnr, rel_mse) = scores;
        let scores =
            MetricScores { cvvdp_jod, flip: flip_mean, butteraugli, butteraugli_norm3, psnr, rel_mse };
        Self { scores, cvvdp: restored(&cvvdp), flip: flip.as_ref().map(restored) }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let MetricScores { cvvdp_jod, flip, butteraugli, butteraugli_norm3, psnr, rel_mse } = self.scores;
        let scores = (cvvdp_jod, flip, butteraugli, butteraugli_norm3, psnr, rel_mse);
        reduced::<Self>(py, (scores, self.cvvdp_map(py)?, self.flip_map(py)?))
    }

    fn __repr__(&self) -> String {
        let MetricScores { cvvdp_jod, psnr, rel_mse, .. } = self.scores;
        format!("<noisefloor.Metrics: {cvvdp_jod:.3} JOD, {psnr:.2} dB, relMSE {rel_mse:.3e}>")
    }
}

fn map<'py>(py: Python<'py>, map: &DifferenceMap) -> PyResult<Bound<'py, PyArray2<f32>>> {
    plane(py, (map.width, map.height), map.values.clone())
}

fn restored(map: &PyReadonlyArray2<'_, f32>) -> DifferenceMap {
    let (map, (height, width)) = (map.as_array(), map.as_array().dim());
    DifferenceMap { width, height, values: map.iter().copied().collect() }
}

/// Compares a picture with a reference, both of shape (height, width, 3): a Metrics.
///
/// encoding: "linear" for radiance in floats, "srgb" for what screens show: uint8, uint16, or floats from 0 to 1.
///
/// Both are shown through one tone mapping ("reinhard" or "srgb"), settled for the reference; see Params.
/// viewing is a Viewing or its text, for ColorVideoVDP; None is "desk". The interpreter's lock is released
/// meanwhile.
///
/// Raises SizeError, ParameterError, and PictureError if a value is not finite or the pictures are too small.
#[pyfunction]
#[pyo3(signature = (image, reference, *, tone_mapping = None, key = 0.18, white = None, exposure = None,
    viewing = None, encoding = "linear"))]
#[expect(clippy::too_many_arguments, reason = "Python names them")]
pub(crate) fn metrics(
    py: Python<'_>,
    image: &Bound<'_, PyAny>,
    reference: &Bound<'_, PyAny>,
    tone_mapping: Option<ToneLike>,
    key: f32,
    white: Option<f32>,
    exposure: Option<f32>,
    viewing: Option<ViewingLike>,
    encoding: &str,
) -> PyResult<PyMetrics> {
    let tone = self::tone_mapping(tone_mapping, key, white, exposure)?;
    let viewing = ViewingLike::checked(viewing)?;
    let (image, reference) = (Picture::new(image, encoding)?, Picture::new(reference, encoding)?);
    if image.size != reference.size {
        let [(w, h), (rw, rh)] = [image.size, reference.size];
        return Err(SizeError::new_err(format!(
            "image has shape ({h}, {w}, 3), and reference ({rh}, {rw}, 3)"
        )));
    }
    py.detach(|| pool::run(|| measure(&image, &reference, tone, &viewing)))
}

fn measure(
    image: &Picture,
    reference: &Picture,
    tone: ToneMapping,
    viewing: &Viewing,
) -> PyResult<PyMetrics> {
    let shown = if reference.display_referred { Display::SRGB } else { tone.settle(&reference.pixels) };
    let (image, reference, size) = (&image.pixels, &reference.pixels, image.size);
    let pair = MetricPair { size, image, reference, display: &shown, viewing };
    let (scores, maps) = pair.measure().map_err(Raise::raise)?;
    Ok(PyMetrics { scores, cvvdp: maps.cvvdp, flip: maps.flip })
}
