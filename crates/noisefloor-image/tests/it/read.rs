use crate::util::{exr_claiming, exr_header, f32s, make_exr};
use exr::prelude::{Compression, FlatSamples, IntegerBounds, f16};
use image::{DynamicImage, ImageBuffer, ImageFormat};
use noisefloor_image::{
    Picture, PictureFault, ReadOptions, read_exr, read_picture, read_picture_with, read_png, read_unread,
    write_png,
};
use std::path::PathBuf;

fn scratch() -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    (folder, path)
}

#[test]
fn half_float_and_uint_in_every_compression() {
    let (_folder, path) = scratch();
    for compression in [
        Compression::Uncompressed,
        Compression::RLE,
        Compression::ZIP1,
        Compression::ZIP16,
        Compression::PIZ,
        Compression::PXR24,
    ] {
        let half = (0..40 * 30).map(|i| f16::from_f32(i as f32 / 8.0)).collect();
        let float: Vec<f32> = (0..40 * 30).map(|i| i as f32 * 0.25).collect();
        let uint = (0..40 * 30).collect();
        let channels =
            vec![("R", FlatSamples::F16(half)), ("G", f32s(&float)), ("B", FlatSamples::U32(uint))];
        make_exr(&path, (40, 30), channels, compression, (0, 0), None);
        let image = read_exr(&path).unwrap();
        assert_eq!((image.width, image.height), (40, 30));
        for (i, pixel) in image.pixels.iter().enumerate() {
            assert_eq!(*pixel, [i as f32 / 8.0, i as f32 * 0.25, i as f32], "{compression:?} {i}");
        }
    }
}

#[test]
fn non_finite_values_are_kept() {
    let (_folder, path) = scratch();
    let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0];
    let channels = vec![("R", f32s(&odd)), ("G", f32s(&odd)), ("B", f32s(&[0.0; 4]))];
    make_exr(&path, (2, 2), channels, Compression::ZIP16, (0, 0), None);
    let pixels = read_exr(&path).unwrap().pixels;
    assert!(pixels[0][0].is_nan());
    assert_eq!([pixels[1][0], pixels[2][1], pixels[3][0]], [f32::INFINITY, f32::NEG_INFINITY, -1.0]);
}

