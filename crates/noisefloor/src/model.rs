//! The model: everything a verdict depends on, and its file. The layout is that of `container.rs`.

#[cfg(feature = "files")]
use crate::container::MAX_PAYLOAD;
use crate::display::ToneMapping;
use crate::evidence::Evidence;
use crate::params::Audience;
use crate::{descriptor::Descriptor, people::Spread, svm::Classifier};
use noisefloor_vision::Viewing;
#[cfg(feature = "files")]
use std::io;
use thiserror::Error;

#[cfg(feature = "bundled-model")]
mod bundled;
pub(crate) mod familiarity;
#[cfg(feature = "files")]
mod file;
mod parts;

pub use crate::descriptor::DescriptorError;
#[doc(hidden)]
pub use familiarity::Familiarity;
pub(crate) use parts::ProbabilityCurve;
#[doc(hidden)]
pub use parts::{Judgement, ModelParts, Scores, TrainingRecord};

/// The version of files that is written, and the only one that is read.
#[cfg(feature = "files")]
const VERSION: u32 = 6;

/// Why a model cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ModelError {
    /// The file cannot be read or written.
    #[cfg(feature = "files")]
    #[error("the model cannot be read or written: {0}")]
    Io(#[from] io::Error),
    /// Not a model file.
    #[cfg(feature = "files")]
    #[error("this is not a noisefloor model: it does not begin with the model magic")]
    Foreign,
    /// Written by a later release.
    #[cfg(feature = "files")]
    #[error(
        "the model has format version {found}, and this release reads version {VERSION}: update noisefloor"
    )]
    Newer {
        /// Version in the file.
        found: u32,
    },
    /// Written by an earlier release, whose models lack what this one needs.
    #[cfg(feature = "files")]
    #[error(
        "the model has format version {found}, and this release reads version {VERSION}: train it again, with this release"
    )]
    Older {
        /// Version in the file.
        found: u32,
    },
    /// The payload is shorter or longer than announced, or its checksum differs.
    #[cfg(feature = "files")]
    #[error("the model is damaged: {0}")]
    Damaged(String),
    /// The payload is announced with more than the limit.
    #[cfg(feature = "files")]
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

/// A trained oracle: what a verdict depends on. Its parts fit together.
#[derive(Clone, Debug, PartialEq)]
pub struct Model(ModelParts);

impl Model {
    pub(crate) fn parts(&self) -> &ModelParts {
        &self.0
    }

    /// What tells it from other models.
    pub(crate) fn fingerprint(&self) -> String {
        #[cfg(feature = "files")]
        {
            self.digest()
        }
        // Without files, nothing is resumed, and nobody keeps this
        #[cfg(not(feature = "files"))]
        {
            format!("{:?}", self.0)
        }
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

    /// Whose thresholds it predicts, as a line from those of the training data.
    pub fn audience(&self) -> Audience {
        self.0.audience
    }
}

/// What models are made of.
#[doc(hidden)]
impl Model {
    /// A model made of these parts.
    ///
    /// # Errors
    /// [`ModelError::Invalid`] if they contradict each other, or a number is not finite.
    pub fn new(parts: ModelParts) -> Result<Self, ModelError> {
        parts.check().map_err(|what| ModelError::Invalid(what.into()))?;
        Ok(Self(parts))
    }

    /// The parts, to make another model of them.
    pub fn into_parts(self) -> ModelParts {
        self.0
    }

    /// What is computed from a tile.
    pub fn descriptor(&self) -> &Descriptor {
        &self.0.descriptor
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
}

#[cfg(test)]
pub(crate) mod tests;
