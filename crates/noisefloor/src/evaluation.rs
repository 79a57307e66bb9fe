//! Predicted thresholds against human ones.
//!
//! Scores are those of the rules of evidence in `docs/guide.md`: whole scenes left out, predictions clipped to the levels that
//! observers could choose, real pictures scored apart from synthesised levels.

use crate::answer::Answer;
use crate::descriptor::Descriptor;
use crate::display::ToneMapping;
use crate::evidence::{Evidence, ROUNDING_LUMINANCE, TilePlanes};
use crate::mask::NoiseMask;
use crate::model::Model;
pub use crate::model::Scores;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};

/// Standard deviation of the noise mask (σ = 1) of the luminance residual over a zone, less known rounding noise; in display
/// values. The constant-noise baseline goes by it.
pub fn noise_level(planes: &TilePlanes) -> f32 {
    let (mask, t) = (NoiseMask::default(), planes.inner);
    let plane = mask.apply(&planes.residual);
    let inner = plane.slice(ndarray::s![t.y..t.y + t.height, t.x..t.x + t.width]);
    let variance = inner.iter().map(|v| v * v).sum::<f32>() / t.pixels() as f32;
    (variance - mask.white_noise_gain() * planes.rounding * ROUNDING_LUMINANCE).max(0.0).sqrt()
}

/// Where the picture of a level comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Origin {
    /// Rendered with so many samples.
    Real,
    /// Made from a real picture and a converged one, with noise ∝ 1/√n.
    Synthesised,
}

/// One zone at one number of samples. Several levels may have the same number: other realisations of the noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Level {
    /// Samples per pixel.
    pub spp: f64,
    /// Rendered or synthesised.
    pub origin: Origin,
    /// Standard deviation of the noise mask (σ = 1) of the residual over the zone, in display luminance: what the constant-noise
    /// baseline goes by.
    pub noise: f32,
    /// The raw descriptor.
    pub descriptor: Vec<f32>,
}

/// One zone of one scene: what people said of it, and its descriptor from noisy to converged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Zone {
    /// Scene.
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
    /// By increasing `spp`.
    pub levels: Vec<Level>,
}

/// Descriptors of a corpus: all that training and evaluation need of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Table {
    /// Which descriptor.
    pub descriptor: Descriptor,
    /// What the zones were held against.
    pub evidence: Evidence,
    /// How the pictures were shown.
    pub tone_mapping: ToneMapping,
    /// The zones.
    pub zones: Vec<Zone>,
    /// What single people said of tiles of other pictures: examples to train on, never scored as thresholds.
    #[serde(default)]
    pub answers: Vec<Answer>,
}

