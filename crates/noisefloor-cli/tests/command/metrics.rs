use crate::kit::{fail, grey_exr, run, said_json, stderr, succeed, text};
use noisefloor_image::{Picture, RenderLayers, read_picture, write_exr, write_png};
use serde_json::Value;
use std::path::Path;
use tempfile::tempdir;

fn measure(image: &Path, reference: &Path, more: &[&str]) -> Value {
    let args = [&["metrics", text(image), text(reference), "--json"], more].concat();
    said_json(&args)
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

#[test]
fn maps_have_a_legend_beside_the_picture() {
    let folder = tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    grey_exr(&path("a.exr"), (160, 150), 1, 0.4);
    grey_exr(&path("b.exr"), (160, 150), 2, 0.4);
    let maps = ["jod.png", "flip.png", "butteraugli.png"];
    let [a, b, jod, flip, butteraugli] = ["a.exr", "b.exr", maps[0], maps[1], maps[2]].map(path);
    let more = ["--map", text(&jod), "--flip-map", text(&flip), "--butteraugli-map", text(&butteraugli)];
    succeed(&[&["metrics", text(&a), text(&b)], &more[..]].concat());
    for name in maps {
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
