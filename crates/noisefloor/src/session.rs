//! The loop, pushed: for a renderer that owns its own.

use crate::checkpoint::{Checkpoint, CheckpointError};
use crate::criterion::{CriterionError, StoppingCriterion, Verdict, View};
use crate::display::{Display, ToneMapping};
use crate::film::{Film, FilmError};
use crate::params::{Audience, Params, ParamsError};
use crate::source::{Reference, Request, Rgb};
use crate::tile::{Tile, TileError, TileGrid};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::fmt;
use thiserror::Error;

/// Why a tile gets no more samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StopReason {
    /// The criterion is satisfied.
    Converged,
    /// The largest number of samples was reached first.
    MaxSamples,
    /// Time was up.
    TimeLimit,
    /// Somebody cancelled.
    Cancelled,
    /// The source has no more samples (a playback came to its end).
    SourceExhausted,
    /// The source or the criterion failed.
    Failed,
}

impl fmt::Display for StopReason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Converged => "converged",
            Self::MaxSamples => "max-samples",
            Self::TimeLimit => "time-limit",
            Self::Cancelled => "cancelled",
            Self::SourceExhausted => "source-exhausted",
            Self::Failed => "failed",
        })
    }
}

/// A tile that is done.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Stop {
    /// The tile.
    pub tile: Tile,
    /// Samples per pixel when it stopped.
    pub samples: u64,
    /// Probability, at the last verdict, that an observer sees no difference; `None` if never judged or not offered.
    pub probability: Option<f32>,
    /// Why.
    pub reason: StopReason,
    /// Whether the last verdict said that the tile is unlike anything the criterion was made for.
    pub unfamiliar: bool,
}

