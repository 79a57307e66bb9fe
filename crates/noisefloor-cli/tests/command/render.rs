use crate::kit::{FILES, column, json, succeed, table, text, tiny, words};
use noisefloor_image::{Picture, read_exr, read_picture};
use tempfile::tempdir;

const STOPS: &str = "tile,x,y,width,height,spp,probability,reason,open_for,unfamiliar,jods_lost";

// Long: one run, looked at from all sides
#[test]
fn writes_all_it_promises() {
    let folder = tempdir().unwrap();
    let out = folder.path().join("new/deep");
    succeed(&tiny(text(&out), &["--seed", "7"]));
    let mut written: Vec<_> =
        std::fs::read_dir(&out).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    // The lock is hidden
    written.retain(|name| name != ".noisefloor.lock");
    written.sort();
    let mut promised: Vec<_> =
        FILES.iter().chain(&["finished.nfc", "noise.png"]).map(|&name| name.to_owned()).collect();
    promised.sort();
    assert_eq!(written, promised);

    // A line a tile
    let stops = out.join("stops.csv");
    assert_eq!(std::fs::read_to_string(&stops).unwrap().lines().next(), Some(STOPS));
    let (_, rows) = table(&stops);
    let places: Vec<_> = rows.iter().map(|r| r[..5].join(",")).collect();
    assert_eq!(places, ["0,0,0,32,32", "1,32,0,32,32", "2,0,32,32,32", "3,32,32,32,32"]);
    for row in &rows {
        let (spp, p): (u64, f32) = (row[5].parse().unwrap(), row[6].parse().unwrap());
        match row[7].as_str() {
            "converged" => assert!((16..=200).contains(&spp) && (0.95..=1.0).contains(&p), "{row:?}"),
            "max-spp" => assert!(spp == 200 && (0.0..0.95).contains(&p), "{row:?}"),
            _ => panic!("{row:?}"),
        }
    }

    // What a report has to say; samples are those of the stops
    let report = json(&out.join("report.json"));
    let spp = || rows.iter().map(|r| r[5].parse::<u64>().unwrap());
    assert_eq!((report["scene"].as_str(), report["seed"].as_u64()), (Some("cornell-box"), Some(7)));
    assert_eq!(report["samples"].as_u64(), Some(spp().sum::<u64>() * 32 * 32));
    assert_eq!(report["samples_uniform"].as_u64(), Some(spp().max().unwrap() * 64 * 64));
    assert_eq!(report["complete"].as_bool(), Some(true));
    let unfamiliar = rows.iter().filter(|r| r[8] == "true").count() as u64;
    assert_eq!(report["unfamiliar_tiles"].as_u64(), Some(unfamiliar));
    assert!(report["seconds_source"].as_f64() > Some(0.0) && report["seconds_oracle"].as_f64() > Some(0.0));
    let digest = report["model"].as_str().unwrap();
    assert!(succeed(&["inspect"]).contains(digest) && digest.len() == 64);

    // History, and how it ended
    let timeline = out.join("timeline.csv");
    assert_eq!(
        std::fs::read_to_string(&timeline).unwrap().lines().next(),
        Some("seconds,samples,active_tiles,rel_mse")
    );
    let samples: Vec<u64> = column(&timeline, "samples").iter().map(|n| n.parse().unwrap()).collect();
    assert!(samples.is_sorted() && samples.last() == Some(&report["samples"].as_u64().unwrap()));
    assert_eq!(column(&timeline, "active_tiles").last().unwrap(), "0");
    assert!(column(&timeline, "rel_mse").iter().all(String::is_empty));

    // Pictures: the linear one is the other one, tone mapped by the exposure that is reported
    let (linear, shown) =
        (read_exr(out.join("image.exr")).unwrap(), read_picture(out.join("image.png")).unwrap());
    let Picture::Display(shown) = shown else { panic!("a PNG is display-encoded") };
    assert_eq!((linear.width, linear.height, shown.width, shown.height), (64, 64, 64, 64));
    let exposure = report["exposure"].as_f64().unwrap() as f32;
    for (linear, shown) in linear.pixels.iter().zip(&shown.pixels) {
        let exposed = linear.map(|c| c * exposure);
        let scale = 1.0 / (1.0 + noisefloor::display::luminance(exposed));
        for (c, s) in exposed.iter().zip(shown) {
            let expected = noisefloor::display::srgb_encode((c * scale).min(1.0));
            assert!((expected - s).abs() < 0.6 / 255.0, "{expected} {s}");
        }
    }
    for map in ["stops.png", "noise.png"] {
        let Picture::Display(map) = read_picture(out.join(map)).unwrap() else { panic!("a PNG") };
        assert!(map.width > 64 && map.height >= 64, "a legend beside the picture");
    }
}

#[test]
fn the_same_seed_gives_the_same_files_whatever_the_threads() {
    let folder = tempdir().unwrap();
    let render = |name: &str, seed: &str, threads: &str| {
        let out = folder.path().join(name);
        succeed(&tiny(text(&out), &["--seed", seed, "--threads", threads]));
        ["image.exr", "stops.csv"].map(|name| std::fs::read(out.join(name)).unwrap())
    };
    let one = render("one", "3", "1");
    assert!(one == render("again", "3", "1"), "another picture the second time");
    assert!(one == render("two", "3", "2"), "another picture on two threads");
    assert!(one != render("other", "4", "2"), "the same picture from another seed");
}

