//! The push session.

use crate::arrays::{Pixels, picture, plane};
use crate::errors::{Error, ParameterError, Raise, SizeError, file_error, whole};
use crate::judging::{Criterion, Hits, Judging, not_while_denoising};
use crate::oracle::PyOracle;
use crate::params::PyParams;
use crate::pickle::reduced;
use crate::pool;
use crate::verdicts::{PyRequest, PyStop, PyVerdict, TileLike};
use noisefloor::{
    Checkpoint, Oracle, Params, Rgb, Schedule, Session, StopReason, Tile, TileGrid,
    checkpoint::CheckpointError, session::Interruption, session::SessionError, source::PixelNoise,
    watch::Warning,
};
use noisefloor_denoise::DEFAULT_JODS_LOST;
use noisefloor_image::{WriteError, WriteFault, write_atomic};
use numpy::{PyArray2, PyArray3};
use pyo3::exceptions::PyUserWarning;
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use pyo3::types::{PyBytes, PyType};
use std::ffi::CString;
use std::fs::File;
use std::io::BufReader;
use std::ops::{Deref, DerefMut};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard};

/// Film, oracle and limits of one picture: a renderer pushes samples, and is told which tiles need more.
///
/// width, height: of the picture in pixels, each up to 65536, 2**28 in all. It takes 36 bytes a pixel.
/// oracle: an Oracle; None is Oracle(). params: a Params; None is Params().
/// shared_pixels: whether neighbouring pixels have noise in common, by a pixel filter, a denoiser or a Markov
///     chain: no warning says so then.
/// denoiser: a function that takes the linear radiance of a whole picture, an array of shape (height, width, 3), and
///     returns it denoised. Tiles are then done when the denoised picture has lost at most `lost` just-objectionable
///     differences (JOD) against the converged one, 19 of 20 of them, by the vision model: nobody has been asked about
///     denoised pictures. What a denoiser smears however many samples it gets is done when its noise is (undenoised). Both halves of the samples are denoised apart, so a verdict takes two calls: params is
///     Params(schedule="growing", step=48, min_spp=48) unless given. What it returns must hang on its arguments
///     alone. It takes the place of oracle, and cannot use sessions.
/// first_hits: ((albedo, normal), (albedo, normal)), a pair for each half, independent of each other: arrays of shape
///     (height, width, 3). The denoiser is then called with (radiance, albedo, normal); first_hits_are_clean knows whether it may take
///     them at their word.
/// passes: 4 if the finished picture is the mean of so many mirror images (mirror_mean). Verdicts take one.
/// linear: says that what is pushed is linear radiance, so that no warning asks: where all batches
///     have one size, nothing tells that from values that were encoded for a screen.
///
/// Threads may call any method at any time; calls take turns. The interpreter's lock is released while
/// judging. A copy, or what pickle makes of a session elsewhere, is one that was saved and resumed: tiles that
/// close_all ended are open in it.
///
/// Raises SizeError if the picture, a tile or first_hits has an impossible size, ParameterError if oracle and denoiser
/// are given.
#[pyclass(frozen, name = "Session", module = "noisefloor")]
pub(crate) struct PySession {
    /// Elsewhere while it judges in the background.
    judged: Mutex<Option<Session<Criterion>>>,
    judging: Judging,
    pub(crate) grid: TileGrid,
    pixels: PixelNoise,
}

/// The session in a lock.
struct MappedGuard<'a>(MutexGuard<'a, Option<Session<Criterion>>>);

impl Deref for MappedGuard<'_> {
    type Target = Session<Criterion>;

    fn deref(&self) -> &Self::Target {
        self.0.as_ref().expect("a session that is elsewhere is not locked")
    }
}

impl DerefMut for MappedGuard<'_> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        self.0.as_mut().expect("a session that is elsewhere is not locked")
    }
}

const BROKEN: &str = "the session cannot be used since an error inside the library";
const AWAY: &str = "the session judges in the background: Background.end() gives it back";

