//! A session that judges beside the rendering.

use crate::arrays::Pixels;
use crate::errors::{Error, ParameterError, Raise, whole};
use crate::judging::{Criterion, not_while_denoising};
use crate::pool;
use crate::session::{PySession, warn};
use crate::verdicts::{PyRequest, PyStop, TileLike};
use noisefloor::Rgb;
use noisefloor::background::{Background, News, WhenFull};
use noisefloor::session::SessionError;
use pyo3::prelude::*;
use std::process;
use std::sync::{Arc, Mutex, PoisonError, Weak};

/// Judges a Session on a thread of its own: the renderer hands over a pass and goes on.
///
/// session: cannot be used until end() gives it back.
/// waiting: passes that may wait behind the one that is being judged, at least 1.
/// when_full: "wait" lets judge() wait until there is room; "merge" adds the pass to the one before, so that the
///     renderer never waits. Which passes become one depends on time then.
///
/// Stops are those of the session without this, to the bit, only later. Samples that a tile gets after it has stopped
/// are in the picture at the end. Threads may call any method at any time. In a process that was forked off, it cannot
/// be used. As a context manager, it ends with the block.
///
/// Raises ParameterError for another when_full.
#[pyclass(frozen, name = "Background", module = "noisefloor")]
pub(crate) struct PyBackground {
    /// Taken when this object is dropped.
    background: Option<Arc<Background<Criterion>>>,
    session: Py<PySession>,
    /// The one that has the thread.
    process: u32,
}

/// Those that may have a thread, and its process.
static RUNNING: Mutex<Vec<(u32, Weak<Background<Criterion>>)>> = Mutex::new(Vec::new());

/// Ends all threads, when the script has ended and the interpreter has not: it would end a thread within a denoiser by
/// unwinding it, which aborts the process.
#[pyfunction]
pub(crate) fn stop_all(py: Python<'_>) {
    let all = std::mem::take(&mut *RUNNING.lock().unwrap_or_else(PoisonError::into_inner));
    let here = all.into_iter().filter(|(process, _)| *process == process::id());
    py.detach(|| here.filter_map(|(_, background)| background.upgrade()).for_each(|running| running.stop()));
}

impl PyBackground {
    /// The background, in the process that has its thread.
    fn here(&self) -> PyResult<&Background<Criterion>> {
        not_while_denoising()?;
        let elsewhere = || Error::new_err("the session judges in the process that this one was forked off");
        self.background.as_deref().filter(|_| self.process == process::id()).ok_or_else(elsewhere)
    }

    /// A copy of an image.
    fn copied(&self, background: &Background<Criterion>, image: &Pixels<'_>) -> PyResult<Vec<Rgb>> {
        let pixels = self.session.get().whole(image)?;
        let mut buffer = background.buffer();
        buffer.copy_from_slice(&pixels);
        Ok(buffer)
    }

    fn raised(&self, error: SessionError) -> PyErr {
        self.session.get().raised(error)
    }

    fn tell(py: Python<'_>, News { stops, warnings, .. }: News) -> PyResult<Vec<PyStop>> {
        warn(py, warnings)?;
        Ok(stops.into_iter().map(PyStop::from).collect())
    }
}

#[pymethods]
impl PyBackground {
    #[new]
    #[pyo3(signature = (session, *, waiting = 2, when_full = "wait"))]
    fn new(
        py: Python<'_>,
        session: Py<PySession>,
        #[pyo3(from_py_with = whole)] waiting: usize,
        when_full: &str,
    ) -> PyResult<Self> {
        let when_full = match when_full {
            "wait" => WhenFull::Wait,
            "merge" => WhenFull::Merge,
            other => {
                let message = format!("when_full is {other:?}: \"wait\" or \"merge\" is needed");
                return Err(ParameterError::new_err(message));
            }
        };
        let lent = session.get().lend(py)?;
        let background = Background::new_in(lent, waiting, when_full, |work| pool::run(work));
        let (background, process) = (Arc::new(background.map_err(Raise::raise)?), process::id());
        let mut all = RUNNING.lock().unwrap_or_else(PoisonError::into_inner);
        all.retain(|(_, other)| other.strong_count() > 0);
        all.push((process, Arc::downgrade(&background)));
        Ok(Self { background: Some(background), session, process })
    }

    /// Adds the mean of spp new samples per pixel of the whole picture to the pass. It is copied.
    ///
    /// image: array of shape (height, width, 3), linear radiance; also one on a GPU, as for Session.push_image.
    ///
    /// Raises SizeError if the shape is another, and what failed in the background.
    fn push_image(&self, #[pyo3(from_py_with = whole)] spp: u64, image: Pixels<'_>) -> PyResult<()> {
        let background = self.here()?;
        let buffer = self.copied(background, &image)?;
        background.push_image(spp, buffer).map_err(|error| self.raised(error))
    }

