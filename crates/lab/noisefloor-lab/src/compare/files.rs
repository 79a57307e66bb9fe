//! Comparisons on disk.

use super::outcome::{Comparison, CriterionRun, CurvePoint};
use super::page::page;
use super::pictures::Pictures;
use super::plots::{Cost, Plot};
use crate::error::LabError;
use crate::files::{make_folder, write_json, write_text};
use noisefloor_image::write_csv;
use serde::Serialize;
use std::path::Path;

#[derive(Serialize)]
struct CurveRow<'a> {
    scene: &'a str,
    spp: u64,
    source_seconds: f64,
    rel_mse: f64,
    psnr: f64,
    flip: f64,
    flip_worst: f64,
    flip_worst_block: f64,
    flip_bad_block: f64,
    butteraugli: f64,
    butteraugli_worst: f64,
    butteraugli_worst_block: f64,
    cvvdp_jod: f64,
    cvvdp_jod_worst: f64,
    denoised_jod_worst: Option<f64>,
    denoised_seconds: Option<f64>,
}

impl<'a> CurveRow<'a> {
    fn new(scene: &'a str, point: &CurvePoint) -> Self {
        let CurvePoint { spp, source_seconds, quality, denoised_jod_worst, denoised_seconds } = *point;
        Self {
            scene,
            spp,
            source_seconds,
            rel_mse: quality.rel_mse,
            psnr: quality.psnr,
            flip: quality.flip,
            flip_worst: quality.flip_worst,
            flip_worst_block: quality.flip_worst_block,
            flip_bad_block: quality.flip_bad_block,
            butteraugli: quality.butteraugli,
            butteraugli_worst: quality.butteraugli_worst,
            butteraugli_worst_block: quality.butteraugli_worst_block,
            cvvdp_jod: quality.cvvdp_jod,
            cvvdp_jod_worst: quality.cvvdp_jod_worst,
            denoised_jod_worst,
            denoised_seconds,
        }
    }
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
    write_csv(folder.join("curve.csv"), comparison.curve.iter().map(|point| CurveRow::new(scene, point)))?;
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
