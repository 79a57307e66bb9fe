//! `render --frames`: a sequence, each frame by a process of its own, which gets its job as a value.
//!
//! A frame that fails or is killed takes nothing else with it, and memory is that of one frame.

use super::exposure::{self, KeyExposure, SequenceExposure, eased};
use super::forecast;
use super::frame_report::{FrameRow, read, row};
use crate::job::{CriterionJob, RenderRun};
use anyhow::Context;
use indicatif::HumanDuration;
use noisefloor_cli::end::ANSWER_IS_NO;
use noisefloor_cli::folder::Earlier;
use noisefloor_cli::signals::{self, INTERRUPTED, cancel_on_signal};
use noisefloor_cli::{note, say};
use noisefloor_farm::Frames;
use noisefloor_image::write_csv;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A sequence to render: checked. Names and values of its run say where the number of the frame stands.
pub struct SequenceRun {
    pub frames: Frames,
    pub out: PathBuf,
    pub run: RenderRun,
    pub exposure: SequenceExposure,
    /// How many frames are rendered to say what all of them take; none to render all.
    pub forecast: Option<usize>,
}

impl SequenceRun {
    /// The run of one frame, in a folder of its own; with the exposure that it has by the key frames, unless
    /// it is one of them.
    fn of_frame(&self, frame: i32, keys: &[KeyExposure]) -> RenderRun {
        let out = self.out.join(Frames::folder(frame));
        let against = self.run.against.as_ref().map(|against| against.of_frame(frame));
        let mut job = self.run.job.of_frame(frame);
        if let Some(exposure) = eased(keys, frame) {
            job.tone = job.tone.exposed_as(exposure);
        }
        RenderRun { job, out: Some(out.into()), against, ..self.run.clone() }
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

pub fn render_frames(sequence: &SequenceRun) -> anyhow::Result<ExitCode> {
    let SequenceRun { frames, out, run, exposure, forecast } = sequence;
    let (first, last) = (frames.first(), frames.last());
    fs::create_dir_all(out).with_context(|| out.display().to_string())?;
    // Ctrl-C reaches the process of the frame, too, which then writes what there is
    let cancel = Arc::new(AtomicBool::new(false));
    cancel_on_signal(Arc::clone(&cancel), "stopping after this frame")?;
    warn(sequence);
    let (began, mut rows, mut rendered) = (Instant::now(), Vec::new(), 0);
    let mut keys = exposure.kept(out, run.earlier)?;
    // The frames whose exposures the others have come first
    let key_frames = if keys.is_empty() { exposure.frames() } else { &[] };
    let wanted: Vec<i32> = match forecast {
        Some(few) => frames.spread(*few),
        None => frames.iter().collect(),
    };
    let others: Vec<i32> = wanted.into_iter().filter(|frame| !key_frames.contains(frame)).collect();
    let keys_within = key_frames.iter().filter(|frame| frames.contains(**frame)).count();
    let (mut found, mut is_no) = (Vec::new(), false);
    for (index, &frame) in key_frames.iter().chain(&others).enumerate() {
        let folder = out.join(Frames::folder(frame));
        // Whether that is this frame, its own process knows: it reads the scene
        let done = run.earlier == Earlier::Resume && read(&folder).is_some_and(|report| report.complete);
        let status = elsewhere(&sequence.of_frame(frame, &keys)).with_context(|| format!("frame {frame}"))?;
        rendered += u32::from(!done);
        let says_no = status.code() == Some(ANSWER_IS_NO.into());
        is_no |= says_no;
        if !status.success() && !says_no && status.code() != Some(INTERRUPTED.into()) {
            note!("frame {frame} of {first} to {last} failed; --resume goes on from it");
            return Ok(ExitCode::from(status.code().and_then(|code| code.try_into().ok()).unwrap_or(1)));
        }
        let report = read(&folder);
        if frames.contains(frame) {
            rows.extend(report.as_ref().map(|report| row(frame, report)));
            rows.sort_by_key(|row| row.frame);
            write_csv(out.join("frames.csv"), &rows)?;
        }
        if cancel.load(Ordering::Relaxed) {
            note!("stopped at frame {frame} of {first} to {last}; --resume goes on from it");
            return Ok(ExitCode::from(INTERRUPTED));
        }
        if index < key_frames.len() {
            let exposure = report.and_then(|report| report.exposure);
            let exposure = exposure.with_context(|| {
                format!(
                    "frame {frame} ended before its exposure was known, which other frames are to have: \
                     give it more --time, or give --exposure"
                )
            })?;
            found.push(KeyExposure { frame, exposure });
            if found.len() == key_frames.len() {
                exposure::keep(out, &found)?;
                keys.clone_from(&found);
            }
        }
        let to_go = (keys_within + others.len()).saturating_sub(rows.len());
        if !run.quiet && !done && to_go > 0 {
            let left = began.elapsed().as_secs_f64() / f64::from(rendered) * to_go as f64;
            let left = HumanDuration(Duration::from_secs_f64(left));
            note!("frame {frame} of {first} to {last} done, about {left} to go");
        }
    }
    match forecast {
        Some(_) => forecast::say(frames, out, &rows, run.quiet)?,
        None if !run.quiet => sum_up(out, &rows)?,
        None => {}
    }
    Ok(if is_no { ExitCode::from(ANSWER_IS_NO) } else { ExitCode::SUCCESS })
}

/// What is unwise about one seed for all frames.
pub const ONE_SEED: &str = "with one seed for all frames, their noise stands still on the screen, \
     like dirt on the lens: it takes about three times the samples to vanish. Leave out --same-seed";

/// What is unwise about an exposure for each frame.
pub const EACH: &str = "each frame settles an exposure of its own. \
     Those of frames that differ by noise alone differ by several percent, and the film flickers: \
     leave out --exposure-from each";

/// Says what is unwise about a sequence.
fn warn(sequence: &SequenceRun) {
    let RenderRun { job, quiet, .. } = &sequence.run;
    if *quiet {
        return;
    }
    if job.source.same_seed {
        note!("warning: {ONE_SEED}");
    }
    let in_film = job.frames_per_second.or(job.viewing.and_then(|viewing| viewing.frames_per_second()));
    if in_film.is_none() && !job.source.same_seed && matches!(job.criterion, CriterionJob::Oracle { .. }) {
        note!(
            "each frame is judged as a still; as a frame of a film, whose noise is new in each, \
             it needs about half of the samples or less: --fps 24"
        );
    }
    if sequence.exposure.frames().is_empty() && job.tone.settles() {
        note!("warning: {EACH}");
    }
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
