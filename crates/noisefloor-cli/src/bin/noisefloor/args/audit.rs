//! `noisefloor audit`.

use crate::audit::AuditJob;
use clap::Args;
use noisefloor_cli::options::values;
use noisefloor_cli::sources::Resources;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

/// Find out whether a finished render keeps what it has promised.
///
/// Nobody has the converged picture, so some tiles are rendered again, with another seed, to four times their samples: half of
/// them drawn at random, and half among the quarter that had the most noise left when it stopped. What the picture has lost there
/// is measured by the vision model, in colour, denoised if the render was, and the noise of the new samples is taken off. The
/// scene must be the same as it was. The result goes into report.json, too, and is numbers alone, which can be sent.
///
/// Works with every source but pictures that are played back.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor audit out/hall
  noisefloor audit out/hall --places 32 --json > audit.json
  noisefloor audit out/hall --check                  exit code 3 if fewer than 19 of 20 places keep the limit")]
pub struct AuditArgs {
    /// Output folder of a render.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// How many tiles are rendered again.
    #[arg(long, default_value = "8", value_name = "N", value_parser = places)]
    places: usize,
    /// Draws the tiles, and their samples.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Just-objectionable differences (JOD) that a place may have lost [default: those of --denoise; else 0.5, as much as
    /// the worst squares of pictures in which people stopped seeing noise].
    #[arg(long, value_name = "JOD", value_parser = values::jods)]
    lost: Option<f64>,
    /// End with exit code 3 if fewer than 19 of 20 places keep the limit.
    #[arg(long)]
    check: bool,
    /// Print JSON instead of a table.
    #[arg(long)]
    json: bool,
    /// No progress bar and no table.
    #[arg(long, short)]
    quiet: bool,
    /// Threads [default: one a core].
    #[arg(long, value_name = "N", value_parser = values::threads)]
    threads: Option<NonZeroUsize>,
    /// Other renderers: abort a call after this many seconds.
    #[arg(long, default_value = "1800", value_name = "SECONDS", value_parser = values::seconds)]
    timeout: Duration,
}

/// A number of places.
pub(super) fn places(text: &str) -> Result<usize, String> {
    values::within(text, 1..=100_000)
}

impl AuditArgs {
    pub fn check(self) -> anyhow::Result<AuditJob> {
        let Self { folder, places, seed, lost, check, json, quiet, threads, timeout } = self;
        let resources = Resources { threads, timeout };
        resources.start_threads()?;
        Ok(AuditJob { folder, places, seed, lost, check, json, quiet, resources })
    }
}
