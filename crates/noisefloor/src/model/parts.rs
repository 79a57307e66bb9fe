//! What a model consists of, and how that judges a tile.

use super::familiarity::{Familiarity, UNFAMILIAR};
use crate::descriptor::Descriptor;
use crate::display::ToneMapping;
use crate::evidence::Evidence;
use crate::params::Audience;
use crate::people::{Spread, Unknown};
use crate::svm::{Classifier, Machine, from_log_odds};
use noisefloor_vision::Viewing;
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};

/// Scores of predicted thresholds against human ones, over a set of zones.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub struct Scores {
    /// Zones scored.
    pub zones: usize,
    /// exp(mean |ln(predicted/human)|), at least 1.
    pub error_factor: f64,
    /// exp(mean ln(predicted/human)): above 1 stops late, below 1 early.
    pub bias_factor: f64,
    /// Share of zones stopped below half the human threshold, in [0, 1].
    pub early_share: f64,
}

/// Where a model comes from.
#[derive(Clone, Debug, Default, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub struct TrainingRecord {
    /// What it was trained on, in words.
    pub corpus: String,
    /// BLAKE3 of the descriptor table, hexadecimal.
    pub table_digest: String,
    /// Scenes trained on.
    pub scenes: Vec<String>,
    /// Examples (zones × levels) trained on.
    pub examples: usize,
    /// C of the machine.
    pub c: f64,
    /// γ of the machine.
    pub gamma: f64,
    /// Scores on scenes left out, with C and γ chosen without them; `None` if not evaluated.
    pub leave_one_scene_out: Option<Scores>,
}

/// Everything a model consists of, unchecked: [`Model::new`](super::Model::new) checks that it fits together.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelParts {
    /// What is computed from a tile.
    pub descriptor: Descriptor,
    /// What the tile is compared with.
    pub evidence: Evidence,
    /// How the training pictures were displayed. For the record: descriptors are computed from display
    /// values, however these were made, and a session may display its picture in another way.
    pub tone_mapping: ToneMapping,
    /// On which display the training pictures were seen, and from how far. An assumption where nobody
    /// recorded it, as with the bundled model's. Of stills: people have judged no films.
    pub viewing: Viewing,
    /// From raw descriptors to probabilities.
    pub classifier: Classifier,
    /// The texture that the model has been tried on; `None` if the descriptor does not separate noise from
    /// picture.
    pub familiarity: Option<Familiarity>,
    /// How thresholds scatter around what it expects; `None` if the descriptor does not separate noise from picture,
    /// so that nothing is known in samples: P is then the machine's, for the mean observer.
    pub spread: Option<Spread>,
    /// Whose thresholds it predicts, as a line from those of the training data.
    pub audience: Audience,
    /// Where it comes from.
    pub record: TrainingRecord,
}

/// What a model says about one tile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judgement {
    /// Share of people, in [0, 1], in a scene like those seen, who see no difference. Of an unfamiliar tile, their
    /// thresholds scatter more than the model knows.
    pub probability: f32,
    /// The same without the penalty for unfamiliar tiles.
    pub probability_without_penalty: f32,
    /// Probability that the mean observer sees no difference, without the penalty: one half where a mean threshold
    /// is expected.
    pub mean_observer: f32,
    /// Whether the tile shows texture that the model has not been tried on.
    pub unfamiliar: bool,
}

impl ModelParts {
    /// Judges a tile by its raw descriptor, as [`Model::judge`](super::Model::judge) does: for scoring what is not a whole model,
    /// such as one trained on some of a descriptor's numbers.
    ///
    /// # Panics
    /// If the descriptor does not have the classifier's dimensionality.
    pub fn judge(&self, raw: &[f32]) -> Judgement {
        self.curve(raw, None).judgement()
    }

    /// P of a tile as a function of its samples, for people whose thresholds scatter by `people`, or as the model says.
    pub(crate) fn curve<'a>(&'a self, raw: &'a [f32], people: Option<f64>) -> ProbabilityCurve<'a> {
        let scaled = self.classifier.scaler.scaled(raw);
        let texture = || self.descriptor.texture().iter().map(|&i| scaled[i]).collect::<Vec<f32>>();
        let strangeness = self.familiarity.as_ref().map_or(0.0, |known| known.strangeness(&texture()));
        let spread = self.spread.map(|s| Spread { people: people.unwrap_or(s.people), ..s });
        let texture = (UNFAMILIAR * f64::from(strangeness)).powi(2);
        let unknown = Unknown { texture, ..Unknown::default() };
        ProbabilityCurve { parts: self, raw, spread, unknown, projected: scaled }
    }