impl PySession {
    /// A session that has not begun.
    fn fresh(
        py: Python<'_>,
        (width, height): (usize, usize),
        judging: Judging,
        params: Params,
        pixels: PixelNoise,
    ) -> PyResult<Self> {
        let session = fresh(py, (width, height), &judging, params, pixels)?;
        let grid = session.film().grid();
        Ok(Self { grid, judged: Mutex::new(Some(session)), judging, pixels })
    }

    /// The session, for something short. Others may have the interpreter while this waits.
    fn attached(&self, py: Python<'_>) -> PyResult<MappedGuard<'_>> {
        let guard = MappedGuard(self.lock(py)?);
        if guard.0.is_some() { Ok(guard) } else { Err(Error::new_err(AWAY)) }
    }

    fn lock(&self, py: Python<'_>) -> PyResult<MutexGuard<'_, Option<Session<Criterion>>>> {
        not_while_denoising()?;
        self.judged.lock_py_attached(py).map_err(|_| Error::new_err(BROKEN))
    }

    /// Hands the session out, to judge in the background.
    pub(crate) fn lend(&self, py: Python<'_>) -> PyResult<Session<Criterion>> {
        self.lock(py)?.take().ok_or_else(|| Error::new_err(AWAY))
    }

    pub(crate) fn is_lent(&self, py: Python<'_>) -> PyResult<bool> {
        Ok(self.lock(py)?.is_none())
    }

    pub(crate) fn take_back(&self, py: Python<'_>, session: Session<Criterion>) -> PyResult<()> {
        *self.lock(py)? = Some(session);
        Ok(())
    }

    fn if_denoised<T>(&self, of: impl FnOnce() -> PyResult<T>) -> PyResult<Option<T>> {
        matches!(self.judging, Judging::Denoised { .. }).then(of).transpose()
    }

    /// The exception that a denoiser has raised, or that of an error.
    pub(crate) fn raised(&self, error: SessionError) -> PyErr {
        self.judging.raised().unwrap_or_else(|| error.raise())
    }

    /// Checks the shape of a whole picture.
    pub(crate) fn whole<'a>(&self, image: &'a Pixels<'_>) -> PyResult<std::borrow::Cow<'a, [Rgb]>> {
        let (width, height, pixels) = image.get();
        if (width, height) != self.size() {
            let (w, h) = self.size();
            let message = format!("image has shape ({height}, {width}, 3), and the session ({h}, {w}, 3)");
            return Err(SizeError::new_err(message));
        }
        Ok(pixels)
    }

    /// Does something long without the interpreter.
    fn detached<T: Send>(
        &self,
        py: Python<'_>,
        work: impl FnOnce(&mut Session<Criterion>) -> T + Send,
    ) -> PyResult<T> {
        not_while_denoising()?;
        let locked = |mut judged: MutexGuard<'_, Option<Session<Criterion>>>| {
            let session = judged.as_mut()?;
            Some(pool::run(|| work(session)))
        };
        let done = py.detach(|| self.judged.lock().map(locked).map_err(|_| BROKEN));
        done.map_err(Error::new_err)?.ok_or_else(|| Error::new_err(AWAY))
    }

    fn size(&self) -> (usize, usize) {
        (self.grid.width(), self.grid.height())
    }

    /// Checks the shape of a batch.
    pub(crate) fn batch<'a>(
        &self,
        tile: Tile,
        mean: &'a Pixels<'_>,
    ) -> PyResult<std::borrow::Cow<'a, [Rgb]>> {
        let (width, height, pixels) = mean.get();
        if (width, height) != (tile.width, tile.height) {
            let Tile { index, width: w, height: h, .. } = tile;
            let message = format!("mean has shape ({height}, {width}, 3), and tile {index} is ({h}, {w}, 3)");
            return Err(SizeError::new_err(message));
        }
        Ok(pixels)
    }

    /// A value for each tile, on all of its pixels.
    fn spread<T: Copy + Default>(&self, value: impl Fn(usize) -> T) -> Vec<T> {
        let width = self.grid.width();
        let mut all = vec![T::default(); width * self.grid.height()];
        for tile in self.grid.tiles() {
            let value = value(tile.index);
            tile.rows(width).for_each(|row| all[row].fill(value));
        }
        all
    }
}

