//! Encodes pictures and noise maps as PNG.

use super::verdicts::Tiles;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, ImageError};
use noisefloor::Rgb;

/// Range of the noise map, as in `noisefloor judge --noise-map`: logarithmic, 1 is just seen.
const SCALE: [f32; 2] = [0.25, 4.0];

/// The picture as displayed, so many stops brighter.
pub(crate) fn shown(tiles: &Tiles, stops: f32) -> Result<Vec<u8>, ImageError> {
    let byte = |c: f32| (c.clamp(0.0, 1.0) * 255.0).round() as u8;
    let shown = |p: &Rgb| tiles.display.encode(p.map(|c| c * stops.exp2())).map(byte);
    encode(tiles, tiles.still.pixels.iter().flat_map(shown).collect())
}

/// The map of visible noise; `None` if the descriptor has none.
pub(crate) fn noise(tiles: &Tiles) -> Option<Result<Vec<u8>, ImageError>> {
    let span = (SCALE[1] / SCALE[0]).ln();
    let colour = |value: &f32| {
        let place = ((value.max(f32::MIN_POSITIVE) / SCALE[0]).ln() / span).clamp(0.0, 1.0);
        colorous::INFERNO.eval_continuous(f64::from(place)).as_array()
    };
    Some(encode(tiles, tiles.noise.as_ref()?.iter().flat_map(colour).collect()))
}

fn encode(tiles: &Tiles, rgb: Vec<u8>) -> Result<Vec<u8>, ImageError> {
    let (width, height) = (tiles.grid.width() as u32, tiles.grid.height() as u32);
    let mut png = Vec::new();
    PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Sub).write_image(
        &rgb,
        width,
        height,
        ExtendedColorType::Rgb8,
    )?;
    Ok(png)
}