    /// As push_image, for a renderer that keeps running means: the mean of all total samples per pixel so far.
    ///
    /// Raises SizeError if the shape is another, and what failed in the background.
    fn push_running_image(
        &self,
        #[pyo3(from_py_with = whole)] total: u64,
        image: Pixels<'_>,
    ) -> PyResult<()> {
        let background = self.here()?;
        let buffer = self.copied(background, &image)?;
        background.push_running_image(total, buffer).map_err(|error| self.raised(error))
    }

    /// Adds the mean of spp new samples per pixel of a tile (a Tile or its number) to the pass. It is copied.
    ///
    /// Raises SizeError if the shape is another, BatchError if the tile does not exist, and what failed in the
    /// background.
    fn push(&self, tile: TileLike, #[pyo3(from_py_with = whole)] spp: u64, mean: Pixels<'_>) -> PyResult<()> {
        let (background, session) = (self.here()?, self.session.get());
        let tile = tile.of(session.grid)?;
        let pixels = session.batch(tile, &mean)?.into_owned();
        background.push(tile.index, spp, pixels).map_err(|error| self.raised(error))
    }

    /// Hands over the pass, all that was pushed since the last call, and returns a list of Stop: what has come of
    /// earlier ones. Warns as Session.judge does.
    ///
    /// Raises what failed in the background: FaultError, BatchError, CriterionError, what a denoiser raises.
    fn judge(&self, py: Python<'_>) -> PyResult<Vec<PyStop>> {
        let background = self.here()?;
        let news = py.detach(|| background.judge().and_then(|()| background.news()));
        Self::tell(py, news.map_err(|error| self.raised(error))?)
    }

    /// Waits until no pass waits, and returns a list of Stop as judge does.
    ///
    /// Raises what failed in the background.
    fn finish(&self, py: Python<'_>) -> PyResult<Vec<PyStop>> {
        let background = self.here()?;
        Self::tell(py, py.detach(|| background.finish()).map_err(|error| self.raised(error))?)
    }

    /// Waits until no pass waits, gives the session back, and returns it. What was pushed and not handed over is lost. From then
    /// on, calls of other threads raise Error.
    ///
    /// Raises what failed in the background; the session is back then, too, unless an error inside the library was it.
    fn end(&self, py: Python<'_>) -> PyResult<Py<PySession>> {
        let background = self.here()?;
        let (news, session) = py.detach(|| (background.finish(), background.take_session()));
        let session = session.map_err(|error| self.raised(error))?;
        self.session.get().take_back(py, session)?;
        Self::tell(py, news.map_err(|error| self.raised(error))?)?;
        Ok(self.session.clone_ref(py))
    }

    /// Passes that were handed over and are not judged yet. Does not wait.
    #[getter]
    fn pending(&self) -> PyResult<usize> {
        Ok(self.here()?.pending())
    }

    /// As Session.next_pass, after the last pass that was judged. Does not wait.
    #[getter]
    fn next_pass(&self) -> PyResult<Option<u64>> {
        Ok(self.here()?.next_pass())
    }

    /// Samples per pixel that open tiles can still get before they stop at Params.max_spp, beside all that was handed over. Does
    /// not wait. A renderer that has summed up as many waits for the verdict, by finish(): what it would render meanwhile is
    /// beyond the stop. 0 when all tiles are done, or will be with the passes that are pending, as far as is known.
    #[getter]
    fn spp_left(&self) -> PyResult<u64> {
        Ok(self.here()?.spp_left())
    }

    /// Whether every tile is done, by the passes that were judged. Does not wait.
    #[getter]
    fn done(&self) -> PyResult<bool> {
        Ok(self.here()?.is_done())
    }

    /// As Session.requests(), after the last pass that was judged; does not wait. What was handed over since is not in
    /// it: number samples yourself instead of by first and point.
    fn requests(&self) -> PyResult<Vec<PyRequest>> {
        Ok(self.here()?.requests().into_iter().map(PyRequest::from).collect())
    }

    fn __enter__(this: Py<Self>) -> Py<Self> {
        this
    }

    /// Ends with the block; if that ended by an exception, what failed in the background is not raised.
    #[pyo3(signature = (kind, _value, _traceback))]
    fn __exit__(
        &self,
        py: Python<'_>,
        kind: Option<Bound<'_, PyAny>>,
        _value: Option<Bound<'_, PyAny>>,
        _traceback: Option<Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        match self.session.get().is_lent(py)? {
            true => self.end(py).map(drop).or_else(|error| if kind.is_some() { Ok(()) } else { Err(error) }),
            false => Ok(()),
        }
    }

    fn __repr__(&self) -> String {
        let (width, height) = (self.session.get().grid.width(), self.session.get().grid.height());
        format!("<noisefloor.Background of a session of {width}×{height} pixels>")
    }
}

impl Drop for PyBackground {
    /// The thread may wait for the interpreter, to call a denoiser.
    fn drop(&mut self) {
        let Some(background) = self.background.take() else { return };
        if self.process == process::id() {
            let mut background = Some(background);
            Python::try_attach(|py| py.detach(|| drop(background.take())));
            // Or the interpreter ends, and nothing can be waited for
            std::mem::forget(background);
        } else {
            // Its thread is not here to be waited for
            std::mem::forget(background);
        }
    }
}
