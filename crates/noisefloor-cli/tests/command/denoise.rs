use crate::kit::{FILES, column, command, fail, json, run, stderr, succeed, text, tiny, wait_for, words};
use noisefloor_denoise::OIDN;
use noisefloor_image::{RenderLayers, read_exr, write_exr};
use noisefloor_sidecar::find;
use noisefloor_testkit::{HANG, Noise, Requirement, require, require_python};
use std::path::Path;
use std::process::Stdio;
use std::time::Duration;
use tempfile::tempdir;

#[test]
fn options_that_have_no_say_are_refused() {
    let folder = tempdir().unwrap();
    let out = text(folder.path());
    for more in [
        &["--denoise", "oidn", "--model", "m.nfm"][..],
        &["--denoise", "oidn", "--criterion", "spp:100"],
        &["--denoise", "blur"],
        &["--lost", "0.1"],
        &["--denoise", "oidn", "--lost", "0"],
    ] {
        fail(&tiny(out, more), &["--"]);
    }
}

#[test]
fn without_the_denoiser_it_says_how_to_install_it() {
    let folder = tempdir().unwrap();
    let mut typed = command(&tiny(text(folder.path()), &["--denoise", "oidn"]));
    typed.env("XDG_CACHE_HOME", folder.path()).env_remove(OIDN.variable());
    let output = typed.output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let said = stderr(&output);
    assert!(said.contains("doctor --install oidn") && said.lines().count() == 1, "{said}");
}

#[test]
fn the_denoised_picture_and_its_error_are_written() {
    if require(Requirement::Renderers, find(&OIDN)).is_none() {
        return;
    }
    let folder = tempdir().unwrap();
    let (out, noisy) = (folder.path().join("out"), folder.path().join("noisy"));
    succeed(&tiny(text(&out), &["--denoise", "oidn", "--lost", "0.5"]));
    let more = ["image-denoised.exr", "image-denoised.png", "denoised-error.png", "albedo.exr", "normal.exr"];
    for file in FILES.iter().chain(&more) {
        assert!(out.join(file).exists(), "{file}");
    }
    let spp: Vec<u64> = column(&out.join("stops.csv"), "spp").iter().map(|n| n.parse().unwrap()).collect();
    assert!(spp.iter().all(|n| n % 16 == 0 || *n == 200), "{spp:?}");
    let report = &json(&out.join("report.json"))["denoised"];
    assert!(report["denoiser"].as_str().unwrap().contains("Open Image Denoise"));
    assert_eq!(report["guided"].as_bool(), Some(true));
    assert!(report["picture_seconds"].as_f64() > Some(0.0));
    assert!(report["spp_without"].as_f64().unwrap() > *spp.iter().max().unwrap() as f64 / 4.0);

    // It is nearer to a converged picture than what it was made from
    let many = ["render", "--size", "64x64", "--criterion", "spp:600", "--seed", "5", "--quiet", "--out"];
    succeed(&many.into_iter().chain([text(&noisy)]).collect::<Vec<_>>());
    let read = |path: &Path, name: &str| read_exr(path.join(name)).unwrap().pixels;
    let truth = read(&noisy, "image.exr");
    let error = |name: &str| -> f32 {
        let squares =
            read(&out, name).into_iter().zip(&truth).map(|(p, t)| (p[1].min(4.0) - t[1].min(4.0)).powi(2));
        squares.sum()
    };
    let (denoised, rendered) = (error("image-denoised.exr"), error("image.exr"));
    assert!(denoised < 0.7 * rendered, "{denoised} and {rendered}");

    let said = run(&["doctor"]);
    assert!(String::from_utf8(said.stdout).unwrap().lines().any(|line| line.starts_with("oidn ")));
}

/// Killed at random moments and resumed, a render ends as an undisturbed one does, and knows what was found of
/// tiles that had stopped before.
#[test]
fn killed_denoised_renders_lose_nothing() {
    if require(Requirement::Renderers, find(&OIDN)).is_none() {
        return;
    }
    let [whole, killed] = [tempdir().unwrap(), tempdir().unwrap()];
    let arguments = |out: &Path, more: &[&str]| -> Vec<String> {
        let args = ["render", "--size", "64x64", "--tile", "32", "--denoise", "oidn", "--lost", "0.02"];
        let rest = ["--max-spp", "700", "--threads", "1", "--quiet", "--autosave", "0.1", "--out", text(out)];
        args.iter().chain(&rest).chain(more).map(|word| (*word).to_owned()).collect()
    };
    succeed(&arguments(whole.path(), &[]));
    let resume = arguments(killed.path(), &["--resume"]);
    let saved = killed.path().join("checkpoint.nfc");
    let last_save = || std::fs::metadata(&saved).and_then(|file| file.modified()).ok();
    let mut cut = 0;
    for wait in [0, 150, 400] {
        let before = last_save();
        let mut child = command(&resume).stderr(Stdio::null()).spawn().unwrap();
        while last_save() == before && child.try_wait().unwrap().is_none() {
            std::thread::sleep(Duration::from_millis(5));
        }
        std::thread::sleep(Duration::from_millis(wait));
        cut += usize::from(child.try_wait().unwrap().is_none());
        child.kill().unwrap();
        child.wait().unwrap();
    }
    assert!(cut > 0, "the render was done before it was killed, each time");
    succeed(&resume);
    assert_same_pictures(killed.path(), whole.path());
}

