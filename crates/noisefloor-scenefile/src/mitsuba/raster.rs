//! A picture, ready to become textures.

pub(super) use crate::channels::linear;
use noisefloor::Rgb;
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
