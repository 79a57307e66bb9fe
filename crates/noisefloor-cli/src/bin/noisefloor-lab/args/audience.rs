//! `noisefloor-lab audience`.

use clap::{Args, Subcommand};
use std::path::PathBuf;

/// Work out how much more demanding other viewers are than the observers of a model.
#[derive(Debug, Args)]
pub struct AudienceArgs {
    #[command(subcommand)]
    pub command: AudienceCommand,
}

#[derive(Debug, Subcommand)]
pub enum AudienceCommand {
    Fit(FitArgs),
}

/// Fit the line T' = a T + b from the thresholds T of the observers to those of an audience, T'.
///
/// Show your audience zones for which the observers' thresholds are known, or predicted by a model.
/// FILE.csv has one line a zone and the columns `observers` and `audience`, in samples per pixel; other
/// columns are ignored. Prints the line (the median of slopes, which tolerates outliers), Pearson's r, 95 %
/// bootstrap intervals of a and b, and the option for `render`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor-lab audience fit students.csv
  noisefloor render --audience 1.94,-346")]
pub struct FitArgs {
    /// Pairs of thresholds.
    #[arg(value_name = "FILE.csv")]
    pub file: PathBuf,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}
