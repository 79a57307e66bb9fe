use crate::kit::{fail, grey_exr, run, stderr, succeed, text};
use noisefloor_image::{Picture, RenderLayers, read_picture, write_exr, write_png};
use serde_json::Value;
use std::path::Path;
use tempfile::tempdir;

fn measure(image: &Path, reference: &Path, more: &[&str]) -> Value {
    let args = [&["metrics", text(image), text(reference), "--json"], more].concat();
    serde_json::from_str(&succeed(&args)).unwrap()
}

#[test]
fn a_picture_and_itself_have_ten_jods() {
    let folder = tempdir().unwrap();
    let exr = folder.path().join("a.exr");
    grey_exr(&exr, (32, 24), 1, 0.4);
    let report = measure(&exr, &exr, &["--viewing", "standard_4k"]);
    assert!((report["cvvdp_jod"].as_f64().unwrap() - 10.0).abs() < 1e-6, "{report}");
    assert!(report["psnr"].is_null() && report["rel_mse"] == 0.0, "{report}");
    assert_eq!((report["width"].as_u64(), report["height"].as_u64()), (Some(32), Some(24)));
    assert!((report["viewing"]["pixels_per_degree"].as_f64().unwrap() - 75.4).abs() < 0.1, "{report}");
    for key in ["flip", "butteraugli", "butteraugli_norm3"] {
        assert_eq!(report[key], 0.0, "{key}");
    }

    let said = succeed(&["metrics", text(&exr), text(&exr)]);
    assert!(said.contains("10.000  JOD") && said.contains("inf  dB"), "{said}");
}

/// 32 random bits of a place, as `record_cvvdp.py` makes them.
fn hashed(x: u32, y: u32, channel: u32, seed: u32) -> u32 {
    let mut h = x.wrapping_mul(0x9E37_79B1)
        ^ y.wrapping_mul(0x85EB_CA77)
        ^ channel.wrapping_mul(0xC2B2_AE3D)
        ^ seed.wrapping_mul(0x27D4_EB2F);
    for (shift, factor) in [(15, 0x2C1B_3C6D), (12, 0x297A_2D39)] {
        h = (h ^ (h >> shift)).wrapping_mul(factor);
    }
    h ^ (h >> 15)
}

/// Pairs that the PyPI package `cvvdp` 0.5.7 was given: noise on a flat grey and on a ramp.
#[test]
fn files_get_the_jods_of_cvvdp() {
    let recorded = include_str!("../../../noisefloor-vision/tests/cvvdp.json");
    let recorded: Value = serde_json::from_str(recorded).unwrap();
    let folder = tempdir().unwrap();
    let mut compared = 0;
    for pair in recorded["pairs"].as_array().unwrap() {
        let pattern = pair["pattern"].as_str().unwrap();
        if !["flat", "ramp"].contains(&pattern) {
            continue;
        }
        let of = |key: &str| pair[key].as_i64().unwrap();
        let (width, height) = (of("width"), of("height"));
        let code = |x: i64, y: i64, channel: usize, noisy: bool| {
            let [low, high, amount] =
                ["low", "high", "amount"].map(|key| pair[key][channel].as_i64().unwrap());
            let place = if pattern == "flat" { 128 } else { 255 * (x + y) / (width + height) };
            let h = hashed(x as u32, y as u32, channel as u32, of("seed") as u32);
            let noise = i64::from((h & 0xFFFF) + (h >> 16)) * (2 * amount + 1) / 131_071 - amount;
            (low + (high - low) * place / 255 + if noisy { noise } else { 0 }).clamp(0, 255) as u8
        };
        let [test, reference] = [true, false].map(|noisy| {
            let path = folder.path().join(format!("{noisy}.png"));
            let mut rgb = Vec::new();
            for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
                rgb.extend((0..3).map(|channel| code(x, y, channel, noisy)));
            }
            write_png(&path, width as usize, height as usize, &rgb).unwrap();
            path
        });
        let jod = measure(&test, &reference, &["--viewing", pair["viewing"].as_str().unwrap()])["cvvdp_jod"]
            .as_f64()
            .unwrap();
        // The file is decoded to light and encoded again, which costs some 10⁻⁶ of a code value
        assert!((jod - pair["jod"].as_f64().unwrap()).abs() < 0.001, "{jod} for {pair}");
        compared += 1;
    }
    assert_eq!(compared, 5);
}

#[test]
fn maps_have_a_legend_beside_the_picture() {
    let folder = tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    grey_exr(&path("a.exr"), (160, 150), 1, 0.4);
    grey_exr(&path("b.exr"), (160, 150), 2, 0.4);
    let mut args = vec!["metrics".to_owned()];
    args.extend(["a.exr", "b.exr"].map(|name| text(&path(name)).to_owned()));
    let mut maps = vec![("--map", "jod.png")];
    maps.extend([("--flip-map", "flip.png"), ("--butteraugli-map", "butteraugli.png")]);
    for (option, name) in &maps {
        args.extend([(*option).to_owned(), text(&path(name)).to_owned()]);
    }
    succeed(&args.iter().map(String::as_str).collect::<Vec<_>>());
    for (_, name) in &maps {
        let Picture::Display(map) = read_picture(path(name)).unwrap() else { panic!("a PNG") };
        assert!(map.width > 160 + 60 && map.height == 150, "{name}");
        // Letters are dark on the paper at the right
        let legend = map.pixels.chunks(map.width).flat_map(|row| &row[160..]);
        let dark = legend.filter(|pixel| pixel.iter().all(|&c| c < 0.2)).count();
        assert!(dark > 100, "{name}: {dark}");
    }
}

