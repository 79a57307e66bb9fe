//! The study file as it is written, before anything is checked.

use super::rules::{Participants, Question, Screening, StudyProtocol, Texts};
use crate::viewing::ViewingLimits;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct StudyFile {
    pub(super) protocol: StudyProtocol,
    pub(super) database: PathBuf,
    pub(super) languages: Option<PathBuf>,
    pub(super) tile: Option<usize>,
    pub(super) repeats: Option<u32>,
    pub(super) seed: Option<u64>,
    pub(super) trials: Option<u32>,
    pub(super) interval_ms: Option<u32>,
    pub(super) minutes: Option<u32>,
    pub(super) break_every: Option<u32>,
    #[serde(default)]
    pub(super) groups: Vec<String>,
    #[serde(default)]
    pub(super) participants: Participants,
    #[serde(default)]
    pub(super) screening: Screening,
    #[serde(default)]
    pub(super) viewing: ViewingLimits,
    #[serde(default)]
    pub(super) question: Vec<Question>,
    pub(super) text: BTreeMap<String, Texts>,
    pub(super) stack: Vec<StackEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(super) struct StackEntry {
    pub(super) name: String,
    pub(super) folder: PathBuf,
    #[serde(default)]
    pub(super) renderer: String,
    /// Where each tile stopped: `stops.csv` of `noisefloor render`, or a table with the columns `tile` and
    /// `spp`.
    pub(super) stops: Option<PathBuf>,
    /// Frames per second of a loop: the folder then has a folder of pictures for each frame.
    pub(super) fps: Option<f64>,
}
