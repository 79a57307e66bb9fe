//! Signs of series, drawn alike in plots and legends.

use plotters::element::{Drawable, PointCollection};
use plotters::prelude::*;
use plotters_backend::{BackendCoord, DrawingErrorKind};
use std::iter::{Once, once};

/// A circle, a triangle or a cross.
pub(crate) struct Sign<C> {
    series: usize,
    at: C,
    size: i32,
    colour: RGBColor,
}

/// The sign of series number `i`, `size` pixels large.
pub(crate) fn sign<C>(i: usize, at: C, size: i32, colour: RGBColor) -> Sign<C> {
    Sign { series: i, at, size, colour }
}

impl<'a, C> PointCollection<'a, C> for &'a Sign<C> {
    type Point = &'a C;
    type IntoIter = Once<&'a C>;

    fn point_iter(self) -> Once<&'a C> {
        once(&self.at)
    }
}

impl<C, B: DrawingBackend> Drawable<B> for Sign<C> {
    fn draw<I: Iterator<Item = BackendCoord>>(
        &self,
        points: I,
        backend: &mut B,
        _parent: (u32, u32),
    ) -> Result<(), DrawingErrorKind<B::ErrorType>> {
        let size = self.size;
        for (x, y) in points {
            match self.series % 3 {
                0 => backend.draw_circle((x, y), size as u32, &self.colour, true)?,
                1 => {
                    // Equilateral, its corners a little beyond the circle
                    let (wide, low) = (f64::from(size + 1) * 0.866, (size + 1) / 2);
                    let wide = wide.round() as i32;
                    let corners = [(x, y - size - 1), (x + wide, y + low), (x - wide, y + low)];
                    backend.fill_polygon(corners, &self.colour)?;
                }
                _ => {
                    let pen = self.colour.stroke_width(size as u32 / 2);
                    backend.draw_line((x - size, y - size), (x + size, y + size), &pen)?;
                    backend.draw_line((x - size, y + size), (x + size, y - size), &pen)?;
                }
            }
        }
        Ok(())
    }
}