    /// Checks that they fit together, and that every number is finite; the error says what does not.
    pub(crate) fn check(&self) -> Result<(), &'static str> {
        let n = self.descriptor.dimensions();
        let Classifier { scaler, machine, platt } = &self.classifier;
        if scaler.mean.len() != n || scaler.scale.len() != n {
            return Err("scaler and descriptor differ in length");
        }
        let (weights, scalars): ([&[f32]; 2], [f32; 2]) = match machine {
            Machine::Line(line) => ([&line.weights, &[]], [line.bias, 0.0]),
            Machine::Svm(svm) => ([&svm.vectors, &svm.coefficients], [svm.rho, svm.gamma]),
        };
        let fits = match machine {
            Machine::Line(line) => line.weights.len() == n,
            Machine::Svm(svm) => {
                !svm.coefficients.is_empty() && svm.vectors.len() == svm.coefficients.len() * n
            }
        };
        if !fits {
            return Err("the machine and the descriptor differ in length");
        }
        if let Some(Spread { scenes, people }) = self.spread
            && ![scenes, people].iter().all(|sd| (1e-6..=100.0).contains(sd))
        {
            return Err("the spread of thresholds is out of range");
        }
        if let Some(Familiarity { zones, reach }) = &self.familiarity {
            let known = self.descriptor.texture().len();
            if known == 0 || zones.is_empty() || zones.iter().any(|zone| zone.len() != known) {
                return Err("familiar zones and descriptor differ in length");
            }
            if !(*reach >= 0.0 && reach.is_finite() && zones.iter().flatten().all(|v| v.is_finite())) {
                return Err("what is familiar is not a finite number");
            }
        }
        let numbers: [&[f32]; 5] = [&scaler.mean, &scaler.scale, weights[0], weights[1], &scalars];
        if !numbers.into_iter().flatten().chain(&[platt.a, platt.b]).all(|v| v.is_finite()) {
            return Err("a number is not finite");
        }
        if matches!(machine, Machine::Svm(svm) if svm.gamma <= 0.0) {
            return Err("γ is not positive");
        }
        if self.viewing.frames_per_second().is_some() {
            return Err("it was trained on films, and people have judged stills");
        }
        if self.tone_mapping.check().is_err() {
            return Err("the tone mapping is out of range");
        }
        Ok(())
    }
}

/// P of one tile as a function of its samples: noise falls as 1/√n, and so do errors of what is estimated. Texture decides
/// once how familiar the tile is.
pub(crate) struct ProbabilityCurve<'a> {
    parts: &'a ModelParts,
    raw: &'a [f32],
    spread: Option<Spread>,
    unknown: Unknown,
    /// Room for the descriptor at another number of samples.
    projected: Vec<f32>,
}

impl ProbabilityCurve<'_> {
    /// With what is not known of the tile at its own samples.
    pub(crate) fn within(self, unknown: Unknown) -> Self {
        Self { unknown: Unknown { texture: self.unknown.texture, ..unknown }, ..self }
    }

    pub(crate) fn judgement(&mut self) -> Judgement {
        self.projected.copy_from_slice(self.raw);
        let log_odds = self.parts.classifier.log_odds_in_place(&mut self.projected);
        Judgement {
            probability: self.share(log_odds, self.unknown),
            probability_without_penalty: self.share(log_odds, Unknown { texture: 0.0, ..self.unknown }),
            mean_observer: from_log_odds(log_odds),
            unfamiliar: self.unknown.texture > 0.0,
        }
    }

    fn share(&self, log_odds: f64, unknown: Unknown) -> f32 {
        self.spread.map_or_else(|| from_log_odds(log_odds), |spread| spread.share(log_odds, unknown) as f32)
    }

    /// P with `factor` times the samples; `None` if the descriptor does not separate noise from picture.
    pub(crate) fn at(&mut self, factor: f32) -> Option<f32> {
        self.projected_by(factor, self.unknown.after(factor.into()))
    }

    /// The same of noise alone, as if all about it were known.
    pub(crate) fn known(&mut self, factor: f32) -> Option<f32> {
        self.projected_by(factor, Unknown::default())
    }

    fn projected_by(&mut self, factor: f32, unknown: Unknown) -> Option<f32> {
        self.projected.copy_from_slice(self.raw);
        let known = self.parts.descriptor.project(&mut self.projected, factor);
        known.then(|| {
            let log_odds = self.parts.classifier.log_odds_in_place(&mut self.projected);
            self.share(log_odds, unknown)
        })
    }
}
