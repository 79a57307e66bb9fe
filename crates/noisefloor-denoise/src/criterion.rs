//! A limit on what people would see of the error of the denoised picture, as a stopping criterion.

use crate::denoiser::{DenoiseError, Denoiser, NoisyPicture, cut};
use crate::estimate::{DenoisedError, DenoisedHalves, ESTIMATE_ERRS_BY, PartError};
use crate::guides::Guides;
use crate::mirrored::DenoisePasses;
use crate::parts::{holds, parts_around, within};
use crate::record::{DENOISED_DECAY, Done, Record};
use crate::unmet::unmet_error;
use noisefloor::{
    Film, Rgb, StoppingCriterion, Tile, TileGrid, Verdict, Viewing,
    criterion::{CriterionError, Needs, OpenFor, View},
    display::{Display, luminance},
    evidence::{Plane, TilePlanes},
    unmet::Unmet,
};
use noisefloor_vision::{VisionModel, VisionWorkspace};
use rayon::prelude::*;
use std::error::Error;
use std::sync::Arc;

/// What stands before and after the limit in the criterion's name.
const AT_MOST: &str = "at most ";
const JOD_LOST: &str = " JOD lost after ";
/// A tile with more than one in this many pixels without valid samples gives no evidence.
const NO_EVIDENCE: usize = 16;
/// Noise is n^−DECAY of n samples.
const DECAY: f64 = 0.5;
/// Light that few samples have met is spread over ever more finds.
const UNMET_DECAY: f64 = 1.0;
/// A tile that needs n samples takes n^TOGETHER · N^(1 − TOGETHER), where the hardest so far needs N, but at most so many times
/// what the median tile does, if these are so many times more than it has.
const TOGETHER: f64 = 0.85;
const MOST_MEDIANS: f64 = 8.0;
const TOGETHER_STEP: f64 = 1.2;
/// An estimate below this share of the limit is taken by itself, and counts as so much beside others: where nothing is lost, it says
/// little of what is lost around it.
const LEAST: f64 = 0.25;
/// From so many tiles on, estimates that are pooled and counts that are drawn together make up for most of what estimates err
/// by, and this is left of the margin: [`stops_err_by`].
const COMPANY: usize = 16;
const ERR_BY_IN_COMPANY: f64 = 1.2;
/// A tile that has been looked at before is not again where it needs at most so many times what it has. In scenes that are hard for
/// denoisers, errors fall as n^−0.2: the margin makes up for that over twice the samples, and not over eight times.
const FORESEEN: u64 = 2;
/// JODs that a tile may lose, unless one says otherwise. Where people stopped seeing *noise*, zones had lost as much,
/// on average over the human data; 0.08 to 0.38 by scene.
pub const DEFAULT_JODS_LOST: f64 = 0.3;
/// Edge of the square that a smaller tile is judged in, in pixels: as [`noisefloor::tune::PicturePair::squares`].
const SQUARE: usize = 64;
/// Contrasts between which an error is sought that is just allowed, and how well it is found.
const CONTRASTS: (f64, f64) = (1.0 / 64.0, 8.0);
const CONTRAST_TOLERANCE: f64 = 1.05;

