//! The loop, pulled: a session that asks a source for samples until the criterion is satisfied or a limit says stop.

use crate::checkpoint::{Checkpoint, CheckpointError};
use crate::criterion::{CriterionError, StoppingCriterion};
use crate::film::FilmError;
use crate::params::Params;
use crate::session::{Session, SessionError, Stop, StopReason};
use crate::source::{Batch, ProgressiveSource, Repeats, Request, SourceError};
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};
use thiserror::Error;

/// Most pixel samples asked for in one call: a second or so of a fast renderer, so that cancelling, the time limit and progress
/// are prompt. A constant, and not a time: the same batches on every machine.
const CALL_SAMPLES: u64 = 1 << 22;

/// What can go wrong in a run. All samples up to then are in the session's film.
#[derive(Debug, Error)]
pub enum DriverError {
    /// The session could not start.
    #[error(transparent)]
    Session(#[from] SessionError),
    /// The source failed.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// The criterion does not fit.
    #[error(transparent)]
    Criterion(#[from] CriterionError),
}

/// One point of a run's history.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimelinePoint {
    /// Seconds since the run began.
    pub seconds: f64,
    /// Samples so far, over all pixels.
    pub samples: u64,
    /// Tiles not yet done.
    pub active_tiles: usize,
}

/// What happens in a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// The quick reference is there.
    ReferenceReady {
        /// Seconds it took.
        seconds: f64,
    },
    /// A batch is in the film.
    BatchDone(Progress),
    /// A tile is done.
    TileStopped(Stop),
}

/// How far a run is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Time, samples and open tiles.
    pub now: TimelinePoint,
    /// All tiles.
    pub tiles: usize,
    /// Seconds to go, as the criterion expects it; `None` while it cannot tell.
    pub eta_seconds: Option<f64>,
}

/// Where the time of a run went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Clock {
    /// Seconds in the source, its reference included.
    pub source_seconds: f64,
    /// Seconds in the criterion, with all it needs: tone mapping, masks, descriptors.
    pub criterion_seconds: f64,
    /// Seconds in all.
    pub total_seconds: f64,
}

/// Drives a source until a criterion is satisfied.
///
/// ```
/// use noisefloor::*;
///
/// /// A renderer of a grey wall.
/// struct Wall;
/// impl ProgressiveSource for Wall {
///     fn info(&self) -> SourceInfo {
///         SourceInfo { name: "wall".into(), width: 64, height: 32, unit: Unit::SamplesPerPixel, aims: true, repeats: Repeats::Samples }
///     }
///     fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
///         Ok(requests.iter().map(|r| Batch { tile: r.tile, samples: r.samples, mean: vec![[0.2; 3]; r.tile.pixels()] }).collect())
///     }
/// }
///
/// let params = Params { tile: 32, ..Params::default() };
/// let mut driver = Driver::new(Wall, FixedSamples(300), params)?;
/// driver.run(|_session, event| if let Event::TileStopped(stop) = event { println!("{} {}", stop.tile.index, stop.samples) })?;
/// assert!(driver.session().stops().all(|stop| stop.samples == 300 && stop.reason == StopReason::Converged));
/// # Ok::<(), DriverError>(())
/// ```
pub struct Driver<S, C> {
    source: S,
    session: Session<C>,
    time_limit: Option<Duration>,
    cancel: Arc<AtomicBool>,
    timeline: Vec<TimelinePoint>,
    clock: Clock,
    /// Samples that were there before the run.
    samples_before: u64,
}

impl<S: ProgressiveSource, C: StoppingCriterion> Driver<S, C> {
    /// Puts a source and a criterion together.
    ///
    /// # Errors
    /// [`DriverError::Session`] if a parameter or the source's image size is out of range.
    pub fn new(source: S, criterion: C, params: Params) -> Result<Self, DriverError> {
        let info = source.info();
        let session = Session::new(info.width, info.height, criterion, params)?;
        let cancel = Arc::new(AtomicBool::new(false));
        let (timeline, clock) = (Vec::new(), Clock::default());
        Ok(Self { source, session, time_limit: None, cancel, timeline, clock, samples_before: 0 })
    }

