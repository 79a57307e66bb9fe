//! Pictures of an evaluation: thresholds of people and of the model over each scene, one against the other,
//! and the reliability curve.

use crate::drawing::{Area, colour, sign, svg};
use crate::error::LabError;
use crate::files::{make_folder, write_text};
use noisefloor::{Rgb, Tile, display::Display};
use noisefloor_image::maps::{Canvas, ColourScale, TileMark, draw_tiles};
use noisefloor_learn::{Corpus, CorpusError, Encoding, Prediction, ReliabilityBin, ThresholdRow};
use plotters::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Where a zone lies in its picture.
type Places = BTreeMap<(String, u32), Tile>;

/// A display-encoded picture, and its width in pixels.
struct Picture {
    width: usize,
    pixels: Vec<Rgb>,
}

/// Edge of the zones, in pixels, where no corpus says where they lie.
const ZONE: usize = 100;
const GREY: Rgb = [0.85; 3];
/// Of the ratio of predicted and human thresholds: beyond, colours are at their end.
const WIDEST_RATIO: f64 = 3.0;

/// Draws thresholds of people and of the model over each scene, with their ratio as colour: (scene, map).
/// `corpus` are the folders that the zones come from, where they are at hand: zones are then drawn over
/// their pictures.
pub(crate) fn map_zones(
    corpus: &[PathBuf],
    predictions: &[Prediction],
) -> Result<Vec<(String, Canvas)>, LabError> {
    let mut scenes: Vec<&str> = predictions.iter().map(|p| p.scene.as_str()).collect();
    scenes.dedup();
    let mut pictures = BTreeMap::new();
    for folder in corpus {
        pictures.extend(pictures_of(folder)?);
    }
    let mut maps = Vec::new();
    for scene in scenes {
        let zones: Vec<&Prediction> = predictions.iter().filter(|p| p.scene == scene).collect();
        let (picture, places) = pictures.remove(scene).unwrap_or_else(|| blank(&zones));
        let marks: Vec<TileMark> = zones.iter().filter_map(|zone| mark(zone, &places)).collect();
        maps.push((
            scene.to_owned(),
            draw_tiles(&Canvas::of_picture(picture.width, &picture.pixels), &marks, &RATIO),
        ));
    }
    Ok(maps)
}

/// Of predicted and human thresholds.
const RATIO: ColourScale = ColourScale {
    title: "people|model\nand ratio",
    low: 1.0 / WIDEST_RATIO,
    high: WIDEST_RATIO,
    log: true,
    colours: colorous::PURPLE_ORANGE,
    landmark: None,
};

fn mark(zone: &Prediction, places: &Places) -> Option<TileMark> {
    Some(TileMark {
        tile: *places.get(&(zone.scene.clone(), zone.zone))?,
        value: zone.predicted_spp / zone.human_spp,
        label: format!("{:.0} | {:.0}", zone.human_spp, zone.predicted_spp),
        unfamiliar: zone.unfamiliar,
        frame: None,
    })
}

/// Writes `zones-SCENE.png` of each scene, `thresholds.svg` and `reliability.svg` into the folder, which
/// is made. `bins` is the reliability curve.
pub fn write_figures(
    folder: &Path,
    corpus: &[PathBuf],
    predictions: &[Prediction],
    bins: &[ReliabilityBin],
) -> Result<(), LabError> {
    make_folder(folder)?;
    for (scene, map) in map_zones(corpus, predictions)? {
        map.save(folder.join(format!("zones-{scene}.png")))?;
    }
    write_text(&folder.join("thresholds.svg"), &svg(SIZE, |root| thresholds(root, predictions))?)?;
    write_text(&folder.join("reliability.svg"), &svg(SIZE, |root| reliability(root, bins))?)?;
    Ok(())
}

/// The most converged picture of each scene of a corpus, put together from its zones, and where these lie.
fn pictures_of(folder: &Path) -> Result<BTreeMap<String, (Picture, Places)>, CorpusError> {
    let corpus = Corpus::open(folder)?;
    let mut found = BTreeMap::new();
    for scene in corpus.scenes() {
        let zones = || corpus.zones().iter().map(|zone| &zone.row).filter(|row| row.scene == scene);
        let width = zones().map(|z| z.x + z.width).max().unwrap_or(1);
        let height = zones().map(|z| z.y + z.height).max().unwrap_or(1);
        let mut pixels = vec![GREY; width * height];
        // Levels come by increasing samples: the last one stays.
        for level in corpus.scene_levels(scene)? {
            let level = level?;
            let Some(zone) = zones().find(|z| z.zone == level.zone) else { continue };
            for (i, pixel) in level.patch.inner_pixels().enumerate() {
                let shown = match level.encoding {
                    Encoding::Display => pixel,
                    Encoding::Linear => Display::SRGB.encode(pixel),
                };
                pixels[(zone.y + i / zone.width) * width + zone.x + i % zone.width] = shown;
            }
        }
        let place = |z: &ThresholdRow| ((z.scene.clone(), z.zone), z.tile());
        found.insert(scene.to_owned(), (Picture { width, pixels }, zones().map(place).collect()));
    }
    Ok(found)
}

