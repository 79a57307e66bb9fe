use exr::prelude::*;
use std::path::Path;

/// A channel of an EXR to make.
pub(crate) type Named<'n> = (&'n str, FlatSamples);

pub(crate) fn encoding(compression: Compression) -> Encoding {
    Encoding { compression, ..Encoding::UNCOMPRESSED }
}

/// Writes a one-part EXR with any channels; `at` is where the data window starts, `display` the display
/// window if another.
pub(crate) fn make_exr(
    path: &Path,
    size: (usize, usize),
    channels: Vec<Named<'_>>,
    compression: Compression,
    at: (i32, i32),
    display: Option<IntegerBounds>,
) {
    let channels: SmallVec<[AnyChannel<FlatSamples>; 4]> =
        channels.into_iter().map(|(name, samples)| AnyChannel::new(name, samples)).collect();
    let attributes = LayerAttributes { layer_position: Vec2(at.0, at.1), ..LayerAttributes::default() };
    let layer = Layer::new(size, attributes, encoding(compression), AnyChannels::sort(channels));
    let mut image = Image::from_layer(layer);
    if let Some(display) = display {
        image.attributes.display_window = display;
    }
    image.write().to_file(path).unwrap();
}

pub(crate) fn f32s(values: &[f32]) -> FlatSamples {
    FlatSamples::F32(values.to_vec())
}

/// Writes a grey EXR of one value.
pub(crate) fn flat_exr(path: &Path, size: (usize, usize), value: f32) {
    let rgb = vec![[value; 3]; size.0 * size.1];
    noisefloor_image::write_exr(path, &noisefloor_image::RenderLayers::rgb(size.0, size.1, &rgb)).unwrap();
}

/// Bytes of an EXR header whose window is as large as its numbers allow, and nothing after it.
pub(crate) fn exr_claiming(width: i32, height: i32) -> Vec<u8> {
    exr_header(width, height, [("B", 1), ("G", 1), ("R", 1)])
}

/// The same with channels that have every so many pixels' values.
pub(crate) fn exr_header(width: i32, height: i32, named: [(&str, i32); 3]) -> Vec<u8> {
    let mut bytes = vec![0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0];
    let mut attribute = |name: &str, kind: &str, value: &[u8]| {
        bytes.extend_from_slice(name.as_bytes());
        bytes.push(0);
        bytes.extend_from_slice(kind.as_bytes());
        bytes.push(0);
        bytes.extend_from_slice(&(value.len() as i32).to_le_bytes());
        bytes.extend_from_slice(value);
    };
    let window: Vec<u8> = [0, 0, width - 1, height - 1].iter().flat_map(|v: &i32| v.to_le_bytes()).collect();
    let mut channels = Vec::new();
    for (name, sampling) in named {
        channels.extend_from_slice(name.as_bytes());
        channels.push(0);
        for v in [2i32, 0, sampling, sampling] {
            channels.extend_from_slice(&v.to_le_bytes());
        }
    }
    channels.push(0);
    attribute("channels", "chlist", &channels);
    attribute("compression", "compression", &[3]);
    attribute("dataWindow", "box2i", &window);
    attribute("displayWindow", "box2i", &window);
    attribute("lineOrder", "lineOrder", &[0]);
    attribute("pixelAspectRatio", "float", &1f32.to_le_bytes());
    attribute("screenWindowCenter", "v2f", &[0; 8]);
    attribute("screenWindowWidth", "float", &1f32.to_le_bytes());
    bytes.push(0);
    bytes
}
