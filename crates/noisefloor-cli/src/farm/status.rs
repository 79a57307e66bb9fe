//! How far a farm is, for people.

use super::{now, open};
use crate::args::StatusArgs;
use crate::say::{NotSaid, note, say, say_json};
use indicatif::HumanDuration;
use noisefloor_farm::{FarmJob, FrameState, Round, Slurm};
use serde::Serialize;
use std::process::ExitCode;
use std::time::Duration;

#[derive(Serialize)]
struct Status {
    round: usize,
    tasks: usize,
    /// Tasks whose shards are there.
    delivered: usize,
    /// Jobs that Slurm has left.
    slurm_left: Option<usize>,
    done: bool,
    frames: Vec<FrameStatus>,
}

#[derive(Serialize)]
struct FrameStatus {
    frame: String,
    eta_seconds: Option<f64>,
    #[serde(flatten)]
    state: FrameState,
}

pub fn status(args: &StatusArgs) -> anyhow::Result<ExitCode> {
    let (folder, job) = open(&args.dir)?;
    let round = folder.round()?.unwrap_or_default();
    let names = job.names();
    let is_there = |(index, task): (usize, &noisefloor_farm::Task)| {
        names.get(task.frame).is_some_and(|name| folder.shard(name, round.number, index).exists())
    };
    let delivered = round.tasks.iter().enumerate().filter(|task| is_there(*task)).count();
    let mut frames = Vec::new();
    for name in &names {
        let state = folder.state(name)?;
        let eta_seconds = eta(&round, &state);
        frames.push(FrameStatus { frame: name.clone(), eta_seconds, state });
    }
    let slurm_left = round.slurm.as_ref().map(Slurm::left).transpose();
    let slurm_left = slurm_left.unwrap_or_else(|error| {
        note!("warning: {error}");
        None
    });
    let done = frames.iter().all(|frame| frame.state.done);
    let status =
        Status { round: round.number, tasks: round.tasks.len(), delivered, slurm_left, done, frames };
    if args.json {
        say_json(&status)?;
        return Ok(ExitCode::SUCCESS);
    }
    for FrameStatus { frame, eta_seconds, state } in &status.frames {
        say_frame(frame, state, *eta_seconds)?;
    }
    if done {
        say!("done in {} rounds", round.number.saturating_sub(1))?;
    } else {
        let since = HumanDuration(Duration::from_secs((now() - round.planned).max(0.0) as u64));
        let jobs = status.slurm_left.map_or(String::new(), |left| format!(", {left} Slurm jobs left"));
        say!(
            "round {}: {delivered} of {} shards there{jobs}, planned {since} ago",
            round.number,
            status.tasks
        )?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Seconds left, at the pace of the last round.
fn eta(round: &Round, state: &FrameState) -> Option<f64> {
    let pace = (round.brought > 0 && round.took > 0.0).then(|| round.brought as f64 / round.took)?;
    state.to_go.map(|samples| samples as f64 / pace)
}

/// One line about a round.
pub fn say_round(job: &FarmJob, round: &Round) -> Result<(), NotSaid> {
    let batches: usize = round.tasks.iter().map(|task| task.batches.len()).sum();
    let mut frames: Vec<usize> = round.tasks.iter().map(|task| task.frame).collect();
    frames.dedup();
    let jobs = match &round.slurm {
        Some(jobs) => format!(", Slurm jobs {} and {}", jobs.tasks, jobs.step),
        None => String::new(),
    };
    say!(
        "round {}: {batches} batches in {} tasks, for {} of {} frames{jobs}",
        round.number,
        round.tasks.len(),
        frames.len(),
        job.names().len()
    )
}

/// One line about a frame.
pub fn say_frame(name: &str, state: &FrameState, eta: Option<f64>) -> Result<(), NotSaid> {
    let FrameState { tiles, open, samples, sampled, rounds, done, .. } = state;
    if *done {
        let wasted = 100.0 * (sampled.max(samples) - samples) as f64 / (*samples).max(1) as f64;
        return say!("{name}: done, {samples} samples, {wasted:.1} % more taken than used");
    }
    let eta = match eta {
        Some(seconds) => {
            format!("about {} to go", HumanDuration(Duration::from_secs(seconds.min(1e9) as u64)))
        }
        None => "no estimate yet".into(),
    };
    say!("{name}: {open} of {tiles} tiles open after {rounds} verdicts, {samples} samples, {eta}")
}
