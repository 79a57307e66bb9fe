//! `noisefloor farm` and `noisefloor merge`.

use clap::{Args, Subcommand};
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

/// Render a frame or a sequence on many machines, or in several processes on this one.
///
/// Work goes in rounds: a plan says which samples each tile is expected to need, tasks take them and write
/// them into shards, and a merge adds the shards, judges, and plans again, until nobody sees noise. Picture
/// and stops are those of `noisefloor render` with the same options, to the bit. The folder, on a file system
/// that all machines share, is all the state there is: whatever is killed, `run` continues. Only renderers
/// that repeat their samples can be divided: `ptwne`, `exr`, `cycles`, and `mitsuba` with libLLVM.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor farm plan shots/hall -- hall.xml --size 3840x2160 --seed 7
  noisefloor farm run shots/hall --local 4           in four processes on this machine
  noisefloor farm run shots/hall --wait              as Slurm array jobs
  noisefloor farm run shots/hall --sbatch=--partition=render --sbatch=--cpus-per-task=32
  noisefloor farm status shots/hall
  noisefloor farm plan shots/walk --frames 1-240 -- 'walk.{frame:04}.xml'     a sequence")]
pub struct FarmArgs {
    #[command(subcommand)]
    pub command: FarmCommand,
}

#[derive(Debug, Subcommand)]
pub enum FarmCommand {
    /// Say what is to be rendered, or plan the next round of what is there.
    ///
    /// What follows `--` is as for `noisefloor render`, without --out and the like. Every scene is opened
    /// once.
    Plan(PlanArgs),
    /// Render round after round: as Slurm array jobs that follow each other, or with --local here.
    ///
    /// On Slurm, each round is an array job, and a job that depends on it merges, judges and submits the next
    /// round. No process waits in between. What preempted and failed tasks did not deliver is planned again.
    /// After three rounds in a row that brought no samples, it ends with an error.
    Run(RunArgs),
    /// Merge the shards that are there, judge, and write the pictures as far as they are.
    Merge(DirArgs),
    /// Show how far each frame is, and what the round under way is doing.
    Status(StatusArgs),
    /// What each task of a round runs.
    #[command(hide = true)]
    Task(TaskArgs),
    /// What follows a round on Slurm.
    #[command(hide = true)]
    Step(StepArgs),
}

#[derive(Debug, Args)]
pub struct DirArgs {
    /// Folder of the farm.
    pub dir: PathBuf,
}

#[derive(Debug, Args)]
pub struct PlanArgs {
    /// Folder of the farm, on a file system that all machines share.
    pub dir: PathBuf,
    /// First and last frame. {frame} in the options after `--` is the number of the frame, {frame:04} with
    /// four digits.
    #[arg(long, value_name = "A-B", value_parser = frames)]
    pub frames: Option<(u32, u32)>,
    /// Most tasks of a round over all frames, up to 1000; short rounds have fewer.
    #[arg(long, default_value = "16", value_name = "N")]
    pub tasks: NonZeroUsize,
    /// Keep shards once they are merged, in FRAME/merged: for `noisefloor merge`.
    #[arg(long)]
    pub keep_shards: bool,
    /// Scene and options, as for `noisefloor render`.
    #[arg(last = true, value_name = "RENDER OPTIONS")]
    pub render: Vec<String>,
}

#[derive(Debug, Args)]
pub struct RunArgs {
    /// Folder of the farm.
    pub dir: PathBuf,
    /// Run the tasks here, N at a time, and return when everything is done.
    #[arg(long, value_name = "N")]
    pub local: Option<NonZeroUsize>,
    /// An option for `sbatch`, such as --sbatch=--partition=render. Can be given more than once.
    #[arg(long, value_name = "OPTION", conflicts_with = "local", allow_hyphen_values = true)]
    pub sbatch: Vec<String>,
    /// Return when everything is done, not when the first round is submitted. Submits again if the jobs have
    /// vanished.
    #[arg(long, conflicts_with = "local")]
    pub wait: bool,
    /// With --wait: seconds between two looks.
    #[arg(long, default_value = "10", value_name = "SECONDS", value_parser = super::values::seconds)]
    pub every: Duration,
    /// Say nothing but errors.
    #[arg(short, long)]
    pub quiet: bool,
}

#[derive(Debug, Args)]
pub struct StatusArgs {
    /// Folder of the farm.
    pub dir: PathBuf,
    /// As JSON.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct TaskArgs {
    pub dir: PathBuf,
    pub round: usize,
    pub task: usize,
}

#[derive(Debug, Args)]
pub struct StepArgs {
    pub dir: PathBuf,
    pub round: usize,
    #[arg(long, allow_hyphen_values = true)]
    pub sbatch: Vec<String>,
}

/// Merge shards of a farm into one picture.
///
/// Shards of the job that the first one belongs to are added batch by batch, as on one machine: picture and
/// stops are the same to the bit, whatever their order, number and size. Shards that are damaged, cut short,
/// of another scene, seed, size or set of options, that overlap, or contradict each other, are named and not
/// mixed in. What is missing is named, too; the exit code is then 1, and `noisefloor render --resume` with
/// the same options and this output folder takes the missing samples.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor merge shots/hall/frame/merged/*.nfs --out hall")]
pub struct MergeArgs {
    /// Shards: files that tasks have written.
    #[arg(required = true, value_name = "SHARD")]
    pub shards: Vec<PathBuf>,
    /// Output folder.
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Overwrite the render that is in the output folder.
    #[arg(long)]
    pub force: bool,
}

fn frames(text: &str) -> Result<(u32, u32), String> {
    let parts = text.split_once('-').and_then(|(a, b)| Some((a.parse().ok()?, b.parse().ok()?)));
    match parts {
        Some((first, last)) if first <= last && last - first < noisefloor_farm::MOST_FRAMES => {
            Ok((first, last))
        }
        _ => Err("expected FIRST-LAST, such as 1-240".to_owned()),
    }
}