impl Zone {
    /// The level nearest to the human threshold; `None` without levels.
    pub(crate) fn at_threshold(&self) -> Option<&Level> {
        let distance = |level: &Level| (level.spp / self.human_spp).ln().abs();
        self.levels.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)))
    }

    /// A quantity of the levels that observers could choose, by increasing samples; realisations of one level are averaged.
    fn path(&self, quantity: impl Fn(usize) -> f64) -> Vec<(f64, f64)> {
        let mut path: Vec<(f64, f64, f64)> = Vec::new();
        for (i, level) in self.levels.iter().enumerate() {
            if !(self.first_spp..=self.last_spp).contains(&level.spp) {
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
    /// Takes away numbers of the descriptor, named as in its columns: to see what each is worth. A machine that is trained on what
    /// is left can be scored, but is not a model.
    ///
    /// # Errors
    /// The name that is not a column.
    pub fn without(mut self, names: &[String]) -> Result<Self, String> {
        let mut columns = self.descriptor.number_names();
        for name in names {
            let at = columns.iter().position(|c| c == name).ok_or_else(|| name.clone())?;
            columns.remove(at);
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
            for spp in [z.human_spp, z.first_spp, z.last_spp] {
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

    /// The groups, in alphabetical order.
    pub fn groups(&self) -> Vec<&str> {
        self.zones.iter().map(|z| z.group.as_str()).collect::<BTreeSet<_>>().into_iter().collect()
    }

    /// The scenes, in alphabetical order.
    pub fn scenes(&self) -> Vec<&str> {
        self.zones.iter().map(|z| z.scene.as_str()).collect::<BTreeSet<_>>().into_iter().collect()
    }
}

/// The name of the group a scene belongs to by its name alone: its first word, which ends before a capital letter that follows
/// a small one, or at `-` or `_`. `SdbCentre` and `SdbDroite` are two cameras in one room.
pub fn group_of_scene(scene: &str) -> &str {
    let mut previous = ' ';
    for (at, c) in scene.char_indices() {
        if at > 0 && (c == '-' || c == '_' || (c.is_uppercase() && previous.is_lowercase())) {
            return &scene[..at];
        }
        previous = c;
    }
    scene
}

/// Samples at which a quantity, known at increasing levels, first reaches `goal`, interpolated in ln(spp); the first or last
/// level if it has there or not yet. `None` without levels.
fn crossing(levels: &[(f64, f64)], goal: f64) -> Option<f64> {
    let at = levels.iter().position(|&(_, v)| v >= goal);
    match at {
        None => levels.last().map(|&(spp, _)| spp),
        Some(0) => Some(levels[0].0),
        Some(i) => {
            let ((n0, v0), (n1, v1)) = (levels[i - 1], levels[i]);
            let t = (goal - v0) / (v1 - v0);
            Some((n0.ln() + t * (n1.ln() - n0.ln())).exp())
        }
    }
}

/// What a model says of a zone at each of its levels: decision values and probabilities.
pub(crate) fn probabilities(model: &Model, zone: &Zone) -> Vec<f32> {
    let mut scratch = Vec::new();
    let probability = |level: &Level| {
        scratch.clone_from(&level.descriptor);
        model.probability(&mut scratch)
    };
    zone.levels.iter().map(probability).collect()
}

/// Log-odds: a scale on which the probability of a level is nearly linear in ln(spp).
fn log_odds(p: f64) -> f64 {
    let p = p.clamp(1e-9, 1.0 - 1e-9);
    (p / (1.0 - p)).ln()
}

/// One zone's prediction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Prediction {
    /// Scene.
    pub scene: String,
    /// Zone.
    pub zone: u32,
    /// Human threshold, in samples per pixel.
    pub human_spp: f64,
    /// Predicted threshold, within what observers could choose.
    pub predicted_spp: f64,
    /// Whether the human threshold is only a lower bound.
    pub censored: bool,
    /// Whether the zone, at its human threshold, is unfamiliar to the model that predicts.
    pub unfamiliar: bool,
    /// Real pictures of the zone that the prediction classifies as people did.
    #[serde(skip)]
    pub images_right: usize,
    /// Real pictures of the zone.
    #[serde(skip)]
    pub images: usize,
    /// Samples per pixel of each level and the probability there, where the predictor has one.
    #[serde(skip)]
    pub probabilities: Vec<(f64, f32)>,
}

impl Prediction {
    /// A prediction whose real pictures are classified by `converged`.
    fn new(zone: &Zone, spp: f64, converged: impl Fn(usize) -> bool) -> Self {
        let real = || zone.levels.iter().enumerate().filter(|(_, l)| l.origin == Origin::Real);
        let right = real().filter(|(i, l)| converged(*i) == (l.spp >= zone.human_spp));
        Self {
            scene: zone.scene.clone(),
            zone: zone.zone,
            human_spp: zone.human_spp,
            censored: zone.censored,
            unfamiliar: false,
            predicted_spp: spp.clamp(zone.first_spp, zone.last_spp),
            images_right: right.count(),
            images: real().count(),
            probabilities: Vec::new(),
        }
    }

    /// By a threshold alone, without looking at pictures.
    fn by_threshold(zone: &Zone, spp: f64) -> Self {
        Self::new(zone, spp, |i| zone.levels[i].spp >= spp)
    }

    fn log_ratio(&self) -> f64 {
        (self.predicted_spp / self.human_spp).ln()
    }
}

/// Predicts a zone's threshold: the samples at which P first reaches `threshold`.
pub fn predict(model: &Model, threshold: f32, zone: &Zone) -> Prediction {
    let p = probabilities(model, zone);
    let odds = zone.path(|i| log_odds(f64::from(p[i])));
    let spp = crossing(&odds, log_odds(f64::from(threshold))).unwrap_or(zone.last_spp);
    let probabilities = zone.levels.iter().map(|l| l.spp).zip(p.iter().copied()).collect();
    let unfamiliar = zone.at_threshold().is_some_and(|level| !model.is_familiar(&level.descriptor));
    Prediction { probabilities, unfamiliar, ..Prediction::new(zone, spp, |i| p[i] >= threshold) }
}

/// Scores predictions. Censored thresholds stay out.
pub fn score<'a>(predictions: impl Iterator<Item = &'a Prediction> + Clone) -> Scores {
    let ratios = || predictions.clone().filter(|p| !p.censored).map(Prediction::log_ratio);
    let zones = ratios().count();
    let mean = |f: fn(f64) -> f64| ratios().map(f).sum::<f64>() / zones as f64;
    Scores {
        zones,
        error_factor: mean(f64::abs).exp(),
        bias_factor: mean(|r| r).exp(),
        early_share: mean(|r| if r < -std::f64::consts::LN_2 { 1.0 } else { 0.0 }),
    }
}

/// Levels within this factor of the human threshold say how well probabilities are calibrated: further ones are easy, and would
/// flatter.
const CALIBRATION_RANGE: f64 = 8.0;

/// Levels whose probabilities lie in one tenth of the scale.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReliabilityBin {
    /// Mean of the predicted probabilities.
    pub predicted: f64,
    /// Mean of what was observed.
    pub observed: f64,
    /// Levels.
    pub levels: usize,
}

/// The reliability curve, in ten bins of equal width, of which empty ones are left out. `observed(spp, human_spp)` is the
/// probability that was observed, or 0 or 1. Levels further than eightfold from the threshold, and censored zones, stay out.
pub fn reliability<'a>(
    predictions: impl Iterator<Item = &'a Prediction>,
    observed: impl Fn(f64, f64) -> f64,
) -> Vec<ReliabilityBin> {
    let mut bins = [(0.0, 0.0, 0usize); 10];
    for p in predictions.filter(|p| !p.censored) {
        for &(spp, probability) in &p.probabilities {
            if (spp / p.human_spp).ln().abs() <= CALIBRATION_RANGE.ln() {
                let bin = &mut bins[((probability * 10.0) as usize).min(9)];
                *bin = (bin.0 + f64::from(probability), bin.1 + observed(spp, p.human_spp), bin.2 + 1);
            }
        }
    }
    let mean = |(predicted, observed, levels): (f64, f64, usize)| ReliabilityBin {
        predicted: predicted / levels as f64,
        observed: observed / levels as f64,
        levels,
    };
    bins.into_iter().filter(|b| b.2 > 0).map(mean).collect()
}

/// Expected calibration error: the mean distance of a reliability curve from the diagonal, by levels.
pub fn calibration_error(bins: &[ReliabilityBin]) -> f64 {
    let levels: usize = bins.iter().map(|b| b.levels).sum();
    bins.iter().map(|b| (b.predicted - b.observed).abs() * b.levels as f64).sum::<f64>() / levels as f64
}

/// Share of real pictures that are classified as people did; `None` without any.
pub fn image_accuracy<'a>(predictions: impl Iterator<Item = &'a Prediction> + Clone) -> Option<f64> {
    let images: usize = predictions.clone().map(|p| p.images).sum();
    let right: usize = predictions.map(|p| p.images_right).sum();
    (images > 0).then(|| right as f64 / images as f64)
}

