//! Other criteria on the same zones, and figures.

use super::{EvaluateJob, Report};
use crate::bars::Bars;
use noisefloor::model::Scores;
use noisefloor_cli::say::{NotSaid, say};
use noisefloor_image::write_atomic;
use noisefloor_lab::figures::write_figures;
use noisefloor_lab::rivals::{self, RatedRival, mean, plot_scene_means};
use noisefloor_learn::{Prediction, score};
use std::io::Write;

pub(super) fn rate(job: &EvaluateJob) -> anyhow::Result<Vec<RatedRival>> {
    if job.rivals.is_empty() {
        return Ok(Vec::new());
    }
    let bars = Bars::new(false);
    let rated =
        rivals::rate(job.data.corpora(), &job.rivals, job.data.viewing, &|advance| bars.show(advance))?;
    bars.finish();
    Ok(rated)
}

/// Draws what `--figures` asks for.
pub(super) fn draw(job: &EvaluateJob, predictions: &[Prediction], report: &Report) -> anyhow::Result<()> {
    let Some(folder) = &job.figures else { return Ok(()) };
    write_figures(folder, job.data.corpora(), predictions, &report.evaluation.reliability)?;
    if !report.rivals.is_empty() {
        let plot = plot_scene_means(predictions, &report.rivals)?;
        write_atomic(folder.join("rivals.svg"), |to| to.write_all(plot.as_bytes()))?;
    }
    Ok(())
}

/// Says what came out, the model's own predictions first.
pub(super) fn say_rated(model: &[Prediction], rated: &[RatedRival]) -> Result<(), NotSaid> {
    let known = || model.iter().filter(|p| !p.censored);
    say!(
        "\n{:44} {:>9} {:>9} {:>7} {:>7} {:>7}",
        "who stops",
        "constant",
        "mean spp",
        "error",
        "bias",
        "early"
    )?;
    say!("{:44} {:>9} {:9.0}", "people", "", mean(known().map(|p| p.human_spp)))?;
    let line = |name: &str, constant: String, spp: f64, s: &Scores| {
        say!(
            "{name:44} {constant:>9} {spp:9.0} {:>7} {:>7} {:5.0} %",
            format!("×{:.2}", s.error_factor),
            format!("×{:.2}", s.bias_factor),
            100.0 * s.early_share
        )
    };
    line("the model", String::new(), mean(known().map(|p| p.predicted_spp)), &score(model.iter()))?;
    for r in rated {
        line(r.title, format!("{:.2e}", r.constant), r.mean_spp, &r.scores)?;
    }
    say!(
        "Constants are those that agree with people on average; \
         scores use the constant fitted on the other scenes. \
         Rivals follow a rendering that is synthesised from the pictures (noise ∝ 1/√n)."
    )
}
