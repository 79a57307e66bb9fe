use crate::kit::{channel, fail, grey_exr, run, said_json, stderr, succeed, text, tiny};
use noisefloor_image::{Picture, RenderLayers, SampleFacts, read_exr, read_facts, read_picture, write_exr};
use noisefloor_testkit::Noise;
use serde_json::Value;
use std::path::{Path, PathBuf};
use tempfile::{TempDir, tempdir};

/// The picture of a small render, in a folder of its own.
fn rendered(folder: &TempDir, name: &str, more: &[&str]) -> PathBuf {
    let out = folder.path().join(name);
    succeed(&tiny(text(&out), more));
    out.join("image.exr")
}

/// Two pictures of noise around grey.
fn greys(folder: &TempDir, size: (usize, usize)) -> [PathBuf; 2] {
    let pair = ["a.exr", "b.exr"].map(|name| folder.path().join(name));
    pair.iter().zip(1..).for_each(|(path, seed)| grey_exr(path, size, seed, 0.4));
    pair
}

// Long: one run, looked at from all sides
#[test]
fn two_renders_with_two_seeds() {
    let folder = tempdir().unwrap();
    let judge = |a: &PathBuf, b: &PathBuf, spp: &str, more: &[&str]| {
        let mut args =
            vec!["judge", text(a), "--spp", spp, "--against", text(b), "--spp", spp, "--tile", "32"];
        args.extend(more);
        succeed(&args)
    };

    // As JSON: noisy at 16, and what is expected lies above
    let noisy = ["1", "2"].map(|seed| rendered(&folder, seed, &["--seed", seed, "--criterion", "spp:16"]));
    let report: Value = serde_json::from_str(&judge(&noisy[0], &noisy[1], "16", &["--json"])).unwrap();
    assert_eq!(
        (report["spp"].as_f64(), report["people"].as_f64().map(|t| t as f32)),
        (Some(16.0), Some(0.95))
    );
    assert_eq!(report["model"].as_str().map(str::len), Some(64));
    let tiles = report["tiles"].as_array().unwrap();
    assert_eq!(tiles.len(), 4);
    let converged = |tile: &Value| tile["converged"].as_bool().unwrap();
    assert_eq!(
        report["converged_tiles"].as_u64(),
        Some(tiles.iter().filter(|t| converged(t)).count() as u64)
    );
    for tile in tiles {
        let p = tile["probability"].as_f64().unwrap();
        assert_eq!(p as f32 >= 0.95, converged(tile), "{tile}");
        let expected = tile["expected_spp"].as_u64().unwrap();
        assert!(
            (0.0..=1.0).contains(&p) && if converged(tile) { expected == 16 } else { expected > 16 },
            "{tile}"
        );
    }
    assert!(!converged(&tiles[0]), "{report}");

    // As a table, with a heat map
    let map = folder.path().join("map.png");
    let said = judge(&noisy[0], &noisy[1], "16", &["--heat-map", text(&map)]);
    assert_eq!(said.lines().count(), 6, "{said}");
    assert!(said.contains("noise seen") && said.contains("of 4 tiles"), "{said}");
    assert!(std::fs::read(&map).unwrap().starts_with(b"\x89PNG\r\n\x1a\n"));
    let Picture::Display(map) = read_picture(&map).unwrap() else { panic!("a PNG") };
    assert!(map.width > 64 && map.height >= 64);

    // Where noise is seen: as a map, and as channels of an EXR of the picture
    let (map, exr) = (folder.path().join("noise.png"), folder.path().join("noise.exr"));
    judge(&noisy[0], &noisy[1], "16", &["--noise-map", text(&map), "--exr", text(&exr)]);
    let Picture::Display(map) = read_picture(&map).unwrap() else { panic!("a PNG") };
    assert!(map.width > 64 && map.height >= 64);
    assert_eq!(read_exr(&exr).unwrap().pixels, read_exr(&noisy[0]).unwrap().pixels);
    let (p, noise) = (channel(&exr, "oracle.P"), channel(&exr, "oracle.visible_noise"));
    for tile in tiles {
        let [x, y] = ["x", "y"].map(|edge| tile[edge].as_u64().unwrap() as usize);
        assert_eq!(f64::from(p[y * 64 + x]) as f32, tile["probability"].as_f64().unwrap() as f32);
    }
    assert!(noise.iter().all(|v| (0.0..255.0).contains(v)) && noise.iter().any(|&v| v > 1.0));
}

