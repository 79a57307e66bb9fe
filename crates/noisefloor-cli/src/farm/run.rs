//! Rounds, one after the other: here, or on Slurm.

use super::frame::Pictures;
use super::status::{say_frame, say_round};
use super::{Coordinator, open};
use crate::args::{RunArgs, StepArgs};
use crate::say::{note, say};
use crate::signals::{INTERRUPTED, cancel_on_signal};
use anyhow::{Context, bail};
use noisefloor_farm::{FarmError, FarmFolder, FarmJob, Round, Slurm, SlurmJobs, run_local};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Rounds in a row without samples after which a farm gives up.
const MOST_BARREN: usize = 3;
/// Seconds that a step waits for the lock of its folder.
const LOCK_TRIES: usize = 600;

pub fn run(args: RunArgs) -> anyhow::Result<ExitCode> {
    let coordinator = Coordinator::claim(&args.dir)?;
    coordinator.check_idle()?;
    // Whoever types this has mended what was wrong; what was killed meanwhile is no sign of the contrary
    if let Some(round) = coordinator.folder.round()? {
        coordinator.folder.write_round(&Round { barren: usize::MAX, slurm: None, ..round })?;
    }
    match args.local {
        Some(processes) => locally(&coordinator, processes.get(), args.quiet),
        None => {
            let slurm = Slurm { program: program()?, options: args.sbatch.clone() };
            let done = submit_next(&coordinator, &slurm, args.quiet)?.is_none();
            let dir = coordinator.folder.path().to_owned();
            // The steps lock the folder
            drop(coordinator);
            if done || !args.wait { Ok(ExitCode::SUCCESS) } else { wait(&dir, &slurm, &args) }
        }
    }
}

/// This command, for other processes and nodes.
fn program() -> anyhow::Result<PathBuf> {
    std::env::current_exe().context("the path of this program")
}

fn locally(coordinator: &Coordinator, processes: usize, quiet: bool) -> anyhow::Result<ExitCode> {
    let cancel = Arc::new(AtomicBool::new(false));
    let says = "stopping once the tasks under way have written what they have; `farm run` continues";
    cancel_on_signal(Arc::clone(&cancel), says)?;
    let cancelled = || cancel.load(Ordering::Relaxed);
    loop {
        let round = coordinator.advance(Pictures::WhenDone)?;
        if round.tasks.is_empty() {
            return finished(&coordinator.folder, &coordinator.job, quiet);
        }
        check_fruitful(&coordinator.folder, &round)?;
        let round = Round { started: true, ..round };
        coordinator.folder.write_round(&round)?;
        if !quiet {
            say_round(&coordinator.job, &round)?;
        }
        let failed = run_local(&program()?, &coordinator.folder, &round, processes, cancelled)?;
        if cancelled() {
            coordinator.advance(Pictures::WhenDone)?;
            return Ok(ExitCode::from(INTERRUPTED));
        }
        if let Some(task) = failed.first() {
            let log = coordinator.folder.log(round.number, *task);
            note!(
                "warning: {} of {} tasks failed, and are planned again: see {}",
                failed.len(),
                round.tasks.len(),
                log.display()
            );
        }
    }
}

/// What follows a round on Slurm: merge, judge, and submit the next one.
pub fn step(args: &StepArgs) -> anyhow::Result<ExitCode> {
    let coordinator = claim_patiently(&args.dir)?;
    let round = coordinator.folder.round()?.unwrap_or_default();
    // A step that Slurm started once more, or whose round was given up
    let own = std::env::var("SLURM_JOB_ID").ok();
    let superseded = round.slurm.as_ref().zip(own.as_ref()).is_some_and(|(jobs, own)| jobs.step != *own);
    if round.number != args.round || superseded {
        bail!("round {} has been superseded by round {}: nothing to do", args.round, round.number);
    }
    let slurm = Slurm { program: program()?, options: args.sbatch.clone() };
    match submit_next(&coordinator, &slurm, false)? {
        Some(_) => Ok(ExitCode::SUCCESS),
        None => finished(&coordinator.folder, &coordinator.job, false),
    }
}

/// Waits for a `farm merge` that somebody has typed meanwhile: without this step nothing would go on.
fn claim_patiently(dir: &Path) -> anyhow::Result<Coordinator> {
    let mut tries = 0;
    loop {
        match Coordinator::claim(dir) {
            Err(error)
                if tries < LOCK_TRIES && matches!(error.downcast_ref(), Some(FarmError::Locked(_))) =>
            {
                tries += 1;
                std::thread::sleep(Duration::from_secs(1));
            }
            claimed => return claimed,
        }
    }
}

/// Merges, plans, and submits what is planned; none if everything is done.
fn submit_next(coordinator: &Coordinator, slurm: &Slurm, quiet: bool) -> anyhow::Result<Option<SlurmJobs>> {
    let mut round = coordinator.advance(Pictures::WhenDone)?;
    if round.tasks.is_empty() {
        return Ok(None);
    }
    check_fruitful(&coordinator.folder, &round)?;
    if round.tasks.len() > Slurm::most_tasks() {
        // The rest comes with the next round
        round.tasks.truncate(Slurm::most_tasks());
        coordinator.folder.write_round(&round)?;
    }
    let jobs = slurm.submit(&coordinator.folder, &round)?;
    (round.started, round.slurm) = (true, Some(jobs.clone()));
    coordinator.folder.write_round(&round)?;
    if !quiet {
        say_round(&coordinator.job, &round)?;
    }
    Ok(Some(jobs))
}

fn check_fruitful(folder: &FarmFolder, round: &Round) -> anyhow::Result<()> {
    if round.barren >= MOST_BARREN {
        bail!(
            "{}: {} rounds in a row brought no samples; see {}, mend what is wrong, and run again",
            folder.path().display(),
            round.barren,
            folder.log(round.number - 1, 0).display()
        );
    }
    Ok(())
}

fn finished(folder: &FarmFolder, job: &FarmJob, quiet: bool) -> anyhow::Result<ExitCode> {
    if !quiet {
        for name in job.names() {
            say_frame(&name, &folder.state(&name)?, None)?;
        }
        say!("written to {}", folder.path().display())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Looks after rounds on Slurm until all is done. Jobs can vanish: a node takes the step with it, or somebody
/// cancels them.
fn wait(dir: &Path, slurm: &Slurm, args: &RunArgs) -> anyhow::Result<ExitCode> {
    let (folder, job) = open(dir)?;
    let mut vanished = 0;
    loop {
        std::thread::sleep(args.every.max(Duration::from_millis(100)));
        let states: Result<Vec<_>, _> = job.names().iter().map(|name| folder.state(name)).collect();
        if states?.iter().all(|state| state.done) {
            return finished(&folder, &job, args.quiet);
        }
        let round = folder.round()?.unwrap_or_default();
        let left = round.slurm.as_ref().map_or(Ok(0), Slurm::left)?;
        // A step that has just ended may have submitted another round since the file was read
        if left > 0 || folder.round()?.unwrap_or_default() != round {
            vanished = 0;
            continue;
        }
        vanished += 1;
        if vanished > MOST_BARREN {
            let coordinator = Coordinator::claim(dir)?;
            check_fruitful(&folder, &round)?;
            note!("warning: the jobs of round {} have vanished: submitting again", round.number);
            submit_next(&coordinator, slurm, args.quiet)?;
            vanished = 0;
        } else {
            check_fruitful(&folder, &round)?;
        }
    }
}
