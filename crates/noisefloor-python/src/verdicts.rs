//! What a session says: tiles, requests, verdicts, stops. Other processes get them pickled, and make them.

use crate::errors::{BatchError, whole};
use noisefloor::{Request, Stop, Tile, TileGrid, Verdict, criterion::OpenFor};
use pyo3::exceptions::PyOverflowError;
use pyo3::prelude::*;

/// Tile(index, x, y, width, height) --
///
/// A rectangle of pixels that stops as a whole.
#[pyclass(frozen, eq, hash, get_all, name = "Tile", module = "noisefloor", from_py_object)]
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct PyTile {
    /// Its number, in rows from the top left.
    pub(crate) index: usize,
    /// Left edge in pixels.
    x: usize,
    /// Top edge in pixels.
    y: usize,
    /// Width in pixels.
    width: usize,
    /// Height in pixels.
    height: usize,
}

#[pymethods]
impl PyTile {
    #[new]
    fn new(
        #[pyo3(from_py_with = whole)] index: usize,
        #[pyo3(from_py_with = whole)] x: usize,
        #[pyo3(from_py_with = whole)] y: usize,
        #[pyo3(from_py_with = whole)] width: usize,
        #[pyo3(from_py_with = whole)] height: usize,
    ) -> Self {
        Self { index, x, y, width, height }
    }

    fn __getnewargs__(&self) -> (usize, usize, usize, usize, usize) {
        (self.index, self.x, self.y, self.width, self.height)
    }

    /// The slices that cut the tile out of an array of the whole picture: image[tile.slices].
    #[getter]
    fn slices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let slice = |start: usize, length: usize| {
            pyo3::types::PySlice::new(py, start as isize, (start + length) as isize, 1)
        };
        Ok((slice(self.y, self.height), slice(self.x, self.width)).into_pyobject(py)?.into_any())
    }

    fn __repr__(&self) -> String {
        let Self { index, x, y, width, height } = self;
        format!("Tile(index={index}, x={x}, y={y}, width={width}, height={height})")
    }
}

impl From<PyTile> for Tile {
    fn from(PyTile { index, x, y, width, height }: PyTile) -> Self {
        Self { index, x, y, width, height }
    }
}

impl From<Tile> for PyTile {
    fn from(Tile { index, x, y, width, height }: Tile) -> Self {
        Self { index, x, y, width, height }
    }
}

/// A tile, or its number.
pub(crate) enum TileLike {
    Index(usize),
    Tile(PyTile),
}

impl<'py> FromPyObject<'_, 'py> for TileLike {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        if let Ok(tile) = object.cast::<PyTile>() {
            return Ok(Self::Tile(*tile.get()));
        }
        object.extract::<usize>().map(Self::Index).map_err(|error| {
            if error.is_instance_of::<PyOverflowError>(object.py()) {
                BatchError::new_err(format!(
                    "tile {} does not exist: they are counted from 0",
                    object.to_owned()
                ))
            } else {
                error
            }
        })
    }
}

impl TileLike {
    /// The tile of a grid.
    pub(crate) fn of(&self, grid: TileGrid) -> PyResult<Tile> {
        let all = grid.len();
        let found = |index: usize| {
            let missing = || BatchError::new_err(format!("tile {index} does not exist: there are {all}"));
            (index < all).then(|| grid.tile(index)).ok_or_else(missing)
        };
        match self {
            Self::Index(index) => found(*index),
            Self::Tile(tile) => {
                let here = found(tile.index)?;
                let other = || {
                    format!(
                        "{} is of another session: here it is {}",
                        tile.__repr__(),
                        PyTile::from(here).__repr__()
                    )
                };
                (PyTile::from(here) == *tile).then_some(here).ok_or_else(|| BatchError::new_err(other()))
            }
        }
    }
}

/// Request(tile, first, spp) --
///
/// What an open tile needs next.
#[pyclass(frozen, eq, hash, get_all, name = "Request", module = "noisefloor")]
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) struct PyRequest {
    /// The tile.
    pub(crate) tile: PyTile,
    /// Number of the first new sample, so that a renderer repeats none.
    pub(crate) first: u64,
    /// New samples per pixel. Fewer or more are fine.
    pub(crate) spp: u64,
    /// For quasi-random points: which sequence of the pixel the samples belong to, 0 or 1. Scramble the two
    /// independently.
    pub(crate) sequence: u32,
    /// Index of the first new point in that sequence.
    pub(crate) point: u64,
}

#[pymethods]
impl PyRequest {
    #[new]
    fn new(
        tile: PyTile,
        #[pyo3(from_py_with = whole)] first: u64,
        #[pyo3(from_py_with = whole)] spp: u64,
        #[pyo3(from_py_with = whole)] sequence: u32,
        #[pyo3(from_py_with = whole)] point: u64,
    ) -> Self {
        Self { tile, first, spp, sequence, point }
    }

    fn __getnewargs__(&self) -> (PyTile, u64, u64, u32, u64) {
        (self.tile, self.first, self.spp, self.sequence, self.point)
    }

