use crate::kit::{fail, json, said_json, succeed, text, tiny};
use noisefloor_image::{Picture, RenderLayers, read_exr, read_picture, write_exr};
use std::fs;
use std::path::Path;
use tempfile::tempdir;

/// A LUT for radiance up to 4, and the square root of its share of that; `last` is its brightest entry.
fn root(path: &Path, comment: &str, last: f32) {
    let mut lines = format!("# {comment}\nLUT_1D_SIZE 1025\nLUT_1D_INPUT_RANGE 0 4\n");
    for i in 0..1025 {
        let v = if i == 1024 { last } else { (i as f32 / 1024.0).sqrt() };
        lines += &format!("{v} {v} {v}\n");
    }
    fs::write(path, lines).unwrap();
}

#[test]
fn metrics_see_what_a_lut_shows() {
    let folder = tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    for (name, value) in [("a.exr", 1.0), ("b.exr", 0.25)] {
        write_exr(path(name), &RenderLayers::rgb(16, 16, &[[value; 3]; 256])).unwrap();
    }
    root(&path("root.cube"), "a root", 1.0);
    let tone = format!("lut:{}", text(&path("root.cube")));
    let measure = |more: &[&str]| {
        let (a, b) = (path("a.exr"), path("b.exr"));
        let args = ["metrics", text(&a), text(&b), "--json", "--tone-mapping", &tone];
        said_json(&[&args[..], more].concat())["psnr"].as_f64().unwrap()
    };
    // √(1/4) and √(1/16): a quarter apart; with four times the light, a half
    assert!((measure(&[]) - 20.0 * 4f64.log10()).abs() < 0.01);
    assert!((measure(&["--exposure", "4"]) - 20.0 * 2f64.log10()).abs() < 0.01);
    // Four stops below middle grey are 0 of a scale of 8 stops, and four above are 1; the LUT takes a quarter
    let psnr = measure(&["--lut-input", "log2:-4,4", "--exposure", "0.18"]);
    let shown = |stops: f64| ((stops + 4.0) / 8.0 / 4.0).sqrt();
    assert!((psnr + 20.0 * (shown(0.0) - shown(-2.0)).log10()).abs() < 0.02, "{psnr}");
}

#[test]
fn a_render_is_shown_through_its_lut_and_resumed_with_its_content() {
    let folder = tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    root(&path("a.cube"), "one", 1.0);
    root(&path("same.cube"), "the same, commented otherwise", 1.0);
    root(&path("other.cube"), "another", 0.9);
    let out = path("out");
    let tone = |name: &str| format!("lut:{}", text(&path(name)));
    let (one, same, other) = (tone("a.cube"), tone("same.cube"), tone("other.cube"));
    let render = |tone: &str, more: &[&str]| -> Vec<String> {
        let size = ["render", "--size", "64x64", "--tile", "32", "--quiet", "--threads", "1"];
        let what = ["--criterion", "spp:1500", "--tone-mapping", tone, "--out", text(&out)];
        [&size[..], &what, more].concat().into_iter().map(str::to_owned).collect()
    };
    succeed(&render(&one, &["--time", "0.01"]));
    fail(&render(&other, &["--resume"]), &["its tone curve", "give the LUT that it had"]);
    succeed(&render(&same, &["--resume", "--time", "0.01"]));

    // image.png is what the LUT makes of image.exr
    let linear = read_exr(out.join("image.exr")).unwrap().pixels;
    let Picture::Display(shown) = read_picture(out.join("image.png")).unwrap() else { panic!("a PNG") };
    for (linear, shown) in linear.iter().flatten().zip(shown.pixels.iter().flatten()) {
        let expected = (linear.clamp(0.0, 4.0) / 4.0).sqrt();
        // Half a step of the PNG, and near black what lies between two entries
        assert!((expected - shown).abs() < 0.6 / 255.0 + 0.01, "{linear} shows as {shown}");
    }
    let curve = json(&out.join("report.json"))["params"]["tone_mapping"]["custom"]["curve"].clone();
    assert_eq!(curve.as_str().map(str::len), Some(64), "the digest of its content");
}

#[test]
fn what_is_wrong_with_a_lut_is_said_before_anything_is_rendered() {
    let folder = tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("broken.cube"), "LUT_3D_SIZE 2\n0 0 0\n").unwrap();
    root(&path("a.cube"), "good", 1.0);
    let out = path("out");
    let refuse = |more: &[&str], words: &[&str]| fail(&tiny(text(&out), more), words);
    let tone = |name: &str| format!("lut:{}", text(&path(name)));
    refuse(&["--tone-mapping", &tone("broken.cube")], &["broken.cube", "20 bytes", "8 entries"]);
    refuse(&["--tone-mapping", &tone("nowhere.cube")], &["nowhere.cube"]);
    refuse(&["--tone-mapping", "lut:"], &["lut:FILE.cube"]);
    refuse(&["--tone-mapping", "filmic"], &["reinhard, srgb, or lut:FILE.cube"]);
    refuse(&["--tone-mapping", &tone("a.cube"), "--lut-input", "log2:3,1"], &["log2:LOW,HIGH"]);
    refuse(&["--tone-mapping", &tone("a.cube"), "--key", "0.2"], &["--key", "reinhard"]);
    refuse(&["--lut-input", "srgb"], &["--lut-input", "lut:FILE.cube"]);
    assert!(!out.exists());
}
