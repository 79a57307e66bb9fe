//! Encodes pictures and noise maps as PNG.

use super::verdicts::Tiles;
use crate::stack::png;
use image::ImageError;
use noisefloor::Rgb;

/// Range of the noise map, as in `noisefloor judge --noise-map`: logarithmic, 1 is just seen.
const SCALE: [f32; 2] = [0.25, 4.0];
/// Range of the map of JODs lost, as in `render --denoise`: from nothing that people see to what three of four do.
const LOST: [f32; 2] = [0.01, 1.0];

/// The picture as displayed, so many stops brighter.
pub(crate) fn shown(tiles: &Tiles, stops: f32) -> Result<Vec<u8>, ImageError> {
    let byte = |c: f32| (c.clamp(0.0, 1.0) * 255.0).round() as u8;
    let shown = |p: &Rgb| tiles.display.encode(p.map(|c| c * stops.exp2())).map(byte);
    let size = (tiles.grid.width(), tiles.grid.height());
    png(size, &tiles.still.pixels.iter().flat_map(shown).collect::<Vec<u8>>())
}

/// The map of visible noise; `None` if the descriptor has none.
pub(crate) fn noise(tiles: &Tiles) -> Option<Result<Vec<u8>, ImageError>> {
    let size = (tiles.grid.width(), tiles.grid.height());
    Some(coloured(size, tiles.noise.as_ref()?, SCALE))
}

/// The map of JODs lost, of a picture of this size.
pub(crate) fn lost(size: (usize, usize), map: &[f32]) -> Result<Vec<u8>, ImageError> {
    coloured(size, map, LOST)
}

fn coloured(size: (usize, usize), map: &[f32], scale: [f32; 2]) -> Result<Vec<u8>, ImageError> {
    png(size, &map.iter().flat_map(|&value| colour(value, scale)).collect::<Vec<u8>>())
}

fn colour(value: f32, [low, high]: [f32; 2]) -> [u8; 3] {
    let place = ((value.max(f32::MIN_POSITIVE) / low).ln() / (high / low).ln()).clamp(0.0, 1.0);
    colorous::INFERNO.eval_continuous(f64::from(place)).as_array()
}