    fn __repr__(&self) -> String {
        let Self { tile, first, spp, sequence, point } = self;
        format!(
            "Request(tile={}, first={first}, spp={spp}, sequence={sequence}, point={point})",
            tile.__repr__()
        )
    }
}

impl From<Request> for PyRequest {
    fn from(Request { tile, first, spp, sequence, .. }: Request) -> Self {
        Self { tile: tile.into(), first, spp, sequence: sequence.number, point: sequence.first }
    }
}

/// The 10 %, 50 % and 90 % points of a threshold, in samples per pixel.
type Points = (u64, u64, u64);

/// What the oracle says about one tile.
#[pyclass(frozen, eq, get_all, name = "Verdict", module = "noisefloor", from_py_object)]
#[derive(Clone, PartialEq)]
pub(crate) struct PyVerdict {
    /// The tile.
    tile: PyTile,
    /// Whether the tile needs no more samples.
    converged: bool,
    /// Probability that an observer sees no difference from the converged picture; None if not known.
    probability: Option<f32>,
    /// Samples per pixel at which the tile is expected to be free of visible noise; None if not known.
    expected_spp: Option<u64>,
    /// Where people are expected to stop seeing noise, in samples per pixel: the 10 %, 50 % and 90 % points.
    /// ``expected_spp`` is where the tile stops, which is later.
    threshold: Option<Points>,
    /// Whether the tile is unlike all that the model was trained on: treat the verdict with care.
    unfamiliar: bool,
    /// What keeps the tile open, or has kept it until a limit: ``"noise"``, ``"exposure"``, ``"unmet-light"``, ``"few-samples"``
    /// or ``"doubt"``; None if nothing does.
    open_for: Option<String>,
}

/// What a verdict is made of again, as `pickle` does.
type VerdictArguments = (PyTile, bool, Option<f32>, Option<u64>, Option<Points>, bool, Option<String>);

#[pymethods]
impl PyVerdict {
    #[new]
    fn new(
        tile: PyTile,
        converged: bool,
        probability: Option<f32>,
        expected_spp: Option<u64>,
        threshold: Option<Points>,
        unfamiliar: bool,
        open_for: Option<String>,
    ) -> Self {
        Self { tile, converged, probability, expected_spp, threshold, unfamiliar, open_for }
    }

    fn __getnewargs__(&self) -> VerdictArguments {
        let Self { tile, converged, probability, expected_spp, threshold, unfamiliar, open_for } =
            self.clone();
        (tile, converged, probability, expected_spp, threshold, unfamiliar, open_for)
    }

    /// Whether the tile is open only for light that it may not have met.
    #[getter]
    fn unmet(&self) -> bool {
        self.open_for.as_deref() == Some(OpenFor::UnmetLight.name())
    }

    fn __repr__(&self) -> String {
        let said = self.open_for.as_deref().map_or("converged".to_owned(), |why| format!("open for {why}"));
        let p = self.probability.map_or("unknown".to_owned(), |p| format!("{p:.3}"));
        format!("<noisefloor.Verdict: tile {}, {said}, P {p}>", self.tile.index)
    }
}

impl PyVerdict {
    pub(crate) fn of(tile: Tile, verdict: Verdict) -> Self {
        let Verdict { converged, probability, threshold, expected_spp, unfamiliar, open_for, .. } = verdict;
        let threshold = threshold.map(|t| (t.low, t.median, t.high));
        let open_for = open_for.map(|why| why.name().to_owned());
        Self { tile: tile.into(), converged, probability, threshold, expected_spp, unfamiliar, open_for }
    }
}

/// A tile that is done.
#[pyclass(frozen, eq, get_all, name = "Stop", module = "noisefloor")]
#[derive(Clone, PartialEq)]
pub(crate) struct PyStop {
    /// The tile.
    tile: PyTile,
    /// Samples per pixel when it stopped.
    spp: u64,
    /// Probability, by the last verdict, that an observer sees no difference; None if never judged.
    probability: Option<f32>,
    /// "converged", "max-spp", "time-limit", "cancelled" or "failed".
    reason: String,
    /// Whether the last verdict called the tile unlike all that the model was trained on.
    unfamiliar: bool,
}

#[pymethods]
impl PyStop {
    #[new]
    fn new(tile: PyTile, spp: u64, probability: Option<f32>, reason: String, unfamiliar: bool) -> Self {
        Self { tile, spp, probability, reason, unfamiliar }
    }

    fn __getnewargs__(&self) -> (PyTile, u64, Option<f32>, String, bool) {
        (self.tile, self.spp, self.probability, self.reason.clone(), self.unfamiliar)
    }

    fn __repr__(&self) -> String {
        format!("<noisefloor.Stop: tile {}, {} at {} spp>", self.tile.index, self.reason, self.spp)
    }
}

impl From<Stop> for PyStop {
    fn from(Stop { tile, spp, probability, reason, unfamiliar, .. }: Stop) -> Self {
        Self { tile: tile.into(), spp, probability, reason: reason.to_string(), unfamiliar }
    }
}