/// What can go wrong in a session.
#[derive(Debug, Error)]
pub enum SessionError {
    /// A parameter out of range.
    #[error(transparent)]
    Params(#[from] ParamsError),
    /// An image or tile size out of range.
    #[error(transparent)]
    Tile(#[from] TileError),
    /// A batch that does not fit.
    #[error(transparent)]
    Film(#[from] FilmError),
    /// A criterion that does not fit.
    #[error(transparent)]
    Criterion(#[from] CriterionError),
    /// A reference of another size than the image.
    #[error("the reference has {got} pixels, the image {expected}")]
    Reference {
        /// Pixels of the reference.
        got: usize,
        /// Pixels of the image.
        expected: usize,
    },
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(crate) struct TileState {
    /// Judge at this many samples.
    pub(crate) next: u64,
    /// Verdicts in a row that said "converged".
    pub(crate) streak: u32,
    verdict: Option<Verdict>,
    /// Converged for the trained audience; this audience wants so many.
    pub(crate) target: Option<u64>,
    pub(crate) stop: Option<Stop>,
}

/// Film, criterion and limits, for a renderer that owns its loop: it pushes batches, asks which tiles are open and how much
/// each deserves, and stops when none is.
///
/// ```
/// use noisefloor::{FixedSamples, Params, Session};
///
/// let mut session = Session::new(640, 360, FixedSamples(200), Params::default())?;
/// while !session.is_done() {
///     for request in session.requests() {
///         // Your renderer: the mean of `request.samples` new samples of each pixel of the tile.
///         let mean = vec![[0.5; 3]; request.tile.pixels()];
///         session.push(request.tile.index, request.samples, &mean)?;
///     }
///     session.judge()?;
/// }
/// assert!(session.stops().all(|stop| stop.samples == 200));
/// # Ok::<(), noisefloor::SessionError>(())
/// ```
pub struct Session<C> {
    film: Film,
    criterion: C,
    params: Params,
    display: Option<Display>,
    reference: Option<Reference>,
    /// The reference as it is displayed, once the display is settled.
    displayed_reference: Option<Vec<Rgb>>,
    tiles: Vec<TileState>,
}

impl<C: StoppingCriterion> Session<C> {
    /// Starts a session for an image of `width`×`height` pixels.
    ///
    /// # Errors
    /// [`SessionError`] if a parameter or the size is out of range.
    pub fn new(width: usize, height: usize, criterion: C, params: Params) -> Result<Self, SessionError> {
        params.check()?;
        let grid = TileGrid::new(width, height, params.tile)?;
        let film = if criterion.needs().halves { Film::new(grid) } else { Film::without_halves(grid) };
        let first = params.schedule.next(params.min_samples.saturating_sub(1), None).min(params.max_samples);
        let tile = TileState { next: first, streak: 0, verdict: None, target: None, stop: None };
        let tiles = vec![tile; grid.len()];
        // Plain sRGB does not depend on the picture; an exposure by log-average has to wait for one.
        let display = match params.tone_mapping {
            ToneMapping::Srgb { .. } => Some(params.tone_mapping.settle(&[])),
            ToneMapping::Reinhard { .. } => None,
        };
        Ok(Self { film, criterion, params, display, reference: None, displayed_reference: None, tiles })
    }

    /// The film.
    pub fn film(&self) -> &Film {
        &self.film
    }

    /// The criterion.
    pub fn criterion(&self) -> &C {
        &self.criterion
    }

    /// The parameters.
    pub fn params(&self) -> &Params {
        &self.params
    }

    /// The frozen way to the screen; `None` until it has settled.
    pub fn display(&self) -> Option<&Display> {
        self.display.as_ref()
    }

    /// Fixes the way to the screen before it settles by itself, for renderers that have an exposure of their own or finish one
    /// tile before they start the next.
    pub fn set_display(&mut self, display: Display) {
        self.display = Some(display);
        self.displayed_reference = None;
    }

    /// Hands over the quick noise-free reference, for criteria that need one.
    ///
    /// # Errors
    /// [`SessionError::Reference`] if its size is not the image's.
    pub fn set_reference(&mut self, reference: Reference) -> Result<(), SessionError> {
        let grid = self.film.grid();
        let expected = grid.width() * grid.height();
        let fits = (reference.width, reference.height) == (grid.width(), grid.height());
        if !fits || reference.pixels.len() != expected {
            return Err(SessionError::Reference { got: reference.pixels.len(), expected });
        }
        self.reference = Some(reference);
        self.displayed_reference = None;
        Ok(())
    }

    /// What the open tiles deserve now. Empty when all are done. Where halves are kept, requests fill one half at a time, so
    /// that the two stay even.
    pub fn requests(&self) -> Vec<Request> {
        let wish = |(index, state): (usize, &TileState)| {
            if state.stop.is_some() {
                return None;
            }
            let first = self.film.samples(index);
            let goal = state.target.unwrap_or(state.next);
            let wanted = if self.film.has_halves() {
                let [a, b] = self.film.half_counts(index);
                goal.div_ceil(2).saturating_sub(a.min(b)).min(goal.saturating_sub(first))
            } else {
                goal.saturating_sub(first)
            };
            let samples = u32::try_from(wanted.max(1)).unwrap_or(u32::MAX);
            Some(Request { tile: self.film.grid().tile(index), first, samples })
        };
        self.tiles.iter().enumerate().filter_map(wish).collect()
    }

    /// Adds the mean of `samples` new samples of a tile, row-major over the tile. Tiles that are done take samples too: they
    /// get better, and keep their stop.
    ///
    /// # Errors
    /// [`FilmError`] if it does not fit; nothing is changed then.
    pub fn push(&mut self, tile: usize, samples: u32, mean: &[Rgb]) -> Result<(), FilmError> {
        self.film.add(tile, samples, mean)
    }

    /// Adds what is new in a running mean of `total` samples of a tile; see [`Film::add_running`].
    ///
    /// # Errors
    /// [`FilmError`] if it does not fit; nothing is changed then.
    pub fn push_running(&mut self, tile: usize, total: u64, mean: &[Rgb]) -> Result<(), FilmError> {
        self.film.add_running(tile, total, mean)
    }

    /// Judges the tiles that are due, and returns those that are done by it.
    ///
    /// The first verdicts wait until every open tile has samples: the exposure is settled then, once and for all, unless the tone
    /// mapping is plain sRGB or [`Session::set_display`] was called.
    ///
    /// # Errors
    /// [`CriterionError`] if the criterion does not fit the job.
    pub fn judge(&mut self) -> Result<Vec<Stop>, CriterionError> {
        let due: Vec<Tile> = self.film.grid().tiles().filter(|t| self.is_due(t.index)).collect();
        if due.is_empty() || !self.settle_display() {
            return Ok(Vec::new());
        }
        let (judged, waited): (Vec<Tile>, Vec<Tile>) =
            due.into_iter().partition(|t| self.tiles[t.index].target.is_none());

        // Tiles that had converged for the trained audience have now what this audience wants.
        let mut stops: Vec<Stop> =
            waited.iter().map(|t| self.stop(t.index, self.audience_reason(t.index))).collect();

        // Ask the criterion for the others.
        if !judged.is_empty() {
            let Some(display) = &self.display else { return Ok(stops) };
            let view = View { film: &self.film, display, reference: self.displayed_reference.as_deref() };
            let verdicts = self.criterion.judge(&view, &judged)?;
            for (tile, verdict) in judged.into_iter().zip(verdicts) {
                stops.extend(self.take(tile.index, verdict));
            }
        }
        Ok(stops)
    }

    /// Whether a tile has what its next verdict needs.
    fn is_due(&self, index: usize) -> bool {
        let state = &self.tiles[index];
        let has_halves = !self.film.has_halves() || self.film.half_counts(index).iter().all(|&n| n > 0);
        state.stop.is_none() && has_halves && self.film.samples(index) >= state.target.unwrap_or(state.next)
    }

    /// Settles exposure and reference; false if it is too early.
    fn settle_display(&mut self) -> bool {
        if self.display.is_none() {
            // A tile that is done without samples has none to wait for.
            let waits = |(t, state): (usize, &TileState)| state.stop.is_none() && self.film.samples(t) == 0;
            if self.tiles.iter().enumerate().any(waits) {
                return false;
            }
            self.display = Some(self.params.tone_mapping.settle(&self.film.image()));
        }
        if let (Some(display), Some(reference), None) =
            (&self.display, &self.reference, &self.displayed_reference)
        {
            self.displayed_reference = Some(reference.pixels.iter().map(|&p| display.encode(p)).collect());
        }
        true
    }

    /// Files one verdict; returns the stop if the tile is done by it.
    fn take(&mut self, index: usize, verdict: Verdict) -> Option<Stop> {
        let samples = self.film.samples(index);
        let Params { schedule, consecutive, max_samples, .. } = self.params;
        let audience = self.audience();
        let state = &mut self.tiles[index];
        state.verdict = Some(verdict);
        state.streak = if verdict.converged { state.streak + 1 } else { 0 };
        if state.streak >= consecutive {
            let target = audience.samples(samples);
            if target <= samples {
                return Some(self.stop(index, StopReason::Converged));
            }
            state.target = Some(target.min(max_samples).max(samples + 1));
        }
        if samples >= max_samples {
            return Some(self.stop(index, StopReason::MaxSamples));
        }
        state.next = schedule.next(samples, verdict.expected_samples).min(max_samples);
        None
    }

    /// The line from the thresholds of the training data to those wanted.
    fn audience(&self) -> Audience {
        self.criterion.audience().then(self.params.audience)
    }

    /// Whether an audience's wish was granted or cut short by the limit.
    fn audience_reason(&self, index: usize) -> StopReason {
        let at_limit = self.film.samples(index) >= self.params.max_samples;
        if at_limit { StopReason::MaxSamples } else { StopReason::Converged }
    }

    fn stop(&mut self, index: usize, reason: StopReason) -> Stop {
        let state = &mut self.tiles[index];
        let stop = Stop {
            tile: self.film.grid().tile(index),
            samples: self.film.samples(index),
            probability: state.verdict.and_then(|v| v.probability),
            reason,
            unfamiliar: state.verdict.is_some_and(|v| v.unfamiliar),
        };
        *state.stop.insert(stop)
    }

    /// Ends one tile for a reason of the caller's. Does nothing if it is done already.
    ///
    /// # Panics
    /// If the tile does not exist.
    pub fn close(&mut self, tile: usize, reason: StopReason) -> Option<Stop> {
        self.tiles[tile].stop.is_none().then(|| self.stop(tile, reason))
    }

    /// Ends every open tile for a reason of the caller's, and returns them.
    pub fn close_all(&mut self, reason: StopReason) -> Vec<Stop> {
        (0..self.tiles.len()).filter_map(|tile| self.close(tile, reason)).collect()
    }

    /// Whether a tile is not done.
    ///
    /// # Panics
    /// If the tile does not exist.
    pub fn is_open(&self, tile: usize) -> bool {
        self.tiles[tile].stop.is_none()
    }

    /// Whether every tile is done.
    pub fn is_done(&self) -> bool {
        self.open_tiles() == 0
    }

    /// Number of tiles that are not done.
    pub fn open_tiles(&self) -> usize {
        self.tiles.iter().filter(|t| t.stop.is_none()).count()
    }

    /// The tiles that are done, in row-major order.
    pub fn stops(&self) -> impl Iterator<Item = Stop> {
        self.tiles.iter().filter_map(|t| t.stop)
    }

    /// The last verdict on a tile.
    ///
    /// # Panics
    /// If the tile does not exist.
    pub fn verdict(&self, tile: usize) -> Option<Verdict> {
        self.tiles[tile].verdict
    }

    /// How visible the noise is at each pixel of the image, row-major, in 8-bit display steps (see [`crate::Descriptor::visible_noise`]);
    /// NaN where there is no evidence. Computed at each call. `None` before the display has settled, and if the criterion cannot say.
    pub fn visible_noise(&self) -> Option<Vec<f32>> {
        let reference = self.displayed_reference.as_deref();
        self.criterion.visible_noise(&View { film: &self.film, display: self.display.as_ref()?, reference })
    }

    /// Samples still to be taken, over all pixels, as the criterion expects it; `None` while any open tile is without an
    /// expectation.
    pub fn expected_samples_to_go(&self) -> Option<u64> {
        let (max, audience) = (self.params.max_samples, self.audience());
        self.tiles.iter().enumerate().filter(|(_, state)| state.stop.is_none()).try_fold(
            0,
            |sum, (index, state)| {
                let expected = match state.target {
                    Some(target) => target,
                    None => audience.samples(state.verdict?.expected_samples?),
                };
                let goal = expected.clamp(state.next.min(max), max);
                let pixels = self.film.grid().tile(index).pixels() as u64;
                Some(sum + goal.saturating_sub(self.film.samples(index)) * pixels)
            },
        )
    }

    /// All that the session has come to, to go on with later. `job` is what the caller knows the job by: scene, seed, options.
    pub fn checkpoint<'a>(&'a self, job: &'a str) -> Checkpoint<'a> {
        Checkpoint {
            job: job.into(),
            criterion: self.criterion.name(),
            state: self.criterion.state(),
            params: self.params,
            display: self.display,
            film: Cow::Borrowed(&self.film),
            tiles: Cow::Borrowed(&self.tiles),
        }
    }

    /// Goes on where another session of the same job stood, instead of where this one does. Tiles that a limit or a failure had ended are
    /// open again; those that have converged, or have as many samples as are allowed, are not.
    ///
    /// The session goes on to the bit, if what is pushed is the same, and the criterion keeps no state of its own but what
    /// [`StoppingCriterion::state`] gives, as [`crate::Oracle`] and [`crate::FixedSamples`] do.
    ///
    /// # Errors
    /// [`CheckpointError`] if job, criterion, parameters or image size are not those of the checkpoint, or it does not hold together.
    pub fn resume(mut self, job: &str, checkpoint: Checkpoint<'_>) -> Result<Self, CheckpointError> {
        checkpoint.check(job, &self.criterion.name(), &self.params, &self.film)?;
        if !self.criterion.restore(self.film.grid(), &checkpoint.state) {
            return Err(CheckpointError::Invalid("what its criterion kept is not that"));
        }
        let mut tiles = checkpoint.tiles.into_owned();
        for state in &mut tiles {
            let done = |stop: &Stop| matches!(stop.reason, StopReason::Converged | StopReason::MaxSamples);
            state.stop = state.stop.filter(done);
        }
        let film = checkpoint.film.into_owned();
        Ok(Self { film, tiles, display: checkpoint.display, displayed_reference: None, ..self })
    }

    /// Takes the session apart: film, and the display if it has settled.
    pub fn into_film(self) -> (Film, Option<Display>) {
        (self.film, self.display)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::criterion::Needs;
    use crate::params::Schedule;

    /// Says "converged" from given samples on, with halves or without.
    struct From {
        samples: u64,
        halves: bool,
        asked: Vec<(usize, u64)>,
    }

    impl StoppingCriterion for From {
        fn name(&self) -> String {
            "from".into()
        }

        fn needs(&self) -> Needs {
            Needs { halves: self.halves, reference: false }
        }

        fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
            let verdict = |tile: &Tile| {
                let samples = view.film.samples(tile.index);
                self.asked.push((tile.index, samples));
                // Tiles further on need more.
                let enough = self.samples * (tile.index as u64 + 1);
                Verdict {
                    converged: samples >= enough,
                    probability: Some(0.5),
                    expected_samples: Some(enough),
                    unfamiliar: tile.index == 1,
                }
            };
            Ok(tiles.iter().map(verdict).collect())
        }
    }

    fn session(samples: u64, halves: bool, params: Params) -> Session<From> {
        Session::new(70, 32, From { samples, halves, asked: vec![] }, Params { tile: 32, ..params }).unwrap()
    }

    fn run(session: &mut Session<From>) -> Vec<(u64, StopReason)> {
        while !session.is_done() {
            for r in session.requests() {
                assert_eq!(r.first, session.film().samples(r.tile.index));
                session.push(r.tile.index, r.samples, &vec![[0.3; 3]; r.tile.pixels()]).unwrap();
            }
            session.judge().unwrap();
        }
        session.stops().map(|s| (s.samples, s.reason)).collect()
    }

    #[test]
    fn each_tile_stops_when_it_has_enough() {
        use StopReason::Converged;
        let expected = [(300, Converged), (600, Converged), (900, Converged)];
        let mut s = session(300, true, Params::default());
        assert_eq!(run(&mut s), expected);
        assert!(s.stops().map(|stop| stop.unfamiliar).eq([false, true, false]));
        assert_eq!(s.film().half_counts(1), [300, 300]);
        assert_eq!(run(&mut session(300, false, Params::default())), expected);
    }

    #[test]
    fn spaced_verdicts_stop_at_the_same_samples_with_fewer_looks() {
        let params = Params { schedule: Schedule::Spaced { step: 100 }, ..Params::default() };
        let (mut every, mut spaced) = (session(2000, true, Params::default()), session(2000, true, params));
        assert_eq!(run(&mut every), run(&mut spaced));
        assert!(spaced.criterion.asked.len() * 2 < every.criterion.asked.len());
    }

    #[test]
    fn limits_hold() {
        use StopReason::{Converged, MaxSamples};
        let params = Params { min_samples: 400, max_samples: 750, ..Params::default() };
        assert_eq!(
            run(&mut session(300, true, params)),
            [(400, Converged), (600, Converged), (750, MaxSamples)]
        );
    }

    #[test]
    fn one_verdict_is_not_a_streak() {
        let params = Params { consecutive: 3, ..Params::default() };
        assert_eq!(run(&mut session(300, true, params)).map_samples(), [500, 800, 1100]);
    }

    #[test]
    fn a_demanding_audience_gets_more() {
        let params = Params { audience: Audience::ART_STUDENTS, max_samples: 1200, ..Params::default() };
        // 1.94·300 − 346 = 236 → 300; 1.94·600 − 346 = 818; 1.94·900 − 346 = 1400 → the limit.
        let mut s = session(300, true, params);
        let stops = run(&mut s);
        assert_eq!(stops.map_samples(), [300, 818, 1200]);
        assert_eq!(stops[2].1, StopReason::MaxSamples);
        assert!(s.criterion.asked.iter().all(|&(_, n)| n <= 900), "no more verdicts once converged");
    }

    #[test]
    fn nothing_is_judged_before_every_tile_has_samples() {
        let mut s = session(100, true, Params::default());
        for _ in 0..2 {
            s.push(0, 50, &[[0.3; 3]; 32 * 32]).unwrap();
        }
        assert_eq!(s.judge().unwrap(), []);
        assert!(s.display().is_none());
        s.set_display(Display::SRGB);
        assert_eq!(s.judge().unwrap().len(), 1);
    }

    #[test]
    fn the_exposure_is_frozen_at_the_first_verdict() {
        let mut s = session(500, false, Params::default());
        for (n, value) in [(100, 0.3), (100, 3.0)] {
            for tile in 0..3 {
                let pixels = s.film().grid().tile(tile).pixels();
                s.push(tile, n, &vec![[value; 3]; pixels]).unwrap();
            }
            s.judge().unwrap();
            assert!((s.display().unwrap().exposure() - 0.18 / 0.3).abs() < 1e-4);
        }
    }

    #[test]
    fn closing_keeps_what_is_done() {
        let mut s = session(100, true, Params::default());
        for _ in 0..2 {
            for r in s.requests() {
                s.push(r.tile.index, r.samples, &vec![[0.3; 3]; r.tile.pixels()]).unwrap();
            }
        }
        assert_eq!(s.judge().unwrap().len(), 1);
        assert_eq!(s.close_all(StopReason::TimeLimit).len(), 2);
        let reasons: Vec<_> = s.stops().map(|s| s.reason).collect();
        assert_eq!(reasons, [StopReason::Converged, StopReason::TimeLimit, StopReason::TimeLimit]);
        assert!(s.requests().is_empty());
    }

    #[test]
    fn bad_input_is_an_error() {
        let new = |w, h, tile| {
            Session::new(w, h, crate::FixedSamples(1), Params { tile, ..Params::default() }).map(|_| ())
        };
        assert!(matches!(new(0, 10, 32), Err(SessionError::Tile(_))));
        assert!(matches!(new(10, 10, 0), Err(SessionError::Tile(_))));
        let mut s = session(100, true, Params::default());
        let reference = Reference { width: 70, height: 32, pixels: vec![] };
        assert!(matches!(s.set_reference(reference), Err(SessionError::Reference { .. })));
        assert!(s.push(9, 1, &[]).is_err());
    }

    trait MapSamples {
        fn map_samples(&self) -> Vec<u64>;
    }

    impl MapSamples for Vec<(u64, StopReason)> {
        fn map_samples(&self) -> Vec<u64> {
            self.iter().map(|s| s.0).collect()
        }
    }
}
