//! Pictures: of a PNG, the checksums of chunks are right.

use crate::files::Folder;
use noisefloor::stills::SampleOrigin;
use noisefloor_image::{RenderLayers, SampleFacts, read_facts, read_picture, write_exr, write_png};
use std::fs;

/// Signature of a PNG.
const SIGNATURE: usize = 8;

fn read(name: &str, bytes: &[u8]) -> bool {
    thread_local!(static FOLDER: Folder = Folder::new());
    let path = FOLDER.with(|folder| folder.write(name, bytes));
    let _ = read_facts(&path);
    let Ok(picture) = read_picture(path) else { return false };
    let (width, height) = picture.size();
    assert_eq!(picture.into_linear().pixels.len(), width * height);
    true
}

pub(crate) fn exr(bytes: &[u8]) -> bool {
    read("picture.exr", bytes)
}

pub(crate) fn exr_seeds() -> Vec<Vec<u8>> {
    let folder = Folder::new();
    let path = folder.write("seed.exr", "");
    let rgb: Vec<[f32; 3]> = (0..20 * 18).map(|i| [(i * 37 % 101) as f32 / 7.0, -0.5, 1e9]).collect();
    let origin = SampleOrigin::new("hall", "01", 7, true);
    let facts = SampleFacts { samples: Some((16, 16)), origin: Some(origin) };
    let layers = RenderLayers { facts: Some(&facts), ..RenderLayers::rgb(20, 18, &rgb) };
    write_exr(&path, &layers).expect("a small picture");
    let plain = fs::read(&path).expect("it was written");
    // The same with its data announced in every other compression: decoders find nonsense of the right length
    let at = plain.windows(11).position(|w| w == b"compression").expect("every EXR says it") + 11 + 13 + 4;
    let other = |compression: u8| {
        let mut bytes = plain.clone();
        bytes[at] = compression;
        bytes
    };
    [plain.clone()]
        .into_iter()
        .chain((0..8).map(other))
        .chain([EXR_B44.to_vec(), EXR_PIZ.to_vec(), EXR_RLE.to_vec(), EXR_PXR24.to_vec()])
        .collect()
}

const EXR_B44: &[u8] = include_bytes!("../seeds/b44.exr");
const EXR_PIZ: &[u8] = include_bytes!("../seeds/piz.exr");
const EXR_RLE: &[u8] = include_bytes!("../seeds/rle.exr");
const EXR_PXR24: &[u8] = include_bytes!("../seeds/pxr24.exr");

pub(crate) fn pfm(bytes: &[u8]) -> bool {
    read("picture.pfm", bytes)
}

pub(crate) fn pfm_seeds() -> Vec<Vec<u8>> {
    let of = |header: &str, values: usize| [header.as_bytes(), &vec![0x3e; 4 * values]].concat();
    vec![of("PF\n3 2\n-1.0\n", 18), of("Pf\n2 2\n1.0\n", 4)]
}

pub(crate) fn png(bytes: &[u8]) -> bool {
    read("picture.png", &repaired(bytes))
}

/// Chunks as far as they go, each with the checksum of its content.
fn repaired(bytes: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let mut at = SIGNATURE;
    while let Some(length) = bytes.get(at..at + 4).and_then(|b| b.try_into().ok()).map(u32::from_be_bytes) {
        let Some(end) = (at + 8).checked_add(length as usize) else { break };
        let Some(content) = bytes.get(at + 4..end) else { break };
        let checksum = crc32fast::hash(content).to_be_bytes();
        let Some(place) = bytes.get_mut(end..end + 4) else { break };
        place.copy_from_slice(&checksum);
        at = end + 4;
    }
    bytes
}

pub(crate) fn png_seeds() -> Vec<Vec<u8>> {
    let folder = Folder::new();
    let path = folder.write("seed.png", "");
    let rgb: Vec<u8> = (0..16 * 9 * 3).map(|i| (i * 7 % 256) as u8).collect();
    write_png(&path, 16, 9, &rgb).expect("a small picture");
    let colour = fs::read(&path).expect("it was written");
    // Header: width, height, depth, colour type, compression, filter, interlace
    let mut interlaced = colour.clone();
    interlaced[SIGNATURE + 8 + 12] = 1;
    let mut palette = colour.clone();
    palette[SIGNATURE + 8 + 9] = 3;
    vec![colour, interlaced, palette]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_png_whose_content_changed_has_right_checksums_again() {
        let mut bytes = png_seeds().remove(0);
        assert_eq!(repaired(&bytes), bytes);
        let right = bytes.clone();
        bytes[SIGNATURE + 8 + 17 - 1] ^= 1; // the checksum of the header
        assert_ne!(bytes, right);
        assert_eq!(repaired(&bytes), right);
        assert_eq!(repaired(b"\x89PNG"), b"\x89PNG");
    }
}
