//! Colours that files state.

use exr::prelude::*;
use flate2::{Compression as Level, write::ZlibEncoder};
use moxcms::ColorProfile;
use noisefloor::display::srgb_decode;
use noisefloor_image::{
    Picture, PictureFault, ReadOptions, read_exr, read_picture, read_picture_with, read_png, read_unread,
};
use std::io::Write;
use std::path::Path;

const COLOURS: [[f32; 3]; 4] = [[0.2, 0.4, 0.6], [0.9, 0.1, 0.3], [0.5, 0.5, 0.5], [0.02, 0.7, 0.05]];

/// Linear Rec.709 → linear RGB of other primaries. Of P3 and Rec.2020: the inverses of the published matrices
/// (CSS Color 4, §17), white at D65; of ACES AP0 and AP1, by the Academy (Bradford).
const TO_P3: [[f64; 3]; 3] = [[0.8225, 0.1775, 0.0], [0.0332, 0.9668, 0.0], [0.0171, 0.0724, 0.9105]];
const TO_2020: [[f64; 3]; 3] = [[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]];
const TO_AP0: [[f64; 3]; 3] = [[0.4396, 0.3830, 0.1774], [0.0898, 0.8134, 0.0968], [0.0175, 0.1115, 0.8710]];
const TO_AP1: [[f64; 3]; 3] = [[0.6131, 0.3395, 0.0474], [0.0702, 0.9164, 0.0134], [0.0206, 0.1096, 0.8698]];
const TO_XYZ: [[f64; 3]; 3] = [
    [0.412_456_4, 0.357_576_1, 0.180_437_5],
    [0.212_672_9, 0.715_152_2, 0.072_175_0],
    [0.019_333_9, 0.119_192_0, 0.950_304_1],
];

fn by(matrix: &[[f64; 3]; 3], pixel: [f32; 3]) -> [f32; 3] {
    matrix.map(|row| row.iter().zip(pixel).map(|(m, v)| m * f64::from(v)).sum::<f64>() as f32)
}

fn exr_with(path: &Path, pixels: &[[f32; 3]], stated: [[f32; 2]; 4], neutral: Option<[f32; 2]>) {
    let channel = |c: usize| FlatSamples::F32(pixels.iter().map(|p| p[c]).collect());
    let channels = ["R", "G", "B"].into_iter().enumerate().map(|(c, name)| AnyChannel::new(name, channel(c)));
    let attributes =
        LayerAttributes { adopted_neutral: neutral.map(|[x, y]| Vec2(x, y)), ..LayerAttributes::default() };
    let layer = Layer::new(
        (pixels.len(), 1),
        attributes,
        Encoding::UNCOMPRESSED,
        AnyChannels::sort(channels.collect()),
    );
    let mut image = Image::from_layer(layer);
    let [red, green, blue, white] = stated.map(|[x, y]| Vec2(x, y));
    image.attributes.chromaticities = Some(exr::meta::attribute::Chromaticities { red, green, blue, white });
    image.write().to_file(path).unwrap();
}

#[test]
fn exrs_in_other_primaries_are_the_same_picture() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.exr");
    const D65: [f32; 2] = [0.3127, 0.3290];
    const D60: [f32; 2] = [0.321_68, 0.337_67];
    let rec709 = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], D65];
    for (name, stated, matrix) in [
        ("XYZ", [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0], [1.0 / 3.0; 2]], TO_XYZ),
        ("P3", [[0.680, 0.320], [0.265, 0.690], [0.150, 0.060], D65], TO_P3),
        ("Rec.2020", [[0.708, 0.292], [0.170, 0.797], [0.131, 0.046], D65], TO_2020),
        ("AP0", [[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.0770], D60], TO_AP0),
        ("AP1", [[0.713, 0.293], [0.165, 0.830], [0.128, 0.044], D60], TO_AP1),
    ] {
        exr_with(&path, &COLOURS.map(|c| by(&matrix, c)), stated, None);
        // Published matrices have four digits
        for (pixel, colour) in read_exr(&path).unwrap().pixels.iter().zip(COLOURS) {
            let near = pixel.iter().zip(colour).all(|(a, b)| (a - b).abs() < 1e-3);
            assert!(near, "{name}: {pixel:?}, not {colour:?}");
        }
    }

    // Stated Rec.709 is what it was, to the bit, and what is not finite stays so
    exr_with(&path, &COLOURS, rec709, None);
    assert_eq!(read_exr(&path).unwrap().pixels, COLOURS);
    exr_with(&path, &[[f32::NAN, 1.0, 2.0]], [[0.7, 0.3], [0.2, 0.7], [0.1, 0.1], D65], None);
    assert_eq!(read_exr(&path).unwrap().pixels[0][1..], [1.0, 2.0]);

    // What is neutral becomes white
    exr_with(
        &path,
        &[[0.950_46, 1.0, 1.089_06]],
        [[1.0, 0.0], [0.0, 1.0], [0.0, 0.0], [1.0 / 3.0; 2]],
        Some(D60),
    );
    let [pixel] = read_exr(&path).unwrap().pixels[..] else { panic!("one pixel") };
    assert!(pixel[2] > pixel[0] + 0.05, "D65 is blue where D60 is white: {pixel:?}");

    exr_with(&path, &COLOURS, [[0.3, 0.3]; 4], None);
    let error = read_exr(&path).unwrap_err();
    assert!(matches!(&error.fault, PictureFault::Colours { .. }), "{error}");
    assert!(error.to_string().contains("0.3"), "{error}");
}

