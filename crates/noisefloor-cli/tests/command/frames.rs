use crate::kit::{column, command, fail, json, stderr, succeed, text};
use std::fs;
use std::path::Path;
use tempfile::{TempDir, tempdir};

/// Three frames, and options for them.
fn shots() -> TempDir {
    let folder = tempdir().unwrap();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/cornell-box.xml");
    for frame in 1..=3 {
        fs::copy(scene, folder.path().join(format!("hall.{frame:04}.xml"))).unwrap();
    }
    let options = "size = \"32x32\"\ntile = 32\nbatch = 8\ncriterion = \"spp:8\"\n";
    fs::write(folder.path().join("shot.toml"), options).unwrap();
    folder
}

fn table(folder: &Path) -> Vec<(u32, bool, f64)> {
    let mut rows = csv::Reader::from_path(folder.join("frames.csv")).unwrap();
    rows.deserialize()
        .map(|row| {
            row.map(|(frame, complete, spp, _, _): (_, _, _, f64, usize)| (frame, complete, spp)).unwrap()
        })
        .collect()
}

#[test]
fn a_sequence_is_rendered_and_resumed_frame_by_frame() {
    let folder = shots();
    let (out, shot) = (folder.path().join("out"), folder.path().join("shot.toml"));
    let scene = folder.path().join("hall.{frame:04}.xml");
    let render = ["render", "--config", text(&shot), "--frames", "1-3", text(&scene), "--out", text(&out)];

    // A frame that cannot be rendered stops the sequence; what is done stays
    let second = folder.path().join("hall.0002.xml");
    let kept = fs::read(&second).unwrap();
    fs::write(&second, "<scene").unwrap();
    let output = command(&render).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("frame 2 of 1 to 3 failed; --resume"), "{}", stderr(&output));
    assert_eq!(table(&out), [(1, true, 8.0)]);
    let first = fs::metadata(out.join("0001/image.exr")).unwrap().modified().unwrap();

    // It goes on from there, and leaves alone what is done
    fs::write(&second, kept).unwrap();
    let said = succeed(&[&render[..], &["--resume"]].concat());
    assert!(said.contains("3 frames, 8 to 8 samples per pixel"), "{said}");
    assert_eq!(table(&out), [(1, true, 8.0), (2, true, 8.0), (3, true, 8.0)]);
    assert_eq!(fs::metadata(out.join("0001/image.exr")).unwrap().modified().unwrap(), first);
    let seeds: Vec<_> =
        (1..=3).map(|frame| json(&out.join(format!("{frame:04}/report.json")))["seed"].clone()).collect();
    assert!(seeds.iter().all(|seed| *seed == seeds[0]), "{seeds:?}");
    // The frames are of one still scene and one seed
    let picture = |frame: u32| fs::read(out.join(format!("{frame:04}/image.png"))).unwrap();
    assert!(picture(1) == picture(2) && picture(2) == picture(3));
}

