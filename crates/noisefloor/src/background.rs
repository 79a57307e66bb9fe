//! A session that judges beside the rendering.
//!
//! A renderer on a GPU is done with a pass before a verdict is. [`Background`] takes the pass, and the renderer goes
//! on: one thread pushes and judges what was handed over, in that order, by an ordinary [`Session`]. Stops, warnings
//! and faults are those of that session, to the bit, and come when they come ([`Background::news`]). Samples that a
//! tile gets after it stopped, since nobody could know yet, are kept aside, so that they change no verdict, and count
//! in the picture at the end, unless they are of other light ([`Warning::Late`]).
//!
//! ```
//! use noisefloor::background::{Background, WhenFull};
//! use noisefloor::{Oracle, Params, Schedule, Session};
//!
//! let params = Params::default().with_tile(32).with_schedule(Schedule::Growing { step: 16 });
//! let session = Session::new(64, 64, Oracle::bundled(), params)?;
//! let background = Background::new(session, 2, WhenFull::Wait)?;
//! let mut spp = 0;
//! while let Some(wanted) = background.next_pass() {
//!     if spp >= wanted && background.pending() == 0 {
//!         let mut image = background.buffer();
//!         image.fill([0.5; 3]); // the mean of these `spp` samples, read back
//!         background.push_image(std::mem::take(&mut spp), image)?;
//!         background.judge()?;
//!     }
//!     let news = if spp < background.spp_left() {
//!         spp += 4; // your renderer: four more samples of each pixel, summed up on the GPU
//!         background.news()?
//!     } else {
//!         background.finish()? // no tile takes more: only a verdict is to come
//!     };
//!     news.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
//! }
//! background.finish()?;
//! assert!(background.into_session()?.is_done());
//! # Ok::<(), noisefloor::SessionError>(())
//! ```

use crate::criterion::StoppingCriterion;
use crate::film::{Film, FilmError};
use crate::rgb::Rgb;
use crate::session::{Session, SessionError, Stop};
use crate::source::Request;
use crate::tile::{Tile, TileGrid, TilePixels};
use crate::watch::Warning;
use std::any::Any;
use std::collections::{HashMap, VecDeque};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};

/// What becomes of a pass while as many wait as may.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum WhenFull {
    /// [`Background::judge`] waits until there is room.
    Wait,
    /// The pass is added to the one before: the k-th batch of a tile, or of the image, to its k-th batch there, by
    /// their samples. The renderer never waits; which passes become one depends on time, and stops are those of a
    /// session that is given the passes so.
    Merge,
}

/// What happened since [`Background::news`] was last asked.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct News {
    /// Passes that were judged.
    pub judged: usize,
    /// What [`Session::judge`] returned, one call after the other.
    pub stops: Vec<Stop>,
    /// What [`Session::new_warnings`] returned.
    pub warnings: Vec<Warning>,
}

/// A session on a thread of its own. See [the module](self).
///
/// Dropping it drops passes that wait, and ends the thread, once the verdict that is being given is.
pub struct Background<C = Box<dyn StoppingCriterion + Send>> {
    shared: Arc<Shared<C>>,
    grid: TileGrid,
    max_spp: u64,
    waiting: usize,
    when_full: WhenFull,
    thread: Mutex<Option<JoinHandle<()>>>,
}

struct Shared<C> {
    judged: Mutex<Judged<C>>,
    state: Mutex<State>,
    /// Whenever the state has changed.
    changed: Condvar,
}

struct Judged<C> {
    /// There until it is given back.
    session: Option<Session<C>>,
    /// Samples of tiles that had stopped.
    late: Option<Film>,
    /// The last running mean and its samples per pixel, for those of tiles that had stopped. It has all samples, so that a
    /// tile that is opened again gets them with the next one.
    running: Option<(u64, Vec<Rgb>)>,
}

#[derive(Default)]
struct State {
    /// What has been pushed since the last pass was handed over.
    pass: Pass,
    waiting: VecDeque<Pass>,
    /// Of the pass that is being judged, what its batches are of and their samples.
    at_work: Option<Vec<(Of, u64)>>,
    ending: bool,
    /// Whether the session is being given back, so that nothing more is taken.
    closed: bool,
    /// What the session wanted after the last pass.
    requests: Vec<Request>,
    next_pass: Option<u64>,
    news: News,
    failed: Option<SessionError>,
    /// Images that were pushed, to be filled again.
    spent: Vec<Vec<Rgb>>,
}

/// Images that are kept to be filled again.
const SPENT: usize = 2;

/// Batches between two verdicts.
type Pass = Vec<Push>;