/// Stops a tile when the *denoised* picture has lost little against the converged one, in the eyes of the
/// vision model.
///
/// The two halves of the film are denoised apart, whole, and [`DenoisedError`] says how wrong the denoised
/// picture is; the vision model says how many just-objectionable differences (JOD) each tile has lost by that. A tile with
/// a side of less than 64 pixels is also done when the square of 64 pixels around it is: the smaller the tiles, the
/// fewer samples go to where nothing asks for them.
///
/// A tile is also done when its noise, as rendered, has lost as little: denoisers smear some details however many samples
/// they are given. [`Verdict::undenoised`] says so, and [`compose`](crate::compose) shows such tiles as they were rendered.
///
/// An estimate is pooled with earlier ones of the tile, and with those of the tiles around it. And counts are drawn together: a tile
/// that is satisfied goes on being sampled, a little, while others need far more; it is not looked at again. For the same promise,
/// this leaves less in the mean. Nor is a tile looked at a third time whose second estimate says that it needs at most twice its samples: it
/// is sampled so far.
///
/// A tile stays open as long as it is likely to lack light that few samples have met ([`Verdict::open_for`]), and that would by itself
/// lose more than the limit where it fell on a plain field as bright as the tile: a denoiser takes lone finds for noise, and removes
/// them. What is found later opens tiles again that had stopped.
///
/// A verdict takes two denoisings, of the whole picture or, where the denoiser can do that, of what lies around tiles that are not
/// satisfied yet, and none where all are: use a
/// schedule with growing intervals, such as
/// [`Schedule::Growing`](noisefloor::Schedule::Growing).
///
/// Nobody has been asked about denoised tiles: the threshold is the vision model's, which was fitted to
/// judgements of other distortions, blur and compression among them.
#[derive(Debug)]
pub struct DenoisedQuality<D> {
    denoiser: D,
    lost: f64,
    guides: Option<Arc<Guides>>,
    passes: DenoisePasses,
    record: Record,
    /// Verdicts that were not asked for, until they are fetched.
    revised: Vec<(Tile, Verdict)>,
}

impl<D: Denoiser> DenoisedQuality<D> {
    /// Tiles may lose at most so many JODs, a positive number: 19 of 20 that stop have lost no more, as their estimates
    /// are held to it with a margin, [`stops_err_by`].
    pub fn new(denoiser: D, lost: f64) -> Self {
        let (guides, passes) = (None, DenoisePasses::One);
        Self { denoiser, lost, guides, passes, record: Record::default(), revised: Vec::new() }
    }

    /// Helps the denoiser with albedo and normals.
    #[must_use]
    pub fn guided_by(self, guides: Arc<Guides>) -> Self {
        Self { guides: Some(guides), ..self }
    }

    /// Says that the finished picture is a mean of mirror images, a [`MirrorMean`](crate::MirrorMean). Verdicts go by one
    /// pass, and by what the mean is known to gain, an error of ×0.97.
    #[must_use]
    pub fn shown_as_mean_of(self, passes: DenoisePasses) -> Self {
        Self { passes, ..self }
    }

    /// The error in each of these rectangles of the picture.
    fn estimate(&mut self, view: &View<'_>, parts: &[Tile]) -> Result<Vec<PartError>, CriterionError> {
        let size = view.film.grid().size();
        let halves = film_halves(view.film);
        let wants = self.denoiser.wants();
        let mut pictures = halves.each_ref().map(|half| NoisyPicture::new(size, half));
        if let Some(guides) = &self.guides {
            let (guided, clean) = (pictures.iter_mut().zip(guides.halves()), guides.is_clean());
            guided.for_each(|(picture, guide)| *picture = picture.guided(guide, clean, wants));
        }
        let made =
            self.denoiser.denoise_parts(pictures.each_ref(), parts).map_err(|error| self.failed(&error))?;
        if made.len() != parts.len() {
            let why = format!("it was asked for {} parts, and returned {}", parts.len(), made.len());
            return Err(CriterionError::Failed { name: self.name(), why });
        }
        if let Some(odd) = made.iter().flatten().flatten().flatten().find(|value| !value.is_finite()) {
            let why = format!("the denoiser returned {odd}, where radiance is finite");
            return Err(CriterionError::Failed { name: self.name(), why });
        }
        let errors = parts.iter().zip(&made).map(|(&part, [da, db])| {
            let [a, b] = halves.each_ref().map(|half| cut(half, size.0, part));
            let size = (part.width, part.height);
            let halves = DenoisedHalves { size, noisy: [&a, &b], denoised: [da, db] };
            let error = DenoisedError::new(&halves, view.display).map_err(|error| self.failed(&error))?;
            Ok((part, error.scaled(self.passes.gain())))
        });
        errors.collect()
    }

