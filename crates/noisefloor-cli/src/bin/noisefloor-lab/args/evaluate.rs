//! `noisefloor-lab evaluate`.

use super::data::{DataArgs, SearchArgs};
use clap::Args;
use noisefloor::People;
use noisefloor_cli::options::values;
use noisefloor_rivals::Rival;
use std::path::PathBuf;

/// Score predicted thresholds against human ones.
///
/// Predicts for each zone the samples per pixel at which P crosses the threshold, and compares that with
/// what people said: error factor exp(mean |ln ratio|), bias factor, and the share of zones that stop below
/// half the human threshold. Two baselines stand beside it: one noise level for all scenes, and the median
/// of the same scene's other zones. Levels between the given pictures are synthesised (noise ∝ 1/√n); the
/// accuracy on images counts only real ones.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor-lab evaluate --table fixtures/human-table.csv --leave-one-scene-out
  noisefloor-lab evaluate --table fixtures/human-choices.csv --nested
  noisefloor-lab evaluate --corpus study/mine --model my.nfm --json scores.json --csv zones.csv
  noisefloor-lab evaluate --corpus study/mine --leave-one-scene-out --figures out/scores
  noisefloor-lab evaluate --table fixtures/human-table.csv --leave-one-scene-out --without picture_noise")]
pub struct EvaluateArgs {
    #[command(flatten)]
    data: DataArgs,
    /// Model to score [default: the bundled one, which has seen the zones it was trained on].
    #[arg(long, value_name = "FILE", conflicts_with = "leave_one_scene_out")]
    model: Option<PathBuf>,
    /// Predict each scene with a model that has seen neither the scene nor another view of its room.
    #[arg(long)]
    leave_one_scene_out: bool,
    /// Predict each scene with everything chosen without it and without other views of its room: the
    /// constants of the descriptor, its numbers, C and γ. Takes a table that `train --save-choices` wrote,
    /// or a corpus.
    #[arg(long, conflicts_with_all = ["model", "leave_one_scene_out", "without", "rivals"])]
    nested: bool,
    /// Share of people who are to see no noise where a tile stops.
    #[arg(long, default_value_t = People::DEFAULT, value_name = "SHARE")]
    people: People,
    /// Write the scores as JSON.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the thresholds of each zone as CSV: scene,zone,human_spp,predicted_spp,stop_spp,censored,
    /// unfamiliar.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
    /// Draw into this folder: both thresholds of each zone (over the pictures, with --corpus), predicted
    /// against human thresholds, and the reliability of P.
    #[arg(long, value_name = "DIR")]
    figures: Option<PathBuf>,
    /// Leave these numbers out of the descriptor, by their names in the table, to see what they are worth.
    #[arg(long, value_name = "NAME,…", value_delimiter = ',', requires = "leave_one_scene_out")]
    without: Vec<String>,
    /// Also score what people use instead: other stopping criteria, by the names in `noisefloor-lab compare
    /// --help`, each with a constant fitted on the other scenes. `cvvdp`
    /// compares with the converged picture, for comparison only. Takes minutes each; the visible-differences
    /// predictors take an hour. With --figures, also plots mean thresholds scene by
    /// scene.
    #[arg(long, value_name = "NAME,…", value_delimiter = ',', requires = "corpus", value_parser = values::rival)]
    rivals: Vec<&'static Rival>,
    #[command(flatten)]
    search: SearchArgs,
}

impl EvaluateArgs {
    pub fn check(self) -> anyhow::Result<crate::evaluate::EvaluateJob> {
        let (mut data, search) = super::data::check_data(self.data, self.search)?;
        let model = match self.leave_one_scene_out || self.nested {
            true => None,
            false => Some(noisefloor_cli::options::oracle::load_model(self.model.as_deref())?),
        };
        // A model is scored by its own descriptor and evidence
        if let Some(model) = &model {
            (data.descriptor, data.evidence) = (model.descriptor().clone(), model.evidence());
            data.viewing = model.viewing();
        }
        Ok(crate::evaluate::EvaluateJob {
            data,
            search,
            model,
            people: self.people,
            json: self.json,
            csv: self.csv,
            figures: self.figures,
            without: self.without,
            nested: self.nested,
            rivals: self.rivals,
        })
    }
}