/// A finished frame is this sequence's only if its job is, and if its pictures are there.
#[test]
fn finished_frames_of_another_job_are_not_taken() {
    let folder = shots();
    let (out, shot) = (folder.path().join("out"), folder.path().join("shot.toml"));
    let scene = folder.path().join("hall.{frame:04}.xml");
    let render = ["render", "--config", text(&shot), "--frames", "1-2", text(&scene), "--out", text(&out)];
    let resume = |more: &[&'static str]| [&render[..], &["--resume", "--quiet"], more].concat();
    let refused = |args: &[&str]| {
        let output = command(args).output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
        assert!(stderr(&output).contains("holds a finished picture of other options"), "{}", stderr(&output));
    };
    succeed(&render);
    refused(&resume(&["--seed", "2"]));
    refused(&resume(&["--size", "48x32"]));
    // A picture that somebody has removed is made again, and no other
    let pictures = [1, 2].map(|frame| out.join(format!("{frame:04}/image.exr")));
    let kept = fs::read(&pictures[1]).unwrap();
    let first = fs::metadata(&pictures[0]).unwrap().modified().unwrap();
    fs::remove_file(&pictures[1]).unwrap();
    succeed(&resume(&[]));
    assert!(fs::read(&pictures[1]).unwrap() == kept);
    assert_eq!(fs::metadata(&pictures[0]).unwrap().modified().unwrap(), first);
    // The scene has changed since
    let second = folder.path().join("hall.0002.xml");
    fs::write(&second, fs::read_to_string(&second).unwrap() + "<!-- brighter -->").unwrap();
    refused(&resume(&[]));
}

/// Whoever kills the sequence has killed its frame, which ends as by SIGTERM.
#[test]
#[cfg(unix)]
fn a_killed_sequence_leaves_no_frame_rendering() {
    let folder = shots();
    let (out, shot) = (folder.path().join("out"), folder.path().join("shot.toml"));
    let scene = folder.path().join("hall.{frame:04}.xml");
    let long = ["--criterion", "spp:100000000", "--max-spp", "100000000", "--autosave", "3"];
    let render = ["render", "--config", text(&shot), "--frames", "1-1", text(&scene), "--out", text(&out)];
    let mut parent =
        command(&[&render[..], &long].concat()).stderr(std::process::Stdio::null()).spawn().unwrap();
    let wait = |what: &str, done: &dyn Fn() -> bool| {
        let began = std::time::Instant::now();
        while !done() {
            assert!(began.elapsed().as_secs() < 120, "{what}");
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
    };
    let lock = out.join("0001/.noisefloor.lock");
    let locked = || fs::File::open(&lock).is_ok_and(|lock| lock.try_lock().is_err());
    // Killed before its first samples, it would have nothing to write
    let checkpoint = out.join("0001/checkpoint.nfc");
    wait("the frame has samples", &|| checkpoint.exists());
    fs::remove_file(&checkpoint).unwrap();
    parent.kill().unwrap();
    parent.wait().unwrap();
    wait("the frame ends", &|| !locked());
    assert!(checkpoint.exists(), "it has written what it had");
}

#[test]
fn what_is_typed_wins_over_a_file_and_nonsense_is_refused() {
    let folder = shots();
    let (out, shot) = (folder.path().join("out"), folder.path().join("shot.toml"));
    succeed(&["render", "--config", text(&shot), "--criterion", "spp:4", "--out", text(&out)]);
    let report = json(&out.join("report.json"));
    assert_eq!((report["width"].as_u64(), report["samples"].as_u64()), (Some(32), Some(4 * 32 * 32)));
    fail(&["render", "--frames", "1-3", "hall.xml"], &["hall.xml", "{frame:04}"]);
    fail(&["render", "--frames", "3-1", "hall.{frame}.xml"], &["frames 3 to 1"]);
    fail(&["render", "--frames", "all", "hall.{frame}.xml"], &["1-240"]);
    fail(&["render", "--config", "absent.toml"], &["--config absent.toml"]);
    fs::write(&shot, "colour = \"green\"").unwrap();
    fail(&["render", "--config", text(&shot)], &["shot.toml: line 1: ", "no option colour"]);
}

/// A draft stops where people want four times the samples; a final picture is judged twice.
#[test]
fn presets_ask_for_less_and_for_more() {
    let folder = tempdir().unwrap();
    let samples = |preset: &[&str], name: &str| {
        let out = folder.path().join(name);
        let args = [
            "render",
            "--size",
            "64x64",
            "--tile",
            "32",
            "--batch",
            "16",
            "--max-spp",
            "1200",
            "--quiet",
            "--out",
        ];
        succeed(&[&args[..], &[text(&out)], preset].concat());
        json(&out.join("report.json"))["samples"].as_u64().unwrap()
    };
    let (draft, plain) = (samples(&["--preset", "draft"], "draft"), samples(&[], "plain"));
    let last = samples(&["--preset", "final"], "final");
    assert!(2 * draft < plain && plain < last, "{draft}, {plain} and {last} samples");
}

/// A draft has its first verdict at a quarter of the samples, too; and small tiles are warned of, once.
#[test]
fn a_draft_may_stop_below_a_hundred_samples() {
    let folder = tempdir().unwrap();
    let out = folder.path().join("draft");
    let args = ["render", "--size", "64x64", "--tile", "32", "--preset", "draft", "--out", text(&out)];
    let output = command(&args).output().unwrap();
    assert!(output.status.success());
    assert_eq!(stderr(&output).matches("tiles of 32 pixels are small").count(), 1);
    let spp = column(&out.join("stops.csv"), "spp");
    assert!(spp.iter().any(|spp| (16..100).contains(&spp.parse::<u64>().unwrap())), "{spp:?}");
}