    /// Samples per pixel that each satisfied tile is still to have, where others need more; `None` for whoever has enough.
    fn together(&self, film: &Film) -> Vec<Option<u64>> {
        let has = |tile: usize| film.spp(tile) as f64;
        let needs: Vec<f64> = self
            .record
            .done
            .iter()
            .enumerate()
            .map(|(tile, done)| done.map_or(has(tile), |done| done.spp as f64))
            .collect();
        let wanted = drawn_together(&needs).into_iter().zip(&self.record.done).enumerate();
        wanted
            .map(|(tile, (wanted, done))| {
                let foreseen = done.is_some_and(|done| done.spp > film.spp(tile));
                let more = foreseen || done.is_some() && wanted >= TOGETHER_STEP * has(tile);
                more.then_some(wanted as u64)
            })
            .collect()
    }

    fn failed(&self, error: &DenoiseError) -> CriterionError {
        let (mut why, mut cause) = (error.to_string(), error.source());
        while let Some(error) = cause {
            why = format!("{why}: {error}");
            cause = error.source();
        }
        CriterionError::Failed { name: self.name(), why }
    }
}

/// Of tiles that stop by [`DenoisedQuality`], in a picture of so many, 19 of 20 have lost less than so many times as much as
/// was estimated when they stopped. A tile stops where its estimate errs to the low side; in a large
/// picture, it is pooled with others, and most tiles go on beside those that need more.
pub fn stops_err_by(tiles: usize) -> f64 {
    if tiles < COMPANY { ESTIMATE_ERRS_BY } else { ERR_BY_IN_COMPANY }
}

/// The samples per pixel that tiles are to have, from those that each needs by itself: no fewer. Needs are estimates: where they
/// are low by chance, the power makes up for some of it. What one tile lacks lifts the others no further than what [`MOST_MEDIANS`]
/// bounds.
fn drawn_together(needs: &[f64]) -> Vec<f64> {
    let mut sorted = needs.to_vec();
    sorted.sort_by(f64::total_cmp);
    let (Some(median), Some(most)) = (sorted.get(sorted.len() / 2), sorted.last()) else { return sorted };
    let most = most.min(MOST_MEDIANS * median);
    needs.iter().map(|need| need.max(need.powf(TOGETHER) * most.powf(1.0 - TOGETHER))).collect()
}

/// The two halves of a film, row-major; where one has no valid sample, it shows the other.
fn film_halves(film: &Film) -> [Vec<Rgb>; 2] {
    let grid = film.grid();
    let mut halves = [0, 1].map(|_| vec![[0.0; 3]; grid.width() * grid.height()]);
    for tile in grid.tiles() {
        for pixel in tile.rows(grid.width()).flatten() {
            let [(a, na), (b, nb)] = film.pixel_halves(tile.index, pixel);
            halves[0][pixel] = if na > 0 { a } else { b };
            halves[1][pixel] = if nb > 0 { b } else { a };
        }
    }
    halves
}

impl<D: Denoiser> StoppingCriterion for DenoisedQuality<D> {
    fn name(&self) -> String {
        let guided = match &self.guides {
            Some(guides) if guides.is_clean() => " with clean albedo and normals",
            Some(_) => " with albedo and normals",
            None => "",
        };
        let mean = match self.passes.count() {
            1 => String::new(),
            count => format!(", mean of {count} mirror images"),
        };
        format!("{AT_MOST}{}{JOD_LOST}{}{guided}{mean}", self.lost, self.denoiser.name())
    }

    fn fingerprint(&self) -> String {
        self.name()
    }

