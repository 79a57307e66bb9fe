//! What decides that a tile is done.

use crate::descriptor::DescriptorError;
use crate::display::Display;
use crate::film::Film;
use crate::params::Audience;
use crate::rgb::Rgb;
use crate::tile::{Tile, TileGrid};
use auto_impl::auto_impl;
use noisefloor_vision::Viewing;
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// What a criterion looks at.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct View<'a> {
    /// All samples so far.
    pub film: &'a Film,
    /// How radiance is displayed; settled before the first verdict.
    pub display: &'a Display,
    /// On which display, and from how far.
    pub viewing: Viewing,
    /// Whose thresholds, relative to those that the criterion stands for: a session sees to them, and a map of
    /// visible noise has to know.
    pub audience: Audience,
    /// The quick reference, display-encoded, row-major over the image; present if [`Needs::reference`] is
    /// set.
    pub reference: Option<&'a [Rgb]>,
    /// Standard error of the exposure of `display`, as a share of it: 0 where it does not depend on the picture. It falls
    /// as samples come.
    pub exposure_error: f64,
}

impl<'a> View<'a> {
    /// A film on the default display, for the observers of the training data, without a reference.
    pub fn new(film: &'a Film, display: &'a Display) -> Self {
        let (viewing, audience) = (Viewing::default(), Audience::TRAINED);
        Self { film, display, viewing, audience, reference: None, exposure_error: 0.0 }
    }

    /// The same on another display.
    #[must_use]
    pub fn seen_on(self, viewing: Viewing) -> Self {
        Self { viewing, ..self }
    }

    /// The same with [`View::reference`].
    #[must_use]
    pub fn beside(self, reference: &'a [Rgb]) -> Self {
        Self { reference: Some(reference), ..self }
    }
}

/// What a criterion reads besides the mean picture; nothing else is kept or rendered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Needs {
    /// Two half buffers.
    pub halves: bool,
    /// A quick noise-free reference.
    pub reference: bool,
}

impl Needs {
    /// Two half buffers.
    pub const HALVES: Self = Self { halves: true, reference: false };
    /// A quick noise-free reference.
    pub const REFERENCE: Self = Self { halves: false, reference: true };
}

/// Where people are expected to stop seeing noise in a tile: not where the tile stops, which is later, and
/// said by [`Verdict::expected_spp`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[non_exhaustive]
pub struct ExpectedThreshold {
    /// Samples per pixel below which it lies with a probability of 10 %.
    pub low: u64,
    /// Samples per pixel below which it lies as often as not: what predictions of people are scored by.
    pub median: u64,
    /// Samples per pixel below which it lies with a probability of 90 %.
    pub high: u64,
}

impl ExpectedThreshold {
    /// The same for whoever needs another number of samples.
    #[must_use]
    pub fn map(self, samples: impl Fn(u64) -> u64) -> Self {
        Self { low: samples(self.low), median: samples(self.median), high: samples(self.high) }
    }
}

/// What keeps a tile open.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "files", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum OpenFor {
    /// What is wrong with the tile, mostly its noise, would be seen.
    Noise,
    /// The exposure of the picture is not known well enough: see [`View::exposure_error`].
    Exposure,
    /// Of light that few samples have met elsewhere, as much as the tile is likely to lack would be seen.
    UnmetLight,
    /// So few samples that neither noise in few pixels is known yet, nor what light none of them has met.
    FewSamples,
    /// Doubts about the samples themselves: the session waits with verdicts ([`crate::watch`]).
    Doubt,
}

impl OpenFor {
    /// All of them, in their order.
    pub const ALL: [Self; 5] = [Self::Noise, Self::Exposure, Self::UnmetLight, Self::FewSamples, Self::Doubt];

    /// As files have it, such as `unmet-light`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Noise => "noise",
            Self::Exposure => "exposure",
            Self::UnmetLight => "unmet-light",
            Self::FewSamples => "few-samples",
            Self::Doubt => "doubt",
        }
    }
}

