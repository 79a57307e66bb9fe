//! The search for a renderer's own setting, such as its noise threshold, at which nobody sees noise.
//!
//! Renderers that sample adaptively know better than tiles *where* samples go; what they cannot know is
//! *when* people stop seeing noise. A [`Tuning`] finds the setting that says so: it names settings, the
//! caller renders two pictures of different seeds with each, and says how far they are from what may be
//! seen ([`Excess`]). It is a state machine: no files, no renderer, no clock.
//!
//! ```
//! use noisefloor::tune::{Excess, Ending, Knob, Next, Tuning};
//!
//! let mut tuning = Tuning::new(Knob::Threshold { coarsest: 0.1, finest: 0.001 })?;
//! let ending = loop {
//!     match tuning.next() {
//!         // A renderer whose noise is seen as soon as its threshold is above 0.03
//!         Next::Render { setting, .. } => tuning.tell(Excess::new(setting / 0.03)),
//!         Next::Done(ending) => break ending,
//!     }
//! };
//! let Ending::Found { setting, .. } = ending else { panic!("{ending:?}") };
//! assert!(setting > 0.02 && setting <= 0.03);
//! # Ok::<(), noisefloor::tune::KnobError>(())
//! ```

mod search;

pub use search::{CROP, Look, Search, crops_for};

use crate::criterion::CriterionError;
use crate::film::blend_row;
use crate::oracle::Oracle;
use crate::params::Params;
use crate::rgb::Rgb;
use crate::stills::{SnapshotPair, Still, StillError, StillWarning};
use crate::tile::{Tile, TileError, TileGrid};
use rayon::prelude::*;
use thiserror::Error;

/// What is aimed at, as a share of what may be seen: an estimate that is a tenth too high does not cost
/// another step.
const AIM: f64 = 0.9;
/// What is claimed in the end, as such a share: between two steps it is known how what is wrong falls.
const CLAIMED: f64 = 0.97;
/// log(excess) over log(effort): noise falls with the root of the samples, until steps show otherwise. Short steps show
/// little: estimates err.
const NOISE: f64 = 0.5;
/// Slopes that are believed. What denoisers leave falls by 0.3 to 0.7 (`docs/denoising.md`); JODs of strong
/// noise, which saturate, by less.
const SLOPES: (f64, f64) = (0.15, 1.0);
/// A closer look may find this much more, and the setting that is enough follows from what falls so slowly, at the least.
const NEAR: f64 = 1.1;
const SLOW: f64 = 0.25;
/// A step makes at least this many times the effort, and none more than [`LEAP`]: a coarse picture does not
/// know the light that it has not met, and a step too far cannot be taken back.
const LEAST_STEP: f64 = 1.25;
const LEAP: f64 = 12.0;
/// The next effort, times, where nothing says how far it is.
const BLIND_STEP: f64 = 8.0;
/// So many finer settings in a row that give the same pictures are enough to say that no setting does otherwise. One is
/// not: above some threshold, every pixel has the fewest samples that the renderer takes.
const UNCHANGED: usize = 2;
/// log(noise) over log(threshold) from which on a threshold is taken to govern the noise: one picture then has at most a tenth
/// more of it than the mean of two. Where it does not, since pixels have the fewest samples that the renderer takes, one
/// finer picture is not worth two coarse ones.
const GOVERNS: f64 = 0.7;
/// Below this, about all pixels still have the fewest samples, and nothing says how far it is until they have more.
const HARDLY: f64 = 0.15;
/// So many steps from the coarsest on may leave the noise as it is: then finer ones will, too.
const UNGOVERNED: usize = 5;
/// Below this slope, twice in a row, noise does not fall: twice the effort takes less than 4 % of it.
const FLAT: f64 = 0.06;
/// Steps are counted as evidence for that from this many times the effort on.
const EVIDENT: f64 = 1.5;

/// A setting of a renderer that trades time for noise, and its range.
#[derive(Clone, Copy, Debug, PartialEq)]
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

/// A range that cannot be searched.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum KnobError {
    /// Samples.
    #[error("samples are sought between {least} and {most}: at least 2, and the second not below the first")]
    Samples {
        /// The least.
        least: u64,
        /// The most.
        most: u64,
    },
    /// Thresholds.
    #[error(
        "a threshold is sought from {coarsest} down to {finest}: both positive, the first not below the second"
    )]
    Threshold {
        /// The coarsest.
        coarsest: f64,
        /// The finest.
        finest: f64,
    },
}

impl Knob {
    fn check(self) -> Result<(), KnobError> {
        match self {
            Self::Samples { least, most } if least < 2 || most < least => {
                Err(KnobError::Samples { least, most })
            }
            Self::Threshold { coarsest, finest }
                if !(finest > 0.0 && coarsest >= finest && coarsest.is_finite()) =>
            {
                Err(KnobError::Threshold { coarsest, finest })
            }
            _ => Ok(()),
        }
    }

