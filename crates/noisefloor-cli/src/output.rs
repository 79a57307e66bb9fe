//! The files that `render` writes.

use crate::args::RenderArgs;
use crate::sources::Source;
use anyhow::{Context, bail};
use noisefloor::{
    Checkpoint, Clock, Display, Params, Progress, Rgb, Session, Stop, StopReason, StoppingCriterion,
};
use noisefloor_image::maps::{self, ColourScale, TileMark};
use noisefloor_image::{RenderLayers, check_writable, read_exr, write_atomic, write_exr, write_png};
use noisefloor_ptwne::ReferenceNoise;
use noisefloor_rivals::metrics::relative_mse;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};

/// A picture to compare a render of that size with: linear radiance, row-major, all of it finite.
pub fn read_reference(path: &Path, (width, height): (usize, usize)) -> anyhow::Result<Vec<Rgb>> {
    let image = read_exr(path)?;
    if (image.width, image.height) != (width, height) {
        let (w, h) = (image.width, image.height);
        bail!("{} has {w}×{h} pixels, the render {width}×{height}: set --size {w}x{h}", path.display());
    }
    if !image.pixels.iter().flatten().all(|c| c.is_finite()) {
        bail!("{} has pixels that are not finite: it cannot be compared with", path.display());
    }
    Ok(image.pixels)
}

/// One line of timeline.csv.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct TimelineRow {
    seconds: f64,
    samples: u64,
    active_tiles: usize,
    rel_mse: Option<f64>,
}

/// One line of stops.csv. A tile that is still open has the reason `open`.
#[derive(Serialize)]
struct StopRow {
    tile: usize,
    x: usize,
    y: usize,
    width: usize,
    height: usize,
    spp: u64,
    probability: Option<f32>,
    reason: String,
    unfamiliar: bool,
}

/// report.json.
#[derive(Serialize)]
struct Report<'a> {
    noisefloor: &'static str,
    scene: &'a str,
    /// Who rendered.
    source: &'a str,
    width: usize,
    height: usize,
    seed: u64,
    criterion: String,
    /// BLAKE3 of the model.
    model: Option<&'a str>,
    params: &'a Params,
    /// Display exposure that was settled.
    exposure: Option<f32>,
    complete: bool,
    tiles: usize,
    stops: BTreeMap<String, usize>,
    /// Tiles with texture unlike any that the model has been tried on.
    unfamiliar_tiles: usize,
    /// Over all pixels.
    samples: u64,
    /// What uniform rendering at the largest stop would take.
    samples_uniform: u64,
    /// Samples kept out by the film because they were not finite.
    samples_rejected: u64,
    /// Samples that the renderer counted as black because they were not finite.
    samples_dropped: Option<u64>,
    /// Samples that were scaled down to `--clamp`.
    samples_clamped: Option<u64>,
    /// Samples of tiles that see nothing but the background: no ray was traced for them.
    samples_background: Option<u64>,
    /// Of the ray-traced reference, if the criterion asked for one: samples of a pixel, and the deviation of its noise mask as it
    /// estimates it, over all blocks and in the worst.
    reference_samples: Option<f64>,
    reference_deviation: Option<f32>,
    reference_worst: Option<f32>,
    /// Of the runs that this one goes on with (`--resume`); the others are this run's.
    seconds_before: f64,
    seconds_source: Option<f64>,
    seconds_oracle: Option<f64>,
    seconds_total: Option<f64>,
    rel_mse: Option<f64>,
}

/// What reports say of a model.
pub struct ModelFacts {
    /// BLAKE3 of the model.
    pub digest: String,
    /// Visible noise from which it is seen.
    pub just_visible: Option<f32>,
}

/// The output folder, and what has been recorded for it.
pub struct Output {
    folder: PathBuf,
    scene: String,
    source: String,
    seed: u64,
    model: Option<ModelFacts>,
    reference: Option<Vec<Rgb>>,
    timeline: Vec<TimelineRow>,
    /// Whether there are checkpoints to resume from.
    resumable: bool,
    seconds_before: f64,
}

/// What a render that was broken off goes on from, in its output folder.
const CHECKPOINT: &str = "checkpoint.nfc";