/// What a criterion says about one tile.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[non_exhaustive]
pub struct Verdict {
    /// Whether the tile needs no more samples.
    pub converged: bool,
    /// The share of people who see no difference from the converged picture, 0 to 1, if the criterion computes one:
    /// the probability that one of them sees none.
    pub probability: Option<f32>,
    /// Where people are expected to stop seeing noise, whatever the criterion's own threshold; `None` if it
    /// has learned nothing from people.
    pub threshold: Option<ExpectedThreshold>,
    /// Samples per pixel at which the criterion expects to be satisfied, if it can tell.
    pub expected_spp: Option<u64>,
    /// What keeps the tile open, by the criterion; `None` if it has converged. See [`Session::open_for`](crate::Session::open_for).
    pub open_for: Option<OpenFor>,
    /// Whether the tile is unlike everything the criterion was made for: treat the verdict with care.
    pub unfamiliar: bool,
    /// What `probability` would be without the penalty for an unfamiliar tile; equal to it where there is no
    /// penalty.
    pub probability_without_penalty: Option<f32>,
    /// Whether what is to be shown of the tile in place of its samples, such as a denoised picture, is brighter or
    /// darker than they are, by more than their noise explains.
    pub brightness_differs: bool,
    /// Just-objectionable differences (JOD) that what is to be shown of the tile has lost against the converged picture, by
    /// the estimate, if the criterion judges that and not the samples.
    pub lost: Option<f64>,
    /// Whether the tile is to be shown as rendered where other tiles are denoised.
    pub undenoised: bool,
}

impl Verdict {
    /// A verdict of a criterion that expects nothing and computes no probability: open for noise, or converged.
    pub fn new(converged: bool) -> Self {
        let open_for = if converged { None } else { Some(OpenFor::Noise) };
        Self { converged, open_for, ..Self::default() }
    }

    /// The same with [`Verdict::expected_spp`].
    pub fn expecting(self, expected_spp: Option<u64>) -> Self {
        Self { expected_spp, ..self }
    }

    /// The same with [`Verdict::brightness_differs`].
    pub fn with_brightness(self, brightness_differs: bool) -> Self {
        Self { brightness_differs, ..self }
    }

    /// The same, but open for this.
    pub fn kept_open_by(self, why: OpenFor) -> Self {
        Self { converged: false, open_for: Some(why), ..self }
    }

    /// The same with [`Verdict::lost`] and [`Verdict::undenoised`].
    pub fn with_loss(self, lost: f64, undenoised: bool) -> Self {
        Self { lost: Some(lost), undenoised, ..self }
    }

    /// The same with [`Verdict::probability`], which no unfamiliar texture has lowered.
    pub fn with_probability(self, probability: f32) -> Self {
        Self { probability: Some(probability), ..self }
    }
}

/// Why a criterion could not judge.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum CriterionError {
    /// The criterion needs a reference, and the source has none.
    #[error(
        "{0} needs a ray-traced reference, which this source does not have: use a model trained on half buffers"
    )]
    NoReference(String),
    /// The criterion was trained for another tile size.
    #[error(
        "{name} judges only tiles of {expected}×{expected} pixels, not {width}×{height}: \
         set the tile size to {expected} and choose an image size that it divides"
    )]
    TileSize {
        /// The criterion.
        name: String,
        /// Edge of the tiles it can judge.
        expected: usize,
        /// Width of the tile it was given.
        width: usize,
        /// Height of the tile it was given.
        height: usize,
    },
    /// The criterion does not know what other viewing conditions change.
    #[error(
        "{name} was trained for the viewing conditions {trained} and cannot tell what people see with {asked}: \
         use a model whose descriptor knows viewing conditions, or leave them as they are"
    )]
    Viewing {
        /// The criterion.
        name: String,
        /// Those it was trained for, as text.
        trained: String,
        /// Those it was given, as text.
        asked: String,
    },
    /// Something that the criterion works with failed, such as a denoiser.
    #[error("{name} cannot judge: {why}")]
    Failed {
        /// The criterion.
        name: String,
        /// What went wrong, and its causes.
        why: String,
    },
    /// The criterion does not keep what [`StoppingCriterion`] asks of implementers.
    #[error("{name} breaks the contract of criteria: {what}")]
    Contract {
        /// The criterion.
        name: String,
        /// What it did.
        what: String,
    },
    /// The descriptor cannot describe the tile.
    #[error(transparent)]
    Descriptor(DescriptorError),
}

