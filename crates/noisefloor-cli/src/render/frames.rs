//! `render --frames`: a sequence, each frame by a command of its own.
//!
//! A frame that fails or is killed takes nothing else with it, and memory is that of one frame.

use crate::files::write_csv;
use crate::say::{note, say};
use crate::signals::{INTERRUPTED, cancel_on_signal};
use anyhow::{Context, bail};
use indicatif::HumanDuration;
use serde::{Deserialize, Serialize};
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// A name with the number of a frame in it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FramePattern {
    before: String,
    digits: usize,
    after: String,
}

impl FramePattern {
    /// `hall.{frame}.xml` or `hall.{frame:04}.xml`.
    pub fn parse(text: &str) -> anyhow::Result<Self> {
        let wrong = || format!("--frames: '{text}' does not hold {{frame}} or {{frame:04}} once");
        let (before, rest) = text.split_once("{frame").with_context(wrong)?;
        let (format, after) = rest.split_once('}').with_context(wrong)?;
        let digits = match format.strip_prefix(":0") {
            None if format.is_empty() => Some(1),
            digits => digits.and_then(|digits| digits.parse().ok()),
        };
        let digits = digits.filter(|digits| (1..=9).contains(digits)).with_context(wrong)?;
        if after.contains("{frame") {
            bail!(wrong());
        }
        Ok(Self { before: before.to_owned(), digits, after: after.to_owned() })
    }

    fn name(&self, frame: u32) -> String {
        format!("{}{frame:0width$}{}", self.before, self.after, width = self.digits)
    }

    /// A name for the sequence: that of its files, without number and ending.
    pub fn stem(&self) -> String {
        let name = Path::new(&self.before).file_name().map(|name| name.to_string_lossy().into_owned());
        let stem = name.filter(|_| !self.before.ends_with('/')).unwrap_or_default();
        let stem = stem.trim_end_matches(['.', '-', '_']);
        if stem.is_empty() { "frames".to_owned() } else { stem.to_owned() }
    }
}

/// A sequence to render: checked.
pub struct SequenceJob {
    pub scene: FramePattern,
    /// First and last.
    pub frames: (u32, u32),
    pub out: PathBuf,
    pub resume: bool,
    pub quiet: bool,
    /// What was typed after the name of the program, options of a configuration included.
    pub typed: Vec<OsString>,
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

pub fn render_frames(job: &SequenceJob) -> anyhow::Result<ExitCode> {
    let (first, last) = job.frames;
    fs::create_dir_all(&job.out).with_context(|| job.out.display().to_string())?;
    let program = std::env::current_exe().context("this program does not find itself")?;
    // Ctrl-C reaches the command of the frame, too, which then writes what there is
    let cancel = Arc::new(AtomicBool::new(false));
    cancel_on_signal(Arc::clone(&cancel), "stopping after this frame")?;
    let (began, mut rows, mut rendered) = (Instant::now(), Vec::new(), 0);
    for frame in first..=last {
        let (scene, out) = (job.scene.name(frame), job.out.join(format!("{frame:04}")));
        let done = read(&out).is_some_and(|report| report.complete) && job.resume;
        if !done {
            let mut command = Command::new(&program);
            command.args(arguments(job, &scene, &out));
            let status = command.status().with_context(|| format!("frame {frame}: no process for it"))?;
            rendered += 1;
            if !status.success() && status.code() != Some(INTERRUPTED.into()) {
                note!("frame {frame} of {first} to {last} failed; --resume goes on from it");
                return Ok(ExitCode::from(status.code().and_then(|code| code.try_into().ok()).unwrap_or(1)));
            }
        }
        rows.extend(read(&out).map(|report| row(frame, &report)));
        write_csv(&job.out.join("frames.csv"), rows.iter())?;
        if cancel.load(Ordering::Relaxed) {
            note!("stopped at frame {frame} of {first} to {last}; --resume goes on from it");
            return Ok(ExitCode::from(INTERRUPTED));
        }
        if !job.quiet && !done && frame < last {
            let left = began.elapsed().as_secs_f64() / f64::from(rendered) * f64::from(last - frame);
            let left = HumanDuration(Duration::from_secs_f64(left));
            note!("frame {frame} of {first} to {last} done, about {left} to go");
        }
    }
    if !job.quiet {
        sum_up(job, &rows)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// What was typed, for one frame.
fn arguments(job: &SequenceJob, scene: &str, out: &Path) -> Vec<OsString> {
    let pattern = format!("{}{{frame", job.scene.before);
    let mut arguments = Vec::new();
    let mut typed = job.typed.iter();
    while let Some(word) = typed.next() {
        let text = word.to_string_lossy();
        match text.split_once('=') {
            _ if ["--frames", "--out", "--config"].contains(&&*text) => drop(typed.next()),
            Some(("--frames" | "--out" | "--config", _)) => (),
            _ if text.starts_with(&pattern) => arguments.push(scene.into()),
            _ => arguments.push(word.clone()),
        }
    }
    arguments.extend(["--out".into(), out.into()]);
    arguments
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

fn sum_up(job: &SequenceJob, rows: &[FrameRow]) -> anyhow::Result<()> {
    let spp = || rows.iter().map(|row| row.spp);
    let (least, most) = (spp().fold(f64::INFINITY, f64::min), spp().fold(0.0, f64::max));
    let seconds: f64 = rows.iter().map(|row| row.seconds).sum();
    let open = rows.iter().filter(|row| !row.complete).count();
    say!("{} frames, {least:.0} to {most:.0} samples per pixel, {seconds:.0} s of rendering", rows.len())?;
    if open > 0 {
        say!("{open} of them ran out of time or samples before every tile had converged")?;
    }
    say!("written to {}: a folder a frame, and frames.csv", job.out.display())?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_names_its_frames() {
        let pattern = FramePattern::parse("shots/hall.{frame:04}.xml").unwrap();
        assert_eq!((pattern.name(7), pattern.stem()), ("shots/hall.0007.xml".into(), "hall".into()));
        let pattern = FramePattern::parse("shots/{frame}/hall.xml").unwrap();
        assert_eq!((pattern.name(70), pattern.stem()), ("shots/70/hall.xml".into(), "frames".into()));
        for wrong in
            ["hall.xml", "{frame", "{frame:4}", "{frame:0x}", "{frame:00}", "{frame}{frame}", "{frame:0999}"]
        {
            assert!(FramePattern::parse(wrong).is_err(), "{wrong}");
        }
    }
}
