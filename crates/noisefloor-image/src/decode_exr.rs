//! EXR to linear RGB.
//!
//! Built on the block layer of the `exr` crate rather than on its image layer. This way sizes are checked
//! after the header and before the pixels, only the blocks of one part are decoded, and the data window can
//! be placed in the display window.

use crate::colours::ToRec709;
use crate::error::{PictureError, PictureFault};
use crate::open::{Format, Opened, check_size, guarded};
use crate::picture::LinearImage;
use exr::block::UncompressedBlock;
use exr::block::reader::ChunksReader;
use exr::meta::attribute::SampleType;
use exr::meta::header::Header;
use exr::prelude::f16;
use noisefloor::text::printable;
use noisefloor::{Rgb, viewing::Chromaticities};
use std::collections::HashSet;
use std::path::Path;

/// Bytes of pixels that a byte of a file can stand for, in any compression: deflate reaches 1032:1, and PXR24
/// leaves out every fourth byte besides. More is a lie, however the rest of the file looks.
const MAX_EXPANSION: u64 = 1376;
/// Pixels of black around a data window that every file may have; longer files may have more.
const FREE_PIXELS: u64 = 1 << 24;
/// Bytes of channels beside the colours that every file may have, and that a longer file may have for each of its own: a
/// block is inflated as a whole. Noise becomes at most some 4 of a byte, and passes without any are rarely all.
const FREE_BESIDE: u64 = 1 << 30;
const BESIDE_A_BYTE: u64 = 64;
/// Largest block (tile or group of scan lines, all channels) that is decompressed, in bytes.
const MAX_BLOCK_BYTES: usize = 1 << 30;
/// Most channels named in an error message.
const NAMES_SHOWN: usize = 20;

/// Reads the colours of an EXR: 16- or 32-bit floats, or unsigned integers, in any compression the `exr`
/// crate supports.
///
/// Of several parts and layers with R, G and B, the picture is read: the unnamed one, or one that is named as renderers
/// name it (`ViewLayer.Combined`, `rgba`, `beauty`, `image`, …), or the only one that is not named as a pass of normals,
/// albedo and the like. If more than one is left, [`PictureFault::Layers`] asks which. If no layer has colours, a lone
/// unnamed Y is read as grey. Other channels are ignored, alpha among them; colour is as stored, that is,
/// premultiplied.
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
        let broken = |reason: String| PictureFault::Broken { format: "EXR", reason }.of(path);
        let wanted = opened.layer.as_deref();
        let reader = exr::block::read(opened.reader, false).map_err(|e| broken(e.to_string()))?;
        let parts = reader.headers();
        let (layers, read) = (coloured_layers(parts), choose(path, parts, wanted)?);
        let (first, others): (Vec<_>, Vec<_>) =
            layers.into_iter().partition(|layer| (layer.part, layer.channels) == (read.part, read.channels));
        let layers = first.into_iter().chain(others).map(|layer| layer.name).collect();
        Ok(Layout { layers, has_alpha: choose_alpha(path, parts, wanted).is_ok() })
    })
}

/// Alpha of the layer that is read, as grey.
pub(crate) fn alpha_of(path: &Path, opened: Opened) -> Result<LinearImage, PictureError> {
    guarded(path, "EXR", || decode_unguarded(path, opened, choose_alpha))
}

/// Says which channels of a file are read; the last word is the layer that the user has named.
type Chooser = fn(&Path, &[Header], Option<&str>) -> Result<Choice, PictureError>;

