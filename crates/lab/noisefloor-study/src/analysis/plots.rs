//! Plots of an analysis.

use super::tiles::{CorpusThreshold, TileRow};
use crate::error::StudyError;
use embedded_graphics::mono_font::iso_8859_1::{FONT_6X10, FONT_7X13_BOLD, FONT_9X18_BOLD};
use noisefloor::TileGrid;
use noisefloor_image::maps::Canvas;
use plotters::coord::Shift;
use plotters::drawing::DrawingAreaErrorKind;
use plotters::prelude::*;
use std::ops::Range;

const SIZE: (u32, u32) = (720, 480);
const LETTERS: (&str, u32) = ("sans-serif", 15);
const BLUE: RGBColor = RGBColor(0, 114, 178);
const VERMILION: RGBColor = RGBColor(213, 94, 0);
const POINTS: usize = 120;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

fn svg(draw: impl FnOnce(&Area<'_>) -> Result<(), StudyError>) -> Result<String, StudyError> {
    let mut text = String::new();
    let root = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    draw(&root)?;
    root.present()?;
    drop(root);
    Ok(text)
}

impl<E: std::error::Error + Send + Sync> From<DrawingAreaErrorKind<E>> for StudyError {
    fn from(error: DrawingAreaErrorKind<E>) -> Self {
        Self::Other(format!("a plot cannot be drawn: {error}"))
    }
}

/// Labels of a logarithmic axis, none of which touch: 1, 2, 3 and 5 times a power of ten, or all digits where
/// little is covered.
fn ticks(covered: &Range<f64>) -> Vec<f64> {
    let is_plain = |digit: &i32| covered.end < 6.0 * covered.start || [1, 2, 3, 5].contains(digit);
    let digits = (1..10).filter(is_plain).map(f64::from);
    let powers = (0..=covered.end.log10() as i32).map(|power| 10f64.powi(power));
    let every = powers.flat_map(|power| digits.clone().map(move |digit| digit * power));
    every.filter(|spp| (covered.start..=covered.end).contains(spp)).collect()
}

/// Mean and 95 % level of each tile with intervals, in table order.
pub(super) fn thresholds(tiles: &[TileRow]) -> Result<String, StudyError> {
    let all = tiles.iter().flat_map(|t| {
        let ends = [t.mean_low, t.mean_high, t.level95_low, t.level95_high].into_iter().flatten();
        ends.chain([t.mean, t.level95]).collect::<Vec<_>>()
    });
    let (low, high) = all.fold((f64::INFINITY, 1.0f64), |(l, h), v| (l.min(v.max(0.1)), h.max(v)));
    let shown = low / 1.2..high * 1.2;
    let labels = ticks(&shown);
    svg(|root| {
        let mut chart = ChartBuilder::on(root)
            .margin(12)
            .x_label_area_size(44)
            .y_label_area_size(64)
            .build_cartesian_2d(-0.5..tiles.len() as f64 - 0.5, shown.log_scale().with_key_points(labels))?;
        chart
            .configure_mesh()
            .disable_x_mesh()
            .x_labels((2 * tiles.len()).clamp(2, 24))
            .x_desc("tile, in the order of tiles.csv (blue: mean; red: 95 % see no difference)")
            .y_desc("samples per pixel")
            // Only where there is a tile
            .x_label_formatter(&|x| match (x.round() - x).abs() < 1e-6 {
                true => format!("{}", x.round() as i64),
                false => String::new(),
            })
            .y_label_formatter(&|spp| format!("{spp:.0}"))
            .label_style(LETTERS)
            .axis_desc_style(LETTERS)
            .light_line_style(WHITE)
            .draw()?;
        for (i, tile) in tiles.iter().enumerate() {
            for (shift, value, low, high, colour) in [
                (-0.12, tile.mean, tile.mean_low, tile.mean_high, BLUE),
                (0.12, tile.level95, tile.level95_low, tile.level95_high, VERMILION),
            ] {
                let x = i as f64 + shift;
                if let Some((low, high)) = low.zip(high) {
                    let line = PathElement::new([(x, low), (x, high)], colour.stroke_width(2));
                    chart.draw_series([line])?;
                }
                chart.draw_series([Circle::new((x, value), 4, colour.filled())])?;
            }
        }
        Ok(())
    })
}

/// Psychometric function of each tile of a stack.
pub(super) fn curves(tiles: &[&TileRow], levels: &[u64]) -> Result<String, StudyError> {
    let (low, high) = (levels[0].max(1) as f64, levels[levels.len() - 1] as f64);
    svg(|root| {
        let mut chart = ChartBuilder::on(root)
            .margin(12)
            .margin_right(32) // half of the last label
            .x_label_area_size(44)
            .y_label_area_size(64)
            .build_cartesian_2d((low..high).log_scale().with_key_points(ticks(&(low..high))), 0.0..1.0)?;
        chart
            .configure_mesh()
            .x_desc("samples per pixel (lines: the likeliest curve of a tile; dots: 95 %, over all that fit)")
            .y_desc("share who see no difference")
            .x_label_formatter(&|spp| format!("{spp:.0}"))
            .label_style(LETTERS)
            .axis_desc_style(LETTERS)
            .light_line_style(WHITE)
            .draw()?;
        for tile in tiles {
            let at = |i: usize| low * (high / low).powf(i as f64 / (POINTS - 1) as f64);
            let curve = (0..POINTS).map(|i| (at(i), tile.fit.share(at(i))));
            chart.draw_series(LineSeries::new(curve, BLUE.mix(0.6)))?;
            if tile.level95 < high {
                let dot = Circle::new((tile.level95, 0.95), 3, VERMILION.filled());
                chart.draw_series([dot])?;
            }
        }
        Ok(())
    })
}

/// The picture, three bytes a pixel, with the tile grid and a threshold in each tile (Takouachet et al. 2017,
/// figure 3).
pub(super) fn grid(grid: TileGrid, picture: &[u8], tiles: &[&TileRow], threshold: CorpusThreshold) -> Canvas {
    let mut canvas = Canvas::of_bytes(grid.width(), picture);
    for t in tiles {
        for x in t.x..t.x + t.width {
            canvas.set(x, t.y, [255; 3]);
        }
        for y in t.y..t.y + t.height {
            canvas.set(t.x, y, [255; 3]);
        }
        let label = format!("{}{:.0}", if t.beyond { ">" } else { "" }, t.threshold(threshold));
        let (font, advance) = match t.width {
            100.. => (&FONT_9X18_BOLD, 9),
            48.. => (&FONT_7X13_BOLD, 7),
            _ => (&FONT_6X10, 6),
        };
        if label.len() * advance + 2 <= t.width && t.height >= 12 {
            canvas.label(&label, (t.x + t.width / 2, t.y + t.height / 2), font);
        }
    }
    canvas
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_of_an_axis_has_labels() {
        assert_eq!(ticks(&(28.0..1300.0)), [30.0, 50.0, 100.0, 200.0, 300.0, 500.0, 1000.0]);
        assert_eq!(ticks(&(350.0..800.0)), [400.0, 500.0, 600.0, 700.0, 800.0]);
        assert_eq!(ticks(&(0.8..4.0)), [1.0, 2.0, 3.0, 4.0]);
    }
}