    /// Goes on with a run of the same job that was broken off; see [`Session::resume`]. The picture and every decision are then those of a
    /// run that was not, to the bit.
    ///
    /// # Errors
    /// [`CheckpointError`] as of [`Session::resume`], and if the source does not promise to repeat its samples ([`Repeats::Samples`]):
    /// what it takes for new could be what the film has already.
    pub fn resume(mut self, job: &str, checkpoint: Checkpoint<'_>) -> Result<Self, CheckpointError> {
        let info = self.source.info();
        if info.repeats != Repeats::Samples {
            return Err(CheckpointError::Source(info.name));
        }
        self.session = self.session.resume(job, checkpoint)?;
        Ok(self)
    }

    /// Stops all tiles once a run has taken so long. A call to the source that has begun is finished first.
    pub fn set_time_limit(&mut self, limit: Option<Duration>) {
        self.time_limit = limit;
    }

    /// Setting this flag, from another thread or a signal handler, stops all tiles after the call that has begun.
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

    /// Takes the driver apart: the source as the run left it, and the session.
    pub fn into_parts(self) -> (S, Session<C>) {
        (self.source, self.session)
    }

    /// One point a batch.
    pub fn timeline(&self) -> &[TimelinePoint] {
        &self.timeline
    }

    /// Where the time went.
    pub fn clock(&self) -> Clock {
        self.clock
    }

    /// Runs until every tile is done. Whatever happens, all samples taken are in the film, and every tile has a stop.
    ///
    /// # Errors
    /// [`DriverError`] if source or criterion fail; open tiles are then stopped with [`StopReason::Failed`].
    pub fn run(&mut self, mut on_event: impl FnMut(&Session<C>, &Event)) -> Result<(), DriverError> {
        let outcome = self.run_until_done(&mut on_event);
        if outcome.is_err() {
            self.end_all(StopReason::Failed, &mut on_event);
        }
        outcome
    }

    fn run_until_done(&mut self, on_event: &mut impl FnMut(&Session<C>, &Event)) -> Result<(), DriverError> {
        let start = Instant::now();
        self.samples_before = self.session.film().total_samples();
        if self.session.criterion().needs().reference {
            self.fetch_reference(on_event)?;
        }
        while !self.session.is_done() {
            // Limits come first, so that a run with no time left takes no samples.
            if self.cancel.load(Ordering::Relaxed) {
                self.end_all(StopReason::Cancelled, on_event);
                break;
            }
            if self.time_limit.is_some_and(|limit| start.elapsed() >= limit) {
                self.end_all(StopReason::TimeLimit, on_event);
                break;
            }

            // Take samples where the criterion is not satisfied.
            let requests = self.plan();
            let began = Instant::now();
            let batches = self.source.sample(&requests)?;
            self.clock.source_seconds += began.elapsed().as_secs_f64();
            let exhausted = self.take(&requests, batches)?;

            // Judge what is due.
            let began = Instant::now();
            let mut stops = self.session.judge()?;
            self.clock.criterion_seconds += began.elapsed().as_secs_f64();
            stops.extend(
                exhausted
                    .into_iter()
                    .filter_map(|tile| self.session.close(tile, StopReason::SourceExhausted)),
            );
            self.clock.total_seconds = start.elapsed().as_secs_f64();
            self.report(stops, on_event);
        }
        self.clock.total_seconds = start.elapsed().as_secs_f64();
        Ok(())
    }

    fn fetch_reference(&mut self, on_event: &mut impl FnMut(&Session<C>, &Event)) -> Result<(), DriverError> {
        let began = Instant::now();
        let reference = self.source.reference()?;
        let seconds = began.elapsed().as_secs_f64();
        self.clock.source_seconds += seconds;
        let Some(reference) = reference else {
            return Err(CriterionError::NoReference(self.session.criterion().name()).into());
        };
        self.session.set_reference(reference)?;
        on_event(&self.session, &Event::ReferenceReady { seconds });
        Ok(())
    }

