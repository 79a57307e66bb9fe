//! EXR to linear RGB.
//!
//! Built on the block layer of the `exr` crate rather than on its image layer. This way sizes are checked
//! after the header and before the pixels, only the blocks of one part are decoded, and the data window can
//! be placed in the display window.

use crate::colours::ToRec709;
use crate::error::PictureError;
use crate::open::{Format, Opened, check_size, guarded};
use crate::picture::LinearImage;
use exr::block::UncompressedBlock;
use exr::block::reader::ChunksReader;
use exr::meta::attribute::SampleType;
use exr::meta::header::Header;
use exr::prelude::f16;
use noisefloor::{Rgb, viewing::Chromaticities};
use std::collections::HashSet;
use std::path::Path;

/// Bytes of pixels that a byte of a file can stand for, in any compression: deflate reaches 1032:1, and PXR24
/// leaves out every fourth byte besides. More is a lie, however the rest of the file looks.
const MAX_EXPANSION: u64 = 1376;
/// Pixels of black around a data window that every file may have; longer files may have more.
const FREE_PIXELS: u64 = 1 << 24;
/// Largest block (tile or group of scan lines, all channels) that is decompressed, in bytes.
const MAX_BLOCK_BYTES: usize = 1 << 30;
/// Most channels named in an error message.
const NAMES_SHOWN: usize = 20;

/// Reads the colours of an EXR: 16- or 32-bit floats, or unsigned integers, in any compression the `exr`
/// crate supports.
///
/// Of several parts and layers, the first with R, G and B is read: in each part the unnamed one, then one
/// named `Combined` (as in `ViewLayer.Combined.R`), then the first in alphabetical order. If there is none, a
/// lone unnamed Y is read as grey. Other channels are ignored, alpha among them; colour is as stored, that
/// is, premultiplied.
///
/// The picture is the display window. Where the data window is smaller, pixels are black; where it is larger
/// (overscan), it is cropped. Of mip maps, the full resolution is read. Non-finite values are kept.
///
/// Colours become linear Rec.709 with a white of D65. A file says by its attribute `chromaticities` that it
/// has others, such as ACES AP0 or AP1, XYZ, P3 or Rec.2020; what is white there, or its `adoptedNeutral`, is
/// white afterwards (Bradford's adaptation). Without the attribute, colours are Rec.709.
///
/// # Errors
/// [`PictureError`] if the file is not an EXR, is too long, too large (by its header) or broken, has no
/// colour channels, holds deep or subsampled pixels, or states chromaticities that no colours have.
pub fn read_exr(path: impl AsRef<Path>) -> Result<LinearImage, PictureError> {
    let path = path.as_ref();
    let opened = Opened::open(path)?;
    if opened.format != Format::Exr {
        return Err(opened.foreign(path, "an OpenEXR file"));
    }
    decode(path, opened)
}

pub(crate) fn decode(path: &Path, opened: Opened) -> Result<LinearImage, PictureError> {
    guarded(path, "EXR", || decode_unguarded(path, opened, choose))
}

/// The layers with colours, the one that is read first, and whether that one has alpha.
pub(crate) struct Layout {
    pub(crate) layers: Vec<String>,
    pub(crate) has_alpha: bool,
}

pub(crate) fn layout_of(path: &Path, opened: Opened) -> Result<Layout, PictureError> {
    guarded(path, "EXR", || {
        let broken = |reason: String| PictureError::Broken { path: path.to_owned(), format: "EXR", reason };
        let reader = exr::block::read(opened.reader, false).map_err(|e| broken(e.to_string()))?;
        let parts = reader.headers();
        let names = channel_names(parts);
        let full = |part: usize, layer: &str| {
            let name = parts[part].own_attributes.layer_name.as_ref().map(ToString::to_string);
            let prefix = name.filter(|_| parts.len() > 1).map(|name| format!("{name}.")).unwrap_or_default();
            format!("{prefix}{layer}").trim_end_matches('.').to_owned()
        };
        let coloured = |(part, names): (usize, &'_ Vec<String>)| -> Vec<String> {
            coloured_layers(names).into_iter().map(|(layer, _)| full(part, layer)).collect()
        };
        let layers = names.iter().enumerate().flat_map(coloured).collect();
        Ok(Layout { layers, has_alpha: choose_alpha(path, parts).is_ok() })
    })
}