    /// With a smaller limit.
    fn asks_for_more_than(&self, fingerprint: &str) -> bool {
        let parts = |text: &str| {
            let (lost, how) = text.strip_prefix(AT_MOST)?.split_once(JOD_LOST)?;
            Some((lost.parse::<f64>().ok()?, how.to_owned()))
        };
        let (kept, now) = (parts(fingerprint), parts(&self.name()));
        kept.zip(now).is_some_and(|((kept, how), (now, how_now))| now < kept && how == how_now)
    }

    fn begin(&mut self, grid: TileGrid) {
        self.record = Record::new(grid);
        self.revised.clear();
    }

    fn needs(&self) -> Needs {
        Needs::HALVES
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        if !(self.lost > 0.0 && self.lost.is_finite()) {
            let why = format!("a tile may lose a positive number of JODs, not {}", self.lost);
            return Err(CriterionError::Failed { name: self.name(), why });
        }
        let grid = view.film.grid();
        if self.record.done.len() != grid.len() {
            self.begin(grid);
        }
        // What a verdict would say of a satisfied tile that has more samples is known, unless it is displayed otherwise
        let exposure = view.display.exposure();
        let known = |tile: &Tile| self.record.done[tile.index].is_some_and(|done| done.ahead);
        let moved = self.record.exposure != exposure;
        let looked: Vec<Tile> = tiles.iter().filter(|tile| moved || !known(tile)).copied().collect();
        let parts = parts_around(&looked, grid.size());
        let errors = if looked.is_empty() { Vec::new() } else { self.estimate(view, &parts)? };
        self.record.exposure = exposure;
        let eyes = VisionModel::new(&view.viewing);
        // An exposure that is estimated adds to what estimates err by, which 19 of 20 do by 1.645 deviations at most; what is
        // seen grows with it, at most
        let err_by = stops_err_by(grid.len()).ln().hypot(1.645 * view.exposure_error).exp();
        let limits = [self.lost / err_by, self.lost / stops_err_by(grid.len())];
        let unmet = Unmet::of(view.film, view.display, view.viewing);
        let found: Vec<(&PartError, (Tile, u64, f64))> = looked
            .par_iter()
            .map_init(VisionWorkspace::default, |room, &tile| {
                let here = errors.iter().find(|(part, _)| holds(*part, tile))?;
                let eyes = &mut Eyes { model: &eyes, room };
                let (_, lost) = judged_by(&here.1, within(tile, here.0), eyes);
                Some((here, (tile, view.film.spp(tile.index), lost)))
            })
            .collect::<Option<_>>()
            .expect("each tile is in a part");
        let least = LEAST * limits[1];
        let at_least: Vec<_> =
            found.iter().map(|&(_, (tile, spp, lost))| (tile, spp, lost.max(least))).collect();
        let before: Vec<bool> = looked.iter().map(|&tile| self.record.has_seen(tile)).collect();
        let pooled = self.record.pool(grid, &at_least);
        let judged: Vec<(Verdict, Option<Done>)> = found
            .par_iter()
            .zip(pooled)
            .zip(before)
            .map_init(VisionWorkspace::default, |room, ((&(here, (tile, spp, own)), pooled), before)| {
                let eyes = &mut Eyes { model: &eyes, room };
                let lost = if own < least { own } else { pooled };
                let verdict = judge_tile(view, here, (tile, lost), limits, eyes);
                let done = satisfied(&verdict, spp, limits[0])
                    .filter(|done| done.spp == spp || before && has_evidence(view.film, tile));
                let dark = done.and_then(|_| darkness(view, &unmet, tile, self.lost, eyes));
                let kind = unmet.kind(view.film, tile);
                match dark {
                    Some(expected) => (verdict.kept_open_by(kind).expecting(expected), None),
                    None => (verdict, done),
                }
            })
            .collect();

        let mut said: Vec<Option<Verdict>> = vec![None; grid.len()];
        for (tile, (verdict, done)) in looked.iter().zip(judged) {
            let before = self.record.done[tile.index].filter(|_| verdict.converged);
            let spp = |done: Done| before.map_or(done.spp, |before| before.spp.min(done.spp));
            self.record.done[tile.index] = done.map(|done| Done { spp: spp(done), ..done });
            said[tile.index] = Some(verdict);
        }
        // Of tiles that were done, what has been found elsewhere since can say that they lack it
        let of_done = |tile: &Tile| Some((*tile, self.record.done[tile.index]?));
        let earlier: Vec<(Tile, Done)> = grid
            .tiles()
            .filter(|tile| said[tile.index].is_none())
            .filter_map(|tile| of_done(&tile))
            .collect();
        let dark: Vec<(Tile, Verdict)> = earlier
            .par_iter()
            .map_init(VisionWorkspace::default, |room, &(tile, done)| {
                let expected = darkness(view, &unmet, tile, self.lost, &mut Eyes { model: &eyes, room })?;
                let lost = done.lost_after(view.film.spp(tile.index));
                let verdict = Verdict::new(false).with_loss(lost, done.undenoised);
                Some((tile, verdict.kept_open_by(unmet.kind(view.film, tile)).expecting(expected)))
            })
            .flatten()
            .collect();
        for (tile, verdict) in dark {
            (self.record.done[tile.index], said[tile.index]) = (None, Some(verdict));
        }
        // Who is satisfied goes on beside those that are not
        let mut asked = vec![false; grid.len()];
        tiles.iter().for_each(|tile| asked[tile.index] = true);
        for (index, together) in self.together(view.film).into_iter().enumerate() {
            let Some(done) = &mut self.record.done[index] else { continue };
            done.ahead = together.is_some() || (done.ahead && !asked[index]);
            let lost = done.lost_after(view.film.spp(index));
            let satisfied = Verdict::new(true).with_loss(lost, done.undenoised);
            let verdict = said[index].unwrap_or(satisfied.expecting(Some(done.spp)));
            said[index] = Some(match together {
                Some(spp) => verdict.kept_open_by(OpenFor::Noise).expecting(Some(spp)),
                None => verdict,
            });
        }
        self.record.renew(grid.width(), &errors, &looked, &eyes);
        let answers =
            tiles.iter().map(|tile| said[tile.index].take().expect("it was looked at, or is known"));
        let answers = answers.collect();
        let open = |tile: Tile| Some((tile, said[tile.index].filter(|verdict| !verdict.converged)?));
        self.revised = grid.tiles().filter_map(open).collect();
        Ok(answers)
    }

