//! `noisefloor farm` and `noisefloor merge`.

mod frame;
mod run;
mod shards;
mod status;

pub use shards::merge;

use crate::args::{DirArgs, FarmArgs, FarmCommand, PlanArgs, TaskArgs, expand};
use crate::say::{note, one_line, say};
use crate::signals::cancel_on_signal;
use anyhow::{Context, bail};
use frame::{Frame, Pictures};
use noisefloor_farm::{FarmFolder, FarmJob, FarmLock, FrameJob, Round, Slurm, sample, split};
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{SystemTime, UNIX_EPOCH};

pub fn run(args: FarmArgs) -> anyhow::Result<ExitCode> {
    match args.command {
        FarmCommand::Plan(args) => plan(args),
        FarmCommand::Run(args) => run::run(args),
        FarmCommand::Merge(args) => merge_farm(&args),
        FarmCommand::Status(args) => status::status(&args),
        FarmCommand::Task(args) => task(&args),
        FarmCommand::Step(args) => run::step(&args),
    }
}

/// A farm whose folder this process has locked.
struct Coordinator {
    folder: FarmFolder,
    job: FarmJob,
    _lock: FarmLock,
}

/// The folder, and what is rendered; relative paths begin where the farm was planned.
fn open(dir: &Path) -> anyhow::Result<(FarmFolder, FarmJob)> {
    let folder = FarmFolder::new(absolute(dir)?);
    let job = folder.job()?;
    std::env::set_current_dir(&job.folder).with_context(|| {
        format!("{}: where the farm was planned, is no folder of this machine", job.folder.display())
    })?;
    Ok((folder, job))
}

fn absolute(dir: &Path) -> anyhow::Result<PathBuf> {
    std::path::absolute(dir).with_context(|| dir.display().to_string())
}

impl Coordinator {
    fn claim(dir: &Path) -> anyhow::Result<Self> {
        let (folder, job) = open(dir)?;
        let lock = folder.lock()?;
        Ok(Self { folder, job, _lock: lock })
    }

    /// Merges what is there, judges, and plans the next round; it has no tasks if everything is done.
    fn advance(&self, pictures: Pictures) -> anyhow::Result<Round> {
        let before = self.folder.round()?.unwrap_or_default();
        let (mut wanted, mut samples) = (Vec::new(), 0);
        for (index, name) in self.job.names().iter().enumerate() {
            let frame = Frame::open(&self.folder, &self.job, index, name)?;
            let grid = frame.grid().with_context(|| name.clone())?;
            let (state, batches) = frame.merge(pictures).with_context(|| name.clone())?;
            samples += state.samples;
            wanted.push((grid, batches));
        }
        let planned = now();
        let brought = samples - before.samples.min(samples);
        let barren = if before.started && brought == 0 { before.barren.wrapping_add(1) } else { 0 };
        let round = Round {
            number: before.number + usize::from(before.started || before.number == 0),
            tasks: split(wanted, self.job.tasks),
            planned,
            took: if before.started { (planned - before.planned).max(0.0) } else { 0.0 },
            samples,
            brought,
            barren,
            started: false,
            slurm: None,
        };
        self.folder.write_round(&round)?;
        Ok(round)
    }

    /// Refuses to work on a round that Slurm is working on.
    fn check_idle(&self) -> anyhow::Result<()> {
        let round = self.folder.round()?.unwrap_or_default();
        let Some(jobs) = &round.slurm else { return Ok(()) };
        match Slurm::left(jobs) {
            Ok(0) => Ok(()),
            Ok(left) => bail!(
                "{}: round {} is under way as Slurm jobs {} and {} ({left} left); `noisefloor farm status` shows how \
                 far it is, `scancel {} {}` ends it",
                self.folder.path().display(),
                round.number,
                jobs.tasks,
                jobs.step,
                jobs.tasks,
                jobs.step
            ),
            Err(error) => {
                note!("warning: cannot tell whether Slurm still works on round {}: {error}", round.number);
                Ok(())
            }
        }
    }
}

/// Seconds since 1970.
fn now() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |time| time.as_secs_f64())
}