/// The constant-noise baseline: a zone has converged once the standard deviation of its noise mask falls to one constant. Of the
/// noise levels at the human thresholds of all other groups, it is the one that errs least on those groups. In a table of one
/// group there are no others: the constant is then fitted to what it predicts, and flattered.
pub fn constant_noise_baseline(table: &Table) -> Vec<Prediction> {
    // Quietness −ln(noise) grows with samples.
    let zones: Vec<(&Zone, Vec<(f64, f64)>)> = table
        .zones
        .iter()
        .map(|zone| (zone, zone.path(|i| -f64::from(zone.levels[i].noise).max(1e-9).ln())))
        .filter(|(_, path)| path.len() > 1)
        .collect();
    let predict = |(zone, path): &(&Zone, Vec<(f64, f64)>), quietness: f64| {
        Prediction::by_threshold(zone, crossing(path, quietness).unwrap_or(zone.last_spp))
    };
    let constant = |left_out: &str| {
        let alone = zones.iter().all(|(z, _)| z.group == left_out);
        let others = || zones.iter().filter(|(z, _)| (alone || z.group != left_out) && !z.censored);
        let error =
            |constant: f64| others().map(|other| predict(other, constant).log_ratio().abs()).sum::<f64>();
        let candidates = others().filter_map(|(zone, path)| value_at(path, zone.human_spp));
        candidates.map(|c| (error(c), c)).min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, c)| c)
    };
    let of_group: BTreeMap<&str, Option<f64>> =
        table.groups().into_iter().map(|g| (g, constant(g))).collect();
    zones.iter().filter_map(|zone| Some(predict(zone, of_group[zone.0.group.as_str()]?))).collect()
}