/// The same tone mapping for both; the exposure is that of the reference.
#[test]
fn linear_pictures_are_tone_mapped_first() {
    let folder = tempdir().unwrap();
    let [a, b] = ["a.exr", "b.exr"].map(|name| folder.path().join(name));
    for (path, value) in [(&a, 0.4), (&b, 0.2)] {
        write_exr(path, &RenderLayers::rgb(16, 16, &[[value; 3]; 256])).unwrap();
    }
    let psnr = |more: &[&str]| measure(&a, &b, more)["psnr"].as_f64().unwrap();
    let encode = |linear: f64| 1.055 * linear.powf(1.0 / 2.4) - 0.055;
    let expected = |a: f64, b: f64| -20.0 * (encode(a) - encode(b)).log10();
    // Reinhard: the reference becomes 0.18 before compression, and the other twice that
    assert!((psnr(&[]) - expected(0.36 / 1.36, 0.18 / 1.18)).abs() < 0.01);
    let srgb = psnr(&["--tone-mapping", "srgb", "--exposure", "0.5"]);
    assert!((srgb - expected(0.2, 0.1)).abs() < 0.001, "{srgb}");
}

#[test]
fn what_cannot_be_compared_is_said() {
    let folder = tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    grey_exr(&path("a.exr"), (16, 16), 1, 0.4);
    grey_exr(&path("small.exr"), (16, 15), 1, 0.4);
    grey_exr(&path("nan.exr"), (16, 16), 1, f32::NAN);
    grey_exr(&path("line.exr"), (16, 1), 1, 0.4);
    write_png(path("a.png"), 16, 16, &[128; 768]).unwrap();
    let refuse = |a: &str, b: &str, words: &[&str]| {
        fail(&["metrics", text(&path(a)), text(&path(b))], words);
    };
    refuse("a.exr", "small.exr", &["a.exr", "small.exr", "16×16 and 16×15"]);
    refuse("a.exr", "a.png", &["a.png", "one kind"]);
    refuse("nan.exr", "a.exr", &["pixel (0, 0) of the picture", "not finite"]);
    refuse("a.exr", "nan.exr", &["pixel (0, 0) of the reference"]);
    refuse("line.exr", "line.exr", &["16×1", "2 or more"]);
    refuse("a.exr", "nowhere.exr", &["nowhere.exr"]);
    let a = path("a.exr");
    fail(&["metrics", text(&a), text(&a), "--viewing", "moon"], &["moon", "desk"]);
    fail(&["metrics", text(&a), text(&a), "--viewing", "ppd=0"], &["pixels per degree"]);
    fail(&["metrics", text(&a), text(&a), "--map", text(&a.join("map.png"))], &["map.png"]);
    fail(&["metrics", text(&a), text(&a), "--viewing", "standard_hdr_pq"], &["standard_hdr_pq", "sRGB"]);
    fail(&["metrics", text(&a)], &["REFERENCE"]);
}

/// What is not read is said, as `judge` says it.
#[test]
fn what_is_not_read_is_said() {
    use exr::prelude::*;
    let folder = tempdir().unwrap();
    let layers = folder.path().join("layers.exr");
    let names = ["A", "B", "G", "R", "albedo.B", "albedo.G", "albedo.R", "beauty.B", "beauty.G", "beauty.R"];
    let channels = |names: &[&str]| {
        let all = names.iter().map(|&name| AnyChannel::new(name, FlatSamples::F32(vec![0.5; 64])));
        Image::from_channels((8, 8), AnyChannels::sort(all.collect()))
    };
    channels(&names[4..]).write().to_file(&layers).unwrap();
    let plain = folder.path().join("plain.exr");
    channels(&names[..4]).write().to_file(&plain).unwrap();
    let output = run(&["metrics", text(&layers), text(&plain)]);
    assert!(output.status.success(), "{}", stderr(&output));
    let said = stderr(&output);
    assert!(said.contains("of its layers, beauty is read, and not albedo"), "{said}");
    assert!(said.contains("plain.exr: it is transparent in places"), "{said}");
}

/// A small file may claim more pixels than there is memory for; 8K is enough for a picture.
#[test]
fn huge_pictures_are_refused() {
    let folder = tempdir().unwrap();
    let path = folder.path().join("a.png");
    let (width, height) = (7680, 4321);
    write_png(&path, width, height, &vec![128; 3 * width * height]).unwrap();
    assert!(std::fs::metadata(&path).unwrap().len() < 1 << 20);
    fail(&["metrics", text(&path), text(&path)], &["a.png", "7680×4321 pixels exceed the limit"]);
}
