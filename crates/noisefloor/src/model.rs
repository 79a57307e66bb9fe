//! The model: everything a verdict depends on, and its file. The layout is that of `container.rs`.

use crate::container::{self, FileFault, Format, MAX_PAYLOAD};
use crate::descriptor::{Descriptor, DescriptorError, DescriptorKind, DescriptorSpec};
use crate::display::ToneMapping;
use crate::evidence::Evidence;
use crate::oracle::Spread;
use crate::params::Audience;
use crate::svm::{Classifier, Machine, from_log_odds};
use noisefloor_vision::{Eotf, Primaries, Viewing, ViewingError, ViewingParams};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::io::{self, Read, Write};
use thiserror::Error;

pub(crate) mod familiarity;
pub(crate) use familiarity::CAUTION;
pub use familiarity::Familiarity;

const FORMAT: Format = Format { magic: *b"NFMODEL\0", version: VERSION };
const VERSION: u32 = 6;
#[cfg(feature = "bundled-model")]
static BUNDLED: &[u8] = include_bytes!("../models/human.nfm");

/// Why a model cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ModelError {
    /// The file cannot be read or written.
    #[error("the model cannot be read or written: {0}")]
    Io(#[from] io::Error),
    /// Not a model file.
    #[error("this is not a noisefloor model: it does not begin with the model magic")]
    Foreign,
    /// Written by a later release.
    #[error(
        "the model has format version {found}, and this release reads version {VERSION}: update noisefloor"
    )]
    Newer {
        /// Version in the file.
        found: u32,
    },
    /// Written by an earlier release, whose models lack what this one needs.
    #[error(
        "the model has format version {found}, and this release reads version {VERSION}: train it again, with this release"
    )]
    Older {
        /// Version in the file.
        found: u32,
    },
    /// The payload is shorter or longer than announced, or its checksum differs.
    #[error("the model is damaged: {0}")]
    Damaged(String),
    /// The payload is announced with more than the limit.
    #[error("the model announces {0} bytes, more than the limit of {MAX_PAYLOAD}")]
    Oversized(u64),
    /// The content contradicts itself.
    #[error("the model contradicts itself: {0}")]
    Invalid(String),
    /// The model was trained with another version of the descriptor than this release computes.
    #[error(
        "the model needs version {needed} of the {name} descriptor, and this release computes version {here}: train it again"
    )]
    Descriptor {
        /// The descriptor.
        name: &'static str,
        /// Version the model was trained with.
        needed: u16,
        /// Version of this release.
        here: u16,
    },
    /// The model names a descriptor that this program does not have.
    #[error("the model cannot be used here: {0}")]
    UnknownDescriptor(#[from] DescriptorError),
}

impl From<FileFault> for ModelError {
    fn from(fault: FileFault) -> Self {
        match fault {
            FileFault::Io(error) => Self::Io(error),
            FileFault::Foreign => Self::Foreign,
            FileFault::Version(found) if found > VERSION => Self::Newer { found },
            FileFault::Version(found) => Self::Older { found },
            FileFault::Damaged(what) => Self::Damaged(what),
            FileFault::Oversized(bytes) => Self::Oversized(bytes),
        }
    }
}

/// Scores of predicted thresholds against human ones, over a set of zones.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
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
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
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

/// Everything a model consists of, unchecked: [`Model::new`] checks that it fits together.
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

/// A trained oracle: what a verdict depends on. Its parts fit together.
#[derive(Clone, Debug, PartialEq)]
pub struct Model(ModelParts);

/// A model as files hold it.
#[derive(Serialize, Deserialize)]
struct ModelFile<'a> {
    descriptor: DescriptorSpec,
    descriptor_version: u16,
    evidence: Evidence,
    tone_mapping: ToneMapping,
    viewing: StillViewing,
    classifier: Cow<'a, Classifier>,
    familiarity: Cow<'a, Option<Familiarity>>,
    spread: Option<Spread>,
    audience: Audience,
    record: Cow<'a, TrainingRecord>,
}

