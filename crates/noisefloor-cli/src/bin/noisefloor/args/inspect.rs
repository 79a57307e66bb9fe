//! `noisefloor inspect`.

use clap::Args;
use std::path::PathBuf;

/// Show what a model depends on and where it comes from.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor inspect                     the bundled model
  noisefloor inspect my.nfm --json")]
pub struct InspectArgs {
    /// Model file [default: the bundled model].
    #[arg(value_name = "MODEL")]
    pub model: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}