struct Push {
    of: Of,
    /// New samples per pixel; of a running mean all of them.
    spp: u64,
    mean: Vec<Rgb>,
}

/// What a batch is of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Of {
    Tile(usize),
    Image,
    /// A running mean of the image.
    Running,
}

impl<C: StoppingCriterion + Send + 'static> Background<C> {
    /// Starts the thread. At most `waiting` passes, and at least one, wait behind the one that is being judged.
    /// Parallel work is done by rayon's global pool.
    ///
    /// # Errors
    /// [`SessionError::Background`] if the system gives no thread.
    pub fn new(session: Session<C>, waiting: usize, when_full: WhenFull) -> Result<Self, SessionError> {
        Self::new_in(session, waiting, when_full, |work| work())
    }

    /// The same with parallel work elsewhere: `run` calls what it is given, for instance in a rayon pool of your own,
    /// `move |work| pool.install(work)`.
    ///
    /// # Errors
    /// As of [`Background::new`].
    #[expect(clippy::disallowed_types, reason = "where there are no threads, it is an error that says so")]
    pub fn new_in(
        session: Session<C>,
        waiting: usize,
        when_full: WhenFull,
        run: impl Fn(&mut (dyn FnMut() + Send)) + Send + 'static,
    ) -> Result<Self, SessionError> {
        let (grid, max_spp) = (session.film().grid(), session.params().max_spp);
        let (requests, next_pass) = (session.requests(), session.next_pass());
        let shared = Arc::new(Shared {
            judged: Mutex::new(Judged { session: Some(session), late: None, running: None }),
            state: Mutex::new(State { requests, next_pass, ..State::default() }),
            changed: Condvar::new(),
        });
        let of_thread = Arc::clone(&shared);
        let thread = thread::Builder::new().name("noisefloor".into()).spawn(move || of_thread.work(run));
        let thread = thread.map_err(|error| SessionError::Background(error.to_string()))?;
        let thread = Mutex::new(Some(thread));
        Ok(Self { shared, grid, max_spp, waiting: waiting.max(1), when_full, thread })
    }

    /// An image for [`Background::push_image`], of an earlier pass if one is done: what is in it is of no use.
    pub fn buffer(&self) -> Vec<Rgb> {
        let spent = self.shared.state().spent.pop();
        spent.unwrap_or_else(|| vec![[0.0; 3]; self.grid.width() * self.grid.height()])
    }

    /// As [`Session::push_image`], later. Tiles that are done by then have the samples at the end. What is pushed takes memory
    /// until it was handed over ([`Background::judge`]) and judged.
    ///
    /// # Errors
    /// [`SessionError::Image`] if its size is not the image's, and what failed in the background.
    pub fn push_image(&self, spp: u64, image: Vec<Rgb>) -> Result<(), SessionError> {
        self.add_image(Of::Image, spp, image)
    }

    /// As [`Session::push_running_image`], later: the mean of all `total` samples per pixel so far. Tiles that are done by
    /// then have the samples at the end. Of passes that become one ([`WhenFull::Merge`]), the later one has all samples.
    ///
    /// # Errors
    /// As of [`Background::push_image`].
    pub fn push_running_image(&self, total: u64, image: Vec<Rgb>) -> Result<(), SessionError> {
        self.add_image(Of::Running, total, image)
    }

    fn add_image(&self, of: Of, spp: u64, mean: Vec<Rgb>) -> Result<(), SessionError> {
        let (got, expected) = (mean.len(), self.grid.width() * self.grid.height());
        if got == expected {
            self.add(Push { of, spp, mean })
        } else {
            Err(SessionError::Image { got, expected })
        }
    }

    /// As [`Session::push`], later. A tile that is done by then has the samples at the end.
    ///
    /// # Errors
    /// [`SessionError::Film`] if the tile does not exist or the size differs, and what failed in the background.
    pub fn push(&self, tile: usize, spp: u64, mean: Vec<Rgb>) -> Result<(), SessionError> {
        if tile >= self.grid.len() {
            return Err(FilmError::Tile(tile, self.grid.len()).into());
        }
        let (got, expected) = (mean.len(), self.grid.tile(tile).pixels());
        if got != expected {
            return Err(FilmError::Pixels { tile, got, expected }.into());
        }
        self.add(Push { of: Of::Tile(tile), spp, mean })
    }

    fn add(&self, push: Push) -> Result<(), SessionError> {
        let mut state = self.shared.state();
        state.check()?;
        state.pass.push(push);
        Ok(())
    }

    /// Hands over what was pushed since the last call, to be judged.
    ///
    /// # Errors
    /// What failed in the background, now or before: see [`Background::news`].
    pub fn judge(&self) -> Result<(), SessionError> {
        let mut state = self.shared.state();
        if self.when_full == WhenFull::Wait {
            let full = |state: &mut State| state.check().is_ok() && state.waiting.len() >= self.waiting;
            state = self.shared.wait_while(state, full);
        }
        state.check()?;
        let pass = std::mem::take(&mut state.pass);
        if state.waiting.len() < self.waiting {
            state.waiting.push_back(pass);
        } else if let Some(last) = state.waiting.back_mut() {
            let spent = merge(last, pass);
            state.keep(spent);
        }
        drop(state);
        self.shared.changed.notify_all();
        Ok(())
    }

    /// What happened since the last call. It does not wait.
    ///
    /// # Errors
    /// What [`Session::push`] or [`Session::judge`] returned, and [`SessionError::Background`] if the criterion
    /// panicked. Nothing is pushed or judged after that, and all other calls return it, too.
    pub fn news(&self) -> Result<News, SessionError> {
        let mut state = self.shared.state();
        state.failed.clone().map_or(Ok(()), Err)?;
        Ok(std::mem::take(&mut state.news))
    }

    /// Passes that were handed over and are not judged yet. It does not wait. A renderer that goes on summing up until
    /// this is 0 hands over as few passes as verdicts need, and renders past the stop only what one verdict takes.
    pub fn pending(&self) -> usize {
        self.shared.state().pending()
    }

    /// As [`Session::next_pass`], after the last pass that was judged. It does not wait.
    pub fn next_pass(&self) -> Option<u64> {
        self.shared.state().next_pass
    }

    /// Samples per pixel that open tiles can still get before they stop at [`Params::max_spp`](crate::Params::max_spp), beside
    /// all that was handed over. It does not wait. A renderer that has summed up as many waits for the verdict
    /// ([`Background::finish`]): what it would render meanwhile is beyond the stop. 0 when all tiles are done, or will be with
    /// the passes that are pending, as far as is known: a verdict can open a tile again.
    pub fn spp_left(&self) -> u64 {
        let state = self.shared.state();
        let mut samples = vec![self.max_spp; self.grid.len()];
        for request in &state.requests {
            samples[request.tile.index] = request.first;
        }
        let waiting = state.waiting.iter().flatten().map(|push| (push.of, push.spp));
        for (of, spp) in state.at_work.iter().flatten().copied().chain(waiting) {
            match of {
                Of::Tile(tile) => samples[tile] = samples[tile].saturating_add(spp),
                Of::Image => samples.iter_mut().for_each(|samples| *samples = samples.saturating_add(spp)),
                Of::Running => samples.iter_mut().for_each(|samples| *samples = spp.max(*samples)),
            }
        }
        let least = samples.into_iter().min().unwrap_or(self.max_spp);
        let left = self.max_spp.saturating_sub(least);
        // A tile that has as many and is open is so for a reason: one of its halves may be empty
        if state.pending() == 0 { left.max(state.next_pass.unwrap_or(0)) } else { left }
    }

    /// As [`Session::requests`], after the last pass that was judged; it does not wait. What was handed over since is
    /// not in it, so count samples and points yourself instead of by [`Request::first`] and [`Request::sequence`].
    pub fn requests(&self) -> Vec<Request> {
        self.shared.state().requests.clone()
    }

    /// Whether every tile is done, by the passes that were judged.
    pub fn is_done(&self) -> bool {
        self.shared.state().requests.is_empty()
    }

    /// Waits until no pass waits, and says what happened as [`Background::news`] does.
    ///
    /// # Errors
    /// As of [`Background::news`].
    pub fn finish(&self) -> Result<News, SessionError> {
        let at_work = |state: &mut State| state.failed.is_none() && state.pending() > 0;
        drop(self.shared.wait_while(self.shared.state(), at_work));
        self.news()
    }

    /// Looks at the session as the last pass left it, to save a checkpoint or to show the picture: waits for the
    /// verdict that is being given, and the next one waits for `look`. Samples that came after their tile had
    /// stopped are not in it. If `look` panics, the session is as before.
    ///
    /// # Errors
    /// [`SessionError::Background`] if the criterion panicked.
    pub fn look<T>(&self, look: impl FnOnce(&Session<C>) -> T) -> Result<T, SessionError> {
        let judged = self.shared.judged.lock().map_err(|_| self.shared.failure())?;
        let session = judged.session.as_ref().ok_or_else(|| self.shared.failure())?;
        // Nothing is changed by looking, so that a panic in it is none of the session's
        let looked = catch_unwind(AssertUnwindSafe(|| look(session)));
        drop(judged);
        looked.map_or_else(|panic| resume_unwind(panic), Ok)
    }

    /// Waits until no pass waits, and gives the session back, with the samples that came after their tile had
    /// stopped. What was pushed and not handed over is lost. An error of a push or of a verdict is none of this
    /// call: ask [`Background::finish`] before.
    ///
    /// # Errors
    /// [`SessionError::Background`] if the criterion panicked.
    pub fn into_session(self) -> Result<Session<C>, SessionError> {
        self.take_session()
    }

    /// As [`Background::into_session`], once: for handles of other languages, which others may hold. From then on, nothing more
    /// is taken from other threads.
    ///
    /// # Errors
    /// As of [`Background::into_session`], and the second time.
    #[doc(hidden)]
    pub fn take_session(&self) -> Result<Session<C>, SessionError> {
        // A renderer on another thread may hand over pass after pass: no more of them, or this would wait for ever
        self.shared.state().closed = true;
        self.shared.changed.notify_all();
        drop(self.finish());
        self.end();
        let mut judged = self.shared.judged.lock().map_err(|_| self.shared.failure())?;
        let (session, late, running) = (judged.session.take(), judged.late.take(), judged.running.take());
        let mut session = session.ok_or_else(gone)?;
        self.shared.state().failed.get_or_insert_with(gone);
        self.shared.changed.notify_all();
        if let Some(late) = late {
            session.add_late(&late)?;
        }
        if let Some((total, image)) = running {
            session.add_late_running(total, &image)?;
        }
        Ok(session)
    }

    /// Drops passes that wait, and ends the thread once the verdict that is being given is; nothing more is taken. For
    /// languages whose interpreter ends before this is dropped.
    #[doc(hidden)]
    pub fn stop(&self) {
        let mut state = self.shared.state();
        state.waiting.clear();
        state.closed = true;
        drop(state);
        self.end();
    }
}

