//! The pull loop: requests samples from a source until the criterion is satisfied or a limit is reached.

#![expect(clippy::disallowed_methods, reason = "a driver keeps a limit of time, and says where time went")]

#[cfg(feature = "files")]
use crate::checkpoint::{Checkpoint, CheckpointError};
use crate::criterion::{CriterionError, StoppingCriterion};
use crate::film::FilmError;
use crate::params::Params;
use crate::session::rounds::CALL_SAMPLES;
use crate::session::{Interruption, Stop};
use crate::session::{Session, SessionError};
#[cfg(feature = "files")]
use crate::source::Repeats;
use crate::source::{Batch, ProgressiveSource, Reference, Request, SourceError};
use crate::watch::Fault;
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Why a run failed. All samples taken before are in the session's film.
///
/// Its `Debug` is its text, so that a `main` that returns it prints what to do.
#[derive(Error)]
#[non_exhaustive]
pub enum DriverError {
    /// The session could not be started, or its samples are wrong ([`Fault`]).
    #[error(transparent)]
    Session(SessionError),
    /// The source failed.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// The criterion does not fit.
    #[error(transparent)]
    Criterion(#[from] CriterionError),
}

impl fmt::Debug for DriverError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")?;
        let mut cause = std::error::Error::source(self);
        while let Some(error) = cause {
            write!(f, ": {error}")?;
            cause = error.source();
        }
        Ok(())
    }
}

impl From<SessionError> for DriverError {
    fn from(error: SessionError) -> Self {
        match error {
            SessionError::Criterion(error) => Self::Criterion(error),
            error => Self::Session(error),
        }
    }
}

/// One point of a run's history.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[non_exhaustive]
pub struct TimelinePoint {
    /// Seconds that the driver has run.
    pub seconds: f64,
    /// Samples so far, over all pixels.
    pub samples: u64,
    /// Tiles not yet done.
    pub active_tiles: usize,
}

impl TimelinePoint {
    /// A point of a run that is kept elsewhere.
    pub fn new(seconds: f64, samples: u64, active_tiles: usize) -> Self {
        Self { seconds, samples, active_tiles }
    }
}

/// What happens in a run.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Event {
    /// The quick reference has been rendered.
    ReferenceReady {
        /// Seconds it took.
        seconds: f64,
    },
    /// The film has a new batch.
    BatchDone(Progress),
    /// A tile is done.
    TileStopped(Stop),
}

/// Progress of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Progress {
    /// Time, samples and open tiles.
    pub now: TimelinePoint,
    /// All tiles.
    pub tiles: usize,
    /// Seconds left, estimated from the criterion's expectations; `None` while it has none.
    pub eta_seconds: Option<f64>,
}

impl Progress {
    /// How far a run is whose end nobody has estimated.
    pub fn new(now: TimelinePoint, tiles: usize) -> Self {
        Self { now, tiles, eta_seconds: None }
    }
}

/// How the time of all runs of a driver was spent.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[non_exhaustive]
pub struct Clock {
    /// Seconds in the source, including its reference.
    pub source_seconds: f64,
    /// Seconds in the criterion, including tone mapping, masks and descriptors.
    pub criterion_seconds: f64,
    /// Seconds in total.
    pub total_seconds: f64,
}

impl Clock {
    /// Of a run that did nothing else.
    pub fn new(source_seconds: f64, criterion_seconds: f64) -> Self {
        Self { source_seconds, criterion_seconds, total_seconds: source_seconds + criterion_seconds }
    }
}

/// Renders the quick noise-free reference of a source; `None` if it has none.
pub type RenderReference<S> = fn(&mut S) -> Result<Option<Reference>, SourceError>;

