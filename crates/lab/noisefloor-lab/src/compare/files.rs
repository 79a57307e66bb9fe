//! Comparisons on disk.

use super::denoising::AfterDenoising;
use super::outcome::{Comparison, CriterionRun};
use super::page::page;
use super::pictures::Pictures;
use super::plots::Cost;
use super::race::CurvePoint;
use crate::error::LabError;
use crate::files::{make_folder, write_text};
use noisefloor_image::write_csv;
use serde::Serialize;
use std::path::Path;

/// The first columns of curve.csv.
#[derive(Serialize)]
struct CurveHead<'a> {
    scene: &'a str,
    spp: u64,
    source_seconds: f64,
}

/// The last columns of curve.csv and runs.csv; empty where nothing is denoised.
#[derive(Serialize)]
struct Denoised {
    denoised_jod: Option<f64>,
    denoised_jod_worst: Option<f64>,
    /// All seconds, and those of the denoiser, which denoises once.
    denoised_seconds: Option<f64>,
}

impl Denoised {
    fn new(after: Option<AfterDenoising>, seconds: f64) -> Self {
        Self {
            denoised_jod: after.map(|after| after.jod),
            denoised_jod_worst: after.map(|after| after.jod_worst),
            denoised_seconds: after.map(|after| seconds + after.seconds),
        }
    }
}

/// Writes what there is of one scene into a folder, which is made: curve.csv, tiles.csv, plots,
/// pictures and crops.
pub fn write_scene(
    folder: &Path,
    comparison: &Comparison,
    pictures: &Pictures,
    plots: &[(Cost, String)],
) -> Result<(), LabError> {
    make_folder(folder)?;
    let scene = &comparison.scene;
    let point = |&CurvePoint { spp, source_seconds, quality, denoised }: &CurvePoint| {
        (CurveHead { scene, spp, source_seconds }, quality, Denoised::new(denoised, source_seconds))
    };
    write_csv(folder.join("curve.csv"), comparison.curve.iter().map(point))?;
    write_csv(folder.join("tiles.csv"), &comparison.tiles)?;
    pictures.reference.save(folder.join("reference.png"))?;
    for (spec, canvas) in &pictures.criteria {
        canvas.save(folder.join(format!("{}.png", spec.replace([':', '='], "-"))))?;
    }
    for crop in &pictures.crops {
        crop.sheet.save(folder.join(format!("crop-{}.png", crop.name)))?;
    }
    for (cost, plot) in plots {
        write_text(&folder.join(cost.file_name()), plot)?;
    }
    Ok(())
}

/// Writes index.html and runs.csv of all scenes. `sections` are those of
/// [`section`](super::section), `scenes` the number that there will be.
pub fn write_page(
    folder: &Path,
    all: &[Comparison],
    sections: &[String],
    scenes: usize,
) -> Result<(), LabError> {
    write_text(&folder.join("index.html"), &page(all, sections, scenes))?;
    let runs = all.iter().flat_map(|comparison| &comparison.runs);
    let lines = runs.map(|CriterionRun { taken, quality, against, denoised }| {
        (taken, quality, against, Denoised::new(*denoised, taken.seconds()))
    });
    Ok(write_csv(folder.join("runs.csv"), lines)?)
}
