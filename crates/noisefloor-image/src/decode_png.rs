//! PNG to display values.

use crate::error::PictureError;
use crate::open::{Format, Opened, check_size, guarded};
use crate::picture::DisplayImage;
use image::codecs::png::PngDecoder;
use image::{DynamicImage, ImageDecoder, Limits};
use std::path::Path;

/// Memory for everything in a PNG that is not pixels: rows, profiles, text.
const MAX_PNG_EXTRA: u64 = 256 << 20;
/// Most pixels that a byte of a PNG can stand for: deflate reaches 1032:1, and a pixel has at least one bit.
const PIXELS_A_BYTE: u64 = 1032 * 8;

/// Reads a PNG as display values: sRGB-encoded RGB in 0…1, 8- or 16-bit codes divided by 255 or 65535.
///
/// Grey becomes three equal values; a palette is resolved. Alpha is dropped, not composited. Gamma,
/// chromaticity and colour profile chunks are ignored: values are assumed to be sRGB. Of an animation, the
/// first picture is read.
///
/// # Errors
/// [`PictureError`] if the file is not a PNG, is too long, too large (by its header) or broken.
pub fn read_png(path: impl AsRef<Path>) -> Result<DisplayImage, PictureError> {
    let path = path.as_ref();
    let opened = Opened::open(path)?;
    if opened.format != Format::Png {
        return Err(opened.foreign(path, "a PNG file"));
    }
    decode(path, opened)
}

/// Alpha in 0…1, if there is any.
pub(crate) fn decode_alpha(path: &Path, opened: Opened) -> Result<Option<Vec<f32>>, PictureError> {
    guarded(path, "PNG", || {
        let image = decode_raw(path, opened)?;
        let alpha =
            |image: DynamicImage| image.into_rgba16().pixels().map(|p| f32::from(p.0[3]) / 65535.0).collect();
        Ok(image.color().has_alpha().then(|| alpha(image)))
    })
}

pub(crate) fn decode(path: &Path, opened: Opened) -> Result<DisplayImage, PictureError> {
    guarded(path, "PNG", || {
        let image = decode_raw(path, opened)?;
        let (width, height) = (image.width() as usize, image.height() as usize);
        let deep = image.color().bytes_per_pixel() > image.color().channel_count();
        let (pixels, codes) = if deep {
            (image.into_rgb16().pixels().map(|p| p.0.map(|v| f32::from(v) / 65535.0)).collect(), 65535.0)
        } else {
            (image.into_rgb8().pixels().map(|p| p.0.map(|v| f32::from(v) / 255.0)).collect(), 255.0)
        };
        Ok(DisplayImage { width, height, pixels, step: 1.0 / codes })
    })
}

/// The pixels as they are stored.
fn decode_raw(path: &Path, opened: Opened) -> Result<DynamicImage, PictureError> {
    let broken = |reason: String| PictureError::Broken { path: path.to_owned(), format: "PNG", reason };
    // Header: the size, and whether the file is long enough to hold that many pixels
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(MAX_PNG_EXTRA);
    let decoder = PngDecoder::with_limits(opened.reader, limits).map_err(|e| broken(e.to_string()))?;
    let (width, height) = decoder.dimensions();
    let (width, height) = (width as usize, height as usize);
    check_size(path, (width, height), opened.most_pixels)?;
    if (width * height) as u64 > opened.bytes.saturating_mul(PIXELS_A_BYTE) {
        return Err(broken(format!("{} bytes cannot hold {width}×{height} pixels", opened.bytes)));
    }
    DynamicImage::from_decoder(decoder).map_err(|e| broken(e.to_string()))
}