impl Output {
    /// Makes the folder, and makes sure that files can be written before hours are spent.
    pub fn create(
        args: &RenderArgs,
        scene: String,
        source: String,
        model: Option<ModelFacts>,
        reference: Option<Vec<Rgb>>,
        resumable: bool,
    ) -> anyhow::Result<Self> {
        let folder = args.out.clone().unwrap_or_else(|| Path::new("out").join(&scene));
        std::fs::create_dir_all(&folder).with_context(|| {
            format!("{}: cannot make this folder; choose another with --out", folder.display())
        })?;
        check_writable(folder.join("image.exr"))?;
        let (seed, timeline) = (args.renderer.seed, Vec::new());
        Ok(Self { folder, scene, source, seed, model, reference, timeline, resumable, seconds_before: 0.0 })
    }

    /// The output folder, for people.
    pub fn folder(&self) -> impl std::fmt::Display + '_ {
        self.folder.display()
    }

    /// The file of the checkpoint, for people.
    pub fn checkpoint_file(&self) -> String {
        self.folder.join(CHECKPOINT).display().to_string()
    }

    /// The checkpoint in the folder, if there is one.
    pub fn checkpoint(&self) -> anyhow::Result<Option<Checkpoint<'static>>> {
        let file = match File::open(self.folder.join(CHECKPOINT)) {
            Ok(file) => file,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error).with_context(|| self.checkpoint_file()),
        };
        let checkpoint = Checkpoint::read(BufReader::new(file))
            .with_context(|| format!("{}: remove it to begin anew", self.checkpoint_file()))?;
        Ok(Some(checkpoint))
    }

    /// Takes up the history of the render that is gone on with, up to so many samples. If it cannot be read, that is no reason to throw
    /// samples away.
    pub fn take_up(&mut self, samples: u64) {
        let rows =
            csv::Reader::from_path(self.folder.join("timeline.csv")).map(csv::Reader::into_deserialize);
        let rows = rows.into_iter().flatten().map_while(Result::ok);
        self.timeline = rows.take_while(|row: &TimelineRow| row.samples <= samples).collect();
        self.seconds_before = self.timeline.last().map_or(0.0, |row| row.seconds);
    }

    /// Writes the checkpoint of a render that is not done, and removes that of one that is.
    fn write_checkpoint<C>(
        &self,
        session: &Session<C>,
        checkpoint: Option<Checkpoint<'_>>,
    ) -> anyhow::Result<()>
    where
        C: StoppingCriterion,
    {
        let Some(checkpoint) = checkpoint else { return Ok(()) };
        let path = self.folder.join(CHECKPOINT);
        let done = |stop: Stop| matches!(stop.reason, StopReason::Converged | StopReason::MaxSpp);
        if !session.is_done() || !session.stops().all(done) {
            return Ok(write_atomic(path, |to| checkpoint.write(to))?);
        }
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                Err(error).with_context(|| self.checkpoint_file())
            }
            _ => Ok(()),
        }
    }

    /// Notes one batch.
    pub fn record<C: StoppingCriterion>(&mut self, session: &Session<C>, progress: &Progress) {
        let rel_mse = self
            .reference
            .as_ref()
            .and_then(|reference| relative_mse(&session.film().image(), reference).ok());
        let noisefloor::TimelinePoint { seconds, samples, active_tiles } = progress.now;
        let seconds = self.seconds_before + seconds;
        self.timeline.push(TimelineRow { seconds, samples, active_tiles, rel_mse });
    }

    /// Writes every file; with the time it took and what became of the samples when the run is over.
    pub fn write<C: StoppingCriterion>(
        &self,
        session: &Session<C>,
        checkpoint: Option<Checkpoint<'_>>,
        over: Option<(Clock, &dyn Source)>,
    ) -> anyhow::Result<()> {
        let film = session.film();
        let (width, height) = (film.grid().width(), film.grid().height());
        let image = film.image();
        let tiles = tile_states(session);

        // image.exr: what each pixel's tile knows, as channels.
        let mut spp = vec![0u32; image.len()];
        let mut probability = vec![f32::NAN; image.len()];
        let mut stopped = vec![false; image.len()];
        for (stop, open) in &tiles {
            for pixel in stop.tile.rows(width).flatten() {
                spp[pixel] = u32::try_from(stop.spp).unwrap_or(u32::MAX);
                probability[pixel] = stop.probability.unwrap_or(f32::NAN);
                stopped[pixel] = !open;
            }
        }
        let noise = session.visible_noise();
        let layers = RenderLayers {
            spp: Some(&spp),
            probability: Some(&probability),
            stopped: Some(&stopped),
            visible_noise: noise.as_deref(),
            ..RenderLayers::rgb(width, height, &image)
        };
        write_exr(self.folder.join("image.exr"), &layers)?;

        // image.png, stops.png and noise.png: as the oracle saw it.
        let display =
            session.display().copied().unwrap_or_else(|| session.params().tone_mapping.settle(&image));
        let encoded: Vec<Rgb> = image.iter().map(|&p| display.encode(p)).collect();
        write_png(self.folder.join("image.png"), width, height, &maps::display_bytes(&encoded))?;
        let map = maps::draw_tiles(width, &encoded, &marks(&tiles), &scale(&tiles));
        map.save(self.folder.join("stops.png"))?;
        if let Some(noise) = &noise {
            let scale = maps::noise_scale(self.model.as_ref().and_then(|m| m.just_visible));
            let map = maps::draw_field(width, &encoded, noise, &scale);
            map.save(self.folder.join("noise.png"))?;
        }

        self.write_stops(&tiles)?;
        self.write_timeline()?;
        self.write_checkpoint(session, checkpoint)?;
        self.write_report(session, &tiles, &display, over)
    }

    fn write_stops(&self, tiles: &[(Stop, bool)]) -> anyhow::Result<()> {
        write_csv(
            &self.folder.join("stops.csv"),
            tiles.iter().map(|(stop, open)| {
                let noisefloor::Tile { index, x, y, width, height } = stop.tile;
                let reason = if *open { "open".into() } else { stop.reason.to_string() };
                StopRow {
                    tile: index,
                    x,
                    y,
                    width,
                    height,
                    spp: stop.spp,
                    probability: stop.probability,
                    reason,
                    unfamiliar: stop.unfamiliar,
                }
            }),
        )
    }

    fn write_timeline(&self) -> anyhow::Result<()> {
        write_csv(&self.folder.join("timeline.csv"), self.timeline.iter())
    }

    fn write_report<C: StoppingCriterion>(
        &self,
        session: &Session<C>,
        tiles: &[(Stop, bool)],
        display: &Display,
        over: Option<(Clock, &dyn Source)>,
    ) -> anyhow::Result<()> {
        let (clock, source) = over.unzip();
        let counts = source.and_then(|source| source.counts());
        let noise = source.and_then(|source| source.reference_noise());
        let grid = session.film().grid();
        let mut stops = BTreeMap::new();
        for (stop, open) in tiles {
            *stops.entry(if *open { "open".to_owned() } else { stop.reason.to_string() }).or_insert(0) += 1;
        }
        let report = Report {
            noisefloor: env!("CARGO_PKG_VERSION"),
            scene: &self.scene,
            source: &self.source,
            width: grid.width(),
            height: grid.height(),
            seed: self.seed,
            criterion: session.criterion().name(),
            model: self.model.as_ref().map(|m| m.digest.as_str()),
            params: session.params(),
            exposure: session.display().map(|_| display.exposure()),
            complete: clock.is_some() && tiles.iter().all(|(_, open)| !open),
            tiles: tiles.len(),
            stops,
            unfamiliar_tiles: tiles.iter().filter(|(stop, _)| stop.unfamiliar).count(),
            samples: session.film().total_samples(),
            samples_uniform: uniform_samples(session),
            samples_rejected: session.film().rejected(),
            samples_dropped: counts.map(|c| c.dropped),
            samples_clamped: counts.map(|c| c.clamped),
            samples_background: counts.map(|c| c.background),
            reference_samples: noise.map(|n| n.samples),
            reference_deviation: noise.map(|n| n.deviation()),
            reference_worst: noise.map(|n| n.worst()),
            seconds_before: self.seconds_before,
            seconds_source: clock.map(|c| c.source_seconds),
            seconds_oracle: clock.map(|c| c.criterion_seconds),
            seconds_total: clock.map(|c| c.total_seconds),
            rel_mse: self.timeline.last().and_then(|row| row.rel_mse),
        };
        write_json(&self.folder.join("report.json"), &report)
    }

    /// A few lines for people.
    pub fn summarise<C: StoppingCriterion>(&self, session: &Session<C>, clock: Clock, source: &dyn Source) {
        let counts = source.counts();
        let film = session.film();
        let spp: Vec<u64> = session.stops().map(|s| s.spp).collect();
        let converged = session.stops().filter(|s| s.reason == StopReason::Converged).count();
        let (least, most) = (spp.iter().min().unwrap_or(&0), spp.iter().max().unwrap_or(&0));
        let pixels = (film.grid().width() * film.grid().height()) as f64;
        let share = film.total_samples() as f64 / uniform_samples(session).max(1) as f64;
        println!(
            "{converged} of {} tiles converged, after {least} to {most} samples per pixel ({:.0} on average: {:.0} % of uniform \
             rendering at {most})",
            spp.len(),
            film.total_samples() as f64 / pixels,
            100.0 * share,
        );
        let unfamiliar = session.stops().filter(|s| s.unfamiliar).count();
        if unfamiliar > 0 {
            println!(
                "{unfamiliar} tiles have texture unlike any the model was tried on: they got twice the samples it asks for, and their \
                 verdicts are less certain"
            );
        }
        println!(
            "{:.1} s, of which {:.2} s ({:.2} %) in the oracle",
            clock.total_seconds,
            clock.criterion_seconds,
            100.0 * clock.criterion_seconds / clock.total_seconds.max(1e-9),
        );
        for (count, what) in [
            (film.rejected(), "were not finite and were kept out"),
            (counts.map_or(0, |c| c.dropped), "were not finite and counted as black"),
            (counts.map_or(0, |c| c.clamped), "were brighter than --clamp and scaled down"),
        ] {
            if count > 0 {
                println!("{count} samples {what}");
            }
        }
        if let Some(noise) = source.reference_noise() {
            say_noise(noise);
        }
        println!("written to {}", self.folder.display());
        // One that is not of this render may lie there too
        if self.resumable && self.folder.join(CHECKPOINT).exists() {
            println!("the same command with --resume goes on from there");
        }
    }
}