    /// What each of two pictures is rendered with, if their mean is to be as good as one with `setting`.
    pub fn of_each(self, setting: f64) -> f64 {
        match self {
            Self::Samples { .. } => (setting / 2.0).ceil(),
            Self::Threshold { .. } => setting * std::f64::consts::SQRT_2,
        }
    }

    /// Samples that a setting takes, in any unit.
    fn effort(self, setting: f64) -> f64 {
        match self {
            Self::Samples { .. } => setting,
            Self::Threshold { coarsest, .. } => (coarsest / setting).powi(2),
        }
    }

    /// The setting of an effort, within the range, in numbers that people type.
    fn setting(self, effort: f64) -> f64 {
        match self {
            Self::Samples { most, .. } => ((effort / 2.0).ceil() * 2.0).min(most as f64),
            Self::Threshold { coarsest, finest } => {
                let exact = coarsest / effort.sqrt();
                // Three digits, rounded to the nearest: within 1 % of the effort. As text, since a product of decimal
                // digits is no decimal number
                let rounded = format!("{exact:.2e}").parse().unwrap_or(exact);
                f64::clamp(rounded, finest, coarsest)
            }
        }
    }

    fn coarsest(self) -> f64 {
        match self {
            Self::Samples { least, .. } => least as f64,
            Self::Threshold { coarsest, .. } => coarsest,
        }
    }

    fn finest(self) -> f64 {
        match self {
            Self::Samples { most, .. } => most as f64,
            Self::Threshold { finest, .. } => finest,
        }
    }
}

/// How far the mean of two pictures is from what may be seen, in its worst place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Excess {
    /// What is wrong there over what may be wrong: 1 passes, 2 is twice as much. Not negative; infinite
    /// where it cannot be told.
    pub ratio: f64,
    /// The worst pixel, as x and y; `None` if nobody asked where.
    pub place: Option<(usize, usize)>,
    /// A number that follows from the pictures, the same for the same pictures; 0 if it is not known.
    pub pictures: u64,
    /// The noise of each picture, in a unit that is the same in all steps; 0 if it is not known. By it, a search notices
    /// thresholds that do not change the noise, and without it trusts that they do. A step of unknown noise after others whose
    /// noise is known is of another place, and is not compared with them.
    pub noise: f64,
}

impl Excess {
    /// From a ratio alone.
    pub fn new(ratio: f64) -> Self {
        let ratio = if ratio >= 0.0 { ratio } else { f64::INFINITY };
        Self { ratio, place: None, pictures: 0, noise: 0.0 }
    }
}

/// Edge of the squares that a picture is looked at in, in pixels: at a desk, 1.7°.
const SQUARE: usize = 64;

