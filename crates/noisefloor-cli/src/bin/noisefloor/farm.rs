//! `noisefloor farm`: what a farm needs of this command, and what it says.

use crate::args::farm::{FarmCommand, MergeArgs, PlanArgs, RunArgs, StatusArgs, StepArgs, TaskArgs};
use crate::job::{CriterionJob, Ready, RenderJob};
use crate::output::{self, About, Output};
use crate::render::{EACH, JOB, KeyExposure, ONE_SEED, eased, exposure_of};
use anyhow::{Context, bail};
use indicatif::HumanDuration;
use noisefloor::driver::{Clock, Progress};
use noisefloor::{Checkpoint, Session};
use noisefloor_cli::build::{program, program_digest};
use noisefloor_cli::folder::{Earlier, Folder};
use noisefloor_cli::say::{NotSaid, one_line, say_json};
use noisefloor_cli::signals::{AFTER_THIS_BATCH, INTERRUPTED, cancel_on_signal};
use noisefloor_cli::sources::{Resources, SourceKind};
use noisefloor_cli::{note, refuse, say};
use noisefloor_farm::{
    Coordinator, Farm, FarmPlan, Finished, FrameJob, FrameProgress, FrameSource, FrameState, News,
    RenderFiles, Round, Slurm, Studio, StudioError, merge_shards,
};
use serde::{Deserialize, Serialize};
use std::cell::Cell;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// What is missing is named so far.
const MOST_NAMED: usize = 5;

/// A render that machines share.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FarmRender {
    pub job: RenderJob,
    pub resources: Resources,
    /// BLAKE3 of the program that planned it. Another one may take other samples for the same job.
    program: String,
}

impl FarmRender {
    fn check_program(&self) -> anyhow::Result<()> {
        let here = program_digest()?;
        anyhow::ensure!(
            here == self.program,
            "this noisefloor is another build than the one that planned the farm ({:.8}, not {:.8}), \
             and may take other samples: run that one on every node, or plan the farm anew in another folder",
            here,
            self.program
        );
        Ok(())
    }
}

/// This command, as a farm sees it.
struct Here {
    quiet: bool,
    /// Whether the user knows what the scene lacks.
    warned: Cell<bool>,
}

pub fn run(command: FarmCommand) -> anyhow::Result<ExitCode> {
    match command {
        FarmCommand::Plan(args) => plan(args),
        FarmCommand::Run(args) => rounds(args),
        FarmCommand::Merge(args) => merge(args),
        FarmCommand::Status(args) => status(&args),
        FarmCommand::Task(args) => deliver(&args),
        FarmCommand::Step(args) => step(args),
    }
}

impl Here {
    fn new(quiet: bool) -> Self {
        Self { quiet, warned: Cell::new(false) }
    }

    fn farm(&self, dir: &Path) -> anyhow::Result<Farm<'_, Self>> {
        Ok(Farm::open(self, &absolute(dir)?)?)
    }
}

fn absolute(dir: &Path) -> anyhow::Result<PathBuf> {
    std::path::absolute(dir).with_context(|| dir.display().to_string())
}

fn plan(args: PlanArgs) -> anyhow::Result<ExitCode> {
    let here = Here::new(false);
    let render = args.render()?;
    let PlanArgs { dir, frames, tasks, keep_shards, .. } = args;
    if let Some((job, resources, exposure)) = render {
        check(&job)?;
        let render = FarmRender { job, resources, program: program_digest()? };
        if frames.is_some() && exposure.frames().is_empty() && render.job.tone.settles() {
            note!("warning: {EACH}");
        }
        if frames.is_some() && render.job.source.same_seed {
            note!("warning: {ONE_SEED}");
        }
        let plan = FarmPlan::new(render, frames, tasks, keep_shards).with_first(exposure.frames().to_vec());
        Farm::plan(&here, &absolute(&dir)?, plan)?;
    }
    let round = here.farm(&dir)?.claim()?.next_round()?;
    say_round(&round)?;
    Ok(ExitCode::SUCCESS)
}

