//! Curves of error against cost, with a marker where each criterion stops.

use super::outcome::{Comparison, Taken, families};
use super::quality::Quality;
use super::race::CurvePoint;
use crate::drawing::{Area, colour, sign, svg};
use crate::error::LabError;
use plotters::coord::ranged1d::{DefaultFormatting, KeyPointHint};
use plotters::prelude::*;

/// What a plot counts on its horizontal axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cost {
    Samples,
    /// Seconds, of the source and the criterion together.
    Seconds,
}

impl Cost {
    pub const ALL: [Self; 2] = [Self::Samples, Self::Seconds];

    pub(super) fn file_name(self) -> &'static str {
        match self {
            Self::Samples => "by-samples.svg",
            Self::Seconds => "by-seconds.svg",
        }
    }

    fn label(self) -> &'static str {
        match self {
            Self::Samples => "samples per pixel",
            Self::Seconds => "seconds, source and criterion",
        }
    }

    fn of_run(self, taken: &Taken) -> f64 {
        match self {
            Self::Samples => taken.spp_mean,
            Self::Seconds => taken.seconds(),
        }
    }

    fn of_point(self, point: &CurvePoint) -> f64 {
        match self {
            Self::Samples => point.spp as f64,
            Self::Seconds => point.source_seconds,
        }
    }
}

/// Plots error against cost as SVG: uniform sampling as a curve, each criterion as a sign where it stopped.
pub fn plot(comparison: &Comparison, cost: Cost) -> Result<String, LabError> {
    let panels = MEASURES.map(|measure| Panel::new(comparison, cost, measure));
    svg(SIZE, |root| draw(root, cost.label(), &panels))
}

/// What is plotted: its name, and its value of a picture.
type Measure = (&'static str, fn(&Quality) -> f64);

const MEASURES: [Measure; 4] = [
    ("relMSE", |q| q.rel_mse),
    ("FLIP, worst tile", |q| q.flip_worst),
    ("JODs lost, worst tile", |q| 10.0 - q.cvvdp_jod_worst),
    ("butteraugli, worst tile", |q| q.butteraugli_worst),
];

/// What is drawn into one panel: a measure of error against a cost.
struct Panel {
    title: &'static str,
    /// Uniform sampling: (cost, error), ascending.
    curve: Vec<(f64, f64)>,
    /// Each family: its name, and (cost, error) of each of its runs.
    markers: Vec<(String, Vec<(f64, f64)>)>,
}

impl Panel {
    fn new(comparison: &Comparison, cost: Cost, (title, measure): Measure) -> Self {
        let point = |point: &CurvePoint| (cost.of_point(point), measure(&point.quality));
        let family = |family: &str| {
            let of = comparison.runs.iter().filter(|run| run.taken.family == family);
            let mut points: Vec<(f64, f64)> =
                of.map(|run| (cost.of_run(&run.taken), measure(&run.quality))).collect();
            points.sort_by(|a, b| a.0.total_cmp(&b.0));
            (family.to_owned(), points)
        };
        Self {
            title,
            curve: comparison.curve.iter().map(point).collect(),
            markers: families(&comparison.runs).into_iter().map(family).collect(),
        }
    }
}

const SIZE: (u32, u32) = (1040, 760);
const LEGEND: u32 = 176;

/// Positive values of both axes, with a little room.
fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values
        .filter(|v| v.is_finite() && *v > 0.0)
        .fold((f64::INFINITY, 0.0f64), |(low, high), v| (low.min(v), high.max(v)));
    if low > high { (0.1, 1.0) } else { (low / 1.25, high * 1.25) }
}

fn draw(root: &Area<'_>, cost: &str, panels: &[Panel]) -> Result<(), LabError> {
    let (plots, legend) = root.split_horizontally(SIZE.0 - LEGEND);
    for (panel, area) in panels.iter().zip(plots.split_evenly((panels.len().div_ceil(2), 2))) {
        draw_panel(&area, cost, panel)?;
    }

    // Legend: the curve, then the families.
    let names = panels.first().map(|p| p.markers.iter().map(|m| m.0.as_str())).into_iter().flatten();
    let style = ("sans-serif", 15).into_font().color(&BLACK);
    let line = |row: usize| 30 + 24 * row as i32;
    legend.draw(&PathElement::new([(8, line(0)), (32, line(0))], BLACK.stroke_width(2)))?;
    legend.draw(&Text::new("uniform", (42, line(0) - 8), style.clone()))?;
    for (i, name) in names.enumerate() {
        legend.draw(&sign(i, (20, line(i + 1)), 6, colour(i)))?;
        legend.draw(&Text::new(name.to_owned(), (42, line(i + 1) - 8), style.clone()))?;
    }
    Ok(())
}

fn draw_panel(area: &Area<'_>, cost: &str, panel: &Panel) -> Result<(), LabError> {
    let points = || panel.curve.iter().chain(panel.markers.iter().flat_map(|m| &m.1));
    let (x0, x1) = range(points().map(|p| p.0));
    let (y0, y1) = range(points().map(|p| p.1));
    let letters = ("sans-serif", 14);
    let mut chart = ChartBuilder::on(area)
        .margin(10)
        .caption(panel.title, ("sans-serif", 16))
        .x_label_area_size(40)
        .y_label_area_size(62)
        .build_cartesian_2d(Logarithmic(x0, x1), Logarithmic(y0, y1))?;
    chart
        .configure_mesh()
        .x_desc(cost)
        .x_label_formatter(&|v| short(*v))
        .y_label_formatter(&|v| short(*v))
        .label_style(letters)
        .axis_desc_style(letters)
        .light_line_style(WHITE)
        .bold_line_style(RGBColor(225, 225, 225))
        .draw()?;
    let drawable = |p: &&(f64, f64)| p.0 > 0.0 && p.1 > 0.0 && p.0.is_finite() && p.1.is_finite();
    let curve = panel.curve.iter().filter(drawable).copied();
    chart.draw_series(LineSeries::new(curve, BLACK.stroke_width(2)))?;
    // The first family comes last, on top.
    for (i, (_, family)) in panel.markers.iter().enumerate().rev() {
        let at = || family.iter().filter(drawable).copied();
        if at().count() > 1 {
            chart.draw_series(LineSeries::new(at(), colour(i).mix(0.6)))?;
        }
        let plotting = chart.plotting_area();
        for point in at() {
            let (x, y) = plotting.map_coordinate(&point);
            let (left, top) = area.get_base_pixel();
            area.draw(&sign(i, (x - left, y - top), 6, colour(i)))?;
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
pub(super) fn short(value: f64) -> String {
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

    #[test]
    fn panels_have_a_curve_and_signs() {
        let panel = Panel {
            title: "FLIP",
            curve: vec![(1.0, 0.5), (10.0, 0.2), (100.0, 0.05)],
            markers: vec![("oracle".into(), vec![(20.0, 0.1)]), ("none".into(), vec![(0.0, 0.0)])],
        };
        let text = svg(SIZE, |root| draw(root, "samples", std::slice::from_ref(&panel))).unwrap();
        assert!(text.contains("oracle") && text.contains("polyline"));
        assert_eq!(text.matches("<circle").count(), 2, "where it stopped, and in the legend");
    }
}