/// The squares of a picture of which the worst counts: of 64 pixels, overlapping by half, row by row; those of a
/// picture that is smaller are cut.
pub fn squares((width, height): (usize, usize)) -> Vec<Tile> {
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
pub fn most_in_squares(size: (usize, usize), map: &[f32]) -> Vec<(Tile, f64)> {
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
}

impl PicturePair {
    /// Linear radiance, row-major, width × height values each. `spp`, samples per pixel of each, is used for
    /// audiences that are not factors only; 128, say, where it is not known.
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
        blend_row([&one.pixels, &other.pixels], [0.5; 2], &mut mean);
        Ok(Self { mean: still(mean, 2.0 * spp), halves: [one, other] })
    }

    /// What the two pictures say against a verdict on them, as [`SnapshotPair::notice`] has it.
    ///
    /// # Errors
    /// [`PairError`] if they are no two pictures of one view, or no light.
    pub fn notice(&self, params: &Params) -> Result<Vec<StillWarning>, PairError> {
        let grid = TileGrid::new(self.size().0, self.size().1, params.tile)?;
        Ok(self.compare(params).notice(grid)?.warnings)
    }

    /// Width and height.
    pub fn size(&self) -> (usize, usize) {
        self.mean.size
    }

    /// The mean of both, row-major.
    pub fn mean(&self) -> &[Rgb] {
        &self.mean.pixels
    }

    /// The mean, and the two pictures as its halves: a session that has them as the halves of its film judges the same,
    /// to the bit. With the exposure of the converged picture.
    pub fn compare(&self, params: &Params) -> SnapshotPair<'_> {
        let [one, other] = &self.halves;
        SnapshotPair::of_halves(&self.mean, [one, other], &params.tone_mapping).seen_on(params.viewing)
    }

    /// How far the noise of the mean is from what the share of people asked for does not see, and the map of
    /// it, row-major, 1 where it is just that. What is only likely to be wrong with the pictures is for
    /// [`PicturePair::notice`] to say.
    ///
    /// # Errors
    /// [`PairError`], also if the pictures are no two of one view, or no light.
    pub fn noise(&self, oracle: &Oracle, params: &Params) -> Result<(Excess, Vec<f32>), PairError> {
        self.notice(params)?;
        let grid = TileGrid::new(self.size().0, self.size().1, params.tile)?;
        let described = self.compare(params).describe(oracle, grid)?;
        let map = oracle.map_visible_noise(grid, &described, params.audience).ok_or(PairError::NoMap)?;
        let worst = (0..map.len()).max_by(|&a, &b| map[a].total_cmp(&map[b]));
        let ratio = worst.map_or(0.0, |worst| f64::from(map[worst]));
        let place = worst.map(|worst| (worst % self.size().0, worst / self.size().0));
        Ok((self.tell_apart(Excess { place, ..Excess::new(ratio) }), map))
    }

    /// An excess of these pictures, with what tells them from those of other settings: [`Excess::pictures`] and
    /// [`Excess::noise`].
    pub fn tell_apart(&self, excess: Excess) -> Excess {
        Excess { pictures: self.digest(), noise: self.noise_of_each(), ..excess }
    }

    /// A number that follows from the pictures, whichever comes first (FNV-1a); not 0.
    fn digest(&self) -> u64 {
        let of_one = |still: &Still| {
            let bits = still.pixels.iter().flatten().map(|c| u64::from(c.to_bits()));
            bits.fold(0xcbf2_9ce4_8422_2325, |hash: u64, bits| {
                (hash ^ bits).wrapping_mul(0x0000_0100_0000_01b3)
            })
        };
        let [one, other] = self.halves.each_ref().map(of_one);
        one.wrapping_add(other).max(1)
    }

    /// How much noise each picture has in its noisiest squares: half the mean difference of the two, relative to how
    /// bright it is there, of which a tenth of the [`squares`] have more. A mean over so many pixels tells a few
    /// percent apart, which the worst place does not.
    fn noise_of_each(&self) -> f64 {
        let mean = &self.mean.pixels;
        let [one, other] = self.halves.each_ref().map(|half| &half.pixels);
        let level = mean.as_flattened().iter().map(|&c| f64::from(c.abs())).sum::<f64>();
        let level = (level / (3 * mean.len()) as f64).max(f64::MIN_POSITIVE);
        let of_pixel = |pixel: usize| -> f64 {
            let of_channel = |c: usize| {
                let apart = f64::from(one[pixel][c]) - f64::from(other[pixel][c]);
                0.5 * apart.abs() / (f64::from(mean[pixel][c]).abs() + level)
            };
            (0..3).map(of_channel).sum()
        };
        let of_square = |square: Tile| {
            square.rows(self.size().0).flatten().map(of_pixel).sum::<f64>() / square.pixels() as f64
        };
        let mut all: Vec<f64> = squares(self.size()).into_par_iter().map(of_square).collect();
        all.sort_by(f64::total_cmp);
        all[all.len() - 1 - all.len() / 10]
    }
}

/// A setting that was tried.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step {
    /// One picture with this setting would be as good as the mean of the two.
    pub setting: f64,
    /// What each of the two was rendered with.
    pub each: f64,
    /// What was found.
    pub excess: Excess,
}

impl Step {
    /// Whether the pictures are known to be the same.
    fn draws_as(&self, other: &Self) -> bool {
        self.excess.pictures == other.excess.pictures && self.excess.pictures != 0
    }
}

/// What to do next.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Next {
    /// Render two pictures with the same setting and different seeds, the same seeds in every step.
    Render {
        /// What each is rendered with.
        each: f64,
        /// One picture with this setting would be as good as their mean.
        setting: f64,
    },
    /// Nothing: the search has ended.
    Done(Ending),
}

/// How a search ended.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ending {
    /// In the mean of the last two pictures nothing is seen that should not be.
    Found {
        /// The setting that is just enough: the one tried last, or between that and the one before, if that
        /// was far more than enough.
        setting: f64,
        /// The setting tried last, which was enough; or `setting` itself, if [`Tuning::correct`] has said that the last one
        /// was not by up to a tenth.
        enough: f64,
        /// The coarser one tried before, which was not; `None` if the coarsest of all is enough.
        too_coarse: Option<f64>,
    },
    /// Even the finest setting leaves this much too much.
    AtFinest {
        /// Over what may be seen.
        ratio: f64,
    },
    /// Settings that differ much gave the same pictures: the renderer ignores the setting, or has reached another limit,
    /// such as its most samples.
    Unchanged,
    /// More effort does not make less noise: what is wrong is no noise, or the pictures are not independent.
    NotFalling {
        /// Over what may be seen.
        ratio: f64,
    },
}

/// A search in progress.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuning {
    knob: Knob,
    steps: Vec<Step>,
    /// The first step whose ratio can be compared with those after it: since then, the place has been the same.
    since: usize,
    /// Of the last step, a closer look was taken.
    is_corrected: bool,
}

