//! Writing EXR and PNG.

use crate::atomic::write_atomic;
use crate::error::{WriteError, WriteFault};
use crate::facts::{SampleFacts, sample_attributes};
use crate::plane::{Channel, Channels, Plane};
use exr::prelude::{
    Blocks, Compression, Encoding, Image, Layer, LayerAttributes, LineOrder, Text, WritableImage,
};
use noisefloor::{Rgb, tile::check_image};
use std::io::Write;
use std::path::Path;

/// Longest edge of a PNG in pixels, by the format.
const MAX_PNG_EDGE: usize = (1 << 31) - 1;

/// A render, and what the oracle knows about each pixel.
#[derive(Clone, Copy, Debug)]
pub struct RenderLayers<'a> {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Linear RGB, Rec.709, row-major, `width * height` values.
    pub rgb: Plane<'a, Rgb>,
    /// Samples behind each pixel; written as 32-bit unsigned integers `oracle.spp`.
    pub spp: Option<Plane<'a, u32>>,
    /// Probability, 0…1, that an observer sees no difference; written as floats `oracle.P`. NaN where nobody
    /// judged.
    pub probability: Option<Plane<'a, f32>>,
    /// Whether the pixel's tile has stopped; written as floats `oracle.stop`, 1 or 0.
    pub stopped: Option<Plane<'a, bool>>,
    /// How visible the noise is, as a multiple of what is just seen; written as floats `oracle.visible_noise`. NaN
    /// without evidence.
    pub visible_noise: Option<Plane<'a, f32>>,
    /// How many samples, and from where; written as attributes that [`read_facts`](crate::read_facts) reads.
    pub facts: Option<&'a SampleFacts>,
}

impl<'a> RenderLayers<'a> {
    /// A picture without further layers.
    pub fn rgb(width: usize, height: usize, rgb: &'a [Rgb]) -> Self {
        let (probability, visible_noise) = (None, None);
        Self {
            width,
            height,
            rgb: rgb.into(),
            spp: None,
            probability,
            stopped: None,
            visible_noise,
            facts: None,
        }
    }
}

/// Writes a linear EXR, atomically: one part, ZIP, scan lines; R, G and B as 32-bit floats in the unnamed
/// layer, which every viewer shows, and what the oracle knows in a layer `oracle`.
///
/// # Errors
/// [`WriteError`] if a slice does not hold one value a pixel, the image is empty or too large, or as of
/// [`write_atomic`].
pub fn write_exr(path: impl AsRef<Path>, layers: &RenderLayers<'_>) -> Result<(), WriteError> {
    let path = path.as_ref();
    let (width, height) = (layers.width, layers.height);
    check_image(width, height).map_err(|source| WriteFault::Image(source).of(path))?;
    let check = |what, got: Option<usize>| {
        check_len(path, what, (width, height), got.unwrap_or(width * height), width * height)
    };

    // Colours, and what the oracle knows
    check("rgb", layers.rgb.len())?;
    let mut channels = vec![
        Channel::new("R", |pixel| layers.rgb.at(pixel)[0]),
        Channel::new("G", |pixel| layers.rgb.at(pixel)[1]),
        Channel::new("B", |pixel| layers.rgb.at(pixel)[2]),
    ];
    if let Some(spp) = layers.spp {
        check("spp", spp.len())?;
        channels.push(Channel::counts("oracle.spp", move |pixel| spp.at(pixel)));
    }
    if let Some(probability) = layers.probability {
        check("probability", probability.len())?;
        channels.push(Channel::new("oracle.P", move |pixel| probability.at(pixel)));
    }
    if let Some(stopped) = layers.stopped {
        check("stopped", stopped.len())?;
        channels.push(Channel::new("oracle.stop", move |pixel| f32::from(u8::from(stopped.at(pixel)))));
    }
    if let Some(noise) = layers.visible_noise {
        check("visible_noise", noise.len())?;
        channels.push(Channel::new("oracle.visible_noise", move |pixel| noise.at(pixel)));
    }

    let [of_picture, of_layer] = layers.facts.map(sample_attributes).unwrap_or_default();
    let attributes = LayerAttributes {
        software_name: Some(Text::from("noisefloor")),
        other: of_layer,
        ..LayerAttributes::default()
    };
    let encoding = Encoding {
        compression: Compression::ZIP16,
        blocks: Blocks::ScanLines,
        line_order: LineOrder::Increasing,
    };
    let channels = Channels::new(width, channels);
    let mut image = Image::from_layer(Layer::new((width, height), attributes, encoding, channels));
    image.attributes.other = of_picture;
    write_atomic(path, |writer| image.write().to_buffered(writer))
}

/// Writes an 8-bit RGB PNG, atomically. `rgb` is sRGB-encoded, row-major, three bytes a pixel. Only the
/// format limits the size: a map with a margin may be larger than the largest image that can be judged.
///
/// # Errors
/// [`WriteError`] if `rgb` does not hold three bytes a pixel, an edge is outside 1…2³¹−1, or as of
/// [`write_atomic`].
pub fn write_png(path: impl AsRef<Path>, width: usize, height: usize, rgb: &[u8]) -> Result<(), WriteError> {
    let path = path.as_ref();
    let edges = 1..=MAX_PNG_EDGE;
    let bytes = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(3));
    let (true, true, Some(bytes)) = (edges.contains(&width), edges.contains(&height), bytes) else {
        return Err(WriteFault::Png { width, height }.of(path));
    };
    check_len(path, "rgb", (width, height), rgb.len(), bytes)?;
    write_atomic(path, |writer| encode_png(writer, width, height, rgb))
}

/// A PNG of three bytes a pixel, whose edges fit into 32 bits. Rendered pictures are compressed little, and soon.
pub(crate) fn encode_png(
    to: impl Write,
    width: usize,
    height: usize,
    rgb: &[u8],
) -> Result<(), png::EncodingError> {
    let mut encoder = png::Encoder::new(to, width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_filter(png::Filter::Adaptive);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(rgb)?;
    writer.finish()
}

fn check_len(
    path: &Path,
    what: &'static str,
    (width, height): (usize, usize),
    got: usize,
    want: usize,
) -> Result<(), WriteError> {
    if got == want {
        return Ok(());
    }
    Err(WriteFault::Size { what, width, height, got, want }.of(path))
}
