//! The frames of a sequence, each with its worst place.

use super::{DenoisedJob, JudgeJob, Question};
use anyhow::Context;
use noisefloor_cli::say::{say, say_json};
use noisefloor_cli::spell::JobPath;
use noisefloor_farm::Frames;
use serde::Serialize;
use std::path::PathBuf;

/// A tile, and how bad it is.
#[derive(Clone, Copy, Serialize)]
pub(super) struct Place {
    pub(super) x: usize,
    pub(super) y: usize,
    pub(super) width: usize,
    pub(super) height: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) probability: Option<f32>,
    /// Of denoised pictures.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) jods_lost: Option<f64>,
}

/// What was found of a picture.
#[derive(Serialize)]
pub(super) struct Judged {
    tiles: usize,
    converged_tiles: usize,
    worst: Option<Place>,
}

#[derive(Serialize)]
struct Row {
    frame: i32,
    #[serde(flatten)]
    judged: Judged,
}

impl Judged {
    /// Of all tiles, and whether each has converged.
    pub(super) fn new(tiles: impl Iterator<Item = (bool, Place)>) -> Self {
        let tiles: Vec<_> = tiles.collect();
        let good =
            |place: &Place| place.jods_lost.map_or(f64::from(place.probability.unwrap_or(0.0)), |lost| -lost);
        let order =
            |a: &&(bool, Place), b: &&(bool, Place)| a.0.cmp(&b.0).then(good(&a.1).total_cmp(&good(&b.1)));
        Self {
            tiles: tiles.len(),
            converged_tiles: tiles.iter().filter(|(converged, _)| *converged).count(),
            worst: tiles.iter().min_by(order).map(|(_, place)| *place),
        }
    }

    pub(super) fn is_converged(&self) -> bool {
        self.converged_tiles == self.tiles
    }
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
