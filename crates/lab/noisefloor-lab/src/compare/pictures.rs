//! What each criterion leaves, and tiles side by side: the converged picture, what each criterion leaves of
//! it, and the FLIP errors below.

use super::quality::Yardstick;
use super::race::Entrant;
use crate::error::LabError;
use embedded_graphics::mono_font::iso_8859_1::FONT_7X13;
use embedded_graphics::text::Alignment;
use noisefloor::{Rgb, Tile};
use noisefloor_image::maps::Canvas;

/// Edge of a tile on the sheet, about, in pixels: small tiles are enlarged by a whole number.
const EDGE: usize = 128;
const GAP: usize = 6;
const LETTERS: usize = 34;
const INK: [u8; 3] = [20; 3];
/// FLIP error that gets the last colour.
pub(super) const WORST_FLIP: f32 = 0.2;

/// One tile as everybody leaves it.
#[derive(Clone, Debug)]
pub struct Crop {
    /// Which one: `worst` or `disputed`.
    pub name: &'static str,
    /// What it shows, for people.
    pub caption: String,
    pub sheet: Canvas,
}

/// What there is to see of a comparison.
#[derive(Clone, Debug)]
pub struct Pictures {
    pub reference: Canvas,
    /// Each criterion as it was asked for, and its picture.
    pub criteria: Vec<(String, Canvas)>,
    /// Tiles that are worth a look.
    pub crops: Vec<Crop>,
}

pub(super) struct Seen<'a> {
    entrant: &'a Entrant,
    /// Display-encoded.
    shown: Vec<Rgb>,
    /// FLIP errors, pixel by pixel.
    pub(super) errors: Vec<f32>,
}

impl<'a> Seen<'a> {
    pub(super) fn new(entrant: &'a Entrant, yardstick: &Yardstick) -> Result<Self, LabError> {
        let shown = yardstick.encode(&entrant.film().image());
        let errors = yardstick.flip(&shown)?;
        Ok(Self { entrant, shown, errors })
    }
}

impl Pictures {
    pub(super) fn new(seen: &[Seen<'_>], yardstick: &Yardstick) -> Self {
        // Of each family the first: those asked for by name come before those of a sweep
        let mut first: Vec<&Seen<'_>> = Vec::new();
        for one in seen {
            if !first.iter().any(|other| other.entrant.family == one.entrant.family) {
                first.push(one);
            }
        }
        let canvas = |shown: &[Rgb]| Canvas::of_picture(yardstick.grid().width(), shown);
        let crop = |(name, tile, why): (&'static str, Tile, String)| Crop {
            name,
            caption: format!("Tile {} at ({}, {}): {why}.", tile.index, tile.x, tile.y),
            sheet: draw(tile, &first, yardstick),
        };
        Self {
            reference: canvas(yardstick.shown()),
            criteria: seen.iter().map(|one| (one.entrant.spec.clone(), canvas(&one.shown))).collect(),
            crops: choose(&first, yardstick).into_iter().map(crop).collect(),
        }
    }
}

/// The tile that the first criterion leaves worst, and the one that the criteria disagree on most.
fn choose(seen: &[&Seen<'_>], yardstick: &Yardstick) -> Vec<(&'static str, Tile, String)> {
    let Some(first) = seen.first() else { return Vec::new() };
    let grid = yardstick.grid();
    let largest = |values: Vec<f64>| {
        let best = values.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        best.map(|(i, _)| grid.tile(i))
    };
    let disagreement = |tile: usize| {
        let spp = || seen.iter().map(|one| one.entrant.film().spp(tile).max(1) as f64);
        spp().fold(0.0, f64::max) / spp().fold(f64::INFINITY, f64::min)
    };
    let worst = largest(yardstick.flip_of_tiles(&first.errors))
        .map(|tile| ("worst", tile, format!("the one that {} leaves worst, by FLIP", first.entrant.spec)));
    let why = "the one whose samples differ most between the criteria".to_owned();
    let disputed = largest((0..grid.len()).map(disagreement).collect()).map(|tile| ("disputed", tile, why));
    worst.into_iter().chain(disputed).collect()
}

/// A sheet with a column for the converged picture and one for each criterion.
fn draw(tile: Tile, seen: &[&Seen<'_>], yardstick: &Yardstick) -> Canvas {
    let zoom = (EDGE / tile.width.max(tile.height)).max(1);
    let (width, height) = (tile.width * zoom, tile.height * zoom);
    let column = width.max(EDGE) + GAP;
    let mut sheet = Canvas::new(GAP + column * (seen.len() + 1), LETTERS + 2 * (height + GAP), [255; 3]);
    let image_width = yardstick.grid().width();
    let mut paste = |at: (usize, usize), colour: &dyn Fn(usize) -> [u8; 3]| {
        for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
            let pixel = (tile.y + y / zoom) * image_width + tile.x + x / zoom;
            sheet.set(at.0 + x, at.1 + y, colour(pixel));
        }
    };
    let byte = |c: f32| (c.clamp(0.0, 1.0) * 255.0).round() as u8;
    paste((GAP, LETTERS), &|pixel| yardstick.shown()[pixel].map(byte));
    for (i, one) in seen.iter().enumerate() {
        let left = GAP + column * (i + 1);
        paste((left, LETTERS), &|pixel| one.shown[pixel].map(byte));
        paste((left, LETTERS + height + GAP), &|pixel| {
            let error = f64::from((one.errors[pixel] / WORST_FLIP).clamp(0.0, 1.0));
            colorous::MAGMA.eval_continuous(error).as_array()
        });
    }
    let mut label = |column_index: usize, line: usize, text: &str| {
        let text: String = text.chars().take(column / 7).collect();
        sheet.text(&text, (GAP + column * column_index, 9 + 15 * line), &FONT_7X13, INK, Alignment::Left);
    };
    label(0, 0, "reference");
    for (i, one) in seen.iter().enumerate() {
        label(i + 1, 0, &one.entrant.spec);
        label(i + 1, 1, &format!("{} spp", one.entrant.film().spp(tile.index)));
    }
    sheet
}
