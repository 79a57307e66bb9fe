//! Opening files that may be hostile: what the decoders share.

use crate::error::{PictureError, PictureFault};
use noisefloor::viewing::Viewing;
use noisefloor::{text::stand_in, tile::check_image};
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Longest file that is read, in bytes: enough for an EXR of 2²⁸ pixels in 32-bit floats.
pub const MAX_FILE_BYTES: u64 = 1 << 32;

/// How a picture is read.
#[derive(Clone, Debug)]
pub struct ReadOptions {
    /// The display that it is to be shown on. It takes the codes of a PNG that states no colours, states sRGB, or
    /// states what the display takes, such as PQ; all others are converted to sRGB if it takes that.
    pub viewing: Viewing,
    /// Most pixels: a larger picture is refused before any pixel is allocated.
    pub most_pixels: usize,
    /// The layer of an EXR: its name, as in `ViewLayer.Combined`, or the end of it, as in `Combined`; capitals do not
    /// matter. Without it, see [`read_exr`](crate::read_exr).
    pub layer: Option<String>,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self { viewing: Viewing::default(), most_pixels: noisefloor::tile::MAX_PIXELS, layer: None }
    }
}

/// The format that the first bytes announce.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Format {
    Exr,
    Pfm,
    Png,
    Empty,
    /// Something else, and what if that is known.
    Other(Option<&'static str>),
}

/// A regular file of acceptable length and known format, positioned at its first byte.
pub(crate) struct Opened {
    pub(crate) reader: BufReader<File>,
    pub(crate) bytes: u64,
    pub(crate) format: Format,
    pub(crate) most_pixels: usize,
    /// The layer of an EXR that is asked for.
    pub(crate) layer: Option<String>,
}

impl Opened {
    pub(crate) fn open(path: &Path) -> Result<Self, PictureError> {
        let io = |source| PictureFault::Io(source).of(path);

        // Only regular files: a pipe or a device might block, or never end
        let meta = std::fs::metadata(path).map_err(io)?;
        if !meta.is_file() {
            let (found, wanted) = ("a folder or a device", "a regular file");
            return Err(PictureFault::Foreign { found, wanted }.of(path));
        }
        let bytes = meta.len();
        if bytes > MAX_FILE_BYTES {
            return Err(PictureFault::Long { bytes, limit: MAX_FILE_BYTES }.of(path));
        }

        let mut reader = BufReader::new(File::open(path).map_err(io)?);
        let mut start = Vec::with_capacity(64);
        reader.by_ref().take(64).read_to_end(&mut start).map_err(io)?;
        reader.rewind().map_err(io)?;
        let format = match start.as_slice() {
            [] => Format::Empty,
            // A flag of the version; the decoder takes deep parts for broken ones
            [0x76, 0x2f, 0x31, 0x01, _, flags, ..] if flags & 8 != 0 => {
                let (what, advice) = ("deep pixels are not read", "flatten the image");
                return Err(PictureFault::Unsupported { what, advice }.of(path));
            }
            [0x76, 0x2f, 0x31, 0x01, ..] => Format::Exr,
            [b'P', b'F' | b'f', b'\n' | b'\r', ..] => Format::Pfm,
            [0x89, b'P', b'N', b'G', b'\r', b'\n', 0x1a, b'\n', ..] => Format::Png,
            _ => Format::Other(stand_in(&start)),
        };
        Ok(Self { reader, bytes, format, most_pixels: noisefloor::tile::MAX_PIXELS, layer: None })
    }

    /// The layer that is asked for, which only an EXR has.
    pub(crate) fn with_layer(self, path: &Path, options: &ReadOptions) -> Result<Self, PictureError> {
        match (&options.layer, self.format) {
            (Some(layer), Format::Pfm | Format::Png) => Err(PictureFault::NoLayer {
                layer: layer.clone(),
                found: "none, as only EXR files have layers".to_owned(),
            }
            .of(path)),
            (layer, _) => Ok(Self { layer: layer.clone(), ..self }),
        }
    }

    pub(crate) fn foreign(&self, path: &Path, wanted: &'static str) -> PictureError {
        if let Format::Other(Some(instead)) = self.format {
            return PictureFault::StandIn(instead).of(path);
        }
        let found = match self.format {
            Format::Exr => "an OpenEXR file",
            Format::Pfm => "a PFM file",
            Format::Png => "a PNG file",
            Format::Empty => "an empty file",
            Format::Other(_) => "something else",
        };
        PictureFault::Foreign { found, wanted }.of(path)
    }
}

/// Checks a size from a header, before anything of that size is allocated.
pub(crate) fn check_size(
    path: &Path,
    (width, height): (usize, usize),
    most: usize,
) -> Result<(), PictureError> {
    check_image(width, height).map_err(|source| PictureFault::Size(source).of(path))?;
    if width * height > most {
        return Err(PictureFault::Large { width, height, most }.of(path));
    }
    Ok(())
}

/// Runs a decoder of a library over bytes that may be hostile. If the decoder panics, the file counts as
/// broken, and the program continues. (Known: exr 1.74 shifts and subtracts with overflow in corrupt B44
/// blocks, in builds that check it.) No state outlives the call. The panic hook still runs, so a line appears
/// on standard error. A program built with `panic = "abort"` loses this protection.
pub(crate) fn guarded<T>(
    path: &Path,
    format: &'static str,
    decode: impl FnOnce() -> Result<T, PictureError>,
) -> Result<T, PictureError> {
    catch_unwind(AssertUnwindSafe(decode)).unwrap_or_else(|_| {
        let reason = "its decoder found a contradiction".to_owned();
        Err(PictureFault::Broken { format, reason }.of(path))
    })
}
