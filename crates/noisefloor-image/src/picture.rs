//! Pictures: linear or display-encoded, told apart by content.

use crate::error::PictureError;
use noisefloor::{Rgb, Still, check_image, srgb_decode};
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Longest file that is read, in bytes: an EXR of [`noisefloor::MAX_PIXELS`] pixels in 32-bit floats, and room to spare.
pub const MAX_FILE_BYTES: u64 = 1 << 32;

/// Scene-referred picture: linear RGB, Rec.709 primaries, arbitrary scale. Values may be negative or non-finite.
#[derive(Clone, Debug, PartialEq)]
pub struct LinearImage {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Row-major, `width * height` values.
    pub pixels: Vec<Rgb>,
}

/// Display-referred picture: sRGB-encoded RGB in 0…1, as an observer's monitor got it.
#[derive(Clone, Debug, PartialEq)]
pub struct DisplayImage {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Row-major, `width * height` values.
    pub pixels: Vec<Rgb>,
    /// Distance of neighbouring codes: 1/255 or 1/65535. Values are rounded to multiples of it.
    pub step: f32,
}

impl DisplayImage {
    /// The same picture in linear light, by [`srgb_decode`]. Values that the display clipped stay at 1: what was above
    /// is lost. One step of an 8-bit code is up to 0.9 % of full scale in linear light.
    pub fn to_linear(&self) -> LinearImage {
        let pixels = self.pixels.iter().map(|rgb| rgb.map(srgb_decode)).collect();
        LinearImage { width: self.width, height: self.height, pixels }
    }
}

/// A picture, and what its numbers mean.
#[derive(Clone, Debug, PartialEq)]
pub enum Picture {
    /// From an EXR or PFM file.
    Linear(LinearImage),
    /// From a PNG file.
    Display(DisplayImage),
}

impl Picture {
    /// Width and height in pixels.
    pub fn size(&self) -> (usize, usize) {
        match self {
            Picture::Linear(image) => (image.width, image.height),
            Picture::Display(image) => (image.width, image.height),
        }
    }

    /// Variance of the rounding of each display value: step²/12; 0 for a linear picture.
    pub fn rounding(&self) -> f32 {
        match self {
            Picture::Linear(_) => 0.0,
            Picture::Display(image) => image.step * image.step / 12.0,
        }
    }

    /// The picture in linear light; a PNG goes through [`DisplayImage::to_linear`].
    pub fn into_linear(self) -> LinearImage {
        match self {
            Picture::Linear(image) => image,
            Picture::Display(image) => image.to_linear(),
        }
    }
}

impl Picture {
    /// The picture, made of `spp` samples per pixel, to be held against others; see [`noisefloor::Held`].
    pub fn into_still(self, spp: f64) -> Still {
        let (size, rounding) = (self.size(), self.rounding());
        let display_referred = matches!(self, Picture::Display(_));
        Still { size, pixels: self.into_linear().pixels, spp, display_referred, rounding }
    }
}

/// Reads an EXR, a PFM or a PNG, whichever the first bytes say it is; the name does not matter.
///
/// # Errors
/// [`PictureError`]: those of [`read_exr`](crate::read_exr), [`read_pfm`](crate::read_pfm) and [`read_png`](crate::read_png),
/// and [`PictureError::Foreign`] if it is none of them.
pub fn read_picture(path: impl AsRef<Path>) -> Result<Picture, PictureError> {
    read_picture_within(path, noisefloor::MAX_PIXELS)
}

/// [`read_picture`] of at most `most` pixels: more are refused before any is allocated.
///
/// # Errors
/// Those of [`read_picture`], and [`PictureError::Large`].
pub fn read_picture_within(path: impl AsRef<Path>, most: usize) -> Result<Picture, PictureError> {
    let path = path.as_ref();
    let opened = Opened { most_pixels: most, ..Opened::open(path)? };
    match opened.format {
        Format::Exr => crate::decode_exr::decode(path, opened).map(Picture::Linear),
        Format::Pfm => crate::decode_pfm::decode(path, opened).map(Picture::Linear),
        Format::Png => crate::decode_png::decode(path, opened).map(Picture::Display),
        _ => Err(opened.foreign(path, "an OpenEXR, PFM or PNG file")),
    }
}

