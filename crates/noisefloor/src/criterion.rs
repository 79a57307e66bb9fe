//! What decides that a tile is done.

use crate::display::Display;
use crate::film::Film;
use crate::params::Audience;
use crate::source::Rgb;
use crate::tile::{Tile, TileGrid};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// What a criterion looks at.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// All samples so far.
    pub film: &'a Film,
    /// The frozen way from radiance to the screen.
    pub display: &'a Display,
    /// The quick reference, display-encoded, row-major over the image; there if [`Needs::reference`] is.
    pub reference: Option<&'a [Rgb]>,
}

/// What a criterion needs; nothing else is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Needs {
    /// Two half buffers.
    pub halves: bool,
    /// A quick noise-free reference.
    pub reference: bool,
}

/// What a criterion says of one tile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// Whether the tile needs no more samples.
    pub converged: bool,
    /// Probability that an observer sees no difference from the converged picture, where the criterion has one.
    pub probability: Option<f32>,
    /// Samples per pixel at which the criterion expects to be satisfied, where it can tell.
    pub expected_samples: Option<u64>,
    /// Whether the tile is unlike anything that the criterion was made for, so that its word has to be taken with care.
    pub unfamiliar: bool,
}

/// Why a criterion could not judge.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum CriterionError {
    /// The source has no reference, and the criterion needs one.
    #[error("{0} needs a ray-traced reference, and this source has none: use a model trained on halves")]
    NoReference(String),
    /// The criterion was trained for another tile size.
    #[error(
        "{name} judges tiles of {expected}×{expected} pixels only, not {width}×{height}: set the tile size to {expected} and use an image that it divides"
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
}

/// Judges tiles of a film.
///
/// # Why it is shaped so
/// All tiles that are due come in one call, so that a criterion can spread them over threads, or look at the whole image
/// once. A criterion may keep state between calls (a rival that compares with the previous picture does): hence `&mut`.
///
/// # For implementers
/// - Return one verdict for each tile, in their order.
/// - Verdicts must not depend on the number of threads.
/// - Say in [`StoppingCriterion::needs`] what you read; what you do not need is not rendered and not kept.
pub trait StoppingCriterion {
    /// A short name for reports: `"svm oracle"`.
    fn name(&self) -> String;

    /// What the criterion reads beside the mean picture.
    fn needs(&self) -> Needs {
        Needs::default()
    }

    /// Whose thresholds its verdicts stand for, as a line from those of the training data.
    fn audience(&self) -> Audience {
        Audience::TRAINED
    }

    /// How visible the noise is at each pixel of the image, row-major, in 8-bit display steps; NaN where a tile gives no evidence.
    /// `None` if the criterion cannot say, which is the default. Costs as much as a verdict on every tile, and is asked for where a
    /// map is wanted, never for a verdict.
    fn visible_noise(&self, _view: &View<'_>) -> Option<Vec<f32>> {
        None
    }

    /// What the criterion keeps between verdicts and cannot make again from the film, for a [`crate::Checkpoint`]: nothing, by default.
    fn state(&self) -> Vec<u8> {
        Vec::new()
    }

    /// Takes up what [`StoppingCriterion::state`] gave of a film of such a grid. The bytes may come from anywhere: false if they are not that.
    fn restore(&mut self, _grid: TileGrid, state: &[u8]) -> bool {
        state.is_empty()
    }

    /// Judges the tiles named, all of which have samples.
    ///
    /// # Errors
    /// [`CriterionError`] if the criterion does not fit the job.
    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError>;
}

impl<C: StoppingCriterion + ?Sized> StoppingCriterion for Box<C> {
    fn name(&self) -> String {
        (**self).name()
    }

    fn needs(&self) -> Needs {
        (**self).needs()
    }

    fn audience(&self) -> Audience {
        (**self).audience()
    }

    fn visible_noise(&self, view: &View<'_>) -> Option<Vec<f32>> {
        (**self).visible_noise(view)
    }

    fn state(&self) -> Vec<u8> {
        (**self).state()
    }

    fn restore(&mut self, grid: TileGrid, state: &[u8]) -> bool {
        (**self).restore(grid, state)
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        (**self).judge(view, tiles)
    }
}

/// The simplest criterion: a fixed number of samples per pixel everywhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FixedSamples(pub u64);

impl StoppingCriterion for FixedSamples {
    fn name(&self) -> String {
        format!("{} samples per pixel", self.0)
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let verdict = |t: &Tile| Verdict {
            converged: view.film.samples(t.index) >= self.0,
            probability: None,
            expected_samples: Some(self.0),
            unfamiliar: false,
        };
        Ok(tiles.iter().map(verdict).collect())
    }
}
