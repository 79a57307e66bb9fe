//! Predicted thresholds against human ones.
//!
//! Scores follow the rules of evidence: whole scenes left out, predictions clipped
//! to the levels that observers could choose, real pictures scored apart from synthesised levels.

use crate::predict::Prediction;
use noisefloor::model::Scores;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Scores predictions. Censored thresholds stay out.
pub fn score<'a>(predictions: impl Iterator<Item = &'a Prediction> + Clone) -> Scores {
    let known = || predictions.clone().filter(|p| !p.censored);
    let ratios = || known().map(Prediction::log_ratio);
    let zones = ratios().count();
    let mean = |f: fn(f64) -> f64| ratios().map(f).sum::<f64>() / zones as f64;
    Scores {
        zones,
        error_factor: mean(f64::abs).exp(),
        bias_factor: mean(|r| r).exp(),
        early_share: known().filter(|p| p.is_early()).count() as f64 / zones as f64,
    }
}

/// Resamplings of groups behind [`error_interval`].
const RESAMPLINGS: usize = 10_000;

/// The middle 90 % of the error factor if the groups of scenes were drawn again, with replacement, from those
/// that are there: what other scenes might have given. `None` with fewer than three groups.
pub fn error_interval<'a>(
    predictions: impl Iterator<Item = &'a Prediction>,
    group_of: impl Fn(&str) -> &'a str,
) -> Option<(f64, f64)> {
    let mut groups: BTreeMap<&str, (f64, f64)> = BTreeMap::new();
    for p in predictions.filter(|p| !p.censored) {
        let (sum, zones) = groups.entry(group_of(&p.scene)).or_default();
        (*sum, *zones) = (*sum + p.log_ratio().abs(), *zones + 1.0);
    }
    let groups: Vec<(f64, f64)> = groups.into_values().collect();
    if groups.len() < 3 {
        return None;
    }
    let mut random = fastrand::Rng::with_seed(1);
    let mut resampled = || {
        let drawn = (0..groups.len()).map(|_| groups[random.usize(..groups.len())]);
        let (sum, zones) = drawn.fold((0.0, 0.0), |(s, n), (sum, zones)| (s + sum, n + zones));
        (sum / zones).exp()
    };
    let mut errors: Vec<f64> = (0..RESAMPLINGS).map(|_| resampled()).collect();
    errors.sort_by(f64::total_cmp);
    Some((errors[RESAMPLINGS / 20], errors[RESAMPLINGS - RESAMPLINGS / 20 - 1]))
}

/// Levels within this factor of the human threshold say how well probabilities are calibrated: further ones
/// are easy, and would flatter.
const CALIBRATION_RANGE: f64 = 8.0;

/// Levels whose probabilities lie in one tenth of the scale.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReliabilityBin {
    pub predicted: f64,
    pub observed: f64,
    pub levels: usize,
}

/// The reliability curve, in ten bins of equal width, of which empty ones are left out: how often people saw no
/// noise where P was such. Levels further than eightfold from the threshold, and censored zones, stay out.
pub fn reliability<'a>(predictions: impl Iterator<Item = &'a Prediction>) -> Vec<ReliabilityBin> {
    let mut bins = [(0.0, 0.0, 0usize); 10];
    for p in predictions.filter(|p| !p.censored) {
        for &(spp, probability) in &p.probabilities {
            if (spp / p.human_as_noise).ln().abs() <= CALIBRATION_RANGE.ln() {
                let bin = &mut bins[((probability * 10.0) as usize).min(9)];
                let observed = f64::from(u8::from(spp >= p.human_as_noise));
                *bin = (bin.0 + f64::from(probability), bin.1 + observed, bin.2 + 1);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::table::tests::zone;

    /// Probabilities of 0.25 and 0.75 that come true in a quarter and in half of the cases.
    #[test]
    fn calibration_is_the_distance_from_the_diagonal() {
        // People stop at 50 or 200 samples, and P is predicted at 100; ninefold away stays out
        let prediction = |p: f32, human: f64| {
            let mut prediction = Prediction::by_threshold(&zone("A", 0, human, 1.0), 100.0);
            prediction.probabilities = vec![(100.0, p), (9.0 * human, 0.5)];
            prediction
        };
        let quarter = [50.0, 200.0, 200.0, 200.0].map(|human| prediction(0.25, human));
        let half = [50.0, 200.0].map(|human| prediction(0.75, human));
        let bins = reliability(quarter.iter().chain(&half));
        assert_eq!(bins.len(), 2);
        assert_eq!((bins[0].observed, bins[1].observed, bins[1].levels), (0.25, 0.5, 2));
        assert!((calibration_error(&bins) - 0.25 / 3.0).abs() < 1e-12);
    }

    /// Two of three groups err by ×1, one by ×8: a mean of ln 8 · k/3 with k drawn of three, k = 0 in 8/27 and
    /// k = 3 in 1/27 of the drawings, so that the middle 90 % reach from k = 0 to k = 2.
    #[test]
    fn intervals_are_those_of_groups_drawn_again() {
        let prediction = |scene: &str, spp: f64| Prediction::by_threshold(&zone(scene, 0, 100.0, 1.0), spp);
        let three = [prediction("A", 100.0), prediction("B", 800.0), prediction("C", 100.0)];
        let group = |scene: &str| {
            if scene == "A" {
                "A"
            } else if scene == "B" {
                "B"
            } else {
                "C"
            }
        };
        let (low, high) = error_interval(three.iter(), group).unwrap();
        assert!((low - 1.0).abs() < 1e-9 && (high - 4.0).abs() < 1e-9, "{low} {high}");
        assert_eq!(error_interval(three[..2].iter(), group), None);
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
