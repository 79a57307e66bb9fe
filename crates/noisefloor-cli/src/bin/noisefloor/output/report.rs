//! report.json.

use super::denoised::DenoisedReport;
use super::tiles::TileState;
use crate::job::RenderJob;
use noisefloor::{
    Params, Session,
    criterion::{ExpectedThreshold, OpenFor},
    driver::Clock,
};
use noisefloor_cli::sources::Source;
use serde::Serialize;
use std::collections::BTreeMap;

/// What is rendered, by what, and how long that took before the samples of this run.
pub struct About {
    pub scene: String,
    pub source: String,
    pub job: RenderJob,
    /// Digest of the model.
    pub model: Option<String>,
    pub seconds_setup: Option<f64>,
    pub seconds_before: f64,
}

impl About {
    pub fn new(scene: String, source: String, job: &RenderJob, model: Option<String>) -> Self {
        Self { scene, source, job: job.clone(), model, seconds_setup: None, seconds_before: 0.0 }
    }
}

/// A run that is over: the time it took, and what counts samples, where that is here.
pub type Over<'a> = (Clock, Option<&'a dyn Source>);

#[derive(Serialize)]
pub(super) struct Report<'a> {
    noisefloor: &'static str,
    scene: &'a str,
    source: &'a str,
    width: usize,
    height: usize,
    seed: u64,
    criterion: String,
    /// BLAKE3 of the model.
    model: Option<&'a str>,
    /// What samples and verdicts depend on ([`noisefloor::Checkpoint::job_digest`]); null for a render that
    /// cannot be resumed.
    job: Option<&'a str>,
    /// What was asked for, as farms keep it.
    render: &'a RenderJob,
    params: &'a Params,
    /// Display exposure that was settled.
    exposure: Option<f32>,
    /// Of the film that it was judged for as a frame, in frames per second; null for a still. Thresholds of people
    /// come from stills in either case.
    judged_for_fps: Option<f64>,
    /// Whether every tile has what it should have: false for a render that was interrupted or ran out of
    /// time, and while it runs.
    complete: bool,
    tiles: usize,
    stops: BTreeMap<String, usize>,
    /// Tiles with texture unlike any that the model has been tried on.
    unfamiliar_tiles: usize,
    /// Tiles that are open, or reached a limit, by what keeps them from being done.
    open_for: BTreeMap<OpenFor, usize>,
    /// Where people are expected to stop seeing noise in the typical tile, in samples per pixel.
    expected_threshold: Option<ExpectedThreshold>,
    /// Share of people who see no noise anywhere in the picture, by the last verdicts on its tiles.
    people_in_picture: Option<f64>,
    samples: u64,
    /// What uniform rendering at the largest stop would take.
    samples_uniform: u64,
    /// Samples kept out by the film because they were not finite.
    samples_rejected: u64,
    /// Samples whose batch had negative luminance.
    samples_negative: u64,
    /// What is likely to be wrong with the samples ([`noisefloor::watch`]).
    warnings: Vec<String>,
    /// Samples that the renderer counted as black because they were not finite.
    samples_dropped: Option<u64>,
    /// Samples that were scaled down to `--clamp`.
    samples_clamped: Option<u64>,
    /// Samples of tiles that see nothing but the background: no ray was traced for them.
    samples_background: Option<u64>,
    /// Of the ray-traced reference, if the criterion asked for one: samples of a pixel, and the deviation
    /// of its noise mask as it estimates it, over all blocks and in the worst.
    reference_samples: Option<f64>,
    reference_deviation: Option<f32>,
    reference_worst: Option<f32>,
    /// Of the runs that this one resumes (`--resume`); the others are this run's.
    seconds_before: f64,
    /// Before the first sample: to read the scene, and to prepare it. Not part of the total.
    seconds_setup: Option<f64>,
    seconds_source: Option<f64>,
    seconds_oracle: Option<f64>,
    seconds_total: Option<f64>,
    pub(super) rel_mse: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) denoised: Option<DenoisedReport>,
}

impl<'a> Report<'a> {
    /// What is known now; with the time it took and what became of the samples when the run is over.
    pub(super) fn new(
        about: &'a About,
        session: &'a Session,
        tiles: &[TileState],
        job: Option<&'a str>,
        over: Option<Over<'_>>,
    ) -> Self {
        let (clock, source) = over.unzip();
        let source = source.flatten();
        let counts = source.and_then(|source| source.counts());
        let noise = source.and_then(|source| source.reference_noise());
        let grid = session.film().grid();
        let mut stops = BTreeMap::new();
        for tile in tiles {
            *stops.entry(tile.reason()).or_insert(0) += 1;
        }
        Self {
            noisefloor: env!("CARGO_PKG_VERSION"),
            scene: &about.scene,
            source: &about.source,
            width: grid.width(),
            height: grid.height(),
            seed: about.job.source.seed,
            criterion: session.criterion().name(),
            model: about.model.as_deref(),
            job,
            render: &about.job,
            params: session.params(),
            exposure: session.display().map(noisefloor::display::Display::exposure),
            judged_for_fps: session.params().viewing.frames_per_second(),
            complete: clock.is_some() && tiles.iter().all(TileState::is_final),
            tiles: tiles.len(),
            stops,
            unfamiliar_tiles: tiles.iter().filter(|tile| tile.stop.unfamiliar).count(),
            open_for: open_for(session),
            expected_threshold: typical_threshold(session),
            people_in_picture: session.share_in_picture(),
            samples: session.film().total_samples(),
            samples_uniform: uniform_samples(session),
            samples_rejected: session.film().rejected(),
            samples_negative: session.negative_samples(),
            warnings: session.warnings().iter().map(ToString::to_string).collect(),
            samples_dropped: counts.map(|c| c.dropped),
            samples_clamped: counts.map(|c| c.clamped),
            samples_background: counts.map(|c| c.background),
            reference_samples: noise.map(|n| n.samples),
            reference_deviation: noise.map(|n| n.deviation()),
            reference_worst: noise.map(|n| n.worst()),
            seconds_before: about.seconds_before,
            seconds_setup: about.seconds_setup,
            seconds_source: clock.map(|c| c.source_seconds),
            seconds_oracle: clock.map(|c| c.criterion_seconds),
            seconds_total: clock.map(|c| c.total_seconds),
            rel_mse: None,
            denoised: None,
        }
    }
}

/// Where people are expected to stop seeing noise in the typical tile: that of median need. `None` if the
/// criterion does not say.
pub(super) fn typical_threshold(session: &Session) -> Option<ExpectedThreshold> {
    let tiles = 0..session.film().grid().len();
    let mut thresholds: Vec<ExpectedThreshold> =
        tiles.filter_map(|tile| session.verdict(tile)?.threshold).collect();
    thresholds.sort_by_key(|threshold| threshold.median);
    thresholds.get(thresholds.len() / 2).copied()
}

/// How many tiles are open, or reached a limit, for what.
pub(super) fn open_for(session: &Session) -> BTreeMap<OpenFor, usize> {
    let mut counts = BTreeMap::new();
    for why in (0..session.film().grid().len()).filter_map(|tile| session.open_for(tile)) {
        *counts.entry(why).or_insert(0) += 1;
    }
    counts
}

/// Samples that uniform rendering at the largest stop would take, over all pixels.
pub(super) fn uniform_samples(session: &Session) -> u64 {
    let grid = session.film().grid();
    let most = (0..grid.len()).map(|t| session.film().spp(t)).max().unwrap_or(0);
    most * (grid.width() * grid.height()) as u64
}
