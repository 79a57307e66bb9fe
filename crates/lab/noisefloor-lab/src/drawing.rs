//! What all plots share: colours and signs.

use crate::error::LabError;
use plotters::coord::Shift;
use plotters::prelude::*;

/// Colours that people with colour-blindness can tell apart too (Okabe and Ito 2008), and a shape for each.
pub(crate) const COLOURS: [RGBColor; 8] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(0, 0, 0),
    RGBColor(120, 120, 120),
];

/// The colour of series number `i`.
pub(crate) fn colour(i: usize) -> RGBColor {
    COLOURS[i % COLOURS.len()]
}

/// The sign of series number `i`, `size` pixels large: a circle, a triangle or a cross.
pub(crate) fn sign<'a, C: Clone + 'static>(
    i: usize,
    at: C,
    size: i32,
    colour: RGBColor,
) -> DynElement<'static, SVGBackend<'a>, C> {
    match i % 3 {
        0 => Circle::new(at, size, colour.filled()).into_dyn(),
        // Its corners a little beyond the circle
        1 => TriangleMarker::new(at, size + 1, colour).into_dyn(),
        _ => Cross::new(at, size, colour.stroke_width(size as u32 / 2)).into_dyn(),
    }
}

pub(crate) type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

/// An SVG plot of that size.
pub(crate) fn svg(
    size: (u32, u32),
    draw: impl FnOnce(&Area<'_>) -> Result<(), LabError>,
) -> Result<String, LabError> {
    let mut text = String::new();
    let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
    root.fill(&WHITE)?;
    draw(&root)?;
    root.present()?;
    drop(root);
    Ok(text)
}