impl Tuning {
    /// A search that has not begun.
    ///
    /// # Errors
    /// [`KnobError`] if the range is empty.
    pub fn new(knob: Knob) -> Result<Self, KnobError> {
        knob.check()?;
        Ok(Self { knob, steps: Vec::new(), since: 0, is_corrected: false })
    }

    /// What is searched.
    pub fn knob(&self) -> Knob {
        self.knob
    }

    /// What was tried, in order.
    pub fn steps(&self) -> &[Step] {
        &self.steps
    }

    /// The setting to try, or how it ended. The same until [`Tuning::tell`].
    pub fn next(&self) -> Next {
        let Some(last) = self.steps.last() else { return self.render(self.knob.coarsest()) };
        if last.excess.ratio <= 1.0
            && let Some(ending) = self.found(last)
        {
            return Next::Done(ending);
        }
        let (ratio, passes) = (last.excess.ratio, last.excess.ratio <= 1.0);
        // Where thresholds hardly change the noise, a little finer is not a little better
        if self.is_corrected && !passes && ratio * self.worse_alone().unwrap_or(f64::INFINITY) <= NEAR {
            let effort = self.knob.effort(last.setting) * (ratio / CLAIMED).powf(1.0 / SLOW);
            let setting = self.knob.setting(effort);
            if setting != self.knob.finest() {
                return Next::Done(Ending::Found {
                    setting,
                    enough: setting,
                    too_coarse: Some(last.setting),
                });
            }
        }
        let alike = self.steps.iter().rev().take_while(|step| step.draws_as(last)).count();
        // Two pictures of the fewest samples may pass together where one does not
        if alike > if passes { UNGOVERNED - 1 } else { UNCHANGED } {
            return Next::Done(Ending::Unchanged);
        }
        if last.setting == self.knob.finest() {
            return Next::Done(Ending::AtFinest { ratio });
        }
        let hardly = alike > 1 || self.exponent().is_some_and(|exponent| exponent < HARDLY);
        if self.is_flat() && !((hardly || passes) && self.steps.len() < UNGOVERNED) {
            return Next::Done(Ending::NotFalling { ratio });
        }
        let more = if hardly {
            BLIND_STEP
        } else if passes {
            // Whether one picture is as good as both: by two of it
            self.knob.effort(last.setting) / self.knob.effort(last.each)
        } else {
            self.step_from(last)
        };
        let next = self.knob.setting(self.knob.effort(last.setting) * more);
        // Rounding must not stand still
        self.render(if next == last.setting { self.knob.finest() } else { next })
    }

    /// What was found with the setting that [`Tuning::next`] named; without one, nothing happens.
    pub fn tell(&mut self, excess: Excess) {
        if let Next::Render { each, setting } = self.next() {
            if excess.noise == 0.0 && self.steps.iter().any(|step| step.excess.noise > 0.0) {
                self.since = self.steps.len();
            }
            self.steps.push(Step { setting, each, excess });
            self.is_corrected = false;
        }
    }

    /// Says what a closer look at the last setting has found, such as at the whole picture where a part of it was judged:
    /// another ratio. If it is up to a tenth too high, a setting is named that is a little finer, and nothing is rendered once
    /// more. Before the first step, nothing happens.
    pub fn correct(&mut self, ratio: f64) {
        if let Some(last) = self.steps.last_mut() {
            last.excess.ratio = Excess::new(ratio).ratio;
            self.since = self.steps.len() - 1;
            self.is_corrected = true;
        }
    }

    fn render(&self, setting: f64) -> Next {
        Next::Render { each: self.knob.of_each(setting), setting }
    }

    /// How many times the effort comes next.
    fn step_from(&self, last: &Step) -> f64 {
        // As far as pixels had the fewest samples at first, the next step does more than the last did: halfway to all
        let answers = self.exponent().map_or(1.0, |exponent| exponent.clamp(HARDLY, 1.0).sqrt());
        let slope = self.slopes().last().map_or(NOISE, |(slope, times)| {
            let weight = times.ln().powi(2);
            (NOISE + weight * slope / answers) / (1.0 + weight)
        });
        let slope = slope.clamp(SLOPES.0, SLOPES.1);
        let ratio = last.excess.ratio;
        if !ratio.is_finite() {
            return BLIND_STEP;
        }
        let all = (ratio / AIM).powf(1.0 / slope).max(LEAST_STEP);
        // Two steps alike waste less than a leap and a hop
        if all > LEAP { all.sqrt().min(LEAP) } else { all }
    }

