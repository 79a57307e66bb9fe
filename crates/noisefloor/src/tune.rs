//! The search for a renderer's own setting, such as its noise threshold, at which nobody sees noise.
//!
//! Renderers that sample adaptively know better than tiles *where* samples go; what they cannot know is
//! *when* people stop seeing noise. A [`Search`] finds the setting that says so: it names settings, the
//! caller renders two pictures of different seeds with each, and says how far they are from what may be
//! seen ([`Excess`]). It is a state machine: no files, no renderer, no clock.
//!
//! ```
//! use noisefloor::tune::{Ending, Excess, Knob, Search, drive};
//!
//! let mut search = Search::new(Knob::Threshold { coarsest: 0.1, finest: 0.001 })?;
//! // A renderer whose noise is seen as soon as its threshold is above 0.03
//! let ending = drive(&mut search, |look| Ok::<_, std::io::Error>((Excess::new(look.setting / 0.03), Vec::new())))?;
//! let Ending::Found { setting, .. } = ending else { panic!("{ending:?}") };
//! assert!(setting > 0.02 && setting <= 0.03);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod search;

pub use search::{Look, Search, drive};

use crate::criterion::{CriterionError, OpenFor, Verdict, View};
use crate::display::Display;
use crate::film::{Film, blend_row};
use crate::oracle::Oracle;
use crate::params::Params;
use crate::rgb::Rgb;
use crate::stills::{SnapshotPair, Still, StillError, StillWarning, film_of};
use crate::tile::{Tile, TileError, TileGrid};
use rayon::prelude::*;
use std::f64::consts::SQRT_2;
use thiserror::Error;

/// The target, as a share of what may be seen. The margin saves a step where an estimate is a tenth too high.
const AIM: f64 = 0.9;
/// The slope of log(excess) over log(effort), assumed until two steps have measured it: noise falls with the root of the samples.
const NOISE: f64 = 0.5;
/// Measured slopes are clamped to this range. The error of denoised pictures falls with slopes of 0.3 to 0.7.
/// While all pixels have the fewest samples that the renderer takes, it does not fall.
const SLOPES: (f64, f64) = (0.2, 1.0);
/// A step multiplies the effort by at least this factor and at most [`LEAP`]. A coarse picture says nothing of light that it
/// has not met, and a step too far is paid for twice.
const LEAST_STEP: f64 = 1.25;
const LEAP: f64 = 16.0;
/// If one picture has at least this share of √2 times what the mean of two coarser ones has left, nearly all pixels still have
/// the fewest samples that the renderer takes. Finer thresholds cost next to nothing until some pixels have more, so a step
/// then multiplies the effort by at least [`BLIND`].
const STILL: f64 = 0.97;
const BLIND: f64 = 8.0;
/// After three slopes in a row below this one, more samples are taken to be of no use: doubling the effort removes less than 4 %
/// of what is wrong. Two are not enough: where few pixels have more than the fewest samples, two leaps may change as little.
const FLAT: f64 = 0.06;
const FLAT_SLOPES: usize = 3;
/// A finer setting that leaves this many times as much has met light that coarser ones had not: they tell nothing of its noise.
const NEWLY_MET: f64 = 1.2;
/// A slope this near to 0 is none: the last step has changed nothing, nothing says how far that goes, and the next is a leap.
const SAME: f64 = 0.02;
/// The widest range of thresholds that is searched: its end takes 10¹⁸ times the samples of its beginning.
const WIDEST: f64 = 1e9;

/// A setting of a renderer that trades time for noise, and its range.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Knob {
    /// Samples per pixel.
    Samples {
        /// Where the search begins, at least 2.
        least: u64,
        /// Where it ends.
        most: u64,
    },
    /// A threshold on the noise of pixels, to which the noise that is left is about proportional, and the
    /// samples to its inverse square.
    Threshold {
        /// Where the search begins.
        coarsest: f64,
        /// Where it ends: a lower threshold, above 0.
        finest: f64,
    },
}

/// Why a range cannot be searched.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{0}")]
pub struct KnobError(String);

impl Knob {
    /// `samples` or `threshold`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Samples { .. } => "samples",
            Self::Threshold { .. } => "threshold",
        }
    }

    fn check(self) -> Result<(), KnobError> {
        match self {
            Self::Samples { least, most } if least < 2 || most / 2 < least.div_ceil(2) => {
                Err(KnobError(format!(
                    "samples are sought between {least} and {most}: at least 2, and the second not below the first"
                )))
            }
            Self::Threshold { coarsest, finest }
                if !(finest > 0.0
                    && coarsest >= finest
                    && coarsest.is_finite()
                    && coarsest / finest <= WIDEST) =>
            {
                Err(KnobError(format!(
                    "a threshold is sought from {coarsest} down to {finest}: both must be positive, \
                     the first not below the second and at most 10⁹ times it"
                )))
            }
            _ => Ok(()),
        }
    }

    /// The setting of each of two pictures whose mean is as good as one picture with `setting`.
    pub fn of_each(self, setting: f64) -> f64 {
        match self {
            Self::Samples { .. } => (setting / 2.0).ceil(),
            Self::Threshold { .. } => setting * SQRT_2,
        }
    }

    /// The setting of one picture that is as good as the mean of two, if noise follows the setting.
    fn of_both(self, each: f64) -> f64 {
        match self {
            Self::Samples { .. } => each * 2.0,
            Self::Threshold { .. } => each / SQRT_2,
        }
    }

    /// The logarithm of the samples that pictures with this setting take, in any unit.
    fn effort(self, each: f64) -> f64 {
        match self {
            Self::Samples { .. } => each.ln(),
            Self::Threshold { .. } => -2.0 * each.ln(),
        }
    }

    /// The setting of each picture for an effort, within the range, in numbers that people type.
    fn each(self, effort: f64) -> f64 {
        let each = match self {
            Self::Samples { .. } => effort.exp().ceil(),
            Self::Threshold { .. } => three_digits((-0.5 * effort).exp()),
        };
        each.clamp(self.coarsest().min(self.finest()), self.coarsest().max(self.finest()))
    }

    /// What the first two pictures are rendered with.
    fn coarsest(self) -> f64 {
        match self {
            Self::Samples { least, .. } => least.div_ceil(2) as f64,
            Self::Threshold { coarsest, .. } => coarsest * SQRT_2,
        }
    }

    /// What the last two are rendered with. With a threshold, one of them is to be enough alone.
    fn finest(self) -> f64 {
        match self {
            Self::Samples { most, .. } => (most / 2) as f64,
            Self::Threshold { finest, .. } => finest,
        }
    }
}

/// Rounds to three digits, which changes the effort by at most 1 %. By way of text, which gives the decimal number that people type.
fn three_digits(exact: f64) -> f64 {
    format!("{exact:.2e}").parse().unwrap_or(exact)
}