/// Judges the tiles of a film.
///
/// # Why it is shaped so
/// All tiles that are due come in one call, so that a criterion can distribute them over threads or look at
/// the whole image once. A criterion may keep state between calls (one that compares with the previous
/// picture does): hence `&mut`. One that says its state can be saved and resumed with its session.
///
/// # Example
/// Tiles stop when their two halves differ by less than a limit, on average over their pixels as displayed:
///
/// ```
/// use noisefloor::criterion::{CriterionError, Needs, View};
/// use noisefloor::{Params, Session, StoppingCriterion, Tile, Verdict};
///
/// struct HalvesAgree(f32);
///
/// impl StoppingCriterion for HalvesAgree {
///     fn name(&self) -> String {
///         "halves that agree".into()
///     }
///
///     fn fingerprint(&self) -> String {
///         format!("halves agree within {}", self.0)
///     }
///
///     fn needs(&self) -> Needs {
///         Needs::HALVES
///     }
///
///     fn state(&self) -> Option<Vec<u8>> {
///         Some(Vec::new()) // keeps nothing, and can be resumed
///     }
///
///     fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
///         let verdict = |tile: &Tile| {
///             let pixels = tile.rows(view.film.width()).flatten();
///             let difference = |pixel| {
///                 let [(a, _), (b, _)] = view.film.pixel_halves(tile.index, pixel);
///                 (view.display.luma(a) - view.display.luma(b)).abs()
///             };
///             Verdict::new(pixels.map(difference).sum::<f32>() / tile.pixels() as f32 <= self.0)
///         };
///         Ok(tiles.iter().map(verdict).collect())
///     }
/// }
///
/// let mut session = Session::new(64, 64, HalvesAgree(0.01), Params::default().with_tile(32))?;
/// while !session.is_done() {
///     for request in session.requests() {
///         session.push(request.tile.index, request.spp, &vec![[0.5; 3]; request.tile.pixels()])?;
///     }
///     session.judge()?;
/// }
/// # Ok::<(), noisefloor::SessionError>(())
/// ```
///
/// # For implementers
/// - Return one verdict for each tile, in order, with probabilities from 0 to 1. Fewer, more or others are
///   [`CriterionError::Contract`], and no tile stops by them.
/// - Verdicts must not depend on the number of threads.
/// - The exposure may still move while [`View::exposure_error`] is large; what it moves by reopens tiles. Count the error,
///   or wait for it to fall.
/// - Declare in [`StoppingCriterion::needs`] what you read; what nobody needs is neither rendered nor kept.
/// - Forget the previous film in [`StoppingCriterion::begin`]; a criterion without state has nothing to do
///   there.
/// - Say in [`StoppingCriterion::state`] what you keep, `Some` of nothing if nothing; otherwise no session of
///   yours can be resumed.
#[auto_impl(&mut, Box)]
pub trait StoppingCriterion {
    /// A short name for reports, such as `"200 samples per pixel"`.
    fn name(&self) -> String;

    /// Everything its verdicts depend on besides the film and the display: model digest, threshold,
    /// constants. Two criteria with the same fingerprint and state give the same verdicts.
    fn fingerprint(&self) -> String;

    /// Whether whatever satisfies this criterion satisfies the one with that fingerprint, as with another limit. Then a session of
    /// that criterion can be resumed with this one: its tiles that were done are judged again. By default no.
    fn asks_for_more_than(&self, _fingerprint: &str) -> bool {
        false
    }

    /// A new film begins, with these tiles.
    fn begin(&mut self, _grid: TileGrid) {}

    /// What the criterion reads besides the mean picture.
    fn needs(&self) -> Needs {
        Needs::default()
    }

    /// Whose thresholds its verdicts stand for, as a line from those of the training data.
    fn audience(&self) -> Audience {
        Audience::TRAINED
    }

    /// Whether it only counts samples and looks at no noise. Tiles that satisfy it then stop with
    /// [`StopReason::ReachedSpp`](crate::StopReason::ReachedSpp) and not as converged.
    fn only_counts(&self) -> bool {
        false
    }

