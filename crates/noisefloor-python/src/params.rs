//! Parameters, unchecked until a session or a picture uses them, and viewing conditions.

use crate::errors::{ParameterError, Raise, whole};
use crate::tone::{PyLut, PyToneTable, made};
use noisefloor::{Audience, Params, Schedule, ToneMapping, Viewing};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

/// Viewing(conditions="desk") --
///
/// A display, the light in the room, how far away the display is, and whether it shows a still or a film.
///
/// conditions is a preset ("desk", "laptop", "tv", "phone", "cinema", or a display of ColorVideoVDP such as
/// "standard_4k"), numbers ("ppd=60,peak=300,black=0.3,ambient=100": pixels per degree, cd/m², cd/m², lux),
/// or a preset with changes ("desk,distance=1.2": metres). "desk,fps=24" is for a frame of a film whose noise is
/// new in every frame.
///
/// Raises ParameterError if there are no such conditions, or a number is out of range.
#[pyclass(frozen, eq, name = "Viewing", module = "noisefloor", from_py_object)]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct PyViewing(pub(crate) Viewing);

#[pymethods]
impl PyViewing {
    #[new]
    #[pyo3(signature = (conditions = "desk"))]
    fn new(conditions: &str) -> PyResult<Self> {
        conditions.parse().map(Self).map_err(Raise::raise)
    }

    /// Pixels per degree of visual angle in the centre of the picture.
    #[getter]
    fn pixels_per_degree(&self) -> f64 {
        self.0.pixels_per_degree()
    }

    /// Luminance of white in cd/m².
    #[getter]
    fn peak(&self) -> f64 {
        self.0.params().peak
    }

    /// Luminance of black in a dark room in cd/m².
    #[getter]
    fn black(&self) -> f64 {
        self.0.params().black
    }

    /// Light of the room that falls on the display, in lux.
    #[getter]
    fn ambient(&self) -> f64 {
        self.0.params().ambient
    }

    /// Frames per second of a film whose noise is new in every frame; None for a still.
    #[getter]
    fn frames_per_second(&self) -> Option<f64> {
        self.0.frames_per_second()
    }

    fn __getnewargs__(&self) -> (String,) {
        (self.0.to_string(),)
    }

    fn __str__(&self) -> String {
        self.0.to_string()
    }

    fn __repr__(&self) -> String {
        format!("Viewing({:?})", self.0.to_string())
    }
}

/// When tiles are judged, how the picture is displayed, and the limits that end tiles.
///
/// tile: edge of a tile in pixels, 16 to 512; tiles of the last column and row have half to one and a half
///     times as many.
/// tone_mapping: "reinhard" (None as well; with white, and exposure by key and the log-average of the picture), "srgb", or
///     a ToneTable or a Lut.
/// exposure: a factor on radiance; 1 for "srgb" and tables by default. With "reinhard", frames of a film should have one.
/// viewing: on which display the picture is seen, and from how far; a Viewing or its text.
/// schedule: "spaced" by the expected need, "growing" by half of what a tile has (both in multiples of step),
///     or "every" step samples per pixel.
/// min_spp, max_spp: fewest and most samples per pixel of a tile.
/// consecutive: verdicts in a row that must say "converged".
/// audience: (slope, offset) of the line from thresholds of the training data to those of your viewers;
///     None is (1, 0).
///
/// Raises ParameterError if a value is out of range.
#[pyclass(frozen, eq, name = "Params", module = "noisefloor", from_py_object)]
#[derive(Clone, PartialEq)]
pub(crate) struct PyParams(pub(crate) Params);

/// A Viewing, or its text.
#[derive(FromPyObject)]
pub(crate) enum ViewingLike {
    Made(PyViewing),
    Text(String),
}

impl ViewingLike {
    /// The conditions; the default without any.
    pub(crate) fn checked(this: Option<Self>) -> PyResult<Viewing> {
        match this {
            None => Ok(Viewing::default()),
            Some(Self::Made(viewing)) => Ok(viewing.0),
            Some(Self::Text(text)) => {
                text.parse().map_err(|error: noisefloor::viewing::ViewingTextError| error.raise())
            }
        }
    }
}

/// "reinhard", "srgb", a table, or a file of one.
#[derive(FromPyObject)]
pub(crate) enum ToneLike {
    Table(PyToneTable),
    Lut(PyLut),
    Name(String),
}

/// Tone mapping by its name, or a table; by the first without any.
pub(crate) fn tone_mapping(
    tone: Option<ToneLike>,
    key: f32,
    white: Option<f32>,
    exposure: Option<f32>,
) -> PyResult<ToneMapping> {
    let reinhard = match exposure {
        None => ToneMapping::Reinhard { key, white },
        Some(exposure) => ToneMapping::ReinhardAt { exposure, white },
    };
    let exposure = exposure.unwrap_or(1.0);
    let tone = match tone {
        None => reinhard,
        Some(ToneLike::Table(table)) => ToneMapping::Custom { exposure, curve: table.curve },
        Some(ToneLike::Lut(lut)) => ToneMapping::Custom { exposure, curve: lut.curve },
        Some(ToneLike::Name(name)) if name == "reinhard" => reinhard,
        Some(ToneLike::Name(name)) if name == "srgb" => ToneMapping::Srgb { exposure },
        Some(ToneLike::Name(name)) => {
            return Err(ParameterError::new_err(format!(
                "{name:?} is no tone mapping: use \"reinhard\", \"srgb\", a ToneTable or a Lut"
            )));
        }
    };
    tone.check().map_err(|error| ParameterError::new_err(error.to_string()))?;
    Ok(tone)
}

