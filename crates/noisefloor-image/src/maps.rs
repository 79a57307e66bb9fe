//! Numbers drawn over a picture: one a tile or one a pixel, in colours, with a legend.

use crate::atomic::write_atomic;
use crate::error::WriteError;
use crate::write::encode_png;
use colorous::INFERNO;
use embedded_graphics::mono_font::iso_8859_1::{FONT_6X10, FONT_7X13, FONT_7X13_BOLD};
use embedded_graphics::mono_font::{MonoFont, MonoTextStyle};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::*;
use embedded_graphics::text::{Alignment, Baseline, Text, TextStyleBuilder};
use noisefloor::{Rgb, Tile};
use std::collections::BTreeSet;
use std::convert::Infallible;
use std::path::Path;

/// One tile and the number to draw over it.
#[derive(Clone, Debug)]
pub struct TileMark {
    /// The tile.
    pub tile: Tile,
    /// Becomes the colour of the tile.
    pub value: f64,
    /// Written into the tile where there is room.
    pub label: String,
    /// Whether the tile is unfamiliar to the model: marked in its corner.
    pub unfamiliar: bool,
    /// Colour of a frame within the tile, and what it says in the legend, in eleven letters.
    pub frame: Option<([u8; 3], &'static str)>,
}

/// How values become colours.
#[derive(Clone, Copy, Debug)]
pub struct ColourScale {
    /// Heading of the legend, one or two short lines.
    pub title: &'static str,
    /// Value of the first colour.
    pub low: f64,
    /// Value of the last colour.
    pub high: f64,
    /// Logarithmic; `low` must then be positive.
    pub log: bool,
    /// The colours.
    pub colours: colorous::Gradient,
    /// A value to mark in the legend, and its name.
    pub landmark: Option<(f64, &'static str)>,
}

impl ColourScale {
    fn place(&self, value: f64) -> f64 {
        let f = |v: f64| if self.log { v.max(f64::MIN_POSITIVE).ln() } else { v };
        let span = f(self.high) - f(self.low);
        if span > 0.0 { ((f(value) - f(self.low)) / span).clamp(0.0, 1.0) } else { 0.5 }
    }

    fn value_at(&self, place: f64) -> f64 {
        if self.log {
            (self.low.ln() + place * (self.high.ln() - self.low.ln())).exp()
        } else {
            self.low + place * (self.high - self.low)
        }
    }

    fn colour(&self, value: f64) -> [u8; 3] {
        self.colours.eval_continuous(self.place(value)).as_array()
    }
}

/// The scale of visible noise, as multiples of what the asked share of people does not see: always the same, so that maps of different
/// pictures and stages compare.
pub const NOISE_SCALE: ColourScale = ColourScale {
    title: "visible noise\nseen above 1",
    low: 0.25,
    high: 4.0,
    log: true,
    colours: INFERNO,
    landmark: Some((1.0, "limit")),
};

/// An RGB picture to draw on, also with `embedded_graphics`. Whatever lies outside is left out.
#[derive(Clone, Debug, PartialEq)]
pub struct Canvas {
    width: usize,
    height: usize,
    pixels: Vec<[u8; 3]>,
}

impl OriginDimensions for Canvas {
    fn size(&self) -> Size {
        Size::new(self.width as u32, self.height as u32)
    }
}

impl DrawTarget for Canvas {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        for Pixel(at, colour) in pixels {
            if let (Ok(x), Ok(y)) = (usize::try_from(at.x), usize::try_from(at.y)) {
                self.set(x, y, [colour.r(), colour.g(), colour.b()]);
            }
        }
        Ok(())
    }
}

impl Canvas {
    /// A canvas of one colour, at most 65,536 pixels and a legend wide.
    pub fn new(width: usize, height: usize, colour: [u8; 3]) -> Self {
        Self { width, height, pixels: vec![colour; width * height] }
    }

    /// A display-encoded picture `width` pixels wide, in [0, 1]; an incomplete last row is left out.
    pub fn of_picture(width: usize, encoded: &[Rgb]) -> Self {
        Self::of_pixels(width, encoded.len() / width.max(1), |pixel| encoded[pixel])
    }

    /// A picture whose display-encoded pixels, in [0, 1], are computed from their row-major index.
    pub fn of_pixels(width: usize, height: usize, encoded: impl Fn(usize) -> Rgb) -> Self {
        let byte = |c: f32| (c.clamp(0.0, 1.0) * 255.0).round() as u8;
        let pixels = (0..width * height).map(|pixel| encoded(pixel).map(byte)).collect();
        Self { width, height, pixels }
    }