#[test]
fn denoised_pictures_made_elsewhere() {
    let folder = tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    let stripes = |noise: &mut dyn FnMut() -> f64| -> Vec<[f32; 3]> {
        (0..64 * 64).map(|i| [0.4 + 0.05 * (i / 4 % 2) as f32 + 0.01 * noise() as f32; 3]).collect()
    };
    let noise = |seed: u64| {
        let mut noise = Noise::new(seed);
        move || noise.normal()
    };
    let flat = vec![[0.425; 3]; 64 * 64];
    for (name, pixels) in [
        ("a.exr", stripes(&mut noise(1))),
        ("b.exr", stripes(&mut noise(2))),
        ("good.exr", stripes(&mut || 0.0)),
        ("good2.exr", stripes(&mut || 0.001)),
        ("bad.exr", flat),
        ("bad2.exr", vec![[0.4251; 3]; 64 * 64]),
        ("bright.exr", stripes(&mut || 30.0)),
        ("bright2.exr", stripes(&mut || 30.01)),
    ] {
        write_exr(path(name), &RenderLayers::rgb(64, 64, &pixels)).unwrap();
    }
    let [a, b, good, good2, bad] = ["a.exr", "b.exr", "good.exr", "good2.exr", "bad.exr"].map(path);
    let [bad2, bright, bright2] = ["bad2.exr", "bright.exr", "bright2.exr"].map(path);
    let judge = |more: &[&str]| -> Vec<String> {
        let all =
            ["judge", &a, "--spp", "50", "--against", &b, "--spp", "50", "--tile", "32", "--lost", "0.2"];
        all.iter().chain(more).map(|word| (*word).to_owned()).collect()
    };
    let say = |more: &[&str]| succeed(&judge(more));
    let map = path("map.png");
    let clean = say(&["--independent", "--denoised", &good, &good2, "--noise-map", &map]);
    assert!(clean.contains("4 of 4 denoised tiles") && clean.contains("nobody has been asked"), "{clean}");
    assert!(Path::new(&map).exists());
    // Any number of threads says the same
    assert_eq!(say(&["--independent", "--threads", "1", "--denoised", &good, &good2]), clean);
    // Without details, and too bright by 0.3 with all of them right
    for [one, other] in [[&bad, &bad2], [&bright, &bright2]] {
        let json = say(&["--independent", "--json", "--denoised", one, other]);
        let report: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(report["converged_tiles"].as_u64(), Some(0), "{json}");
    }

    // What one picture alone has met, the other tiles may lack; a denoiser takes it for noise
    let mut met = stripes(&mut noise(1));
    met[20 * 64 + 20] = [3e4; 3];
    let (met_path, [a_again, b_again]) = (path("met.exr"), [&a, &b]);
    write_exr(&met_path, &RenderLayers::rgb(64, 64, &met)).unwrap();
    for [first, second] in [[&met_path, b_again], [a_again, &met_path]] {
        let line =
            format!("judge {first} {second} --spp 8 --spp 8 --tile 32 --lost 0.2 --independent --json");
        let json = succeed(&[words(&line), vec!["--denoised", &good, &good2]].concat());
        let report: serde_json::Value = serde_json::from_str(&json).unwrap();
        let unmet: Vec<bool> = report["tiles"]
            .as_array()
            .unwrap()
            .iter()
            .map(|tile| tile["open_for"] == "unmet-light")
            .collect();
        assert_eq!(unmet[1..], [true; 3], "{json}");
        assert!(report["converged_tiles"].as_u64().unwrap() <= 1, "{json}");
    }

    let refuse = |more: &[&str], words: &[&str]| fail(&judge(more), words);
    refuse(&["--nested", "--denoised", &good, &bad], &["--nested"]);
    refuse(&["--denoised", &good], &["--denoised"]);
    refuse(&["--independent", "--denoised", &a, &bad], &["identical"]);
    refuse(&["--independent", "--denoised", &bad, &bad], &["identical", "its own half"]);
}

