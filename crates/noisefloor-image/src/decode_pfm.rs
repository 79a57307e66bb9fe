//! PFM to linear RGB.

use crate::error::{PictureError, PictureFault};
use crate::open::{Format, Opened, check_size};
use crate::picture::LinearImage;
use noisefloor::Rgb;
use std::io::{BufRead, Read};
use std::path::Path;

/// Longest header line in bytes.
const MAX_LINE: u64 = 256;

/// Reads a PFM: 32-bit floats, three per pixel (`PF`) or one (`Pf`, read as grey), in either byte order.
///
/// The header has three lines: the kind, width and height, and a number whose sign gives the byte order
/// (negative is little-endian). Its magnitude, a scale that programs disagree on, is ignored. Rows are stored
/// bottom first and returned top first. Non-finite values are kept. Bytes after the last pixel are ignored.
///
/// # Errors
/// [`PictureError`] if the file is not a PFM, is too long, too large (by its header) or broken.
pub fn read_pfm(path: impl AsRef<Path>) -> Result<LinearImage, PictureError> {
    let path = path.as_ref();
    let opened = Opened::open(path)?;
    if opened.format != Format::Pfm {
        return Err(opened.foreign(path, "a PFM file"));
    }
    decode(path, opened)
}

pub(crate) fn decode(path: &Path, mut opened: Opened) -> Result<LinearImage, PictureError> {
    let broken = |reason: &str| {
        let reason = reason.to_owned();
        PictureFault::Broken { format: "PFM", reason }.of(path)
    };
    let io = |source| PictureFault::Io(source).of(path);

    // Header
    let mut header = 0;
    let mut line = || -> Result<String, PictureError> {
        let mut bytes = Vec::new();
        header += opened.reader.by_ref().take(MAX_LINE).read_until(b'\n', &mut bytes).map_err(io)?;
        if bytes.pop() != Some(b'\n') {
            return Err(broken("a line of its header does not end"));
        }
        String::from_utf8(bytes).map_err(|_| broken("its header is not text"))
    };
    let channels = if line()?.trim_end() == "PF" { 3 } else { 1 };
    let size = line()?;
    let mut numbers = size.split_ascii_whitespace().map(str::parse::<usize>);
    let (Some(Ok(width)), Some(Ok(height)), None) = (numbers.next(), numbers.next(), numbers.next()) else {
        return Err(broken("its second line is not width and height"));
    };
    let scale: f64 = line()?.trim().parse().map_err(|_| broken("its third line is not a number"))?;
    if scale == 0.0 || scale.is_nan() {
        return Err(broken("its third line gives no byte order"));
    }
    check_size(path, (width, height), opened.most_pixels)?;

    // Pixels, if the file is long enough for them
    let bytes = width * height * channels * 4;
    if opened.bytes.saturating_sub(header as u64) < bytes as u64 {
        return Err(broken("it is too short for its size"));
    }
    let mut data = Vec::new();
    opened.reader.take(bytes as u64).read_to_end(&mut data).map_err(io)?;
    let value = |at: usize| {
        let bytes: [u8; 4] = data.get(4 * at..4 * at + 4).and_then(|b| b.try_into().ok()).unwrap_or_default();
        if scale < 0.0 { f32::from_le_bytes(bytes) } else { f32::from_be_bytes(bytes) }
    };
    if data.len() < bytes {
        return Err(broken("it was shortened while it was read"));
    }
    let pixel = |at: usize| -> Rgb {
        if channels == 3 { [0, 1, 2].map(|c| value(3 * at + c)) } else { [value(at); 3] }
    };
    let pixels = (0..height).rev().flat_map(|y| (y * width..(y + 1) * width).map(pixel)).collect();
    Ok(LinearImage { width, height, pixels })
}