/// What the first bytes say.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Format {
    Exr,
    Pfm,
    Png,
    Empty,
    Other,
}

/// A regular file of bearable length, at its first byte, whose format is known.
pub(crate) struct Opened {
    pub(crate) reader: BufReader<File>,
    pub(crate) bytes: u64,
    pub(crate) format: Format,
    /// Most pixels that are decoded.
    pub(crate) most_pixels: usize,
}

impl Opened {
    pub(crate) fn open(path: &Path) -> Result<Self, PictureError> {
        let io = |source| PictureError::Io { path: path.to_owned(), source };

        // A pipe or a device would block or never end: only regular files are opened
        let meta = std::fs::metadata(path).map_err(io)?;
        if !meta.is_file() {
            let (found, wanted) = ("a folder or a device", "a regular file");
            return Err(PictureError::Foreign { path: path.to_owned(), found, wanted });
        }
        let bytes = meta.len();
        if bytes > MAX_FILE_BYTES {
            return Err(PictureError::Long { path: path.to_owned(), bytes, limit: MAX_FILE_BYTES });
        }

        let mut reader = BufReader::new(File::open(path).map_err(io)?);
        let mut magic = Vec::with_capacity(8);
        reader.by_ref().take(8).read_to_end(&mut magic).map_err(io)?;
        reader.rewind().map_err(io)?;
        let format = match magic.as_slice() {
            [] => Format::Empty,
            [0x76, 0x2f, 0x31, 0x01, ..] => Format::Exr,
            [b'P', b'F' | b'f', b'\n' | b'\r', ..] => Format::Pfm,
            [0x89, b'P', b'N', b'G', b'\r', b'\n', 0x1a, b'\n'] => Format::Png,
            _ => Format::Other,
        };
        Ok(Self { reader, bytes, format, most_pixels: noisefloor::MAX_PIXELS })
    }

    pub(crate) fn foreign(&self, path: &Path, wanted: &'static str) -> PictureError {
        let found = match self.format {
            Format::Exr => "an OpenEXR file",
            Format::Pfm => "a PFM file",
            Format::Png => "a PNG file",
            Format::Empty => "an empty file",
            Format::Other => "something else",
        };
        PictureError::Foreign { path: path.to_owned(), found, wanted }
    }
}

/// Checks a size from a header, before anything of that size is allocated.
pub(crate) fn check_size(
    path: &Path,
    (width, height): (usize, usize),
    most: usize,
) -> Result<(), PictureError> {
    check_image(width, height).map_err(|source| PictureError::Size { path: path.to_owned(), source })?;
    if width * height > most {
        return Err(PictureError::Large { path: path.to_owned(), width, height, most });
    }
    Ok(())
}

/// Runs a decoder. The decoders are other people's code over hostile bytes: where one of them panics, the file is broken, and
/// the program that reads it goes on. (Seen: exr 1.74 subtracts with overflow in corrupt B44 blocks, in builds that check
/// it.) No state outlives the call. The panic hook still runs, so a line about it appears on standard error; a program
/// built with `panic = "abort"` forgoes this.
pub(crate) fn guarded<T>(
    path: &Path,
    format: &'static str,
    decode: impl FnOnce() -> Result<T, PictureError>,
) -> Result<T, PictureError> {
    catch_unwind(AssertUnwindSafe(decode)).unwrap_or_else(|_| {
        let reason = "the decoder met a contradiction and gave up".to_owned();
        Err(PictureError::Broken { path: path.to_owned(), format, reason })
    })
}
