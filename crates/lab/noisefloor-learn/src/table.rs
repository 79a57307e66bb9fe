//! Descriptors of a corpus, from noisy to converged, and what people said: all that training and scoring
//! need.

use crate::answer::Answer;
use crate::stimulus::as_noise;
use noisefloor::{ToneMapping, Viewing, descriptor::Descriptor, evidence::Evidence};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Where the picture of a level comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Origin {
    Real,
    /// Made from a real picture and a converged one, with noise ∝ 1/√n.
    Synthesised,
}

/// One zone at one number of samples. Several levels may have the same number: other realisations of the
/// noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Level {
    pub spp: f64,
    pub origin: Origin,
    /// Standard deviation of the noise mask (σ = 1) of the residual over the zone, in display luminance: what
    /// the constant-noise baseline goes by.
    pub noise: f32,
    pub descriptor: Vec<f32>,
}

/// One zone of one scene: what people said of it, and its descriptor from noisy to converged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Zone {
    pub scene: String,
    /// Scenes of one group show the same room, and are left out together.
    pub group: String,
    /// Number within the scene.
    pub zone: u32,
    /// Samples per pixel at which people stopped seeing a difference.
    pub human_spp: f64,
    /// Whether `human_spp` is only known to lie at or above its value.
    pub censored: bool,
    /// Fewest samples that observers could choose.
    pub first_spp: f64,
    /// Most samples that observers could choose.
    pub last_spp: f64,
    /// Samples of the picture that people compared with, if it contains those of the levels; infinite if it had no
    /// noise. See [`crate::as_noise`].
    pub reference_spp: f64,
    /// By increasing `spp`.
    pub levels: Vec<Level>,
}

/// Descriptors of a corpus: all that training and evaluation need of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    pub descriptor: Descriptor,
    /// What the zones were compared with.
    pub evidence: Evidence,
    pub tone_mapping: ToneMapping,
    /// On which display they were seen, and from how far: an assumption where nobody recorded it.
    pub viewing: Viewing,
    /// What the numbers of each level are: those of the descriptor, less what was taken away.
    pub numbers: Vec<String>,
    pub zones: Vec<Zone>,
    /// What single people said of tiles of other pictures: examples to train on, never scored as thresholds.
    pub answers: Vec<Answer>,
}

impl Zone {
    /// The samples whose noise is as strong as the difference that people just saw. For a censored threshold, a
    /// number that is certainly not above that.
    pub fn human_as_noise(&self) -> f64 {
        if self.censored { self.human_spp } else { as_noise(self.human_spp, self.reference_spp) }
    }

    /// The level whose noise is nearest to what people just saw; `None` without levels.
    pub(crate) fn at_threshold(&self) -> Option<&Level> {
        let threshold = self.human_as_noise();
        let distance = |level: &Level| (level.spp / threshold).ln().abs();
        self.levels.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }

    /// A quantity of the levels, by increasing samples, from the least that observers could choose; realisations of
    /// one level are averaged. It goes beyond the last one: noise is as weak as what was seen near the last picture
    /// only there.
    pub(crate) fn path(&self, quantity: impl Fn(usize) -> f64) -> Vec<(f64, f64)> {
        let mut path: Vec<(f64, f64, f64)> = Vec::new();
        for (i, level) in self.levels.iter().enumerate() {
            if level.spp < self.first_spp {
                continue;
            }
            match path.last_mut() {
                Some((spp, sum, count)) if *spp == level.spp => {
                    (*sum, *count) = (*sum + quantity(i), *count + 1.0)
                }
                _ => path.push((level.spp, quantity(i), 1.0)),
            }
        }
        path.into_iter().map(|(spp, sum, count)| (spp, sum / count)).collect()
    }
}

impl Table {
    /// Zones of pictures that people saw as files show them, on the default display; no answers.
    pub fn new(descriptor: Descriptor, evidence: Evidence, zones: Vec<Zone>) -> Self {
        Self {
            numbers: descriptor.number_names(),
            descriptor,
            evidence,
            tone_mapping: ToneMapping::Srgb { exposure: 1.0 },
            viewing: Viewing::default(),
            zones,
            answers: Vec::new(),
        }
    }