/// What a reference is like, for people.
pub fn say_noise(noise: &ReferenceNoise) {
    println!(
        "the reference took {:.0} samples a pixel; deviation of its noise mask {:.2}/255, {:.2}/255 in its worst block",
        noise.samples,
        255.0 * noise.deviation(),
        255.0 * noise.worst(),
    );
    if noise.unsettled > 0 {
        println!(
            "warning: {} of {} blocks of the reference are noisier than it promises: tiles there may be stopped too late; \
             a model trained on half buffers needs no reference",
            noise.unsettled,
            noise.deviations.len()
        );
    }
}

fn uniform_samples<C: StoppingCriterion>(session: &Session<C>) -> u64 {
    let grid = session.film().grid();
    let most = (0..grid.len()).map(|t| session.film().spp(t)).max().unwrap_or(0);
    most * (grid.width() * grid.height()) as u64
}

/// Each tile's stop, or its state now and `true` if it is still open.
fn tile_states<C: StoppingCriterion>(session: &Session<C>) -> Vec<(Stop, bool)> {
    let stops: BTreeMap<usize, Stop> = session.stops().map(|s| (s.tile.index, s)).collect();
    let state = |tile: noisefloor::Tile| match stops.get(&tile.index) {
        Some(&stop) => (stop, false),
        None => {
            let verdict = session.verdict(tile.index);
            let stop = Stop {
                tile,
                spp: session.film().spp(tile.index),
                probability: verdict.and_then(|v| v.probability),
                reason: StopReason::Cancelled,
                unfamiliar: verdict.is_some_and(|v| v.unfamiliar),
            };
            (stop, true)
        }
    };
    session.film().grid().tiles().map(state).collect()
}

