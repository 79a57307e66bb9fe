//! The files of models.

use super::{Familiarity, Model, ModelError, ModelParts, TrainingRecord, VERSION};
use crate::container::{self, FileFault, Format};
use crate::descriptor::{Descriptor, DescriptorKind, DescriptorSpec};
use crate::display::ToneMapping;
use crate::evidence::Evidence;
use crate::params::Audience;
use crate::people::Spread;
use crate::svm::Classifier;
use noisefloor_vision::{Eotf, Primaries, Viewing, ViewingError, ViewingParams};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::io::{Read, Write};

pub(super) const FORMAT: Format = Format { magic: *b"NFMODEL\0", version: VERSION };

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

/// A model as files hold it.
#[derive(Serialize, Deserialize)]
pub(super) struct ModelFile<'a> {
    pub(super) descriptor: DescriptorSpec,
    pub(super) descriptor_version: u16,
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
        let mut params = Viewing::default().params();
        (params.pixels_per_degree, params.peak, params.black) = (pixels_per_degree, peak, black);
        (params.ambient, params.reflectivity) = (ambient, reflectivity);
        (params.eotf, params.primaries, params.frames_per_second) = (eotf, primaries, None);
        params.check()
    }
}

impl Model {
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
    #[doc(hidden)]
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

    pub(super) fn file(&self) -> ModelFile<'_> {
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
}
