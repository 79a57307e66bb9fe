//! Pictures for textures and environments.

use crate::error::{LoadError, Place};
use crate::files::{Folder, MAX_FILE_BYTES};
use image::codecs::bmp::BmpDecoder;
use image::codecs::hdr::HdrDecoder;
use image::codecs::jpeg::JpegDecoder;
use image::codecs::png::PngDecoder;
use image::codecs::tga::TgaDecoder;
use image::codecs::webp::WebPDecoder;
use image::{DynamicImage, ImageDecoder, ImageFormat, Limits};
use noisefloor::{Rgb, display::srgb_decode};
use noisefloor_ptwne::{MAX_TEXTURE_PIXELS, Pixels};
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Memory for what a decoder keeps besides the pixels: rows, profiles, text.
const MAX_EXTRA: u64 = 64 << 20;
/// Most pixels that a byte of a file can stand for: deflate packs at best 1032:1, and a pixel has at least
/// one bit. The other formats pack less, but for WebP: a picture of one colour has no bits, whatever its size, and may
/// have the second number.
const PIXELS_A_BYTE: u64 = 1032 * 8;
const PLAIN_PIXELS: u64 = 1 << 24;

/// A picture as its file has it.
#[derive(Debug)]
pub(crate) struct Picture {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// Row-major from the top left.
    pub(crate) samples: Samples,
}

#[derive(Debug)]
pub(crate) enum Samples {
    /// Codes of 8 bits with alpha, usually sRGB-encoded. Grey is three equal codes; without alpha, it is 255.
    Eight(Vec<[u8; 4]>),
    /// Codes of 16 bits, as above.
    Sixteen(Vec<[u16; 4]>),
    /// Linear values, from EXR and Radiance files. They may be negative or not finite.
    Linear(Vec<Rgb>),
}

impl Samples {
    /// Their colours; codes are taken as they are if they are `raw`, for sRGB otherwise.
    pub(crate) fn pixels(self, raw: bool) -> Pixels {
        match self {
            Self::Eight(codes) => {
                let codes = codes.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect();
                if raw { Pixels::Linear8(codes) } else { Pixels::Srgb8(codes) }
            }
            Self::Sixteen(codes) => {
                let linear = |code: u16| {
                    let value = f32::from(code) / 65535.0;
                    if raw { value } else { srgb_decode(value) }
                };
                Pixels::Float(codes.iter().map(|[r, g, b, _]| [*r, *g, *b].map(linear)).collect())
            }
            Self::Linear(values) => Pixels::Float(values.into()),
        }
    }
}

/// Reads the EXR, PFM, Radiance, PNG, JPEG, WebP, BMP or TGA file in `path`, named at `place`. Its content says
/// which it is, not its name, but for TGA, which has no mark.
///
/// # Errors
/// [`LoadError`] if the file cannot be read, is of another format, broken, or has more than
/// [`MAX_TEXTURE_PIXELS`] pixels (known from its header).
pub(crate) fn read(folder: &Folder, path: &Path, place: &Place) -> Result<Picture, LoadError> {
    let bytes = folder.read(path, MAX_FILE_BYTES, place)?;
    let here = Place::file(path);
    let linear = match bytes.as_slice() {
        [0x76, 0x2f, 0x31, 0x01, ..] => noisefloor_image::read_exr(path),
        [b'P', b'F' | b'f', b'\n' | b'\r', ..] => noisefloor_image::read_pfm(path),
        _ => {
            let tga = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("tga"));
            return decode_as(folder, &bytes, tga.then_some(ImageFormat::Tga), &here);
        }
    };
    let image = linear.map_err(|e| here.bad(e))?;
    check_size(image.width as u64, image.height as u64, &here)?;
    folder.draw((image.width * image.height) as u64, &here)?;
    Ok(Picture { width: image.width, height: image.height, samples: Samples::Linear(image.pixels) })
}

/// Decodes the Radiance, PNG, JPEG, WebP or BMP file `bytes`, which are at `place`.
pub(crate) fn decode(folder: &Folder, bytes: &[u8], place: &Place) -> Result<Picture, LoadError> {
    decode_as(folder, bytes, None, place)
}

