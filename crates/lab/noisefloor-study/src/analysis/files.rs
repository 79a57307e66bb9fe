//! An analysis as files: tables, a corpus for `train`, plots, and the grid over the picture.

use super::plots;
use super::report::StudyReport;
use super::tiles::{CorpusThreshold, TileRow};
use crate::config::Study;
use crate::error::StudyError;
use noisefloor_image::{write_atomic, write_csv, write_png};
use noisefloor_learn::ThresholdRow;
use std::fs::{create_dir_all, read_link, remove_file};
use std::io::Write;
use std::path::Path;

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
        write_csv(dir.join("classes.csv"), &report.classes)?;
        page.0 += &table(
            "How often pairs are called identical",
            &["class", "answers", "identical", "95 % interval (Wilson)", "over observers"],
            &report.classes,
            |c| {
                let class = format!("{:?}", c.class).to_lowercase();
                let percent = |share: f64| format!("{:.1} %", 100.0 * share);
                let [wilson, observers] =
                    [(Some(c.wilson_low), Some(c.wilson_high)), (c.observers_low, c.observers_high)].map(
                        |(low, high)| {
                            low.zip(high).map_or("none".to_owned(), |(low, high)| {
                                format!("{} to {}", percent(low), percent(high))
                            })
                        },
                    );
                vec![class, c.answers.to_string(), percent(c.share), wilson, observers]
            },
        );
    }
    if report.tiles.is_empty() {
        return page.write(dir, report);
    }
    write_csv(dir.join("tiles.csv"), &report.tiles)?;
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

/// A section with a table; empty without rows.
fn table<T>(title: &str, columns: &[&str], rows: &[T], cells: impl Fn(&T) -> Vec<String>) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let line = |cell: &str, cells: &[String]| {
        let cells = cells.iter().map(|text| format!("<{cell}>{}</{cell}>", escaped(text)));
        format!("<tr>{}</tr>\n", cells.collect::<String>())
    };
    let head = line("th", &columns.iter().map(|&name| name.to_owned()).collect::<Vec<_>>());
    let rows: String = rows.iter().map(|row| line("td", &cells(row))).collect();
    format!("<section>\n<h2>{title}</h2>\n<table>\n{head}{rows}</table>\n</section>\n")
}

fn spread(report: &StudyReport) -> String {
    table(
        "How far people lie from each other, in ln(samples)",
        &[
            "stack",
            "observers",
            "tiles",
            "people, one place",
            "95 % interval",
            "in all tiles",
            "by tile",
            "by showing",
        ],
        &report.spread,
        |s| {
            let name = s.stack.clone().unwrap_or("all".to_owned());
            let interval =
                s.interval.map_or("none".to_owned(), |[low, high]| format!("{low:.2} to {high:.2}"));
            let of = |deviation: f64| format!("{deviation:.2}");
            let (observers, tiles) = (s.observers.to_string(), s.tiles.to_string());
            vec![name, observers, tiles, of(s.people), interval, of(s.common), of(s.by_place), of(s.within)]
        },
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
            human_spp: t.threshold(threshold).clamp(first_spp.max(1) as f64, last_spp as f64),
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