/// Drives a source until a criterion is satisfied.
///
/// ```
/// use noisefloor::{
///     Batch, Driver, DriverError, Event, FixedSpp, Params, ProgressiveSource, Request, SourceError, SourceInfo,
///     StopReason,
/// };
///
/// /// A renderer of a grey wall.
/// struct Wall;
/// impl ProgressiveSource for Wall {
///     fn info(&self) -> SourceInfo {
///         SourceInfo::new("wall", 64, 32)
///     }
///     fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
///         Ok(requests.iter().map(|r| Batch::new(r.tile, r.spp, vec![[0.2; 3]; r.tile.pixels()])).collect())
///     }
/// }
///
/// let params = Params::default().with_tile(32);
/// let mut driver = Driver::new(Wall, FixedSpp(304), params)?;
/// driver.run(|_session, event| if let Event::TileStopped(stop) = event { println!("{} {}", stop.tile.index, stop.spp) })?;
/// assert!(driver.session().stops().all(|stop| stop.spp == 304 && stop.reason == StopReason::ReachedSpp));
/// # Ok::<(), DriverError>(())
/// ```
pub struct Driver<S, C = Box<dyn StoppingCriterion + Send>> {
    source: S,
    session: Session<C>,
    reference: Option<RenderReference<S>>,
    time_limit: Option<Duration>,
    cancel: Arc<AtomicBool>,
    /// The last ones, for their memory.
    batches: Vec<Batch>,
    timeline: Vec<TimelinePoint>,
    clock: Clock,
    /// Samples in the film before the run.
    samples_before: u64,
    /// Seconds of the runs before.
    seconds_before: f64,
}

impl<S: ProgressiveSource, C: StoppingCriterion> Driver<S, C> {
    /// Combines a source and a criterion.
    ///
    /// # Errors
    /// [`DriverError::Session`] if a parameter or the source's image size is out of range,
    /// [`DriverError::Source`] if the source cannot read what it depends on.
    pub fn new(source: S, criterion: C, params: Params) -> Result<Self, DriverError> {
        let info = source.info();
        let mut session = Session::new(info.width, info.height, criterion, params)?;
        session.set_source(source.identity()?);
        session.set_pixels(info.pixels);
        if info.stratified {
            session.set_stratified();
        }
        session.set_linear();
        let cancel = Arc::new(AtomicBool::new(false));
        let (timeline, clock) = (Vec::new(), Clock::default());
        Ok(Self {
            source,
            session,
            reference: None,
            time_limit: None,
            cancel,
            batches: Vec::new(),
            timeline,
            clock,
            samples_before: 0,
            seconds_before: 0.0,
        })
    }

    /// Stops all tiles once a run has taken this long. A call to the source that is under way is finished
    /// first, and one call is made however short the time.
    pub fn set_time_limit(&mut self, limit: Option<Duration>) {
        self.time_limit = limit;
    }

    /// How the source renders a quick noise-free reference. A run begins with it if the criterion needs one
    /// ([`Needs::reference`](crate::criterion::Needs::reference)) and the session has none.
    pub fn set_reference(&mut self, render: RenderReference<S>) {
        self.reference = Some(render);
    }