#[pymethods]
impl PySession {
    #[new]
    #[pyo3(signature = (width, height, oracle = None, params = None, shared_pixels = false, *, denoiser = None,
        lost = DEFAULT_JODS_LOST, first_hits = None, passes = 1, linear = false))]
    #[expect(clippy::too_many_arguments, reason = "Python names them")]
    fn new(
        py: Python<'_>,
        #[pyo3(from_py_with = whole)] width: usize,
        #[pyo3(from_py_with = whole)] height: usize,
        oracle: Option<PyRef<'_, PyOracle>>,
        params: Option<PyParams>,
        shared_pixels: bool,
        denoiser: Option<Bound<'_, PyAny>>,
        lost: f64,
        first_hits: Option<Hits<'_>>,
        passes: usize,
        linear: bool,
    ) -> PyResult<Self> {
        let (judging, default) = match (denoiser, oracle) {
            (Some(_), Some(_)) => {
                return Err(ParameterError::new_err("give either oracle or denoiser, not both"));
            }
            (None, _) if first_hits.is_some() => {
                return Err(ParameterError::new_err("first_hits are for a denoiser"));
            }
            (None, oracle) => {
                let oracle = oracle.map_or_else(Oracle::bundled, |oracle| oracle.0.clone());
                (Judging::Noise(Box::new(oracle)), Params::default())
            }
            (Some(denoiser), None) => {
                let seldom = Params::default().with_schedule(Schedule::Growing { step: 48 }).with_min_spp(48);
                (Judging::denoised(&denoiser, (lost, passes), first_hits, (width, height))?, seldom)
            }
        };
        let params = params.map_or(default, |params| params.0);
        let session = Self::fresh(py, (width, height), judging, params, noise(shared_pixels))?;
        if linear {
            session.attached(py)?.set_linear();
        }
        Ok(session)
    }

    /// Width of the picture in pixels.
    #[getter]
    fn width(&self) -> usize {
        self.grid.width()
    }

    /// Height of the picture in pixels.
    #[getter]
    fn height(&self) -> usize {
        self.grid.height()
    }

    /// Whether every tile is done.
    #[getter]
    fn done(&self, py: Python<'_>) -> PyResult<bool> {
        Ok(self.attached(py)?.is_done())
    }

    /// Number of open tiles.
    #[getter]
    fn open_tiles(&self, py: Python<'_>) -> PyResult<usize> {
        Ok(self.attached(py)?.open_tiles())
    }

    /// Samples per pixel that the next pass over the whole picture should have, for a renderer of whole frames: what
    /// one half lacks until the first of the open tiles can be judged. None when all tiles are done.
    #[getter]
    fn next_pass(&self, py: Python<'_>) -> PyResult<Option<u64>> {
        Ok(self.attached(py)?.next_pass())
    }

    /// What the open tiles need next: a list of Request, empty when all are done.
    fn requests(&self, py: Python<'_>) -> PyResult<Vec<PyRequest>> {
        Ok(self.attached(py)?.requests().into_iter().map(PyRequest::from).collect())
    }

    /// Adds the mean of spp new samples per pixel of a tile (a Tile or its number).
    ///
    /// mean: array of shape (tile.height, tile.width, 3), linear radiance. Values that are not finite do not
    /// count
    ///     as samples. Tiles that are done accept samples, too: they improve, and stay done.
    ///
    /// Raises SizeError if the shape is another, BatchError if the tile does not exist or spp is 0.
    fn push(
        &self,
        py: Python<'_>,
        tile: TileLike,
        #[pyo3(from_py_with = whole)] spp: u64,
        mean: Pixels<'_>,
    ) -> PyResult<()> {
        let tile = tile.of(self.grid)?;
        let pixels = self.batch(tile, &mean)?;
        self.attached(py)?.push(tile.index, spp, &pixels).map_err(Raise::raise)
    }

    /// As push, for a renderer that keeps running means: the mean of all total samples per pixel so far. The
    /// new samples are what it has more than the session.
    ///
    /// Raises SizeError, BatchError also if there are no new samples.
    fn push_running(
        &self,
        py: Python<'_>,
        tile: TileLike,
        #[pyo3(from_py_with = whole)] total: u64,
        mean: Pixels<'_>,
    ) -> PyResult<()> {
        let tile = tile.of(self.grid)?;
        let pixels = self.batch(tile, &mean)?;
        self.attached(py)?.push_running(tile.index, total, &pixels).map_err(Raise::raise)
    }

    /// As push_image, for a renderer that keeps running means: the mean of all total samples per pixel so far. The new
    /// samples are what it has more than each open tile.
    ///
    /// Raises SizeError, BatchError also if there are no new samples.
    fn push_running_image(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = whole)] total: u64,
        image: Pixels<'_>,
    ) -> PyResult<()> {
        let pixels = self.whole(&image)?;
        let mut session = self.attached(py)?;
        let session: &mut Session<Criterion> = &mut session;
        pool::run(|| session.push_running_image(total, &pixels)).map_err(Raise::raise)
    }

    /// Adds the mean of spp new samples per pixel of the whole picture to every open tile.
    ///
    /// image: array of shape (height, width, 3), linear radiance. Those of frameworks for GPUs (DLPack,
    ///     __cuda_array_interface__: CuPy, PyTorch, JAX, Dr.Jit) are copied from the device once, by the framework, and
    ///     read where they lie if that is memory of the processor.
    ///
    /// Raises SizeError if the shape is another, BatchError if spp is 0.
    fn push_image(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = whole)] spp: u64,
        image: Pixels<'_>,
    ) -> PyResult<()> {
        let pixels = self.whole(&image)?;
        let mut session = self.attached(py)?;
        // The interpreter stays locked: nobody else is to write into what is read
        let session: &mut Session<Criterion> = &mut session;
        pool::run(|| session.push_image(spp, &pixels)).map_err(Raise::raise)
    }

    /// Judges the tiles that are due, on all cores, and returns a list of Stop: those that are now done.
    ///
    /// The first verdicts wait until every open tile has samples, unless tone_mapping is "srgb". When the
    /// exposure of the finished picture turns out to be another than was estimated, tiles that were done
    /// can be open again: render until done is true.
    ///
    /// Warns of samples that are likely to be wrong, each kind once, and after resume() once more. Raises FaultError if they cannot be what
    /// they are said to be: no tile is done then. Raises CriterionError if the model cannot judge these tiles, and what
    /// a denoiser raises.
    fn judge(&self, py: Python<'_>) -> PyResult<Vec<PyStop>> {
        let judge = |session: &mut Session<Criterion>| -> Result<_, SessionError> {
            let stops = session.judge()?;
            Ok((stops, session.new_warnings()))
        };
        let (stops, warnings) = self.detached(py, judge)?.map_err(|error| self.raised(error))?;
        warn(py, warnings)?;
        Ok(stops.into_iter().map(PyStop::from).collect())
    }

    /// All tiles that are done: a list of Stop, by their numbers.
    fn stops(&self, py: Python<'_>) -> PyResult<Vec<PyStop>> {
        Ok(self.attached(py)?.stops().map(PyStop::from).collect())
    }

    /// The last verdict on a tile (a Tile or its number); None before the first.
    ///
    /// Raises BatchError if the tile does not exist.
    fn verdict(&self, py: Python<'_>, tile: TileLike) -> PyResult<Option<PyVerdict>> {
        let tile = tile.of(self.grid)?;
        let session = self.attached(py)?;
        let open_for = session.open_for(tile.index);
        Ok(session.verdict(tile.index).map(|mut verdict| {
            verdict.open_for = open_for;
            PyVerdict::of(tile, verdict)
        }))
    }

    /// Ends every open tile for "time-limit", "cancelled" or "failed", and returns them as a list of Stop.
    ///
    /// Raises ParameterError for any other reason.
    fn close_all(&self, py: Python<'_>, reason: &str) -> PyResult<Vec<PyStop>> {
        let reasons = [Interruption::TimeLimit, Interruption::Cancelled, Interruption::Failed];
        let found = reasons.into_iter().find(|&known| StopReason::from(known).to_string() == reason);
        let unknown = || ParameterError::new_err(format!("{reason:?} is no reason to end tiles"));
        let reason = found.ok_or_else(unknown)?;
        Ok(self.attached(py)?.close_all(reason).into_iter().map(PyStop::from).collect())
    }

    /// What is likely to be wrong with the samples pushed so far, as of the last judge(): a list of str.
    #[getter]
    fn warnings(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        Ok(self.attached(py)?.warnings().iter().map(ToString::to_string).collect())
    }

    /// Samples, over all pixels, that were left out because their batch was not finite.
    #[getter]
    fn rejected_samples(&self, py: Python<'_>) -> PyResult<u64> {
        Ok(self.attached(py)?.film().rejected())
    }

    /// Samples, over all pixels, whose batch had negative luminance; since a resume.
    #[getter]
    fn negative_samples(&self, py: Python<'_>) -> PyResult<u64> {
        Ok(self.attached(py)?.negative_samples())
    }

    /// Samples still to be taken, over all pixels, as the oracle expects; None while it cannot tell for a
    /// tile.
    #[getter]
    fn expected_samples(&self, py: Python<'_>) -> PyResult<Option<u64>> {
        Ok(self.attached(py)?.expected_samples_to_go())
    }

    /// The picture so far: float32 of shape (height, width, 3), linear radiance; black without samples.
    fn image<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        picture(py, self.size(), self.detached(py, |session| session.film().image())?)
    }

    /// Samples of each pixel: uint64 of shape (height, width).
    fn spp<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u64>>> {
        let (session, width) = (self.attached(py)?, self.grid.width());
        let mut all = vec![0; width * self.grid.height()];
        for tile in self.grid.tiles() {
            for pixel in tile.rows(width).flatten() {
                all[pixel] = session.film().spp(tile.index);
            }
        }
        plane(py, self.size(), all)
    }

    /// P of the last verdicts: float32 of shape (height, width); NaN where there is none.
    fn probability<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let session = self.attached(py)?;
        let p = |tile| session.verdict(tile).and_then(|verdict| verdict.probability).unwrap_or(f32::NAN);
        plane(py, self.size(), self.spread(p))
    }

    /// How visible the noise is, 1 where it is just seen: float32 of shape (height, width), NaN
    /// where there is no evidence. Costs as much as a verdict on every tile. None before the first verdict,
    /// or if the model makes no map.
    fn visible_noise<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f32>>>> {
        let map = self.detached(py, |session| session.visible_noise())?;
        map.map(|map| plane(py, self.size(), map)).transpose()
    }

    /// Just-objectionable differences that the denoised tiles have lost, by their last verdicts: float64 of shape
    /// (height, width), NaN before. None without a denoiser.
    fn jods_lost<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let session = self.attached(py)?;
        let lost = |tile| session.verdict(tile).and_then(|verdict| verdict.lost).unwrap_or(f64::NAN);
        self.if_denoised(|| plane(py, self.size(), self.spread(lost)))
    }

    /// Where the picture to be shown is as rendered instead of denoised: bool of shape (height, width). The noise has lost no
    /// more than is allowed there, and what the denoiser makes of it has. None without a denoiser.
    fn undenoised<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<bool>>>> {
        let session = self.attached(py)?;
        let undenoised = |tile| session.verdict(tile).is_some_and(|verdict| verdict.undenoised);
        self.if_denoised(|| plane(py, self.size(), self.spread(undenoised)))
    }

    /// Writes a snapshot to a file, for resuming the session. The file is whole or not there.
    ///
    /// job: names all that the samples depend on: scene, seed, options of the renderer.
    ///
    /// Raises OSError if the file cannot be written, CheckpointError if it would be too large.
    fn save(&self, py: Python<'_>, path: PathBuf, job: &str) -> PyResult<()> {
        self.detached(py, |session| save(session, &path, job))?
    }

    /// Puts the session back where save() found it, with its warnings. Size, parameters, oracle and job must
    /// be the same. If the renderer repeats its samples, all that follows is the same to the bit as without
    /// the interruption.
    ///
    /// Raises OSError if the file cannot be read, CheckpointError if it is damaged or of another job; the
    /// session is then as it was.
    fn resume(&self, py: Python<'_>, path: PathBuf, job: &str) -> PyResult<()> {
        let file = File::open(&path).map_err(|error| file_error(&path, &error))?;
        let checkpoint = py.detach(|| Checkpoint::read(BufReader::new(file)));
        let checkpoint = checkpoint.map_err(|error| raise(&path, error))?;
        let mut guard = self.attached(py)?;
        let session = fresh(py, self.size(), &self.judging, guard.params().clone(), self.pixels)?;
        let session = session.resume(job, checkpoint).map_err(|error| raise(&path, error))?;
        *guard.0 = Some(session);
        Ok(())
    }

    /// What pickle makes it from: a checkpoint, in memory.
    #[classmethod]
    fn _restore(
        class: &Bound<'_, PyType>,
        size: (usize, usize),
        judging: &Bound<'_, PyAny>,
        params: PyParams,
        shared_pixels: bool,
        checkpoint: &[u8],
    ) -> PyResult<Self> {
        let (py, pixels) = (class.py(), noise(shared_pixels));
        let judging = Judging::from_python(judging, size)?;
        let session = fresh(py, size, &judging, params.0, pixels)?;
        let checkpoint = Checkpoint::read(checkpoint).map_err(Raise::raise)?;
        let session = session.resume(PICKLED, checkpoint).map_err(Raise::raise)?;
        let grid = session.film().grid();
        Ok(Self { judged: Mutex::new(Some(session)), judging, grid, pixels })
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let mut kept = Vec::new();
        let params = self
            .detached(py, |session| {
                session.checkpoint(PICKLED)?.write(&mut kept)?;
                Ok(PyParams(session.params().clone()))
            })?
            .map_err(|error: CheckpointError| error.raise())?;
        let (size, judging) = (self.size(), self.judging.to_python(py, self.size())?);
        let shared_pixels = self.pixels == PixelNoise::Shared;
        reduced::<Self>(py, (size, judging, params, shared_pixels, PyBytes::new(py, &kept)))
    }

    fn __repr__(&self) -> String {
        let (width, height) = self.size();
        format!("<noisefloor.Session: {width}×{height} pixels, {} tiles>", self.grid.len())
    }
}