    /// How visible the noise is at each pixel of the image, row-major, as a multiple of what is just seen; NaN
    /// where a tile gives no evidence. `None`, the default, if the criterion cannot say. Costs as much as a verdict
    /// on every tile; called where a map is wanted, never for a verdict.
    fn visible_noise(&self, _view: &View<'_>) -> Option<Vec<f32>> {
        None
    }

    /// Just-objectionable differences (JOD) that what is to be shown has lost at each pixel of the image, row-major, by the last
    /// verdict on its tile; NaN where there was none. `None`, the default, if the criterion judges the samples themselves.
    fn map_of_jods_lost(&self) -> Option<&[f32]> {
        None
    }

    /// The share of people who see no noise *anywhere* in a picture, from the last [`Verdict::probability`] of each
    /// tile and its pixels. `None`, the default, if the criterion knows nothing of people.
    fn share_in_picture(&self, _viewing: Viewing, _tiles: &[(f32, usize)]) -> Option<f64> {
        None
    }

    /// Judges the given tiles, all of which have samples.
    ///
    /// # Errors
    /// [`CriterionError`] if the criterion does not fit the job.
    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError>;

    /// New verdicts on tiles that the last [`StoppingCriterion::judge`] was not asked about, where what it found
    /// makes earlier ones untrue; each is returned once, and none has converged. A session opens such tiles again.
    /// None, the default, if verdicts look at nothing but their tiles.
    fn revised(&mut self) -> Vec<(Tile, Verdict)> {
        Vec::new()
    }

    /// What the criterion keeps between verdicts and cannot derive from the film, for a
    /// [`Checkpoint`](crate::Checkpoint); `None`, the default, if it cannot be saved.
    fn state(&self) -> Option<Vec<u8>> {
        None
    }

    /// Restores what [`StoppingCriterion::state`] returned for a film with these tiles. The bytes may come
    /// from anywhere: returns false, and changes nothing, if they are not such a state. The default is for
    /// a criterion that keeps nothing.
    fn restore(&mut self, _grid: TileGrid, state: &[u8]) -> bool {
        state.is_empty() && self.state().is_some()
    }
}

/// Whether a criterion has answered what it was asked.
pub(crate) fn check_verdicts(
    criterion: &impl StoppingCriterion,
    asked: &[Tile],
    verdicts: &[Verdict],
) -> Result<(), CriterionError> {
    let broken = |what| Err(CriterionError::Contract { name: criterion.name(), what });
    if verdicts.len() != asked.len() {
        return broken(format!("{} verdicts on {} tiles", verdicts.len(), asked.len()));
    }
    for (tile, verdict) in asked.iter().zip(verdicts) {
        let probabilities = [verdict.probability, verdict.probability_without_penalty];
        if let Some(odd) = probabilities.into_iter().flatten().find(|p| !(0.0..=1.0).contains(p)) {
            return broken(format!("a probability of {odd} for tile {}", tile.index));
        }
    }
    Ok(())
}

/// The simplest criterion: a fixed number of samples per pixel everywhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FixedSpp(pub u64);

impl StoppingCriterion for FixedSpp {
    fn name(&self) -> String {
        format!("{} samples per pixel", self.0)
    }

    fn fingerprint(&self) -> String {
        self.name()
    }

    fn asks_for_more_than(&self, fingerprint: &str) -> bool {
        let spp = fingerprint.strip_suffix(" samples per pixel").and_then(|spp| spp.parse::<u64>().ok());
        spp.is_some_and(|spp| spp < self.0)
    }

    fn only_counts(&self) -> bool {
        true
    }

    fn state(&self) -> Option<Vec<u8>> {
        Some(Vec::new())
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let verdict = |t: &Tile| match Verdict::new(view.film.spp(t.index) >= self.0) {
            enough if enough.converged => enough.expecting(Some(self.0)),
            few => few.kept_open_by(OpenFor::FewSamples).expecting(Some(self.0)),
        };
        Ok(tiles.iter().map(verdict).collect())
    }
}