/// Alpha of the layer that is read, as grey.
pub(crate) fn alpha_of(path: &Path, opened: Opened) -> Result<LinearImage, PictureError> {
    guarded(path, "EXR", || decode_unguarded(path, opened, choose_alpha))
}

fn decode_unguarded(
    path: &Path,
    opened: Opened,
    choose: fn(&Path, &[Header]) -> Result<Choice, PictureError>,
) -> Result<LinearImage, PictureError> {
    let broken = |reason: String| PictureError::Broken { path: path.to_owned(), format: "EXR", reason };

    // Headers: which part, which channels, how large; nothing that the file is too short for
    let most = opened.most_pixels;
    let reader = exr::block::read(opened.reader, false).map_err(|e| match e {
        // The decoder refuses a whole file for it
        exr::error::Error::NotSupported(what) if what.contains("subsampl") => subsampled(path),
        e => broken(e.to_string()),
    })?;
    let choice = choose(path, reader.headers())?;
    let part = reader.headers()[choice.part].clone();
    check_part(path, &part, most)?;
    let blocks = reader.headers().iter().try_fold(0usize, |sum, h| sum.checked_add(h.chunk_count));
    if blocks.and_then(|n| n.checked_mul(8)).is_none_or(|table| table as u64 > opened.bytes) {
        return Err(broken(format!("{} bytes cannot hold as many blocks as the header says", opened.bytes)));
    }
    let colours = if choice.is_grey() { None } else { to_rec709(path, &part)? };
    let window = Window::of(path, &part, most)?;
    let decoded = (part.layer_size.area() as u64).saturating_mul(part.channels.bytes_per_pixel.max(1) as u64);
    let shown = (window.width * window.height) as u64;
    let budget = opened.bytes.saturating_mul(MAX_EXPANSION);
    if decoded > budget || shown > FREE_PIXELS.saturating_add(budget) {
        let (width, height) = (window.width, window.height);
        return Err(broken(format!("{} bytes cannot hold {width}×{height} pixels", opened.bytes)));
    }

    // Pixels start black, if there is memory for them
    let refused =
        |_| PictureError::Memory { path: path.to_owned(), width: window.width, height: window.height };
    Vec::<Rgb>::new().try_reserve_exact(window.width * window.height).map_err(refused)?;
    let mut pixels = vec![[0.0; 3]; window.width * window.height];

    // Blocks, one after another in this thread: a decoder that panics in a thread pool would end the process
    let wanted =
        move |block: exr::block::BlockIndex| block.layer == choice.part && block.level.0 + block.level.1 == 0;
    let chunks =
        reader.filter_chunks(false, |_, _, block| wanted(block)).map_err(|e| broken(e.to_string()))?;
    let mut decompressor = chunks.sequential_decompressor(false);
    let (mut seen, mut area) = (HashSet::new(), 0);
    while let Some(block) = decompressor.decompress_next_block() {
        let block = block.map_err(|e| broken(e.to_string()))?;
        if wanted(block.index) && seen.insert((block.index.pixel_position.0, block.index.pixel_position.1)) {
            area += block.index.pixel_size.area();
            place(&block, &part, choice.channels, &window, &mut pixels).map_err(|e| broken(e.to_string()))?;
        }
    }
    if area != part.layer_size.area() {
        return Err(broken(format!("it holds {area} of {} pixels", part.layer_size.area())));
    }
    if let Some(colours) = colours {
        pixels.iter_mut().for_each(|pixel| *pixel = colours.convert(*pixel));
    }
    Ok(LinearImage { width: window.width, height: window.height, pixels })
}