#[test]
fn the_likeliest_layer_is_read() {
    let (_folder, path) = scratch();
    let one = |value| f32s(&[value]);
    let layer = |name: [&'static str; 3], value| name.map(|name| (name, one(value)));
    let albedo = || layer(["A.Albedo.R", "A.Albedo.G", "A.Albedo.B"], 1.0);
    let combined = || layer(["V.Combined.R", "V.Combined.G", "V.Combined.B"], 2.0);
    let unnamed = || layer(["R", "G", "B"], 3.0);
    let y = [("Y", one(4.0))];
    for (channels, value) in [
        (vec![albedo().to_vec()], 1.0),
        (vec![albedo().to_vec(), combined().to_vec()], 2.0),
        (vec![albedo().to_vec(), combined().to_vec(), unnamed().to_vec()], 3.0),
        (vec![y.to_vec()], 4.0),
        (vec![y.to_vec(), albedo().to_vec()], 1.0),
    ] {
        make_exr(&path, (1, 1), channels.concat(), Compression::ZIP16, (0, 0), None);
        assert_eq!(read_exr(&path).unwrap().pixels, [[value; 3]]);
    }
}

/// The picture by its name, whatever the alphabet says; where no name tells, the error lists what there is.
#[test]
fn layers_are_chosen_by_what_they_are_called() {
    let (_folder, path) = scratch();
    let write = |layers: &[&str]| {
        let names: Vec<[String; 3]> =
            layers.iter().map(|l| ["R", "G", "B"].map(|c| format!("{l}.{c}"))).collect();
        let channels = names.iter().enumerate();
        let channels =
            channels.flat_map(|(i, names)| names.each_ref().map(|name| (name.as_str(), f32s(&[i as f32]))));
        make_exr(&path, (1, 1), channels.collect(), Compression::ZIP16, (0, 0), None);
    };
    for (layers, read) in [
        (&["N", "rgba"][..], 1.0),
        (&["AAcrypto00", "rgba"], 1.0),
        (&["albedo", "image"], 1.0),
        (&["A.Combined", "ViewLayer.Combined"], 1.0),
        (&["ViewLayer.Combined", "Composite.Combined"], 1.0),
        (&["ViewLayer.Denoising Albedo", "ViewLayer.Noisy Image", "ViewLayer.Combined"], 2.0),
        (&["P", "Z", "crypto_object", "beauty"], 3.0),
        (&["depth", "specular"], 1.0),
        (&["N"], 0.0),
    ] {
        write(layers);
        assert_eq!(read_exr(&path).unwrap().pixels, [[read; 3]], "{layers:?}");
    }
    for layers in [&["diffuse", "specular"][..], &["N", "albedo"], &["A.Combined", "B.Combined"]] {
        write(layers);
        let error = read_exr(&path).unwrap_err();
        assert!(
            matches!(&error.fault, PictureFault::Layers(found) if *found == layers.join(", ")),
            "{error}"
        );
        // And by name, each can be had
        for (i, layer) in layers.iter().enumerate() {
            let layer = Some(layer.to_uppercase());
            let options = ReadOptions { layer, ..ReadOptions::default() };
            let found = read_picture_with(&path, &options).unwrap().into_linear();
            assert_eq!(found.pixels, [[i as f32; 3]]);
            assert_eq!(read_unread(&path, &options).unwrap().layers[0], layers[i]);
        }
    }
    let asked = |layer: &str| {
        let options = ReadOptions { layer: Some(layer.to_owned()), ..ReadOptions::default() };
        read_picture_with(&path, &options).map(|picture| picture.into_linear().pixels)
    };
    for layer in ["beauty", "Combined", ""] {
        let error = asked(layer).unwrap_err().to_string();
        assert!(error.contains("A.Combined, B.Combined"), "{error}");
    }
    write(&["ViewLayer.Combined", "ViewLayer.DiffCol"]);
    assert_eq!(asked("diffcol").unwrap(), [[1.0; 3]]);
}

/// Files that stand for pictures say so.
#[test]
fn pointers_and_pages_are_named() {
    let (_folder, path) = scratch();
    for (bytes, want) in [
        ("version https://git-lfs.github.com/spec/v1\noid sha256:aa\nsize 12\n", "git lfs pull"),
        ("/annex/objects/SHA256E-s12--aa.exr\n", "git annex get"),
        ("\n<!DOCTYPE html>\n<html></html>", "web page"),
    ] {
        std::fs::write(&path, bytes).unwrap();
        for error in [read_exr(&path).unwrap_err(), read_picture(&path).map(drop).unwrap_err()] {
            assert!(
                matches!(error.fault, PictureFault::StandIn(_)) && error.to_string().contains(want),
                "{error}"
            );
        }
    }
}

#[test]
fn missing_channels_are_named() {
    let (_folder, path) = scratch();
    make_exr(&path, (1, 1), vec![("R", f32s(&[1.0])), ("A", f32s(&[1.0]))], Compression::ZIP16, (0, 0), None);
    let error = read_exr(&path).unwrap_err();
    assert!(matches!(&error.fault, PictureFault::Channels { missing, .. } if missing == "G, B"), "{error}");
    let said = error.to_string();
    assert!(said.contains("a.exr") && said.contains("A, R"), "{said}");

    // Coordinates are not luminance
    let xyz = ["X", "Y", "Z"].map(|name| (name, f32s(&[1.0])));
    make_exr(&path, (1, 1), xyz.to_vec(), Compression::ZIP16, (0, 0), None);
    assert!(matches!(read_exr(&path).unwrap_err().fault, PictureFault::Channels { .. }));
}

#[test]
fn the_display_window_is_the_picture() {
    let (_folder, path) = scratch();
    let values: Vec<f32> = (1..=6).map(|v| v as f32).collect();
    let channels = || ["R", "G", "B"].map(|name| (name, f32s(&values))).to_vec();
    let read = |at, display: IntegerBounds| {
        make_exr(&path, (3, 2), channels(), Compression::ZIP16, at, Some(display));
        read_exr(&path).map(|image| {
            assert_eq!((image.width, image.height), (display.size.0, display.size.1));
            image.pixels.iter().map(|p| p[0]).collect::<Vec<_>>()
        })
    };

    // Smaller than the display window: black around it
    let around = read((1, 1), IntegerBounds::new((0, 0), (4, 3))).unwrap();
    assert_eq!(around, [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0, 0.0, 4.0, 5.0, 6.0]);
    // Overscan: cropped
    assert_eq!(read((-1, -1), IntegerBounds::new((0, 0), (1, 1))).unwrap(), [5.0]);
    // Both windows away from the origin
    assert_eq!(read((-7, 9), IntegerBounds::new((-6, 9), (3, 1))).unwrap(), [2.0, 3.0, 0.0]);
    // Apart
    let error = read((5, 0), IntegerBounds::new((0, 0), (4, 3))).unwrap_err();
    assert!(matches!(error.fault, PictureFault::Unsupported { .. }), "{error}");
}

/// Luminance with a quarter of the chroma (OpenEXR, RgbaYca): refused by name, not as broken.
#[test]
fn luminance_and_chroma_are_refused_by_name() {
    let (_folder, path) = scratch();
    std::fs::write(&path, exr_header(4, 4, [("BY", 2), ("RY", 2), ("Y", 1)])).unwrap();
    let error = read_exr(&path).unwrap_err();
    assert!(matches!(error.fault, PictureFault::Unsupported { .. }), "{error}");
    assert!(error.to_string().contains("luminance and chroma (Y, RY, BY)"), "{error}");
}

#[test]
fn png_of_every_kind() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let read = |image: DynamicImage| {
        image.save_with_format(&path, ImageFormat::Png).unwrap();
        read_png(&path).unwrap().pixels
    };
    let rgb8 = ImageBuffer::from_raw(1, 1, vec![0u8, 51, 255]).unwrap();
    assert_eq!(read(DynamicImage::ImageRgb8(rgb8)), [[0.0, 0.2, 1.0]]);
    let rgb16 = ImageBuffer::from_raw(1, 1, vec![1u16, 13107, 65535]).unwrap();
    assert_eq!(read(DynamicImage::ImageRgb16(rgb16)), [[1.0 / 65535.0, 0.2, 1.0]]);
    let grey = ImageBuffer::from_raw(1, 1, vec![51u8]).unwrap();
    assert_eq!(read(DynamicImage::ImageLuma8(grey)), [[0.2; 3]]);
    let grey16 = ImageBuffer::from_raw(1, 1, vec![13107u16, 0]).unwrap();
    assert_eq!(read(DynamicImage::ImageLumaA16(grey16)), [[0.2; 3]]);

    // Alpha is dropped, whatever it is
    let rgba = ImageBuffer::from_raw(1, 1, vec![0u8, 51, 255, 0]).unwrap();
    assert_eq!(read(DynamicImage::ImageRgba8(rgba)), [[0.0, 0.2, 1.0]]);
}