    /// The session's requests, cut to what one call may ask for; all tiles for a source that cannot aim.
    fn plan(&self) -> Vec<Request> {
        let mut requests = self.session.requests();
        if !self.source.info().aims {
            let samples = requests.iter().map(|r| r.samples).max().unwrap_or(1);
            let film = self.session.film();
            requests = film
                .grid()
                .tiles()
                .map(|tile| Request { tile, first: film.samples(tile.index), samples })
                .collect();
        }
        let pixels: u64 = requests.iter().map(|r| r.tile.pixels() as u64).sum();
        let most = u32::try_from(CALL_SAMPLES / pixels.max(1)).unwrap_or(u32::MAX).max(1);
        requests.iter_mut().for_each(|r| r.samples = r.samples.min(most));
        requests
    }

    /// Files the batches of one call; returns the tiles that have no more.
    fn take(&mut self, requests: &[Request], batches: Vec<Batch>) -> Result<Vec<usize>, DriverError> {
        let broken = |what| SourceError::Contract { name: self.source.info().name, what };
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
            if batch.samples == 0 {
                exhausted.push(batch.tile.index);
                continue;
            }
            match self.session.push(batch.tile.index, batch.samples, &batch.mean) {
                Ok(()) => {}
                Err(error @ FilmError::Pixels { .. }) => return Err(broken(error.to_string()).into()),
                Err(error) => return Err(SessionError::from(error).into()),
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
        let seconds_a_sample = now.seconds / (now.samples - self.samples_before).max(1) as f64;
        let eta_seconds = self.session.expected_samples_to_go().map(|n| n as f64 * seconds_a_sample);
        let tiles = self.session.film().grid().len();
        on_event(&self.session, &Event::BatchDone(Progress { now, tiles, eta_seconds }));
        for stop in stops {
            on_event(&self.session, &Event::TileStopped(stop));
        }
    }

    fn end_all(&mut self, reason: StopReason, on_event: &mut impl FnMut(&Session<C>, &Event)) {
        for stop in self.session.close_all(reason) {
            on_event(&self.session, &Event::TileStopped(stop));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::criterion::{FixedSamples, Needs, Verdict, View};
    use crate::source::{Repeats, SourceInfo, Unit};
    use crate::tile::Tile;

    /// A grey source that can be told to misbehave.
    #[derive(Default)]
    struct Grey {
        cannot_aim: bool,
        /// Samples per pixel it has in store; 0 for no end.
        store: u64,
        fail_after: Option<usize>,
        lie: Option<fn(Vec<Batch>) -> Vec<Batch>>,
        calls: Vec<Vec<Request>>,
    }

    impl ProgressiveSource for Grey {
        fn info(&self) -> SourceInfo {
            let unit = Unit::SamplesPerPixel;
            SourceInfo {
                name: "grey".into(),
                width: 70,
                height: 32,
                unit,
                aims: !self.cannot_aim,
                repeats: Repeats::Samples,
            }
        }

        fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
            if self.fail_after.is_some_and(|calls| self.calls.len() >= calls) {
                return Err(SourceError::Failed {
                    name: "grey".into(),
                    tile: Some(1),
                    cause: "lamp broke".into(),
                });
            }
            self.calls.push(requests.to_vec());
            let batch = |r: &Request| {
                let left = if self.store == 0 { u64::MAX } else { self.store.saturating_sub(r.first) };
                let samples = u64::from(r.samples).min(left) as u32;
                let mean = if samples == 0 { vec![] } else { vec![[0.5; 3]; r.tile.pixels()] };
                Batch { tile: r.tile, samples, mean }
            };
            let batches = requests.iter().map(batch).collect();
            Ok(self.lie.map_or_else(|| Vec::clone(&batches), |lie| lie(batches.clone())))
        }
    }

    fn driver(source: Grey, samples: u64) -> Driver<Grey, FixedSamples> {
        Driver::new(source, FixedSamples(samples), Params { tile: 32, ..Params::default() }).unwrap()
    }

    fn reasons<C: StoppingCriterion>(driver: &Driver<Grey, C>) -> Vec<(u64, StopReason)> {
        driver.session().stops().map(|s| (s.samples, s.reason)).collect()
    }

    #[test]
    fn events_and_timeline_tell_the_whole_run() {
        let mut driver = driver(Grey::default(), 300);
        let (mut stops, mut batches) = (0, 0);
        driver
            .run(|session, event| match event {
                Event::TileStopped(stop) => {
                    stops += 1;
                    assert_eq!(stop.samples, session.film().samples(stop.tile.index));
                }
                Event::BatchDone(progress) => {
                    batches += 1;
                    assert!(
                        progress.tiles == 3
                            && (progress.now.active_tiles == 0 || progress.eta_seconds.is_some())
                    );
                }
                Event::ReferenceReady { .. } => panic!("nobody needs one"),
            })
            .unwrap();
        assert_eq!((stops, batches), (3, driver.timeline().len()));
        assert_eq!(driver.timeline().last().unwrap().samples, 300 * 70 * 32);
        assert!(driver.timeline().is_sorted_by_key(|p| p.samples));
        let clock = driver.clock();
        assert!(clock.source_seconds + clock.criterion_seconds <= clock.total_seconds);
    }

    #[test]
    fn a_source_that_cannot_aim_is_asked_for_all_tiles() {
        let mut driver = driver(Grey { cannot_aim: true, ..Grey::default() }, 200);
        driver.run(|_, _| ()).unwrap();
        assert!(driver.source.calls.iter().all(|c| c.len() == 3));
    }

    #[test]
    fn the_end_of_a_playback_is_a_reason() {
        let mut driver = driver(Grey { store: 250, ..Grey::default() }, 1000);
        driver.run(|_, _| ()).unwrap();
        assert_eq!(reasons(&driver), [(250, StopReason::SourceExhausted); 3]);
    }

    #[test]
    fn limits_stop_and_keep_what_is_there() {
        let mut limited = driver(Grey::default(), 10_000);
        limited.set_time_limit(Some(Duration::ZERO));
        limited.run(|_, _| ()).unwrap();
        assert_eq!(reasons(&limited), [(0, StopReason::TimeLimit); 3]);

        let mut cancelled = driver(Grey::default(), 10_000);
        let flag = cancelled.cancel_flag();
        cancelled
            .run(|_, event| {
                if matches!(event, Event::BatchDone(_)) {
                    flag.store(true, Ordering::Relaxed)
                }
            })
            .unwrap();
        assert_eq!(reasons(&cancelled), [(100, StopReason::Cancelled); 3]);
    }

    #[test]
    fn a_failure_keeps_what_is_there() {
        let mut driver = driver(Grey { fail_after: Some(2), ..Grey::default() }, 10_000);
        let error = driver.run(|_, _| ()).unwrap_err();
        assert!(error.to_string().contains("grey: sampling failed in tile 1"), "{error}");
        assert_eq!(reasons(&driver), [(200, StopReason::Failed); 3]);
    }

    #[test]
    fn broken_promises_are_typed_errors() {
        let lies: [fn(Vec<Batch>) -> Vec<Batch>; 3] = [
            |mut b| {
                b.pop();
                b
            },
            |mut b| {
                b.swap(0, 1);
                b
            },
            |mut b| {
                b[0].mean.pop();
                b
            },
        ];
        for lie in lies {
            let error = driver(Grey { lie: Some(lie), ..Grey::default() }, 100).run(|_, _| ()).unwrap_err();
            assert!(matches!(error, DriverError::Source(SourceError::Contract { .. })), "{error}");
        }
    }

    struct Picky;

    impl StoppingCriterion for Picky {
        fn name(&self) -> String {
            "picky".into()
        }

        fn needs(&self) -> Needs {
            Needs { halves: false, reference: true }
        }

        fn judge(&mut self, _: &View<'_>, _: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
            Ok(vec![])
        }
    }

    #[test]
    fn a_missing_reference_is_an_error_before_any_sample() {
        let mut driver =
            Driver::new(Grey::default(), Picky, Params { tile: 32, ..Params::default() }).unwrap();
        let error = driver.run(|_, _| ()).unwrap_err();
        assert!(matches!(error, DriverError::Criterion(CriterionError::NoReference(_))));
        assert!(driver.source.calls.is_empty());
    }
}