/// How the colours of a part become those of Rec.709, if they are others.
fn to_rec709(path: &Path, part: &Header) -> Result<Option<ToRec709>, PictureError> {
    let Some(stated) = &part.shared_attributes.chromaticities else { return Ok(None) };
    let [red, green, blue, white] =
        [&stated.red, &stated.green, &stated.blue, &stated.white].map(|c| [f64::from(c.0), f64::from(c.1)]);
    let neutral = part.own_attributes.adopted_neutral.map(|c| [f64::from(c.0), f64::from(c.1)]);
    ToRec709::new(&Chromaticities { red, green, blue, white }, neutral).map_err(|()| PictureError::Colours {
        path: path.to_owned(),
        stated: format!("chromaticities that no colours have: {red:?}, {green:?}, {blue:?}, white {white:?}"),
        advice: "correct the attribute, or remove it if the colours are Rec.709",
    })
}

/// A part of the file, and the indices of R, G and B in its list of channels.
#[derive(Clone, Copy)]
struct Choice {
    part: usize,
    channels: [usize; 3],
}

impl Choice {
    /// One channel for all three: Y or alpha.
    fn is_grey(&self) -> bool {
        self.channels[0] == self.channels[1]
    }
}

/// The names of the channels of each part.
fn channel_names(parts: &[Header]) -> Vec<Vec<String>> {
    parts.iter().map(|part| part.channels.list.iter().map(|c| c.name.to_string()).collect()).collect()
}

/// The layers of a part that have colours, the most likely picture first, with the places of R, G and B.
fn coloured_layers(names: &[String]) -> Vec<(&str, [usize; 3])> {
    let colours = |layer: &str| {
        let at = |channel: &str| names.iter().position(|name| *name == format!("{layer}{channel}"));
        Some([at("R")?, at("G")?, at("B")?])
    };
    layers(names).into_iter().filter_map(|layer| Some((layer, colours(layer)?))).collect()
}

/// Alpha beside the colours that are read.
fn choose_alpha(path: &Path, parts: &[Header]) -> Result<Choice, PictureError> {
    let Choice { part, channels } = choose(path, parts)?;
    let names = &channel_names(parts)[part];
    let red = &names[channels[0]];
    let alpha = format!("{}A", red.strip_suffix(['R', 'Y']).unwrap_or_default());
    match names.iter().position(|name| *name == alpha) {
        Some(alpha) => Ok(Choice { part, channels: [alpha; 3] }),
        None => {
            Err(PictureError::Channels { path: path.to_owned(), missing: alpha, found: names.join(", ") })
        }
    }
}

fn choose(path: &Path, parts: &[Header]) -> Result<Choice, PictureError> {
    let names = channel_names(parts);

    // Colour, then grey
    let colour = names.iter().enumerate().find_map(|(part, names)| {
        let (_, channels) = coloured_layers(names).into_iter().next()?;
        Some(Choice { part, channels })
    });
    let grey = || {
        names.iter().enumerate().find_map(|(part, names)| {
            // Beside chroma, or as one of three coordinates, Y is not the picture
            let alone = !names.iter().any(|name| ["RY", "BY", "X", "Z"].contains(&name.as_str()));
            let y = names.iter().position(|name| name == "Y").filter(|_| alone)?;
            Some(Choice { part, channels: [y; 3] })
        })
    };

    colour.or_else(grey).ok_or_else(|| {
        let all: Vec<&str> = names.iter().flatten().map(String::as_str).collect();
        let missing: Vec<&str> = ["R", "G", "B"].into_iter().filter(|name| !all.contains(name)).collect();
        let missing =
            if missing.is_empty() { "R, G and B in one part".to_owned() } else { missing.join(", ") };
        let found = match all.len() {
            0 => "none".to_owned(),
            n => all[..n.min(NAMES_SHOWN)].join(", ") + if n > NAMES_SHOWN { ", …" } else { "" },
        };
        PictureError::Channels { path: path.to_owned(), missing, found }
    })
}

/// Prefixes of layers with a red channel, the most likely picture first; the unnamed layer has the empty
/// prefix.
fn layers(names: &[String]) -> Vec<&str> {
    let mut layers: Vec<&str> = names
        .iter()
        .filter_map(|n| n.strip_suffix('R'))
        .filter(|l| l.is_empty() || l.ends_with('.'))
        .collect();
    layers.sort_by_key(|layer| {
        (!layer.is_empty(), !(*layer == "Combined." || layer.ends_with(".Combined.")), *layer)
    });
    layers
}