    /// Setting this flag, from another thread or a signal handler, stops all tiles after the call under way.
    pub fn cancel_flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.cancel)
    }

    /// The session: film, stops, display.
    pub fn session(&self) -> &Session<C> {
        &self.session
    }

    /// The session, to fix its display before the run.
    pub fn session_mut(&mut self) -> &mut Session<C> {
        &mut self.session
    }

    /// The source, between two runs.
    pub fn source(&self) -> &S {
        &self.source
    }

    /// The source, to set it up before a run.
    pub fn source_mut(&mut self) -> &mut S {
        &mut self.source
    }

    /// One point a batch.
    pub fn timeline(&self) -> &[TimelinePoint] {
        &self.timeline
    }

    /// Where the time went.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// Runs until every tile is done. Whatever happens, all samples taken are in the film, and every tile has
    /// a stop.
    ///
    /// # Errors
    /// [`DriverError`] if source or criterion fail; open tiles are then stopped with [`StopReason::Failed`](crate::StopReason::Failed).
    pub fn run(&mut self, mut on_event: impl FnMut(&Session<C>, &Event)) -> Result<(), DriverError> {
        let outcome = self.run_until_done(&mut on_event);
        if outcome.is_err() {
            self.end_all(Interruption::Failed, &mut on_event);
        }
        outcome
    }

    fn run_until_done(&mut self, on_event: &mut impl FnMut(&Session<C>, &Event)) -> Result<(), DriverError> {
        let start = Instant::now();
        self.samples_before = self.session.film().total_samples();
        self.seconds_before = self.clock.total_seconds;
        if self.session.criterion().needs().reference && !self.session.has_reference() {
            self.fetch_reference(on_event)?;
        }
        while !self.session.is_done() {
            if self.cancel.load(Ordering::Relaxed) {
                self.end_all(Interruption::Cancelled, on_event);
                break;
            }
            // One call is made even so, so that repeated short runs finish.
            let begun = self.session.film().total_samples() > self.samples_before;
            if begun && self.time_limit.is_some_and(|limit| start.elapsed() >= limit) {
                self.end_all(Interruption::TimeLimit, on_event);
                break;
            }

            // Take samples where the criterion is not satisfied.
            let requests = self.plan();
            let began = Instant::now();
            // Nothing is missing where an earlier run failed to judge
            if !requests.is_empty() {
                self.source.sample_into(&requests, &mut self.batches)?;
            }
            self.clock.source_seconds += began.elapsed().as_secs_f64();
            let batches = std::mem::take(&mut self.batches);
            let exhausted = self.take(&requests, &batches)?;
            self.batches = batches;

            let mut stops = self.close_exhausted(&exhausted);

            // Judge when every tile has what it needs.
            let began = Instant::now();
            let judged = if self.session.is_round_complete() { self.session.judge() } else { Ok(Vec::new()) };
            self.clock.criterion_seconds += began.elapsed().as_secs_f64();
            self.clock.total_seconds = self.seconds_before + start.elapsed().as_secs_f64();
            // What is done is said, even if no verdict comes
            let failed = judged.map(|judged| stops.extend(judged)).err();
            self.report(stops, on_event);
            if let Some(error) = failed {
                return Err(error.into());
            }
        }
        self.clock.total_seconds = self.seconds_before + start.elapsed().as_secs_f64();
        Ok(())
    }

    fn fetch_reference(&mut self, on_event: &mut impl FnMut(&Session<C>, &Event)) -> Result<(), DriverError> {
        let began = Instant::now();
        let reference = self.reference.map_or(Ok(None), |render| render(&mut self.source))?;
        let seconds = began.elapsed().as_secs_f64();
        self.clock.source_seconds += seconds;
        let Some(reference) = reference else {
            return Err(CriterionError::NoReference(self.session.criterion().name()).into());
        };
        self.session.set_reference(reference)?;
        on_event(&self.session, &Event::ReferenceReady { seconds });
        Ok(())
    }

    /// The batches of one call: of the tiles with the fewest samples, as many as one call may ask for; of all
    /// tiles for a source that cannot aim.
    fn plan(&self) -> Vec<Request> {
        let mut requests = self.session.next_batches();
        if self.source.info().aims {
            keep_rearmost(&mut requests);
            return requests;
        }
        let film = self.session.film();
        let pixels = (film.grid().width() * film.grid().height()) as u64;
        let spp = requests.iter().map(|r| r.spp).max().unwrap_or(1).min((CALL_SAMPLES / pixels).max(1));
        film.grid().tiles().map(|tile| film.request(tile.index, spp)).collect()
    }

    /// Ends the tiles of which the source has no more, unless they have enough for a verdict.
    fn close_exhausted(&mut self, tiles: &[usize]) -> Vec<Stop> {
        let close = |&tile: &usize| match self.session.is_due(tile) {
            true => None,
            false => self.session.close(tile, Interruption::SourceExhausted),
        };
        tiles.iter().filter_map(close).collect()
    }

    /// Files the batches of one call; returns the tiles that have no more.
    fn take(&mut self, requests: &[Request], batches: &[Batch]) -> Result<Vec<usize>, DriverError> {
        let broken = |what| SourceError::Contract { name: self.source.info().name, what };
        let batches = if requests.is_empty() { &[] } else { batches };
        if batches.len() != requests.len() {
            let what = format!("{} batches for {} requests", batches.len(), requests.len());
            return Err(broken(what).into());
        }
        let mut exhausted = Vec::new();
        for (request, batch) in requests.iter().zip(batches) {
            if batch.tile != request.tile {
                let what = format!("a batch of tile {} for tile {}", batch.tile.index, request.tile.index);
                return Err(broken(what).into());
            }
            if batch.spp > self.source.info().counts.most(request.spp) {
                let (tile, asked) = (batch.tile.index, request.spp);
                let what = format!("{} samples where {asked} were asked for, in tile {tile}", batch.spp);
                return Err(broken(what).into());
            }
            if batch.spp == 0 {
                exhausted.push(batch.tile.index);
                continue;
            }
            let pushed = self.session.push(batch.tile.index, batch.spp, &batch.mean);
            match pushed {
                Ok(()) => {}
                Err(SessionError::Film(error @ FilmError::Pixels { .. })) => {
                    return Err(broken(error.to_string()).into());
                }
                Err(SessionError::Fault(Fault::Light { tile, light })) => {
                    return Err(broken(format!("in tile {tile}, {light}")).into());
                }
                Err(error) => return Err(error.into()),
            }
        }
        Ok(exhausted)
    }

    fn report(&mut self, stops: Vec<Stop>, on_event: &mut impl FnMut(&Session<C>, &Event)) {
        let now = TimelinePoint {
            seconds: self.clock.total_seconds,
            samples: self.session.film().total_samples(),
            active_tiles: self.session.open_tiles(),
        };
        self.timeline.push(now);
        let seconds_a_sample =
            (now.seconds - self.seconds_before) / (now.samples - self.samples_before).max(1) as f64;
        let eta_seconds = self.session.expected_samples_to_go().map(|n| n as f64 * seconds_a_sample);
        let tiles = self.session.film().grid().len();
        on_event(&self.session, &Event::BatchDone(Progress { now, tiles, eta_seconds }));
        for stop in stops {
            on_event(&self.session, &Event::TileStopped(stop));
        }
    }

    fn end_all(&mut self, reason: Interruption, on_event: &mut impl FnMut(&Session<C>, &Event)) {
        for stop in self.session.close_all(reason) {
            on_event(&self.session, &Event::TileStopped(stop));
        }
    }

    /// Resumes an interrupted run of the same job; see [`Session::resume`]. The picture and every decision
    /// are then those of a run that was not interrupted, to the bit.
    ///
    /// # Errors
    /// [`CheckpointError`] as in [`Session::resume`], and [`CheckpointError::Source`] if the source does not
    /// promise to repeat its samples ([`Repeats::Samples`]): it could return samples that the film already
    /// has.
    #[cfg(feature = "files")]
    pub fn resume(mut self, job: &str, checkpoint: Checkpoint<'_>) -> Result<Self, CheckpointError> {
        let info = self.source.info();
        if info.repeats != Repeats::Samples {
            return Err(CheckpointError::Source(info.name));
        }
        self.session = self.session.resume(job, checkpoint)?;
        Ok(self)
    }
}

/// Keeps as many of the tiles furthest behind as a call has room for, one at least.
fn keep_rearmost(requests: &mut Vec<Request>) {
    requests.sort_by_key(|request| request.first);
    let mut samples = 0;
    let count = requests.iter().take_while(|request| {
        samples += request.spp * request.tile.pixels() as u64;
        samples <= CALL_SAMPLES
    });
    let count = count.count();
    requests.truncate(count.max(1));
    requests.sort_by_key(|request| request.tile.index);
}

#[cfg(test)]
mod tests;
