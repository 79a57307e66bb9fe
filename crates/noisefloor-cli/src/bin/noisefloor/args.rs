//! What can be typed, one file a command. Where checking makes something else of it, arguments become a job;
//! nothing typed goes further.

mod audit;
mod calibrate;
mod config;
mod doctor;
pub mod farm;
mod inspect;
mod judge;
mod metrics;
mod reference;
mod render;
mod scenes;
mod tune;
mod verdicts;

pub use audit::AuditArgs;
pub use calibrate::CalibrateArgs;
pub use config::expand;
pub use doctor::DoctorArgs;
use farm::FarmArgs;
pub use inspect::InspectArgs;
pub use judge::JudgeArgs;
pub use metrics::MetricsArgs;
pub use reference::ReferenceArgs;
pub use render::RenderArgs;
pub use scenes::{CheckArgs, ScenesCommand};
pub use tune::TuneArgs;

use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use clap_complete::Shell;
use std::ffi::OsString;
use std::path::PathBuf;

/// Tells progressive Monte Carlo renderers, tile by tile, when people stop seeing noise.
///
/// noisefloor has learned from people when to stop: observers said at how many samples per pixel (spp) they
/// could no longer tell parts of real renders from the converged picture. `render` stops each tile of the
/// built-in path tracer, or of another renderer. `tune` finds the noise threshold of a renderer, or its
/// samples, at which nobody sees noise. `judge` looks at pictures rendered elsewhere. `metrics`
/// compares a picture with its reference. Another command, `noisefloor-lab`, trains models, compares
/// criteria and asks people.
#[derive(Debug, Parser)]
#[command(
    name = "noisefloor",
    version,
    max_term_width = 110,
    propagate_version = true,
    after_help = "Exit codes: 0 done; 1 failed, with one line that says why; 2 wrong usage, or not in this build;
3 with --check: the answer is no;
130 stopped by Ctrl-C or SIGTERM after writing what there was."
)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    Render(Box<RenderArgs>),
    /// One frame of a sequence, as another process says.
    #[command(hide = true)]
    Frame,
    Tune(Box<TuneArgs>),
    Farm(FarmArgs),
    Audit(AuditArgs),
    Reference(ReferenceArgs),
    Judge(JudgeArgs),
    Metrics(MetricsArgs),
    Inspect(InspectArgs),
    Calibrate(CalibrateArgs),
    Doctor(DoctorArgs),
    /// List the built-in scenes, or check scene files.
    Scenes {
        #[command(subcommand)]
        command: Option<ScenesCommand>,
    },
    /// Print completions for a shell.
    #[command(after_help = "Examples:
  noisefloor completions bash > ~/.local/share/bash-completion/completions/noisefloor")]
    Completions {
        shell: Shell,
    },
    /// Write man pages into a folder.
    #[command(after_help = "Examples:
  noisefloor man ~/.local/share/man/man1")]
    Man {
        dir: PathBuf,
    },
}

impl Cli {
    /// The command as it explains itself.
    pub fn known() -> clap::Command {
        Self::command().mut_subcommand("render", render::brief)
    }

    /// What was typed.
    pub fn parsed(typed: impl IntoIterator<Item = OsString>) -> Result<Self, clap::Error> {
        Self::from_arg_matches(&Self::known().try_get_matches_from(typed)?)
    }
}

/// Commands that are elsewhere now, and what to type.
pub const ELSEWHERE: &[(&str, &str)] = &[
    ("merge", "in `noisefloor farm` now: `noisefloor farm merge SHARD… --out DIR`"),
    ("train", LAB),
    ("evaluate", LAB),
    ("audience", LAB),
    ("compare", LAB),
    ("reproduce", LAB),
    ("study", LAB),
    ("explore", LAB),
];

const LAB: &str = "a command of noisefloor-lab: \
                   `cargo run --release -p noisefloor-cli --features lab --bin noisefloor-lab -- …`";
