//! The search for a renderer's own setting.

use crate::arrays::{Pixels, plane};
use crate::errors::{CriterionError, ParameterError, PictureError, Raise, SizeError};
use crate::oracle::PyOracle;
use crate::params::PyParams;
use crate::pool;
use noisefloor::stills::StillWarning;
use noisefloor::tune::{Ending, Excess, Knob, Look, Looked, PairError, PicturePair, PixelCounts, Search};
use noisefloor::{Oracle, Params, Rgb, Tile, Viewing};
use noisefloor_denoise::{DEFAULT_JODS_LOST, DenoisedError};
use noisefloor_vision::VisionModel;
use numpy::{AllowTypeChange, PyArray2, PyArrayLike2};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use std::ffi::CString;
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Edge of the tiles in which noise is described.
const TILE: usize = 64;

/// How far the mean of two pictures is from what may be seen, in its worst place.
#[pyclass(frozen, name = "Excess", module = "noisefloor")]
pub(crate) struct PyExcess {
    excess: Excess,
    size: (usize, usize),
    left: Left,
    /// Squares, and what is wrong in each over what may be.
    squares: Vec<(Tile, f64)>,
}

/// What is left, pixel by pixel.
enum Left {
    Map(Vec<f32>),
    /// Denoised pictures, of which a map takes as long as the verdict, and is made when it is asked for.
    Denoised(Box<DenoisedError>, Viewing),
}

#[pymethods]
impl PyExcess {
    /// What is wrong in the worst place over what may be wrong: 1 or less passes. Infinite where it cannot be told.
    #[getter]
    fn ratio(&self) -> f64 {
        self.excess.ratio
    }

    /// The ratio of one picture whose threshold is finer by the root of two; None without counts of samples.
    #[getter]
    fn alone(&self) -> Option<f64> {
        self.excess.alone
    }

    /// The worst place, (x, y).
    #[getter]
    fn place(&self) -> Option<(usize, usize)> {
        self.excess.place
    }

    /// map() --
    ///
    /// What is left, an array of shape (height, width): visible noise, of which 1 is the limit; or of denoised pictures
    /// the JODs lost.
    fn map<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let map = match &self.left {
            Left::Map(map) => map.clone(),
            Left::Denoised(error, viewing) => py
                .detach(|| error.map_of_jods_lost(&VisionModel::new(viewing)))
                .map_err(|error| PictureError::new_err(error.to_string()))?,
        };
        plane(py, self.size, map)
    }

    /// squares() --
    ///
    /// Where it is wrong: (x, y, width, height, ratio) of squares of 64 pixels that overlap by half. The worst of all has
    /// the ratio of the picture.
    fn squares(&self) -> Vec<(usize, usize, usize, usize, f64)> {
        let found = |(tile, ratio): &(Tile, f64)| (tile.x, tile.y, tile.width, tile.height, *ratio);
        self.squares.iter().map(found).collect()
    }

    fn __repr__(&self) -> String {
        format!("<Excess ratio={:.3} place={:?}>", self.excess.ratio, self.excess.place)
    }
}

/// A search, and whether it was asked since it was told.
pub(crate) struct Asked {
    search: Search,
    asked: bool,
}

impl Asked {
    /// It is to be told what it asked for, once.
    fn told(&mut self) -> PyResult<&mut Search> {
        if std::mem::take(&mut self.asked) {
            return Ok(&mut self.search);
        }
        Err(ParameterError::new_err(
            "tell() answers next(), once: call next(), render what it returns, and tell what was found; \
             after the end there is nothing to tell",
        ))
    }
}

/// A number of how much is left, not negative.
fn ratio(name: &str, value: f64) -> PyResult<f64> {
    if value >= 0.0 {
        return Ok(value);
    }
    Err(ParameterError::new_err(format!(
        "{name} is what is wrong over what may be wrong: 0 or more, or infinity where it cannot be told, not {value}"
    )))
}

