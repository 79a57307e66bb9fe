//! What can be typed, one file a command. Each command's arguments become a checked job; nothing typed goes
//! further.
#![cfg_attr(
    not(feature = "full"),
    allow(dead_code, reason = "a command that a build leaves out is known to the parser all the same")
)]

mod audience;
mod compare;
mod config;
mod data;
mod doctor;
mod evaluate;
mod explore;
mod farm;
mod inspect;
mod judge;
mod metrics;
mod oracle;
mod reference;
mod render;
mod renderer;
mod reproduce;
mod scenes;
mod study;
mod tone;
mod train;
mod values;
mod viewing;

pub use audience::AudienceArgs;
pub use compare::CompareArgs;
pub use config::expand;
pub use doctor::DoctorArgs;
pub use evaluate::EvaluateArgs;
pub use explore::ExploreArgs;
#[cfg(feature = "farm")]
pub use farm::{DirArgs, FarmCommand, PlanArgs, RunArgs, StatusArgs, StepArgs, TaskArgs};
pub use farm::{FarmArgs, MergeArgs};
pub use inspect::InspectArgs;
pub use judge::JudgeArgs;
pub use metrics::MetricsArgs;
pub use reference::ReferenceArgs;
pub use render::RenderArgs;
pub use reproduce::ReproduceArgs;
pub use scenes::{CheckArgs, ScenesCommand};
pub use study::StudyArgs;
pub use train::TrainArgs;

use clap::{Parser, Subcommand};

/// Tells progressive Monte Carlo renderers, tile by tile, when people stop seeing noise.
///
/// noisefloor has learned from people when to stop: observers said at how many samples per pixel (spp) they
/// could no longer tell parts of real renders from the converged picture. `render` stops each tile of the
/// built-in path tracer, or of another renderer. `judge` and `explore` look at pictures rendered elsewhere.
/// `metrics` compares a picture with its reference. `train` and `evaluate` make models and score them.
#[derive(Debug, Parser)]
#[command(
    name = "noisefloor",
    version,
    max_term_width = 110,
    propagate_version = true,
    after_help = "Exit codes: 0 done; 1 failed, with one line that says why; 2 wrong usage, or not in this build;
130 stopped by Ctrl-C or SIGTERM after writing what there was."
)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Command,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    Render(Box<RenderArgs>),
    Farm(FarmArgs),
    Merge(MergeArgs),
    Reference(ReferenceArgs),
    Compare(Box<CompareArgs>),
    Judge(JudgeArgs),
    Metrics(MetricsArgs),
    Explore(ExploreArgs),
    Train(TrainArgs),
    Evaluate(EvaluateArgs),
    Audience(AudienceArgs),
    Reproduce(ReproduceArgs),
    Study(StudyArgs),
    Inspect(InspectArgs),
    Doctor(DoctorArgs),
    /// List the built-in scenes, or check scene files.
    Scenes {
        #[command(subcommand)]
        command: Option<ScenesCommand>,
    },
}
