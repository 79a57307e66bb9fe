//! What can be typed, one file a command. Where checking makes something else of it, arguments become a job;
//! nothing typed goes further.

pub mod audience;
mod compare;
mod data;
mod evaluate;
mod explore;
mod reproduce;
pub mod study;
mod train;

pub use compare::CompareArgs;
pub use data::check_data;
pub use evaluate::EvaluateArgs;
pub use explore::ExploreArgs;
pub use reproduce::ReproduceArgs;
pub use train::TrainArgs;

use audience::AudienceArgs;
use clap::{Parser, Subcommand};
use clap_complete::Shell;
use std::path::PathBuf;
use study::StudyArgs;

/// Trains the models of noisefloor, compares stopping criteria, and asks people.
///
/// `train` and `evaluate` make models of human thresholds and score them. `compare` lets criteria watch one
/// render. `study` and `explore` ask people in the browser. Renders are made by the command `noisefloor`.
#[derive(Debug, Parser)]
#[command(
    name = "noisefloor-lab",
    version,
    max_term_width = 110,
    propagate_version = true,
    after_help = "Exit codes: 0 done; 1 failed, with one line that says why; 2 wrong usage; 130 stopped by Ctrl-C or
SIGTERM after writing what there was."
)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    Train(TrainArgs),
    Evaluate(EvaluateArgs),
    Audience(AudienceArgs),
    Compare(Box<CompareArgs>),
    Reproduce(ReproduceArgs),
    Study(StudyArgs),
    Explore(ExploreArgs),
    /// Print completions for a shell.
    #[command(after_help = "Examples:
  noisefloor-lab completions bash > ~/.local/share/bash-completion/completions/noisefloor-lab")]
    Completions {
        shell: Shell,
    },
    /// Write man pages into a folder.
    #[command(after_help = "Examples:
  noisefloor-lab man ~/.local/share/man/man1")]
    Man {
        dir: PathBuf,
    },
}

/// Commands of the other binary.
pub const ELSEWHERE: &[(&str, &str)] = &[
    ("render", RENDER),
    ("farm", RENDER),
    ("judge", RENDER),
    ("metrics", RENDER),
    ("reference", RENDER),
    ("inspect", RENDER),
    ("scenes", RENDER),
    ("doctor", RENDER),
];

const RENDER: &str = "a command of noisefloor: `cargo run --release -- …`";