impl<C> Background<C> {
    fn end(&self) {
        self.shared.state().ending = true;
        self.shared.changed.notify_all();
        let thread = self.thread.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(thread) = thread {
            // What it panicked with, if it did, was caught
            drop(thread.join());
        }
    }
}

impl<C> Drop for Background<C> {
    fn drop(&mut self) {
        self.shared.state().waiting.clear();
        self.end();
    }
}

impl<C> Shared<C> {
    /// The state, which is whole at any time: nothing panics while it is locked.
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait_while<'a>(
        &self,
        state: MutexGuard<'a, State>,
        condition: impl FnMut(&mut State) -> bool,
    ) -> MutexGuard<'a, State> {
        self.changed.wait_while(state, condition).unwrap_or_else(PoisonError::into_inner)
    }

    /// Why there is no session.
    fn failure(&self) -> SessionError {
        let failed = self.state().failed.clone();
        failed.unwrap_or_else(|| SessionError::Background("the criterion panicked".into()))
    }
}

impl<C: StoppingCriterion + Send> Shared<C> {
    fn work(&self, run: impl Fn(&mut (dyn FnMut() + Send))) {
        loop {
            let mut state = self.wait_while(self.state(), |state| state.waiting.is_empty() && !state.ending);
            let Some(mut pass) = state.waiting.pop_front() else { return };
            state.at_work = Some(pass.iter().map(|push| (push.of, push.spp)).collect());
            drop(state);
            self.changed.notify_all();

            let mut found = None;
            let judged = catch_unwind(AssertUnwindSafe(|| {
                // Once, whatever is done with it: samples count once
                run(&mut || {
                    found.get_or_insert_with(|| self.take(&mut pass));
                });
            }));
            let nothing = || Err(SessionError::Background("its work was not done where it was sent".into()));
            let found = match judged {
                Ok(()) => found.unwrap_or_else(nothing),
                Err(panic) => {
                    Err(SessionError::Background(format!("the criterion panicked: {}", said(&*panic))))
                }
            };

            let mut state = self.state();
            state.at_work = None;
            let images =
                pass.into_iter().filter(|push| !matches!(push.of, Of::Tile(_)) && !push.mean.is_empty());
            state.keep(images.map(|push| push.mean));
            match found {
                Ok(Found { stops, warnings, requests, next_pass }) => {
                    (state.requests, state.next_pass) = (requests, next_pass);
                    state.news.judged += 1;
                    state.news.stops.extend(stops);
                    state.news.warnings.extend(warnings);
                }
                Err(error) => state.failed = Some(error),
            }
            let failed = state.failed.is_some();
            drop(state);
            self.changed.notify_all();
            if failed {
                return;
            }
        }
    }