/// Nested stages of one rendering agree with independent ones about how much noise there is.
#[test]
fn nested_stages_ask_for_what_independent_pictures_ask_for() {
    let folder = tempdir().unwrap();
    let size = ["--size", "128x128", "--tile", "64"];
    let render = |seed: &str, spp: &str| -> PathBuf {
        let out = folder.path().join(format!("{seed}-{spp}"));
        let count = format!("spp:{spp}");
        let render = ["render", "--quiet", "--seed", seed, "--criterion", &count, "--out", text(&out)];
        succeed(&[&render[..], &size].concat());
        out.join("image.exr")
    };
    let first = render("1", "32");
    let needs = |against: &PathBuf, spp: &str, how: &str| -> f64 {
        let judge = ["judge", text(&first), "--spp", "32", "--against", text(against), "--spp", spp, how];
        let report = succeed(&[&judge[..], &["--tile", "64", "--json"]].concat());
        let report: Value = serde_json::from_str(&report).unwrap();
        let tiles = report["tiles"].as_array().unwrap();
        tiles.iter().map(|tile| tile["threshold"]["median"].as_f64().unwrap().ln()).sum::<f64>() / 4.0
    };
    // Two residuals show two realisations of the noise: over four pairs of seeds the needs differ by 5 to 16 %
    let (other, later) = (render("2", "32"), render("1", "128"));
    let nested = needs(&later, "128", "--nested");
    let ratio = (needs(&other, "32", "--independent") - nested).exp();
    assert!((0.8..1.25).contains(&ratio), "{ratio}");
    // The very same difference: of energy σ²(1/32 − 1/128), and taken for σ²(1/32 + 1/128). Over four seeds it is 1 to 3 % less
    let mistaken = (needs(&later, "128", "--independent") - nested).exp();
    assert!((mistaken - 0.6).abs() < 0.03, "{mistaken}");
}

/// The same noise claimed to be that of more samples is the same noise: P goes by what is seen.
#[test]
fn extreme_counts_and_sizes_are_judged() {
    let folder = tempdir().unwrap();
    for size in [(1, 1), (17, 16)] {
        let [a, b] = greys(&folder, size);
        grey_exr(&b, size, 2, 0.5);
        for spp in ["1", "1e18", "0.001"] {
            let args = ["judge", text(&a), "--spp", spp, "--against", text(&b), "--spp", spp, "--json"];
            let args = [&args[..], &["--independent"]].concat();
            let report = said_json(&args);
            assert!(report["tiles"][0]["probability"].as_f64().is_some(), "{report}");
        }
    }
}

/// What `render` wrote says how many samples it has, and whether it shares them: nobody has to.
#[test]
fn our_own_files_say_what_they_are() {
    let folder = tempdir().unwrap();
    let render =
        |name: &str, seed: &str, spp: &str| rendered(&folder, name, &["--seed", seed, "--criterion", spp]);
    // Equal counts and a ratio of 25 show nothing, or too little, in pictures of 64×64 pixels
    let (first, later) = (render("a", "1", "spp:8"), render("b", "1", "spp:200"));
    let other = render("c", "2", "spp:200");
    let judge = |against: &PathBuf, more: &[&str]| {
        let output =
            run(&[&["judge", text(&first), "--against", text(against), "--tile", "32", "--json"], more]
                .concat());
        (serde_json::from_slice::<Value>(&output.stdout), stderr(&output))
    };
    let probability = |report: &Value| report["tiles"][0]["probability"].as_f64().unwrap();
    let (nested, said) = judge(&later, &[]);
    let nested = nested.unwrap();
    assert!(said.contains("share samples"), "{said}");
    assert_eq!(nested["spp"].as_f64(), Some(8.0));
    let (typed, said) = judge(&later, &["--spp", "8", "--spp", "200", "--nested"]);
    assert!(said.is_empty() && probability(&typed.unwrap()) == probability(&nested), "{said}");
    let (independent, said) = judge(&other, &[]);
    assert!(said.is_empty(), "{said}");
    let (typed, _) = judge(&other, &["--spp", "8", "--spp", "200", "--independent"]);
    assert_eq!(probability(&typed.unwrap()), probability(&independent.unwrap()));

    // Whatever its depth is, a render of one seed shares its random numbers: pixels are not asked
    let deep = rendered(&folder, "d", &["--seed", "1", "--criterion", "spp:200", "--max-depth", "9"]);
    fail(
        &["judge", text(&first), "--against", text(&deep)],
        &["seed 1", "same random numbers", "another seed"],
    );
    assert!(judge(&deep, &["--independent"]).0.is_ok());

    // What was typed counts, and is not passed over in silence
    let (_, said) = judge(&other, &["--spp", "9", "--spp", "200"]);
    assert!(said.contains("says that it has 8 samples") && said.contains("--spp 9"), "{said}");
    let verdict = folder.path().join("verdict.exr");
    assert!(judge(&other, &["--exr", text(&verdict)]).0.is_ok());
    assert_eq!(read_facts(&verdict).unwrap(), read_facts(&first).unwrap());

    // Tiles that stopped at different counts have none in common
    let uneven = folder.path().join("uneven.exr");
    let facts = SampleFacts { samples: Some((100, 200)), origin: None };
    let rgb = read_exr(&other).unwrap().pixels;
    write_exr(&uneven, &RenderLayers { facts: Some(&facts), ..RenderLayers::rgb(64, 64, &rgb) }).unwrap();
    let (_, said) = judge(&uneven, &[]);
    assert!(said.contains("100 to 200 samples") && said.contains("--spp"), "{said}");
    let plain = folder.path().join("plain.exr");
    grey_exr(&plain, (64, 64), 1, 0.4);
    let (_, said) = judge(&plain, &[]);
    assert!(said.contains("plain.exr") && said.contains("--spp"), "{said}");
}

