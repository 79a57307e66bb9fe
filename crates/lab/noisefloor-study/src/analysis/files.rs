//! An analysis as files: tables, a corpus for `train`, plots, and the grid over the picture.

use super::plots;
use super::report::ClassRow;
use super::report::StudyReport;
use super::tiles::{CorpusThreshold, TileRow};
use crate::config::Study;
use crate::error::StudyError;
use noisefloor_image::{write_atomic, write_csv, write_png};
use serde::Serialize;
use std::fs::{create_dir_all, read_link, remove_file};
use std::io::Write;
use std::path::Path;

#[derive(Serialize)]
struct CorpusRow {
    scene: String,
    renderer: String,
    zone: usize,
    x: usize,
    y: usize,
    width: usize,
    height: usize,
    human_spp: f64,
    first_spp: u64,
    last_spp: u64,
}

#[derive(Serialize)]
struct TileLine<'a> {
    stack: &'a str,
    tile: usize,
    x: usize,
    y: usize,
    width: usize,
    height: usize,
    observers: usize,
    mean: f64,
    mean_low: Option<f64>,
    mean_high: Option<f64>,
    median: f64,
    median_low: Option<f64>,
    median_high: Option<f64>,
    quartiles: f64,
    level95: f64,
    level95_low: Option<f64>,
    level95_high: Option<f64>,
    beyond: bool,
    fit_probability: Option<f64>,
}

#[derive(Serialize)]
struct ClassLine {
    class: String,
    identical: usize,
    answers: usize,
    share: f64,
    wilson_low: f64,
    wilson_high: f64,
    observers_low: Option<f64>,
    observers_high: Option<f64>,
}

/// Writes `report.json`, `observers.csv` and, as the protocol has them, `tiles.csv`, `classes.csv`, plots,
/// `grid-STACK.png` and the folder `corpus`, which `noisefloor-lab train --corpus` takes. Loops are not part
/// of that: models are trained on stills, and their thresholds are those of films. What was there is
/// replaced.
///
/// # Errors
/// [`StudyError`] if a file cannot be written, or a picture not be read.
pub fn write(
    dir: &Path,
    study: &Study,
    report: &StudyReport,
    threshold: CorpusThreshold,
) -> Result<(), StudyError> {
    folder(dir)?;
    write_atomic(dir.join("report.json"), |to| serde_json::to_writer_pretty(to, report))?;
    write_csv(dir.join("observers.csv"), &report.observers)?;
    if !report.classes.is_empty() {
        let line = |row: &ClassRow| ClassLine {
            class: format!("{:?}", row.class).to_lowercase(),
            identical: row.identical.yes,
            answers: row.identical.of,
            share: row.identical.share,
            wilson_low: row.identical.wilson[0],
            wilson_high: row.identical.wilson[1],
            observers_low: row.observers_interval.map(|i| i[0]),
            observers_high: row.observers_interval.map(|i| i[1]),
        };
        write_csv(dir.join("classes.csv"), report.classes.iter().map(line))?;
        svg(&dir.join("classes.svg"), plots::classes(&report.classes)?)?;
    }
    if report.tiles.is_empty() {
        return Ok(());
    }
    write_csv(dir.join("tiles.csv"), report.tiles.iter().map(tile_line))?;
    svg(&dir.join("thresholds.svg"), plots::thresholds(&report.tiles)?)?;
    // A model keeps the name of the corpus it is trained on.
    let corpus_dir = dir.join(if report.simulated { "corpus-simulated" } else { "corpus" });
    for (number, stack) in study.stacks.iter().enumerate() {
        let tiles: Vec<&TileRow> = report.tiles.iter().filter(|t| t.stack == stack.name()).collect();
        if tiles.is_empty() {
            continue;
        }
        svg(&dir.join(format!("curves-{}.svg", stack.name())), plots::curves(&tiles, stack.levels())?)?;
        let picture = stack.shown(stack.last())?;
        let grid = plots::grid(stack.grid(), &picture, &tiles, threshold);
        grid.save(dir.join(format!("grid-{}.png", stack.name())))?;
        if stack.fps().is_none() {
            pictures(&corpus_dir, study, number)?;
        }
    }
    corpus(&corpus_dir, study, report, threshold)
}

fn folder(dir: &Path) -> Result<(), StudyError> {
    create_dir_all(dir).map_err(|source| StudyError::Io { path: dir.to_owned(), source })
}

fn svg(path: &Path, text: String) -> Result<(), StudyError> {
    Ok(write_atomic(path, |to| to.write_all(text.as_bytes()))?)
}

fn tile_line(t: &TileRow) -> TileLine<'_> {
    let end = |interval: Option<[f64; 2]>, i: usize| interval.map(|ends| ends[i]);
    TileLine {
        stack: &t.stack,
        tile: t.tile,
        x: t.x,
        y: t.y,
        width: t.width,
        height: t.height,
        observers: t.observers,
        mean: t.mean,
        mean_low: end(t.mean_interval, 0),
        mean_high: end(t.mean_interval, 1),
        median: t.median,
        median_low: end(t.median_interval, 0),
        median_high: end(t.median_interval, 1),
        quartiles: t.quartiles,
        level95: t.level95,
        level95_low: end(t.level95_interval, 0),
        level95_high: end(t.level95_interval, 1),
        beyond: t.beyond,
        fit_probability: t.fit_probability,
    }
}

/// `thresholds.csv` as `noisefloor_image::corpus` reads it. Thresholds lie within what was offered: one
/// beyond is then taken for a lower bound.
fn corpus(
    dir: &Path,
    study: &Study,
    report: &StudyReport,
    threshold: CorpusThreshold,
) -> Result<(), StudyError> {
    folder(dir)?;
    let row = |t: &TileRow| {
        let stack = study.stacks.iter().find(|s| s.name() == t.stack && s.fps().is_none())?;
        let (first_spp, last_spp) = (stack.levels()[0], stack.levels()[stack.last() as usize]);
        let spp = match threshold {
            CorpusThreshold::Level95 => t.level95,
            CorpusThreshold::Mean => t.mean,
        };
        let (scene, renderer) = (t.stack.clone(), stack.renderer().to_owned());
        let TileRow { tile: zone, x, y, width, height, .. } = *t;
        let human_spp = spp.clamp(first_spp.max(1) as f64, last_spp as f64);
        Some(CorpusRow { scene, renderer, zone, x, y, width, height, human_spp, first_spp, last_spp })
    };
    Ok(write_csv(dir.join("thresholds.csv"), report.tiles.iter().filter_map(row))?)
}

/// The pictures of a stack in the corpus, as they were shown: a link to its folder, or PNGs where it is
/// tone mapped.
fn pictures(corpus: &Path, study: &Study, number: usize) -> Result<(), StudyError> {
    folder(corpus)?;
    let stack = &study.stacks[number];
    let path = corpus.join(stack.name());
    let io = |source| StudyError::Io { path: path.clone(), source };
    // An earlier link goes first: nothing may be written through it
    if read_link(&path).is_ok() {
        remove_file(&path).map_err(io)?;
    }
    #[cfg(unix)]
    if !stack.is_tone_mapped() && !path.exists() {
        let target = std::fs::canonicalize(stack.folder()).map_err(io)?;
        return std::os::unix::fs::symlink(target, &path).map_err(io);
    }
    folder(&path)?;
    for (level, spp) in stack.levels().iter().enumerate() {
        let shown = stack.shown(level as u32)?;
        let grid = stack.grid();
        write_png(path.join(format!("{spp:05}.png")), grid.width(), grid.height(), &shown)?;
    }
    Ok(())
}