fn decode_unguarded(path: &Path, opened: Opened, choose: Chooser) -> Result<LinearImage, PictureError> {
    let broken = |reason: String| PictureFault::Broken { format: "EXR", reason }.of(path);

    // Headers: which part, which channels, how large; nothing that the file is too short for
    let most = opened.most_pixels;
    let reader = exr::block::read(opened.reader, false).map_err(|e| match e {
        // The decoder refuses a whole file for it
        exr::error::Error::NotSupported(what) if what.contains("subsampl") => subsampled(path),
        e => broken(e.to_string()),
    })?;
    let choice = choose(path, reader.headers(), opened.layer.as_deref())?;
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

    let beside = decoded.saturating_sub(shown.saturating_mul(size_of::<Rgb>() as u64));
    if beside > opened.bytes.saturating_mul(BESIDE_A_BYTE).saturating_add(FREE_BESIDE) {
        return Err(PictureFault::Unsupported {
            what: "the channels beside its colours are out of proportion to the file",
            advice: "save the picture by itself",
        }
        .of(path));
    }

    // Pixels start black, if there is memory for them
    let refused = |_| PictureFault::Memory { width: window.width, height: window.height }.of(path);
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
    ToRec709::new(&Chromaticities { red, green, blue, white }, neutral).map_err(|()| {
        PictureFault::Colours {
            stated: format!(
                "chromaticities that no colours have: {red:?}, {green:?}, {blue:?}, white {white:?}"
            ),
            advice: "correct the attribute, or remove it if the colours are Rec.709",
        }
        .of(path)
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

/// A layer with R, G and B, and the places of these in the list of channels of its part.
struct Layer {
    part: usize,
    /// Of the layer, behind that of its part if there are several; empty if neither has one.
    name: String,
    channels: [usize; 3],
}

/// The layers that have colours, in the order of the file.
fn coloured_layers(parts: &[Header]) -> Vec<Layer> {
    let mut layers = Vec::new();
    for (part, names) in channel_names(parts).iter().enumerate() {
        let called = parts[part].own_attributes.layer_name.as_ref().map(ToString::to_string);
        let called = called.filter(|_| parts.len() > 1).unwrap_or_default();
        let prefixes = names.iter().filter_map(|n| n.strip_suffix('R'));
        for prefix in prefixes.filter(|prefix| prefix.is_empty() || prefix.ends_with('.')) {
            let at = |channel: &str| names.iter().position(|name| *name == format!("{prefix}{channel}"));
            let Some(channels) = [at("R"), at("G"), at("B")].into_iter().collect::<Option<Vec<_>>>() else {
                continue;
            };
            let layer = prefix.trim_end_matches('.');
            // Blender repeats the name of the part in those of its channels
            let name = match (called.as_str(), layer) {
                ("", name) | (name, "") => name.to_owned(),
                (part, layer) if layer.starts_with(part) => layer.to_owned(),
                (part, layer) => format!("{part}.{layer}"),
            };
            layers.push(Layer { part, name, channels: [channels[0], channels[1], channels[2]] });
        }
    }
    layers
}

/// How renderers name the layer of the picture (Arnold, V-Ray, RenderMan, Mitsuba, Nuke), the surest first.
const PICTURES: [&str; 14] = [
    "combined",
    "rgba",
    "rgb",
    "beauty",
    "image",
    "color",
    "colour",
    "ci",
    "c",
    "final",
    "main",
    "default",
    "render",
    "composite",
];
/// How Blender names what the layer `Combined` is of: its compositor's picture, and the first view layer.
const SHOWN: [&str; 4] = ["composite", "viewlayer", "view layer", "renderlayer"];
/// How names of layers begin that are no picture, in lower case.
const PASSES: [&str; 26] = [
    "albedo", "ao", "crypto", "debug", "denois", "depth", "diffcol", "id", "index", "mask", "matte", "mist",
    "motion", "noisy", "normal", "object", "material", "p", "pos", "shadow", "st", "tangent", "uv",
    "variance", "vector", "z",
];

/// How likely a layer is the picture: the lower, the likelier.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Likelihood {
    Unnamed,
    /// Named as renderers do: the place in [`PICTURES`], and in [`SHOWN`].
    Picture(usize, usize),
    Unknown,
    Pass,
}

impl Likelihood {
    fn of(name: &str) -> Self {
        let name = name.to_lowercase();
        let mut words = name.split('.').filter(|word| !matches!(*word, "left" | "right")).rev();
        let Some(last) = words.next().filter(|word| !word.is_empty()) else { return Self::Unnamed };
        if let Some(rank) = PICTURES.iter().position(|known| *known == last) {
            let first = words.next_back().unwrap_or_default();
            let shown = SHOWN.iter().position(|known| *known == first);
            return Self::Picture(rank, shown.unwrap_or(SHOWN.len()));
        }
        // N, P, AO and their like are short: longer words may begin so without being one
        let is = |pass: &str| if pass.len() <= 2 { last == pass } else { last.starts_with(pass) };
        let is_pass = last == "n" || name.contains("crypto") || PASSES.iter().any(|pass| is(pass));
        if is_pass { Self::Pass } else { Self::Unknown }
    }
}

/// The picture among layers: the one that is asked for, or the likeliest if it is the only one.
fn the_picture<'l>(
    path: &Path,
    layers: &'l [Layer],
    wanted: Option<&str>,
) -> Result<Option<&'l Layer>, PictureError> {
    let found = || match layers {
        [] => "none".to_owned(),
        _ => listed(layers.iter().map(|l| if l.name.is_empty() { "(unnamed)" } else { &l.name })),
    };
    if let Some(wanted) = wanted {
        let wanted = wanted.trim_end_matches('.').to_lowercase();
        let exact: Vec<_> = layers.iter().filter(|layer| layer.name.to_lowercase() == wanted).collect();
        let behind = |layer: &&Layer| layer.name.to_lowercase().ends_with(&format!(".{wanted}"));
        let ends: Vec<_> = layers.iter().filter(behind).collect();
        return match (exact.as_slice(), ends.as_slice()) {
            ([layer, ..], _) | ([], [layer]) => Ok(Some(layer)),
            _ => Err(PictureFault::NoLayer { layer: wanted, found: found() }.of(path)),
        };
    }
    let likelihood = |layer: &Layer| Likelihood::of(&layer.name);
    let Some(best) = layers.iter().map(likelihood).min() else { return Ok(None) };
    let best: Vec<_> = layers.iter().filter(|layer| likelihood(layer) == best).collect();
    match best.as_slice() {
        [layer] => Ok(Some(layer)),
        // Parts that have no names come in their order
        [first, ..] if first.name.is_empty() => Ok(Some(first)),
        _ => Err(PictureFault::Layers(found()).of(path)),
    }
}