fn plan(args: PlanArgs) -> anyhow::Result<ExitCode> {
    let folder = FarmFolder::new(absolute(&args.dir)?);
    if !args.render.is_empty() {
        if folder.planned_job()?.is_some() {
            bail!(
                "{}: a farm was planned here already; leave out what follows `--`, or choose another folder",
                args.dir.display()
            );
        }
        let tasks = args.tasks.get().min(Slurm::most_tasks());
        let here = std::env::current_dir().context("the current folder")?;
        let (arguments, frames, keep) = (expanded(&args.render)?, args.frames, args.keep_shards);
        let job = FarmJob { arguments, frames, folder: here, tasks, keep };
        let lock = folder.lock()?;
        for (index, name) in job.names().iter().enumerate() {
            Frame::find_out(&folder, &job, index, name).with_context(|| name.clone())?;
        }
        // Last: a farm whose plan was killed is none
        folder.write_job(&job)?;
        drop(lock);
    }
    let coordinator = Coordinator::claim(&args.dir)?;
    coordinator.check_idle()?;
    let round = coordinator.advance(Pictures::WhenDone)?;
    status::say_round(&coordinator.job, &round)?;
    Ok(ExitCode::SUCCESS)
}

/// Options with those of `--config` among them: the file may change before the last task reads it.
fn expanded(render: &[String]) -> anyhow::Result<Vec<String>> {
    let words = ["noisefloor", "render"].into_iter().chain(render.iter().map(String::as_str));
    let words = expand(words.map(OsString::from).collect())?;
    let text = |word: OsString| word.into_string().ok().context("an option of --config is no text");
    words.into_iter().skip(2).map(text).collect()
}

fn merge_farm(args: &DirArgs) -> anyhow::Result<ExitCode> {
    let coordinator = Coordinator::claim(&args.dir)?;
    for (index, name) in coordinator.job.names().iter().enumerate() {
        let frame = Frame::open(&coordinator.folder, &coordinator.job, index, name)?;
        let (state, _) = frame.merge(Pictures::Always).with_context(|| name.clone())?;
        status::say_frame(name, &state, None)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Takes the samples of one task. Interrupted, it writes those that it has.
fn task(args: &TaskArgs) -> anyhow::Result<ExitCode> {
    let (folder, job) = open(&args.dir)?;
    let round = folder.round()?.unwrap_or_default();
    let TaskArgs { round: number, task: index, .. } = *args;
    let Some(task) = round.tasks.get(index).filter(|_| round.number == number) else {
        bail!("{}: round {number} has no task {index} (any more): nothing to do", args.dir.display());
    };
    let names = job.names();
    let name = names.get(task.frame).context("the plan names a frame that the farm does not have")?;
    let arguments = job.arguments_of(task.frame);
    let render = frame::parse(&arguments)?;
    render.source.start_threads()?;
    let planned = folder.frame_job(name)?.context("the frame was not planned")?;
    let opened = render.source.open()?;
    opened.warn();
    let mut source = opened.source;
    let cancel = Arc::new(AtomicBool::new(false));
    cancel_on_signal(Arc::clone(&cancel), "stopping after this batch, and writing what there is")?;
    let FrameJob { scene, source: renderer, shards } = planned;
    let shard = sample(&mut source, shards, &task.batches, || cancel.load(Ordering::Relaxed))?;
    source.notes().iter().for_each(|text| note!("warning: {text}"));
    if shard.is_empty() {
        bail!("stopped before the first batch was there");
    }
    let shard = shard.with_arguments(arguments).with_names(scene, renderer);
    shard.write(folder.shard(name, number, index))?;
    say!("{} of {} batches of {name}", shard.len(), task.batches.len())?;
    Ok(if shard.len() == task.batches.len() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Says which shards cannot be used.
fn warn(problems: &[noisefloor_farm::Problem]) {
    const MOST: usize = 20;
    for problem in problems.iter().take(MOST) {
        note!("warning: {}", one_line(&anyhow::anyhow!("{problem}")));
    }
    if problems.len() > MOST {
        note!("warning: and {} more", problems.len() - MOST);
    }
}