#[test]
fn a_fixed_number_of_samples() {
    let folder = tempdir().unwrap();
    // No multiple of a batch
    succeed(&tiny(text(folder.path()), &["bulb", "--criterion", "spp:150"]));
    let stops = folder.path().join("stops.csv");
    assert_eq!(column(&stops, "spp"), ["150"; 4]);
    // Nobody has looked at the noise
    assert_eq!(column(&stops, "reason"), ["reached-spp"; 4]);
    assert_eq!(column(&stops, "probability"), [""; 4]);
    let report = json(&folder.path().join("report.json"));
    assert!(report["model"].is_null() && report["scene"] == "bulb");
    assert!(!folder.path().join("noise.png").exists(), "a number of samples knows of no noise");
}

#[test]
fn the_error_to_a_reference_falls() {
    let folder = tempdir().unwrap();
    let (truth, out) = (folder.path().join("truth"), folder.path().join("out"));
    succeed(&tiny(text(&truth), &["--criterion", "spp:1000", "--seed", "1"]));
    let against = truth.join("image.exr");
    let more = ["--criterion", "spp:200", "--seed", "2", "--schedule", "every", "--batch", "20"];
    let more = [&more[..], &["--against", text(&against)]].concat();
    succeed(&tiny(text(&out), &more));
    let errors: Vec<f64> =
        column(&out.join("timeline.csv"), "rel_mse").iter().map(|e| e.parse().unwrap()).collect();
    let (first, last) = (errors[0], errors[errors.len() - 1]);
    // Tenfold the samples: a tenth of the variance, and the reference's own, a fifth of what is left
    assert!(errors.len() >= 10 && last < 0.3 * first, "{errors:?}");
    // serde_json reads numbers to the last bit but one
    let reported = json(&out.join("report.json"))["rel_mse"].as_f64().unwrap();
    assert!((reported - last).abs() < 1e-15 * last.abs().max(1.0), "{reported} {last}");
}

/// The command says how free of noise the reference is that tiles were held against; without one it says
/// nothing.
#[test]
fn the_noise_of_the_reference_is_told() {
    let folder = tempdir().unwrap();
    let model = concat!(env!("CARGO_MANIFEST_DIR"), "/../noisefloor/models/human-reference.nfm");
    let mut args = vec!["render", "cornell-box", "--size", "32x32", "--tile", "32", "--max-spp", "100"];
    args.extend(["--out", text(folder.path())]);
    let plain = succeed(&args);
    assert!(!plain.contains("reference"), "{plain}");
    assert!(json(&folder.path().join("report.json"))["reference_samples"].is_null());
    args.extend(["--force", "--model", model]);
    let told = succeed(&args);
    assert!(told.contains("the reference took"), "{told}");
    let report = json(&folder.path().join("report.json"));
    let number = |name: &str| report[name].as_f64().unwrap();
    assert!((64.0..=16384.0).contains(&number("reference_samples")), "{report}");
    // Each block of 16×16 pixels, and so the whole, keeps within 0.305/255
    assert!(number("reference_worst") < 0.306 / 255.0 && number("reference_deviation") > 0.0, "{report}");
    assert!(number("reference_deviation") <= number("reference_worst"), "{report}");
}

#[test]
fn time_is_kept() {
    let folder = tempdir().unwrap();
    let mut args = vec!["render", "bulb", "--size", "64x64", "--tile", "32", "--out", text(folder.path())];
    args.extend(["--criterion", "spp:100000000", "--time", "1", "--threads", "1"]);
    succeed(&args);
    // Half of the time at least is for samples; how late it ends, the machine decides
    let report = json(&folder.path().join("report.json"));
    assert!(report["seconds_total"].as_f64().unwrap() >= 0.5, "{report}");
    assert_eq!(column(&folder.path().join("stops.csv"), "reason"), ["time-limit"; 4]);
    assert_eq!(report["complete"], false);
}

/// A scene file is rendered as it says, and named after its file.
#[test]
fn scene_files_are_rendered() {
    let folder = tempdir().unwrap();
    let out = folder.path().join("out");
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/cornell-box.xml");
    let size = ["--size", "32x32", "--tile", "32", "--criterion", "spp:4", "--out", text(&out)];
    let mut args = vec!["render", file];
    args.extend(size);
    succeed(&args);
    let report = json(&out.join("report.json"));
    assert_eq!(report["scene"].as_str(), Some("cornell-box"));
    assert_eq!((report["samples_dropped"].as_u64(), report["samples_clamped"].as_u64()), (Some(0), Some(0)));

    // With all that can be chosen; brighter samples than the walls give back are counted
    args.extend(words("--sampler sobol --filter gaussian --clamp 0.5 --max-depth 3 --force"));
    succeed(&args);
    assert!(json(&out.join("report.json"))["samples_clamped"].as_u64() > Some(0));
}

/// The map of stops is wider than the picture.
#[test]
fn the_widest_picture_is_written() {
    let folder = tempdir().unwrap();
    let args = ["render", "--size", "65536x2", "--tile", "512", "--criterion", "spp:2", "--quiet", "--out"];
    succeed(&[&args[..], &[text(folder.path())]].concat());
    for map in ["image.png", "stops.png"] {
        let (width, _) = image_size(&folder.path().join(map));
        assert!(width >= 65_536, "{map}: {width}");
    }
}

/// Width and height in the header of a PNG.
fn image_size(path: &std::path::Path) -> (u32, u32) {
    let bytes = std::fs::read(path).unwrap();
    let number = |at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
    (number(16), number(20))
}
