//! `.cube` files.

use crate::error::{PictureError, PictureFault};
use crate::open::Opened;
use noisefloor::display::{ColourLut, parse_cube};
use std::io::Read;
use std::path::Path;

/// Longest file, in bytes: a cube of the largest size, with 40 bytes a line.
const MAX_BYTES: u64 = 96 << 20;

/// Reads a `.cube` file: a 1D LUT, a 3D LUT, or a 1D LUT before a 3D one, as Resolve writes them.
///
/// # Errors
/// [`PictureError`] if the file cannot be read, is too long, or [broken](crate::CubeError).
pub fn read_cube(path: impl AsRef<Path>) -> Result<ColourLut, PictureError> {
    let path = path.as_ref();
    let Opened { reader, bytes, .. } = Opened::open(path)?;
    if bytes > MAX_BYTES {
        return Err(PictureFault::Long { bytes, limit: MAX_BYTES }.of(path));
    }
    let mut text = Vec::new();
    let io = |source| PictureFault::Io(source).of(path);
    reader.take(MAX_BYTES).read_to_end(&mut text).map_err(io)?;
    parse_cube(&text)
        .map_err(|error| PictureFault::Broken { format: "cube", reason: error.to_string() }.of(path))
}