    fn revised(&mut self) -> Vec<(Tile, Verdict)> {
        std::mem::take(&mut self.revised)
    }

    fn map_of_jods_lost(&self) -> Option<&[f32]> {
        Some(&self.record.map)
    }

    /// Verdicts follow from film and display alone; what is kept is which tiles are done, and the map of what is left.
    fn state(&self) -> Option<Vec<u8>> {
        Some(self.record.to_bytes())
    }

    fn restore(&mut self, grid: TileGrid, state: &[u8]) -> bool {
        Record::from_bytes(grid, state).map(|record| self.record = record).is_some()
    }
}

/// The vision model, and room for it.
struct Eyes<'a> {
    model: &'a VisionModel,
    room: &'a mut VisionWorkspace,
}

impl Eyes<'_> {
    /// JODs lost by an error of so many times its strength. A tile that cannot be compared stays open.
    fn lost(&mut self, error: &DenoisedError, contrast: f64) -> f64 {
        error.jods_lost_at(contrast as f32, self.model, self.room).unwrap_or(10.0)
    }

    /// The samples per pixel at which no more than `limit` is lost, of an error of `spp` samples that falls as
    /// n^−`decay`; `None` if it has to be weaker than [`CONTRASTS`] allow. No fewer than those of the strongest.
    fn needed(&mut self, error: &DenoisedError, limit: f64, (spp, decay): (u64, f64)) -> Option<u64> {
        let (mut low, mut high) = CONTRASTS;
        if self.lost(error, low) > limit {
            return None;
        }
        while high / low > CONTRAST_TOLERANCE {
            let middle = (low * high).sqrt();
            if self.lost(error, middle) <= limit { low = middle } else { high = middle }
        }
        Some((spp as f64 * low.powf(-1.0 / decay)).clamp(1.0, 1e15).ceil() as u64)
    }
}