/// Pictures of luminance and chroma have a quarter of their chroma.
fn subsampled(path: &Path) -> PictureError {
    let what = "subsampled channels, as of luminance and chroma (Y, RY, BY), are not read";
    PictureError::Unsupported { path: path.to_owned(), what, advice: "save R, G and B at full resolution" }
}

fn check_part(path: &Path, part: &Header, most: usize) -> Result<(), PictureError> {
    let unsupported = |what, advice| Err(PictureError::Unsupported { path: path.to_owned(), what, advice });
    if part.deep {
        return unsupported("deep pixels are not read", "flatten the image");
    }
    if part.channels.list.iter().any(|channel| channel.sampling.0 != 1 || channel.sampling.1 != 1) {
        return Err(subsampled(path));
    }
    check_size(path, (part.layer_size.width(), part.layer_size.height()), most)?;
    let block = part.max_block_pixel_size();
    let pixels = block.width().min(part.layer_size.width()) * block.height().min(part.layer_size.height());
    match pixels.checked_mul(part.channels.bytes_per_pixel) {
        Some(bytes) if bytes <= MAX_BLOCK_BYTES => Ok(()),
        _ => unsupported(
            "one of its tiles takes more than 1 GiB",
            "save it in smaller tiles or with fewer channels",
        ),
    }
}

/// The display window, and where in it the data window starts.
struct Window {
    width: usize,
    height: usize,
    x: i64,
    y: i64,
}

impl Window {
    fn of(path: &Path, part: &Header, most: usize) -> Result<Self, PictureError> {
        let display = part.shared_attributes.display_window;
        let (width, height) = (display.size.width(), display.size.height());
        check_size(path, (width, height), most)?;
        let at = part.own_attributes.layer_position;
        let (x, y) = (
            i64::from(at.0) - i64::from(display.position.0),
            i64::from(at.1) - i64::from(display.position.1),
        );
        let meets = |start: i64, data: usize, shown: usize| start < shown as i64 && start + data as i64 > 0;
        if !meets(x, part.layer_size.width(), width) || !meets(y, part.layer_size.height(), height) {
            let what = "its data window lies outside its display window";
            return Err(PictureError::Unsupported {
                path: path.to_owned(),
                what,
                advice: "save it uncropped",
            });
        }
        Ok(Self { width, height, x, y })
    }
}

/// Copies the colours of one block to their place in the display window.
fn place(
    block: &UncompressedBlock,
    part: &Header,
    channels: [usize; 3],
    window: &Window,
    pixels: &mut [Rgb],
) -> exr::error::UnitResult {
    let mut values: Vec<f32> = Vec::new();
    for line in block.lines(&part.channels) {
        // Lines of other channels, and lines above or below the window
        let y = line.location.position.1 as i64 + window.y;
        if !channels.contains(&line.location.channel) || !(0..window.height as i64).contains(&y) {
            continue;
        }

        // Samples of any type as f32
        values.clear();
        match part.channels.list[line.location.channel].sample_type {
            SampleType::F16 => {
                for v in line.read_samples::<f16>() {
                    values.push(v?.to_f32());
                }
            }
            SampleType::F32 => {
                for v in line.read_samples::<f32>() {
                    values.push(v?);
                }
            }
            SampleType::U32 => {
                for v in line.read_samples::<u32>() {
                    values.push(v? as f32);
                }
            }
        }

        // The part of the line that is inside the window
        let row = &mut pixels[y as usize * window.width..][..window.width];
        let x = line.location.position.0 as i64 + window.x;
        let skip = usize::try_from(-x).unwrap_or(0);
        let shown = row.iter_mut().skip(usize::try_from(x).unwrap_or(0));
        for (pixel, value) in shown.zip(values.iter().skip(skip)) {
            for (colour, channel) in pixel.iter_mut().zip(channels) {
                if channel == line.location.channel {
                    *colour = *value;
                }
            }
        }
    }
    Ok(())
}
