//! Scores as a table.

use noisefloor_cli::say::{NotSaid, say};
use noisefloor_learn::{Baselines, Chosen, Evaluation, PredictionScores};

pub(super) fn say_scores(evaluation: &Evaluation) -> Result<(), NotSaid> {
    say!("{:22} zones  error  bias   early  images right    constant noise    scene median", "scene")?;
    for scene in &evaluation.scenes {
        say_line(&scene.scene, &scene.summary, &scene.baselines)?;
    }
    say_line("all", &evaluation.summary, &evaluation.baselines)?;
    if let Some((low, high)) = evaluation.error_interval {
        say!(
            "error if other groups of scenes were drawn from those that are there: ×{low:.2} to ×{high:.2} (90 %)"
        )?;
    }
    say!(
        "calibration error of P: {:.3} (how far P is from how often people saw no noise)",
        evaluation.calibration_error
    )?;
    say!(
        "error = exp(mean |ln(predicted/human)|); bias = exp(mean ln(predicted/human)); \
         early = stopped below half the human threshold.\n\
         Thresholds are searched on {} real and {} synthesised levels; \
         \"images right\" counts only real pictures. The factors leave out {} censored zones; \
         {} zones are unfamiliar to the model that predicts them.\n\
         The scene median knows the scene's other zones, which no predictor of unseen scenes can.",
        evaluation.levels_real,
        evaluation.levels_synthesised,
        evaluation.censored_zones,
        evaluation.unfamiliar_zones
    )
}

/// What was chosen without each group.
pub(super) fn say_choices(choices: &[Chosen]) -> Result<(), NotSaid> {
    for Chosen { without, choice, c, gamma, error_factor } in choices {
        say!(
            "chosen without {without}: {choice}; C = {c}, γ = {gamma} (×{error_factor:.2} on the other scenes)"
        )?;
    }
    Ok(())
}

fn say_line(name: &str, s: &PredictionScores, b: &Baselines) -> Result<(), NotSaid> {
    // A scene of one zone has no median of others.
    let factor = |f: f64| if f.is_finite() { format!("×{f:.2}") } else { "–".into() };
    let constant = b.constant.scores;
    say!(
        "{name:22} {:5}  {:6} {:6} {:3.0} %  {:>12}    {:>14}    {:>12}",
        s.scores.zones,
        factor(s.scores.error_factor),
        factor(s.scores.bias_factor),
        100.0 * s.scores.early_share,
        s.image_accuracy.map_or("–".into(), |a| format!("{:.1} %", 100.0 * a)),
        format!("{}, {:.0} % early", factor(constant.error_factor), 100.0 * constant.early_share),
        factor(b.scene_median.scores.error_factor),
    )
}