fn judge_tile(
    view: &View<'_>,
    (part, error): &PartError,
    (tile, lost): (Tile, f64),
    [limit, at_known_exposure]: [f64; 2],
    eyes: &mut Eyes<'_>,
) -> Verdict {
    let (film, spp) = (view.film, view.film.spp(tile.index));
    let evidence = has_evidence(film, tile);
    let place = within(tile, *part);
    if lost <= limit {
        return Verdict::new(evidence).expecting(Some(spp)).with_loss(lost, false);
    }
    let brightness_differs = error.part(place).shift() > 0.0;
    // What a denoiser smears however many samples it gets is done when the noise is: no tile takes more samples denoised.
    // The noise is seen on the picture without noise, as good as the denoiser knows it; one that knows nothing of it, such as
    // a black one, hides no noise
    let part = error.part(place);
    let [on_denoised, on_rendered] = [Some(part.shown_in_channels().collect()), None]
        .map(|shown| noise_of(film, view.display, tile, shown))
        .map(|noise| (eyes.lost(&noise, 1.0), noise));
    let (of_noise, noise) = if on_denoised.0 >= on_rendered.0 { on_denoised } else { on_rendered };
    if of_noise <= limit {
        let verdict = Verdict::new(evidence).expecting(Some(spp)).with_brightness(brightness_differs);
        return verdict.with_loss(of_noise, evidence);
    }
    let enough = evidence && lost.min(of_noise) <= at_known_exposure;
    let why = if enough { OpenFor::Exposure } else { OpenFor::Noise };
    let verdict = Verdict::new(false).kept_open_by(why);
    let denoised = needed_denoised(lost, limit, spp);
    let verdict = verdict
        .expecting(Some(eyes.needed(&noise, limit, (spp, DECAY)).map_or(denoised, |n| n.min(denoised))));
    verdict.with_brightness(brightness_differs).with_loss(lost, false)
}

fn has_evidence(film: &Film, tile: Tile) -> bool {
    film.unsampled_pixels(tile.index) <= tile.pixels() / NO_EVIDENCE
}

/// The tile as one that is done, at the `spp` that it has or, if it lacks nothing but so many more, at those that it is to have.
fn satisfied(verdict: &Verdict, spp: u64, limit: f64) -> Option<Done> {
    let (lost, undenoised) = (verdict.lost?, verdict.undenoised);
    if verdict.converged {
        return Some(Done { lost, undenoised, spp, ahead: false });
    }
    let need = verdict.expected_spp.filter(|&need| need > spp && need <= FORESEEN.saturating_mul(spp))?;
    let undenoised = need < needed_denoised(lost, limit, spp);
    (verdict.open_for == Some(OpenFor::Noise)).then_some(Done {
        lost: limit,
        undenoised,
        spp: need,
        ahead: true,
    })
}

/// Whether a tile is likely to lack light, on a plain field as bright as it is, that would lose more than `limit`; then the
/// samples per pixel at which it does not, if these can be told.
fn darkness(
    view: &View<'_>,
    unmet: &Unmet,
    tile: Tile,
    limit: f64,
    eyes: &mut Eyes<'_>,
) -> Option<Option<u64>> {
    let film = view.film;
    let light = unmet_error(film, view.display, unmet, tile)?;
    (eyes.lost(&light, 1.0) > limit).then(|| eyes.needed(&light, limit, (film.spp(tile.index), UNMET_DECAY)))
}