    /// By how much log(excess) fell for log(effort), step by step, and how many times the effort that was.
    fn slopes(&self) -> impl DoubleEndedIterator<Item = (f64, f64)> {
        let effort = |step: &Step| self.knob.effort(step.setting);
        let changed = self.steps[self.since..].windows(2).filter(|pair| !pair[0].draws_as(&pair[1]));
        changed.filter_map(move |pair| {
            let times = effort(&pair[1]) / effort(&pair[0]);
            let slope = (pair[0].excess.ratio / pair[1].excess.ratio).ln() / times.ln();
            slope.is_finite().then_some((slope, times))
        })
    }

    fn is_flat(&self) -> bool {
        let mut last_two = self.slopes().rev().take(2);
        let flat = |step: Option<(f64, f64)>| step.is_some_and(|(s, times)| s < FLAT && times >= EVIDENT);
        flat(last_two.next()) && flat(last_two.next())
    }

    /// log(noise) over log(threshold) between each step and the last of those before it that is far enough from it, the last
    /// steps first; `None` where noise is not known. Between thresholds that differ little nothing can be told: Cycles,
    /// for one, looks at its threshold after every 16 samples.
    fn exponents(&self) -> impl Iterator<Item = Option<f64>> {
        (0..self.steps.len()).rev().map(|at| {
            let (before, step) = (&self.steps[..at], &self.steps[at]);
            let times = |before: &Step| before.each / step.each;
            let before = before.iter().rev().find(|before| times(before).powi(2) >= EVIDENT)?;
            let noise = before.excess.noise / step.excess.noise;
            let exponent = noise.ln() / times(before).ln();
            (exponent.is_finite() && noise > 0.0).then_some(exponent)
        })
    }

    /// That of the last step.
    fn exponent(&self) -> Option<f64> {
        self.exponents().next().flatten()
    }

    /// How many times worse one picture may be than the mean of two coarser ones, beyond what is tolerated ([`GOVERNS`]); `None`
    /// if only one step tells its noise, and nothing is known of that.
    fn worse_alone(&self) -> Option<f64> {
        if matches!(self.knob, Knob::Samples { .. }) {
            return Some(1.0);
        }
        // One has 2^((1 − exponent)/2) times the noise
        let times = |exponent: f64| ((GOVERNS - exponent) / 2.0).exp2().max(1.0);
        let trusts = || {
            let mut last = self.steps.iter().rev();
            last.next().is_some_and(|step| step.excess.noise == 0.0)
                || last.next().is_some_and(|step| step.excess.noise == 0.0)
        };
        self.exponents().flatten().next().map(times).or_else(|| trusts().then_some(1.0))
    }

    /// What is claimed if the mean of the last two pictures passes; `None` if one picture with a finer threshold may be worse.
    fn found(&self, last: &Step) -> Option<Ending> {
        let coarser = self.steps.iter().rev().nth(1);
        let governs = self.worse_alone().is_some_and(|times| last.excess.ratio * times <= 1.0);
        if !governs {
            // One of the two is worse than their mean, by the root of two at the most
            let single = last.excess.ratio * std::f64::consts::SQRT_2 <= 1.0;
            let setting = self.knob.setting(self.knob.effort(last.each));
            let too_coarse = coarser.filter(|step| step.excess.ratio > 1.0).map(|step| step.each);
            let done = single || last.setting == self.knob.finest();
            return done.then_some(Ending::Found { setting, enough: setting, too_coarse });
        }
        Some(self.between(last))
    }

    fn between(&self, last: &Step) -> Ending {
        let coarser = self.steps.iter().rev().nth(1);
        let enough = last.setting;
        let between = |before: &Step| {
            let [a, b] = [before, last].map(|step| step.excess.ratio.ln());
            let [from, to] = [before, last].map(|step| self.knob.effort(step.setting).ln());
            // Where the line between both meets what is claimed; if only part of the way went by the threshold, noise
            // rises again from the last one as noise does
            let share = ((a - CLAIMED.ln()) / (a - b)).clamp(0.0, 1.0);
            let as_noise = to - (CLAIMED.ln() - b) / NOISE;
            let chord = from + share * (to - from);
            let setting =
                self.knob.setting(if last.excess.noise > 0.0 { chord.max(as_noise) } else { chord }.exp());
            // Nothing is claimed outside of what was tried
            setting.clamp(enough.min(before.setting), enough.max(before.setting))
        };
        let setting = match coarser {
            Some(before) if last.excess.ratio < CLAIMED && before.excess.ratio.is_finite() => between(before),
            _ => enough,
        };
        let too_coarse = coarser.filter(|step| step.excess.ratio > 1.0).map(|step| step.setting);
        Ending::Found { setting, enough, too_coarse }
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
        for _ in 0..20 {
            match tuning.next() {
                Next::Render { setting, .. } => tuning.tell(excess(setting)),
                Next::Done(ending) => return (ending, tuning.steps),
            }
        }
        panic!("no end after {:?}", tuning.steps);
    }

