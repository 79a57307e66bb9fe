//! Finished pictures.

use crate::arrays::{Picture, plane};
use crate::errors::{ParameterError, PictureError, Raise};
use crate::oracle::PyOracle;
use crate::params::PyParams;
use crate::pickle::reduced;
use crate::pool;
use crate::verdicts::PyVerdict;
use noisefloor::{
    Oracle, Params, TileGrid,
    evidence::{Evidence, Samples},
    stills::{SnapshotPair, Still},
};
use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyType;

/// What judge() found out about a picture.
#[pyclass(frozen, name = "Judged", module = "noisefloor")]
pub(crate) struct PyJudged {
    size: (usize, usize),
    verdicts: Vec<PyVerdict>,
    samples: Samples,
    warnings: Vec<String>,
    visible_noise: Option<Vec<f32>>,
}

#[pymethods]
impl PyJudged {
    /// A list of Verdict, one for each tile.
    #[getter]
    fn verdicts(&self) -> Vec<PyVerdict> {
        self.verdicts.clone()
    }

    /// "independent" or "nested": how the pictures share samples, as said or recognised.
    #[getter]
    fn samples(&self) -> &'static str {
        match self.samples {
            Samples::Independent => "independent",
            Samples::Nested => "nested",
        }
    }

    /// What is likely wrong with the two pictures, a list of texts: their noise is filtered, or one has another
    /// exposure.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.warnings.clone()
    }

    /// How visible the noise is, 1 where it is just seen: float32 of shape (height, width); None if
    /// the model makes no map.
    fn visible_noise<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f32>>>> {
        self.visible_noise.clone().map(|map| plane(py, self.size, map)).transpose()
    }

    #[classmethod]
    fn _restore(
        _class: &Bound<'_, PyType>,
        size: (usize, usize),
        verdicts: Vec<PyVerdict>,
        samples: &str,
        warnings: Vec<String>,
        visible_noise: Option<PyReadonlyArray2<'_, f32>>,
    ) -> PyResult<Self> {
        let visible_noise = visible_noise.map(|map| map.as_array().iter().copied().collect());
        Ok(Self { size, verdicts, samples: sharing(samples)?, warnings, visible_noise })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let kept = (self.size, self.verdicts(), self.samples(), self.warnings(), self.visible_noise(py)?);
        reduced::<Self>(py, kept)
    }
}

/// Judges a picture by another rendering of the same view: a Judged with a verdict for each tile.
///
/// image: array of shape (height, width, 3), all finite. encoding: "linear" for radiance in floats, "srgb" for what
///     screens show: uint8, uint16, or floats from 0 to 1; tone mapping is left out then. spp: its samples per pixel, above
/// 0. against: another rendering, of the same shape; against_spp: its samples per pixel. samples:
/// "independent" (different seeds), "nested" (two stages of one rendering), or None: recognised from the
///     pictures, where they show it.
/// oracle: an Oracle; None is Oracle(). params: tile size, display and audience; None is Params().
///
/// Look at the warnings of what it returns: pictures that were denoised, or exposed otherwise, are judged wrongly.
/// The interpreter's lock is released while judging.
///
/// Raises SizeError, ParameterError, CriterionError, and PictureError if the pictures cannot be judged.
#[pyfunction]
#[pyo3(signature = (image, spp, against, against_spp, *, samples = None, oracle = None, params = None,
    encoding = "linear"))]
#[expect(clippy::too_many_arguments, reason = "Python names them")]
pub(crate) fn judge(
    py: Python<'_>,
    image: &Bound<'_, PyAny>,
    spp: f64,
    against: &Bound<'_, PyAny>,
    against_spp: f64,
    samples: Option<&str>,
    oracle: Option<PyRef<'_, PyOracle>>,
    params: Option<PyParams>,
    encoding: &str,
) -> PyResult<PyJudged> {
    let samples = samples.map(sharing).transpose()?;
    let oracle = oracle.map_or_else(Oracle::bundled, |oracle| oracle.0.clone());
    let params = params.map_or_else(Params::default, |params| params.0);
    let still = |array, spp, what| still(Picture::new(array, encoding)?, spp, what);
    let (image, other) = (still(image, spp, "image")?, still(against, against_spp, "against")?);
    py.detach(|| pool::run(|| judge_still(&oracle, &params, &image, &other, samples)))
}

fn sharing(name: &str) -> PyResult<Samples> {
    match name {
        "independent" => Ok(Samples::Independent),
        "nested" => Ok(Samples::Nested),
        other => {
            Err(ParameterError::new_err(format!("samples are \"independent\" or \"nested\", not {other:?}")))
        }
    }
}

fn still(picture: Picture, spp: f64, what: &str) -> PyResult<Still> {
    let Picture { size, pixels, display_referred, rounding } = picture;
    let still = Still::new(size, pixels, spp);
    let still = if display_referred { still.displayed_as_it_is(rounding) } else { still };
    still.check().map_err(|error| PictureError::new_err(format!("{what}: {error}")))?;
    Ok(still)
}

fn judge_still(
    oracle: &Oracle,
    params: &Params,
    image: &Still,
    other: &Still,
    samples: Option<Samples>,
) -> PyResult<PyJudged> {
    let evidence = oracle.model().evidence();
    let pair = SnapshotPair::new(evidence, image, &[other], params.tone_mapping.clone(), samples);
    let pair = pair.map_err(Raise::raise)?.seen_on(params.viewing);
    let grid = TileGrid::new(image.size.0, image.size.1, params.tile).map_err(Raise::raise)?;
    let noticed = pair.notice(grid).map_err(Raise::raise)?;
    let judged = pair.judge(oracle, grid, params.audience).map_err(Raise::raise)?;
    let visible_noise = match evidence {
        Evidence::Halves => judged.visible_noise(oracle),
        _ => None,
    };
    Ok(PyJudged {
        size: image.size,
        verdicts: grid
            .tiles()
            .zip(judged.verdicts())
            .zip(noticed.unlike)
            .map(|((tile, verdict), unlike)| {
                PyVerdict::of(tile, if unlike { noisefloor::Verdict::default() } else { *verdict })
            })
            .collect(),
        samples: pair.samples(),
        warnings: noticed.warnings.iter().map(ToString::to_string).collect(),
        visible_noise,
    })
}
