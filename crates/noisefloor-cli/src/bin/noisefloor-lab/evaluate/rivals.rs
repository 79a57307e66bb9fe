//! Other criteria on the same zones, and figures.

use crate::bars::Bars;
use crate::learning::DataJob;
use noisefloor::model::Scores;
use noisefloor_cli::say::{NotSaid, say};
use noisefloor_image::write_atomic;
use noisefloor_lab::rivals::{self, RatedRival, mean, plot_scene_means};
use noisefloor_learn::{Prediction, score};
use noisefloor_rivals::Rival;
use std::io::Write;
use std::path::Path;

pub(super) fn rate(data: &DataJob, asked: &[&'static Rival]) -> anyhow::Result<Vec<RatedRival>> {
    if asked.is_empty() {
        return Ok(Vec::new());
    }
    let bars = Bars::new(false);
    let rated = rivals::rate(data.corpora(), asked, data.viewing, &|advance| bars.show(advance))?;
    bars.finish();
    Ok(rated)
}

/// Draws how the model's predictions and those of rivals compare.
pub(super) fn draw(folder: &Path, predictions: &[Prediction], rated: &[RatedRival]) -> anyhow::Result<()> {
    if !rated.is_empty() {
        let plot = plot_scene_means(predictions, rated)?;
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