    /// Pushes a pass, and judges.
    fn take(&self, pass: &mut Pass) -> Result<Found, SessionError> {
        let Ok(mut judged) = self.judged.lock() else { return Err(self.failure()) };
        let Judged { session: Some(session), late, running } = &mut *judged else {
            return Err(self.failure());
        };
        let grid = session.film().grid();
        for Push { of, spp, mean } in pass {
            let tiles: Vec<Tile> = match *of {
                Of::Tile(tile) => vec![grid.tile(tile)],
                Of::Image | Of::Running => grid.tiles().collect(),
            };
            let pixels = |place: Tile| match of {
                Of::Tile(_) => TilePixels::alone(place, mean),
                Of::Image | Of::Running => TilePixels::in_image(place, mean, grid.width()),
            };
            let (open, done): (Vec<Tile>, Vec<Tile>) =
                tiles.into_iter().partition(|tile| session.is_open(tile.index));
            if *of == Of::Running {
                session.push_running_tiles(*spp, &open, mean)?;
                let before = running.replace((*spp, std::mem::take(mean)));
                *mean = before.map_or_else(Vec::new, |(_, image)| image);
            } else {
                session.push_tiles(*spp, &open, pixels)?;
                add_late(late, grid, *spp, &done, pixels)?;
            }
        }
        let (stops, warnings) = (session.judge()?, session.new_warnings());
        Ok(Found { stops, warnings, requests: session.requests(), next_pass: session.next_pass() })
    }
}

