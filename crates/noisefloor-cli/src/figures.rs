//! Pictures of an evaluation: thresholds of people and of the model over each scene, one against the other, and the reliability
//! curve.

use crate::heat_map::{self, Mark, Scale};
use anyhow::Context;
use noisefloor::{Display, Rgb, Tile};
use noisefloor_image::{write_atomic, write_png};
use noisefloor_learn::{Corpus, Encoding};
use noisefloor_learn::{Prediction, ReliabilityBin};
use plotters::prelude::*;
use std::collections::BTreeMap;
use std::fs::create_dir_all;
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

/// Writes `zones-SCENE.png`, `thresholds.svg` and `reliability.svg` into the folder. `corpus` are the folders that the zones come
/// from, where they are at hand: zones are then drawn over their pictures. `bins` is the reliability curve.
pub fn write(
    dir: &Path,
    corpus: &[PathBuf],
    predictions: &[Prediction],
    bins: &[ReliabilityBin],
) -> anyhow::Result<()> {
    create_dir_all(dir).with_context(|| format!("{}: cannot be made", dir.display()))?;
    let mut scenes: Vec<&str> = predictions.iter().map(|p| p.scene.as_str()).collect();
    scenes.dedup();
    let mut pictures = BTreeMap::new();
    for folder in corpus {
        pictures.extend(pictures_of(folder)?);
    }
    for scene in scenes {
        let zones: Vec<&Prediction> = predictions.iter().filter(|p| p.scene == scene).collect();
        let (picture, places) = match pictures.remove(scene) {
            Some(found) => found,
            None => blank(&zones),
        };
        let mark = |p: &&Prediction| {
            Some(Mark {
                tile: *places.get(&(p.scene.clone(), p.zone))?,
                value: p.predicted_spp / p.human_spp,
                label: format!("{:.0} | {:.0}", p.human_spp, p.predicted_spp),
                unfamiliar: p.unfamiliar,
            })
        };
        let marks: Vec<Mark> = zones.iter().filter_map(mark).collect();
        let scale = Scale {
            title: "people|model\nand ratio",
            low: 1.0 / WIDEST_RATIO,
            high: WIDEST_RATIO,
            log: true,
            colours: colorous::PURPLE_ORANGE,
            landmark: None,
        };
        let map = heat_map::draw(picture.width, &picture.pixels, &marks, &scale);
        write_png(dir.join(format!("zones-{scene}.png")), map.width, map.height, &map.bytes)?;
    }
    let svg = |name: &str, draw: &dyn Fn(&mut String) -> anyhow::Result<()>| {
        let mut text = String::new();
        draw(&mut text)?;
        write_atomic(dir.join(name), |to| std::io::Write::write_all(to, text.as_bytes()))?;
        anyhow::Ok(())
    };
    svg("thresholds.svg", &|to| thresholds(to, predictions))?;
    svg("reliability.svg", &|to| reliability(to, bins))
}

