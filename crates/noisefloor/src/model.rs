//! The model file: everything a verdict depends on. Its layout is that of [`container`].

use crate::container::{self, Fault, Format, MAX_PAYLOAD};
use crate::descriptor::Descriptor;
use crate::display::ToneMapping;
use crate::evidence::Evidence;
use crate::familiarity::{CAUTION, Familiarity};
use crate::params::Audience;
use crate::svm::{Platt, Scaler, Svm};
use serde::{Deserialize, Serialize};
use std::io::{self, Read, Write};
use thiserror::Error;

const FORMAT: Format = Format { magic: *b"NFMODEL\0", version: VERSION };
const VERSION: u32 = 2;
#[cfg(feature = "bundled-model")]
static BUNDLED: &[u8] = include_bytes!("../models/human.nfm");

/// Why a model cannot be used.
#[derive(Debug, Error)]
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
    #[error("the model does not hold together: {0}")]
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
}

impl From<Fault> for ModelError {
    fn from(fault: Fault) -> Self {
        match fault {
            Fault::Io(error) => Self::Io(error),
            Fault::Foreign => Self::Foreign,
            Fault::Version(found) if found > VERSION => Self::Newer { found },
            Fault::Version(found) => Self::Older { found },
            Fault::Damaged(what) => Self::Damaged(what),
            Fault::Oversized(bytes) => Self::Oversized(bytes),
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

/// A trained oracle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Model {
    /// What is computed of a tile.
    pub descriptor: Descriptor,
    /// Version of that descriptor the model was trained with.
    pub descriptor_version: u16,
    /// What the tile is held against.
    pub evidence: Evidence,
    /// How the training pictures were shown. For the record: descriptors are of display values, whatever led to them, and a
    /// session may show its picture in another way.
    pub tone_mapping: ToneMapping,
    /// From raw to scaled descriptors.
    pub scaler: Scaler,
    /// The machine.
    pub svm: Svm,
    /// From decision values to probabilities.
    pub platt: Platt,
    /// What pictures it has been tried on; `None` if the descriptor does not tell noise from picture.
    pub familiarity: Option<Familiarity>,
    /// Whose thresholds it predicts, as a line from those of the training data.
    pub audience: Audience,
    /// Where it comes from.
    pub record: TrainingRecord,
}

impl Model {
    /// The model trained on the human data of LISIC (lisic9 and one SIN3D view), inside the library; see the project's
    /// `docs/guide.md` for the command that makes it.
    #[cfg(feature = "bundled-model")]
    pub fn bundled() -> Self {
        Self::read(BUNDLED).expect("the bundled model is checked by a test")
    }

    /// Reads a model.
    ///
    /// # Errors
    /// [`ModelError`] if it is foreign, damaged, oversized, newer, older, contradicts itself, or needs another descriptor version.
    pub fn read(from: impl Read) -> Result<Self, ModelError> {
        let model: Self = FORMAT.read(from)?;
        model.check()?;
        Ok(model)
    }

    /// Writes the model.
    ///
    /// # Errors
    /// [`ModelError::Io`] if it cannot be written, [`ModelError::Invalid`] if it could not be read again.
    pub fn write(&self, to: impl Write) -> Result<(), ModelError> {
        self.check()?;
        Ok(FORMAT.write(self, to)?)
    }

    /// BLAKE3 of the content, hexadecimal: names the model in reports.
    pub fn digest(&self) -> String {
        container::payload(self).map(|p| blake3::hash(&p).to_hex().to_string()).unwrap_or_default()
    }

    /// Whether a tile shows texture such as the training zones had, by its raw descriptor; see [`Familiarity`]. Always so if the
    /// descriptor does not tell noise from picture.
    pub fn is_familiar(&self, descriptor: &[f32]) -> bool {
        let Some(known) = &self.familiarity else { return true };
        let mut scaled = descriptor.to_vec();
        self.scaler.apply(&mut scaled);
        known.includes(&self.descriptor.texture_of(&scaled))
    }

    /// Probability in [0, 1] that an observer sees no difference, of a raw descriptor, which is scaled in place. Of an unfamiliar
    /// one it is what P would be with half of the samples.
    ///
    /// # Panics
    /// If the descriptor has not the model's number of numbers.
    pub fn probability(&self, descriptor: &mut [f32]) -> f32 {
        if !self.is_familiar(descriptor) {
            self.descriptor.project(descriptor, 1.0 / CAUTION);
        }
        self.scaler.apply(descriptor);
        self.platt.probability(self.svm.decision(descriptor))
    }

    fn check(&self) -> Result<(), ModelError> {
        let here = self.descriptor.version();
        if self.descriptor_version != here {
            let (name, needed) = (self.descriptor.name(), self.descriptor_version);
            return Err(ModelError::Descriptor { name, needed, here });
        }
        let invalid = |what: &str| Err(ModelError::Invalid(what.into()));
        let n = self.descriptor.len();
        if self.scaler.mean.len() != n || self.scaler.scale.len() != n {
            return invalid("scaler and descriptor differ in length");
        }
        if self.svm.coefficients.is_empty() || self.svm.vectors.len() != self.svm.coefficients.len() * n {
            return invalid("support vectors and descriptor differ in length");
        }
        if let Some(Familiarity { zones, reach }) = &self.familiarity {
            let known = self.descriptor.texture_numbers();
            if known == 0 || zones.is_empty() || zones.iter().any(|zone| zone.len() != known) {
                return invalid("familiar zones and descriptor differ in length");
            }
            if !(*reach >= 0.0 && reach.is_finite() && zones.iter().flatten().all(|v| v.is_finite())) {
                return invalid("what is familiar is not a finite number");
            }
        }
        let numbers = [&self.scaler.mean, &self.scaler.scale, &self.svm.coefficients, &self.svm.vectors];
        let scalars = [self.svm.rho, self.svm.gamma, self.platt.a, self.platt.b];
        if !numbers.into_iter().flatten().chain(&scalars).all(|v| v.is_finite()) {
            return invalid("a number is not finite");
        }
        if self.svm.gamma <= 0.0 {
            return invalid("γ is not positive");
        }
        if self.tone_mapping.check().is_err() {
            return invalid("the tone mapping is out of range");
        }
        Ok(())
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A model that goes by the first number of the compact descriptor alone.
    pub(crate) fn small() -> Model {
        let descriptor = Descriptor::default();
        let n = descriptor.len();
        let mut vectors = vec![0.0; 2 * n];
        (vectors[0], vectors[n]) = (-1.0, 1.0);
        Model {
            descriptor,
            descriptor_version: descriptor.version(),
            evidence: Evidence::Halves,
            tone_mapping: ToneMapping::default(),
            scaler: Scaler::identity(n),
            svm: Svm { gamma: 0.1, rho: 0.0, coefficients: vec![1.0, -1.0], vectors },
            platt: Platt { a: -2.0, b: 0.0 },
            familiarity: None,
            audience: Audience::TRAINED,
            record: TrainingRecord::default(),
        }
    }

    fn file() -> Vec<u8> {
        let mut bytes = Vec::new();
        small().write(&mut bytes).unwrap();
        bytes
    }

    #[test]
    fn survives_the_file() {
        let model = Model::read(&file()[..]).unwrap();
        assert_eq!(model, small());
        assert_eq!(model.digest(), small().digest());
    }

    #[cfg(feature = "bundled-model")]
    #[test]
    fn the_bundled_model_is_whole_small_and_scored() {
        let model = Model::bundled();
        assert!(BUNDLED.len() < 1 << 20);
        assert_eq!(model.evidence, Evidence::Halves);
        assert!(model.record.leave_one_scene_out.is_some_and(|s| s.zones == 128));
    }

    /// An unfamiliar tile has the P that a familiar one of the same noise has with half of the samples.
    #[test]
    fn what_is_unfamiliar_is_judged_as_if_it_had_half_the_samples() {
        let zones = vec![vec![0.5; small().descriptor.texture_numbers()]];
        let cautious = Model { familiarity: Some(Familiarity { zones, reach: 0.1 }), ..small() };
        let mut tile = vec![0.5; small().descriptor.len()];
        assert!(cautious.is_familiar(&tile) && small().is_familiar(&tile));
        assert_eq!(cautious.probability(&mut tile.clone()), small().probability(&mut tile.clone()));

        tile[1] += 0.11;
        assert!(!cautious.is_familiar(&tile) && small().is_familiar(&tile));
        let mut halved = tile.clone();
        small().descriptor.project(&mut halved, 0.5);
        let p = cautious.probability(&mut tile.clone());
        assert_eq!(p, small().probability(&mut halved));
        assert!(p < small().probability(&mut tile));
    }

    #[test]
    fn the_model_for_references_is_whole() {
        let model = Model::read(&include_bytes!("../models/human-reference.nfm")[..]).unwrap();
        assert_eq!((model.evidence, model.record.scenes.len()), (Evidence::Reference, 8));
    }

    #[cfg(feature = "bundled-model")]
    #[test]
    fn clean_tiles_are_converged_and_noisy_ones_are_not_whatever_the_texture() {
        let model = Model::bundled();
        for textured in 0..=17 {
            // From no texture at all, ln 2, to a checkerboard of black and white, ln 128.
            let texture = 0.693 + 0.25 * textured as f32;
            let p = |noise: f32| {
                let mut tile = vec![texture; model.descriptor.len()];
                // Of the tile and of its picture.
                (tile[0], tile[3]) = (noise, noise);
                model.probability(&mut tile)
            };
            // From no noise, at the floor, to white noise from black to white: 128 steps, which the masks and the weights of the
            // scales let through almost whole.
            let path: Vec<f32> = (0..=83).map(|i| p(-3.45 + 0.1 * i as f32)).collect();
            assert!(path[0] > 0.99 && path[83] < 0.6, "{texture}: {path:?}");
            // Far from all training data a Gaussian kernel forgets, so that P ends a little above its least.
            assert!(path.windows(2).all(|w| w[1] <= w[0] + 2e-3), "{texture}: {path:?}");
        }
    }

    #[test]
    fn each_fault_has_its_error() {
        let read = |bytes: &[u8]| Model::read(bytes).unwrap_err();
        assert!(matches!(read(b""), ModelError::Foreign));
        assert!(matches!(read(b"\x89PNG\r\n\x1a\n and so on"), ModelError::Foreign));
        let whole = file();
        assert!(matches!(read(&whole[..20]), ModelError::Damaged(_)));
        assert!(matches!(read(&whole[..whole.len() - 1]), ModelError::Damaged(_)));
        assert!(matches!(read(&[&whole[..], b"x"].concat()), ModelError::Damaged(_)));
        let mut newer = whole.clone();
        newer[8] = 3;
        assert!(matches!(read(&newer), ModelError::Newer { found: 3 }));
        newer[8] = 1;
        assert!(matches!(read(&newer), ModelError::Older { found: 1 }));
        let mut oversized = whole.clone();
        oversized[19] = 0xff;
        assert!(matches!(read(&oversized), ModelError::Oversized(_)));
    }

    #[test]
    fn contradictions_are_refused() {
        let fails = |change: fn(&mut Model)| {
            let mut model = small();
            change(&mut model);
            model.write(Vec::new()).unwrap_err()
        };
        assert!(matches!(fails(|m| m.svm.rho = f32::NAN), ModelError::Invalid(_)));
        assert!(matches!(fails(|m| m.svm.gamma = 0.0), ModelError::Invalid(_)));
        assert!(matches!(fails(|m| m.svm.vectors.truncate(3)), ModelError::Invalid(_)));
        assert!(matches!(fails(|m| m.scaler.mean.clear()), ModelError::Invalid(_)));
        let n = small().descriptor.texture_numbers();
        let known = |zone: Vec<f32>, reach| Some(Familiarity { zones: vec![zone], reach });
        let none = Some(Familiarity { zones: vec![], reach: 1.0 });
        let short = known(vec![0.0; n - 1], 1.0);
        for familiarity in [none, short, known(vec![0.0; n], -1.0), known(vec![f32::NAN; n], 1.0)] {
            let model = Model { familiarity, ..small() };
            assert!(matches!(model.write(Vec::new()).unwrap_err(), ModelError::Invalid(_)));
        }
        assert!(matches!(fails(|m| m.descriptor_version = 99), ModelError::Descriptor { needed: 99, .. }));
    }

    proptest! {
        #[test]
        fn no_damaged_byte_goes_unnoticed(at in 0usize..4000, flip in 1u8..) {
            let mut bytes = file();
            let at = at % bytes.len();
            bytes[at] ^= flip;
            prop_assert!(Model::read(&bytes[..]).is_err());
        }

        #[test]
        fn noise_is_never_a_model(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
            let framed = [&FORMAT.magic[..], &bytes].concat();
            prop_assert!(Model::read(&framed[..]).is_err());
            prop_assert!(Model::read(&bytes[..]).is_err());
        }
    }
}
