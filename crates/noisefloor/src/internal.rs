//! What other crates of this workspace share with this one; no part of its public interface, and without
//! promises.

mod text;

pub use crate::container::{Fault, Format};
pub use text::printable;

use crate::descriptor::Descriptor;
use crate::tile::{MAX_EDGE, MAX_PIXELS, TileError};

/// How far filters read beyond a tile, in pixels, and the edge of the blocks that a tile is divided into.
pub const HALO: usize = 8;

/// Luminance weights, squared and summed: variance of Y′ for unit variance of R′, G′ and B′.
pub const ROUNDING_LUMINANCE: f32 = 0.2126 * 0.2126 + 0.7152 * 0.7152 + 0.0722 * 0.0722;

/// Checks an image's size against the limits, before anything of that size is allocated.
///
/// # Errors
/// [`TileError::Image`] if it is empty or too large.
pub fn check_image(width: usize, height: usize) -> Result<(), TileError> {
    let fits = (1..=MAX_EDGE).contains(&width) && (1..=MAX_EDGE).contains(&height);
    if fits && width * height <= MAX_PIXELS { Ok(()) } else { Err(TileError::Image(width, height)) }
}

/// Distance of `point` to the nearest of `others`, which have its length; infinite if there are none.
pub fn nearest<'a>(others: impl IntoIterator<Item = &'a Vec<f32>>, point: &[f32]) -> f32 {
    let distance =
        |other: &Vec<f32>| other.iter().zip(point).map(|(a, b)| (a - b) * (a - b)).sum::<f32>().sqrt();
    others.into_iter().map(distance).fold(f32::INFINITY, f32::min)
}

/// The paper's first attempt, without a mask, which failed: the luminance of the tile and of what it is
/// compared with, pixel by pixel (Takouachet et al. 2017, §4.3, §4.4). 2·edge² numbers, for tiles of exactly
/// edge×edge pixels.
pub fn luminance_pair(edge: usize) -> Descriptor {
    Descriptor::luminance_pair(edge)
}