/// The viewing conditions of a still as files hold them, whose fields have no names there.
#[derive(Serialize, Deserialize)]
struct StillViewing {
    pixels_per_degree: f64,
    peak: f64,
    black: f64,
    ambient: f64,
    reflectivity: f64,
    eotf: Eotf,
    primaries: Primaries,
}

impl From<Viewing> for StillViewing {
    fn from(viewing: Viewing) -> Self {
        let ViewingParams { pixels_per_degree, peak, black, ambient, reflectivity, eotf, primaries, .. } =
            viewing.params();
        Self { pixels_per_degree, peak, black, ambient, reflectivity, eotf, primaries }
    }
}

impl TryFrom<StillViewing> for Viewing {
    type Error = ViewingError;

    fn try_from(still: StillViewing) -> Result<Self, ViewingError> {
        let StillViewing { pixels_per_degree, peak, black, ambient, reflectivity, eotf, primaries } = still;
        let frames_per_second = None;
        ViewingParams {
            pixels_per_degree,
            peak,
            black,
            ambient,
            reflectivity,
            eotf,
            primaries,
            frames_per_second,
        }
        .check()
    }
}

/// What a model says about one tile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Judgement {
    /// Share of people, in [0, 1], in a scene like those seen, who see no difference. For an unfamiliar tile, that
    /// with fewer samples than it has: with half of them, if it is unlike all that the model was tried on.
    pub probability: f32,
    /// The same without the penalty for unfamiliar tiles.
    pub probability_without_penalty: f32,
    /// Probability that the mean observer sees no difference, without the penalty: one half where a mean threshold
    /// is expected.
    pub mean_observer: f32,
    /// Whether the tile shows texture that the model has not been tried on.
    pub unfamiliar: bool,
}

impl Model {
    /// The model trained on the human data of LISIC (nine scenes and two SIN3D views), inside the library; see the
    /// project's `docs/guide.md` for the command that makes it.
    #[cfg(feature = "bundled-model")]
    pub fn bundled() -> Self {
        Self::read(BUNDLED).expect("the bundled model is checked by a test")
    }

    /// A model made of these parts.
    ///
    /// # Errors
    /// [`ModelError::Invalid`] if they contradict each other, or a number is not finite.
    pub fn new(parts: ModelParts) -> Result<Self, ModelError> {
        parts.check()?;
        Ok(Self(parts))
    }

    /// Reads a model with a built-in descriptor.
    ///
    /// # Errors
    /// [`ModelError`] if it is foreign, damaged, oversized, newer, older, contradicts itself, or needs
    /// another version of the descriptor.
    pub fn read(from: impl Read) -> Result<Self, ModelError> {
        Self::read_with(from, &[])
    }

    /// Reads a model whose descriptor is one of `kinds`, or built in.
    ///
    /// # Errors
    /// [`ModelError`] as in [`Model::read`].
    pub fn read_with(from: impl Read, kinds: &[DescriptorKind]) -> Result<Self, ModelError> {
        let file: ModelFile<'_> = FORMAT.read(from)?;
        let descriptor = Descriptor::from_spec(&file.descriptor, kinds)?;
        let (needed, here) = (file.descriptor_version, descriptor.version());
        if needed != here {
            return Err(ModelError::Descriptor { name: descriptor.name(), needed, here });
        }
        Self::new(ModelParts {
            descriptor,
            evidence: file.evidence,
            tone_mapping: file.tone_mapping,
            viewing: file.viewing.try_into().map_err(|e: ViewingError| ModelError::Invalid(e.to_string()))?,
            classifier: file.classifier.into_owned(),
            familiarity: file.familiarity.into_owned(),
            spread: file.spread,
            audience: file.audience,
            record: file.record.into_owned(),
        })
    }

