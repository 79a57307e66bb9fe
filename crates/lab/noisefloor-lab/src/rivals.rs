//! When other criteria would have stopped the pictures that people judged.
//!
//! The pictures of a corpus are stages of one rendering, too few to follow a criterion that remembers what
//! it saw. So a rendering is synthesised from them: batches of growing size, each the converged picture
//! with noise of its own laid over it, noise that is the difference of real pictures, scaled by 1/√samples.
//! There are five or so such differences in a corpus; they take turns, with changing sign. All zones of a
//! scene are one picture, as people saw them, and each zone is a tile. A rival that compares with the
//! converged picture is given it.

mod noise;
mod plot;
mod rendering;

pub use plot::plot_scene_means;

use crate::advance::{Advance, Watch};
use crate::error::LabError;
use noisefloor::{Viewing, model::Scores};
use noisefloor_learn::{Corpus, JudgedZone, Prediction, as_noise, first_word, score};
use noisefloor_rivals::Rival;
use rayon::prelude::*;
use rendering::SynthesisedRendering;
use serde::Serialize;
use std::path::PathBuf;

/// Constants that are tried for a rival, evenly spread over its range in logarithms: of one that has to be
/// run with each, and of one whose verdicts tell what constant would do.
const CONSTANTS: (u32, u32) = (16, 400);
/// Constants that are tried at the same time.
const AT_ONCE: usize = 2;

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RatedRival {
    /// The name in a spec: `dammertz`.
    pub name: &'static str,
    /// What it is called in a table or a legend.
    pub title: &'static str,
    /// The constant at which it agrees with people on average, over all scenes.
    pub constant: f64,
    /// With the constant that the other scenes give.
    pub scores: Scores,
    /// Over zones without censored thresholds, samples per pixel.
    pub mean_spp: f64,
    /// Mean thresholds, scene by scene.
    pub scenes: Vec<SceneMean>,
    pub predictions: Vec<Prediction>,
}

/// Mean thresholds of a scene, in samples per pixel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneMean {
    pub scene: String,
    pub human_spp: f64,
    pub predicted_spp: f64,
}

/// Scores rivals on the corpora, the constant of each fitted on the other groups of scenes. `viewing` is
/// where a rival that asks for it takes people to have sat.
pub fn rate(
    folders: &[PathBuf],
    rivals: &[&'static Rival],
    viewing: Viewing,
    watch: Watch<'_>,
) -> Result<Vec<RatedRival>, LabError> {
    let mut scenes: Vec<(Corpus, String)> = Vec::new();
    for folder in folders {
        let corpus = Corpus::open(folder)?;
        scenes.extend(corpus.scenes().into_iter().map(|scene| (corpus.clone(), scene.to_owned())));
    }
    let mut zones = Vec::new();
    let mut stops: Vec<Vec<Vec<f64>>> =
        rivals.iter().map(|rival| vec![Vec::new(); constants(rival).len()]).collect();
    let (mut done, of) = (0, (scenes.len() * rivals.len()) as u64);
    for (corpus, scene) in &scenes {
        let rendering = SynthesisedRendering::of(corpus, scene)?;
        for (rival, stops) in rivals.iter().zip(&mut stops) {
            let detail = format!("{}, {scene}", rival.name);
            watch(Advance { what: "rivals on scenes", done, of, detail: &detail });
            stops
                .iter_mut()
                .zip(stops_of(rival, viewing, &rendering)?)
                .for_each(|(all, new)| all.extend(new));
            done += 1;
        }
        zones.extend(rendering.zones);
    }
    Ok(rivals.iter().zip(stops).map(|(rival, stops)| RatedRival::of(rival, &zones, &stops)).collect())
}

/// Samples per pixel at which a rival stops: a row for each constant, a column for each zone.
fn stops_of(
    rival: &Rival,
    viewing: Viewing,
    rendering: &SynthesisedRendering,
) -> Result<Vec<Vec<f64>>, LabError> {
    let constants = constants(rival);
    if rival.tells {
        let needed = rendering.follow((rival.make)(rival.range.0), viewing, false)?;
        return Ok(constants.into_iter().map(|constant| rendering.stops(&needed, constant)).collect());
    }
    // From lax to strict: where a constant stops no zone at any stage, no stricter one does.
    let mut stops: Vec<Vec<f64>> = Vec::new();
    for some in constants.rchunks(AT_ONCE) {
        let follow = |constant: &f64| rendering.follow((rival.make)(*constant), viewing, true);
        let needed = some.par_iter().map(follow).collect::<Result<Vec<_>, _>>()?;
        stops.extend(
            needed.iter().zip(some).rev().map(|(needed, constant)| rendering.stops(needed, *constant)),
        );
        if needed[0].iter().flatten().all(|needed| needed.is_infinite()) {
            break;
        }
    }
    let strictest = stops.last().cloned().unwrap_or_default();
    stops.resize(constants.len(), strictest);
    stops.reverse();
    Ok(stops)
}

fn constants(rival: &Rival) -> Vec<f64> {
    let (strict, lax) = rival.range;
    let count = if rival.tells { CONSTANTS.1 } else { CONSTANTS.0 };
    let place = |i: u32| f64::from(i) / f64::from(count - 1);
    (0..count).map(|i| strict * (lax / strict).powf(place(i))).collect()
}

impl RatedRival {
    /// `stops` are samples per pixel: a row for each constant, a column for each zone.
    fn of(rival: &'static Rival, zones: &[JudgedZone], stops: &[Vec<f64>]) -> Self {
        let constants = constants(rival);
        let group = |zone: &JudgedZone| first_word(&zone.row.scene).to_owned();
        let predict = |(i, zone): (usize, &JudgedZone)| {
            let others = |j: usize| group(&zones[j]) != group(zone);
            let place = unbiased(stops, zones, &others);
            Prediction {
                scene: zone.row.scene.clone(),
                zone: zone.row.zone,
                human_spp: zone.row.human_spp,
                predicted_spp: at(stops, i, place),
                stop_spp: at(stops, i, place),
                human_as_noise: as_noise(zone.row.human_spp, zone.reference_spp()),
                censored: zone.censored(),
                unfamiliar: false,
                images_right: 0,
                images: 0,
                probabilities: Vec::new(),
            }
        };
        let predictions: Vec<Prediction> = zones.iter().enumerate().map(predict).collect();
        let place = unbiased(stops, zones, &|_| true);
        let (low, share) = (place.floor() as usize, place.fract());
        let next = (low + 1).min(constants.len() - 1);
        Self {
            name: rival.name,
            title: rival.title,
            constant: constants[low] * (constants[next] / constants[low]).powf(share),
            scores: score(predictions.iter()),
            mean_spp: mean(predictions.iter().filter(|p| !p.censored).map(|p| p.predicted_spp)),
            scenes: scene_means(&predictions),
            predictions,
        }
    }
}

/// Mean thresholds of people and of a predictor, scene by scene; censored ones stay out.
pub(crate) fn scene_means(predictions: &[Prediction]) -> Vec<SceneMean> {
    let mut scenes: Vec<&str> = predictions.iter().map(|p| p.scene.as_str()).collect();
    scenes.dedup();
    let means = |scene: &str| {
        let known = || predictions.iter().filter(|p| p.scene == scene && !p.censored);
        SceneMean {
            scene: scene.to_owned(),
            human_spp: mean(known().map(|p| p.human_spp)),
            predicted_spp: mean(known().map(|p| p.predicted_spp)),
        }
    };
    scenes.into_iter().map(means).collect()
}

/// Mean of numbers; NaN of none.
pub fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0usize), |(s, n), v| (s + v, n + 1));
    sum / count as f64
}