/// The samples per pixel at which no more than `limit` is lost of a denoised picture that has lost more after `spp` samples.
fn needed_denoised(lost: f64, limit: f64, spp: u64) -> u64 {
    (spp as f64 * (lost / limit).powf(1.0 / DENOISED_DECAY)).clamp(1.0, 1e15).ceil() as u64
}

/// The part of the error that a tile is judged by, its own or the square around it, whichever has lost less, and what that is.
fn judged_by(error: &DenoisedError, tile: Tile, eyes: &mut Eyes<'_>) -> (DenoisedError, f64) {
    let places = [tile, square_around(tile, error.size())];
    let [own, around] = places.map(|place| error.part(place)).map(|part| (eyes.lost(&part, 1.0), part));
    let (lost, part) = if around.0 < own.0 { around } else { own };
    (part, lost)
}

/// The tile, grown to [`SQUARE`] pixels where a side is shorter, within the picture.
fn square_around(tile: Tile, (width, height): (usize, usize)) -> Tile {
    let grown = |at: usize, edge: usize, side: usize| {
        let wanted = edge.max(SQUARE.min(side));
        ((at + edge / 2).saturating_sub(wanted / 2).min(side - wanted), wanted)
    };
    let ((x, width), (y, height)) = (grown(tile.x, tile.width, width), grown(tile.y, tile.height, height));
    Tile { index: tile.index, x, y, width, height }
}

/// Samples per pixel, on average, that a picture would take without denoising until no tile has lost more than `limit`
/// JODs, estimated from the noise of its halves. `denoised` is what the noise is seen on,
/// row-major. `None` if that is out of sight for a tile.
pub fn spp_without_denoising(
    film: &Film,
    display: &Display,
    denoised: &[Rgb],
    viewing: Viewing,
    limit: f64,
) -> Option<f64> {
    let (grid, model) = (film.grid(), VisionModel::new(&viewing));
    let tiles: Vec<Tile> = grid.tiles().collect();
    let samples = tiles.par_iter().map_init(VisionWorkspace::default, |room, &tile| {
        let shown: Vec<Rgb> =
            tile.rows(grid.width()).flatten().map(|pixel| display.encode(denoised[pixel])).collect();
        let luma: Vec<f32> = shown.iter().map(|&pixel| luminance(pixel)).collect();
        let [red, blue] = [0, 2].map(|c| shown.iter().map(|pixel| pixel[c]).collect::<Vec<f32>>());
        let noise = noise_of(film, display, tile, Some(vec![&luma, &red, &blue]));
        let mut eyes = Eyes { model: &model, room };
        let spp = eyes.needed(&noise, limit, (film.spp(tile.index), DECAY))?;
        Some(spp as f64 * tile.pixels() as f64)
    });
    let samples: Option<Vec<f64>> = samples.collect();
    Some(samples?.iter().sum::<f64>() / (grid.width() * grid.height()) as f64)
}