/// How far the mean of two pictures is from what may be seen, in the worst place.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Excess {
    /// The ratio of what is seen there to what may be seen: 1 passes, 2 is twice too much. At least 0; infinite where it is
    /// unknown.
    pub ratio: f64,
    /// The worst pixel, as x and y; `None` if nobody asked where.
    pub place: Option<(usize, usize)>,
    /// A number computed from the pictures, equal for equal pictures; 0 if unknown.
    pub pictures: u64,
    /// How far a single picture, rendered with the threshold divided by √2, would be from the limit: `ratio` where noise follows
    /// the threshold, up to √2 times as much where pixels have the fewest samples. `None`: unknown.
    pub alone: Option<f64>,
    /// The ratio below which no finer threshold gets, since the pixels that make it have the most samples that the renderer
    /// takes; 0 if unknown.
    pub floor: f64,
}

impl Excess {
    /// From a ratio alone.
    pub fn new(ratio: f64) -> Self {
        let ratio = if ratio >= 0.0 { ratio } else { f64::INFINITY };
        Self { ratio, place: None, pictures: 0, alone: None, floor: 0.0 }
    }

    /// Whether nearly all noise is of pixels that have the fewest samples that the renderer takes: until others have more, a
    /// finer threshold changes nothing.
    fn is_still(&self) -> bool {
        self.alone.is_some() && self.of_finer() > STILL * self.of_each()
    }

    /// Of each of the two pictures, at the most: noise that they do not share is smaller by √2 in their mean.
    fn of_each(&self) -> f64 {
        self.ratio * SQRT_2
    }

    /// Of one picture that is finer by √2, at the most.
    fn of_finer(&self) -> f64 {
        match self.alone {
            Some(alone) if alone <= self.of_each() => alone.max(self.ratio),
            _ => self.of_each(),
        }
    }
}

/// The samples of the pixels of a picture that a renderer sampled until its noise threshold.
#[derive(Clone, Debug, PartialEq)]
pub struct PixelCounts {
    /// Of each pixel, row-major.
    pub samples: Vec<f32>,
    /// The fewest that the renderer took.
    pub fewest: f32,
    /// The fewest of one picture whose threshold is finer by √2: `fewest` or more; twice as many, where two pictures share them.
    pub fewest_alone: f32,
    /// The most.
    pub most: f32,
}

impl PixelCounts {
    /// Of each pixel, row-major, with the limits in the order of the fields; `None` if they cannot be: limits are positive, counts not
    /// negative, and all are finite.
    pub fn new(samples: Vec<f32>, [fewest, fewest_alone, most]: [f32; 3]) -> Option<Self> {
        let possible = [fewest, fewest_alone, most].iter().all(|&limit| limit.is_finite() && limit > 0.0)
            && samples.iter().all(|&samples| samples.is_finite() && samples >= 0.0);
        possible.then_some(Self { samples, fewest, fewest_alone, most })
    }

    /// By how much the variance of one picture whose threshold is finer by √2 is larger than that of the mean of two, at a
    /// pixel with these samples in both; and whether both have the most there.
    fn alone(counts: [&Self; 2], pixel: usize) -> (f64, bool) {
        let samples = counts.map(|counts| counts.samples.get(pixel).copied().unwrap_or(counts.most));
        let each = || samples.iter().zip(counts);
        if each().any(|(&samples, counts)| samples > counts.fewest && samples < counts.most) {
            return (1.0, false);
        }
        let [one, _] = counts;
        let is_capped = each().all(|(&samples, counts)| samples >= counts.most);
        let shared = f64::from(one.fewest) / f64::from(one.fewest_alone);
        (if is_capped { 2.0 } else { 2.0 * shared }, is_capped)
    }
}

/// Edge of the squares that a picture is looked at in, in pixels: at a desk, 1.7°.
const SQUARE: usize = 64;

/// As [`PicturePair::squares`].
fn squares((width, height): (usize, usize)) -> Vec<Tile> {
    let places = |side: usize| {
        let last = side.saturating_sub(SQUARE);
        (0..last).step_by(SQUARE / 2).chain([last])
    };
    let (across, down) = (SQUARE.min(width), SQUARE.min(height));
    let square = |x, y| Tile { index: 0, x, y, width: across, height: down };
    let rows = places(height).flat_map(|y| places(width).map(move |x| (x, y)));
    rows.enumerate().map(|(index, (x, y))| Tile { index, ..square(x, y) }).collect()
}

/// The most that a map, row-major, has in each of these squares; infinite where a number is missing or is none.
fn most_in_squares(size: (usize, usize), map: &[f32]) -> Vec<(Tile, f64)> {
    let told =
        |pixel: usize| map.get(pixel).copied().filter(|number| !number.is_nan()).unwrap_or(f32::INFINITY);
    let most = |tile: &Tile| tile.rows(size.0).flatten().map(told).fold(0.0, f32::max);
    squares(size).into_iter().map(|tile| (tile, f64::from(most(&tile)))).collect()
}

/// Two pictures of one view, rendered with the same setting and different seeds, and their mean: what is
/// shown in the end, and what is judged.
#[derive(Clone, Debug, PartialEq)]
pub struct PicturePair {
    mean: Still,
    halves: [Still; 2],
}