/// Zones side by side, row-major, in as square a grid as they make.
fn blank(zones: &[&Prediction]) -> (Picture, Places) {
    let columns = (zones.len() as f64).sqrt().ceil().max(1.0) as usize;
    let rows = zones.len().div_ceil(columns);
    let place = |(i, p): (usize, &&Prediction)| {
        let (x, y) = (i % columns * ZONE, i / columns * ZONE);
        ((p.scene.clone(), p.zone), Tile { index: i, x, y, width: ZONE, height: ZONE })
    };
    let picture = Picture { width: columns * ZONE, pixels: vec![GREY; columns * rows * ZONE * ZONE] };
    (picture, zones.iter().enumerate().map(place).collect())
}

const SIZE: (u32, u32) = (640, 560);
const LETTERS: (&str, u32) = ("sans-serif", 15);

/// Predicted against human thresholds, with lines at half, once and twice.
fn thresholds(root: &Area<'_>, predictions: &[Prediction]) -> Result<(), LabError> {
    let all = predictions.iter().flat_map(|p| [p.human_spp, p.predicted_spp]);
    let (low, high) = all.fold((f64::INFINITY, 1.0f64), |(l, h), v| (l.min(v), h.max(v)));
    let (low, high) = (low.min(high) / 1.3, high * 1.3);
    let mut chart = ChartBuilder::on(root)
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d((low..high).log_scale(), (low..high).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("people, samples per pixel")
        .y_desc("model, samples per pixel")
        .x_label_formatter(&|spp| format!("{spp:.0}"))
        .y_label_formatter(&|spp| format!("{spp:.0}"))
        .label_style(LETTERS)
        .axis_desc_style(LETTERS)
        .light_line_style(WHITE)
        .draw()?;
    for (line, grey) in [
        ([(low, low), (high, high)], 60),
        ([(low, 2.0 * low), (0.5 * high, high)], 170),
        ([(2.0 * low, low), (high, 0.5 * high)], 170),
    ] {
        chart.draw_series(LineSeries::new(line, RGBColor(grey, grey, grey)))?;
    }
    let mut scenes: Vec<&str> = predictions.iter().map(|p| p.scene.as_str()).collect();
    scenes.dedup();
    for (i, scene) in scenes.iter().enumerate() {
        let of_scene = predictions.iter().filter(|p| p.scene == *scene);
        let signs = of_scene.map(|p| sign(i, (p.human_spp, p.predicted_spp), 4, colour(i)));
        let legend = move |(x, y)| sign(i, (x + 10, y), 4, colour(i));
        chart.draw_series(signs)?.label((*scene).to_owned()).legend(legend);
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE.mix(0.85))
        .border_style(RGBColor(200, 200, 200))
        .label_font(LETTERS)
        .draw()?;
    Ok(())
}

/// Observed against predicted probability; the area of a point is its share of the levels.
fn reliability(root: &Area<'_>, bins: &[ReliabilityBin]) -> Result<(), LabError> {
    let mut chart = ChartBuilder::on(root)
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(0.0..1.0, 0.0..1.0)?;
    chart
        .configure_mesh()
        .x_desc("P of the model")
        .y_desc("how often people saw no noise")
        .label_style(LETTERS)
        .axis_desc_style(LETTERS)
        .light_line_style(WHITE)
        .draw()?;
    let diagonal = LineSeries::new([(0.0, 0.0), (1.0, 1.0)], RGBColor(150, 150, 150));
    chart.draw_series(diagonal)?;
    let points = || bins.iter().map(|b| (b.predicted, b.observed));
    chart.draw_series(LineSeries::new(points(), colour(0)))?;
    let levels: usize = bins.iter().map(|b| b.levels).sum();
    let circle = |b: &ReliabilityBin| {
        let radius = 2.0 + 22.0 * (b.levels as f64 / levels as f64).sqrt();
        Circle::new((b.predicted, b.observed), radius.round() as i32, colour(0).mix(0.5).filled())
    };
    chart.draw_series(bins.iter().map(circle))?;
    Ok(())
}