fn begin(threshold: Option<(f64, f64)>, samples: Option<(u64, u64)>) -> PyResult<Search> {
    let knob = match (threshold, samples) {
        (Some((coarsest, finest)), None) => Knob::Threshold { coarsest, finest },
        (None, Some((least, most))) => Knob::Samples { least, most },
        _ => {
            return Err(ParameterError::new_err(
                "give threshold=(coarsest, finest) or samples=(least, most)",
            ));
        }
    };
    Search::new(knob).map_err(|error| ParameterError::new_err(error.to_string()))
}

/// What is to be rendered twice, with different seeds, and judged.
#[pyclass(frozen, get_all, name = "Look", module = "noisefloor")]
pub(crate) struct PyLook {
    /// What each picture is rendered with, the same seeds in every step.
    each: f64,
    /// The number of the view, such as a frame.
    view: usize,
    /// (x, y, width, height) of a part that is judged as a picture of its own; None for the whole.
    crop: Option<(usize, usize, usize, usize)>,
    /// Nothing is rendered: the part is cut from the pictures of the whole view that were rendered just before.
    is_rendered: bool,
}

/// Search(*, threshold=None, samples=None, views=1, size=None) --
///
/// The search for the setting of a renderer at which nobody sees noise: its noise threshold, or samples per pixel.
///
/// threshold: (coarsest, finest), such as (0.2, 0.001). samples: (least, most), such as (16, 4096). One of both. What is to be
///     rendered comes from a loop over it:
///
///     search = noisefloor.Search(threshold=(0.2, 0.001))
///     for look in search:
///         search.tell(noisefloor.excess(render(look.each, seed=1), render(look.each, seed=2)))
///     print(search.ending, search.setting)
///
/// views: number of pictures, such as frames of a sequence. All are rendered with the first setting, and then the hardest first,
///     until one fails.
/// size: (width, height) of each view, if the renderer can render a part of it. Then crops around the worst squares stand
///     for a large picture, at most a third of its pixels, and the whole is looked at again in the end.
///
/// One picture with the setting found shows nothing that should not be seen: two with it were looked at, and of a threshold each of
/// them is good enough; or the counts of their samples (see excess) say so.
///
/// Raises ParameterError if the range is empty, or wider than 10⁹.
#[pyclass(frozen, name = "Search", module = "noisefloor")]
pub(crate) struct PySearch(Mutex<Asked>);

impl PySearch {
    fn lock(&self) -> MutexGuard<'_, Asked> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[pymethods]
impl PySearch {
    #[new]
    #[pyo3(signature = (*, threshold = None, samples = None, views = 1, size = None))]
    fn new(
        threshold: Option<(f64, f64)>,
        samples: Option<(u64, u64)>,
        views: usize,
        size: Option<(usize, usize)>,
    ) -> PyResult<Self> {
        if !(1..=MOST_VIEWS).contains(&views) {
            return Err(ParameterError::new_err(format!("views must be 1 to {MOST_VIEWS}, not {views}")));
        }
        let crops = size.map_or(0, Search::crops_for);
        let search = begin(threshold, samples)?.with_views(views).with_crops(crops);
        Ok(Self(Mutex::new(Asked { search, asked: false })))
    }

    /// next() --
    ///
    /// The next Look; None at the end. The same until tell().
    fn next(&self) -> Option<PyLook> {
        let mut search = self.lock();
        let look = search.search.next();
        search.asked = look.is_some();
        look.map(|Look { each, view, crop, is_rendered, .. }| {
            let crop = crop.map(|crop| (crop.x, crop.y, crop.width, crop.height));
            PyLook { each, view, crop, is_rendered }
        })
    }

