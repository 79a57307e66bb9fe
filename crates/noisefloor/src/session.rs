//! The push loop: for a renderer that owns its main loop.

use crate::criterion::{CriterionError, OpenFor, StoppingCriterion, Verdict, View, check_verdicts};
use crate::display::{BRIGHTEST, Display, Settled, ToneMapping};
use crate::film::{Film, FilmError};
use crate::params::{Audience, Params, ParamsError};
use crate::rgb::Rgb;
use crate::source::SourceIdentity;
use crate::source::{PixelNoise, Reference, Request};
use crate::tile::{Tile, TileError, TileGrid, TilePixels};
use crate::watch::{Fault, Warning, Watch};
use rayon::prelude::*;
use std::fmt;
use thiserror::Error;

mod settling;
mod stop;
pub(crate) use settling::Settling;
use settling::is_another;
pub(crate) use stop::{Goal, TileState};
pub use stop::{Interruption, Stop, StopReason};

/// Why a session failed.
///
/// Its `Debug` is its text, so that a `main` that returns it prints what to do.
#[derive(Error, Clone, PartialEq)]
#[non_exhaustive]
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
    /// A picture of another size than the image.
    #[error("the picture has {got} pixels, the image {expected}")]
    Image {
        /// Pixels of the picture.
        got: usize,
        /// Pixels of the image.
        expected: usize,
    },
    /// A display for a session that has judged with another one.
    #[error("tiles were judged already with another display: set it before the first verdict")]
    Judged,
    /// Samples that cannot be what they are said to be.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// A [`Background`](crate::background::Background) without a thread, or whose criterion panicked.
    #[error("judging in the background failed: {0}")]
    Background(String),
}

impl fmt::Debug for SessionError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}

