//! The model inside the library. It is read without serde: who embeds only the oracle needs neither that nor the
//! formats of files.

use super::{Familiarity, Model, ModelParts, Scores, TrainingRecord};
use crate::descriptor::{Descriptor, DescriptorSpec};
use crate::display::ToneMapping;
use crate::evidence::Evidence;
use crate::params::Audience;
use crate::people::Spread;
use crate::svm::{Classifier, Line, Machine, Platt, Scaler};
use noisefloor_vision::{Eotf, Primaries, Viewing};

static FILE: &[u8] = include_bytes!("../../models/human.nfm");
/// Bytes before the payload: magic, version, length and checksum.
const HEADER: usize = 8 + 4 + 8 + 32;

impl Model {
    /// The model trained on the human data of LISIC (nine scenes and two SIN3D views), inside the library; see the
    /// project's guide for the command that makes it.
    pub fn bundled() -> Self {
        Self(parts(&mut Payload(&FILE[HEADER..])))
    }
}

/// The parts in the order of `ModelFile`. A test holds them against what [`Model::read`] makes of the file.
fn parts(from: &mut Payload) -> ModelParts {
    let mut named = from.list(|from| {
        let name = from.text();
        DescriptorSpec {
            name,
            parameters: from.list(|from| (from.text(), from.double())).into_iter().collect(),
        }
    });
    let descriptor = Descriptor::from_spec(&named.remove(0), &[]).expect("a built-in descriptor");
    assert_eq!(from.whole(), u64::from(descriptor.version()), "the version of the descriptor");
    from.variant(0, "evidence from halves");
    from.variant(1, "plain sRGB, as the pictures are shown that people judged");
    let tone_mapping = ToneMapping::Srgb { exposure: from.single() };
    let viewing = viewing(from);
    let scaler = Scaler { mean: from.list(Payload::single), scale: from.list(Payload::single) };
    from.variant(0, "a line");
    let machine = Machine::Line(Line { weights: from.list(Payload::single), bias: from.single() });
    let platt = Platt { a: from.single(), b: from.single() };
    ModelParts {
        descriptor,
        evidence: Evidence::Halves,
        tone_mapping,
        viewing,
        classifier: Classifier { scaler, machine, platt },
        familiarity: from.option(|from| Familiarity {
            zones: from.list(|from| from.list(Payload::single)),
            reach: from.single(),
        }),
        spread: from.option(|from| Spread { scenes: from.double(), people: from.double() }),
        audience: Audience { slope: from.double(), offset: from.double() },
        record: TrainingRecord {
            corpus: from.text(),
            table_digest: from.text(),
            scenes: from.list(Payload::text),
            examples: from.whole() as usize,
            c: from.double(),
            gamma: from.double(),
            leave_one_scene_out: from.option(|from| Scores {
                zones: from.whole() as usize,
                error_factor: from.double(),
                bias_factor: from.double(),
                early_share: from.double(),
            }),
        },
    }
}

fn viewing(from: &mut Payload) -> Viewing {
    let mut params = Viewing::default().params();
    for number in [
        &mut params.pixels_per_degree,
        &mut params.peak,
        &mut params.black,
        &mut params.ambient,
        &mut params.reflectivity,
    ] {
        *number = from.double();
    }
    from.variant(0, "sRGB");
    from.variant(0, "Rec.709");
    (params.eotf, params.primaries) = (Eotf::Srgb, Primaries::Rec709);
    params.check().expect("the viewing conditions of a model")
}

/// What is left of a payload, as bincode 2 writes it in its standard configuration.
struct Payload(&'static [u8]);

impl Payload {
    fn bytes<const N: usize>(&mut self) -> [u8; N] {
        let (bytes, rest) = self.0.split_first_chunk().expect("the file is whole");
        self.0 = rest;
        *bytes
    }

    /// One byte up to 250; else 251, 252 or 253, and then two, four or eight bytes.
    fn whole(&mut self) -> u64 {
        let [byte] = self.bytes();
        match byte {
            251 => u16::from_le_bytes(self.bytes()).into(),
            252 => u32::from_le_bytes(self.bytes()).into(),
            253 => u64::from_le_bytes(self.bytes()),
            small => small.into(),
        }
    }

    fn single(&mut self) -> f32 {
        f32::from_le_bytes(self.bytes())
    }

    fn double(&mut self) -> f64 {
        f64::from_le_bytes(self.bytes())
    }

    fn list<T>(&mut self, mut one: impl FnMut(&mut Self) -> T) -> Vec<T> {
        (0..self.whole()).map(|_| one(self)).collect()
    }

    fn text(&mut self) -> String {
        let bytes = self.list(|from| from.bytes::<1>()[0]);
        String::from_utf8(bytes).expect("text in UTF-8")
    }

    fn option<T>(&mut self, some: impl FnOnce(&mut Self) -> T) -> Option<T> {
        (self.whole() == 1).then(|| some(self))
    }

    /// Reads which variant of an enumeration follows.
    fn variant(&mut self, number: u64, what: &str) {
        assert_eq!(self.whole(), number, "{what}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_what_the_file_says() {
        assert_eq!(Model::bundled(), Model::read(FILE).unwrap());
        let mut payload = Payload(&FILE[HEADER..]);
        parts(&mut payload);
        assert!(payload.0.is_empty());
    }
}