fn rounds(RunArgs { dir, local, sbatch, wait, every, quiet }: RunArgs) -> anyhow::Result<ExitCode> {
    let here = Here::new(quiet);
    let coordinator = here.farm(&dir)?.claim()?;
    coordinator.begin()?;
    if let Some(processes) = local {
        let cancel = Arc::new(AtomicBool::new(false));
        let says = "stopping once the tasks under way have written what they have; `farm run` continues";
        cancel_on_signal(Arc::clone(&cancel), says)?;
        let done = coordinator.run_local(&program()?, processes.get(), || cancel.load(Ordering::Relaxed))?;
        return if done { finished(&here, &dir) } else { Ok(ExitCode::from(INTERRUPTED)) };
    }
    let slurm = Slurm { program: program()?, options: sbatch };
    let submitted = coordinator.submit(&slurm)?;
    // The steps lock the folder
    drop(coordinator);
    if !submitted || !wait {
        return Ok(ExitCode::SUCCESS);
    }
    here.farm(&dir)?.wait(&slurm, every)?;
    finished(&here, &dir)
}

/// What follows a round on Slurm.
fn step(StepArgs { dir, round, sbatch }: StepArgs) -> anyhow::Result<ExitCode> {
    let here = Here::new(false);
    let own = std::env::var("SLURM_JOB_ID").ok();
    let slurm = Slurm { program: program()?, options: sbatch };
    let submitted = Coordinator::step(here.farm(&dir)?, round, own.as_deref(), &slurm)?;
    if submitted { Ok(ExitCode::SUCCESS) } else { finished(&here, &dir) }
}