/// Why two pictures could not be judged.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PairError {
    /// They cannot be compared.
    #[error(transparent)]
    Still(#[from] StillError),
    /// They are too small or too large.
    #[error(transparent)]
    Size(#[from] TileError),
    /// The model cannot judge them.
    #[error(transparent)]
    Criterion(#[from] CriterionError),
    /// The model cannot say how much noise is too much.
    #[error("a model with this descriptor does not tell noise from picture; the bundled model does")]
    NoMap,
    /// What judges them otherwise than by their noise cannot.
    #[error(transparent)]
    Judge(Box<dyn std::error::Error + Send + Sync>),
}

/// What was found of two pictures.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Looked {
    /// In the worst place.
    pub excess: Excess,
    /// What is wrong in each of [`PicturePair::squares`], over what may be wrong there.
    pub squares: Vec<(Tile, f64)>,
    /// How visible noise is at each pixel of the mean, row-major, 1 where it is just what may be; empty if something else was judged.
    pub map: Vec<f32>,
    /// What is likely wrong with the pictures: verdicts come too early or too late.
    pub warnings: Vec<StillWarning>,
    /// How the pictures are displayed: with the exposure of the converged one.
    pub display: Display,
}

impl PicturePair {
    /// Linear radiance, row-major, width × height values each. `spp` is samples per pixel of each: below 50, noise of few
    /// pixels is not trusted, and neither is a small picture. Where it is not known, 128, say.
    ///
    /// # Errors
    /// [`StillError`] if a pixel is not finite, the sizes do not fit, or the pictures are the same.
    pub fn new(size: (usize, usize), pictures: [Vec<Rgb>; 2], spp: f64) -> Result<Self, StillError> {
        let still =
            |pixels, spp| Still { size, pixels, spp, display_referred: false, rounding: 0.0, origin: None };
        let [one, other] = pictures.map(|pixels| still(pixels, spp));
        one.check()?;
        other.check()?;
        one.fits(&other)?;
        let mut mean = vec![[0.0; 3]; one.pixels.len()];
        let rows = one.pixels.par_chunks(size.0).zip(other.pixels.par_chunks(size.0));
        let rows = rows.zip(mean.par_chunks_mut(size.0));
        rows.for_each(|((one, other), mean)| blend_row([one, other], [0.5; 2], mean));
        Ok(Self { mean: still(mean, 2.0 * spp), halves: [one, other] })
    }

    /// Width and height.
    pub fn size(&self) -> (usize, usize) {
        self.mean.size
    }

    /// The squares of the picture of which the worst counts: of 64 pixels, overlapping by half, row by row; those of a
    /// picture that is smaller are cut.
    pub fn squares(&self) -> Vec<Tile> {
        squares(self.size())
    }

    /// The mean of both, row-major.
    pub fn mean(&self) -> &[Rgb] {
        &self.mean.pixels
    }

    /// Both pictures, row-major.
    pub fn halves(&self) -> [&[Rgb]; 2] {
        self.halves.each_ref().map(|half| half.pixels.as_slice())
    }

    /// How far the noise of the mean is from what the share of people asked for does not see: as a session has it whose film has
    /// the two pictures as its halves, with the light that they are likely not to have met, and with more samples wanted
    /// where noise is not trusted yet. `counts` are the samples of the pixels of both, where the renderer tells.
    ///
    /// # Errors
    /// [`PairError`], also if the pictures are no two of one view, or no light.
    pub fn look(
        &self,
        oracle: &Oracle,
        params: &Params,
        counts: Option<[&PixelCounts; 2]>,
    ) -> Result<Looked, PairError> {
        let (compared, film) = self.compare(params)?;
        let warnings = compared.notice(film.grid())?.warnings;
        let (display, viewing) = (compared.display(), params.viewing);
        let view = View { audience: params.audience, ..View::new(&film, display).seen_on(viewing) };
        let (verdicts, map) = oracle.judge_all(&view)?;
        let map = map.ok_or(PairError::NoMap)?;

        let worst = (0..map.len()).max_by(|&a, &b| map[a].total_cmp(&map[b]));
        let ratio = worst.map_or(0.0, |worst| f64::from(map[worst]));
        // Noise falls as the root of the samples
        let wanted = |verdict: &Verdict| verdict.expected_spp.map_or(f64::INFINITY, |spp| spp as f64);
        let few = verdicts.iter().filter(|verdict| verdict.open_for == Some(OpenFor::FewSamples));
        let ratio = ratio.max((few.map(wanted).fold(0.0, f64::max) / film.spp(0) as f64).sqrt());
        let place = worst.map(|worst| (worst % self.size().0, worst / self.size().0));
        let squares = most_in_squares(self.size(), &map);
        let excess = self.known(Excess { place, ..Excess::new(ratio) }, &squares, counts);
        Ok(Looked { excess, squares, map, warnings, display: display.clone() })
    }

    /// The same by what `judge` finds in each of [`PicturePair::squares`], over what may be wrong there: of the pictures as
    /// they are displayed, and of a film that has them as its halves. There is no map.
    ///
    /// # Errors
    /// As [`PicturePair::look`], and those of `judge`.
    pub fn look_by(
        &self,
        params: &Params,
        counts: Option<[&PixelCounts; 2]>,
        judge: impl FnOnce(&Display, &Film) -> Result<Vec<(Tile, f64)>, PairError> + Send,
    ) -> Result<Looked, PairError> {
        let (compared, film) = self.compare(params)?;
        let display = compared.display();
        // Each has moments in which one thread works alone
        let (noticed, squares) = rayon::join(|| compared.notice(film.grid()), || judge(display, &film));
        let (warnings, squares) = (noticed?.warnings, squares?);
        let worst = squares.iter().max_by(|a, b| a.1.total_cmp(&b.1));
        let (ratio, place) = worst.map_or((0.0, None), |(square, ratio)| {
            (*ratio, Some((square.x + square.width / 2, square.y + square.height / 2)))
        });
        let excess = self.known(Excess { place, ..Excess::new(ratio) }, &squares, counts);
        Ok(Looked { excess, squares, map: Vec::new(), warnings, display: display.clone() })
    }

    /// The mean beside the two pictures as its halves, with the exposure of the converged picture; and a film that has these
    /// halves.
    fn compare(&self, params: &Params) -> Result<(SnapshotPair<'_>, Film), TileError> {
        let [one, other] = &self.halves;
        let grid = TileGrid::new(self.size().0, self.size().1, params.tile)?;
        let compared = SnapshotPair::of_halves(&self.mean, [one, other], &params.tone_mapping);
        Ok((compared.seen_on(params.viewing), film_of([one, other], grid)))
    }

    /// An excess of these pictures with what tells them from others, and with what is known of *one* whose threshold is finer by
    /// √2 ([`Excess::alone`], [`Excess::floor`]), by the samples that their pixels have. `squares` are those of the picture, with
    /// what is wrong in each.
    ///
    /// Where pixels have more than the fewest samples and less than the most, their noise follows the threshold, and that
    /// picture is as good as the mean of both.
    fn known(&self, excess: Excess, squares: &[(Tile, f64)], counts: Option<[&PixelCounts; 2]>) -> Excess {
        let excess = Excess { pictures: self.digest(), ..excess };
        let Some(counts) = counts else { return excess };
        let grey = |[r, g, b]: Rgb| (f64::from(r) + f64::from(g) + f64::from(b)) / 3.0;
        let [one, other] = self.halves();
        let mean = self.mean().iter().map(|&pixel| grey(pixel)).sum::<f64>() / self.mean().len() as f64;
        // Noise as a share of the light: what is seen on the screen is near to that
        let strength = |pixel: usize| {
            let light = (grey(one[pixel]) + grey(other[pixel])) / 2.0;
            ((grey(one[pixel]) - grey(other[pixel])) / (light + mean + 1e-9)).powi(2)
        };
        let of_square = |(square, ratio): &(Tile, f64)| {
            let (mut all, mut larger, mut capped) = (0.0, 0.0, 0.0);
            for pixel in square.rows(self.size().0).flatten() {
                let (strength, (times, is_capped)) = (strength(pixel), PixelCounts::alone(counts, pixel));
                (all, larger) = (all + strength, larger + strength * times);
                capped += if is_capped { strength } else { 0.0 };
            }
            // Of a picture without any noise, nothing is known
            if all <= 0.0 {
                return (ratio * SQRT_2, 0.0);
            }
            let alone = ratio * (larger / all).sqrt();
            // What is wrong falls at most with the variance of the noise
            let floor = if capped >= all { alone } else { ratio * (2.0 * capped / all).min(1.0) };
            (alone, floor)
        };
        let all: Vec<(f64, f64)> = squares.par_iter().map(of_square).collect();
        // What is worst in one picture need not be worst in the mean
        let worst = all.into_iter().reduce(|a, b| (a.0.max(b.0), a.1.max(b.1)));
        worst.map_or(excess, |(alone, floor)| Excess { alone: Some(alone), floor, ..excess })
    }

    /// A number that follows from the pictures, whichever comes first (FNV-1a, of parts and then of their numbers); not 0.
    fn digest(&self) -> u64 {
        const AT_ONCE: usize = 1 << 14;
        fn fnv(numbers: impl Iterator<Item = u64>) -> u64 {
            numbers.fold(0xcbf2_9ce4_8422_2325, |hash, number| {
                (hash ^ number).wrapping_mul(0x0000_0100_0000_01b3)
            })
        }
        let of_part = |part: &[Rgb]| fnv(part.as_flattened().iter().map(|c| u64::from(c.to_bits())));
        let of_one = |still: &Still| {
            let parts: Vec<u64> = still.pixels.par_chunks(AT_ONCE).map(of_part).collect();
            fnv(parts.into_iter())
        };
        let [one, other] = self.halves.each_ref().map(of_one);
        one.wrapping_add(other).max(1)
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Step {
    /// What each of the two was rendered with.
    each: f64,
    excess: Excess,
}

impl Step {
    /// Whether the pictures are known to be the same.
    fn draws_as(&self, other: &Self) -> bool {
        self.excess.pictures == other.excess.pictures && self.excess.pictures != 0
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Next {
    /// Two pictures, each with this setting.
    Render(f64),
    Done(Ending),
}

/// How a search ended.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Ending {
    /// One picture with the setting shows nothing that should not be seen.
    Found {
        /// The setting: that of two pictures of which each is enough, by their mean; or, where it is known how the samples of
        /// pixels follow the threshold ([`Excess::alone`]), a little finer than that of two pictures whose mean is enough.
        setting: f64,
        /// The finest one that was tried and is not enough; `None` if the coarsest of all is.
        too_coarse: Option<f64>,
    },
    /// Even the finest setting leaves this much too much.
    AtFinest {
        /// Over what may be seen.
        ratio: f64,
    },
    /// All settings down to the finest gave the same pictures. The renderer ignores the setting, or is held by another limit, such
    /// as its most or its fewest samples.
    Unchanged,
    /// Finer settings leave as much, since the pixels that make it have the most samples that the renderer takes.
    Capped {
        /// Over what may be seen.
        ratio: f64,
    },
    /// More effort does not reduce what is seen: it is no noise, few samples find the light, or the pictures are not
    /// independent.
    NotFalling {
        /// Over what may be seen.
        ratio: f64,
    },
}

impl Ending {
    /// `found`, `at-finest`, `unchanged`, `capped` or `not-falling`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Found { .. } => "found",
            Self::AtFinest { .. } => "at-finest",
            Self::Unchanged => "unchanged",
            Self::Capped { .. } => "capped",
            Self::NotFalling { .. } => "not-falling",
        }
    }
}

/// The search of a setting, whatever it is looked at in.
///
/// It begins with the coarsest setting. Each step draws a line through the last two, in logarithms of excess and effort, and
/// goes to where the line meets what may be seen; the first step assumes that noise falls as 1/√n. It claims only what it has
/// looked at.
#[derive(Clone, Debug, PartialEq)]
struct Tuning {
    knob: Knob,
    steps: Vec<Step>,
    /// The first step that those after it can be compared with: before, parts stood for the whole, or light was not met, and
    /// they were too easy.
    since: usize,
}

impl Tuning {
    fn new(knob: Knob) -> Result<Self, KnobError> {
        knob.check()?;
        Ok(Self { knob, steps: Vec::new(), since: 0 })
    }

    /// The setting to try, or how it ended. The same until [`Tuning::tell`].
    fn next(&self) -> Next {
        let Some(last) = self.steps.last() else { return Next::Render(self.knob.coarsest()) };
        if let Some(setting) = self.passed() {
            return Next::Done(Ending::Found { setting, too_coarse: self.too_coarse(setting) });
        }
        let ratio = last.excess.ratio;
        if last.excess.floor > 1.0 {
            return Next::Done(Ending::Capped { ratio });
        }
        if last.each == self.knob.finest() {
            let before = self.steps.iter().rev().nth(1);
            return Next::Done(match before {
                Some(before) if before.draws_as(last) => Ending::Unchanged,
                Some(_) if self.is_flat() => Ending::NotFalling { ratio },
                _ => Ending::AtFinest { ratio },
            });
        }
        // Where pixels have the fewest samples that the renderer takes, finer thresholds may still help; where samples follow, no
        let follows = self.is_samples() || last.excess.of_finer() < last.excess.of_each();
        if follows && self.is_flat() {
            return Next::Done(Ending::NotFalling { ratio });
        }
        let next = self.knob.each(self.knob.effort(last.each) + self.times_from(last).ln());
        // Rounding must not stand still
        Next::Render(if next == last.each { self.knob.finest() } else { next })
    }

    /// What was found with the setting that [`Tuning::next`] named; without one, nothing happens. A ratio that is not a number or
    /// negative counts as infinite.
    fn tell(&mut self, excess: Excess) {
        if let Next::Render(each) = self.next() {
            self.push(each, excess);
        }
    }

    /// What was found elsewhere, with this setting of each picture, and not enough after all.
    fn reopen(&mut self, each: f64, excess: Excess) {
        self.since = self.steps.len();
        self.push(each, excess);
    }

    fn push(&mut self, each: f64, excess: Excess) {
        let excess = Excess { ratio: Excess::new(excess.ratio).ratio, ..excess };
        if self.steps.last().is_some_and(|before| excess.ratio > NEWLY_MET * before.excess.ratio) {
            self.since = self.steps.len();
        }
        self.steps.push(Step { each, excess });
    }

    fn is_samples(&self) -> bool {
        matches!(self.knob, Knob::Samples { .. })
    }

    /// The coarsest setting of one picture that two with `each` say is enough, if they say so of any.
    fn enough(&self, each: f64, excess: &Excess) -> Option<f64> {
        let (coarsest, finest) = match self.knob {
            // Samples are samples, in two pictures or one
            Knob::Samples { .. } => return (excess.ratio <= 1.0).then_some(self.knob.of_both(each)),
            Knob::Threshold { coarsest, finest } => (coarsest, finest),
        };
        let (of_each, of_finer) = (excess.of_each(), excess.of_finer());
        if of_each <= 1.0 {
            return Some(each.min(coarsest));
        }
        if of_finer > 1.0 {
            return None;
        }
        // Of the noise, a share falls with the threshold, so that the square of what is wrong is a·t² + b: it is known at `each`
        // and at `each`/√2
        let less = (of_each.powi(2) - 1.0) / (of_each.powi(2) - of_finer.powi(2)) / 2.0;
        let exact = each * (1.0 - less).sqrt();
        let rounded = three_digits(exact);
        let setting = if rounded <= exact { rounded } else { three_digits(exact * 0.99) };
        (setting >= finest).then_some(setting.min(coarsest))
    }

    /// The setting that is enough, of the cheapest step that says so.
    fn passed(&self) -> Option<f64> {
        let all = self.steps[self.since..].iter();
        let passed = all.filter_map(|step| Some((self.enough(step.each, &step.excess)?, step.each)));
        passed
            .reduce(|a, b| if self.knob.effort(b.1) < self.knob.effort(a.1) { b } else { a })
            .map(|(setting, _)| setting)
    }

    /// The finest setting of one picture that was tried and is coarser than this one.
    fn too_coarse(&self, enough: f64) -> Option<f64> {
        let tried = self.steps.iter().filter(|step| self.enough(step.each, &step.excess).is_none());
        let single = |step: &Step| if self.is_samples() { self.knob.of_both(step.each) } else { step.each };
        let coarser = |setting: &f64| if self.is_samples() { *setting < enough } else { *setting > enough };
        let all = tried.map(single).filter(coarser);
        if self.is_samples() { all.reduce(f64::max) } else { all.reduce(f64::min) }
    }

    /// How many times the effort comes next.
    fn times_from(&self, last: &Step) -> f64 {
        let left = if self.is_samples() { last.excess.ratio } else { last.excess.of_finer() };
        if !left.is_finite() {
            return LEAP;
        }
        let measured = self.slopes().next_back().unwrap_or(NOISE);
        let slope = measured.clamp(SLOPES.0, SLOPES.1);
        let least = match last.excess.is_still() {
            _ if measured.abs() < SAME => LEAP,
            true => BLIND,
            false => LEAST_STEP,
        };
        (left / AIM).powf(1.0 / slope).clamp(least, LEAP)
    }

    /// By how much log(excess) fell for log(effort), step by step.
    fn slopes(&self) -> impl DoubleEndedIterator<Item = f64> {
        let slope = |pair: &[Step]| {
            let fell = (pair[0].excess.ratio / pair[1].excess.ratio).ln();
            fell / (self.knob.effort(pair[1].each) - self.knob.effort(pair[0].each))
        };
        self.steps[self.since..].windows(2).map(slope).filter(|slope| !slope.is_nan())
    }

    fn is_flat(&self) -> bool {
        let last: Vec<f64> = self.slopes().rev().take(FLAT_SLOPES).collect();
        last.len() == FLAT_SLOPES && last.iter().all(|&slope| slope < FLAT)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use noisefloor_testkit::Noise;
    use proptest::prelude::*;

    const THRESHOLD: Knob = Knob::Threshold { coarsest: 0.1, finest: 0.001 };
    const SAMPLES: Knob = Knob::Samples { least: 16, most: 65_536 };

    fn search(knob: Knob, excess: impl Fn(f64) -> Excess) -> (Ending, Vec<Step>) {
        let mut tuning = Tuning::new(knob).unwrap();
        (finish(&mut tuning, |each| excess(knob.of_both(each))), tuning.steps)
    }

    /// Goes on to the end; `excess` is that of two pictures which are rendered with this setting each.
    fn finish(tuning: &mut Tuning, excess: impl Fn(f64) -> Excess) -> Ending {
        for _ in 0..20 {
            match tuning.next() {
                Next::Render(each) => tuning.tell(excess(each)),
                Next::Done(ending) => return ending,
            }
        }
        panic!("no end after {:?}", tuning.steps);
    }

    /// Noise in one half of a picture, none in the other; the fewest samples, the most, or some in between.
    #[test]
    fn what_one_picture_leaves_follows_from_the_samples_of_its_pixels() {
        let size = (128, 64);
        let picture = |seed: u64| -> Vec<Rgb> {
            let mut noise = Noise::keyed(&[31, seed]);
            let of = |i: usize| if i % size.0 < 64 { 1.0 } else { 1e-4 };
            (0..size.0 * size.1).map(|i| [1.0 + of(i) * 0.1 * noise.normal() as f32; 3]).collect()
        };
        let pair = PicturePair::new(size, [picture(1), picture(2)], 32.0).unwrap();
        let square = |x| Tile { index: 0, x, y: 0, width: 64, height: 64 };
        let found = |left: f32, right: f32, fewest_alone: f32, ratios: [f64; 2]| {
            let samples = (0..size.0 * size.1).map(|i| if i % size.0 < 64 { left } else { right }).collect();
            let counts = PixelCounts { samples, fewest: 32.0, fewest_alone, most: 256.0 };
            let squares = [(square(0), ratios[0]), (square(64), ratios[1])];
            let told = pair.known(Excess::new(ratios[0].max(ratios[1])), &squares, Some([&counts; 2]));
            (told.alone.unwrap(), told.floor)
        };
        let near = |(alone, floor): (f64, f64), right: f64, lowest: f64| {
            assert!((alone / right - 1.0).abs() < 1e-6 && (floor - lowest).abs() < 1e-6, "{alone} {floor}");
        };
        // As good as both where samples follow, or where two share the fewest; √2 times where one has as many as each
        near(found(100.0, 100.0, 64.0, [2.0, 1.0]), 2.0, 0.0);
        near(found(32.0, 32.0, 64.0, [2.0, 1.0]), 2.0, 0.0);
        near(found(32.0, 32.0, 48.0, [2.0, 1.0]), 2.0 * (4f64 / 3.0).sqrt(), 0.0);
        near(found(32.0, 32.0, 32.0, [2.0, 1.0]), 2.0 * SQRT_2, 0.0);
        // Where all have the most, nothing helps
        near(found(256.0, 100.0, 64.0, [2.0, 1.0]), 2.0 * SQRT_2, 2.0 * SQRT_2);
        // The worst of one picture is elsewhere than that of the mean
        near(found(100.0, 256.0, 64.0, [2.0, 1.6]), 1.6 * SQRT_2, 1.6 * SQRT_2);
        // A quarter of the pixels with the most make a quarter of the noise; its sum over 1,024 pixels scatters by 4 %
        let quarter = (0..size.0 * size.1).map(|i| if i % 4 == 0 { 256.0 } else { 100.0 }).collect();
        let quarter = PixelCounts { samples: quarter, fewest: 32.0, fewest_alone: 64.0, most: 256.0 };
        let told = pair.known(Excess::new(2.0), &[(square(0), 2.0)], Some([&quarter; 2]));
        assert!((told.floor - 1.0).abs() < 0.2 && (told.alone.unwrap() / 2.0 - 1.25f64.sqrt()).abs() < 0.05);
        // Of one picture that is stopped early nothing but its own is known
        let nothing = PixelCounts { samples: Vec::new(), fewest: 32.0, fewest_alone: 64.0, most: 256.0 };
        let told = pair.known(Excess::new(2.0), &[(square(0), 2.0)], Some([&nothing; 2]));
        assert_eq!(told.alone.map(|alone| (alone / SQRT_2 * 1e6).round()), Some(2e6));
    }

    /// Of a renderer whose samples follow its threshold.
    fn followed(ratio: f64) -> Excess {
        Excess { alone: Some(ratio), ..Excess::new(ratio) }
    }

    #[test]
    fn noise_that_falls_as_noise_does_takes_two_steps() {
        for (needed, tried) in [(0.04, 0.036), (0.085, 0.0765)] {
            // Of each picture it is √2 times that of their mean
            let (ending, steps) = search(THRESHOLD, |setting| Excess::new(setting / needed));
            let Ending::Found { setting, too_coarse: Some(coarse) } = ending else { panic!("{ending:?}") };
            assert_eq!((steps.len(), setting), (2, tried), "{steps:?}");
            assert!((coarse - 0.1 * SQRT_2).abs() < 1e-9);
            // Where samples follow, the mean of two is believed, and half of the samples are enough
            let (ending, steps) = search(THRESHOLD, |setting| followed(setting / needed));
            let Ending::Found { setting, .. } = ending else { panic!("{ending:?}") };
            assert!(
                steps.len() == 2 && (THRESHOLD.of_both(steps[1].each) / (0.9 * needed) - 1.0).abs() < 0.01,
                "{steps:?}"
            );
            assert!(setting <= needed && setting > 0.98 * needed, "{setting}");
        }
        let (ending, steps) = search(SAMPLES, |n| Excess::new((100.0 / n).sqrt()));
        // 100/0.9² = 123.5, of two halves
        assert_eq!(ending, Ending::Found { setting: 124.0, too_coarse: Some(16.0) });
        assert_eq!(steps[1].each, 62.0);
    }

    #[test]
    fn the_coarsest_setting_is_tried_first_and_may_be_enough() {
        let (ending, steps) = search(THRESHOLD, |_| Excess::new(0.2));
        assert_eq!(ending, Ending::Found { setting: 0.1, too_coarse: None });
        assert_eq!(steps.len(), 1);
        assert!((steps[0].each - 0.141_42).abs() < 1e-5);
    }

    #[test]
    fn ends_are_told_apart() {
        let unchanged = Excess { pictures: 7, ..Excess::new(3.0) };
        let (ending, steps) = search(THRESHOLD, |_| unchanged);
        assert!(ending == Ending::Unchanged && steps[steps.len() - 1].each == 0.001, "{steps:?}");
        // The fewest samples that the renderer takes are too few, and only thresholds below this ask for more
        for above in [0.05, 0.03, 0.01, 0.004] {
            let (ending, steps) = search(THRESHOLD, |t| match t {
                t if t > above => Excess { pictures: 7, ..Excess::new(1.5 * above / 0.003) },
                t => Excess { pictures: t.to_bits(), ..Excess::new(t / 0.003) },
            });
            let Ending::Found { setting, .. } = ending else { panic!("{above}: {ending:?} {steps:?}") };
            assert!(setting <= 0.003 && setting > 0.5 * 0.003, "{above}: {steps:?}");
        }
        // Other pictures, as bad: nobody knows why before the finest
        let (ending, steps) = search(THRESHOLD, |_| Excess::new(3.0));
        assert!(ending == Ending::NotFalling { ratio: 3.0 } && steps[steps.len() - 1].each == 0.001);
        // It is known earlier where more samples were taken
        let (ending, steps) = search(THRESHOLD, |_| followed(3.0));
        assert!(ending == Ending::NotFalling { ratio: 3.0 } && steps.len() == 4, "{steps:?}");
        let (ending, steps) = search(SAMPLES, |_| Excess::new(3.0));
        assert!(ending == Ending::NotFalling { ratio: 3.0 } && steps.len() == 4, "{steps:?}");
        let hard = |t: f64| Excess::new(t / 1e-4);
        let Ending::AtFinest { ratio } = search(THRESHOLD, hard).0 else { panic!() };
        assert!((ratio - 10.0 / SQRT_2).abs() < 1e-9);
        // Nothing can be told, and then all is well
        for nothing in [f64::NAN, f64::INFINITY, -1.0] {
            let blind = |t: f64| Excess { ratio: if t > 0.02 { nothing } else { 0.7 }, ..Excess::new(0.0) };
            let (ending, steps) = search(THRESHOLD, blind);
            let Ending::Found { setting, .. } = ending else { panic!("{ending:?}") };
            assert_eq!(setting, steps[steps.len() - 1].each);
        }
        let mut over = Tuning::new(THRESHOLD).unwrap();
        over.tell(Excess::new(0.1));
        over.tell(Excess::new(5.0));
        assert_eq!(over.steps.len(), 1);
    }

    #[test]
    fn samples_are_claimed_as_they_were_judged() {
        for (least, most) in [(2, 3), (3, 4), (3, 9), (5, 101), (16, 4_097), (2, 2)] {
            for enough in [1.0, 4.0, 7.0, 60.0, 1e9] {
                let knob = Knob::Samples { least, most };
                let (ending, steps) = search(knob, |n| Excess::new((enough / n).sqrt()));
                let in_range = |n: f64| n >= least as f64 && n <= most as f64 && n % 2.0 == 0.0;
                assert!(
                    steps
                        .iter()
                        .all(|step| in_range(2.0 * step.each) && knob.of_both(step.each) == 2.0 * step.each)
                );
                match ending {
                    Ending::Found { setting, .. } => {
                        assert!(setting >= enough && setting == 2.0 * steps[steps.len() - 1].each)
                    }
                    ending => {
                        assert!(matches!(ending, Ending::AtFinest { .. }) && enough > most as f64 - 1.0)
                    }
                }
            }
        }
    }

    #[test]
    fn ranges_that_hold_nothing_are_refused() {
        for knob in [
            Knob::Samples { least: 0, most: 10 },
            Knob::Samples { least: 20, most: 10 },
            Knob::Samples { least: 3, most: 3 },
            Knob::Threshold { coarsest: 1e308, finest: 1e-308 },
            Knob::Threshold { coarsest: 1.0, finest: -1.0 },
            Knob::Threshold { coarsest: 0.1, finest: 0.2 },
            Knob::Threshold { coarsest: f64::INFINITY, finest: 0.2 },
            Knob::Threshold { coarsest: f64::NAN, finest: 0.2 },
            Knob::Threshold { coarsest: 0.1, finest: 0.0 },
        ] {
            assert!(Tuning::new(knob).is_err(), "{knob:?}");
        }
    }

    /// Pixels of a hundred kinds, whose variances span `decades`, of which each has `fewest` samples at least: samples of all,
    /// what is wrong with one picture of this threshold, by this power of its noise, and the share of the noise that follows.
    fn mixed(fewest: f64, decades: f64, power: f64, threshold: f64) -> (f64, f64, f64) {
        let variances = (0..100).map(|kind| 10f64.powf(decades * f64::from(kind) / 100.0));
        let (mut samples, mut noise, mut followed) = (0.0, 0.0, 0.0);
        for variance in variances {
            let wanted = variance / threshold.powi(2);
            samples += wanted.max(fewest);
            noise += variance / wanted.max(fewest);
            followed += if wanted > fewest { threshold.powi(2) } else { 0.0 };
        }
        (samples, (noise / 100.0).powf(power / 2.0), followed / noise)
    }

    /// What a search is told beside what is left.
    #[derive(Clone, Copy, Debug, PartialEq)]
    enum Told {
        Nothing,
        /// How samples follow.
        Alone,
        /// The same, and each picture has half of the fewest samples.
        Halved,
    }

    /// In frames with what was found, and how many samples more than the least these take.
    fn costs(fewest: f64, decades: f64, power: f64, share: f64, told: Told) -> (f64, f64, usize) {
        let mut tuning = Tuning::new(Knob::Threshold { coarsest: 0.2, finest: 0.000_1 }).unwrap();
        let law = |threshold| mixed(fewest, decades, power, threshold);
        // What may be seen, as a share of what the coarsest threshold leaves
        let needed = law(0.2).1 * share;
        let of_each = if told == Told::Halved { fewest / 2.0 } else { fewest };
        let ending = finish(&mut tuning, |each| {
            let (_, wrong, followed) = mixed(of_each, decades, power, each);
            let ratio = wrong / needed / 2f64.powf(power / 2.0);
            let alone = match told {
                Told::Nothing => None,
                Told::Alone => Some(ratio * (2.0 - followed).sqrt()),
                Told::Halved => Some(ratio),
            };
            Excess { alone, ..Excess::new(ratio) }
        });
        let cost: f64 =
            tuning.steps.iter().map(|step| 2.0 * mixed(of_each, decades, power, step.each).0).sum();
        let Ending::Found { setting, .. } = ending else { panic!("{ending:?}") };
        let (samples, wrong, _) = law(setting);
        assert!(wrong <= 1.001 * needed, "{} of {fewest}, {decades}, {power}, {share}", wrong / needed);
        let (mut fine, mut coarse) = (1e-5f64, 1.0f64);
        for _ in 0..60 {
            let middle = (fine * coarse).sqrt();
            *(if law(middle).1 > needed { &mut coarse } else { &mut fine }) = middle;
        }
        (cost / samples, samples / law(fine).0, tuning.steps.len())
    }

    /// Whatever the fewest samples: one picture is enough, and searching takes few.
    #[test]
    fn a_search_through_the_fewest_samples_is_short_and_not_dear() {
        let all =
            [(Told::Halved, 1.7, 2.7, 2.0), (Told::Alone, 2.0, 3.3, 3.0), (Told::Nothing, 3.0, 4.5, 5.0)];
        for (told, median, most, finer) in all {
            let mut frames = Vec::new();
            for (fewest, decades) in
                [(1.0, 0.0), (16.0, 2.0), (64.0, 2.0), (64.0, 4.0), (256.0, 3.0), (2_048.0, 3.0)]
            {
                for power in [0.5, 0.8, 1.0] {
                    for share in [0.8, 0.4, 0.2, 0.1, 0.05] {
                        let (cost, times, steps) = costs(fewest, decades, power, share, told);
                        assert!(
                            cost <= most && times <= finer && steps <= 7,
                            "{told:?}: {cost} {times} {steps} for {fewest}, {decades}, {power}, {share}"
                        );
                        frames.push(cost);
                    }
                }
            }
            frames.sort_by(f64::total_cmp);
            assert!(frames[frames.len() / 2] <= median, "{told:?}: {frames:?}");
        }
    }

    /// Above some threshold nearly all pixels have the fewest samples: leaps change as little as if samples did not help.
    #[test]
    fn a_wide_plateau_is_crossed() {
        for told in [Told::Halved, Told::Alone, Told::Nothing] {
            for fewest in [1_500.0, 2_500.0, 3_900.0] {
                for decades in [0.05, 0.2, 0.35, 0.6] {
                    for (power, share) in [(0.5, 0.3), (0.5, 0.9), (0.7, 0.7), (0.9, 0.55)] {
                        let (cost, ..) = costs(fewest, decades, power, share, told);
                        assert!(cost < 6.0, "{told:?}: {cost} for {fewest}, {decades}, {power}, {share}");
                    }
                }
            }
        }
    }

    /// Glass, a small lamp and a ring of metal: coarse thresholds do not meet the caustic, and what is left rises as it is met.
    #[test]
    fn light_that_is_newly_met_begins_the_search_anew() {
        let mut tuning = Tuning::new(Knob::Threshold { coarsest: 0.2, finest: 1e-5 }).unwrap();
        for ratio in [2.13, 1.48, 2.31, 3.22] {
            assert!(matches!(tuning.next(), Next::Render(_)), "{tuning:?}");
            tuning.tell(followed(ratio));
        }
        let Next::Render(met) = tuning.next() else { panic!("{tuning:?}") };
        let law = |each: f64| 2.0 * each / met;
        let ending = finish(&mut tuning, |each| followed(law(each)));
        let Ending::Found { setting, .. } = ending else { panic!("{ending:?}") };
        assert!(law(setting * SQRT_2) <= 1.0, "{tuning:?}");
    }

    #[test]
    fn pixels_with_the_most_samples_end_a_search_that_they_keep_from_passing() {
        for (floor, ends) in [(0.0, false), (0.99, false), (1.01, true)] {
            let mut tuning = Tuning::new(THRESHOLD).unwrap();
            tuning.tell(Excess { floor, ..followed(2.0) });
            let ended = tuning.next() == Next::Done(Ending::Capped { ratio: 2.0 });
            assert_eq!(ended, ends, "{floor}");
        }
        // What is good enough is so whatever holds the rest
        let mut tuning = Tuning::new(THRESHOLD).unwrap();
        tuning.tell(Excess { alone: Some(0.99), floor: 0.99, ..Excess::new(0.7) });
        assert!(matches!(tuning.next(), Next::Done(Ending::Found { .. })));
    }

    #[test]
    fn what_fails_in_another_place_goes_on_from_there() {
        let mut tuning = Tuning::new(THRESHOLD).unwrap();
        tuning.tell(Excess::new(3.0));
        tuning.tell(Excess::new(0.7));
        let Next::Done(Ending::Found { setting, .. }) = tuning.next() else { panic!() };
        // The whole, of which that was a part, is not enough by a little
        tuning.reopen(THRESHOLD.of_each(setting), Excess::new(1.05));
        let Next::Render(each) = tuning.next() else { panic!("{:?}", tuning.next()) };
        assert!(each < setting && each > 0.5 * setting, "{each} after {setting}");
        tuning.tell(Excess::new(0.65));
        assert_eq!(
            tuning.next(),
            Next::Done(Ending::Found { setting: each, too_coarse: Some(setting * SQRT_2) })
        );
    }

    /// A grey picture of this noise, in which one quarter has three times as much.
    fn noisy(seed: u64, sigma: f64) -> Vec<Rgb> {
        let mut noise = Noise::new(seed);
        let pixel = |i: usize| {
            let worst = i % 256 >= 128 && i / 256 >= 128;
            let value = 0.4 + sigma * if worst { 3.0 } else { 1.0 } * noise.normal();
            [value as f32; 3]
        };
        (0..256 * 256).map(pixel).collect()
    }

    #[test]
    fn the_noise_of_a_mean_is_found_where_it_is_worst_and_falls_with_its_amplitude() {
        let (oracle, params) = (Oracle::bundled(), Params::default().with_tile(64));
        let ratio = |sigma| {
            let pair = PicturePair::new((256, 256), [noisy(1, sigma), noisy(2, sigma)], 64.0).unwrap();
            let Looked { excess, map, .. } = pair.look(&oracle, &params, None).unwrap();
            let (x, y) = excess.place.unwrap();
            // Windows reach over the border by half of their width
            assert!(x >= 112 && y >= 112, "{x}, {y}");
            assert_eq!(map.iter().copied().fold(0.0, f32::max), excess.ratio as f32);
            excess.ratio
        };
        let [strong, weak] = [0.04, 0.01].map(ratio);
        // A quarter of the amplitude, within what the line's other numbers and the crossing's steps do
        assert!((strong / weak / 4.0).ln().abs() < 0.25, "{strong} {weak}");
        // What two halves of one film say is the same: a session stops where the mean of two passes
        assert!(strong > 1.0, "{strong}");
    }

    #[test]
    fn squares_cover_a_picture_and_overlap_by_half() {
        for size in [(192, 130), (64, 64), (65, 200), (40, 30)] {
            let all = squares(size);
            let mut covered = vec![0; size.0 * size.1];
            for (place, square) in all.iter().enumerate() {
                assert_eq!(
                    (square.index, square.width, square.height),
                    (place, size.0.min(64), size.1.min(64))
                );
                square.rows(size.0).flatten().for_each(|pixel| covered[pixel] += 1);
            }
            // Two rows of two, and more only where the last ones are moved inwards
            assert!(covered.iter().all(|times| (1..=9).contains(times)), "{size:?}");
        }
        assert_eq!(
            squares((192, 64)).iter().map(|square| square.x).collect::<Vec<_>>(),
            [0, 32, 64, 96, 128]
        );
    }

    #[test]
    fn pictures_that_say_nothing_are_refused() {
        let picture = noisy(1, 0.1);
        let new = |a: &[Rgb], b: &[Rgb]| PicturePair::new((256, 256), [a.to_vec(), b.to_vec()], 1.0);
        assert!(matches!(new(&picture, &picture), Err(StillError::Same)));
        assert!(matches!(new(&picture, &picture[1..]), Err(StillError::Pixels { got: 65_535, .. })));
        assert!(matches!(new(&picture[1..], &picture[1..]), Err(StillError::Pixels { .. })));
        let mut other = noisy(2, 0.1);
        other[300] = [f32::NAN; 3];
        assert!(matches!(new(&picture, &other), Err(StillError::NotFinite { x: 44, y: 1 })));
    }

    proptest! {
        /// Whatever the law by which what is wrong falls, one picture with the setting found is enough and not much more.
        #[test]
        fn every_law_is_found(
            slope in 0.25..0.5f64, excess in 0.5..40.0f64, threshold in any::<bool>(), followed in any::<bool>(),
        ) {
            let knob = if threshold {
                Knob::Threshold { coarsest: 0.5, finest: 1e-9 }
            } else {
                Knob::Samples { least: 16, most: 1 << 50 }
            };
            let effort = |setting: f64| if threshold { setting.powi(-2) } else { setting };
            let begin = effort(if threshold { 0.5 } else { 16.0 });
            // Of one picture
            let law = |setting: f64| excess * (effort(setting) / begin).powf(-slope);
            let (ending, steps) = search(knob, |setting| {
                let ratio = law(setting);
                Excess { alone: followed.then_some(ratio), ..Excess::new(ratio) }
            });
            let Ending::Found { setting, .. } = ending else { panic!("{ending:?}") };
            // Each of two pictures that share no noise has √2 times that of their mean
            let doubted = threshold && !followed;
            let left = if doubted { SQRT_2 * law(setting / SQRT_2) } else { law(setting) };
            prop_assert!(left <= 1.0 + 1e-9, "{left} of {steps:?}");
            if steps.len() > 1 {
                // The aim, a step of ×1.25 at the least, and rounding
                prop_assert!(left > 0.9 * 1.3f64.powf(-slope), "{left} of {steps:?}");
            }
        }

        /// A renderer that looks at its threshold now and then, so that noise comes in levels; or has its fewest samples
        /// above some threshold. One picture with what is claimed is enough.
        #[test]
        fn what_is_claimed_is_enough_where_noise_comes_in_levels(
            level in 1.01..6.0f64, phase in 0.0..1.0f64, above in 0.001..0.3f64, enough in 0.002..0.3f64,
        ) {
            let noise = |threshold: f64| {
                let levels = (threshold.min(above).ln() / level.ln() - phase).floor() + phase;
                level.powf(levels)
            };
            let knob = Knob::Threshold { coarsest: 0.2, finest: 1e-5 };
            let (ending, steps) = search(knob, |setting| {
                Excess::new(noise(knob.of_each(setting)) / SQRT_2 / enough)
            });
            let Ending::Found { setting, .. } = ending else { panic!("{ending:?} {steps:?}") };
            prop_assert!(noise(setting) <= enough * (1.0 + 1e-9), "{setting} {steps:?}");
            prop_assert!(steps.len() <= 12, "{steps:?}");
        }
    }
}