/// Samples at which a zone is stopped, at a place between two constants.
fn at(stops: &[Vec<f64>], zone: usize, place: f64) -> f64 {
    let (low, share) = (place.floor() as usize, place.fract());
    let next = (low + 1).min(stops.len() - 1);
    let (a, b) = (stops[low][zone], stops[next][zone]);
    a * (b / a).powf(share)
}

/// The place between constants where the mean of ln(stop/human) over the zones that count is nearest to 0:
/// where a rival agrees with people on average.
fn unbiased(stops: &[Vec<f64>], zones: &[JudgedZone], counts: &dyn Fn(usize) -> bool) -> f64 {
    let bias = |place: f64| {
        mean(
            zones
                .iter()
                .enumerate()
                .filter(|(i, zone)| !zone.censored() && counts(*i))
                .map(|(i, zone)| (at(stops, i, place) / zone.row.human_spp).ln()),
        )
    };
    // Stops fall as constants get lax, but not always: look everywhere.
    let steps = 20 * (stops.len() - 1);
    let places = (0..=steps).map(|i| i as f64 / 20.0);
    places.min_by(|a, b| bias(*a).abs().total_cmp(&bias(*b).abs())).unwrap_or(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use noisefloor_learn::{ThresholdRow, ZoneImages};

    fn zone(scene: &str, human_spp: f64) -> JudgedZone {
        let stack = ZoneImages::Batches(PathBuf::new());
        let row = ThresholdRow {
            scene: scene.into(),
            renderer: String::new(),
            zone: 0,
            x: 0,
            y: 0,
            width: 16,
            height: 16,
            human_spp,
            first_spp: 1,
            last_spp: 10_000,
            reference_spp: None,
        };
        JudgedZone { row, stack }
    }

    /// Three constants stop every zone at 100, 200 and 400 samples; people want 200 in one scene and 283 in
    /// the other.
    #[test]
    fn a_constant_is_fitted_on_the_other_scenes() {
        let rival = &noisefloor_rivals::RIVALS[1];
        let zones = [zone("A", 200.0), zone("B", 200.0 * 2f64.sqrt())];
        let mut stops = vec![vec![400.0; 2], vec![200.0; 2]];
        stops.resize(constants(rival).len(), vec![100.0; 2]);
        let rated = RatedRival::of(rival, &zones, &stops);
        // Each gets what the other one wants.
        let near = |a: f64, b: f64| (a / b).ln().abs() < 0.02;
        assert!(near(rated.predictions[0].predicted_spp, 200.0 * 2f64.sqrt()), "{:?}", rated.predictions);
        assert!(near(rated.predictions[1].predicted_spp, 200.0), "{:?}", rated.predictions);
        // Over both: 2^(1/4)·200, three quarters of the way from the first to the second constant.
        let constants = constants(rival);
        let place = (rated.constant / constants[0]).ln() / (constants[1] / constants[0]).ln();
        assert!((place - 0.75).abs() < 0.03, "{place}");
        assert!(near(rated.scores.error_factor, 2f64.sqrt()));
    }
}
