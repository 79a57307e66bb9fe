//! An analysis as files: tables, a corpus for `train`, plots, and the grid over the picture.

use super::plots;

use super::report::{ClassRow, StudyReport};
use super::spread::PeopleSpread;
use super::tiles::{CorpusThreshold, TileRow};
use crate::config::Study;
use crate::error::StudyError;
use noisefloor_image::{write_atomic, write_csv, write_png};
use noisefloor_learn::ThresholdRow;
use serde::Serialize;
use std::fs::{create_dir_all, read_link, remove_file};
use std::io::Write;
use std::path::Path;

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

/// Writes `index.html` with all plots, `report.json`, `observers.csv` and, as the protocol has them, `tiles.csv`,
/// `classes.csv`, plots, `grid-STACK.png` and the folder `corpus`, which `noisefloor-lab train --corpus` takes.
/// Loops are not part of that: models are trained on stills, and their thresholds are those of films. What was
/// there is replaced.
pub fn write(
    dir: &Path,
    study: &Study,
    report: &StudyReport,
    threshold: CorpusThreshold,
) -> Result<(), StudyError> {
    folder(dir)?;
    let mut page = Page::default();
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
        page.add("How often pairs are called identical", "classes.svg", "classes.csv");
    }
    if report.tiles.is_empty() {
        return page.write(dir, report);
    }
    write_csv(dir.join("tiles.csv"), report.tiles.iter().map(tile_line))?;
    svg(&dir.join("thresholds.svg"), plots::thresholds(&report.tiles)?)?;
    page.add("Thresholds of the tiles", "thresholds.svg", "tiles.csv");
    // A model keeps the name of the corpus it is trained on.
    let corpus_dir = dir.join(if report.simulated { "corpus-simulated" } else { "corpus" });
    for (number, stack) in study.stacks.iter().enumerate() {
        let tiles: Vec<&TileRow> = report.tiles.iter().filter(|t| t.stack == stack.name()).collect();
        if tiles.is_empty() {
            continue;
        }
        let (name, curves, map) =
            (stack.name(), format!("curves-{}.svg", stack.name()), format!("grid-{}.png", stack.name()));
        svg(&dir.join(&curves), plots::curves(&tiles, stack.levels())?)?;
        let picture = stack.shown(stack.last())?;
        let grid = plots::grid(stack.grid(), &picture, &tiles, threshold);
        grid.save(dir.join(&map))?;
        page.add(&format!("{name}: who sees no difference"), &curves, "tiles.csv");
        let what = if threshold == CorpusThreshold::Mean { "the mean" } else { "the 95 % level" };
        page.add(&format!("{name}: {what} in samples per pixel, as train gets it"), &map, "tiles.csv");
        if stack.fps().is_none() {
            pictures(&corpus_dir, study, number)?;
        }
    }
    corpus(&corpus_dir, study, report, threshold)?;
    page.write(dir, report)
}

/// All plots on one page, which opens without a server.
#[derive(Default)]
struct Page(String);

impl Page {
    /// A plot, and the table that it is of; both are files beside the page.
    fn add(&mut self, title: &str, plot: &str, table: &str) {
        let [title, plot] = [title, plot].map(escaped);
        self.0 += &format!(
            "<section>\n<h2>{title}</h2>\n<img src=\"{plot}\" alt=\"{title}\">\n<p><a href=\"{table}\">{table}</a></p>\n\
             </section>\n"
        );
    }

    fn write(self, dir: &Path, report: &StudyReport) -> Result<(), StudyError> {
        let who = if report.simulated { "simulated observers" } else { "observers" };
        let left = report.observers.iter().filter(|row| row.excluded.is_some()).count();
        let page = format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
             <meta name=\"viewport\" content=\"width=device-width\"><title>noisefloor-lab study analyse</title>\n\
             <style>body {{ font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem }}\n\
             img {{ max-width: 100%; height: auto }}\n\
             img[src$='.png'] {{ width: min(100%, 45rem); image-rendering: pixelated }}\n\
             th, td {{ text-align: left; font-weight: normal; padding: 0 1rem 0 0; vertical-align: top }}\n\
             </style></head>\n<body>\n<h1>{} {who}</h1>\n\
             <p>{left} of them excluded. <a href=\"observers.csv\">observers.csv</a>, \
             <a href=\"report.json\">report.json</a></p>\n{}{}</body></html>\n",
            report.observers.len(),
            spread(report),
            self.0
        );
        Ok(write_atomic(dir.join("index.html"), |to| to.write_all(page.as_bytes()))?)
    }
}

/// The spread of people, as a table.
fn spread(report: &StudyReport) -> String {
    if report.spread.is_empty() {
        return String::new();
    }
    let row = |s: &PeopleSpread| {
        let name = s.stack.as_deref().map_or("all".to_owned(), escaped);
        let interval = s.interval.map_or("none".to_owned(), |[low, high]| format!("{low:.2} to {high:.2}"));
        let PeopleSpread { observers, tiles, people, common, by_place, within, .. } = s;
        format!(
            "<tr><th>{name}</th><td>{observers}</td><td>{tiles}</td><td>{people:.2}</td><td>{interval}</td>\
             <td>{common:.2}</td><td>{by_place:.2}</td><td>{within:.2}</td></tr>\n"
        )
    };
    let rows: String = report.spread.iter().map(row).collect();
    format!(
        "<section>\n<h2>How far people lie from each other, in ln(samples)</h2>\n<table>\n<tr><th>stack</th>\
         <th>observers</th><th>tiles</th><th>people, one place</th><th>95 % interval</th><th>in all tiles</th>\
         <th>by tile</th><th>by showing</th></tr>\n{rows}</table>\n</section>\n"
    )
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}

pub(super) fn folder(dir: &Path) -> Result<(), StudyError> {
    create_dir_all(dir).map_err(|fault| StudyError::at(dir, fault))
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

/// `thresholds.csv` as [`noisefloor_learn::Corpus`] reads it. Thresholds lie within what was offered: one
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
        let TileRow { tile, x, y, width, height, .. } = *t;
        Some(ThresholdRow {
            scene,
            renderer,
            zone: tile as u32,
            x,
            y,
            width,
            height,
            human_spp: spp.clamp(first_spp.max(1) as f64, last_spp as f64),
            first_spp,
            last_spp,
            reference_spp: None,
        })
    };
    Ok(write_csv(dir.join("thresholds.csv"), report.tiles.iter().filter_map(row))?)
}

/// The pictures of a stack in the corpus, as they were shown: a link to its folder, or PNGs where it is
/// tone mapped.
fn pictures(corpus: &Path, study: &Study, number: usize) -> Result<(), StudyError> {
    folder(corpus)?;
    let stack = &study.stacks[number];
    let path = corpus.join(stack.name());
    let io = |fault: std::io::Error| StudyError::at(&path, fault);
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
