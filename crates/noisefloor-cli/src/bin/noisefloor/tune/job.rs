//! What `tune` is to find, and what it notes of each step.

use noisefloor::tune::Search;
use noisefloor::{Audience, Oracle, Viewing};
use noisefloor_cli::folder::Earlier;
use noisefloor_cli::options::tone::Tone;
use noisefloor_cli::sources::{Resources, SourceJob};
use noisefloor_sidecar::Device;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Edge of the tiles in which noise is described: windows are what is judged, whatever the tiles.
pub(super) const TILE: usize = 64;

pub struct TuneJob {
    pub source: SourceJob,
    /// The frames of a sequence that are looked at; none if it is one picture.
    pub frames: Vec<i32>,
    /// Crops that are rendered after the first setting; 0 for the whole picture.
    pub regions: usize,
    pub resources: Resources,
    /// That has not begun.
    pub search: Search,
    /// Most samples per pixel of a picture with a threshold.
    pub most_spp: Option<u64>,
    pub criterion: TuneCriterion,
    pub tone: Tone,
    pub viewing: Viewing,
    pub audience: Audience,
    pub keep: Option<PathBuf>,
    pub earlier: Earlier,
    pub json: bool,
    pub quiet: bool,
}

pub enum TuneCriterion {
    /// The noise of the picture.
    Noise(Box<Oracle>),
    /// What is wrong with the denoised picture, in JODs that its worst square may have lost.
    Denoised { lost: f64, device: Option<Device> },
}

/// One line of the search.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Row {
    /// One picture with it is as good as the mean of the two, if noise follows the setting.
    pub(super) setting: f64,
    /// What each of the two was rendered with.
    pub(super) each: f64,
    /// What is wrong in the worst place, over what may be; null where it cannot be told.
    pub(super) ratio: Option<f64>,
    /// The same of one picture whose threshold is finer by √2, and that below which no finer threshold gets; where the renderer
    /// tells how many samples pixels have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) alone: Option<f64>,
    #[serde(default)]
    pub(super) floor: f64,
    /// The worst place, and the frame of a sequence that has it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) frame: Option<i32>,
    pub(super) x: Option<usize>,
    pub(super) y: Option<usize>,
    /// How many crops stood for the whole; 0 if it was judged itself.
    #[serde(default)]
    pub(super) crops: usize,
    /// Follows from the pictures, so that equal ones are known ([`Excess::pictures`]).
    pub(super) pictures: u64,
    /// For both pictures, of all views that were rendered, and what judging them took.
    pub(super) seconds: f64,
    #[serde(default = "one")]
    pub(super) views: usize,
    pub(super) judging_seconds: f64,
}

fn one() -> usize {
    1
}