/// Said or not, `desk` is where the bundled model takes people to have sat.
#[test]
fn viewing_conditions_are_said_and_checked() {
    let folder = tempdir().unwrap();
    let [a, b] = greys(&folder, (32, 32));
    let judge = |more: &[&str]| {
        let pair = ["judge", text(&a), "--spp", "16", "--against", text(&b), "--spp", "16", "--json"];
        succeed(&[&pair[..], &["--independent"], more].concat())
    };
    assert_eq!(judge(&["--viewing", "desk"]), judge(&[]));
    assert_eq!(judge(&["--viewing", "standard_fhd"]), judge(&[]));
    let pair = ["judge", text(&a), "--spp", "16", "--against", text(&b), "--spp", "16"];
    fail(&[&pair[..], &["--viewing", "ppd=0"]].concat(), &["pixels per degree"]);
    fail(&[&pair[..], &["--viewing", "bed"]].concat(), &["bed", "desk"]);
}

/// Pictures of two different things are an error; where only a part differs, that part is not judged.
#[test]
fn pictures_of_different_things_are_not_judged() {
    let folder = tempdir().unwrap();
    let [black, white, grey, other, mixed] =
        ["black.exr", "white.exr", "grey.exr", "other.exr", "mixed.exr"].map(|name| folder.path().join(name));
    for (path, value) in [(&black, 0.0), (&white, 1.0)] {
        let pixels = vec![[value; 3]; 32 * 32];
        write_exr(path, &RenderLayers::rgb(32, 32, &pixels)).unwrap();
    }
    grey_exr(&grey, (32, 32), 1, 0.4);
    grey_exr(&other, (32, 32), 2, 0.4);
    let mut pixels = read_exr(&other).unwrap().pixels;
    for pixel in (0..32 * 32).filter(|i| i % 32 < 16 && i / 32 < 16) {
        pixels[pixel] = [1.0; 3];
    }
    write_exr(&mixed, &RenderLayers::rgb(32, 32, &pixels)).unwrap();
    fn args<'a>(a: &'a Path, b: &'a Path) -> Vec<&'a str> {
        let all = ["judge", text(a), "--spp", "9", "--against", text(b), "--spp", "9", "--independent"];
        [&all[..], &["--tone-mapping", "srgb", "--tile", "16", "--json"]].concat()
    }
    for (a, b) in [(&black, &white), (&white, &black), (&grey, &white)] {
        fail(&args(a, b), &["differ in brightness", "everywhere"]);
    }
    let judged = |b: &PathBuf| -> (Vec<Value>, String) {
        let output = run(&args(&grey, b));
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        (report["tiles"].as_array().unwrap().clone(), stderr(&output))
    };
    let (right, said) = judged(&other);
    assert!(said.is_empty() && right.iter().all(|tile| tile["unlike"] == false), "{said}");
    let (tiles, said) = judged(&mixed);
    assert!(said.contains("in 1 of 4 tiles") && said.contains("not judged"), "{said}");
    assert_eq!(tiles[0]["unlike"], true);
    assert!(tiles[0]["converged"] == false && tiles[0]["probability"] == 0.0);
    assert!(tiles[1..].iter().all(|tile| tile["unlike"] == false));
}

