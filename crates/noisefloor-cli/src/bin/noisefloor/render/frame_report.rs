//! What a frame of a sequence took, by its report.

use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// One line of frames.csv.
#[derive(Serialize)]
pub(super) struct FrameRow {
    pub(super) frame: i32,
    /// Whether every tile has what it should have.
    pub(super) complete: bool,
    /// Samples per pixel, on average.
    pub(super) spp: f64,
    /// With reading the scene, without writing files.
    pub(super) seconds: f64,
    unfamiliar_tiles: usize,
}

#[derive(Deserialize)]
pub(super) struct FrameReport {
    pub(super) complete: bool,
    width: usize,
    height: usize,
    samples: u64,
    unfamiliar_tiles: usize,
    seconds_before: f64,
    #[serde(default)]
    seconds_setup: Option<f64>,
    seconds_total: Option<f64>,
    pub(super) exposure: Option<f32>,
}

/// What the report in a folder says, if there is one.
pub(super) fn read(out: &Path) -> Option<FrameReport> {
    serde_json::from_reader(BufReader::new(File::open(out.join("report.json")).ok()?)).ok()
}

pub(super) fn row(frame: i32, report: &FrameReport) -> FrameRow {
    let spp = report.samples as f64 / (report.width * report.height).max(1) as f64;
    let this_run = report.seconds_setup.unwrap_or(0.0) + report.seconds_total.unwrap_or(0.0);
    let seconds = report.seconds_before + this_run;
    let FrameReport { complete, unfamiliar_tiles, .. } = *report;
    FrameRow { frame, complete, spp, seconds, unfamiliar_tiles }
}
