//! PNG to display values.

use crate::colours::{Curve, Stated, ToRec709, Treatment, is_srgb};
use crate::error::{PictureError, PictureFault};
use crate::open::{Format, Opened, check_size, guarded};
use crate::picture::DisplayImage;
use noisefloor::Rgb;
use noisefloor::viewing::{Chromaticities, Viewing};
use png::{BitDepth, CodingIndependentCodePoints, SourceChromaticities, Transformations};
use std::io::{self, Read, Seek};
use std::ops::Range;
use std::path::Path;

/// Memory for everything in a PNG that is not pixels: rows, profiles, text.
const MAX_PNG_EXTRA: u64 = 256 << 20;
/// Most pixels that a byte of a PNG can stand for: deflate reaches 1032:1, and a pixel has at least one bit.
const PIXELS_A_BYTE: u64 = 1032 * 8;

/// Most chunks before the pixels in which colours are looked for.
const MAX_CHUNKS: usize = 10_000;

/// Reads a PNG as display values: sRGB-encoded RGB in 0…1, 8- or 16-bit codes divided by 255 or 65535.
///
/// Grey becomes three equal values; a palette is resolved. Alpha is dropped, not composited. Of an animation,
/// the first picture is read.
///
/// # Colours
/// A file that states no colours is taken for sRGB. Colours that it states are converted to sRGB, and clipped
/// to what that can show: `cICP` (the curves of sRGB, gamma, linear light, PQ and HLG; any primaries that a
/// number stands for), a profile of primaries and curves in `iCCP`, or `gAMA` and `cHRM`. Of several, the
/// first of these that is there is believed, as in the third edition of PNG (§4.3); `sRGB` comes after the
/// profile.
/// `gAMA` of 1/2.2 without other primaries means sRGB, as programs that write no `sRGB` intend. The white of
/// PQ and HLG is that of ITU-R BT.2408: 203 cd/m².
///
/// # Errors
/// [`PictureError`] if the file is not a PNG, is too long, too large (by its header) or broken, or states
/// colours that cannot be converted.
pub fn read_png(path: impl AsRef<Path>) -> Result<DisplayImage, PictureError> {
    let path = path.as_ref();
    let opened = Opened::open(path)?;
    if opened.format != Format::Png {
        return Err(opened.foreign(path, "a PNG file"));
    }
    decode(path, opened, &Viewing::default())
}

/// The colours of a file that states others than sRGB.
pub(crate) fn stated_colours(path: &Path, mut opened: Opened) -> Result<Option<Stated>, PictureError> {
    guarded(path, "PNG", || stated(path, &mut opened))
}

/// Alpha in 0…1, if there is any.
pub(crate) fn decode_alpha(path: &Path, opened: Opened) -> Result<Option<Vec<f32>>, PictureError> {
    guarded(path, "PNG", || {
        let stored = decode_raw(path, opened)?;
        let last = stored.channels - 1;
        Ok((last % 2 == 1).then(|| stored.pixels().map(|pixel| stored.code(pixel, last)).collect()))
    })
}

pub(crate) fn decode(
    path: &Path,
    mut opened: Opened,
    viewing: &Viewing,
) -> Result<DisplayImage, PictureError> {
    guarded(path, "PNG", || {
        let stated = stated(path, &mut opened)?;
        let stored = decode_raw(path, opened)?;
        // The one channel of a grey, or the first three
        let colours = if stored.channels < 3 { [0; 3] } else { [0, 1, 2] };
        let mut pixels: Vec<Rgb> =
            stored.pixels().map(|pixel| colours.map(|channel| stored.code(pixel, channel))).collect();
        let mut step = if stored.deep { 1.0 / 65535.0 } else { 1.0 / 255.0 };
        let Stored { width, height, .. } = stored;
        match stated.as_ref().map_or(Treatment::Keep, |stated| stated.on(viewing)) {
            Treatment::Keep => {}
            Treatment::Convert(stated) => step = stated.to_srgb(&mut pixels, step),
            Treatment::Refuse(stated) => {
                let (stated, advice) =
                    (stated.describe(), "save it with the colours that this display takes");
                return Err(PictureFault::Colours { stated, advice }.of(path));
            }
        }
        Ok(DisplayImage { width, height, pixels, step })
    })
}