    /// An sRGB-encoded picture `width` pixels wide, row-major, three bytes a pixel; an incomplete last row is
    /// left out.
    pub fn of_bytes(width: usize, rgb: &[u8]) -> Self {
        let mut canvas = Self::new(width, rgb.len() / (3 * width.max(1)), PAPER);
        canvas.pixels.as_flattened_mut().iter_mut().zip(rgb).for_each(|(to, &from)| *to = from);
        canvas
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// sRGB-encoded, row-major, three bytes a pixel.
    pub fn bytes(&self) -> &[u8] {
        self.pixels.as_flattened()
    }

    /// Colours one pixel.
    pub fn set(&mut self, x: usize, y: usize, colour: [u8; 3]) {
        if x < self.width && y < self.height {
            self.pixels[y * self.width + x] = colour;
        }
    }

    /// Luminance of a pixel as displayed, 0 to 255.
    fn grey(&self, x: usize, y: usize) -> f32 {
        noisefloor::display::luminance(self.pixels[y * self.width + x].map(f32::from))
    }

    /// The canvas as a PNG file in memory.
    ///
    /// # Errors
    /// What the encoder says, if the canvas has no pixels.
    pub fn to_png(&self) -> Result<Vec<u8>, png::EncodingError> {
        let mut bytes = Vec::new();
        encode_png(&mut bytes, self.width, self.height, self.bytes())?;
        Ok(bytes)
    }

    /// Writes the canvas as PNG, atomically.
    ///
    /// # Errors
    /// Those of [`write_atomic`].
    pub fn save(&self, path: impl AsRef<Path>) -> Result<(), WriteError> {
        write_atomic(path, |to| encode_png(to, self.width, self.height, self.bytes()))
    }

    /// A white triangle with an edge of ink, its right angle at (x, y).
    fn corner(&mut self, x: usize, y: usize) {
        for row in 0..CORNER {
            for column in 0..CORNER - row {
                let on_edge = row == 0 || column == 0 || row + column >= CORNER - 2;
                self.set(x + column, y + row, if on_edge { INK } else { PAPER });
            }
        }
    }

    /// A frame two pixels wide, with ink inside, that begins at (x, y).
    fn frame(&mut self, (x, y): (usize, usize), (width, height): (usize, usize), colour: [u8; 3]) {
        for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column))) {
            let inset = row.min(column).min(height - 1 - row).min(width - 1 - column);
            if inset < 3 {
                self.set(x + column, y + row, if inset == 2 { INK } else { colour });
            }
        }
    }

    /// White letters around a centre, with dark outlines that keep them readable on any picture.
    pub fn label(&mut self, text: &str, (x, y): (usize, usize), font: &MonoFont<'_>) {
        for (dx, dy) in [(0, 1), (2, 1), (1, 0), (1, 2)] {
            self.text(
                text,
                ((x + dx).saturating_sub(1), (y + dy).saturating_sub(1)),
                font,
                INK,
                Alignment::Center,
            );
        }
        self.text(text, (x, y), font, [255; 3], Alignment::Center);
    }

    /// Letters in `colour`, their middle line at the height given.
    pub fn text(
        &mut self,
        text: &str,
        at: (usize, usize),
        font: &MonoFont<'_>,
        colour: [u8; 3],
        alignment: Alignment,
    ) {
        let style = TextStyleBuilder::new().alignment(alignment).baseline(Baseline::Middle).build();
        let character = MonoTextStyle::new(font, Rgb888::new(colour[0], colour[1], colour[2]));
        let at = Point::new(at.0 as i32, at.1 as i32);
        let Ok(_) = Text::with_text_style(text, at, character, style).draw(self);
    }
}

const LEGEND: usize = 104;
/// The legend needs some room.
const LEAST_HEIGHT: usize = 140;
/// Edge of the mark on unfamiliar tiles; fits into the smallest tile.
const CORNER: usize = 11;
/// Between lines of the legend.
const LINE: usize = 20;
const PAPER: [u8; 3] = [250, 250, 250];
const INK: [u8; 3] = [20, 20, 20];

/// Draws `marks` over a picture, legend at the right.
pub fn draw_tiles(picture: &Canvas, marks: &[TileMark], scale: &ColourScale) -> Canvas {
    let (width, height) = (picture.width(), picture.height());
    let frames: BTreeSet<([u8; 3], &str)> = marks.iter().filter_map(|mark| mark.frame).collect();
    let height = height.max(LEAST_HEIGHT + LINE * frames.len());
    let mut canvas = Canvas::new(width + LEGEND, height, PAPER);

    for mark in marks {
        tint(&mut canvas, picture, mark.tile, scale.colour(mark.value));
    }
    for mark in marks {
        frame(&mut canvas, mark);
    }

    let mut lowest = height - 16;
    if marks.iter().any(|m| m.unfamiliar) {
        canvas.corner(width + 12, lowest - 1);
        canvas.text("unfamiliar", (width + 27, lowest + 4), &FONT_7X13, INK, Alignment::Left);
        lowest -= LINE;
    }
    for (colour, name) in frames {
        canvas.frame((width + 12, lowest - 1), (CORNER, CORNER), colour);
        canvas.text(name, (width + 27, lowest + 4), &FONT_7X13, INK, Alignment::Left);
        lowest -= LINE;
    }
    draw_legend(&mut canvas, width, lowest, scale);
    canvas
}