/// What is not read of a picture is said: alpha, and all layers but one.
#[test]
fn what_is_not_read_of_a_picture_is_said() {
    use exr::prelude::*;
    let folder = tempdir().unwrap();
    let [a, b] = ["a.exr", "b.exr"].map(|name| folder.path().join(name));
    grey_exr(&b, (32, 32), 2, 0.4);
    let mut noise = Noise::new(1);
    let grey: Vec<f32> = (0..32 * 32).map(|_| 0.4 + 0.1 * noise.normal() as f32).collect();
    let said = |channels: &[(&str, f32)]| {
        let values = |value: f32| if value < 0.0 { grey.clone() } else { vec![value; 32 * 32] };
        let channel = |&(name, value): &(&str, f32)| AnyChannel::new(name, FlatSamples::F32(values(value)));
        let channels = AnyChannels::sort(channels.iter().map(channel).collect());
        let layer = Layer::new((32, 32), LayerAttributes::default(), Encoding::UNCOMPRESSED, channels);
        Image::from_layer(layer).write().to_file(&a).unwrap();
        let args = ["judge", text(&a), "--spp", "9", "--against", text(&b), "--spp", "9", "--independent"];
        let output = run(&args);
        assert!(output.status.success(), "{}", stderr(&output));
        stderr(&output)
    };
    let grey = [("R", -1.0), ("G", -1.0), ("B", -1.0)];
    let with = |more: &[(&'static str, f32)]| [&grey[..], more].concat();
    assert_eq!(said(&grey), "");
    assert_eq!(said(&with(&[("A", 1.0)])), "");
    let half = said(&with(&[("A", 0.5)]));
    assert!(half.contains("a.exr: it is transparent") && half.contains("alpha is ignored"), "{half}");
    let none = said(&with(&[("A", 0.0)]));
    assert!(none.contains("its alpha is 0 everywhere"), "{none}");
    let layers = said(&with(&[("key.R", 0.1), ("key.G", 0.1), ("key.B", 0.1)]));
    assert!(layers.contains("the unnamed one is read, and not key"), "{layers}");
}

/// Noise that pixels share, and exposures that differ, are said; two renders are judged without a word.
#[test]
fn pictures_that_were_filtered_or_exposed_otherwise_are_noticed() {
    let folder = tempdir().unwrap();
    let size = (64, 64);
    let noise = |seed: u64| -> Vec<f32> {
        let mut noise = Noise::new(seed);
        (0..64 * 64).map(|i| (0.3 + 0.004 * (i % 64) as f32) * (1.0 + 0.2 * noise.normal() as f32)).collect()
    };
    let write = |name: &str, values: &[f32]| {
        let path = folder.path().join(name);
        let rgb: Vec<[f32; 3]> = values.iter().map(|&v| [v; 3]).collect();
        write_exr(&path, &RenderLayers::rgb(size.0, size.1, &rgb)).unwrap();
        path
    };
    let blurred = |values: &[f32]| -> Vec<f32> {
        let at = |i: usize| values[i.min(values.len() - 1)];
        (0..values.len()).map(|i| (at(i.saturating_sub(1)) + at(i) + at(i + 1)) / 3.0).collect()
    };
    let judge = |a: &PathBuf, b: &PathBuf| {
        let args = ["judge", text(a), "--against", text(b), "--independent", "--tile", "32"];
        let output = run(&[&args[..], &["--spp", "64", "--spp", "64", "--threads", "1"]].concat());
        assert!(output.status.success(), "{}", stderr(&output));
        stderr(&output)
    };
    let (a, b) = (noise(1), noise(2));
    let sharp = [write("a.exr", &a), write("b.exr", &b)];
    assert_eq!(judge(&sharp[0], &sharp[1]), "");
    let soft = [write("c.exr", &blurred(&a)), write("d.exr", &blurred(&b))];
    let said = judge(&soft[0], &soft[1]);
    assert!(
        said.contains("the noise of neighbouring pixels is correlated") && said.lines().count() == 1,
        "{said}"
    );
    let bright = write("e.exr", &b.iter().map(|v| 1.5 * v).collect::<Vec<_>>());
    let said = judge(&sharp[0], &bright);
    assert!(said.contains("the picture is 0.67 times as bright"), "{said}");
}

/// The same noise at a quarter of a sample as at one: it needs a quarter of the samples.
#[test]
fn needs_of_less_than_a_sample_are_its_own() {
    let folder = tempdir().unwrap();
    let [a, b] = greys(&folder, (64, 64));
    let need = |spp: &str| {
        let args = ["judge", text(&a), "--against", text(&b), "--independent", "--tile", "64", "--json"];
        let report = said_json(&[&args[..], &["--spp", spp, "--spp", spp]].concat());
        report["tiles"][0]["expected_spp"].as_f64().unwrap()
    };
    let (one, quarter) = (need("1"), need("0.25"));
    assert!(one > 8.0 && (quarter - one / 4.0).abs() <= 1.0, "{one} {quarter}");
}

/// A pipeline asks by the exit code, also for a sequence, of which the table has the worst place of each frame.
#[test]
fn frames_are_judged_and_the_exit_code_tells() {
    let folder = tempdir().unwrap();
    let name = |name: &str| folder.path().join(name);
    let noise = |path: PathBuf, seed: u64, deviation: f64| {
        let mut random = Noise::new(seed);
        // The lower right tile has twice the noise
        let pixel = |i: usize| {
            let noise = random.normal() * if i % 64 > 31 && i > 2048 { 2.0 } else { 1.0 };
            [(0.4 + deviation * noise) as f32; 3]
        };
        let pixels: Vec<[f32; 3]> = (0..64 * 64).map(pixel).collect();
        write_exr(&path, &RenderLayers::rgb(64, 64, &pixels)).unwrap();
    };
    for (frame, deviation) in [(1, 0.0005), (2, 0.01), (3, 0.2)] {
        noise(name(&format!("a.{frame:04}.exr")), 10 + frame, deviation);
        noise(name(&format!("b.{frame:04}.exr")), 20 + frame, deviation);
    }
    let judge = |names: [&str; 2], more: &[&str]| {
        let [a, b] = names.map(name);
        let typed =
            ["judge", text(&a), text(&b), "--spp", "200", "--spp", "200", "--independent", "--tile", "32"];
        let output = run(&[&typed[..], more].concat());
        (output.status.code(), String::from_utf8(output.stdout.clone()).unwrap() + &stderr(&output))
    };
    // One picture: 0 unless it is asked for
    let noisy = ["a.0003.exr", "b.0003.exr"];
    assert_eq!(judge(noisy, &[]).0, Some(0));
    assert_eq!(judge(noisy, &["--check"]).0, Some(3));
    assert_eq!(judge(["a.0001.exr", "b.0001.exr"], &["--check"]).0, Some(0));

    let all = ["a.####.exr", "b.%04d.exr"];
    let (code, said) =
        judge(all, &["--frames", "1-3", "--check", "--noise-map", text(&name("map.{frame:04}.png"))]);
    let rows: Vec<Vec<&str>> = said.lines().skip(1).map(|line| line.split_whitespace().collect()).collect();
    assert_eq!((code, rows.len()), (Some(3), 3), "{said}");
    assert_eq!(rows[0][..4], ["1", "4", "of", "4"], "{said}");
    assert_eq!(rows[2][..6], ["3", "0", "of", "4", "(32,", "32)"], "{said}");
    assert!((1..4).all(|frame| name(&format!("map.{frame:04}.png")).is_file()));
    let frames: Vec<Value> = serde_json::from_str(&judge(all, &["--frames", "1,3", "--json"]).1).unwrap();
    let told =
        |row: &Value| (row["frame"].as_i64(), row["converged_tiles"].as_u64(), row["worst"]["x"].as_u64());
    assert_eq!(frames.len(), 2);
    assert_eq!(told(&frames[1]), (Some(3), Some(0), Some(32)));
    assert!(frames[1]["worst"]["probability"].as_f64() < frames[0]["worst"]["probability"].as_f64());
    assert_eq!(judge(all, &["--frames", "1", "--check"]).0, Some(0));

    let (code, said) = judge(["a.0001.exr", "b.####.exr"], &["--frames", "1-3"]);
    assert!(code == Some(2) && said.contains("a.0001.exr' does not say where the number"), "{said}");
    let (code, said) = judge(all, &["--frames", "3-4"]);
    assert!(code == Some(1) && said.contains("frame 4: ") && said.contains("a.0004.exr"), "{said}");
}
