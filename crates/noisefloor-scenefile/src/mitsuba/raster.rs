//! A picture, ready to become textures.

use noisefloor::{Rgb, srgb_decode};
use noisefloor_ptwne::Pixels;

/// A picture, ready for textures.
#[derive(Clone, Debug)]
pub(super) struct Raster {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) pixels: Pixels,
}

impl Raster {
    /// Width, height, and linear values.
    pub(super) fn linear(&self) -> (usize, usize, Vec<Rgb>) {
        (self.width, self.height, linear(&self.pixels))
    }
}

/// Linear values of pixels.
pub(super) fn linear(pixels: &Pixels) -> Vec<Rgb> {
    let linear = |code: u8| f32::from(code) / 255.0;
    match pixels {
        Pixels::Srgb8(codes) => codes.iter().map(|p| p.map(|code| srgb_decode(linear(code)))).collect(),
        Pixels::Linear8(codes) => codes.iter().map(|p| p.map(linear)).collect(),
        Pixels::Float(values) => values.to_vec(),
    }
}