/// A stand-in for Open Image Denoise, as an interpreter that ignores the script it is given: it hands
/// pictures back, and hangs once the file `hang` is there, or, if that holds a number, over so many pictures.
#[cfg(unix)]
fn fake_denoiser(folder: &Path, python: &Path) -> std::path::PathBuf {
    use std::os::unix::fs::PermissionsExt;
    const HOST: &str = r#"
import json, os, struct, sys, time
source, sink = sys.stdin.buffer, sys.stdout.buffer
while True:
    lengths = source.read(8)
    if len(lengths) < 8:
        break
    header, payload = struct.unpack("<II", lengths)
    asked, payload = json.loads(source.read(header)), source.read(payload)
    reply = {"ok": True, "name": "a stand-in"}
    if asked["op"] == "filter":
        while os.path.exists(sys.argv[1]) and open(sys.argv[1]).read() in ("", str(asked["frames"])):
            open(sys.argv[1] + "ing", "w").close()
            time.sleep(0.05)
        size = asked["width"] * asked["height"] * 12
        step = size * len(asked["pictures"])
        payload = b"".join(payload[i * step :][:size] for i in range(asked["frames"]))
    reply = json.dumps(reply).encode()
    sink.write(struct.pack("<II", len(reply), len(payload)) + reply + payload)
    sink.flush()
"#;
    let (host, script) = (folder.join("host.py"), folder.join("python"));
    std::fs::write(&host, HOST).unwrap();
    let [host, hang, python] = [&host, &folder.join("hang"), python].map(|path| path.display().to_string());
    std::fs::write(&script, format!("#!/bin/sh\nexec '{python}' '{host}' '{hang}'\n")).unwrap();
    std::fs::set_permissions(&script, std::fs::Permissions::from_mode(0o755)).unwrap();
    script
}

/// A denoiser that hangs holds nothing up: the first signal ends the verdict, everything that is rendered is
/// saved, and `--resume` ends as an undisturbed render does.
#[test]
#[cfg(unix)]
fn a_denoiser_that_hangs_costs_no_samples() {
    let Some(python) = require_python() else { return };
    let folder = tempdir().unwrap();
    let (denoiser, hang) = (fake_denoiser(folder.path(), &python), folder.path().join("hang"));
    let [whole, broken] = ["whole", "broken"].map(|name| folder.path().join(name));
    let render = |out: &Path, more: &[&str]| {
        let args =
            ["render", "bulb", "--size", "32x32", "--tile", "16", "--denoise", "oidn", "--max-spp", "64"];
        let rest = ["--denoise-passes", "1", "--threads", "1", "--quiet", "--out", text(out)];
        let mut typed = command(&[&args[..], &rest, more].concat());
        typed.env(OIDN.variable(), &denoiser).stderr(Stdio::piped());
        typed
    };
    assert!(render(&whole, &[]).status().unwrap().success());

    std::fs::write(&hang, "").unwrap();
    let child = render(&broken, &[]).spawn().unwrap();
    // The first verdict hangs, however long a busy machine takes to get there
    let hanging = folder.path().join("hanging");
    wait_for("the denoiser", || hanging.exists().then_some(()));
    let id = child.id().to_string();
    assert!(std::process::Command::new("kill").args(["-TERM", &id]).status().unwrap().success());
    let begun = std::time::Instant::now();
    let ended = child.wait_with_output().unwrap();
    let said = stderr(&ended);
    assert!(begun.elapsed() < HANG, "{said}");
    assert_eq!(ended.status.code(), Some(130), "{said}");
    assert!(said.contains("the verdict under way is lost") && said.contains("is not denoised"), "{said}");
    assert!(read_exr(broken.join("image.exr")).is_ok() && broken.join("checkpoint.nfc").exists());
    assert!(json(&broken.join("report.json"))["samples"].as_u64() > Some(0));

    // So does the time allowed, whatever the signals
    let ended = render(&broken, &["--resume", "--timeout", "1"]).output().unwrap();
    let said = stderr(&ended);
    assert!(ended.status.code() == Some(1) && said.contains("no answer in 1 s"), "{said}");
    assert!(broken.join("checkpoint.nfc").exists());

    std::fs::remove_file(&hang).unwrap();
    let ended = render(&broken, &["--resume"]).output().unwrap();
    assert!(ended.status.success(), "{}", stderr(&ended));
    assert_same_pictures(&broken, &whole);

    // Killed while the last picture is denoised, after all verdicts
    std::fs::remove_file(&hanging).unwrap();
    std::fs::write(&hang, "1").unwrap();
    let killed = folder.path().join("killed");
    let mut child = render(&killed, &[]).spawn().unwrap();
    wait_for("the denoiser", || hanging.exists().then_some(()));
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!killed.join("denoised-error.png").exists());
    std::fs::remove_file(&hang).unwrap();
    let ended = render(&killed, &["--resume"]).output().unwrap();
    assert!(ended.status.success(), "{}", stderr(&ended));
    assert_same_pictures(&killed, &whole);
}

/// To the bit, the map of what is left included, and what was found of tiles that had stopped before.
fn assert_same_pictures(one: &Path, other: &Path) {
    for name in ["image.exr", "image-denoised.exr"] {
        let pixels = |out: &Path| read_exr(out.join(name)).unwrap().pixels;
        assert!(pixels(one) == pixels(other), "{name}");
    }
    let map = |out: &Path| std::fs::read(out.join("denoised-error.png")).unwrap();
    assert!(map(one) == map(other), "denoised-error.png");
    for key in ["jods_lost", "spp_without", "guided"] {
        let said = |out: &Path| json(&out.join("report.json"))["denoised"][key].clone();
        assert_eq!(said(one), said(other), "{key}");
    }
}