#[test]
fn srgb_there_and_back() {
    assert_eq!((noisefloor::display::srgb_decode(0.0), noisefloor::display::srgb_decode(1.0)), (0.0, 1.0));
    // IEC 61966-2-1: mid grey of 8-bit displays
    assert!((noisefloor::display::srgb_decode(128.0 / 255.0) - 0.215_861).abs() < 1e-6);
    for code in 0..=255u8 {
        let encoded = f32::from(code) / 255.0;
        assert!(
            (noisefloor::display::srgb_encode(noisefloor::display::srgb_decode(encoded)) - encoded).abs()
                < 1e-6
        );
    }
}

#[test]
fn content_decides_not_the_name() {
    let (folder, path) = scratch();
    write_png(&path, 1, 1, &[255, 255, 255]).unwrap();
    assert!(matches!(read_picture(&path), Ok(Picture::Display(_))));
    assert!(matches!(read_exr(&path).unwrap_err().fault, PictureFault::Foreign { found: "a PNG file", .. }));

    std::fs::write(&path, b"P6 1 1 255 ...").unwrap();
    let said = read_picture(&path).unwrap_err().to_string();
    assert!(said.contains("a.exr") && said.contains("OpenEXR") && said.contains("PNG"), "{said}");

    std::fs::write(&path, b"").unwrap();
    assert!(matches!(
        read_png(&path).unwrap_err().fault,
        PictureFault::Foreign { found: "an empty file", .. }
    ));
    assert!(matches!(read_picture(folder.path()).unwrap_err().fault, PictureFault::Foreign { .. }));
    assert!(matches!(read_picture(folder.path().join("absent")).unwrap_err().fault, PictureFault::Io(_)));
}

#[test]
fn sizes_are_checked_before_pixels() {
    let (_folder, path) = scratch();
    for (width, height) in [(70_000, 10), (60_000, 60_000), (i32::MAX, i32::MAX), (0, 5)] {
        std::fs::write(&path, exr_claiming(width, height)).unwrap();
        let error = read_exr(&path).unwrap_err();
        assert!(matches!(error.fault, PictureFault::Size(_) | PictureFault::Broken { .. }), "{error}");
    }
    std::fs::write(&path, exr_claiming(70_000, 10)).unwrap();
    assert!(matches!(read_exr(&path).unwrap_err().fault, PictureFault::Size(_)));
    // Within the limits, but there is no table of blocks
    std::fs::write(&path, exr_claiming(16_384, 16_384)).unwrap();
    assert!(matches!(read_exr(&path).unwrap_err().fault, PictureFault::Broken { .. }));

    // A PNG header is the same for any size: patch width, height and checksum of a small one
    for (width, height) in [(70_000u32, 10u32), (60_000, 60_000), (0, 5), (16_384, 16_384)] {
        write_png(&path, 2, 2, &[0; 12]).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[16..20].copy_from_slice(&width.to_be_bytes());
        bytes[20..24].copy_from_slice(&height.to_be_bytes());
        let crc = crc32fast::hash(&bytes[12..29]);
        bytes[29..33].copy_from_slice(&crc.to_be_bytes());
        std::fs::write(&path, bytes).unwrap();
        let error = read_png(&path).unwrap_err();
        let large = width.max(height) == 70_000 || width == 60_000;
        assert_eq!(matches!(error.fault, PictureFault::Size(_)), large, "{error}");
        assert!(large || matches!(error.fault, PictureFault::Broken { .. }), "{error}");
    }
}