/// Samples per pixel, on average, after which [`DenoisedQuality`] would have stopped all tiles of the *denoised* picture
/// with this limit, estimated from a film that was sampled for the noisy one, and so without albedo and normals. It takes the
/// error of its many samples for what would be left of that of far fewer, so it is rough: a factor of two is well
/// possible. `None` if that is out of sight for a tile.
///
/// # Errors
/// [`DenoiseError`] if the denoiser fails.
pub fn spp_with_denoising(
    film: &Film,
    display: &Display,
    mut denoiser: impl Denoiser,
    viewing: Viewing,
    limit: f64,
) -> Result<Option<f64>, DenoiseError> {
    let (grid, model) = (film.grid(), VisionModel::new(&viewing));
    let size = grid.size();
    let [a, b] = film_halves(film);
    let [da, db] = denoiser.denoise_both([&a, &b].map(|half| NoisyPicture::new(size, half)).each_ref())?;
    let error = DenoisedError::new(&DenoisedHalves { size, noisy: [&a, &b], denoised: [&da, &db] }, display)?;
    let tiles: Vec<Tile> = grid.tiles().collect();
    let needs = tiles.par_iter().map_init(VisionWorkspace::default, |room, &tile| {
        let mut eyes = Eyes { model: &model, room };
        let limit = limit / stops_err_by(tiles.len());
        let (here, _) = judged_by(&error, tile, &mut eyes);
        let part = error.part(tile);
        let noise = noise_of(film, display, tile, Some(part.shown_in_channels().collect()));
        let spp = film.spp(tile.index);
        let needs = [(&here, DENOISED_DECAY), (&noise, DECAY)];
        let needs = needs.map(|(error, decay)| eyes.needed(error, limit, (spp, decay)));
        Some(needs.into_iter().flatten().min()? as f64)
    });
    let needs: Option<Vec<f64>> = needs.collect();
    let sum = |needs: Vec<f64>| -> f64 {
        drawn_together(&needs).iter().zip(&tiles).map(|(spp, tile)| spp * tile.pixels() as f64).sum()
    };
    Ok(needs.map(|needs| sum(needs) / (size.0 * size.1) as f64))
}

/// The noise of a tile of the film, as displayed, on what is shown there, in Y′ or in Y′, R′ and B′, or on itself.
fn noise_of(film: &Film, display: &Display, tile: Tile, shown: Option<Vec<&[f32]>>) -> DenoisedError {
    let planes = TilePlanes::from_halves(film, display, tile);
    let mut channels = vec![[&planes.image, &planes.residual]];
    if let Some(colour) = &planes.colour {
        channels.extend([0, 2].map(|c| [&colour.image[c], &colour.residual[c]]));
    }
    let channel = |(n, [image, residual]): (usize, &[&Plane; 2])| {
        // What is shown without colour is grey
        let given = shown.as_ref().map(|shown| shown.get(n).unwrap_or(&shown[0]).to_vec());
        let shown = given.unwrap_or_else(|| image.inside(planes.inner).collect());
        [shown, residual.inside(planes.inner).collect()]
    };
    let channels = channels.iter().enumerate().map(channel).collect();
    DenoisedError::of((tile.width, tile.height), channels, display)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of five that need 100, 10, 1, 100 and 1,000, the hardest draws as 800 would; those above draw nobody down.
    #[test]
    fn counts_are_drawn_together_within_bounds() {
        // 100^0.85 · 800^0.15, 10^0.85 · 800^0.15, 800^0.15
        let right = [
            136.604_025_675_439_54,
            19.295_831_501_316_908,
            2.725_608_645_032_458,
            136.604_025_675_439_54,
            1000.0,
        ];
        let found = drawn_together(&[100.0, 10.0, 1.0, 100.0, 1000.0]);
        assert!(found.iter().zip(right).all(|(a, b)| (a / b - 1.0).abs() < 1e-12), "{found:?}");
        assert!(drawn_together(&[]).is_empty());
    }

    #[test]
    fn a_small_tile_is_in_the_middle_of_its_square_and_at_an_edge_as_near_as_can_be() {
        let around = |(x, y, width, height), size| {
            let square = square_around(Tile { index: 7, x, y, width, height }, size);
            (square.x, square.y, square.width, square.height)
        };
        assert_eq!(around((64, 96, 32, 32), (480, 270)), (48, 80, 64, 64));
        assert_eq!(around((0, 256, 32, 14), (480, 270)), (0, 206, 64, 64));
        assert_eq!(around((464, 0, 16, 16), (480, 270)), (416, 0, 64, 64));
        // Larger tiles are judged by themselves, and so are pictures that are smaller than a square
        assert_eq!(around((128, 0, 128, 128), (480, 270)), (128, 0, 128, 128));
        assert_eq!(around((32, 0, 16, 30), (48, 30)), (0, 0, 48, 30));
    }
}
