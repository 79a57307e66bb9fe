//! Tiles side by side: the converged picture, what each criterion leaves, and the FLIP errors below.

use super::quality::Yardstick;
use super::race::{Entrant, Race};
use crate::heat_map::{Canvas, to_bytes};
use embedded_graphics::mono_font::iso_8859_1::FONT_7X13;
use embedded_graphics::text::Alignment;
use noisefloor::{Rgb, Tile};
use noisefloor_image::write_png;
use std::path::Path;

/// Edge of a crop on the sheet, about, in pixels: small tiles are enlarged by a whole number.
const EDGE: usize = 128;
const GAP: usize = 6;
const LETTERS: usize = 34;
/// FLIP error that gets the last colour.
pub const WORST_FLIP: f32 = 0.2;

/// Writes a sheet for each tile that is worth a look, and says what it shows: (file name, caption).
pub fn write(folder: &Path, race: &Race, yardstick: &Yardstick) -> anyhow::Result<Vec<(String, String)>> {
    // One of each family: those asked for by name come before those of a sweep.
    let mut shown: Vec<(&Entrant, Vec<Rgb>)> = Vec::new();
    for entrant in &race.entrants {
        if !shown.iter().any(|(e, _)| e.family == entrant.family) {
            shown.push((entrant, yardstick.encode(&entrant.film().image())));
        }
    }
    let mut sheets = Vec::new();
    for (name, tile, why) in choose(&shown, yardstick)? {
        let file = format!("crop-{name}.png");
        let sheet = draw(tile, &shown, yardstick)?;
        write_png(folder.join(&file), sheet.width, sheet.height, &sheet.bytes)?;
        sheets.push((file, format!("Tile {} at ({}, {}): {why}.", tile.index, tile.x, tile.y)));
    }
    Ok(sheets)
}

/// The tile that the first criterion leaves worst, and the one that the criteria disagree on most.
fn choose(
    shown: &[(&Entrant, Vec<Rgb>)],
    yardstick: &Yardstick,
) -> anyhow::Result<Vec<(&'static str, Tile, String)>> {
    let Some((first, picture)) = shown.first() else { return Ok(Vec::new()) };
    let grid = yardstick.grid();
    let largest = |values: Vec<f64>| {
        let best = values.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1));
        best.map(|(i, _)| grid.tile(i))
    };
    let errors = yardstick.flip_of_tiles(&yardstick.flip(picture)?);
    let disagreement = |tile: usize| {
        let spp = || shown.iter().map(|(e, _)| e.film().samples(tile).max(1) as f64);
        spp().fold(0.0, f64::max) / spp().fold(f64::INFINITY, f64::min)
    };
    let mut chosen = Vec::new();
    if let Some(tile) = largest(errors) {
        chosen.push(("worst", tile, format!("the one that {} leaves worst, by FLIP", first.spec)));
    }
    if let Some(tile) = largest((0..grid.len()).map(disagreement).collect()) {
        chosen.push(("disputed", tile, "the one whose samples differ most between the criteria".to_owned()));
    }
    Ok(chosen)
}

fn draw(tile: Tile, shown: &[(&Entrant, Vec<Rgb>)], yardstick: &Yardstick) -> anyhow::Result<Canvas> {
    let zoom = (EDGE / tile.width.max(tile.height)).max(1);
    let (width, height) = (tile.width * zoom, tile.height * zoom);
    let column = width.max(EDGE) + GAP;
    let mut canvas = Canvas::new(GAP + column * (shown.len() + 1), LETTERS + 2 * (height + GAP), [255; 3]);
    let image_width = yardstick.grid().width();
    let mut paste = |at: (usize, usize), bytes: &[u8]| {
        for y in 0..height {
            for x in 0..width {
                let pixel = (tile.y + y / zoom) * image_width + tile.x + x / zoom;
                let colour = [bytes[3 * pixel], bytes[3 * pixel + 1], bytes[3 * pixel + 2]];
                canvas.set(at.0 + x, at.1 + y, colour);
            }
        }
    };
    paste((GAP, LETTERS), &to_bytes(yardstick.shown()));
    for (i, (_, picture)) in shown.iter().enumerate() {
        let left = GAP + column * (i + 1);
        paste((left, LETTERS), &to_bytes(picture));
        let errors: Vec<u8> = yardstick
            .flip(picture)?
            .iter()
            .flat_map(|e| {
                colorous::MAGMA.eval_continuous(f64::from((e / WORST_FLIP).clamp(0.0, 1.0))).as_array()
            })
            .collect();
        paste((left, LETTERS + height + GAP), &errors);
    }
    let ink = [20; 3];
    let fits = column / 7;
    let mut label = |column_index: usize, line: usize, text: &str| {
        let text: String = text.chars().take(fits).collect();
        canvas.text(&text, (GAP + column * column_index, 9 + 15 * line), &FONT_7X13, ink, Alignment::Left);
    };
    label(0, 0, "reference");
    for (i, (entrant, _)) in shown.iter().enumerate() {
        label(i + 1, 0, &entrant.spec);
        label(i + 1, 1, &format!("{} spp", entrant.film().samples(tile.index)));
    }
    Ok(canvas)
}
