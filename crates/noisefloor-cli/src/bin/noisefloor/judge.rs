//! `noisefloor judge`.

mod denoised;
mod frames;
mod job;
mod read;
mod report;

pub use job::{DenoisedJudge, Judge, JudgeJob, NoiseJudge};
pub use read::warn_unread;

use crate::output::open_for_colour;
use anyhow::Context;
use noisefloor::{
    Tile, TileGrid, Verdict,
    evidence::{Evidence, Samples},
    stills::{JudgedTiles, SnapshotPair, Still, StillError},
};
use noisefloor_cli::end::ANSWER_IS_NO;
use noisefloor_cli::say::note;
use noisefloor_cli::sources::start_threads;
use noisefloor_image::maps::{Canvas, ColourScale, NOISE_SCALE, TileMark, draw_field, draw_tiles};
use noisefloor_image::{Plane, ReadOptions, RenderLayers, SampleFacts, check_writable, write_exr};
use read::{read, warn_of};
use report::{Judged, Place, Row};
use std::path::Path;
use std::process::ExitCode;

pub fn run(job: &JudgeJob) -> anyhow::Result<ExitCode> {
    start_threads(job.threads)?;
    let is_converged = match &job.frames {
        Some(frames) => {
            let value = if matches!(job.by, Judge::Noise(_)) { "P" } else { "JOD lost" };
            frames::run(frames, value, job.json, |frame| judge(&job.of_frame(frame), false))?
        }
        None => judge(job, true)?.is_converged(),
    };
    Ok(if job.check && !is_converged { ExitCode::from(ANSWER_IS_NO) } else { ExitCode::SUCCESS })
}

/// Judges, and draws what was asked for; `says` all of it.
fn judge(job: &JudgeJob, says: bool) -> anyhow::Result<Judged> {
    match &job.by {
        Judge::Noise(by) => judge_noise(job, by, says),
        Judge::Denoised(by) => denoised::run(job, by, says),
    }
}

fn judge_noise(job: &JudgeJob, by: &NoiseJudge, says: bool) -> anyhow::Result<Judged> {
    for path in [&by.heat_map, &job.noise_map, &by.exr].into_iter().flatten() {
        check_writable(path)?;
    }
    let options = ReadOptions { viewing: job.viewing, layer: job.layer.clone(), ..ReadOptions::default() };
    let read = |picture: &_| read(picture, &options);
    let image = read(&job.image)?;
    let others: Vec<Still> = job.against.iter().map(read).collect::<anyhow::Result<_>>()?;
    for (other, (path, _)) in others.iter().zip(&job.against) {
        let names = || format!("{} against {}", job.image.0.display(), path.display());
        image.fits(other).with_context(names)?;
    }
    let (width, height) = image.size;
    let grid = TileGrid::new(width, height, job.tile)?;

    // Compare the picture with the others, and judge.
    let others: Vec<&Still> = others.iter().collect();
    let held = SnapshotPair::new(Evidence::Halves, &image, &others, job.tone.clone(), job.samples)?
        .seen_on(job.viewing);
    if job.samples.is_none() && held.samples() == Samples::Nested {
        note!(
            "note: the pictures share samples, as snapshots of one rendering do, and are judged as --nested; --independent overrides this"
        );
    }
    let noticed = held.notice(grid)?;
    warn_of(&noticed.warnings);
    let unlike = noticed.unlike;
    let judged = held.judge(&by.oracle, grid, by.audience).map_err(|error| match error {
        StillError::Audience => anyhow::Error::new(error)
            .context("this model cannot judge for other eyes than those it has learned from; --eyes none"),
        error => error.into(),
    })?;
    let rows = rows(grid, image.spp, &judged, &unlike);
    if says {
        report::say_all(&job.image.0, image.spp, &by.oracle, &rows, job.json)?;
    }
    draw(job, by, &image, grid, &held, &judged, &rows)?;
    let place = |row: &Row| {
        let Row { x, y, width, height, probability, .. } = *row;
        (row.converged, Place { x, y, width, height, probability: Some(probability), jods_lost: None })
    };
    Ok(Judged::new(rows.iter().map(place)))
}

/// The verdicts; tiles that are `unlike` in both pictures get none, and count as not converged.
fn rows(grid: TileGrid, spp: f64, judged: &JudgedTiles, unlike: &[bool]) -> Vec<Row> {
    // Of less than one sample, the tile was judged as if it had one: what it needs is in its own samples
    let fewer = spp.min(1.0);
    let samples = |n: u64| (n as f64 * fewer).ceil() as u64;
    let row = |(tile, &verdict): (Tile, &Verdict)| {
        let unlike = unlike[tile.index];
        let verdict = if unlike { Verdict::default() } else { verdict };
        let Verdict { converged, probability, threshold, expected_spp, unfamiliar, open_for, .. } = verdict;
        let Tile { index, x, y, width, height } = tile;
        let probability = probability.unwrap_or(0.0);
        Row {
            tile: index,
            x,
            y,
            width,
            height,
            probability,
            converged,
            threshold: threshold.map(|threshold| threshold.map(samples)),
            expected_spp: expected_spp.map(samples),
            unfamiliar,
            open_for,
            unlike,
        }
    };
    grid.tiles().zip(judged.verdicts()).map(row).collect()
}

fn draw(
    job: &JudgeJob,
    by: &NoiseJudge,
    image: &Still,
    grid: TileGrid,
    held: &SnapshotPair<'_>,
    judged: &JudgedTiles,
    rows: &[Row],
) -> anyhow::Result<()> {
    let width = grid.width();
    let wants_noise = job.noise_map.is_some() || by.exr.is_some();
    let noise = wants_noise.then(|| judged.visible_noise(&by.oracle)).flatten();
    if let (Some(path), Some(noise)) = (&job.noise_map, &noise) {
        draw_field(&Canvas::of_picture(width, &held.shown()), noise, &NOISE_SCALE).save(path)?;
    }
    if let Some(path) = &by.exr {
        write_channels(path, image, grid, rows, noise.as_deref())?;
    }
    if let Some(path) = &by.heat_map {
        let mark = |row: &Row| TileMark {
            tile: grid.tile(row.tile),
            value: f64::from(row.probability),
            label: format!("{:.2}", row.probability),
            unfamiliar: row.unfamiliar,
            frame: row.open_for.and_then(open_for_colour),
        };
        let marks: Vec<TileMark> = rows.iter().map(mark).collect();
        let (title, colours) = ("P(no noise\nis seen)", colorous::CIVIDIS);
        let scale = ColourScale { title, low: 0.0, high: 1.0, log: false, colours, landmark: None };
        draw_tiles(&Canvas::of_picture(width, &held.shown()), &marks, &scale).save(path)?;
    }
    Ok(())
}

fn write_channels(
    path: &Path,
    image: &Still,
    grid: TileGrid,
    rows: &[Row],
    noise: Option<&[f32]>,
) -> anyhow::Result<()> {
    let (width, height) = image.size;
    let probability = |pixel: usize| rows[grid.index_at(pixel % width, pixel / width)].probability;
    let spp = (image.spp.fract() == 0.0 && image.spp < 1e15).then_some(image.spp as u64);
    let facts = SampleFacts { samples: spp.map(|spp| (spp, spp)), origin: image.origin.clone() };
    let layers = RenderLayers {
        probability: Some(Plane::Computed(&probability)),
        visible_noise: noise.map(Plane::from),
        facts: Some(&facts),
        ..RenderLayers::rgb(width, height, &image.pixels)
    };
    Ok(write_exr(path, &layers)?)
}