/// The colours that the chunks before the pixels state; none if they are those of sRGB.
fn stated(path: &Path, opened: &mut Opened) -> Result<Option<Stated>, PictureError> {
    let broken = |reason: String| PictureFault::Broken { format: "PNG", reason }.of(path);
    let refused = |stated: String| {
        PictureFault::Colours { stated, advice: "save it with the colours of sRGB" }.of(path)
    };
    let io = |source| PictureFault::Io(source).of(path);
    let chunks = chunks_before_pixels(&mut opened.reader).map_err(io)?;
    opened.reader.rewind().map_err(io)?;
    let limits = png::Limits { bytes: MAX_PNG_EXTRA as usize };
    let reader = png::Decoder::new_with_limits(&mut opened.reader, limits).read_info();
    let reader = reader.map_err(|e| broken(e.to_string()))?;
    let info = reader.info();
    // The decoder passes over chunks that it cannot read; the colours of the file would be taken for sRGB
    let known = [
        (*b"cICP", info.coding_independent_code_points.is_some()),
        (*b"iCCP", info.icc_profile.is_some()),
        (*b"sRGB", info.srgb.is_some()),
        (*b"gAMA", info.gama_chunk.is_some()),
        (*b"cHRM", info.chrm_chunk.is_some()),
    ];
    let known = known.map(|(kind, read)| (kind, read, chunks.contains(&kind)));
    // What comes after one that is believed is not looked at; the last two are believed together
    let believed = known.iter().take(3).position(|(_, read, _)| *read).unwrap_or(known.len());
    if let Some((kind, ..)) = known.iter().take(believed).find(|(_, read, there)| *there && !read) {
        return Err(refused(format!("those of a chunk {}, which cannot be read", kind.escape_ascii())));
    }
    let found = if let Some(points) = info.coding_independent_code_points {
        Some(by_points(points).ok_or_else(|| refused(code_points(points)))?)
    } else if let Some(profile) = &info.icc_profile {
        Some(by_profile(profile).map_err(refused)?)
    } else if info.srgb.is_some() {
        None
    } else {
        let gamma = info.gama_chunk.map(|gamma| f64::from(gamma.into_scaled()) / 1e5);
        let gamut = info.chrm_chunk.map(chromaticities);
        by_gamma(gamma, gamut).map_err(refused)?
    };
    drop(reader);
    opened.reader.rewind().map_err(io)?;
    Ok(found.filter(|found| !is_srgb(found)))
}

/// The kinds of the chunks before the pixels, as far as there are chunks.
fn chunks_before_pixels(reader: &mut (impl Read + Seek)) -> io::Result<Vec<[u8; 4]>> {
    const SIGNATURE: i64 = 8;
    const CRC: i64 = 4;
    let mut kinds = Vec::new();
    reader.seek_relative(SIGNATURE)?;
    let mut header = [0; 8];
    while kinds.len() < MAX_CHUNKS {
        match reader.read_exact(&mut header) {
            Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => break,
            read => read?,
        }
        let [a, b, c, d, kind @ ..] = header;
        if kind == *b"IDAT" {
            break;
        }
        kinds.push(kind);
        reader.seek_relative(i64::from(u32::from_be_bytes([a, b, c, d])) + CRC)?;
    }
    Ok(kinds)
}

/// ITU-T H.273, tables 2 and 3. The curves of cameras are left out: programs disagree on how to show them.
fn by_points(points: CodingIndependentCodePoints) -> Option<Stated> {
    const DCI: Chromaticities = Chromaticities { white: [0.314, 0.351], ..Chromaticities::DISPLAY_P3 };
    let gamut = match points.color_primaries {
        1 => Chromaticities::REC709,
        9 => Chromaticities::REC2020,
        11 => DCI,
        12 => Chromaticities::DISPLAY_P3,
        _ => return None,
    };
    let curve = match points.transfer_function {
        4 => Curve::Power(2.2),
        5 => Curve::Power(2.8),
        8 => Curve::Power(1.0),
        13 => Curve::Srgb,
        16 => Curve::Pq,
        18 => Curve::Hlg,
        _ => return None,
    };
    let as_stored = points.matrix_coefficients == 0 && points.is_video_full_range_image;
    as_stored.then_some(Stated { gamut: Some(gamut), matrix: ToRec709::new(&gamut, None).ok()?, curve })
}

