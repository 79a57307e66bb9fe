//! Comparisons on disk.

use super::outcome::{Comparison, CriterionRun, CurvePoint};
use super::page::page;
use super::pictures::Pictures;
use super::plots::{Cost, Plot};
use super::quality::Quality;
use crate::error::LabError;
use crate::files::{make_folder, write_json, write_text};
use noisefloor_image::write_csv;
use serde::Serialize;
use std::path::Path;

#[derive(Serialize)]
struct CurveHead<'a> {
    scene: &'a str,
    spp: u64,
    source_seconds: f64,
}

#[derive(Serialize)]
struct CurveTail {
    denoised_jod_worst: Option<f64>,
    denoised_seconds: Option<f64>,
}

/// A line of curve.csv.
fn curve_line<'a>(scene: &'a str, point: &CurvePoint) -> (CurveHead<'a>, Quality, CurveTail) {
    let CurvePoint { spp, source_seconds, quality, denoised_jod_worst, denoised_seconds } = *point;
    (CurveHead { scene, spp, source_seconds }, quality, CurveTail { denoised_jod_worst, denoised_seconds })
}

/// Writes what there is of one scene into a folder, which is made: curve.csv, tiles.csv, plots (SVG and
/// PNG), pictures and crops.
pub fn write_scene(
    folder: &Path,
    comparison: &Comparison,
    pictures: &Pictures,
    plots: &[(Cost, Plot)],
) -> Result<(), LabError> {
    make_folder(folder)?;
    let scene = &comparison.scene;
    write_csv(folder.join("curve.csv"), comparison.curve.iter().map(|point| curve_line(scene, point)))?;
    write_csv(folder.join("tiles.csv"), &comparison.tiles)?;
    pictures.reference.save(folder.join("reference.png"))?;
    for (spec, canvas) in &pictures.criteria {
        canvas.save(folder.join(format!("{}.png", spec.replace([':', '='], "-"))))?;
    }
    for crop in &pictures.crops {
        crop.sheet.save(folder.join(format!("crop-{}.png", crop.name)))?;
    }
    for (cost, plot) in plots {
        let path = folder.join(cost.name());
        write_text(&path.with_extension("svg"), &plot.svg)?;
        plot.canvas.save(path.with_extension("png"))?;
    }
    Ok(())
}

/// Writes index.html, runs.csv and runs.json of all scenes. `sections` are those of
/// [`section`](super::section), `scenes` the number that there will be.
pub fn write_page(
    folder: &Path,
    all: &[Comparison],
    sections: &[String],
    scenes: usize,
) -> Result<(), LabError> {
    let runs: Vec<&CriterionRun> = all.iter().flat_map(|comparison| &comparison.runs).collect();
    write_text(&folder.join("index.html"), &page(all, sections, scenes))?;
    write_csv(folder.join("runs.csv"), &runs)?;
    write_json(&folder.join("runs.json"), &runs)?;
    Ok(())
}
