//! The frames of a sequence, each with its worst place.

use super::report::{Judged, Place};
use super::{DenoisedJob, JudgeJob, Question};
use anyhow::Context;
use noisefloor_cli::say::{say, say_json};
use noisefloor_cli::spell::JobPath;
use noisefloor_farm::Frames;
use serde::Serialize;
use std::path::PathBuf;

#[derive(Serialize)]
struct Row {
    frame: i32,
    #[serde(flatten)]
    judged: Judged,
}

/// Judges all frames, and says what each is like; whether all have converged.
pub(super) fn run(question: &Question, frames: &Frames, json: bool) -> anyhow::Result<bool> {
    let mut rows = Vec::new();
    if !json {
        say!("frame  converged    worst place      size  {}", question.value())?;
    }
    for frame in frames.iter() {
        let judged = question.of_frame(frame).judge(false).with_context(|| format!("frame {frame}"))?;
        if let (false, Some(Place { x, y, width, height, probability, jods_lost })) = (json, judged.worst) {
            let (size, place) = (format!("{width}×{height}"), format!("({x}, {y})"));
            let value = jods_lost.or(probability.map(f64::from)).unwrap_or_default();
            let converged = format!("{} of {}", judged.converged_tiles, judged.tiles);
            say!("{frame:5} {converged:>10} {place:>14} {size:>9}  {value:.3}")?;
        }
        rows.push(Row { frame, judged });
    }
    if json {
        say_json(&rows)?;
    }
    Ok(rows.iter().all(|row| row.judged.is_converged()))
}

fn at(path: &mut PathBuf, frame: i32) {
    *path = JobPath(std::mem::take(path)).of_frame(frame).0;
}

impl Question {
    /// The same of one frame.
    fn of_frame(&self, frame: i32) -> Self {
        match self {
            Self::Noise(job) => {
                let mut job = JudgeJob::clone(job);
                let pictures = std::iter::once(&mut job.image).chain(&mut job.against);
                let maps = [&mut job.heat_map, &mut job.noise_map, &mut job.exr].into_iter().flatten();
                pictures.map(|(path, _)| path).chain(maps).for_each(|path| at(path, frame));
                Self::Noise(Box::new(job))
            }
            Self::Denoised(job) => {
                let mut job = DenoisedJob::clone(job);
                let pictures = job.noisy.iter_mut().map(|(path, _)| path).chain(&mut job.denoised);
                pictures.chain(&mut job.noise_map).for_each(|path| at(path, frame));
                Self::Denoised(Box::new(job))
            }
        }
    }

    fn value(&self) -> &'static str {
        if matches!(self, Self::Noise(_)) { "P" } else { "JOD lost" }
    }
}