fn marks(tiles: &[(Stop, bool)]) -> Vec<TileMark> {
    let label = |stop: &Stop, open: bool| format!("{}{}", stop.spp, if open { "+" } else { "" });
    let mark = |(stop, open): &(Stop, bool)| TileMark {
        tile: stop.tile,
        value: stop.spp as f64,
        label: label(stop, *open),
        unfamiliar: stop.unfamiliar,
    };
    tiles.iter().map(mark).collect()
}

fn scale(tiles: &[(Stop, bool)]) -> ColourScale {
    let spp = || tiles.iter().map(|(stop, _)| stop.spp.max(1) as f64);
    let (low, high) = (spp().fold(f64::INFINITY, f64::min), spp().fold(1.0, f64::max));
    ColourScale {
        title: "samples\nper pixel",
        low,
        high,
        log: true,
        colours: colorous::VIRIDIS,
        landmark: None,
    }
}

/// Writes rows as CSV, atomically.
pub fn write_csv<T: Serialize>(path: &Path, rows: impl Iterator<Item = T>) -> anyhow::Result<()> {
    write_atomic(path, |to| {
        let mut csv = csv::Writer::from_writer(to);
        for row in rows {
            csv.serialize(row)?;
        }
        csv.flush().map_err(csv::Error::from)
    })?;
    Ok(())
}

/// Writes JSON, atomically.
pub fn write_json(path: &Path, value: &impl Serialize) -> anyhow::Result<()> {
    write_atomic(path, |to| serde_json::to_writer_pretty(to, value))?;
    Ok(())
}
