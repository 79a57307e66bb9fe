//! `noisefloor-lab train`.

use super::data::{DataArgs, SearchArgs};
use clap::Args;
use std::path::PathBuf;

/// Train a model on human thresholds.
///
/// A corpus is a folder with thresholds.csv (scene, renderer, zone, x, y, width, height, human_spp,
/// first_spp, last_spp) and the pictures: SCENE/SPP.png, which are running means of one progressive
/// rendering, or zoneNN/batch_FIRST_LAST.exr, which are means of only those samples. C and γ are chosen,
/// and probabilities calibrated, by leaving out one scene at a time.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor-lab train --corpus study/lisic9 --corpus study/staircase --out my.nfm
  noisefloor-lab train --table fixtures/human-table.csv --out my.nfm    from the shipped table, without any picture
  noisefloor-lab train --table fixtures/human-table.csv --disagreements explore.sqlite --out my.nfm")]
pub struct TrainArgs {
    #[command(flatten)]
    pub data: DataArgs,
    /// Model file to write.
    #[arg(long, value_name = "FILE")]
    pub out: PathBuf,
    /// Also write the table of descriptors; `--table` trains from it without the pictures.
    #[arg(long, value_name = "FILE.csv")]
    pub save_table: Option<PathBuf>,
    /// Also write the numbers for every choice of constants in the descriptor, for `evaluate --nested`.
    #[arg(long, value_name = "FILE.csv", requires = "corpus")]
    pub save_choices: Option<PathBuf>,
    /// Learn from the disagreements that `explore` keeps in this database, too. Each counts as much as the
    /// levels of a zone within a factor of two in samples. Prints the scores before and after.
    #[arg(long, value_name = "FILE.sqlite", conflicts_with = "no_scores")]
    pub disagreements: Option<PathBuf>,
    /// Do not score on left-out scenes; the model's record then has no scores.
    #[arg(long)]
    pub no_scores: bool,
    #[command(flatten)]
    pub search: SearchArgs,
}