/// The most converged picture of each scene of a corpus, put together from its zones, and where these lie.
fn pictures_of(folder: &Path) -> anyhow::Result<BTreeMap<String, (Picture, Places)>> {
    let corpus = Corpus::open(folder)?;
    let mut found = BTreeMap::new();
    for scene in corpus.scenes() {
        let zones = || corpus.zones().iter().filter(|z| z.scene == scene);
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
        let place = |z: &noisefloor_learn::JudgedZone| {
            let tile = Tile { index: z.zone as usize, x: z.x, y: z.y, width: z.width, height: z.height };
            ((z.scene.clone(), z.zone), tile)
        };
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

/// Colours that people with colour-blindness can tell apart too (Okabe and Ito 2008), and a shape for each.
pub const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(0, 0, 0),
    RGBColor(120, 120, 120),
];
const SIZE: (u32, u32) = (640, 560);
const LETTERS: (&str, u32) = ("sans-serif", 15);

pub fn failed(error: impl std::fmt::Display) -> anyhow::Error {
    anyhow::anyhow!("a plot cannot be drawn: {error}")
}

/// Predicted against human thresholds, with lines at half, once and twice.
fn thresholds(to: &mut String, predictions: &[Prediction]) -> anyhow::Result<()> {
    let all = predictions.iter().flat_map(|p| [p.human_spp, p.predicted_spp]);
    let (low, high) = all.fold((f64::INFINITY, 1.0f64), |(l, h), v| (l.min(v), h.max(v)));
    let (low, high) = (low.min(high) / 1.3, high * 1.3);
    let root = SVGBackend::with_string(to, SIZE).into_drawing_area();
    root.fill(&WHITE).map_err(failed)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d((low..high).log_scale(), (low..high).log_scale())
        .map_err(failed)?;
    chart
        .configure_mesh()
        .x_desc("people, samples per pixel")
        .y_desc("model, samples per pixel")
        .x_label_formatter(&|spp| format!("{spp:.0}"))
        .y_label_formatter(&|spp| format!("{spp:.0}"))
        .label_style(LETTERS)
        .axis_desc_style(LETTERS)
        .light_line_style(WHITE)
        .draw()
        .map_err(failed)?;
    for (line, grey) in [
        ([(low, low), (high, high)], 60),
        ([(low, 2.0 * low), (0.5 * high, high)], 170),
        ([(2.0 * low, low), (high, 0.5 * high)], 170),
    ] {
        chart.draw_series(LineSeries::new(line, RGBColor(grey, grey, grey))).map_err(failed)?;
    }
    let mut scenes: Vec<&str> = predictions.iter().map(|p| p.scene.as_str()).collect();
    scenes.dedup();
    for (i, scene) in scenes.iter().enumerate() {
        let colour = COLOURS[i % COLOURS.len()];
        let points = predictions.iter().filter(|p| p.scene == *scene).map(|p| (p.human_spp, p.predicted_spp));
        let series = match i % 3 {
            0 => chart.draw_series(points.map(|at| Circle::new(at, 4, colour.filled()).into_dyn())),
            1 => chart.draw_series(points.map(|at| TriangleMarker::new(at, 5, colour.filled()).into_dyn())),
            _ => chart.draw_series(points.map(|at| Cross::new(at, 4, colour.stroke_width(2)).into_dyn())),
        };
        series.map_err(failed)?.label((*scene).to_owned()).legend(move |(x, y)| match i % 3 {
            0 => Circle::new((x + 10, y), 4, colour.filled()).into_dyn(),
            1 => TriangleMarker::new((x + 10, y), 5, colour.filled()).into_dyn(),
            _ => Cross::new((x + 10, y), 4, colour.stroke_width(2)).into_dyn(),
        });
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE.mix(0.85))
        .border_style(RGBColor(200, 200, 200))
        .label_font(LETTERS)
        .draw()
        .map_err(failed)?;
    root.present().map_err(failed)
}

/// Observed against predicted probability; the area of a point is its share of the levels.
fn reliability(to: &mut String, bins: &[ReliabilityBin]) -> anyhow::Result<()> {
    let root = SVGBackend::with_string(to, SIZE).into_drawing_area();
    root.fill(&WHITE).map_err(failed)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(0.0..1.0, 0.0..1.0)
        .map_err(failed)?;
    chart
        .configure_mesh()
        .x_desc("P of the model")
        .y_desc("share of observers who see no difference")
        .label_style(LETTERS)
        .axis_desc_style(LETTERS)
        .light_line_style(WHITE)
        .draw()
        .map_err(failed)?;
    let diagonal = LineSeries::new([(0.0, 0.0), (1.0, 1.0)], RGBColor(150, 150, 150));
    chart.draw_series(diagonal).map_err(failed)?;
    let points = || bins.iter().map(|b| (b.predicted, b.observed));
    chart.draw_series(LineSeries::new(points(), COLOURS[0])).map_err(failed)?;
    let levels: usize = bins.iter().map(|b| b.levels).sum();
    let circle = |b: &ReliabilityBin| {
        let radius = 2.0 + 22.0 * (b.levels as f64 / levels as f64).sqrt();
        Circle::new((b.predicted, b.observed), radius.round() as i32, COLOURS[0].mix(0.5).filled())
    };
    chart.draw_series(bins.iter().map(circle)).map_err(failed)?;
    root.present().map_err(failed)
}