    #[test]
    fn noise_that_falls_as_noise_does_takes_two_steps() {
        for (needed, tried, found) in [(0.04, 0.036, 0.0388), (0.085, 0.0765, 0.0825)] {
            let (ending, steps) = search(THRESHOLD, |setting| Excess::new(setting / needed));
            let Ending::Found { setting, enough, too_coarse } = ending else { panic!("{ending:?}") };
            assert_eq!((steps.len(), too_coarse), (2, Some(0.1)), "{steps:?}");
            // To three digits 0.97 and 0.9 of what is needed
            assert_eq!((setting, enough), (found, tried));
        }
        let (ending, steps) = search(SAMPLES, |n| Excess::new((100.0 / n).sqrt()));
        // 100/0.97² = 106.3, of two halves, and 100/0.9² = 123.5
        assert_eq!(ending, Ending::Found { setting: 108.0, enough: 124.0, too_coarse: Some(16.0) });
        assert_eq!(steps[1].each, 62.0);
    }

    #[test]
    fn the_coarsest_setting_is_tried_first_and_may_be_enough() {
        let (ending, steps) = search(THRESHOLD, |_| Excess::new(0.2));
        assert_eq!(ending, Ending::Found { setting: 0.1, enough: 0.1, too_coarse: None });
        assert_eq!(steps.len(), 1);
        assert!((steps[0].each - 0.141_42).abs() < 1e-5);
    }

    #[test]
    fn a_step_too_far_is_interpolated() {
        // Falls much faster than noise: 0.1 is twice too coarse, and 0.045 far more than enough
        let (ending, steps) = search(THRESHOLD, |t| Excess::new((t / 0.08).powf(3.1)));
        let Ending::Found { setting, enough, too_coarse: Some(0.1) } = ending else { panic!("{ending:?}") };
        assert!(steps.len() == 2 && steps[1].excess.ratio < 0.5, "{steps:?}");
        assert!(setting > enough && setting <= 0.08 && setting > 0.075, "{setting}");
    }

    #[test]
    fn ends_are_told_apart() {
        let unchanged = Excess { pictures: 7, ..Excess::new(3.0) };
        assert_eq!(search(THRESHOLD, |_| unchanged).0, Ending::Unchanged);
        // The fewest samples that the renderer takes are too few, and the coarsest thresholds do not ask for more
        let (ending, steps) = search(THRESHOLD, |t| match t {
            t if t > 0.05 => unchanged,
            t => Excess { pictures: t.to_bits(), ..Excess::new(t / 0.016_67) },
        });
        assert!(
            matches!(ending, Ending::Found { setting, .. } if (setting - 0.97 * 0.016_67).abs() < 0.000_1),
            "{steps:?}"
        );
        assert_eq!(search(THRESHOLD, |_| Excess::new(3.0)).0, Ending::NotFalling { ratio: 3.0 });
        let hard = |t: f64| Excess::new(t / 1e-4);
        let Ending::AtFinest { ratio } = search(THRESHOLD, hard).0 else { panic!() };
        assert!((ratio - 10.0).abs() < 1e-9);
        // Nothing can be told, and then all is well
        let blind = |t: f64| Excess::new(if t > 0.02 { f64::NAN } else { 0.95 });
        let (ending, _) = search(THRESHOLD, blind);
        assert!(matches!(ending, Ending::Found { setting, enough, .. } if setting == enough), "{ending:?}");
        for knob in [
            Knob::Samples { least: 0, most: 10 },
            Knob::Samples { least: 20, most: 10 },
            Knob::Threshold { coarsest: 0.1, finest: 0.2 },
            Knob::Threshold { coarsest: f64::INFINITY, finest: 0.2 },
            Knob::Threshold { coarsest: f64::NAN, finest: 0.2 },
            Knob::Threshold { coarsest: 0.1, finest: 0.0 },
        ] {
            assert!(Tuning::new(knob).is_err(), "{knob:?}");
        }
    }

    /// Pictures of a renderer that takes `fewest` samples at least, where 1/t² are enough for a threshold t, in the unit of
    /// the samples that are needed.
    fn with_fewest(fewest: f64, needed: f64) -> impl Fn(f64) -> Excess {
        move |setting| {
            let each = THRESHOLD.of_each(setting).powi(-2).max(fewest);
            Excess { noise: each.powf(-0.5), ..Excess::new((needed / (2.0 * each)).sqrt()) }
        }
    }

    /// Noise of other frames or crops, which is marked as unknown, says nothing of the fewest samples.
    #[test]
    fn noise_that_is_unknown_in_between_makes_no_leap() {
        let mut tuning = Tuning::new(THRESHOLD).unwrap();
        for (ratio, noise) in [(8.0, 0.01), (2.68, 0.0), (1.1, 0.2)] {
            tuning.tell(Excess { noise, ..Excess::new(ratio) });
        }
        let Next::Render { setting, .. } = tuning.next() else { panic!("{:?}", tuning.next()) };
        let times = THRESHOLD.effort(setting) / THRESHOLD.effort(tuning.steps()[2].setting);
        assert!(times < 3.0, "{times} after {:?}", tuning.steps());
    }

