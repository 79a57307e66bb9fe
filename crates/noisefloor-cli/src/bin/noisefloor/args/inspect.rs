//! `noisefloor inspect`.

use crate::inspect::InspectJob;
use clap::Args;
use noisefloor_cli::options::oracle::load_model;
use std::path::PathBuf;

/// Show what a model depends on and where it comes from.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor inspect                     the bundled model
  noisefloor inspect my.nfm --json")]
pub struct InspectArgs {
    /// Model file [default: the bundled model].
    #[arg(value_name = "MODEL")]
    model: Option<PathBuf>,
    /// Print JSON.
    #[arg(long)]
    json: bool,
}

impl InspectArgs {
    pub fn check(self) -> anyhow::Result<InspectJob> {
        Ok(InspectJob { model: load_model(self.model.as_deref())?, json: self.json })
    }
}