#[pymethods]
impl PyParams {
    #[new]
    #[pyo3(signature = (*, tile = 128, tone_mapping = None, key = 0.18, white = None, exposure = None,
        viewing = None, schedule = "spaced", step = 8, min_spp = 16, max_spp = 10_000, consecutive = 1,
        audience = None))]
    #[expect(clippy::too_many_arguments, reason = "Python names them")]
    fn new(
        #[pyo3(from_py_with = whole)] tile: usize,
        tone_mapping: Option<ToneLike>,
        key: f32,
        white: Option<f32>,
        exposure: Option<f32>,
        viewing: Option<ViewingLike>,
        schedule: &str,
        #[pyo3(from_py_with = whole)] step: u64,
        #[pyo3(from_py_with = whole)] min_spp: u64,
        #[pyo3(from_py_with = whole)] max_spp: u64,
        #[pyo3(from_py_with = whole)] consecutive: u32,
        audience: Option<(f64, f64)>,
    ) -> PyResult<Self> {
        let schedule = match schedule {
            "every" => Schedule::Every { step },
            "spaced" => Schedule::Spaced { step },
            "growing" => Schedule::Growing { step },
            other => {
                let message = format!("{other:?} is no schedule: use \"every\", \"spaced\" or \"growing\"");
                return Err(ParameterError::new_err(message));
            }
        };
        let params = Params::default()
            .with_tile(tile)
            .with_tone_mapping(self::tone_mapping(tone_mapping, key, white, exposure)?)
            .with_viewing(ViewingLike::checked(viewing)?)
            .with_schedule(schedule)
            .with_min_spp(min_spp)
            .with_max_spp(max_spp)
            .with_consecutive(consecutive)
            .with_audience(audience.map_or(Audience::TRAINED, |(slope, offset)| Audience { slope, offset }));
        params.check().map_err(Raise::raise)?;
        Ok(Self(params))
    }

    /// Edge of a tile in pixels.
    #[getter]
    fn tile(&self) -> usize {
        self.0.tile
    }

    /// On which display the picture is seen, and from how far.
    #[getter]
    fn viewing(&self) -> PyViewing {
        PyViewing(self.0.viewing)
    }

    /// Fewest samples per pixel at which a tile may stop.
    #[getter]
    fn min_spp(&self) -> u64 {
        self.0.min_spp
    }

    /// Samples per pixel at which every tile stops.
    #[getter]
    fn max_spp(&self) -> u64 {
        self.0.max_spp
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyTuple>, Bound<'py, PyDict>)> {
        Ok((PyTuple::empty(py), self.arguments(py)?))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let arguments = self.arguments(py)?.into_iter();
        let arguments = arguments.map(|(name, value)| Ok(format!("{name}={}", value.repr()?)));
        Ok(format!("Params({})", arguments.collect::<PyResult<Vec<_>>>()?.join(", ")))
    }
}

impl PyParams {
    /// What Python makes the same parameters from.
    fn arguments<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let params = &self.0;
        let arguments = PyDict::new(py);
        arguments.set_item("tile", params.tile)?;
        match &params.tone_mapping {
            ToneMapping::Reinhard { key, white } => {
                arguments.set_item("tone_mapping", "reinhard")?;
                arguments.set_item("key", short(*key))?;
                arguments.set_item("white", white.map(short))?;
            }
            ToneMapping::ReinhardAt { exposure, white } => {
                arguments.set_item("tone_mapping", "reinhard")?;
                arguments.set_item("exposure", short(*exposure))?;
                arguments.set_item("white", white.map(short))?;
            }
            ToneMapping::Srgb { exposure } => {
                arguments.set_item("tone_mapping", "srgb")?;
                arguments.set_item("exposure", short(*exposure))?;
            }
            ToneMapping::Custom { exposure, curve } => {
                arguments.set_item("tone_mapping", made(py, curve)?)?;
                arguments.set_item("exposure", short(*exposure))?;
            }
            other => unreachable!("Python has no name for {other:?}"),
        }
        arguments.set_item("viewing", params.viewing.to_string())?;
        arguments.set_item("schedule", params.schedule.name())?;
        arguments.set_item("step", params.schedule.step())?;
        arguments.set_item("min_spp", params.min_spp)?;
        arguments.set_item("max_spp", params.max_spp)?;
        arguments.set_item("consecutive", params.consecutive)?;
        let Audience { slope, offset } = params.audience;
        arguments.set_item("audience", (slope, offset))?;
        Ok(arguments)
    }
}

/// The double with the digits of a float: 0.18, not 0.18000000715255737. It is rounded to the same float.
fn short(value: f32) -> f64 {
    value.to_string().parse().unwrap_or(f64::from(value))
}