/// Adds batches of `spp` samples to a film that is watched, which are the same for any criterion. Those of running means
/// were `given` in other numbers, and have `growth` times as many samples.
fn add<'a, 'b>(
    film: &mut Film,
    watch: &mut Watch,
    (spp, growth): (u64, f64),
    tiles: &[Tile],
    pixels: &(dyn Fn(Tile) -> TilePixels<'a> + Sync),
    given: &(dyn Fn(Tile) -> TilePixels<'b> + Sync),
) -> Result<(), SessionError> {
    let glances: Vec<_> = tiles.par_iter().map(|&tile| watch.glance(tile, pixels(tile))).collect();
    let refused = tiles.iter().zip(glances).enumerate().find_map(|(i, (&tile, glance))| {
        let light = watch.check_light(film, tile, spp, pixels(tile), glance).map_err(SessionError::from);
        let checked = light.and_then(|()| Ok(film.check_new(tile.index, spp)?));
        checked.err().map(|error| (i, error))
    });
    let (accepted, refused) = match refused {
        Some((i, error)) => (&tiles[..i], Err(error)),
        None => (tiles, Ok(())),
    };
    let compared = |&tile: &Tile| (tile, watch.compare(film, tile, spp, pixels(tile)));
    let compared: Vec<_> = accepted.par_iter().map(compared).collect();
    film.add_tiles(spp, accepted, pixels);
    watch.see(compared, (spp, growth), pixels, given);
    refused
}

/// Film, criterion and limits, for a renderer that owns its main loop: it pushes batches, asks which tiles
/// are open and how many samples each needs, and ends when none is open.
///
/// ```
/// use noisefloor::{FixedSpp, Params, Session};
///
/// let mut session = Session::new(640, 360, FixedSpp(200), Params::default())?;
/// while !session.is_done() {
///     for request in session.requests() {
///         // Your renderer: the mean of `request.spp` new samples of each pixel of the tile.
///         let mean = vec![[0.5; 3]; request.tile.pixels()];
///         session.push(request.tile.index, request.spp, &mean)?;
///     }
///     session.judge()?;
///     session.new_warnings().iter().for_each(|warning| eprintln!("warning: {warning}"));
/// }
/// assert!(session.stops().all(|stop| stop.spp == 200));
/// # Ok::<(), noisefloor::SessionError>(())
/// ```
pub struct Session<C = Box<dyn StoppingCriterion + Send>> {
    film: Film,
    criterion: C,
    params: Params,
    display: Option<Display>,
    /// What the display was settled from; `None` if it was set, or is not there yet.
    settling: Option<Settling>,
    reference: Option<Reference>,
    /// The reference as displayed, once the display is settled.
    displayed_reference: Option<Vec<Rgb>>,
    tiles: Vec<TileState>,
    source: SourceIdentity,
    watch: Watch,
    /// Warnings that were handed over.
    told: usize,
}

impl<C: StoppingCriterion> Session<C> {
    /// Starts a session for an image of `width`×`height` pixels.
    ///
    /// # Errors
    /// [`SessionError`] if a parameter or the size is out of range.
    pub fn new(width: usize, height: usize, mut criterion: C, params: Params) -> Result<Self, SessionError> {
        params.check()?;
        let grid = TileGrid::new(width, height, params.tile)?;
        Film::check_memory(grid, if criterion.needs().halves { 2 } else { 1 })?;
        criterion.begin(grid);
        let film = if criterion.needs().halves { Film::new(grid) } else { Film::without_halves(grid) };
        let goal = Goal::Verdict { spp: params.first_verdict(), streak: 0 };
        let tile = TileState { goal, verdict: None, stop: None };
        let tiles = vec![tile; grid.len()];
        // Only an exposure by log-average depends on the picture, and has to wait for one
        let display = match &params.tone_mapping {
            ToneMapping::Reinhard { .. } => None,
            known => Some(known.settle(&[])),
        };
        Ok(Self {
            watch: Watch::new(grid),
            told: 0,
            film,
            criterion,
            params,
            display,
            settling: None,
            reference: None,
            displayed_reference: None,
            tiles,
            source: SourceIdentity::default(),
        })
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

    /// How radiance is displayed; `None` until it is settled. All verdicts that stand were given with it. An
    /// exposure by log-average is settled again as samples come: until no tile is open, it can change.
    pub fn display(&self) -> Option<&Display> {
        self.display.as_ref()
    }

    /// How the picture is to be shown so far: [`Session::display`], or as it would be settled now.
    pub fn display_so_far(&self) -> Display {
        let settled = || self.film.settle(&self.params.tone_mapping).display;
        self.display.clone().unwrap_or_else(settled)
    }

    /// Fixes how radiance is displayed before that is settled automatically: for renderers with an exposure
    /// of their own, or that finish one tile before they start the next.
    ///
    /// # Errors
    /// [`SessionError::Judged`] after the first verdict: what was judged was shown otherwise.
    pub fn set_display(&mut self, display: Display) -> Result<(), SessionError> {
        if self.tiles.iter().any(|tile| tile.verdict.is_some()) {
            return Err(SessionError::Judged);
        }
        (self.display, self.settling) = (Some(display), None);
        self.displayed_reference = None;
        Ok(())
    }

    /// Says what the samples depend on, for checkpoints: a session whose source has changed is not resumed. A
    /// [`Driver`](crate::Driver) does this by itself.
    #[doc(hidden)]
    pub fn set_source(&mut self, source: SourceIdentity) {
        self.source = source;
    }

    /// Says that neighbouring pixels have noise in common, so that no warning needs to. A
    /// [`Driver`](crate::Driver) does this by itself.
    pub fn set_pixels(&mut self, pixels: PixelNoise) {
        self.watch.set_pixels(pixels);
    }

    /// Whether neighbouring pixels have noise in common, as [`Session::set_pixels`] said.
    pub fn pixels(&self) -> PixelNoise {
        self.watch.pixels()
    }

    /// What is likely to be wrong with the samples pushed so far: each kind once, in the order found. Complete
    /// after each [`Session::judge`]; see [`crate::watch`].
    pub fn warnings(&self) -> &[Warning] {
        self.watch.warnings()
    }

    /// The warnings that this has not returned yet: for a loop that prints them. A session that was resumed
    /// returns all again.
    pub fn new_warnings(&mut self) -> Vec<Warning> {
        let warnings = self.watch.warnings();
        let new = warnings[self.told.min(warnings.len())..].to_vec();
        self.told = warnings.len();
        new
    }

    /// Samples, over all pixels, of pixels of a batch that had negative luminance. A few are rounding, or lobes
    /// of a filter. Counted since the session was made or resumed.
    pub fn negative_samples(&self) -> u64 {
        self.film.negative()
    }

    /// Says that what is pushed is linear radiance, so that no warning asks. Where all batches have one size, nothing tells that from values that were encoded for a screen. A [`Driver`](crate::Driver) does this by
    /// itself, as sources promise it.
    pub fn set_linear(&mut self) {
        self.watch.set_linear();
    }

    /// Says that the samples of each sequence complete each other ([`SourceInfo::stratified`](crate::SourceInfo)).
    pub(crate) fn set_stratified(&mut self) {
        self.watch.set_sequences(Some(if self.film.has_halves() { 2 } else { 1 }));
    }

    /// Provides the quick noise-free reference, for criteria that need one.
    ///
    /// # Errors
    /// [`SessionError::Reference`] if its size is not the image's.
    pub fn set_reference(&mut self, reference: Reference) -> Result<(), SessionError> {
        let grid = self.film.grid();
        let expected = grid.width() * grid.height();
        let fits = (reference.width, reference.height) == grid.size();
        if !fits || reference.pixels.len() != expected {
            return Err(SessionError::Reference { got: reference.pixels.len(), expected });
        }
        self.reference = Some(reference);
        self.displayed_reference = None;
        Ok(())
    }

    pub(crate) fn has_reference(&self) -> bool {
        self.reference.is_some()
    }

    /// What the open tiles need next; empty when all are done. Where halves are kept, requests fill one half
    /// at a time, so that the two stay even.
    pub fn requests(&self) -> Vec<Request> {
        let wish = |(index, state): (usize, &TileState)| {
            if state.stop.is_some() {
                return None;
            }
            let counts = self.film.half_counts(index);
            let wanted = self.wanted(counts, state.goal.spp());
            Some(self.film.request_after(index, counts, wanted.max(1)))
        };
        self.tiles.iter().enumerate().filter_map(wish).collect()
    }

    /// Samples per pixel that the next pass over the whole image should have, for a renderer of whole frames: what
    /// one half lacks until the first of the open tiles can be judged, so that nothing has to be read back from a GPU
    /// before. `None` when all tiles are done.
    pub fn next_pass(&self) -> Option<u64> {
        self.requests().iter().map(|request| request.spp).min()
    }

    /// Adds the mean of `spp` new samples per pixel of a tile, row-major over the tile. Finished tiles accept
    /// samples, too: they improve, and keep their stop.
    ///
    /// # Errors
    /// [`SessionError::Film`] if it does not fit, [`SessionError::Fault`] if it is no light; nothing is changed
    /// then.
    pub fn push(&mut self, tile: usize, spp: u64, mean: &[Rgb]) -> Result<(), SessionError> {
        let place = self.film.check(tile, mean.len())?;
        self.push_tiles(spp, &[place], |tile| TilePixels::alone(tile, mean))
    }

    /// Adds the mean of `spp` new samples per pixel of the whole image, row-major, to every open tile. On all threads of
    /// the rayon pool that it is called in, as verdicts are given: `pool.install(|| session.judge())` keeps both in a
    /// pool of your own.
    ///
    /// # Errors
    /// [`SessionError::Image`] if its size is not the image's, and as of [`Session::push`]: tiles before the
    /// one that is refused have the samples then.
    pub fn push_image(&mut self, spp: u64, image: &[Rgb]) -> Result<(), SessionError> {
        let (open, width) = (self.open_in(image)?, self.film.width());
        self.push_tiles(spp, &open, |tile| TilePixels::in_image(tile, image, width))
    }

    /// The open tiles of a whole image, which has to have its size.
    fn open_in(&self, image: &[Rgb]) -> Result<Vec<Tile>, SessionError> {
        let grid = self.film.grid();
        let (got, expected) = (image.len(), grid.width() * grid.height());
        let open = || grid.tiles().filter(|tile| self.is_open(tile.index)).collect();
        if got == expected { Ok(open()) } else { Err(SessionError::Image { got, expected }) }
    }

    /// Adds new samples of tiles, in the order of the grid: those before the one that is refused. All that tiles
    /// need not wait for each other with is distributed over threads, to the same bits.
    pub(crate) fn push_tiles<'a>(
        &mut self,
        spp: u64,
        tiles: &[Tile],
        pixels: impl Fn(Tile) -> TilePixels<'a> + Sync,
    ) -> Result<(), SessionError> {
        add(&mut self.film, &mut self.watch, (spp, 0.0), tiles, &pixels, &pixels)
    }

    /// Adds samples that came after their tile had stopped, where they are like those before.
    pub(crate) fn add_late(&mut self, late: &Film) -> Result<(), FilmError> {
        let grid = self.film.grid();
        let batch_of = |tile: Tile| {
            let valid = |pixel| late.pixel_counts(tile.index, pixel)[0] > 0;
            let mean = |pixel| if valid(pixel) { late.pixel(tile.index, pixel) } else { [f32::NAN; 3] };
            (late.spp(tile.index), tile.rows(grid.width()).flatten().map(mean).collect())
        };
        let tiles = grid.tiles().filter(|tile| late.spp(tile.index) > 0);
        self.add_late_batches(tiles.map(|tile| (tile, batch_of(tile))))
    }

    /// The same, of a running mean of the whole image.
    pub(crate) fn add_late_running(&mut self, total: u64, image: &[Rgb]) -> Result<(), FilmError> {
        let grid = self.film.grid();
        let late = |tile: &Tile| !self.is_open(tile.index) && self.film.spp(tile.index) < total;
        let new_of = |tile: Tile| {
            let mean = TilePixels::in_image(tile, image, grid.width());
            Ok((tile, self.film.new_of_running(tile, total, mean)?))
        };
        let batches = grid.tiles().filter(late).map(new_of).collect::<Result<Vec<_>, FilmError>>()?;
        self.add_late_batches(batches.into_iter())
    }

    fn add_late_batches(
        &mut self,
        batches: impl Iterator<Item = (Tile, (u64, Vec<Rgb>))>,
    ) -> Result<(), FilmError> {
        let (mut tiles, mut of) = (0, 0);
        for (tile, (spp, mean)) in batches {
            of += 1;
            if self.watch.is_like(&self.film, tile, spp, TilePixels::alone(tile, &mean)) {
                self.film.add(tile.index, spp, &mean)?;
            } else {
                tiles += 1;
            }
        }
        if tiles > 0 {
            self.watch.warn(Warning::Late { tiles, of });
        }
        Ok(())
    }

    /// Adds the new samples in a running mean of a tile, of `total` samples per pixel, for renderers that keep one of their own.
    /// Their difference amplifies the rounding of the mean by total/(new samples): push batches where you can.
    ///
    /// # Errors
    /// As of [`Session::push`].
    pub fn push_running(&mut self, tile: usize, total: u64, mean: &[Rgb]) -> Result<(), SessionError> {
        let place = self.film.check(tile, mean.len())?;
        let (new, batch) = self.film.new_of_running(place, total, TilePixels::alone(place, mean))?;
        let pixels = |tile| TilePixels::alone(tile, &batch);
        let of = (new, total as f64 / new as f64);
        let given = |tile| TilePixels::alone(tile, mean);
        add(&mut self.film, &mut self.watch, of, &[place], &pixels, &given)
    }

    /// Adds the new samples in a running mean of the whole image, row-major, to every open tile: `total` samples per pixel so
    /// far, more than each of them has.
    ///
    /// # Errors
    /// As of [`Session::push_image`] and [`Session::push_running`]: tiles before the one that is refused have the samples then.
    pub fn push_running_image(&mut self, total: u64, image: &[Rgb]) -> Result<(), SessionError> {
        self.push_running_tiles(total, &self.open_in(image)?, image)
    }

    /// As [`Session::push_running_image`], to these tiles, in the order of the grid.
    pub(crate) fn push_running_tiles(
        &mut self,
        total: u64,
        tiles: &[Tile],
        image: &[Rgb],
    ) -> Result<(), SessionError> {
        let new = self.film.new_of_running_image(tiles, total, image);
        let width = self.film.width();
        let given = |tile| TilePixels::in_image(tile, image, width);
        // Nearly always, all tiles have as many: they are pushed at once then
        let mut rest = tiles.iter().zip(new).peekable();
        while let Some((first, new)) = rest.next() {
            let (spp, batch) = new?;
            let (mut alike, mut batches) = (vec![*first], vec![batch]);
            while let Some((tile, Ok((_, batch)))) =
                rest.next_if(|(_, new)| matches!(new, Ok((n, _)) if *n == spp))
            {
                alike.push(*tile);
                batches.push(batch);
            }
            let place = |tile: &Tile| alike.partition_point(|other| other.index < tile.index);
            let pixels = |tile: Tile| TilePixels::alone(tile, &batches[place(&tile)]);
            let of = (spp, total as f64 / spp as f64);
            add(&mut self.film, &mut self.watch, of, &alike, &pixels, &given)?;
        }
        Ok(())
    }

    /// Judges the tiles that are due, and returns those that are now done. On all threads of the rayon pool that it is
    /// called in; a verdict of the oracle takes 0.4 ms of one processor for a tile of 128×128 pixels.
    ///
    /// The first verdicts wait until every open tile has samples: the exposure is settled then, as that of
    /// the converged picture, unless the tone mapping has one or [`Session::set_display`] was called. It is
    /// settled again as samples come. Criteria know its standard error ([`View::exposure_error`]), and when
    /// it moves by more than 2 %, all tiles are judged again: one that had converged can be open again, so
    /// that [`Session::requests`] has it, and is returned a second time when it is done.
    ///
    /// # Errors
    /// [`SessionError::Fault`] if the samples pushed cannot be what they are said to be: no tile stops then, now or
    /// later. [`SessionError::Criterion`] if the criterion does not fit the job.
    pub fn judge(&mut self) -> Result<Vec<Stop>, SessionError> {
        let due: Vec<Tile> = self.film.grid().tiles().filter(|t| self.is_due(t.index)).collect();
        if due.is_empty() {
            return Ok(Vec::new());
        }
        let before = (self.display.clone(), self.settling);
        let Some(moved) = self.settle_display() else { return Ok(Vec::new()) };
        self.check_exposure()?;
        self.watch.look(&self.film)?;
        // Whoever only counts samples does not mind what they are
        let doubts = self.watch.doubts() && !self.criterion.only_counts();
        let first = self.params.first_verdict();
        let (early, due_now): (Vec<Tile>, Vec<Tile>) = due.iter().partition(|t| {
            let (spp, for_verdict) = (self.film.spp(t.index), self.is_for_verdict(t));
            spp < first || (doubts && for_verdict && spp < self.params.max_spp)
        });
        for tile in early {
            let spp = self.film.spp(tile.index);
            let next = if spp < first { first } else { self.next_in_doubt(tile.index, spp) };
            self.tiles[tile.index].goal = Goal::Verdict { spp: next.min(self.params.max_spp), streak: 0 };
        }
        let (judged, waited): (Vec<Tile>, Vec<Tile>) =
            due_now.into_iter().partition(|t| self.is_for_verdict(t));
        // What was judged under another exposure is judged again: all that is, as criteria look at
        // neighbours, too
        let again: Vec<Tile> = match moved {
            true => self.film.grid().tiles().filter(|t| self.is_judged_again(t, &judged)).collect(),
            false => Vec::new(),
        };

        // Ask the criterion.
        let mut stops = Vec::new();
        if !(judged.is_empty() && again.is_empty()) {
            // Whether the criterion fails or panics: until its verdicts are there, those that stand were given
            // under the display of before
            let display = std::mem::replace(&mut self.display, before.0);
            let settling = std::mem::replace(&mut self.settling, before.1);
            let reference = self.displayed_reference.take();
            let Some(view) = view(&self.film, (&display, settling), &self.params, &reference) else {
                return Ok(stops);
            };
            let asked: Vec<Tile> = again.iter().chain(&judged).copied().collect();
            let verdicts = self.criterion.judge(&view, &asked)?;
            check_verdicts(&self.criterion, &asked, &verdicts)?;
            self.watch.see_verdicts(&verdicts);
            (self.display, self.settling, self.displayed_reference) = (display, settling, reference);
            let mut verdicts = verdicts.into_iter();
            let open = self.open_tiles() as f64 / self.tiles.len() as f64;
            for (tile, verdict) in again.into_iter().zip(&mut verdicts) {
                stops.extend(self.take_again(tile.index, verdict, open));
            }
            for (tile, verdict) in judged.into_iter().zip(verdicts) {
                stops.extend(self.take(tile.index, verdict, open));
            }
            // What other tiles have met can say of a tile that it lacks light
            let revised = self.criterion.revised();
            // Many that are opened again make the next round one of many
            let open = open.max(revised.len() as f64 / self.tiles.len() as f64);
            for (tile, verdict) in revised {
                stops.extend(self.take_again(tile.index, verdict, open));
            }
        }

        // Tiles that had converged for the trained audience, and still have, have now what this audience
        // wants.
        for tile in waited {
            if !self.is_for_verdict(&tile) {
                stops.push(self.stop(tile.index, self.audience_reason(tile.index)));
            }
        }
        Ok(stops)
    }

    /// Samples at which a tile of so many is looked at next while verdicts wait: about half as many more, and in batches of
    /// another size if all had the same, as that tells noise from none.
    fn next_in_doubt(&self, index: usize, samples: u64) -> u64 {
        let next = self.params.schedule.half_more(samples);
        let alike = self.watch.only_size(index) == Some(self.wanted(self.film.half_counts(index), next));
        if alike { next.saturating_add(self.params.schedule.step()) } else { next }
    }

    /// Whether the exposure that the picture asks for can be had.
    fn check_exposure(&self) -> Result<(), Fault> {
        let settled = self.display.as_ref().filter(|_| self.settling.is_some()).map(Display::exposure);
        settled.filter(|&exposure| exposure == BRIGHTEST).map_or(Ok(()), |exposure| Err(Fault::Dim(exposure)))
    }

    /// Looks at the samples as before a verdict, without one.
    #[cfg(test)]
    pub(crate) fn look(&mut self) -> Result<(), SessionError> {
        Ok(self.watch.look(&self.film)?)
    }

    /// Whether a tile has what its next verdict needs.
    pub(crate) fn is_due(&self, index: usize) -> bool {
        let state = &self.tiles[index];
        state.stop.is_none() && self.has_enough(self.film.half_counts(index), state.goal.spp())
    }

    fn is_for_verdict(&self, tile: &Tile) -> bool {
        matches!(self.tiles[tile.index].goal, Goal::Verdict { .. })
    }

    /// Whether a tile has been judged, or looked at with its neighbours, and is not going to be now.
    fn is_judged_again(&self, tile: &Tile, judged: &[Tile]) -> bool {
        self.has_enough(self.film.half_counts(tile.index), 1)
            && judged.binary_search_by_key(&tile.index, |t| t.index).is_err()
    }

    /// Settles exposure and reference; says whether the exposure is another than that of earlier verdicts.
    /// `None` if it is too early.
    fn settle_display(&mut self) -> Option<bool> {
        let samples = self.film.total_samples();
        let due = match (&self.display, self.settling) {
            (Some(_), None) => false,
            (Some(_), Some(settling)) => settling.is_due(samples),
            (None, _) => {
                // A tile that is done without samples has none to wait for.
                let waits = |(t, state): (usize, &TileState)| state.stop.is_none() && self.film.spp(t) == 0;
                if self.tiles.iter().enumerate().any(waits) {
                    return None;
                }
                true
            }
        };
        let mut moved = false;
        if due {
            let Settled { display, error, .. } = self.film.settle(&self.params.tone_mapping);
            self.settling = Some(Settling { samples, error });
            if self.display.as_ref().is_none_or(|before| is_another(before, &display)) {
                moved = self.display.is_some();
                self.display = Some(display);
                self.displayed_reference = None;
            }
        }
        if let (Some(display), Some(reference), None) =
            (&self.display, &self.reference, &self.displayed_reference)
        {
            self.displayed_reference = Some(reference.pixels.iter().map(|&p| display.encode(p)).collect());
        }
        // A criterion that only counts says the same of any picture
        Some(moved && !self.criterion.only_counts())
    }

    /// Whether the criterion has what it wants, or a less demanding audience has enough where the others are
    /// still expected to need more.
    fn is_satisfied(&self, verdict: &Verdict, samples: u64) -> bool {
        let content =
            self.audience().slope < 1.0 && self.expected(verdict).is_some_and(|need| need <= samples);
        verdict.converged || content
    }

    /// Files a verdict at another exposure on a tile that is not due: what is done stays done, or is open
    /// again. Returns the stop if it has become another.
    fn take_again(&mut self, index: usize, verdict: Verdict, open: f64) -> Option<Stop> {
        let samples = self.film.spp(index);
        let (satisfied, max_spp) = (self.is_satisfied(&verdict, samples), self.params.max_spp);
        let next = self.next_verdict(samples, self.expected(&verdict), open);
        let state = &mut self.tiles[index];
        state.verdict = Some(verdict);
        if let Some(stop) = &mut state.stop {
            (stop.probability, stop.unfamiliar) = (verdict.probability, verdict.unfamiliar);
        }
        let converged = state.stop.is_some_and(|stop| stop.reason == StopReason::Converged);
        match state.goal {
            _ if satisfied => None,
            Goal::Verdict { spp, .. } if state.stop.is_none() => {
                state.goal = Goal::Verdict { spp, streak: 0 };
                None
            }
            _ if state.stop.is_none() || converged => {
                (state.stop, state.goal) = (None, Goal::Verdict { spp: next, streak: 0 });
                (samples >= max_spp).then(|| self.stop(index, StopReason::MaxSpp))
            }
            _ => None,
        }
    }

    /// Samples at which a tile is judged next that is not satisfied now.
    fn next_verdict(&self, samples: u64, expected: Option<u64>, open: f64) -> u64 {
        // What light a tile lacks may fall faster than the criterion expects
        let ahead = expected.filter(|&need| need > samples);
        self.params.schedule.next(samples, ahead, open).min(self.params.max_spp)
    }

    /// Files one verdict, with the share of tiles that were open before; returns the stop if the tile is done by
    /// it.
    fn take(&mut self, index: usize, verdict: Verdict, open: f64) -> Option<Stop> {
        let samples = self.film.spp(index);
        let Params { consecutive, max_spp, .. } = self.params;
        let (audience, satisfied) = (self.audience(), self.is_satisfied(&verdict, samples));
        let streak = match self.tiles[index].goal {
            Goal::Verdict { streak, .. } if satisfied => streak + 1,
            _ => 0,
        };
        // Asked again about much the same samples, a criterion would say the same
        let expected = self.expected(&verdict).filter(|_| streak == 0);
        let spp = self.next_verdict(samples, expected, open);
        let state = &mut self.tiles[index];
        (state.verdict, state.goal) = (Some(verdict), Goal::Verdict { spp, streak });
        if streak >= consecutive {
            let wanted = audience.samples(samples);
            if wanted <= samples {
                // Of samples that look wrong, a tile is judged at its limit alone
                let wrong = self.watch.looks_wrong() && !self.criterion.only_counts();
                return Some(self.stop(index, if wrong { StopReason::MaxSpp } else { self.satisfied() }));
            }
            state.goal = Goal::Audience { spp: wanted.min(max_spp).max(samples + 1) };
        }
        (samples >= max_spp).then(|| self.stop(index, StopReason::MaxSpp))
    }

    /// Where a verdict like this expects the next ones to say "converged": for a less demanding audience sooner.
    fn expected(&self, verdict: &Verdict) -> Option<u64> {
        let audience = self.audience();
        verdict.expected_spp.map(|need| if audience.slope < 1.0 { audience.samples(need) } else { need })
    }

    /// The line from the thresholds of the training data to those wanted.
    fn audience(&self) -> Audience {
        self.criterion.audience().then(self.params.audience)
    }

    /// Whether an audience's wish was granted or cut short by the limit.
    fn audience_reason(&self, index: usize) -> StopReason {
        let at_limit = self.film.spp(index) >= self.params.max_spp;
        if at_limit { StopReason::MaxSpp } else { self.satisfied() }
    }

    /// Why a tile stops that the criterion is satisfied with.
    fn satisfied(&self) -> StopReason {
        if self.criterion.only_counts() { StopReason::ReachedSpp } else { StopReason::Converged }
    }

    fn stop(&mut self, index: usize, reason: StopReason) -> Stop {
        let state = &mut self.tiles[index];
        let stop = Stop::new(self.film.grid().tile(index), self.film.spp(index), reason);
        let stop = state.verdict.map_or(stop, |verdict| stop.with_verdict(&verdict));
        *state.stop.insert(stop)
    }

    /// Ends one tile for the caller's reason. Does nothing if it is already done.
    ///
    /// # Panics
    /// If the tile does not exist.
    pub fn close(&mut self, tile: usize, reason: Interruption) -> Option<Stop> {
        self.tiles[tile].stop.is_none().then(|| self.stop(tile, reason.into()))
    }

    /// Ends every open tile for the caller's reason, and returns these tiles.
    pub fn close_all(&mut self, reason: Interruption) -> Vec<Stop> {
        (0..self.tiles.len()).filter_map(|tile| self.close(tile, reason)).collect()
    }

    /// Whether a tile is still open.
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

    /// Number of open tiles.
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

    /// What keeps a tile from being done, or has kept it until a limit; `None` if nothing does. A tile that no criterion has
    /// judged is open for [`OpenFor::FewSamples`]; what the session itself waits for is [`OpenFor::Doubt`].
    ///
    /// # Panics
    /// If the tile does not exist.
    pub fn open_for(&self, tile: usize) -> Option<OpenFor> {
        let TileState { stop, verdict, .. } = self.tiles[tile];
        match (stop, verdict) {
            (Some(stop), _) if stop.reason.is_satisfied() => None,
            _ if self.watch.doubts() && !self.criterion.only_counts() => Some(OpenFor::Doubt),
            (_, None) => Some(OpenFor::FewSamples),
            // More verdicts in a row are asked for, or more for this audience
            (_, Some(verdict)) => Some(verdict.open_for.unwrap_or(OpenFor::Noise)),
        }
    }

    /// How visible the noise is at each pixel of the image, row-major, as a multiple of what is just seen
    /// ([`StoppingCriterion::visible_noise`]); NaN where there is no evidence. Computed at each call. `None`
    /// before the display is settled, or if the criterion cannot say.
    pub fn visible_noise(&self) -> Option<Vec<f32>> {
        let display = (&self.display, self.settling);
        let view = view(&self.film, display, &self.params, &self.displayed_reference)?;
        self.criterion.visible_noise(&view)
    }

    /// The share of people who see no noise *anywhere* in the picture, by the last verdicts on its tiles: less than of
    /// the worst tile, and more than if people saw each tile by chance. `None` before all tiles have one, or if
    /// the criterion knows nothing of people.
    pub fn share_in_picture(&self) -> Option<f64> {
        let seen = |(tile, state): (Tile, &TileState)| Some((state.verdict?.probability?, tile.pixels()));
        let tiles: Vec<_> = self.film.grid().tiles().zip(&self.tiles).map(seen).collect::<Option<_>>()?;
        self.criterion.share_in_picture(self.params.viewing, &tiles)
    }

    /// Samples still to be taken, over all pixels, by the criterion's expectations; `None` while it has none
    /// for an open tile.
    pub fn expected_samples_to_go(&self) -> Option<u64> {
        let (max, audience) = (self.params.max_spp, self.audience());
        self.tiles.iter().enumerate().filter(|(_, state)| state.stop.is_none()).try_fold(
            0u64,
            |sum, (index, state)| {
                let goal = match state.goal {
                    Goal::Audience { spp } => spp,
                    Goal::Verdict { spp, .. } => {
                        audience.samples(state.verdict?.expected_spp?).clamp(spp.min(max), max)
                    }
                };
                let pixels = self.film.grid().tile(index).pixels() as u64;
                let missing = goal.saturating_sub(self.film.spp(index));
                Some(missing.saturating_mul(pixels).saturating_add(sum))
            },
        )
    }
}

/// What a criterion looks at; none before the display is settled.
fn view<'a>(
    film: &'a Film,
    (display, settling): (&'a Option<Display>, Option<Settling>),
    params: &Params,
    reference: &'a Option<Vec<Rgb>>,
) -> Option<View<'a>> {
    let view = View::new(film, display.as_ref()?).seen_on(params.viewing);
    let exposure_error = settling.map_or(0.0, |settling| settling.error);
    Some(View { audience: params.audience, reference: reference.as_deref(), exposure_error, ..view })
}

#[cfg(feature = "files")]
mod resume;
pub(crate) mod rounds;
#[cfg(test)]
mod tests;