/// A PNG of 16 bits with any chunks before its pixels.
fn png_with(path: &Path, pixels: &[[u16; 3]], chunks: &[(&[u8; 4], Vec<u8>)]) {
    let mut file = b"\x89PNG\r\n\x1a\n".to_vec();
    let mut chunk = |name: &[u8; 4], data: &[u8]| {
        file.extend((data.len() as u32).to_be_bytes());
        let body = [&name[..], data].concat();
        file.extend(&body);
        file.extend(crc32fast::hash(&body).to_be_bytes());
    };
    let size = [(pixels.len() as u32).to_be_bytes(), 1u32.to_be_bytes()].concat();
    chunk(b"IHDR", &[&size[..], &[16, 2, 0, 0, 0]].concat());
    chunks.iter().for_each(|(name, data)| chunk(name, data));
    let row: Vec<u8> = pixels.as_flattened().iter().flat_map(|v| v.to_be_bytes()).collect();
    chunk(b"IDAT", &deflated(&[&[0][..], &row].concat()));
    chunk(b"IEND", &[]);
    std::fs::write(path, file).unwrap();
}

fn deflated(bytes: &[u8]) -> Vec<u8> {
    let mut out = ZlibEncoder::new(Vec::new(), Level::fast());
    out.write_all(bytes).unwrap();
    out.finish().unwrap()
}

fn gama(gamma: f64) -> (&'static [u8; 4], Vec<u8>) {
    (b"gAMA", ((gamma * 1e5).round() as u32).to_be_bytes().to_vec())
}

fn profile(profile: &ColorProfile) -> (&'static [u8; 4], Vec<u8>) {
    let mut chunk = b"any\0\0".to_vec();
    chunk.extend(deflated(&profile.encode().unwrap()));
    (b"iCCP", chunk)
}

fn codes(pixel: [f32; 3], curve: impl Fn(f64) -> f64) -> [u16; 3] {
    pixel.map(|v| (curve(f64::from(v)) * 65535.0).round() as u16)
}

fn srgb(v: f64) -> f64 {
    if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }
}

/// SMPTE ST 2084, of light whose white is 203 cd/m².
fn pq(v: f64) -> f64 {
    let y = (v * 203.0 / 10_000.0).powf(0.159_301_757_812_5);
    ((0.835_937_5 + 18.851_562_5 * y) / (1.0 + 18.6875 * y)).powf(78.843_75)
}

#[test]
fn pngs_in_other_colours_show_the_same_light() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let all = |matrix: Option<&[[f64; 3]; 3]>, curve: &dyn Fn(f64) -> f64| -> Vec<[u16; 3]> {
        COLOURS.iter().map(|&c| codes(matrix.map_or(c, |m| by(m, c)), curve)).collect()
    };
    let points = |primaries, transfer| (b"cICP", vec![primaries, transfer, 0, 1]);
    let chrm: Vec<u8> = [31270u32, 32900, 68000, 32000, 26500, 69000, 15000, 6000]
        .iter()
        .flat_map(|v| v.to_be_bytes())
        .collect();
    let p3 = ColorProfile::new_display_p3();
    for (name, pixels, chunks) in [
        ("nothing", all(None, &srgb), vec![]),
        ("linear", all(None, &|v| v), vec![gama(1.0)]),
        ("gamma 1.8", all(None, &|v| v.powf(1.0 / 1.8)), vec![gama(1.0 / 1.8)]),
        ("gamma of sRGB", all(None, &srgb), vec![gama(0.45455)]),
        ("sRGB before gamma", all(None, &srgb), vec![(b"sRGB", vec![0]), gama(1.0)]),
        ("P3 by cHRM", all(Some(&TO_P3), &|v| v.powf(0.5)), vec![gama(0.5), (b"cHRM", chrm)]),
        ("P3 by cICP", all(Some(&TO_P3), &srgb), vec![points(12, 13), gama(1.0)]),
        ("PQ", all(Some(&TO_2020), &pq), vec![points(9, 16)]),
        ("P3 by a profile", all(Some(&TO_P3), &srgb), vec![profile(&p3)]),
        ("sRGB by a profile", all(None, &srgb), vec![profile(&ColorProfile::new_srgb())]),
    ] {
        png_with(&path, &pixels, &chunks);
        let image = read_png(&path).unwrap();
        for (pixel, colour) in image.pixels.iter().zip(COLOURS) {
            let near = pixel.iter().zip(colour).all(|(&a, b)| (srgb_decode(a) - b).abs() < 2e-3);
            assert!(near, "{name}: {:?}, not {colour:?}", pixel.map(srgb_decode));
        }
        let stays = ["nothing", "gamma of sRGB", "sRGB before gamma", "sRGB by a profile"].contains(&name);
        assert_eq!(image.step == 1.0 / 65535.0, stays, "{name}: {}", image.step);
    }
}

