//! What is judged, and by what.

use noisefloor::{Audience, Oracle, ToneMapping, Viewing, evidence::Samples};
use noisefloor_cli::spell::JobPath;
use noisefloor_farm::Frames;
use std::num::NonZeroUsize;
use std::path::PathBuf;

/// Pictures, or those of all frames of a sequence.
#[derive(Clone)]
pub struct JudgeJob {
    /// With its samples per pixel; without them, the file says how many.
    pub image: (PathBuf, Option<f64>),
    /// At least one, in the same way; one, if denoised pictures are judged.
    pub against: Vec<(PathBuf, Option<f64>)>,
    pub by: Judge,
    /// Of EXR files, if the user names one.
    pub layer: Option<String>,
    /// If the user says so.
    pub samples: Option<Samples>,
    pub tone: ToneMapping,
    pub viewing: Viewing,
    pub tile: usize,
    pub threads: Option<NonZeroUsize>,
    pub json: bool,
    pub noise_map: Option<PathBuf>,
    pub frames: Option<Frames>,
    /// Whether the exit code tells.
    pub check: bool,
}

#[derive(Clone)]
pub enum Judge {
    Noise(Box<NoiseJudge>),
    Denoised(DenoisedJudge),
}

#[derive(Clone)]
pub struct NoiseJudge {
    /// Of a model that goes by halves; with a map of visible noise if one is to be drawn.
    pub oracle: Oracle,
    pub audience: Audience,
    pub heat_map: Option<PathBuf>,
    pub exr: Option<PathBuf>,
}

/// What a denoiser has made of each of two halves.
#[derive(Clone)]
pub struct DenoisedJudge {
    pub made: [PathBuf; 2],
    /// JODs that a tile may lose.
    pub lost: f64,
}

impl JudgeJob {
    /// The same of one frame.
    pub(super) fn of_frame(&self, frame: i32) -> Self {
        let mut job = self.clone();
        let pictures = std::iter::once(&mut job.image).chain(&mut job.against).map(|(path, _)| path);
        let by: Vec<&mut PathBuf> = match &mut job.by {
            Judge::Noise(judge) => judge.heat_map.iter_mut().chain(&mut judge.exr).collect(),
            Judge::Denoised(judge) => judge.made.iter_mut().collect(),
        };
        for path in pictures.chain(by).chain(&mut job.noise_map) {
            *path = JobPath(std::mem::take(path)).of_frame(frame).0;
        }
        job
    }
}
