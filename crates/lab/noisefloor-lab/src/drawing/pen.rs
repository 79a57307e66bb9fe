//! Plots as pixels: lines by the plotting library, letters from a font that is always there.

use embedded_graphics::mono_font::MonoFont;
use embedded_graphics::mono_font::iso_8859_1::{FONT_7X13, FONT_8X13_BOLD};
use embedded_graphics::text::Alignment;
use noisefloor_image::maps::Canvas;
use plotters::prelude::*;
use plotters_backend::{BackendColor, BackendCoord, BackendTextStyle, DrawingErrorKind};
use std::convert::Infallible;

pub(crate) struct Pen<'a>(pub(crate) &'a mut Canvas);

fn font(style: &impl BackendTextStyle) -> MonoFont<'static> {
    if style.size() > 15.5 { FONT_8X13_BOLD } else { FONT_7X13 }
}

fn size(text: &str, style: &impl BackendTextStyle) -> (u32, u32) {
    let letter = font(style).character_size;
    (letter.width * text.chars().count() as u32, letter.height)
}

impl DrawingBackend for Pen<'_> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        (self.0.width() as u32, self.0.height() as u32)
    }

    fn ensure_prepared(&mut self) -> Result<(), DrawingErrorKind<Infallible>> {
        Ok(())
    }

    fn present(&mut self) -> Result<(), DrawingErrorKind<Infallible>> {
        Ok(())
    }

    fn draw_pixel(
        &mut self,
        (x, y): BackendCoord,
        colour: BackendColor,
    ) -> Result<(), DrawingErrorKind<Infallible>> {
        if let (Ok(x), Ok(y)) = (usize::try_from(x), usize::try_from(y)) {
            let (r, g, b) = colour.rgb;
            self.0.blend(x, y, [r, g, b], colour.alpha);
        }
        Ok(())
    }

    fn estimate_text_size<S: BackendTextStyle>(
        &self,
        text: &str,
        style: &S,
    ) -> Result<(u32, u32), DrawingErrorKind<Infallible>> {
        Ok(size(text, style))
    }

    fn draw_text<S: BackendTextStyle>(
        &mut self,
        text: &str,
        style: &S,
        (x, y): BackendCoord,
    ) -> Result<(), DrawingErrorKind<Infallible>> {
        use plotters_backend::text_anchor::{HPos, VPos};
        let (width, height) = size(text, style);
        let (width, height) = (width as i32, height as i32);
        let left = match style.anchor().h_pos {
            HPos::Left => x,
            HPos::Center => x - width / 2,
            HPos::Right => x - width,
        };
        let middle = match style.anchor().v_pos {
            VPos::Top => y + height / 2,
            VPos::Center => y,
            VPos::Bottom => y - height / 2,
        };
        let (r, g, b) = style.color().rgb;
        if let (Ok(left), Ok(middle)) = (usize::try_from(left), usize::try_from(middle)) {
            self.0.text(text, (left, middle), &font(style), [r, g, b], Alignment::Left);
        }
        Ok(())
    }
}