/// A quantity at given samples, interpolated in ln(spp) between the levels around it.
fn value_at(levels: &[(f64, f64)], spp: f64) -> Option<f64> {
    let after = levels.iter().position(|&(n, _)| n >= spp).unwrap_or(levels.len() - 1).max(1);
    let (&(n0, v0), &(n1, v1)) = (levels.get(after - 1)?, levels.get(after)?);
    Some(v0 + (v1 - v0) * ((spp / n0).ln() / (n1 / n0).ln()).clamp(0.0, 1.0))
}

/// The scene-median baseline: the median threshold of the same scene's other zones, which no predictor of unseen scenes can
/// know. Scenes of a single zone stay out.
pub fn scene_median_baseline(table: &Table) -> Vec<Prediction> {
    let predict = |zone: &Zone| {
        let same = |o: &&Zone| o.scene == zone.scene && o.zone != zone.zone && !o.censored;
        let mut others: Vec<f64> = table.zones.iter().filter(same).map(|o| o.human_spp).collect();
        others.sort_by(f64::total_cmp);
        let middle = others.len() / 2;
        let median = match others.len() {
            0 => return None,
            n if n % 2 == 0 => 0.5 * (others[middle - 1] + others[middle]),
            _ => others[middle],
        };
        Some(Prediction::by_threshold(zone, median))
    };
    table.zones.iter().filter_map(predict).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn zone(scene: &str, number: u32, human_spp: f64, scale: f64) -> Zone {
        let level = |i: i32| {
            let spp = 20.0 * 1.5f64.powi(i);
            Level { spp, origin: Origin::Real, noise: (scale / spp.sqrt()) as f32, descriptor: vec![] }
        };
        let group = group_of_scene(scene).to_owned();
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
            levels,
        }
    }

    #[test]
    fn groups_are_first_words() {
        let groups = ["SdbCentre", "SdbDroite", "Appart1opt02", "staircase2-view0", "Bureau1", "a_b", ""];
        assert_eq!(
            groups.map(group_of_scene),
            ["Sdb", "Sdb", "Appart1opt02", "staircase2", "Bureau1", "a", ""]
        );
    }

    #[test]
    fn crossings_are_interpolated_in_the_logarithm() {
        let levels = [(100.0, 0.0), (400.0, 2.0), (800.0, 1.0)];
        assert!((crossing(&levels, 1.0).unwrap() - 200.0).abs() < 1e-9);
        assert_eq!(crossing(&levels, -1.0), Some(100.0));
        assert_eq!(crossing(&levels, 3.0), Some(800.0));
        assert_eq!(crossing(&[], 1.0), None);
    }

    /// Two scenes that people stop at the same noise: the baseline that knows this finds their thresholds exactly.
    #[test]
    fn constant_noise_is_right_where_noise_is_all() {
        let zones = vec![zone("A", 0, 100.0, 1.0), zone("B", 0, 400.0, 2.0)];
        let table = Table {
            descriptor: Descriptor::default(),
            evidence: Evidence::Halves,
            tone_mapping: ToneMapping::Srgb { exposure: 1.0 },
            zones,
            answers: Vec::new(),
        };
        let scores = score(constant_noise_baseline(&table).iter());
        assert!((scores.error_factor - 1.0).abs() < 1e-3, "{scores:?}");
        assert_eq!(scene_median_baseline(&table), vec![]);
    }

    /// Probabilities of 0.25 and 0.75 that come true in a quarter and in half of the cases.
    #[test]
    fn calibration_is_the_distance_from_the_diagonal() {
        let levels = |p: f32, n: usize| (0..n).map(move |_| (100.0, p));
        let mut prediction = Prediction::by_threshold(&zone("A", 0, 100.0, 1.0), 100.0);
        prediction.probabilities = levels(0.25, 40).chain(levels(0.75, 20)).collect();
        // Ninefold away: stays out.
        prediction.probabilities.push((900.0, 0.5));
        let turn = std::cell::Cell::new(0);
        let observed = |_, _| {
            turn.set(turn.get() + 1);
            let every = if turn.get() <= 40 { 4 } else { 2 };
            if turn.get() % every == 0 { 1.0 } else { 0.0 }
        };
        let bins = reliability([&prediction].into_iter(), observed);
        assert_eq!(bins.len(), 2);
        assert_eq!((bins[0].observed, bins[1].observed, bins[1].levels), (0.25, 0.5, 20));
        assert!((calibration_error(&bins) - 0.25 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn columns_are_taken_away_by_name() {
        let mut zone = zone("A", 0, 100.0, 1.0);
        zone.levels.iter_mut().for_each(|l| l.descriptor = vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        let table = Table {
            descriptor: Descriptor::default(),
            evidence: Evidence::Halves,
            tone_mapping: ToneMapping::Srgb { exposure: 1.0 },
            zones: vec![zone],
            answers: Vec::new(),
        };
        let less = table.clone().without(&["picture_noise".into(), "textured_area".into()]).unwrap();
        assert!(less.zones[0].levels.iter().all(|l| l.descriptor == [0.0, 2.0, 4.0, 5.0]));
        assert_eq!(table.without(&["colour".into()]), Err("colour".into()));
    }

    #[test]
    fn scores_are_the_geometric_ones() {
        let predictions: Vec<Prediction> = [200.0, 50.0, 40.0, 100.0]
            .map(|spp| Prediction::by_threshold(&zone("A", 0, 100.0, 1.0), spp))
            .to_vec();
        let scores = score(predictions.iter());
        assert_eq!(scores.zones, 4);
        assert!((scores.error_factor - (2.0f64 * 2.0 * 2.5).powf(0.25)).abs() < 1e-9);
        assert!((scores.bias_factor - (2.0f64 / 2.0 / 2.5).powf(0.25)).abs() < 1e-9);
        assert_eq!(scores.early_share, 0.25); // exactly half is not below half
        let accuracy = image_accuracy(predictions.iter()).unwrap();
        assert!(accuracy > 0.8 && accuracy < 1.0);
    }
}