    fn __iter__(search: PyRef<'_, Self>) -> PyRef<'_, Self> {
        search
    }

    /// The next Look, as next(); raises ParameterError if tell() was not called since the last one.
    fn __next__(&self) -> PyResult<Option<PyLook>> {
        if self.lock().asked {
            return Err(ParameterError::new_err(
                "tell() what was found of this look, then ask for the next one",
            ));
        }
        Ok(self.next())
    }

    /// tell(excess, *, alone=None) --
    ///
    /// What was found of the two pictures that were asked for: an Excess, or its ratio, of which no crops come.
    ///
    /// alone: the ratio of one picture whose threshold is finer by the root of two, if it is known how the samples of pixels follow
    ///     the threshold: that of the mean where they do, and at most 1.41 times that where they do not. None: as the Excess
    ///     has it from counts; without, only pictures that were rendered speak for a setting.
    ///
    /// Raises ParameterError for a ratio that is negative or not a number, and for what was not asked for.
    #[pyo3(signature = (excess, *, alone = None))]
    fn tell(&self, excess: ExcessLike<'_>, alone: Option<f64>) -> PyResult<()> {
        let alone = alone.map(|alone| ratio("alone", alone)).transpose()?;
        let (mut told, squares) = match &excess {
            ExcessLike::Whole(whole) => (whole.excess, whole.squares.as_slice()),
            ExcessLike::Ratio(value) => (Excess::new(ratio("an excess", *value)?), [].as_slice()),
        };
        told.alone = alone.or(told.alone);
        self.lock().told()?.tell(told, squares);
        Ok(())
    }

    /// The views, hardest first as far as it is known.
    #[getter]
    fn views(&self) -> Vec<usize> {
        self.lock().search.views().to_vec()
    }

    /// How it ended: "found", "at-finest" (even the finest setting is not enough), "unchanged" (settings down to the finest give the
    /// same pictures), "capped" (pixels have the most samples), or "not-falling" (more samples do not make it better); None before that.
    #[getter]
    fn ending(&self) -> Option<&'static str> {
        self.lock().search.ending().map(|ending| ending.name())
    }

    /// The setting that is just enough; None unless one was found.
    #[getter]
    fn setting(&self) -> Option<f64> {
        match self.lock().search.ending() {
            Some(Ending::Found { setting, .. }) => Some(setting),
            _ => None,
        }
    }

    /// What was tried: (setting, ratio) of each step. One picture with the setting is as good as the mean of the two
    /// that were rendered for it, if noise follows the setting.
    #[getter]
    fn steps(&self) -> Vec<(f64, f64)> {
        self.lock().search.steps().map(|(setting, excess)| (setting, excess.ratio)).collect()
    }
}

/// More frames than anybody marks.
const MOST_VIEWS: usize = 100_000;

/// An Excess, or its ratio.
#[derive(FromPyObject)]
enum ExcessLike<'py> {
    Whole(PyRef<'py, PyExcess>),
    Ratio(f64),
}

/// How far the mean of two pictures is from what may be seen, in its worst place: an Excess.
///
/// a, b: arrays of shape (height, width, 3) with linear radiance, all finite, rendered with the same setting and
///     different seeds.
/// oracle: an Oracle; None is Oracle(). params: display and audience; None is Params(). Windows are judged, whatever the
///     tile.
/// denoised: what a denoiser makes of a and of b, each without a look at the other. Then the ratio is that of the
///     just-objectionable differences (JOD) that the worst square of 64 pixels may have lost, 1.5 times the estimate, to
///     lost; nobody has been asked about denoised pictures.
/// spp: samples per pixel of each, for an audience that is no factor.
/// counts: (of_a, of_b, fewest, fewest_alone, most), if the renderer tells the samples of its pixels: two arrays of shape (height,
///     width), the fewest that it takes of a pixel of these pictures, and of one picture whose threshold is finer by the root of
///     two (twice as many, where the two share them), and the most.
///
/// The interpreter's lock is released. Warns of what is likely wrong with the pictures, such as another exposure of one.
///
/// Raises SizeError, CriterionError, and PictureError if the pictures cannot be judged: the same twice, for example, or no
/// two of one view.
#[pyfunction]
#[pyo3(signature = (a, b, *, oracle = None, params = None, denoised = None, lost = DEFAULT_JODS_LOST, spp = 128.0, counts = None))]
#[expect(clippy::too_many_arguments, reason = "Python names them")]
pub(crate) fn excess(
    py: Python<'_>,
    a: Pixels<'_>,
    b: Pixels<'_>,
    oracle: Option<PyRef<'_, PyOracle>>,
    params: Option<PyParams>,
    denoised: Option<(Pixels<'_>, Pixels<'_>)>,
    lost: f64,
    spp: f64,
    counts: Option<Counts<'_>>,
) -> PyResult<PyExcess> {
    if !(lost > 0.0 && lost.is_finite()) {
        return Err(ParameterError::new_err(format!("lost must be a positive number of JOD, not {lost}")));
    }
    let oracle = oracle.map_or_else(Oracle::bundled, |oracle| oracle.0.clone());
    let params = params.map_or_else(|| Params::default().with_tile(TILE), |params| params.0);
    let (size, other) = (a.size(), b.size());
    if size != other {
        return Err(SizeError::new_err(format!("the pictures have different sizes, {size:?} and {other:?}")));
    }
    let counts = counts.map(|counts| pixel_counts(counts, size)).transpose()?;
    let (a, b) = (a.copied(), b.copied());
    let denoised = denoised.map(|(a, b)| [a.copied(), b.copied()]);
    let (excess, warnings) =
        py.detach(|| pool::run(|| compare(&oracle, &params, size, [a, b], denoised, lost, spp, counts)))?;
    for warning in warnings {
        let text = CString::new(warning.to_string())?;
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)?;
    }
    Ok(excess)
}

