use crate::kit::{column, command, fail, grey_exr, json, succeed, text};
use noisefloor_image::{Picture, RenderLayers, read_exr, read_picture, write_exr};
use noisefloor_testkit::{Noise, Requirement, require, require_python};
use std::path::Path;
use tempfile::tempdir;

const CORNELL_BOX: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/cornell-box.xml");

/// A render of so many samples of whatever source.
fn fixed<'a>(source: &'a str, scene: &'a str, out: &'a Path, more: &[&'a str]) -> Vec<&'a str> {
    let args = ["render", "--source", source, scene, "--out", text(out), "--quiet", "--tile", "32"];
    args.into_iter().chain(more.iter().copied()).collect()
}

#[test]
fn a_folder_of_pictures_is_played_back() {
    let folder = tempdir().unwrap();
    let stack = folder.path().join("stack");
    std::fs::create_dir(&stack).unwrap();
    for (seed, name) in ["batch_0_100.exr", "batch_100_200.exr", "batch_200_300.exr"].iter().enumerate() {
        grey_exr(&stack.join(name), (48, 40), seed as u64, 0.4);
    }
    let out = folder.path().join("out");
    succeed(&fixed("exr", text(&stack), &out, &["--criterion", "spp:1000"]));
    assert_eq!(column(&out.join("stops.csv"), "spp"), ["300"; 2]);
    assert_eq!(column(&out.join("stops.csv"), "reason"), ["source-exhausted"; 2]);
    let report = json(&out.join("report.json"));
    assert_eq!((report["source"].as_str(), report["scene"].as_str()), (Some("stack stack"), Some("stack")));
    assert!(report["samples_dropped"].is_null(), "{report}");
    fail(&fixed("exr", text(&stack), &out, &["--size", "48x40"]), &["--size", "--source exr"]);
    fail(&["render", "--source", "exr"], &["needs a folder"]);
}

/// A dot in one of two batches is light that tiles apart from it may lack: table, report, summary and map say so.
#[test]
fn what_tiles_wait_for_is_said() {
    let folder = tempdir().unwrap();
    let (stack, out) = (folder.path().join("stack"), folder.path().join("out"));
    std::fs::create_dir(&stack).unwrap();
    for (seed, name) in ["batch_0_8.exr", "batch_8_16.exr"].iter().enumerate() {
        let mut noise = Noise::new(seed as u64);
        let mut pixels: Vec<[f32; 3]> =
            (0..256 * 256).map(|_| [0.4 + 0.001 * noise.normal() as f32; 3]).collect();
        pixels[70 * 256 + 80] = [[0.4; 3], [3e4; 3]][seed];
        write_exr(stack.join(name), &RenderLayers::rgb(256, 256, &pixels)).unwrap();
    }
    let said = succeed(&["render", "--source", "exr", text(&stack), "--tile", "64", "--out", text(&out)]);

    // Windows around pixels of twelve tiles are apart from it
    let waits = column(&out.join("stops.csv"), "open_for");
    let apart = [2, 3, 6, 7].into_iter().chain(8..16);
    assert!(apart.into_iter().all(|tile| waits[tile] == "unmet-light"), "{waits:?}");
    let count = |why: &str| waits.iter().filter(|waits| *waits == why).count();
    let unmet = count("unmet-light");
    let reported = &json(&out.join("report.json"))["open_for"];
    assert_eq!(reported["unmet-light"].as_u64(), Some(unmet as u64), "{reported}");
    let all: u64 = reported.as_object().unwrap().values().map(|count| count.as_u64().unwrap()).sum();
    assert_eq!(all as usize, waits.len() - count(""), "{reported}");
    assert!(said.contains(&format!("{unmet} of 16 tiles wait for light")), "{said}");
    assert!(said.contains("one dot at (80, 70) holds 100 % of it"), "{said}");
    // Those around the dot show it as noise
    let noisy = count("noise");
    let dot =
        format!("one dot at (80, 70) keeps {noisy} of 16 tiles open: it holds 100 % of the noise of its own");
    assert!(noisy > 0 && said.contains(&dot), "{noisy}: {said}");
    let Picture::Display(map) = read_picture(out.join("stops.png")).unwrap() else { panic!("a PNG") };
    let framed = [255.0, 210.0, 40.0].map(|byte: f32| byte / 255.0);
    let is_framed = |x: usize, y: usize| map.pixels[y * map.width + x] == framed;
    assert!(is_framed(193, 200) && !is_framed(200, 200), "the frame of the last tile");
    assert!((256..map.width).any(|x| (0..map.height).any(|y| is_framed(x, y))), "the legend");
}

/// A program that writes PFM, here in Python, in whole images: until the oracle is satisfied or the samples
/// are used up.
#[test]
fn a_command_renders() {
    let Some(python) = require_python() else { return };
    let python = text(&python);
    let folder = tempdir().unwrap();
    let script = folder.path().join("render it.py");
    let program = "import array, random, sys\n\
        scene, seed, spp, out = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]\n\
        assert open(scene).read() == 'lamp'\n\
        draw = random.Random(seed).gauss\n\
        values = array.array('f', (draw(0.5, 0.2 / spp ** 0.5) for _ in range(3 * 48 * 40)))\n\
        open(out, 'wb').write(b'PF\\n48 40\\n-1\\n' + values.tobytes())\n";
    std::fs::write(&script, program).unwrap();
    let scene = folder.path().join("a scene.txt");
    std::fs::write(&scene, "lamp").unwrap();
    let source = format!("command: {python} '{}' {{scene}} {{seed}} {{spp}} {{out}}.pfm", script.display());
    let out = folder.path().join("out");
    succeed(&fixed(&source, text(&scene), &out, &["--max-spp", "300"]));
    let report = json(&out.join("report.json"));
    assert_eq!((report["width"].as_u64(), report["height"].as_u64()), (Some(48), Some(40)));
    assert_eq!(report["source"].as_str(), Some(format!("command {python}").as_str()));
    // Noise of 0.2 falls with the samples: after n of them 0.2/√n, a tenth of it away with p < 1e-8
    let spp = report["samples"].as_f64().unwrap() / (48.0 * 40.0);
    let image = read_exr(out.join("image.exr")).unwrap();
    let squares: f64 = image.pixels.iter().flatten().map(|&c| f64::from(c - 0.5).powi(2)).sum();
    let deviation = (squares / (3.0 * 48.0 * 40.0)).sqrt() * spp.sqrt();
    assert!((deviation / 0.2 - 1.0).abs() < 0.1, "{deviation} at {spp} samples");

    std::fs::write(&scene, "no lamp").unwrap();
    fail(
        &fixed(&source, text(&scene), &out, &["--size", "48x40", "--force"]),
        &["AssertionError", "render it.py"],
    );
    fail(&fixed("command: ", text(&scene), &out, &[]), &["it is empty"]);
}

#[test]
fn options_of_the_built_in_renderer_are_refused_elsewhere() {
    let folder = tempdir().unwrap();
    let out = folder.path().join("out");
    for (option, value) in
        [("--no-mis", None), ("--sampler", Some("sobol")), ("--filter", Some("box")), ("--clamp", Some("1"))]
    {
        for source in ["mitsuba", "exr", "command: render {seed} {spp} {out}"] {
            let more: Vec<_> = std::iter::once(option).chain(value).collect();
            fail(&fixed(source, CORNELL_BOX, &out, &more), &[option, "--source"]);
        }
    }
    fail(&["render", "--source", "povray"], &["mitsuba", "ptwne", "exr", "command"]);
    fail(&["render", "--source", "mitsuba"], &["needs a scene file"]);
    fail(&["doctor", "--install", "povray"], &["mitsuba"]);
}

/// Nothing is installed in an empty cache folder: that is said, with what to do, and is no fault; a Python
/// that lacks the renderer is one.
#[test]
fn the_doctor_says_what_is_missing() {
    let cache = tempdir().unwrap();
    let doctor = |python: Option<&str>, args: &[&str]| {
        let mut doctor = command(args);
        doctor.env("XDG_CACHE_HOME", cache.path()).env("LOCALAPPDATA", cache.path());
        match python {
            Some(python) => doctor.env("NOISEFLOOR_MITSUBA_PYTHON", python),
            None => doctor.env_remove("NOISEFLOOR_MITSUBA_PYTHON"),
        };
        let output = doctor.output().unwrap();
        let said = [output.stdout, output.stderr].concat();
        (output.status.code(), String::from_utf8(said).unwrap())
    };
    let (code, said) = doctor(None, &["doctor"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("ptwne") && said.contains("noisefloor doctor --install mitsuba"), "{said}");
    let (code, said) = doctor(Some("/no/such/python"), &["doctor"]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("/no/such/python") && said.contains("NOISEFLOOR_MITSUBA_PYTHON"), "{said}");
    let (code, said) = doctor(None, &["doctor", "--json"]);
    let rows: Vec<serde_json::Value> = serde_json::from_str(&said).unwrap();
    assert!(code == Some(0) && rows[0]["renderer"] == "ptwne" && rows[0]["usable"] == true, "{said}");
    assert!(rows.iter().any(|row| row["renderer"] == "mitsuba" && row["usable"] == false), "{said}");
    let (code, said) = doctor(None, &["render", "--source", "mitsuba", CORNELL_BOX]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("noisefloor doctor --install mitsuba") && said.lines().count() == 1, "{said}");
}

/// From the scene file to the stops, by another renderer.
#[test]
fn mitsuba_renders_until_the_oracle_is_satisfied() {
    let doctor = command(&["doctor"]).output().unwrap();
    let said = String::from_utf8(doctor.stdout).unwrap();
    let usable = said.lines().any(|line| line.starts_with("mitsuba    yes"));
    let Some(()) = require(Requirement::Renderers, if usable { Ok(()) } else { Err(said) }) else { return };
    let folder = tempdir().unwrap();
    let out = folder.path().join("out");
    let more = ["--size", "64x48", "--max-spp", "200", "--max-depth", "5", "--threads", "2", "--seed", "9"];
    succeed(&fixed("mitsuba", CORNELL_BOX, &out, &more));
    let report = json(&out.join("report.json"));
    assert_eq!((report["scene"].as_str(), report["width"].as_u64()), (Some("cornell-box"), Some(64)));
    assert!(report["source"].as_str().unwrap().starts_with("Mitsuba 3"), "{report}");
    assert_eq!((report["complete"].as_bool(), report["tiles"].as_u64()), (Some(true), Some(4)));
}