    /// Writes the model.
    ///
    /// # Errors
    /// [`ModelError::Io`] if it cannot be written.
    pub fn write(&self, to: impl Write) -> Result<(), ModelError> {
        Ok(FORMAT.write(&self.file(), to)?)
    }

    fn file(&self) -> ModelFile<'_> {
        let ModelParts {
            descriptor,
            evidence,
            tone_mapping,
            viewing,
            classifier,
            familiarity,
            spread,
            audience,
            record,
        } = &self.0;
        ModelFile {
            descriptor: descriptor.spec(),
            descriptor_version: descriptor.version(),
            evidence: *evidence,
            tone_mapping: tone_mapping.clone(),
            viewing: (*viewing).into(),
            classifier: Cow::Borrowed(classifier),
            familiarity: Cow::Borrowed(familiarity),
            spread: *spread,
            audience: *audience,
            record: Cow::Borrowed(record),
        }
    }

    /// BLAKE3 of the content, hexadecimal: identifies the model in reports.
    pub fn digest(&self) -> String {
        container::payload(&self.file()).map(|p| blake3::hash(&p).to_hex().to_string()).unwrap_or_default()
    }

    /// The parts, to make another model of them.
    pub fn into_parts(self) -> ModelParts {
        self.0
    }

    /// What is computed from a tile.
    pub fn descriptor(&self) -> &Descriptor {
        &self.0.descriptor
    }

    /// What a tile is compared with.
    pub fn evidence(&self) -> Evidence {
        self.0.evidence
    }

    /// How the training pictures were displayed.
    pub fn tone_mapping(&self) -> ToneMapping {
        self.0.tone_mapping.clone()
    }

    /// The viewing conditions that it was trained for. Those of the bundled model are an assumption (`desk`):
    /// the data do not say on what display, and from where, people saw the pictures.
    pub fn viewing(&self) -> Viewing {
        self.0.viewing
    }

    /// From raw descriptors to probabilities.
    pub fn classifier(&self) -> &Classifier {
        &self.0.classifier
    }

    /// The texture that the model has been tried on.
    pub fn familiarity(&self) -> Option<&Familiarity> {
        self.0.familiarity.as_ref()
    }

    /// How thresholds scatter around what it expects.
    pub fn spread(&self) -> Option<Spread> {
        self.0.spread
    }

    /// Whose thresholds it predicts, as a line from those of the training data.
    pub fn audience(&self) -> Audience {
        self.0.audience
    }

    /// Where it comes from.
    pub fn record(&self) -> &TrainingRecord {
        &self.0.record
    }

    /// Judges a tile by its raw descriptor.
    ///
    /// # Panics
    /// If the descriptor does not have the model's dimensionality.
    pub fn judge(&self, raw: &[f32]) -> Judgement {
        self.0.judge(raw)
    }

    pub(crate) fn curve<'a>(&'a self, raw: &'a [f32], people: Option<f64>) -> ProbabilityCurve<'a> {
        self.0.curve(raw, people)
    }
}

impl ModelParts {
    /// Judges a tile by its raw descriptor, as [`Model::judge`] does: for scoring what is not a whole model,
    /// such as one trained on some of a descriptor's numbers.
    ///
    /// # Panics
    /// If the descriptor does not have the classifier's dimensionality.
    pub fn judge(&self, raw: &[f32]) -> Judgement {
        self.curve(raw, None).judgement()
    }

    /// P of a tile as a function of its samples, for people whose thresholds scatter by `people`, or as the model says.
    fn curve<'a>(&'a self, raw: &'a [f32], people: Option<f64>) -> ProbabilityCurve<'a> {
        let scaled = self.classifier.scaler.scaled(raw);
        let texture = || self.descriptor.texture().iter().map(|&i| scaled[i]).collect::<Vec<f32>>();
        let strangeness = self.familiarity.as_ref().map_or(0.0, |known| known.strangeness(&texture()));
        let spread = self.spread.map(|s| Spread { people: people.unwrap_or(s.people), ..s });
        ProbabilityCurve { parts: self, raw, spread, strangeness, projected: scaled }
    }

