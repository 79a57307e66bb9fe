//! `noisefloor farm`.

use super::config::with_file;
use super::render::RenderArgs;
use crate::job::{RenderJob, RenderRun};
use crate::render::SequenceExposure;
use anyhow::anyhow;
use clap::{Args, Subcommand};
use noisefloor_cli::folder::Earlier;
use noisefloor_cli::options::values;
use noisefloor_cli::refuse;
use noisefloor_cli::sources::Resources;
use noisefloor_farm::{Frames, Slurm};
use std::ffi::OsString;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

/// Render a frame or a sequence on many machines, or in several processes on this one.
///
/// Work goes in rounds: a plan says which samples each tile is expected to need, tasks take them and write
/// them into shards, and a merge adds the shards, judges, and plans again, until nobody sees noise. Picture
/// and stops are those of `noisefloor render` with the same options, to the bit. The folder, on a file
/// system that all machines share, is all the state there is: whatever is killed, `run` continues. Only
/// renderers that repeat their samples can be divided: `ptwne`, `cycles`, and `mitsuba` with libLLVM.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  noisefloor farm plan shots/hall -- hall.xml --size 3840x2160 --seed 7
  noisefloor farm run shots/hall --local 4           in four processes on this machine
  noisefloor farm run shots/hall --wait              as Slurm array jobs
  noisefloor farm run shots/hall --sbatch=--partition=render --sbatch=--cpus-per-task=32
  noisefloor farm status shots/hall
  noisefloor farm plan shots/walk --frames 1-240 -- 'walk.{frame:04}.xml'     a sequence
  noisefloor farm merge shots/hall/frame/merged/*.nfs --out hall              shards without their farm")]
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
    /// On Slurm, each round is an array job, and a job that depends on it merges, judges and submits the
    /// next round. No process waits in between. What preempted and failed tasks did not deliver is planned
    /// again. After three rounds in a row that brought no samples, it ends with an error.
    Run(RunArgs),
    /// Merge the shards that are there, judge, and write the pictures as far as they are.
    ///
    /// With --out, files of shards are merged into one picture, without their farm. Those of the job that
    /// the first one belongs to are added batch by batch, as on one machine: picture and stops are the same
    /// to the bit, whatever their order, number and size. Shards that are damaged, cut short, of another
    /// scene, seed, size or set of options, that overlap, or contradict each other, are named and not mixed
    /// in. What is missing is named, too; the exit code is then 1, and `noisefloor render --resume` with
    /// the same options and this output folder takes the missing samples.
    Merge(MergeArgs),
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
pub struct MergeArgs {
    /// Folder of the farm; with --out, shards: files that tasks have written.
    #[arg(required = true, value_name = "DIR|SHARD")]
    pub paths: Vec<PathBuf>,
    /// Merge files of shards into this output folder.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Overwrite the render that is in the output folder.
    #[arg(long, requires = "out")]
    pub force: bool,
}

#[derive(Debug, Args)]
pub struct PlanArgs {
    /// Folder of the farm, on a file system that all machines share.
    pub dir: PathBuf,
    /// Frames, as for `noisefloor render`: 1-240, 1-100x5, 1,5,9 or -3--1. {frame} in the name of the scene, or
    /// {frame:04} for four digits, is the number of the frame (####, %04d and $F4, too). Each frame has a seed of its own. All have the exposure of the first, for which they
    /// wait; after `--`, --exposure-from or --exposure give another.
    #[arg(long, value_name = "LIST", allow_hyphen_values = true)]
    pub frames: Option<Frames>,
    /// Most tasks of a round over all frames, up to 1000; short rounds have fewer.
    #[arg(long, default_value = "16", value_name = "N", value_parser = tasks)]
    pub tasks: usize,
    /// Keep shards once they are merged, in FRAME/merged: for `farm merge --out`.
    #[arg(long)]
    pub keep_shards: bool,
    /// Scene and options, as for `noisefloor render`.
    #[arg(last = true, value_name = "RENDER OPTIONS")]
    pub render: Vec<OsString>,
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
    #[arg(long, default_value = "10", value_name = "SECONDS", value_parser = values::seconds)]
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

fn tasks(text: &str) -> Result<usize, String> {
    values::within(text, 1..=Slurm::most_tasks())
}

impl PlanArgs {
    /// The render that follows `--`, and where its frames have their exposure from; none to plan the next round of what
    /// is there. Other machines know neither the current folder nor the file of --config.
    pub fn render(&self) -> anyhow::Result<Option<(RenderJob, Resources, SequenceExposure)>> {
        if self.render.is_empty() {
            return Ok(None);
        }
        let frames = self.frames.as_ref();
        let args =
            RenderArgs::parsed(with_file(&self.render)?).map_err(|error| anyhow!("after `--`: {error}"))?;
        if args.is_sequence() {
            refuse!("--frames: before `--`, as in `farm plan DIR --frames 1-240 -- 'hall.{{frame:04}}.xml'`");
        }
        let (run, exposure) = match frames {
            Some(frames) => args.check_of(frames)?,
            None => (args.check()?, SequenceExposure::Each),
        };
        let absent = |frame: &&i32| frames.is_some_and(|frames| !frames.contains(**frame));
        if let Some(frame) = exposure.frames().iter().find(absent) {
            refuse!(
                "--exposure-from: frame {frame} is not among the frames of the farm; render it first, \
             and give its output folder"
            );
        }
        let RenderRun { job, resources, out, time, against, earlier, tev, watch, audit, .. } = run;
        for (option, given) in [
            ("--tev", tev.is_some()),
            ("--watch", watch.is_some()),
            ("--out", out.is_some()),
            ("--time", time.is_some()),
            ("--against", against.is_some()),
            ("--audit", audit.is_some()),
            ("--resume and --force", earlier != Earlier::Keep),
        ] {
            if given {
                refuse!(
                    "{option}: not for a farm, which renders into its own folder, to the end, on other machines; \
                 leave it out"
                );
            }
        }
        Ok(Some((job.absolute()?, resources, exposure)))
    }
}