/// As [`decode`], of a format that is known, or else has a mark.
fn decode_as(
    folder: &Folder,
    bytes: &[u8],
    format: Option<ImageFormat>,
    place: &Place,
) -> Result<Picture, LoadError> {
    let broken = |e: image::ImageError| place.bad(format!("the picture is broken: {e}"));
    // A Radiance picture begins with `#?` and any word: RGBE, RADIANCE, rtrace. The decoder knows one
    let renamed = bytes.strip_prefix(b"#?").map(|rest| {
        let line = rest.iter().position(|b| *b == b'\n').unwrap_or(rest.len());
        [b"#?RADIANCE".as_slice(), &rest[line..]].concat()
    });
    let bytes = renamed.as_deref().unwrap_or(bytes);
    let format = image::guess_format(bytes).ok().or(format);
    let reader = Cursor::new(bytes);
    let most = (bytes.len() as u64).saturating_mul(PIXELS_A_BYTE);
    let most = if format == Some(ImageFormat::WebP) { most.max(PLAIN_PIXELS) } else { most };
    let room = Room { bytes: bytes.len(), most, folder, place };
    // The decoders are other people's code over hostile bytes: where one of them panics, the file is broken,
    // and the program that reads it continues. No state outlives the call.
    let decoded = catch_unwind(AssertUnwindSafe(|| match format {
        Some(ImageFormat::Png) => {
            let mut limits = Limits::no_limits();
            limits.max_alloc = Some(MAX_EXTRA);
            pixels(PngDecoder::with_limits(reader, limits).map_err(broken)?, room)
        }
        Some(ImageFormat::Jpeg) => pixels(JpegDecoder::new(reader).map_err(broken)?, room),
        Some(ImageFormat::Hdr) => pixels(HdrDecoder::new(reader).map_err(broken)?, room),
        Some(ImageFormat::WebP) => pixels(WebPDecoder::new(reader).map_err(broken)?, room),
        Some(ImageFormat::Bmp) => pixels(BmpDecoder::new(reader).map_err(broken)?, room),
        Some(ImageFormat::Tga) => pixels(TgaDecoder::new(reader).map_err(broken)?, room),
        _ => {
            let what = match bytes {
                [0xab, b'K', b'T', b'X', ..] => "a KTX2 picture (KHR_texture_basisu)",
                _ => "a picture that is neither PNG, JPEG, WebP, BMP, TGA, PFM, OpenEXR nor Radiance",
            };
            Err(place.unsupported(what))
        }
    }));
    decoded.unwrap_or_else(|_| Err(place.bad("the picture is broken: its decoder gave up")))
}

/// How many pixels a file may have.
#[derive(Clone, Copy)]
struct Room<'a> {
    bytes: usize,
    /// Most pixels that as many bytes can stand for.
    most: u64,
    /// Counts those of all pictures.
    folder: &'a Folder,
    place: &'a Place,
}

/// The pixels behind a decoder that has read the header of a file.
fn pixels(decoder: impl ImageDecoder, room: Room<'_>) -> Result<Picture, LoadError> {
    let Room { bytes, most, folder, place } = room;
    let (width, height) = decoder.dimensions();
    check_size(u64::from(width), u64::from(height), place)?;
    let count = u64::from(width) * u64::from(height);
    if count > most {
        return Err(place.bad(format!("{bytes} bytes cannot hold {width}×{height} pixels")));
    }
    folder.draw(count, place)?;
    let image =
        DynamicImage::from_decoder(decoder).map_err(|e| place.bad(format!("the picture is broken: {e}")))?;
    let samples = match image {
        DynamicImage::ImageLuma16(_)
        | DynamicImage::ImageLumaA16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba16(_) => {
            Samples::Sixteen(image.into_rgba16().pixels().map(|p| p.0).collect())
        }
        DynamicImage::ImageRgb32F(_) | DynamicImage::ImageRgba32F(_) => {
            Samples::Linear(image.into_rgb32f().pixels().map(|p| p.0).collect())
        }
        _ => Samples::Eight(image.into_rgba8().pixels().map(|p| p.0).collect()),
    };
    Ok(Picture { width: width as usize, height: height as usize, samples })
}

/// Checks a size from a header, before anything of that size is allocated.
fn check_size(width: u64, height: u64, place: &Place) -> Result<(), LoadError> {
    if width == 0 || height == 0 {
        return Err(place.bad("the picture is empty"));
    }
    place.at_most("pixels", width.saturating_mul(height), MAX_TEXTURE_PIXELS as u64)
}