fn finished(here: &Here, dir: &Path) -> anyhow::Result<ExitCode> {
    if !here.quiet {
        let farm = here.farm(dir)?;
        say_frames(&farm.progress()?.frames)?;
        say!("written to {}", farm.folder().path().display())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Takes the samples of one task. Interrupted, it writes those that it has.
fn deliver(TaskArgs { dir, round, task }: &TaskArgs) -> anyhow::Result<ExitCode> {
    let here = Here::new(false);
    let farm = here.farm(dir)?;
    let order = farm.order(*round, *task)?;
    let FarmRender { job, resources, .. } = &order.job;
    order.job.check_program()?;
    resources.start_threads()?;
    let opened = job.source.open(*resources)?;
    opened.warn();
    let mut source = opened.source;
    let cancel = Arc::new(AtomicBool::new(false));
    cancel_on_signal(Arc::clone(&cancel), AFTER_THIS_BATCH)?;
    let delivered = order.deliver(&mut source, || cancel.load(Ordering::Relaxed))?;
    source.notes().iter().for_each(|text| note!("warning: {text}"));
    say!("{} of {} batches of {}", delivered.batches, delivered.of, delivered.frame)?;
    Ok(if delivered.batches == delivered.of { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn merge(MergeArgs { paths, out, force }: MergeArgs) -> anyhow::Result<ExitCode> {
    let here = Here::new(false);
    let Some(out) = out else {
        let [dir] = paths.as_slice() else {
            refuse!("one folder of a farm, or shards and --out for their picture")
        };
        for (frame, state) in here.farm(dir)?.claim()?.merge()? {
            say_frame(&frame, None, &state)?;
        }
        return Ok(ExitCode::SUCCESS);
    };
    let merged = merge_shards(&here, &paths, &out, force)?;
    let done = merged.tiles - merged.missing.len();
    say!(
        "{} batches of {} shards, {done} of {} tiles done; written to {}",
        merged.batches,
        merged.shards,
        merged.tiles,
        out.display()
    )?;
    if merged.missing.is_empty() {
        return Ok(ExitCode::SUCCESS);
    }
    for (tile, first, end) in merged.missing.iter().take(MOST_NAMED) {
        note!("warning: no shard has tile {tile}, samples {first} to {end}");
    }
    if merged.missing.len() > MOST_NAMED {
        note!("warning: nor the next samples of {} more tiles", merged.missing.len() - MOST_NAMED);
    }
    note!("`noisefloor render --resume` with the same options and this output folder takes what is missing");
    Ok(ExitCode::FAILURE)
}

impl Studio for Here {
    type Job = FarmRender;
    const CHECKPOINT: &'static str = JOB;

    fn of_frame(&self, render: &FarmRender, frame: i32) -> FarmRender {
        FarmRender { job: render.job.of_frame(frame), ..render.clone() }
    }

    /// With the exposure that frame has by those that it waited for.
    fn after(
        &self,
        render: &FarmRender,
        frame: i32,
        first: &[(i32, PathBuf)],
    ) -> Result<FarmRender, StudioError> {
        let key = |(frame, folder): &(i32, PathBuf)| {
            anyhow::Ok(KeyExposure { frame: *frame, exposure: exposure_of(folder)? })
        };
        let keys: Vec<KeyExposure> = first.iter().map(key).collect::<Result<_, _>>()?;
        let exposure = eased(&keys, frame).context("the frames that it waits for have no exposure")?;
        let job = RenderJob { tone: render.job.tone.exposed_as(exposure), ..render.job.clone() };
        Ok(FarmRender { job, ..render.clone() })
    }

    fn open(&self, render: &FarmRender) -> Result<FrameSource, StudioError> {
        render.check_program()?;
        let opened = render.job.source.open(render.resources)?;
        if !self.warned.replace(true) {
            opened.warn();
        }
        Ok(FrameSource { source: opened.source, scene: opened.scene })
    }

    fn session(&self, render: &FarmRender, (width, height): (usize, usize)) -> Result<Session, StudioError> {
        render.check_program()?;
        let Ready { params, oracle } = render.job.read()?;
        let criterion = render.job.criterion.of(oracle.as_ref()).context("a farm does not denoise")?;
        let mut session = Session::new(width, height, criterion, params)?;
        // As a driver does: sources deliver radiance
        session.set_linear();
        Ok(session)
    }

    fn occupied(&self, folder: &Path) -> Option<&'static str> {
        output::render_in(folder)
    }

    fn finished(&self, folder: &Path, digest: &str) -> Result<Finished, StudioError> {
        Ok(output::finished(folder, digest)?)
    }

    fn files(
        &self,
        render: &FarmRender,
        frame: &FrameJob,
        folder: &Path,
        force: bool,
    ) -> Result<Box<dyn RenderFiles>, StudioError> {
        let FrameJob { scene, source, .. } = frame;
        let (folder, earlier) = (Folder::claim(folder.to_owned())?, Earlier::of(force, false));
        let model = render.job.read()?.oracle.map(|oracle| oracle.model().digest());
        let about = About::new(scene.clone(), source.clone(), &render.job, model);
        let mut output = Output::create(folder, earlier, about, false)?;
        // Only sources that repeat their samples are on a farm
        output.origin = render.job.source.origin(scene, source, true)?;
        Ok(Box::new(output))
    }

    fn tell(&self, news: News<'_>) {
        match news {
            News::Round(round) if !self.quiet => drop(say_round(round)),
            News::Failed { failed, tasks, log } => note!(
                "warning: {failed} of {tasks} tasks failed, and are planned again: see {}",
                log.display()
            ),
            News::Problems(problems) => {
                const MOST: usize = 20;
                for problem in problems.iter().take(MOST) {
                    note!("warning: {}", one_line(&anyhow::anyhow!("{problem}")));
                }
                if problems.len() > MOST {
                    note!("warning: and {} more", problems.len() - MOST);
                }
            }
            News::SetAside(aside) => {
                note!("{} was put aside; what it lacks is rendered again", aside.display());
            }
            News::Unsure(round, error) => {
                note!("warning: cannot tell whether Slurm still works on round {round}: {error}");
            }
            News::Vanished(round) => {
                note!("warning: the jobs of round {round} have vanished: submitting again");
            }
            _ => {}
        }
    }
}

impl RenderFiles for Output {
    fn checkpoint(&mut self) -> Result<Option<Checkpoint<'static>>, StudioError> {
        let checkpoint = Output::checkpoint(self)?;
        if let Some(checkpoint) = &checkpoint {
            self.take_up(checkpoint.total_samples());
        }
        Ok(checkpoint)
    }

    fn write(
        &mut self,
        session: &Session,
        progress: &Progress,
        over: Option<Clock>,
    ) -> Result<(), StudioError> {
        self.record(session, progress);
        let checkpoint = Some(session.checkpoint(JOB)?);
        match over {
            Some(clock) => Output::write(self, session, checkpoint, (clock, None))?,
            None => self.write_progress(session, checkpoint)?,
        }
        Ok(())
    }
}

/// What a farm cannot do.
fn check(job: &RenderJob) -> anyhow::Result<()> {
    if job.source.kind == SourceKind::Exr {
        bail!(
            "pictures on disk hold the batches that they hold, and a farm plans others; \
             `noisefloor render --source exr` plays them"
        );
    }
    match job.criterion {
        CriterionJob::Oracle { .. } | CriterionJob::Spp(_) => Ok(()),
        _ => bail!(
            "a farm judges by the oracle or by `--criterion spp:N`; `noisefloor render` does all others"
        ),
    }
}

fn status(StatusArgs { dir, json }: &StatusArgs) -> anyhow::Result<ExitCode> {
    let here = Here::new(false);
    let progress = here.farm(dir)?.progress()?;
    if *json {
        say_json(&progress)?;
        return Ok(ExitCode::SUCCESS);
    }
    say_frames(&progress.frames)?;
    if progress.done {
        say!("done in {} rounds", progress.round.saturating_sub(1))?;
    } else {
        let since = HumanDuration(Duration::from_secs(progress.seconds as u64));
        let jobs = progress.slurm_left.map_or(String::new(), |left| format!(", {left} Slurm jobs left"));
        let (round, delivered, tasks) = (progress.round, progress.delivered, progress.tasks);
        say!("round {round}: {delivered} of {tasks} shards there{jobs}, planned {since} ago")?;
    }
    Ok(ExitCode::SUCCESS)
}

fn say_round(round: &Round) -> Result<(), NotSaid> {
    let batches: usize = round.tasks.iter().map(|task| task.batches.len()).sum();
    let mut frames: Vec<usize> = round.tasks.iter().map(|task| task.frame).collect();
    frames.dedup();
    let jobs = match round.slurm() {
        Some(jobs) => format!(", Slurm jobs {} and {}", jobs.tasks, jobs.step),
        None => String::new(),
    };
    let (number, tasks) = (round.number, round.tasks.len());
    say!("round {number}: {batches} batches in {tasks} tasks, for {} frames{jobs}", frames.len())
}

fn say_frames(frames: &[FrameProgress]) -> Result<(), NotSaid> {
    frames.iter().try_for_each(|known| say_frame(&known.frame, known.eta_seconds, &known.state))
}

fn say_frame(frame: &str, eta_seconds: Option<f64>, state: &FrameState) -> Result<(), NotSaid> {
    let FrameState { tiles, open, samples, sampled, rounds, done, .. } = state;
    if *tiles == 0 {
        return say!("{frame}: waits for the frame whose exposure it is to have");
    }
    if *done {
        let wasted = 100.0 * (sampled.max(samples) - samples) as f64 / (*samples).max(1) as f64;
        return say!("{frame}: done, {samples} samples, {wasted:.1} % more taken than used");
    }
    let eta = match eta_seconds {
        Some(seconds) => {
            format!("about {} to go", HumanDuration(Duration::from_secs(seconds.min(1e9) as u64)))
        }
        None => "no estimate yet".into(),
    };
    say!("{frame}: {open} of {tiles} tiles open after {rounds} verdicts, {samples} samples, {eta}")
}