/// The job of a session on its way to another process, which names none.
const PICKLED: &str = "pickled";

fn noise(shared: bool) -> PixelNoise {
    if shared { PixelNoise::Shared } else { PixelNoise::Independent }
}

fn fresh(
    py: Python<'_>,
    (width, height): (usize, usize),
    judging: &Judging,
    params: Params,
    pixels: PixelNoise,
) -> PyResult<Session<Criterion>> {
    let criterion = judging.make(py)?;
    let mut session = Session::new(width, height, criterion, params).map_err(Raise::raise)?;
    session.set_pixels(pixels);
    Ok(session)
}

/// Warns of what is likely to be wrong with samples.
pub(crate) fn warn(py: Python<'_>, warnings: Vec<Warning>) -> PyResult<()> {
    warnings.into_iter().try_for_each(|warning| {
        let text = CString::new(warning.to_string()).unwrap_or_default();
        PyErr::warn(py, &py.get_type::<PyUserWarning>(), &text, 1)
    })
}

fn save(session: &Session<Criterion>, path: &Path, job: &str) -> PyResult<()> {
    let checkpoint = session.checkpoint(job).map_err(Raise::raise)?;
    write_atomic(path, |writer| checkpoint.write(writer)).map_err(|error| match error.fault {
        WriteFault::Failed(source) => match source.downcast() {
            Ok(error) => raise(path, *error),
            Err(source) => WriteError { fault: WriteFault::Failed(source), ..error }.raise(),
        },
        fault => WriteError { fault, ..error }.raise(),
    })
}

fn raise(path: &Path, error: CheckpointError) -> PyErr {
    match error {
        CheckpointError::Io(error) => file_error(path, &error),
        other => other.raise(),
    }
}
