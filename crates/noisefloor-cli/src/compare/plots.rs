//! Curves of error against cost, with a marker where each criterion stops.

use super::canvas::Paper;
use crate::figures::{COLOURS, failed};
use anyhow::Context;
use noisefloor_image::{write_atomic, write_png};
use plotters::coord::Shift;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint};
use plotters::prelude::*;
use std::path::Path;

/// What is drawn into one panel: a measure of error against a cost.
pub struct Panel {
    pub title: &'static str,
    /// Uniform sampling: (cost, error), ascending.
    pub curve: Vec<(f64, f64)>,
    /// Each family: its name, and (cost, error) of each of its entrants.
    pub markers: Vec<(String, Vec<(f64, f64)>)>,
}

const SIZE: (u32, u32) = (1040, 760);
const LEGEND: u32 = 176;

/// Writes `NAME.svg` and `NAME.png` with four panels or fewer, and one legend.
pub fn write(folder: &Path, name: &str, cost: &str, panels: &[Panel]) -> anyhow::Result<()> {
    let mut text = String::new();
    draw(&SVGBackend::with_string(&mut text, SIZE).into_drawing_area(), cost, panels)?;
    write_atomic(folder.join(name).with_extension("svg"), |to| {
        std::io::Write::write_all(to, text.as_bytes())
    })?;
    let mut paper = Paper::new(SIZE);
    draw(&paper.backend().into_drawing_area(), cost, panels)?;
    let canvas = paper.into_canvas();
    let path = folder.join(name).with_extension("png");
    write_png(&path, canvas.width, canvas.height, &canvas.bytes).with_context(|| path.display().to_string())
}

/// Positive values of both axes, with a little room.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values
        .filter(|v| v.is_finite() && *v > 0.0)
        .fold((f64::INFINITY, 0.0f64), |(low, high), v| (low.min(v), high.max(v)));
    if low > high { (0.1, 1.0) } else { (low / 1.25, high * 1.25) }
}

fn draw<B: DrawingBackend>(root: &DrawingArea<B, Shift>, cost: &str, panels: &[Panel]) -> anyhow::Result<()> {
    root.fill(&WHITE).map_err(failed)?;
    let (plots, legend) = root.split_horizontally(SIZE.0 - LEGEND);
    for (panel, area) in panels.iter().zip(plots.split_evenly((panels.len().div_ceil(2), 2))) {
        draw_panel(&area, cost, panel)?;
    }

    // Legend: the curve, then the families.
    let names = panels.first().map(|p| p.markers.iter().map(|m| m.0.as_str())).into_iter().flatten();
    let style = ("sans-serif", 15).into_font().color(&BLACK);
    let line = |row: usize| 30 + 24 * row as i32;
    legend.draw(&PathElement::new([(8, line(0)), (32, line(0))], BLACK.stroke_width(2))).map_err(failed)?;
    legend.draw(&Text::new("uniform", (42, line(0) - 8), style.clone())).map_err(failed)?;
    for (i, name) in names.enumerate() {
        marker(&legend, i, (20, line(i + 1)))?;
        legend.draw(&Text::new(name.to_owned(), (42, line(i + 1) - 8), style.clone())).map_err(failed)?;
    }
    root.present().map_err(failed)
}

/// The sign of the family number `i`: a colour and a shape.
fn marker<B: DrawingBackend>(area: &DrawingArea<B, Shift>, i: usize, at: (i32, i32)) -> anyhow::Result<()> {
    let colour = COLOURS[i % COLOURS.len()];
    match i % 3 {
        0 => area.draw(&Circle::new(at, 6, colour.filled())),
        1 => area.draw(&TriangleMarker::new(at, 7, colour.filled())),
        _ => area.draw(&Cross::new(at, 6, colour.stroke_width(3))),
    }
    .map_err(failed)
}

