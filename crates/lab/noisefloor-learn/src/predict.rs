//! The threshold that a model predicts for a zone.

use crate::stimulus::as_difference;
use crate::table::{Origin, Zone};
use noisefloor::{People, model::Judgement};
use serde::{Deserialize, Serialize};

/// Samples at which a quantity, known at increasing levels, first reaches `goal`, interpolated in ln(spp);
/// the first or last level if it has there or not yet. `None` without levels.
pub(crate) fn crossing(levels: &[(f64, f64)], goal: f64) -> Option<f64> {
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

/// Log-odds: a scale on which the probability of a level is nearly linear in ln(spp).
fn log_odds(p: f64) -> f64 {
    let p = p.clamp(1e-9, 1.0 - 1e-9);
    (p / (1.0 - p)).ln()
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Prediction {
    pub scene: String,
    pub zone: u32,
    /// Human threshold, in samples per pixel.
    pub human_spp: f64,
    /// Predicted threshold, within what observers could choose: where half of such zones would have converged.
    pub predicted_spp: f64,
    /// Where the predictor stops, within what observers could choose: not before the predicted threshold.
    pub stop_spp: f64,
    /// [`Zone::human_as_noise`]: to hold probabilities against, which are those of noise without a reference.
    #[serde(skip)]
    pub human_as_noise: f64,
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
    /// By a threshold and a stop, without looking at pictures.
    fn new(zone: &Zone, spp: f64, stop: f64) -> Self {
        let real = || zone.levels.iter().filter(|l| l.origin == Origin::Real);
        let right = real().filter(|l| (l.spp >= spp) == (l.spp >= zone.human_spp));
        Self {
            scene: zone.scene.clone(),
            zone: zone.zone,
            human_spp: zone.human_spp,
            censored: zone.censored,
            unfamiliar: false,
            predicted_spp: spp.clamp(zone.first_spp, zone.last_spp),
            stop_spp: stop.clamp(zone.first_spp, zone.last_spp),
            human_as_noise: zone.human_as_noise(),
            images_right: right.count(),
            images: real().count(),
            probabilities: Vec::new(),
        }
    }

    /// By a threshold, at which the predictor stops.
    pub(crate) fn by_threshold(zone: &Zone, spp: f64) -> Self {
        Self::new(zone, spp, spp)
    }

    pub(crate) fn log_ratio(&self) -> f64 {
        (self.predicted_spp / self.human_spp).ln()
    }

    /// Whether it stops below half of what people asked for.
    pub(crate) fn is_early(&self) -> bool {
        self.stop_spp < 0.5 * self.human_spp
    }
}

/// Predicts what people say of a zone: the samples at which P first reaches one half, without the penalty of unfamiliar
/// tiles, for the mean observer, and those at which that share of `people` is satisfied and a render would stop. P is
/// that of noise; both are turned into the samples of a picture that differs as much from what people compared with. `judge` judges a raw descriptor, as [`noisefloor::Model::judge`]
/// does.
pub fn predict(judge: impl Fn(&[f32]) -> Judgement, people: People, zone: &Zone) -> Prediction {
    let judged: Vec<Judgement> = zone.levels.iter().map(|level| judge(&level.descriptor)).collect();
    let expected = zone.path(|i| log_odds(f64::from(judged[i].mean_observer)));
    let stopping = zone.path(|i| log_odds(f64::from(judged[i].probability)));
    let reaches = |odds: &[(f64, f64)], p: f64| {
        let as_noise = crossing(odds, log_odds(p)).unwrap_or(f64::INFINITY);
        as_difference(as_noise, zone.reference_spp)
    };
    let probabilities = zone.levels.iter().zip(&judged).map(|(l, j)| (l.spp, j.mean_observer)).collect();
    let unfamiliar = zone.at_threshold().is_some_and(|level| judge(&level.descriptor).unfamiliar);
    let (threshold, stop) = (reaches(&expected, 0.5), reaches(&stopping, f64::from(people.share())));
    Prediction { probabilities, unfamiliar, ..Prediction::new(zone, threshold, stop) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crossings_are_interpolated_in_the_logarithm() {
        let levels = [(100.0, 0.0), (400.0, 2.0), (800.0, 1.0)];
        assert!((crossing(&levels, 1.0).unwrap() - 200.0).abs() < 1e-9);
        assert_eq!(crossing(&levels, -1.0), Some(100.0));
        assert_eq!(crossing(&levels, 3.0), Some(800.0));
        assert_eq!(crossing(&[], 1.0), None);
    }
}
