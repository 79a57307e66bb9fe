//! Mean thresholds, scene by scene.

use super::{RatedRival, scene_means};
use crate::drawing::{Area, colour, sign, svg};
use crate::error::LabError;
use noisefloor_learn::Prediction;
use plotters::prelude::*;

/// Where the legend of the plot begins, in pixels.
const LEGEND: (i32, i32) = (758, 40);

/// Draws mean thresholds as SVG, scene by scene: people, the model, and each rival.
pub fn plot_scene_means(model: &[Prediction], rated: &[RatedRival]) -> Result<String, LabError> {
    let (scenes, series) = series(model, rated);
    svg((900, 480), |root| draw(root, &scenes, &series))
}

/// A name, and a mean threshold for each scene; NaN where there is none.
type Series<'a> = (&'a str, Vec<f64>);

/// The scenes, and the series of everybody.
fn series<'a>(model: &[Prediction], rated: &'a [RatedRival]) -> (Vec<String>, Vec<Series<'a>>) {
    let of_model = scene_means(model);
    let mut series: Vec<Series<'_>> = vec![
        ("people", of_model.iter().map(|s| s.human_spp).collect()),
        ("the model", of_model.iter().map(|s| s.predicted_spp).collect()),
    ];
    for rival in rated {
        let spp = |scene: &str| rival.scenes.iter().find(|s| s.scene == scene).map(|s| s.predicted_spp);
        let means = of_model.iter().map(|s| spp(&s.scene).unwrap_or(f64::NAN)).collect();
        series.push((rival.name, means));
    }
    (of_model.into_iter().map(|s| s.scene).collect(), series)
}

fn draw(root: &Area<'_>, scenes: &[String], series: &[Series<'_>]) -> Result<(), LabError> {
    let all = || series.iter().flat_map(|s| &s.1).copied().filter(|v| v.is_finite());
    let (low, high) = all().fold((f64::INFINITY, 1.0f64), |(l, h), v| (l.min(v), h.max(v)));
    let letters = ("sans-serif", 14);
    let mut chart = ChartBuilder::on(root)
        .margin(12)
        .margin_right(150)
        .x_label_area_size(40)
        .y_label_area_size(64)
        .build_cartesian_2d(-0.5..scenes.len() as f64 - 0.5, (low / 1.3..high * 1.3).log_scale())?;
    let name = |x: &f64| {
        let near = (x - x.round()).abs() < 1e-6 && *x >= 0.0;
        scenes.get(x.round().max(0.0) as usize).filter(|_| near).cloned().unwrap_or_default()
    };
    chart
        .configure_mesh()
        .y_desc("mean samples per pixel at the stop")
        .x_labels(2 * scenes.len() + 1)
        .x_label_formatter(&name)
        .y_label_formatter(&|v| format!("{v:.0}"))
        .label_style(letters)
        .axis_desc_style(letters)
        .light_line_style(WHITE)
        .disable_x_mesh()
        .draw()?;
    for (i, (name, values)) in series.iter().enumerate() {
        // People in black, all others in colours
        let ink = if i == 0 { BLACK } else { colour(i - 1) };
        let offset = (i as f64 - series.len() as f64 / 2.0) * 0.07;
        let known = values.iter().enumerate().filter(|(_, v)| v.is_finite());
        let signs = known.map(|(x, &v)| sign(i, (x as f64 + offset, v), 5, ink));
        chart.draw_series(signs)?;
        // The legend, outside: the library's own lies over the plot
        let at = (LEGEND.0 + 8, LEGEND.1 + 24 * i as i32);
        root.draw(&sign(i, at, 5, ink))?;
        root.draw(&Text::new((*name).to_owned(), (at.0 + 16, at.1 - 7), letters))?;
    }
    Ok(())
}