/// The picture in grey below a colour, so that colour means only the value.
fn tint(canvas: &mut Canvas, picture: &Canvas, tile: Tile, colour: [u8; 3]) {
    let (columns, rows) = (tile.x..tile.x + tile.width, tile.y..tile.y + tile.height);
    for (x, y) in rows.flat_map(|y| columns.clone().map(move |x| (x, y))) {
        let grey = picture.grey(x, y);
        canvas.set(x, y, colour.map(|c| (0.55 * f32::from(c) + 0.45 * grey).round() as u8));
    }
}

/// Borders at the left and the top, the frame, the label, and the corner of an unfamiliar tile.
fn frame(canvas: &mut Canvas, TileMark { tile, label, unfamiliar, frame, .. }: &TileMark) {
    for x in tile.x..tile.x + tile.width {
        canvas.set(x, tile.y, INK);
    }
    for y in tile.y..tile.y + tile.height {
        canvas.set(tile.x, y, INK);
    }
    if let Some((colour, _)) = frame.filter(|_| tile.width.min(tile.height) > CORNER) {
        canvas.frame((tile.x + 1, tile.y + 1), (tile.width - 1, tile.height - 1), colour);
    }
    let (font, advance) = if tile.width >= 100 { (&FONT_7X13_BOLD, 7) } else { (&FONT_6X10, 6) };
    if label.len() * advance + 4 <= tile.width && tile.height >= 14 {
        let (x, y) = (tile.x + tile.width / 2, tile.y + tile.height / 2);
        canvas.label(label, (x, y), font);
    }
    if *unfamiliar {
        canvas.corner(tile.x + 1, tile.y + 1);
    }
}

/// Draws one value a pixel over a picture, legend at the right. The picture is dark and grey below the
/// colours; it stays bare where a value is NaN.
pub fn draw_field(picture: &Canvas, values: &[f32], scale: &ColourScale) -> Canvas {
    let (width, height) = (picture.width(), picture.height());
    let mut canvas = Canvas::new(width + LEGEND, height.max(LEAST_HEIGHT), PAPER);
    for (pixel, &value) in values.iter().enumerate().take(width * height) {
        let grey = picture.grey(pixel % width, pixel / width);
        let colour = if value.is_nan() { [0; 3] } else { scale.colour(f64::from(value)) };
        let blend = colour.map(|c| (0.7 * f32::from(c) + 0.3 * grey).round() as u8);
        canvas.set(pixel % width, pixel / width, blend);
    }
    draw_legend(&mut canvas, width, height.max(LEAST_HEIGHT) - 16, scale);
    canvas
}

fn draw_legend(canvas: &mut Canvas, width: usize, bottom: usize, scale: &ColourScale) {
    let left = width + 12;
    for (line, text) in scale.title.split('\n').enumerate() {
        canvas.text(text, (left, 14 + 15 * line), &FONT_7X13_BOLD, INK, Alignment::Left);
    }
    let top = 50;
    for y in top..=bottom {
        let place = (bottom - y) as f64 / (bottom - top) as f64;
        let colour = scale.colour(scale.value_at(place));
        for x in left..left + 18 {
            canvas.set(x, y, colour);
        }
    }
    for tick in 0..5 {
        let place = f64::from(tick) / 4.0;
        let y = bottom - ((bottom - top) as f64 * place) as usize;
        for x in left + 18..left + 23 {
            canvas.set(x, y, INK);
        }
        let value = scale.value_at(place);
        let digits = if scale.high <= 10.0 { 2 } else { 0 };
        let text = format!("{value:.digits$}");
        canvas.text(&text, (left + 27, y), &FONT_7X13, INK, Alignment::Left);
    }
    if let Some((value, name)) = scale.landmark {
        let y = bottom - ((bottom - top) as f64 * scale.place(value)) as usize;
        for x in left - 3..left + 23 {
            canvas.set(x, y, INK);
        }
        for x in left..left + 18 {
            canvas.set(x, y, PAPER);
        }
        canvas.text(name, (left + 59, y), &FONT_7X13, INK, Alignment::Left);
    }
}

#[cfg(test)]
mod tests;