    /// Takes away numbers of the descriptor, named as in its columns: to see what each is worth. A machine
    /// that is trained on what is left can be scored, but is not a model.
    pub fn without(mut self, names: &[String]) -> Result<Self, String> {
        for name in names {
            let at = self.numbers.iter().position(|n| n == name).ok_or_else(|| name.clone())?;
            self.numbers.remove(at);
            self.zones.iter_mut().flat_map(|z| &mut z.levels).for_each(|l| {
                l.descriptor.remove(at);
            });
            self.answers.iter_mut().for_each(|a| {
                a.descriptor.remove(at);
            });
        }
        Ok(self)
    }

    /// BLAKE3 of the table's numbers, hexadecimal: names the table in a model's record.
    pub fn digest(&self) -> String {
        let mut hash = blake3::Hasher::new();
        for z in &self.zones {
            hash.update(z.scene.as_bytes()).update(z.group.as_bytes()).update(&z.zone.to_le_bytes());
            for spp in [z.human_spp, z.first_spp, z.last_spp, z.reference_spp] {
                hash.update(&spp.to_le_bytes());
            }
            for level in &z.levels {
                hash.update(&level.spp.to_le_bytes());
                level.descriptor.iter().for_each(|v| {
                    hash.update(&v.to_le_bytes());
                });
            }
        }
        for answer in &self.answers {
            hash.update(answer.group.as_bytes())
                .update(&answer.spp.to_le_bytes())
                .update(&[u8::from(answer.sees_noise)]);
            answer.descriptor.iter().for_each(|v| {
                hash.update(&v.to_le_bytes());
            });
        }
        hash.finalize().to_hex().to_string()
    }

    /// The groups of the answers, in alphabetical order.
    pub fn answer_groups(&self) -> Vec<&str> {
        self.answers.iter().map(|a| a.group.as_str()).collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// The groups, in alphabetical order.
    pub fn groups(&self) -> Vec<&str> {
        self.zones.iter().map(|z| z.group.as_str()).collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// The scenes, in alphabetical order.
    pub fn scenes(&self) -> Vec<&str> {
        self.zones.iter().map(|z| z.scene.as_str()).collect::<BTreeSet<_>>().into_iter().collect()
    }
}

/// The first word of a scene's name, as the group that the scene belongs to: a word which ends before a
/// capital letter that follows a small one, or at `-` or `_`. `SdbCentre` and `SdbDroite` are two cameras in
/// one room.
pub fn first_word(scene: &str) -> &str {
    let mut previous = ' ';
    for (at, c) in scene.char_indices() {
        if at > 0 && (c == '-' || c == '_' || (c.is_uppercase() && previous.is_lowercase())) {
            return &scene[..at];
        }
        previous = c;
    }
    scene
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn zone(scene: &str, number: u32, human_spp: f64, scale: f64) -> Zone {
        let level = |i: i32| {
            let spp = 20.0 * 1.5f64.powi(i);
            Level { spp, origin: Origin::Real, noise: (scale / spp.sqrt()) as f32, descriptor: vec![] }
        };
        let group = first_word(scene).to_owned();
        let levels: Vec<Level> = (0..14).map(level).collect();
        let last_spp = levels[13].spp;
        Zone {
            scene: scene.into(),
            group,
            zone: number,
            human_spp,
            censored: false,
            first_spp: 20.0,
            last_spp,
            reference_spp: f64::INFINITY,
            levels,
        }
    }

    #[test]
    fn groups_are_first_words() {
        let groups = ["SdbCentre", "SdbDroite", "Appart1opt02", "staircase2-view0", "Bureau1", "a_b", ""];
        assert_eq!(groups.map(first_word), ["Sdb", "Sdb", "Appart1opt02", "staircase2", "Bureau1", "a", ""]);
    }

    #[test]
    fn columns_are_taken_away_by_name() {
        let mut zone = zone("A", 0, 100.0, 1.0);
        zone.levels.iter_mut().for_each(|l| l.descriptor = vec![0.0, 1.0, 2.0, 3.0, 4.0]);
        let table = Table::new(Descriptor::default(), Evidence::Halves, vec![zone]);
        let less = table.clone().without(&["picture_noise".into(), "texture".into()]).unwrap();
        assert!(less.zones[0].levels.iter().all(|l| l.descriptor == [0.0, 2.0, 4.0]));
        assert_eq!(table.without(&["colour".into()]), Err("colour".into()));
    }
}
