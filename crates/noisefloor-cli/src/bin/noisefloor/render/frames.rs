//! `render --frames`: a sequence, each frame by a process of its own, which gets its job as a value.
//!
//! A frame that fails or is killed takes nothing else with it, and memory is that of one frame.

use crate::job::RenderRun;
use anyhow::Context;
use indicatif::HumanDuration;
use noisefloor_cli::folder::Earlier;
use noisefloor_cli::signals::{self, INTERRUPTED, cancel_on_signal};
use noisefloor_cli::{note, say};
use noisefloor_farm::FrameRange;
use noisefloor_image::write_csv;
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io::{BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A sequence to render: checked. {frame} stands for the frame in the names of its run.
pub struct SequenceRun {
    pub frames: FrameRange,
    pub out: PathBuf,
    pub run: RenderRun,
}

impl SequenceRun {
    /// The run of one frame, in a folder of its own.
    fn of_frame(&self, frame: u32) -> RenderRun {
        let out = self.out.join(FrameRange::folder(frame));
        let against = self.run.against.as_ref().map(|against| against.of_frame(frame));
        RenderRun { job: self.run.job.of_frame(frame), out: Some(out.into()), against, ..self.run.clone() }
    }
}

/// Renders one frame, as another process says on standard input. Where that ends, its process was killed: the
/// frame then ends as by SIGTERM, with everything written.
pub fn one_frame() -> anyhow::Result<ExitCode> {
    let mut jobs = serde_json::Deserializer::from_reader(std::io::stdin()).into_iter::<RenderRun>();
    let run = jobs.next().context("no frame was named")??;
    std::thread::spawn(move || {
        drop(jobs.next());
        signals::terminate_self();
    });
    super::render(&run, true)
}

/// One line of frames.csv.
#[derive(Serialize)]
struct FrameRow {
    frame: u32,
    /// Whether every tile has what it should have.
    complete: bool,
    /// Samples per pixel, on average.
    spp: f64,
    seconds: f64,
    unfamiliar_tiles: usize,
}

/// What report.json says.
#[derive(Deserialize)]
struct FrameReport {
    complete: bool,
    width: usize,
    height: usize,
    samples: u64,
    unfamiliar_tiles: usize,
    seconds_before: f64,
    seconds_total: Option<f64>,
}

pub fn render_frames(sequence: &SequenceRun) -> anyhow::Result<ExitCode> {
    let SequenceRun { frames, out, run } = sequence;
    let (first, last) = (frames.first(), frames.last());
    fs::create_dir_all(out).with_context(|| out.display().to_string())?;
    // Ctrl-C reaches the process of the frame, too, which then writes what there is
    let cancel = Arc::new(AtomicBool::new(false));
    cancel_on_signal(Arc::clone(&cancel), "stopping after this frame")?;
    let (began, mut rows, mut rendered) = (Instant::now(), Vec::new(), 0);
    for frame in frames.iter() {
        let folder = out.join(FrameRange::folder(frame));
        // Whether that is this frame, its own process knows: it reads the scene
        let done = run.earlier == Earlier::Resume && read(&folder).is_some_and(|report| report.complete);
        let status = elsewhere(&sequence.of_frame(frame)).with_context(|| format!("frame {frame}"))?;
        rendered += u32::from(!done);
        if !status.success() && status.code() != Some(INTERRUPTED.into()) {
            note!("frame {frame} of {first} to {last} failed; --resume goes on from it");
            return Ok(ExitCode::from(status.code().and_then(|code| code.try_into().ok()).unwrap_or(1)));
        }
        rows.extend(read(&folder).map(|report| row(frame, &report)));
        write_csv(out.join("frames.csv"), &rows)?;
        if cancel.load(Ordering::Relaxed) {
            note!("stopped at frame {frame} of {first} to {last}; --resume goes on from it");
            return Ok(ExitCode::from(INTERRUPTED));
        }
        if !run.quiet && !done && frame < last {
            let left = began.elapsed().as_secs_f64() / f64::from(rendered) * f64::from(last - frame);
            let left = HumanDuration(Duration::from_secs_f64(left));
            note!("frame {frame} of {first} to {last} done, about {left} to go");
        }
    }
    if !run.quiet {
        sum_up(out, &rows)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Renders in a process of its own.
fn elsewhere(run: &RenderRun) -> anyhow::Result<ExitStatus> {
    let program = std::env::current_exe().context("this program does not find itself")?;
    let mut process = Command::new(program).arg("frame").stdin(Stdio::piped()).spawn()?;
    let job = serde_json::to_vec(run)?;
    // A process that has ended says more than a broken pipe. The pipe stays open as long as this process
    // lives
    let mut stdin = process.stdin.take();
    drop(stdin.as_mut().map(|stdin| stdin.write_all(&job).and_then(|()| stdin.flush())));
    let ended = process.wait();
    drop(stdin);
    Ok(ended?)
}

fn read(out: &Path) -> Option<FrameReport> {
    serde_json::from_reader(BufReader::new(File::open(out.join("report.json")).ok()?)).ok()
}

fn row(frame: u32, report: &FrameReport) -> FrameRow {
    let &FrameReport { complete, width, height, samples, unfamiliar_tiles, seconds_before, seconds_total } =
        report;
    let spp = samples as f64 / (width * height).max(1) as f64;
    let seconds = seconds_before + seconds_total.unwrap_or(0.0);
    FrameRow { frame, complete, spp, seconds, unfamiliar_tiles }
}

fn sum_up(out: &Path, rows: &[FrameRow]) -> anyhow::Result<()> {
    let spp = || rows.iter().map(|row| row.spp);
    let (least, most) = (spp().fold(f64::INFINITY, f64::min), spp().fold(0.0, f64::max));
    let seconds: f64 = rows.iter().map(|row| row.seconds).sum();
    let open = rows.iter().filter(|row| !row.complete).count();
    say!("{} frames, {least:.0} to {most:.0} samples per pixel, {seconds:.0} s of rendering", rows.len())?;
    if open > 0 {
        say!("{open} of them ran out of time or samples before every tile had converged")?;
    }
    say!("written to {}: a folder a frame, and frames.csv", out.display())?;
    Ok(())
}