/// Of two pictures, with the fewest of each, of one that is as good as both, and the most.
type Counts<'py> = (Plane<'py>, Plane<'py>, f32, f32, f32);
type Plane<'py> = PyArrayLike2<'py, f32, AllowTypeChange>;

fn pixel_counts(
    (a, b, fewest, fewest_alone, most): Counts<'_>,
    (width, height): (usize, usize),
) -> PyResult<[PixelCounts; 2]> {
    let counts = |plane: &Plane<'_>| {
        let samples = plane.as_array();
        if samples.dim() != (height, width) {
            let message =
                format!("counts of samples have the shape ({height}, {width}), not {:?}", samples.dim());
            return Err(SizeError::new_err(message));
        }
        PixelCounts::new(samples.iter().copied().collect(), [fewest, fewest_alone, most]).ok_or_else(|| {
            ParameterError::new_err("counts of samples are 0 or more, their limits above 0, and all finite")
        })
    };
    Ok([counts(&a)?, counts(&b)?])
}

#[expect(clippy::too_many_arguments, reason = "as Python names them")]
fn compare(
    oracle: &Oracle,
    params: &Params,
    size: (usize, usize),
    pictures: [Vec<Rgb>; 2],
    denoised: Option<[Vec<Rgb>; 2]>,
    lost: f64,
    spp: f64,
    counts: Option<[PixelCounts; 2]>,
) -> PyResult<(PyExcess, Vec<StillWarning>)> {
    let pair = PicturePair::new(size, pictures, spp).map_err(Raise::raise)?;
    let unfit = |error| match error {
        PairError::Still(error) => error.raise(),
        PairError::Size(error) => error.raise(),
        PairError::Judge(error) => PictureError::new_err(error.to_string()),
        other => CriterionError::new_err(other.to_string()),
    };
    let counts = counts.as_ref().map(|counts| counts.each_ref());
    let (looked, left) = match denoised {
        None => {
            let mut looked = pair.look(oracle, params, counts).map_err(unfit)?;
            let map = std::mem::take(&mut looked.map);
            (looked, Left::Map(map))
        }
        Some([a, b]) => {
            let (error, looked) =
                DenoisedError::look(&pair, [&a, &b], lost, params, counts).map_err(unfit)?;
            (looked, Left::Denoised(Box::new(error.of_shape_alone()), params.viewing))
        }
    };
    let Looked { excess, squares, warnings, .. } = looked;
    Ok((PyExcess { excess, size, left, squares }, warnings))
}