/// Names, of which many are cut.
fn listed<'n>(names: impl Iterator<Item = &'n str>) -> String {
    let names: Vec<String> = names.map(|name| printable(name).into_owned()).collect();
    names[..names.len().min(NAMES_SHOWN)].join(", ") + if names.len() > NAMES_SHOWN { ", …" } else { "" }
}

/// Alpha beside the colours that are read.
fn choose_alpha(path: &Path, parts: &[Header], wanted: Option<&str>) -> Result<Choice, PictureError> {
    let Choice { part, channels } = choose(path, parts, wanted)?;
    let names = &channel_names(parts)[part];
    let red = &names[channels[0]];
    let alpha = format!("{}A", red.strip_suffix(['R', 'Y']).unwrap_or_default());
    match names.iter().position(|name| *name == alpha) {
        Some(alpha) => Ok(Choice { part, channels: [alpha; 3] }),
        None => Err(PictureFault::Channels { missing: alpha, found: names.join(", ") }.of(path)),
    }
}

fn choose(path: &Path, parts: &[Header], wanted: Option<&str>) -> Result<Choice, PictureError> {
    // Colour, then grey
    if let Some(Layer { part, channels, .. }) = the_picture(path, &coloured_layers(parts), wanted)? {
        return Ok(Choice { part: *part, channels: *channels });
    }
    let names = channel_names(parts);
    let grey = names.iter().enumerate().find_map(|(part, names)| {
        // Beside chroma, or as one of three coordinates, Y is not the picture
        let alone = !names.iter().any(|name| ["RY", "BY", "X", "Z"].contains(&name.as_str()));
        let y = names.iter().position(|name| name == "Y").filter(|_| alone)?;
        Some(Choice { part, channels: [y; 3] })
    });
    grey.ok_or_else(|| {
        let all: Vec<&str> = names.iter().flatten().map(String::as_str).collect();
        let missing: Vec<&str> = ["R", "G", "B"].into_iter().filter(|name| !all.contains(name)).collect();
        let missing =
            if missing.is_empty() { "R, G and B in one part".to_owned() } else { missing.join(", ") };
        let found = if all.is_empty() { "none".to_owned() } else { listed(all.into_iter()) };
        PictureFault::Channels { missing, found }.of(path)
    })
}

/// Pictures of luminance and chroma have a quarter of their chroma.
fn subsampled(path: &Path) -> PictureError {
    let what = "subsampled channels, as of luminance and chroma (Y, RY, BY), are not read";
    PictureFault::Unsupported { what, advice: "save R, G and B at full resolution" }.of(path)
}

fn check_part(path: &Path, part: &Header, most: usize) -> Result<(), PictureError> {
    let unsupported = |what, advice| Err(PictureFault::Unsupported { what, advice }.of(path));
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
            return Err(PictureFault::Unsupported { what, advice: "save it uncropped" }.of(path));
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