/// HLG has a gain that depends on luminance: ITU-R BT.2408, table 1, has its white at 75 %.
#[test]
fn white_of_hlg_is_white() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    png_with(&path, &[[49151; 3], [0; 3]], &[(b"cICP", vec![9, 18, 0, 1])]);
    let image = read_png(&path).unwrap();
    assert!(image.pixels[0].iter().all(|v| (v - 1.0).abs() < 0.01), "{:?}", image.pixels);
    assert_eq!(image.pixels[1], [0.0; 3]);
    let warnings = read_unread(&path, &ReadOptions::default()).unwrap().warnings();
    assert!(matches!(&warnings[..], [one] if one.contains("Rec.2020 primaries with HLG")), "{warnings:?}");
}

/// A display shows the codes that it gets.
#[test]
fn displays_of_the_same_kind_get_the_codes() {
    const HDR: &str = "peak=1000,black=0,ambient=0,eotf=pq,primaries=rec2020";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let stored = [[10_000, 20_000, 30_000]];
    png_with(&path, &stored, &[(b"cICP", vec![9, 16, 0, 1])]);
    let on = |viewing: &str| match read_picture_with(
        &path,
        &ReadOptions { viewing: viewing.parse().unwrap(), ..ReadOptions::default() },
    ) {
        Ok(Picture::Display(image)) => Ok(image.pixels == stored.map(|p| p.map(|v| f32::from(v) / 65535.0))),
        Ok(Picture::Linear(_)) => panic!("a PNG"),
        Err(error) => Err(error.to_string()),
    };
    assert_eq!((on(HDR), on("desk")), (Ok(true), Ok(false)));
    png_with(&path, &stored, &[gama(1.0)]);
    assert!(on(HDR).is_err_and(|said| said.contains("gamma of 1.00")));
    assert_eq!(on("desk"), Ok(false));
    png_with(&path, &stored, &[]);
    assert_eq!((on(HDR), on("desk")), (Ok(true), Ok(true)));
}

#[test]
fn what_is_not_converted_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let mut table = ColorProfile::new_srgb();
    table.red_trc = None;
    let chrm: Vec<u8> = [0u32; 8].iter().flat_map(|v| v.to_be_bytes()).collect();
    let broken = [&b"any\0\0"[..], &deflated(b"no profile")].concat();
    for (chunk, what) in [
        ((b"cICP", vec![1, 1, 0, 1]), "cICP 1/1/0 in full range"),
        ((b"cICP", vec![9, 16, 0, 0]), "in narrow range"),
        (profile(&table), "sRGB"),
        ((b"iCCP", broken), "broken profile"),
        ((b"cHRM", chrm), "cHRM"),
        (gama(0.001), "0.001"),
        // What cannot be read is no sRGB either
        ((b"iCCP", b"any\0\0no deflate".to_vec()), "a chunk iCCP, which cannot be read"),
        ((b"iCCP", b"any".to_vec()), "a chunk iCCP, which cannot be read"),
        ((b"gAMA", vec![0; 4]), "a chunk gAMA, which cannot be read"),
        ((b"gAMA", vec![1]), "a chunk gAMA, which cannot be read"),
        ((b"cHRM", vec![0; 5]), "a chunk cHRM, which cannot be read"),
        ((b"sRGB", vec![9]), "a chunk sRGB, which cannot be read"),
    ] {
        png_with(&path, &[[1; 3]], &[chunk]);
        let error = read_picture(&path).unwrap_err();
        assert!(matches!(&error.fault, PictureFault::Colours { .. }), "{error}");
        assert!(error.to_string().contains(what), "{error}");
    }
    // But not where another chunk is believed
    let profile = (b"iCCP", b"any\0\0no deflate".to_vec());
    png_with(&path, &[[1; 3]], &[(b"cICP", vec![1, 13, 0, 1]), profile]);
    read_picture(&path).unwrap();
}