struct Found {
    stops: Vec<Stop>,
    warnings: Vec<Warning>,
    requests: Vec<Request>,
    next_pass: Option<u64>,
}

/// Keeps samples of tiles that had stopped.
fn add_late<'a>(
    late: &mut Option<Film>,
    grid: TileGrid,
    spp: u64,
    tiles: &[Tile],
    pixels: impl Fn(Tile) -> TilePixels<'a> + Sync,
) -> Result<(), FilmError> {
    if tiles.is_empty() {
        return Ok(());
    }
    if late.is_none() {
        Film::check_memory(grid, 1)?;
    }
    let late = late.get_or_insert_with(|| Film::without_halves(grid));
    tiles.iter().try_for_each(|tile| late.check_new(tile.index, spp))?;
    late.add_tiles(spp, tiles, pixels);
    Ok(())
}

fn gone() -> SessionError {
    SessionError::Background("the session was given back".into())
}

impl State {
    /// Whether anything more is taken.
    fn check(&self) -> Result<(), SessionError> {
        match &self.failed {
            Some(failed) => Err(failed.clone()),
            None if self.closed => Err(gone()),
            None => Ok(()),
        }
    }

    fn pending(&self) -> usize {
        self.waiting.len() + usize::from(self.at_work.is_some())
    }

    /// Keeps images to be filled again.
    fn keep(&mut self, images: impl IntoIterator<Item = Vec<Rgb>>) {
        self.spent.extend(images);
        self.spent.truncate(SPENT);
    }
}

/// Adds a pass to another one, and returns the images that are of no use then.
fn merge(before: &mut Pass, pass: Pass) -> Vec<Vec<Rgb>> {
    let mut places: HashMap<Of, VecDeque<usize>> = HashMap::new();
    for (place, push) in before.iter().enumerate() {
        places.entry(push.of).or_default().push_back(place);
    }
    let mut spent = Vec::new();
    for push in pass {
        let place = places.get_mut(&push.of).and_then(VecDeque::pop_front);
        match place.map(|place| &mut before[place]) {
            // A batch without samples stays one: pushing it is an error
            Some(other) if other.spp > 0 && push.spp > 0 => {
                if push.of == Of::Running {
                    // It has the samples of the one before in it; one with fewer is an error
                    if push.spp > other.spp {
                        spent.push(std::mem::replace(other, push).mean);
                    } else {
                        before.push(push);
                    }
                    continue;
                }
                let spp = other.spp.saturating_add(push.spp);
                let weight = push.spp as f64 / spp as f64;
                let numbers = other.mean.as_flattened_mut().iter_mut().zip(push.mean.as_flattened());
                numbers.for_each(|(mean, &new)| {
                    let old = f64::from(*mean);
                    *mean = (old + (f64::from(new) - old) * weight) as f32;
                });
                other.spp = spp;
                if push.of == Of::Image {
                    spent.push(push.mean);
                }
            }
            _ => before.push(push),
        }
    }
    spent
}

fn said(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str)).unwrap_or("without a word")
}

#[cfg(test)]
mod tests;
