//! `noisefloor scenes`.

use clap::{Args, Subcommand};
use noisefloor_cli::options::scenes::SceneFileArgs;
use std::path::PathBuf;

/// What to do with scenes.
#[derive(Debug, Subcommand)]
pub enum ScenesCommand {
    /// Load scene files without rendering them, and list all that is not supported, approximated or ignored.
    ///
    /// The exit code is 1 if a file does not load.
    Check(CheckArgs),
}

#[derive(Debug, Args)]
pub struct CheckArgs {
    /// Scene files: glTF, Mitsuba XML or pbrt.
    #[arg(required = true, value_name = "FILE")]
    pub files: Vec<PathBuf>,
    #[command(flatten)]
    pub scene_files: SceneFileArgs,
}
