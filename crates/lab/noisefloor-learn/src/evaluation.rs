//! Everything that predictions are scored by, as data.

use crate::baselines::{constant_noise_baseline, scene_median_baseline};
use crate::predict::Prediction;
use crate::score::{ReliabilityBin, calibration_error, error_interval, image_accuracy, reliability, score};
use crate::table::{Origin, Table};
use noisefloor::model::Scores;
use serde::Serialize;

/// Scores of one way to predict.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PredictionScores {
    #[serde(flatten)]
    pub scores: Scores,
    /// Share of real pictures that are classified as people did; `None` without any.
    pub image_accuracy: Option<f64>,
}

/// What a predictor has to beat.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Baselines {
    /// One noise level for all scenes.
    pub constant: PredictionScores,
    /// The median of the same scene's other zones.
    pub scene_median: PredictionScores,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneScores {
    pub scene: String,
    #[serde(flatten)]
    pub summary: PredictionScores,
    /// Of the same zones.
    pub baselines: Baselines,
}

/// How close predictions come to people.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Evaluation {
    /// `leave-one-scene-out`, or the digest of the model scored.
    pub predicted_by: String,
    #[serde(flatten)]
    pub summary: PredictionScores,
    /// The middle 90 % of the error factor over groups of scenes drawn again; see [`error_interval`]. `None`
    /// with fewer than three groups.
    pub error_interval: Option<(f64, f64)>,
    pub baselines: Baselines,
    pub scenes: Vec<SceneScores>,
    /// P against how often people saw no noise.
    pub reliability: Vec<ReliabilityBin>,
    pub calibration_error: f64,
    /// Zones whose human threshold is only a lower bound: not in the factors.
    pub censored_zones: usize,
    /// Zones unlike any that the model which predicts them was tested on.
    pub unfamiliar_zones: usize,
    pub levels_real: usize,
    pub levels_synthesised: usize,
}

impl PredictionScores {
    fn of(predictions: &[Prediction], keep: &dyn Fn(&Prediction) -> bool) -> Self {
        let kept = || predictions.iter().filter(|p| keep(p));
        Self { scores: score(kept()), image_accuracy: image_accuracy(kept()) }
    }
}

impl Evaluation {
    /// Scores the predictions of the zones of `table`.
    pub fn new(predicted_by: String, table: &Table, predictions: &[Prediction]) -> Self {
        let (constant, median) = (constant_noise_baseline(table), scene_median_baseline(table));
        let baselines = |keep: &dyn Fn(&Prediction) -> bool| Baselines {
            constant: PredictionScores::of(&constant, keep),
            scene_median: PredictionScores::of(&median, keep),
        };
        let scene = |scene: &str| {
            let keep = |p: &Prediction| p.scene == scene;
            let summary = PredictionScores::of(predictions, &keep);
            SceneScores { scene: scene.into(), summary, baselines: baselines(&keep) }
        };
        let levels = || table.zones.iter().flat_map(|z| &z.levels);
        let real = levels().filter(|l| l.origin == Origin::Real).count();
        let curve = reliability(predictions.iter());
        let group =
            |scene: &str| table.zones.iter().find(|z| z.scene == scene).map_or("", |z| z.group.as_str());
        Self {
            predicted_by,
            summary: PredictionScores::of(predictions, &|_| true),
            error_interval: error_interval(predictions.iter(), group),
            baselines: baselines(&|_| true),
            scenes: table.scenes().into_iter().map(scene).collect(),
            calibration_error: calibration_error(&curve),
            reliability: curve,
            censored_zones: table.zones.iter().filter(|z| z.censored).count(),
            unfamiliar_zones: predictions.iter().filter(|p| p.unfamiliar).count(),
            levels_real: real,
            levels_synthesised: levels().count() - real,
        }
    }
}