fn draw_panel<B: DrawingBackend>(
    area: &DrawingArea<B, Shift>,
    cost: &str,
    panel: &Panel,
) -> anyhow::Result<()> {
    let points = || panel.curve.iter().chain(panel.markers.iter().flat_map(|m| &m.1));
    let (x0, x1) = range(points().map(|p| p.0));
    let (y0, y1) = range(points().map(|p| p.1));
    let letters = ("sans-serif", 14);
    let mut chart = ChartBuilder::on(area)
        .margin(10)
        .caption(panel.title, ("sans-serif", 16))
        .x_label_area_size(40)
        .y_label_area_size(62)
        .build_cartesian_2d(Logarithmic(x0, x1), Logarithmic(y0, y1))
        .map_err(failed)?;
    chart
        .configure_mesh()
        .x_desc(cost)
        .x_label_formatter(&|v| short(*v))
        .y_label_formatter(&|v| short(*v))
        .label_style(letters)
        .axis_desc_style(letters)
        .light_line_style(WHITE)
        .bold_line_style(RGBColor(225, 225, 225))
        .draw()
        .map_err(failed)?;
    let drawable = |p: &&(f64, f64)| p.0 > 0.0 && p.1 > 0.0 && p.0.is_finite() && p.1.is_finite();
    let curve = panel.curve.iter().filter(drawable).copied();
    chart.draw_series(LineSeries::new(curve, BLACK.stroke_width(2))).map_err(failed)?;
    // The first family comes last, on top.
    for (i, (_, family)) in panel.markers.iter().enumerate().rev() {
        let at = || family.iter().filter(drawable).copied();
        if at().count() > 1 {
            let colour = COLOURS[i % COLOURS.len()];
            chart.draw_series(LineSeries::new(at(), colour.mix(0.6))).map_err(failed)?;
        }
        let plotting = chart.plotting_area();
        for point in at() {
            let (x, y) = plotting.map_coordinate(&point);
            let (left, top) = area.get_base_pixel();
            marker(area, i, (x - left, y - top))?;
        }
    }
    Ok(())
}

/// A logarithmic axis from one positive value to another. The library's own has no labels but powers of ten.
struct Logarithmic(f64, f64);

impl Ranged for Logarithmic {
    type FormatOption = DefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, (from, to): (i32, i32)) -> i32 {
        let place = (value / self.0).ln() / (self.1 / self.0).ln();
        from + (place * f64::from(to - from)).round() as i32
    }

    fn key_points<H: KeyPointHint>(&self, _: H) -> Vec<f64> {
        ticks(self.0, self.1)
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.0..self.1
    }
}

/// Round numbers within a range, few enough for labels.
fn ticks(low: f64, high: f64) -> Vec<f64> {
    let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
    let with = |steps: &'static [f64]| -> Vec<f64> {
        let all = decades.clone().flat_map(|d| steps.iter().map(move |s| s * 10f64.powi(d)));
        all.filter(|v| (low..=high).contains(v)).collect()
    };
    let choices: [&[f64]; 4] =
        [&[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0], &[1.0, 2.0, 3.0, 5.0], &[1.0, 3.0], &[1.0]];
    let found = choices.into_iter().map(with).find(|ticks| ticks.len() <= 7);
    found.unwrap_or_else(|| with(&[1.0]))
}

/// A number with no more digits than a label has room for.
pub fn short(value: f64) -> String {
    let digits = if value <= 0.0 { 0 } else { (1 - value.abs().log10().floor() as i32).clamp(0, 5) as usize };
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_are_short_and_right() {
        let all = [0.0, 0.001, 0.00123, 0.05, 1.0, 2.5, 31.6, 1000.0, 12_345.6].map(short);
        assert_eq!(all, ["0", "0.001", "0.0012", "0.05", "1", "2.5", "32", "1000", "12346"]);
    }

    #[test]
    fn ticks_are_round_and_few() {
        let values = |low, high| -> Vec<String> { ticks(low, high).into_iter().map(short).collect() };
        assert_eq!(values(50.0, 450.0), ["50", "70", "100", "150", "200", "300", "400"]);
        assert_eq!(values(0.001, 12.0), ["0.001", "0.01", "0.1", "1", "10"]);
        assert!((-3..9).all(|d| (2..=7).contains(&ticks(10f64.powi(d), 10f64.powi(d) * 2.1).len())));
    }

    /// Both files are written, and what is drawn is there: ink of the curve, and of a marker.
    #[test]
    fn panels_are_drawn_in_both_formats() {
        let folder = tempfile::tempdir().unwrap();
        let panel = Panel {
            title: "FLIP",
            curve: vec![(1.0, 0.5), (10.0, 0.2), (100.0, 0.05)],
            markers: vec![("oracle".into(), vec![(20.0, 0.1)]), ("none".into(), vec![(0.0, 0.0)])],
        };
        write(folder.path(), "plot", "samples", &[panel]).unwrap();
        let svg = std::fs::read_to_string(folder.path().join("plot.svg")).unwrap();
        assert!(svg.contains("oracle") && svg.contains("polyline") && svg.contains("<circle"));
        let png = noisefloor_image::read_picture(folder.path().join("plot.png")).unwrap();
        let noisefloor_image::Picture::Display(image) = png else { panic!("a PNG is a display picture") };
        assert_eq!((image.width, image.height), (SIZE.0 as usize, SIZE.1 as usize));
        let blue = |p: &&noisefloor::Rgb| p[2] > 0.6 && p[0] < 0.1;
        assert!(image.pixels.iter().filter(blue).count() > 100, "two circles of the first colour");
        let black = |p: &&noisefloor::Rgb| p.iter().all(|c| *c < 0.05);
        assert!(image.pixels.iter().filter(black).count() > 300, "the curve and the letters");
    }
}