    /// Two pictures of the fewest samples are worth one of twice as many, but no coarse threshold renders that.
    #[test]
    fn one_picture_with_the_setting_found_is_enough_whatever_the_fewest_samples() {
        for fewest in [1.0, 60.0, 400.0, 2_000.0, 9_000.0] {
            for needed in [30.0, 110.0, 500.0, 700.0, 3_000.0, 15_000.0] {
                let (ending, steps) = search(THRESHOLD, with_fewest(fewest, needed));
                let Ending::Found { setting, enough, too_coarse } = ending else { panic!("{ending:?}") };
                let samples = |setting: f64| f64::max(setting.powi(-2), fewest);
                assert!(samples(setting) >= 0.99 * needed, "{setting} for {fewest}, {needed}: {steps:?}");
                // And it is not much finer than it must be, but where the fewest are about enough
                let most =
                    if fewest > needed / 4.0 { 4.2 * fewest.max(needed) } else { 1.7 * needed.max(100.0) };
                assert!(samples(setting) <= most, "{setting} for {fewest}, {needed}: {steps:?}");
                assert!(enough <= setting && too_coarse.is_none_or(|coarse| coarse >= setting));
                assert!(steps.len() <= 6, "{steps:?}");
            }
        }
    }

    #[test]
    fn a_closer_look_goes_on_where_the_whole_is_worse_than_its_part() {
        let mut tuning = Tuning::new(THRESHOLD).unwrap();
        tuning.correct(0.5);
        assert!(tuning.steps().is_empty());
        for ratio in [3.0, 0.9] {
            tuning.tell(Excess::new(ratio));
        }
        let Next::Done(Ending::Found { setting, enough, .. }) = tuning.next() else { panic!() };
        assert!(setting > enough);
        // The whole is a little worse: less is claimed
        tuning.correct(0.97);
        assert!(matches!(tuning.next(), Next::Done(Ending::Found { setting, .. }) if setting == enough));
        // Up to a tenth too much is made good without another picture, even if it falls slowly
        tuning.correct(1.08);
        let Next::Done(Ending::Found { setting: finer, too_coarse, .. }) = tuning.next() else { panic!() };
        let effort = THRESHOLD.effort(finer) / THRESHOLD.effort(enough);
        assert!(1.08 * effort.powf(-0.25) < 1.0 && effort < 1.6 && too_coarse == Some(enough), "{effort}");
        tuning.correct(1.3);
        let Next::Render { setting, .. } = tuning.next() else { panic!() };
        assert!(setting < enough);
    }

    /// A finer threshold that is not tried is not claimed where thresholds do not change the noise.
    #[test]
    fn a_closer_look_at_the_fewest_samples_is_followed_by_pictures() {
        let mut tuning = Tuning::new(THRESHOLD).unwrap();
        for (ratio, noise) in [(1.5, 0.1), (0.6, 0.099)] {
            tuning.tell(Excess { noise, ..Excess::new(ratio) });
        }
        // One picture passes
        assert!(matches!(tuning.next(), Next::Done(Ending::Found { .. })));
        tuning.correct(1.05);
        assert!(matches!(tuning.next(), Next::Render { .. }), "{:?}", tuning.next());
    }

    /// As Cycles, which draws the same pictures then.
    #[test]
    fn two_alike_pictures_that_pass_are_not_the_end_where_one_does_not() {
        // The fewest samples are those of a threshold of 0.02; two of these pictures are just enough
        let law = with_fewest(2_500.0, 4_500.0);
        let (ending, steps) = search(THRESHOLD, |setting| {
            let told = law(setting);
            Excess { pictures: told.noise.to_bits(), ..told }
        });
        let Ending::Found { setting, .. } = ending else { panic!("{ending:?}: {steps:?}") };
        assert!(setting.powi(-2) >= 0.99 * 4_500.0, "{setting}: {steps:?}");
    }

    /// Pixels of a hundred kinds, whose variances span `decades`, and of which a few have the fewest samples for long; what
    /// is wrong falls by this power of the noise.
    fn mixed(fewest: f64, decades: f64, power: f64, needed: f64) -> impl Fn(f64) -> (f64, f64) {
        let variance = move |kind: i32| 10f64.powf(decades * f64::from(kind) / 100.0);
        // Of one picture with this threshold: its noise, and what is wrong with the mean of two
        move |threshold: f64| {
            let of = |kind| (variance(kind) / (variance(kind) / threshold.powi(2)).max(fewest)).sqrt();
            let noise = (0..100).map(of).sum::<f64>() / 100.0;
            (noise, (noise / std::f64::consts::SQRT_2 / needed).powf(power))
        }
    }