fn code_points(points: CodingIndependentCodePoints) -> String {
    let CodingIndependentCodePoints { color_primaries, transfer_function, matrix_coefficients, .. } = points;
    let range = if points.is_video_full_range_image { "full" } else { "narrow" };
    format!(
        "those of cICP {color_primaries}/{transfer_function}/{matrix_coefficients} in {range} range, \
         which are not known here"
    )
}

#[cfg(feature = "profiles")]
use crate::profile::stated as by_profile;

#[cfg(not(feature = "profiles"))]
fn by_profile(_: &[u8]) -> Result<Stated, String> {
    Err("those of a profile, which a build without the feature `profiles` does not read".into())
}

fn chromaticities(stated: SourceChromaticities) -> Chromaticities {
    let xy = |(x, y): (png::ScaledFloat, png::ScaledFloat)| [x, y].map(|v| f64::from(v.into_scaled()) / 1e5);
    let SourceChromaticities { white, red, green, blue } = stated;
    Chromaticities { red: xy(red), green: xy(green), blue: xy(blue), white: xy(white) }
}

/// `gAMA` and `cHRM`, of which either may be missing.
fn by_gamma(gamma: Option<f64>, gamut: Option<Chromaticities>) -> Result<Option<Stated>, String> {
    let colours = gamut.unwrap_or(Chromaticities::REC709);
    let matrix = ToRec709::new(&colours, None)
        .map_err(|()| "primaries or a white (cHRM) that no colours have".to_owned())?;
    let curve = match gamma {
        None => Curve::Srgb,
        // What sRGB stands for beside its own primaries (PNG, third edition, §11.3.2.5), or none
        Some(gamma) if matrix.is_none() && (gamma - 0.454_55).abs() < 1e-3 => Curve::Srgb,
        Some(gamma) if (0.1..=10.0).contains(&gamma) => Curve::Power(1.0 / gamma),
        Some(gamma) => return Err(format!("a gamma (gAMA) of {gamma}, which no display has")),
    };
    let nothing = gamma.is_none() && gamut.is_none();
    Ok((!nothing).then_some(Stated { gamut: Some(colours), matrix, curve }))
}

/// Pixels as they are stored, of one to four channels.
struct Stored {
    width: usize,
    height: usize,
    channels: usize,
    /// Of 16 bits, big-endian, in place of 8.
    deep: bool,
    bytes: Vec<u8>,
}

impl Stored {
    fn pixels(&self) -> Range<usize> {
        0..self.width * self.height
    }

    /// A channel of a pixel, as a share of the largest code.
    fn code(&self, pixel: usize, channel: usize) -> f32 {
        let at = pixel * self.channels + channel;
        if self.deep {
            f32::from(u16::from_be_bytes([self.bytes[2 * at], self.bytes[2 * at + 1]])) / 65535.0
        } else {
            f32::from(self.bytes[at]) / 255.0
        }
    }
}

fn decode_raw(path: &Path, opened: Opened) -> Result<Stored, PictureError> {
    let broken = |reason: String| PictureFault::Broken { format: "PNG", reason }.of(path);
    // Header: the size, and whether the file is long enough to hold that many pixels
    let limits = png::Limits { bytes: MAX_PNG_EXTRA as usize };
    let mut decoder = png::Decoder::new_with_limits(opened.reader, limits);
    decoder.set_transformations(Transformations::EXPAND);
    let mut reader = decoder.read_info().map_err(|e| broken(e.to_string()))?;
    let (width, height) = reader.info().size();
    let (width, height) = (width as usize, height as usize);
    check_size(path, (width, height), opened.most_pixels)?;
    if (width * height) as u64 > opened.bytes.saturating_mul(PIXELS_A_BYTE) {
        return Err(broken(format!("{} bytes cannot hold {width}×{height} pixels", opened.bytes)));
    }
    let (colours, depth) = reader.output_color_type();
    let (channels, deep) = (colours.samples(), depth == BitDepth::Sixteen);
    let mut bytes = vec![0; width * height * channels * if deep { 2 } else { 1 }];
    reader.next_frame(&mut bytes).map_err(|e| broken(e.to_string()))?;
    Ok(Stored { width, height, channels, deep, bytes })
}
