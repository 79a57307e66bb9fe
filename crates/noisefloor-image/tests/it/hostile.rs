use crate::util::{exr_claiming, f32s, make_exr};
use exr::prelude::{Compression, FlatSamples, IntegerBounds, f16};
use noisefloor_image::{RenderLayers, read_picture, write_exr, write_png};
use proptest::prelude::*;
use std::path::Path;
use std::sync::OnceLock;

/// Small valid files: an EXR a compression, and a PNG.
fn originals() -> &'static [Vec<u8>] {
    static FILES: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    FILES.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let mut files = Vec::new();
        let values: Vec<f32> = (0..20 * 18).map(|i| ((i * 37) % 101) as f32 / 7.0).collect();
        for compression in [
            Compression::Uncompressed,
            Compression::RLE,
            Compression::PIZ,
            Compression::PXR24,
            Compression::B44,
        ] {
            let half = || FlatSamples::F16(values.iter().map(|v| f16::from_f32(*v)).collect());
            let channels = vec![("R", half()), ("G", half()), ("B", f32s(&values))];
            make_exr(&path, (20, 18), channels, compression, (0, 0), None);
            files.push(std::fs::read(&path).unwrap());
        }
        let rgb: Vec<[f32; 3]> = values.iter().map(|v| [*v; 3]).collect();
        write_exr(&path, &RenderLayers::rgb(20, 18, &rgb)).unwrap();
        files.push(std::fs::read(&path).unwrap());
        let bytes: Vec<u8> = (0..20 * 18 * 3).map(|i| (i * 7 % 256) as u8).collect();
        write_png(&path, 20, 18, &bytes).unwrap();
        files.push(std::fs::read(&path).unwrap());
        files
    })
}

/// Reads the bytes as a file: a picture whose pixels fit its size, or an error that names the file.
fn check(path: &Path, bytes: &[u8]) -> bool {
    std::fs::write(path, bytes).unwrap();
    match read_picture(path) {
        Ok(picture) => {
            let (width, height) = picture.size();
            assert_eq!(picture.into_linear().pixels.len(), width * height);
            true
        }
        Err(error) => {
            assert!(error.to_string().contains("hostile"), "{error}");
            false
        }
    }
}

#[test]
fn every_cut_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hostile");
    for (file, bytes) in originals().iter().enumerate() {
        assert!(check(&path, bytes));
        // The last chunk of a PNG (12 bytes) holds nothing
        let needed = if bytes.starts_with(b"\x89PNG") { bytes.len() - 12 } else { bytes.len() };
        for length in (0..needed).step_by(if bytes.len() > 2000 { 13 } else { 1 }) {
            assert!(!check(&path, &bytes[..length]), "file {file} cut to {length} bytes");
        }
    }
}

#[test]
fn every_byte_of_a_header_may_be_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hostile");
    for bytes in originals() {
        for at in 0..bytes.len().min(450) {
            for value in [0x00, 0x01, 0x7f, 0x80, 0xff] {
                let mut bytes = bytes.clone();
                bytes[at] = value;
                check(&path, &bytes);
            }
        }
    }
}

/// A short file does not make anybody allocate much: neither by many pixels of its own, nor by a wide black
/// border.
#[test]
fn a_few_bytes_cannot_be_many_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hostile.exr");
    // One block of 65,536×16 pixels, whose offset is there
    std::fs::write(&path, [exr_claiming(65_536, 16), vec![0; 8]].concat()).unwrap();
    let error = read_picture(&path).unwrap_err().to_string();
    assert!(error.contains("bytes cannot hold 65536×16 pixels"), "{error}");

    let display = Some(IntegerBounds::new((0, 0), (16_384, 4096)));
    let black = || vec![("R", f32s(&[1.0])), ("G", f32s(&[1.0])), ("B", f32s(&[1.0]))];
    make_exr(&path, (1, 1), black(), Compression::Uncompressed, (0, 0), display);
    let error = read_picture(&path).unwrap_err().to_string();
    assert!(error.contains("bytes cannot hold 16384×4096 pixels"), "{error}");
    // A border that many a cropped render has
    let display = Some(IntegerBounds::new((0, 0), (3840, 2160)));
    make_exr(&path, (1, 1), black(), Compression::Uncompressed, (0, 0), display);
    assert_eq!(read_picture(&path).unwrap().size(), (3840, 2160));
}

/// Blocks hold all channels: too many that nobody asks for are refused before any is inflated.
#[test]
fn channels_beside_the_picture_are_in_proportion_to_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("hostile.exr");
    let names: Vec<String> = (0..1200).map(|i| format!("pass{i}.V")).collect();
    let write = |count: usize, edge: usize| {
        let black = f32s(&vec![0.0; edge * edge]);
        let passes = names[..count].iter().map(String::as_str);
        let channels = passes.chain(["R", "G", "B"]).map(|name| (name, black.clone())).collect();
        make_exr(&path, (edge, edge), channels, Compression::ZIP16, (0, 0), None);
    };
    write(100, 256);
    assert_eq!(read_picture(&path).unwrap().size(), (256, 256));
    // To write 1200 channels of 8192×32 pixels would take long: those of 32×32 are said to be as large, in a file of 1 MiB
    write(1200, 32);
    let mut bytes = std::fs::read(&path).unwrap();
    for window in [&b"dataWindow\0box2i\0"[..], b"displayWindow\0box2i\0"] {
        let at = bytes.windows(window.len()).position(|bytes| bytes == window).unwrap() + window.len() + 4;
        bytes[at + 8..at + 12].copy_from_slice(&8191i32.to_le_bytes());
    }
    bytes.resize(1 << 20, 0);
    std::fs::write(&path, bytes).unwrap();
    let error = read_picture(&path).unwrap_err().to_string();
    assert!(error.contains("out of proportion to the file; save the picture by itself"), "{error}");
}

/// A flag of the version says that pixels are deep.
#[test]
fn deep_pixels_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("deep.exr");
    let mut bytes = exr_claiming(16, 16);
    bytes[5] |= 8;
    std::fs::write(&path, bytes).unwrap();
    let error = read_picture(&path).unwrap_err().to_string();
    assert!(error.ends_with("deep.exr: deep pixels are not read; flatten the image"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]
    #[test]
    fn flipped_bytes_never_panic(
        file in 0usize..7,
        flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        length in prop::option::weighted(0.2, any::<prop::sample::Index>()),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let mut bytes = originals()[file].clone();
        for (at, value) in flips {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if let Some(length) = length {
            bytes.truncate(length.index(bytes.len()));
        }
        check(&folder.path().join("hostile"), &bytes);
    }
}