    fn check(&self) -> Result<(), ModelError> {
        let invalid = |what: &str| Err(ModelError::Invalid(what.into()));
        let n = self.descriptor.dimensions();
        let Classifier { scaler, machine, platt } = &self.classifier;
        if scaler.mean.len() != n || scaler.scale.len() != n {
            return invalid("scaler and descriptor differ in length");
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
            return invalid("the machine and the descriptor differ in length");
        }
        if let Some(Spread { scenes, people }) = self.spread
            && ![scenes, people].iter().all(|sd| (1e-6..=100.0).contains(sd))
        {
            return invalid("the spread of thresholds is out of range");
        }
        if let Some(Familiarity { zones, reach }) = &self.familiarity {
            let known = self.descriptor.texture().len();
            if known == 0 || zones.is_empty() || zones.iter().any(|zone| zone.len() != known) {
                return invalid("familiar zones and descriptor differ in length");
            }
            if !(*reach >= 0.0 && reach.is_finite() && zones.iter().flatten().all(|v| v.is_finite())) {
                return invalid("what is familiar is not a finite number");
            }
        }
        let numbers: [&[f32]; 5] = [&scaler.mean, &scaler.scale, weights[0], weights[1], &scalars];
        if !numbers.into_iter().flatten().chain(&[platt.a, platt.b]).all(|v| v.is_finite()) {
            return invalid("a number is not finite");
        }
        if matches!(machine, Machine::Svm(svm) if svm.gamma <= 0.0) {
            return invalid("γ is not positive");
        }
        if self.viewing.frames_per_second().is_some() {
            return invalid("it was trained on films, and people have judged stills");
        }
        if self.tone_mapping.check().is_err() {
            return invalid("the tone mapping is out of range");
        }
        Ok(())
    }
}

/// P of one tile as a function of its samples: noise falls as 1/√n, nothing else changes. Texture decides
/// once how familiar the tile is.
pub(crate) struct ProbabilityCurve<'a> {
    parts: &'a ModelParts,
    raw: &'a [f32],
    spread: Option<Spread>,
    strangeness: f32,
    /// Room for the descriptor at another number of samples.
    projected: Vec<f32>,
}

impl ProbabilityCurve<'_> {
    pub(crate) fn judgement(&mut self) -> Judgement {
        self.projected.copy_from_slice(self.raw);
        let log_odds = self.parts.classifier.log_odds_in_place(&mut self.projected);
        let free = self.share(log_odds);
        let probability = if self.strangeness > 0.0 { self.at(1.0).unwrap_or(free) } else { free };
        Judgement {
            probability,
            probability_without_penalty: free,
            mean_observer: from_log_odds(log_odds),
            unfamiliar: self.strangeness > 0.0,
        }
    }

    fn share(&self, log_odds: f64) -> f32 {
        self.spread.map_or_else(|| from_log_odds(log_odds), |spread| spread.share(log_odds) as f32)
    }

    /// P with `factor` times the samples; `None` if the descriptor does not separate noise from picture.
    pub(crate) fn at(&mut self, factor: f32) -> Option<f32> {
        self.without_penalty(factor / CAUTION.powf(self.strangeness))
    }

    /// The same without the penalty for an unfamiliar tile.
    pub(crate) fn without_penalty(&mut self, factor: f32) -> Option<f32> {
        self.projected.copy_from_slice(self.raw);
        let known = self.parts.descriptor.project(&mut self.projected, factor);
        known.then(|| {
            let log_odds = self.parts.classifier.log_odds_in_place(&mut self.projected);
            self.share(log_odds)
        })
    }
}

#[cfg(test)]
pub(crate) mod tests;