    #[test]
    fn a_search_through_the_fewest_samples_is_short_and_not_dear() {
        let (mut dearest, mut longest, mut coarsest) = (0.0f64, 0, 0.0f64);
        for (fewest, decades) in [(16.0, 2.0), (64.0, 2.0), (64.0, 4.0), (256.0, 3.0), (2_048.0, 3.0)] {
            for power in [0.5, 0.8, 1.2] {
                for share in [0.8, 0.4, 0.2, 0.1, 0.05] {
                    let law = |threshold| mixed(fewest, decades, power, 1.0)(threshold).0;
                    // What may be seen, as a share of what the coarsest threshold leaves
                    let needed = law(0.2) * share;
                    let (mut tuning, mut cost) =
                        (Tuning::new(Knob::Threshold { coarsest: 0.2, finest: 0.000_1 }).unwrap(), 0.0);
                    let samples = |threshold: f64| {
                        let of = |kind| {
                            (10f64.powf(decades * f64::from(kind) / 100.0) / threshold.powi(2)).max(fewest)
                        };
                        (0..100).map(of).sum::<f64>()
                    };
                    let ending = loop {
                        match tuning.next() {
                            Next::Render { each, .. } => {
                                let (noise, ratio) = mixed(fewest, decades, power, needed)(each);
                                cost += 2.0 * samples(each);
                                tuning.tell(Excess { noise, ..Excess::new(ratio) });
                            }
                            Next::Done(ending) => break ending,
                        }
                    };
                    let Ending::Found { setting, .. } = ending else { panic!("{ending:?}") };
                    // One picture
                    let single = (law(setting) / needed).powf(power);
                    let (mut fine, mut coarse) = (1e-5f64, 1.0f64);
                    for _ in 0..60 {
                        let middle = (fine * coarse).sqrt();
                        *(if law(middle) > needed { &mut coarse } else { &mut fine }) = middle;
                    }
                    let times = samples(setting) / samples(fine);
                    assert!(times < 1.4, "{times} for {fewest}, {decades}, {power}, {share}");
                    dearest = dearest.max(cost / samples(setting));
                    longest = longest.max(tuning.steps.len());
                    coarsest = coarsest.max(single);
                }
            }
        }
        // The dearest are those in which the fewest samples are nearly enough
        assert!(coarsest <= 1.1 && longest <= 6 && dearest < 4.0, "{coarsest} {longest} {dearest}");
    }

    #[test]
    fn the_noise_of_pictures_is_in_proportion_and_well_known() {
        let noise = |seed, sigma| {
            let pair =
                PicturePair::new((256, 256), [noisy(seed, sigma), noisy(seed + 1, sigma)], 64.0).unwrap();
            let told = pair.tell_apart(Excess::new(1.0));
            assert!(told.pictures != 0 && told.ratio == 1.0);
            told.noise
        };
        let [one, half, again] = [noise(1, 0.02), noise(3, 0.01), noise(5, 0.02)];
        assert!(
            (one / half / 2.0 - 1.0).abs() < 0.05 && (one / again - 1.0).abs() < 0.05,
            "{one} {half} {again}"
        );
        // Of a normal deviation σ, |a − b|/2 is σ/√π on average; three times as much where it is worst
        let expected = 3.0 * 3.0 * 0.02 / std::f64::consts::PI.sqrt() / (0.4 + 0.4);
        assert!((one / expected - 1.0).abs() < 0.05, "{one} {expected}");
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
            let (excess, map) = pair.noise(&oracle, &params).unwrap();
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
        /// Whatever the law by which what is wrong falls, the setting found is enough and not much more, and
        /// what the steps before the last cost is bounded.
        #[test]
        fn every_law_is_found(slope in 0.2..0.9f64, excess in 0.5..40.0f64, threshold in any::<bool>()) {
            let knob = if threshold {
                Knob::Threshold { coarsest: 0.5, finest: 1e-9 }
            } else {
                Knob::Samples { least: 16, most: 1 << 50 }
            };
            let begin = knob.effort(knob.coarsest());
            let law = |setting: f64| excess * (knob.effort(setting) / begin).powf(-slope);
            let (ending, steps) = search(knob, |setting| Excess::new(law(setting)));
            let Ending::Found { setting, enough, .. } = ending else { panic!("{ending:?}") };
            prop_assert!(law(enough) <= 1.0 && law(setting) <= 1.0);
            if steps.len() > 1 {
                // An effort of ×1.25 more than needed at the most, and what rounding adds
                prop_assert!(law(setting) > 0.9 * 1.3f64.powf(-slope), "{} of {steps:?}", law(setting));
                let efforts: Vec<f64> = steps.iter().map(|step| knob.effort(step.setting)).collect();
                prop_assert!(efforts.windows(2).all(|pair| pair[1] > pair[0]));
            }
        }
    }
}
