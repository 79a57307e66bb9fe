use crate::kit::{column, command, fail, json, stderr, succeed, text, wait_for};
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
    // Samples that nobody is going to ask for again would fill the disk
    assert!(!out.join("0001/finished.nfc").exists());
    assert_eq!(table(&out), [(1, true, 8.0), (2, true, 8.0), (3, true, 8.0)]);
    assert_eq!(fs::metadata(out.join("0001/image.exr")).unwrap().modified().unwrap(), first);
    // The frames are of one still scene: they differ by their noise, and not by their exposure
    let [seeds, exposures] = ["seed", "exposure"].map(|key| reported(&out, key));
    assert!(seeds[0] != seeds[1] && seeds[1] != seeds[2] && seeds[2] != seeds[0], "{seeds:?}");
    assert!(exposures[0].is_number() && exposures.iter().all(|e| *e == exposures[0]), "{exposures:?}");
    assert!(picture(&out, 1) != picture(&out, 2) && picture(&out, 2) != picture(&out, 3));
    // As without the interruption
    let again = folder.path().join("again");
    let render = ["render", "--config", text(&shot), "--frames", "1-3", text(&scene), "--out", text(&again)];
    succeed(&render);
    assert!((1..=3).all(|frame| picture(&out, frame) == picture(&again, frame)));
}

/// What the reports of three frames say.
fn reported(out: &Path, key: &str) -> Vec<serde_json::Value> {
    (1..=3).map(|frame| json(&out.join(format!("{frame:04}/report.json")))[key].clone()).collect()
}

fn picture(out: &Path, frame: u32) -> Vec<u8> {
    fs::read(out.join(format!("{frame:04}/image.exr"))).unwrap()
}

/// A film has one exposure: of the frame that is named, of another render, or a number; or each its own, which is
/// warned of.
#[test]
fn frames_take_their_exposure_from_where_they_are_told() {
    let folder = shots();
    let shot = folder.path().join("shot.toml");
    let scene = folder.path().join("hall.{frame:04}.xml");
    let out = |name: &str| folder.path().join(name);
    let render = |name: &str, more: &[&str]| {
        let out = out(name);
        let args = ["render", "--config", text(&shot), "--frames", "1-3", text(&scene), "--out", text(&out)];
        let output = command(&[&args[..], more].concat()).output().unwrap();
        (output.status.code(), stderr(&output), out)
    };
    let exposures = |name: &str, more: &[&str]| {
        let (code, said, out) = render(name, more);
        assert_eq!(code, Some(0), "{said}");
        (reported(&out, "exposure"), said)
    };
    let (each, said) = exposures("each", &["--exposure-from", "each"]);
    assert!(each[0] != each[1] && each[1] != each[2], "{each:?}");
    assert!(said.contains("the film flickers"), "{said}");
    let (first, said) = exposures("first", &[]);
    assert_eq!(first, vec![each[0].clone(); 3]);
    assert!(!said.contains("warning"), "{said}");
    // Frame 3 is rendered first
    let (third, _) = exposures("third", &["--exposure-from", "3"]);
    assert_eq!(third, vec![each[2].clone(); 3]);
    let second = out("each/0002");
    let (other, _) = exposures("other", &["--exposure-from", text(&second)]);
    assert_eq!(other, vec![each[1].clone(); 3]);
    let (number, _) = exposures("number", &["--exposure", "1.25"]);
    assert_eq!(number, vec![serde_json::json!(1.25); 3]);

    // What is there keeps its exposure, whatever is asked for later
    let (code, said, _) = render("third", &["--resume", "--exposure-from", "1"]);
    assert_eq!(code, Some(1), "{said}");
    assert!(said.contains("exposure.json has the exposure of frame 3"), "{said}");
    fs::remove_dir_all(out("third/0002")).unwrap();
    assert_eq!(exposures("third", &["--resume"]).0, third);
    let (anew, _) = exposures("third", &["--force"]);
    assert_eq!(anew, first);

    let (code, said, _) = render("wrong", &["--exposure-from", "nowhere"]);
    assert_eq!(code, Some(1));
    assert!(said.contains("--exposure-from nowhere"), "{said}");
    let srgb = ["--exposure-from", "first", "--tone-mapping", "srgb"];
    fail(&[&["render", "--frames", "1-3", text(&scene)], &srgb[..]].concat(), &["--tone-mapping srgb"]);
    fail(&["render", "--exposure-from", "first"], &["--frames"]);
    fail(&["render", "--exposure-from", "1,2"], &["--frames"]);
    fail(&["render", "--exposure", "2", "--key", "0.2"], &["either --key or --exposure"]);
}

/// Between several frames, which are rendered first, the exposure is eased by equal factors; a sequence that
/// is taken up again has the same.
#[test]
fn exposure_is_eased_between_frames() {
    let folder = shots();
    let (out, shot) = (folder.path().join("out"), folder.path().join("shot.toml"));
    // The second frame's lamp is four times as bright, and the third's as at first
    let lamp = folder.path().join("hall.0002.xml");
    let xml = fs::read_to_string(&lamp).unwrap();
    let radiance =
        xml.split("name=\"radiance\" value=\"").nth(1).unwrap().split('"').next().unwrap().to_owned();
    let bright: Vec<String> =
        radiance.split(',').map(|c| (4.0 * c.trim().parse::<f64>().unwrap()).to_string()).collect();
    let two = xml.replacen(&radiance, &bright.join(", "), 1);
    fs::write(&lamp, &two).unwrap();
    fs::copy(folder.path().join("hall.0001.xml"), folder.path().join("hall.0004.xml")).unwrap();
    fs::write(folder.path().join("hall.0004.xml"), &two).unwrap();
    let scene = folder.path().join("hall.{frame:04}.xml");
    let args =
        ["render", "--config", text(&shot), "--frames", "1-4", text(&scene), "--out", text(&out), "--quiet"];
    succeed(&[&args[..], &["--exposure-from", "4,1"]].concat());
    let exposures = |out: &Path| {
        [1, 2, 3, 4]
            .map(|frame| json(&out.join(format!("{frame:04}/report.json")))["exposure"].as_f64().unwrap())
    };
    let found = exposures(&out);
    assert!(found[3] < 0.5 * found[0], "{found:?}");
    let factor = (found[3] / found[0]).cbrt();
    for (frame, exposure) in found.iter().enumerate() {
        let eased = found[0] * factor.powi(frame as i32);
        assert!((exposure / eased - 1.0).abs() < 1e-5, "frame {}: {exposure}, not {eased}", frame + 1);
    }
    let kept = json(&out.join("exposure.json"));
    assert_eq!(kept[1]["frame"], 4);
    fs::remove_dir_all(out.join("0002")).unwrap();
    succeed(&[&args[..], &["--resume"]].concat());
    assert_eq!(exposures(&out), found);
    let output = command(&[&args[..], &["--resume", "--exposure-from", "1,2,4"]].concat()).output().unwrap();
    assert!(stderr(&output).contains("has the exposure of frame 1, 4"), "{}", stderr(&output));
    // A farm takes one exposure of a render, and a sequence with several has none
    fail(&["render", "--exposure-from", text(&out)], &["several exposures"]);
}

/// A forecast renders a few frames of the sequence, says what all take, and loses nothing: the sequence goes
/// on from them.
#[test]
fn a_forecast_renders_frames_that_the_sequence_keeps() {
    let folder = shots();
    for frame in 4..=9 {
        fs::copy(folder.path().join("hall.0001.xml"), folder.path().join(format!("hall.{frame:04}.xml")))
            .unwrap();
    }
    let out = folder.path().join("out");
    let scene = folder.path().join("hall.{frame:04}.xml");
    let args =
        ["render", "--size", "32x32", "--tile", "32", "--max-spp", "4000", "--fps", "24", "--threads", "1"];
    let args = [&args[..], &["--frames", "1-9", text(&scene), "--out", text(&out)]].concat();
    let said = succeed(&[&args[..], &["--forecast=3"]].concat());
    assert!(said.contains("all 9 frames: ") && said.contains("in nine of ten sequences"), "{said}");
    let few = table(&out);
    assert_eq!(few.iter().map(|row| row.0).collect::<Vec<_>>(), [1, 5, 9]);
    let forecast = json(&out.join("forecast.json"));
    assert_eq!(
        (&forecast["frames"], &forecast["known"]),
        (&serde_json::json!("1-9"), &serde_json::json!([1, 5, 9]))
    );
    // Three known frames, and lines between them
    let spp = [few[0].2, few[1].2, few[2].2];
    let expected = (spp.iter().sum::<f64>() + 1.5 * (spp[0] + 2.0 * spp[1] + spp[2])) / 9.0;
    let of = |kind: &str, key: &str| forecast[kind][key].as_f64().unwrap();
    assert!((of("spp", "expected") / expected - 1.0).abs() < 1e-9, "{forecast} {expected}");
    for kind in ["spp", "seconds"] {
        assert!(
            of(kind, "low") <= of(kind, "expected") && of(kind, "expected") <= of(kind, "high"),
            "{forecast}"
        );
    }
    // Interrupted, it is taken up
    fs::remove_dir_all(out.join("0005")).unwrap();
    let changed =
        |frame: u32| fs::metadata(out.join(format!("{frame:04}/image.exr"))).unwrap().modified().unwrap();
    let before = [1, 9].map(changed);
    succeed(&[&args[..], &["--forecast=3", "--resume", "--quiet"]].concat());
    assert_eq!(table(&out), few);
    assert_eq!(json(&out.join("forecast.json"))["spp"], forecast["spp"]);
    // The rest
    succeed(&[&args[..], &["--resume", "--quiet"]].concat());
    let all = table(&out);
    assert_eq!((all.len(), [1, 9].map(changed)), (9, before));
    assert_eq!([all[0], all[4], all[8]], [few[0], few[1], few[2]]);
    fail(&["render", "--forecast"], &["--frames"]);
    fail(&["render", "--frames", "1-9", text(&scene), "--forecast=2"], &["3…"]);
    fail(&["farm", "plan", "x", "--frames", "1-9", "--", text(&scene), "--forecast"], &["--frames"]);
}

/// One seed for all frames is possible, and is warned of; a film is not judged so.
#[test]
fn one_seed_for_all_frames_is_warned_of() {
    let folder = shots();
    let (out, shot) = (folder.path().join("out"), folder.path().join("shot.toml"));
    let scene = folder.path().join("hall.{frame:04}.xml");
    let render = ["render", "--config", text(&shot), "--frames", "1-3", text(&scene), "--out", text(&out)];
    let output = command(&[&render[..], &["--same-seed"]].concat()).output().unwrap();
    assert!(output.status.success(), "{}", stderr(&output));
    assert_eq!(stderr(&output).matches("about three times the samples").count(), 1, "{}", stderr(&output));
    assert!(reported(&out, "seed").iter().all(|seed| *seed == 1));
    let shown = |frame: u32| fs::read(out.join(format!("{frame:04}/image.png"))).unwrap();
    assert!(shown(1) == shown(2) && shown(2) == shown(3));
    fail(&[&render[..], &["--same-seed", "--fps", "24"]].concat(), &["--same-seed", "--fps"]);
    let viewing = ["--same-seed", "--viewing", "desk,fps=24"];
    fail(&[&render[..], &viewing].concat(), &["leave out --same-seed"]);
}

/// What a film needs less is tested where a setting is searched for; here, that the rate arrives and is said.
#[test]
fn frames_of_a_film_are_judged_for_their_rate() {
    let folder = tempdir().unwrap();
    let render = |more: &[&str], name: &str| {
        let out = folder.path().join(name);
        let args = ["render", "--size", "32x32", "--tile", "32", "--max-spp", "64", "--out", text(&out)];
        let said = succeed(&[&args[..], more].concat());
        (json(&out.join("report.json"))["judged_for_fps"].clone(), said)
    };
    let (none, said) = render(&[], "still");
    assert!(none.is_null() && !said.contains("frames a second"), "{said}");
    let (rate, said) = render(&["--fps", "24"], "slow");
    assert_eq!(rate, 24.0);
    assert!(said.contains("judged for 24 frames a second") && said.contains("come from stills"), "{said}");
    assert_eq!(render(&["--viewing", "desk,fps=60"], "fast").0, 60.0);
    fail(&["render", "--fps", "4"], &["10…1000 frames per second"]);
    fail(&["render", "--fps", "24", "--viewing", "desk,fps=25"], &["either --fps"]);
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
    let lock = out.join("0001/.noisefloor.lock");
    let locked = || fs::File::open(&lock).is_ok_and(|lock| lock.try_lock().is_err());
    // Killed before its first samples, it would have nothing to write
    let checkpoint = out.join("0001/checkpoint.nfc");
    wait_for("the first samples of the frame", || checkpoint.exists().then_some(()));
    fs::remove_file(&checkpoint).unwrap();
    parent.kill().unwrap();
    parent.wait().unwrap();
    wait_for("the end of the frame", || (!locked()).then_some(()));
    assert!(checkpoint.exists(), "it has written what it had");
}

/// Killed in the frame whose exposure all have, and resumed, a sequence has the pictures, stops and exposure of one that
/// was not.
#[test]
#[cfg(unix)]
fn a_killed_sequence_is_resumed_as_if_it_had_not_been() {
    let folder = shots();
    let scene = folder.path().join("hall.{frame:04}.xml");
    let options = ["--size", "64x64", "--tile", "32", "--batch", "16", "--max-spp", "4000", "--threads", "1"];
    let render = |out: &Path, more: &[&str]| {
        let args = ["render", "--frames", "1-2", text(&scene), "--out", text(out), "--quiet"];
        command(&[&args[..], &options, more].concat())
    };
    let (whole, out) = (folder.path().join("whole"), folder.path().join("out"));
    assert!(render(&whole, &[]).status().unwrap().success());
    let lock = out.join("0001/.noisefloor.lock");
    let locked = || fs::File::open(&lock).is_ok_and(|lock| lock.try_lock().is_err());
    // A machine may take so long to come back here that the frame is done: then once more
    let cut = (0..20).any(|_| {
        drop(fs::remove_dir_all(&out));
        let mut killed = render(&out, &[]).stderr(std::process::Stdio::null()).spawn().unwrap();
        wait_for("the first frame", || locked().then_some(()));
        killed.kill().unwrap();
        killed.wait().unwrap();
        wait_for("its end", || (!locked()).then_some(()));
        !out.join("exposure.json").exists()
    });
    assert!(cut, "the sequence was never killed before its exposure was known");
    assert!(render(&out, &["--resume"]).status().unwrap().success());
    for frame in 1..=2 {
        let read = |out: &Path, name: &str| fs::read(out.join(format!("{frame:04}/{name}"))).unwrap();
        assert!(
            ["image.exr", "stops.csv"].iter().all(|name| read(&whole, name) == read(&out, name)),
            "{frame}"
        );
        let exposure = |out: &Path| json(&out.join(format!("{frame:04}/report.json")))["exposure"].clone();
        assert_eq!(exposure(&whole), exposure(&out));
    }
    let kept = |out: &Path| json(&out.join("exposure.json"));
    assert_eq!(kept(&whole), kept(&out));
}

#[test]
fn what_is_typed_wins_over_a_file_and_nonsense_is_refused() {
    let folder = shots();
    let (out, shot) = (folder.path().join("out"), folder.path().join("shot.toml"));
    succeed(&["render", "--config", text(&shot), "--criterion", "spp:4", "--out", text(&out)]);
    let report = json(&out.join("report.json"));
    assert_eq!((report["width"].as_u64(), report["samples"].as_u64()), (Some(32), Some(4 * 32 * 32)));
    fail(&["render", "--frames", "1-3", "hall.xml"], &["hall.xml", "{frame:04}"]);
    fail(&["render", "--frames", "3-", "hall.{frame}.xml"], &["such as 1-240"]);
    fail(&["render", "--frames", "all", "hall.{frame}.xml"], &["1-240"]);
    fail(&["render", "--config", "absent.toml"], &["--config absent.toml"]);
    fs::write(&shot, "colour = \"green\"").unwrap();
    fail(&["render", "--config", text(&shot)], &["shot.toml: line 1: ", "no option colour"]);
    // Paths of Windows, of which TOML reads the first as an escape that is none, and the second as a tab
    for out in [r#"out = "c:\shots""#, r#"out = "c:\temp""#] {
        fs::write(&shot, out).unwrap();
        fail(
            &["render", "--config", text(&shot)],
            &["shot.toml: line 1: ", r"single quotes, as in 'c:\shots'"],
        );
    }
}

/// A draft stops where people want four times the samples; a final picture is judged twice.
#[test]
fn presets_ask_for_less_and_for_more() {
    let folder = tempdir().unwrap();
    let samples = |preset: &[&str], name: &str| {
        let out = folder.path().join(name);
        // One that needs more than the 100 samples that small pictures get in any case
        let scene = ["render", "needles", "--size", "32x32", "--tile", "32"];
        let args = [&scene[..], &["--batch", "16", "--max-spp", "4000", "--quiet", "--out"]].concat();
        succeed(&[&args[..], &[text(&out)], preset].concat());
        json(&out.join("report.json"))["samples"].as_u64().unwrap()
    };
    let (draft, plain) = (samples(&["--preset", "draft"], "draft"), samples(&[], "plain"));
    let last = samples(&["--preset", "final"], "final");
    assert!(2 * draft < plain && plain < last, "{draft}, {plain} and {last} samples");
}

/// A draft has its first verdict at a quarter of the samples, too, in pictures that have enough of them: this one has its
/// two million after 57 a pixel. And small tiles are warned of, once.
#[test]
fn a_draft_may_stop_below_a_hundred_samples() {
    let folder = tempdir().unwrap();
    let out = folder.path().join("draft");
    let size = ["render", "--size", "192x192", "--tile", "32", "--max-spp", "72"];
    let args = [&size[..], &["--preset", "draft", "--out", text(&out)]].concat();
    let output = command(&args).output().unwrap();
    assert!(output.status.success());
    assert_eq!(stderr(&output).matches("tiles of 32 pixels are small").count(), 1);
    let [spp, reason] = ["spp", "reason"].map(|name| column(&out.join("stops.csv"), name));
    let early =
        |(spp, reason): (&String, &String)| reason == "converged" && spp.parse::<u64>().unwrap() < 100;
    assert!(spp.iter().zip(&reason).any(early), "{spp:?}");
}

/// Steps, lists and frames before 0, as farms send them, and the other places where the number of a frame may stand.
#[test]
fn frames_are_named_as_farms_name_them() {
    let folder = shots();
    let shot = folder.path().join("shot.toml");
    for frame in ["-001", "-002", "-0002"] {
        fs::copy(folder.path().join("hall.0001.xml"), folder.path().join(format!("hall.{frame}.xml")))
            .unwrap();
    }
    let render = |scene: &str, frames: &str, name: &str| {
        let (scene, out) = (folder.path().join(scene), folder.path().join(name));
        let args = ["render", "--config", text(&shot), "--frames", frames, text(&scene), "--out", text(&out)];
        succeed(&[&args[..], &["--quiet", "--exposure", "1"]].concat());
        let mut rows = csv::Reader::from_path(out.join("frames.csv")).unwrap();
        let frames = rows.deserialize().map(|row| row.map(|row: (i32, bool, f64, f64, usize)| row.0));
        (frames.collect::<Result<Vec<i32>, _>>().unwrap(), out)
    };
    assert_eq!(render("hall.{frame:04}.xml", "1-3x2", "steps").0, [1, 3]);
    let (list, out) = render("hall.####.xml", "3,1", "hashes");
    assert_eq!(list, [1, 3]);
    assert!(out.join("0003/image.exr").exists());
    assert_eq!(render("hall.%04d.xml", "-2--1", "before").0, [-2, -1]);
    assert_eq!(render("hall.$F4.xml", "-2", "houdini").0, [-2]);
    // Frames that are rendered alone have the samples that they have among others
    let (_, steps) = render("hall.{frame:04}.xml", "3", "alone");
    assert_eq!(picture(&steps, 3), picture(&folder.path().join("steps"), 3));

    // One file that holds all frames
    let xml = fs::read_to_string(folder.path().join("hall.0001.xml")).unwrap();
    let lamp = xml.split("name=\"radiance\" value=\"").nth(1).unwrap().split('"').next().unwrap().to_owned();
    fs::write(folder.path().join("all.xml"), xml.replacen(&lamp, "$t", 1)).unwrap();
    let (scene, out) = (folder.path().join("all.xml"), folder.path().join("all"));
    let args =
        ["render", "--config", text(&shot), "--frames", "1-2", text(&scene), "--out", text(&out), "--quiet"];
    succeed(&[&args[..], &["--exposure", "1", "--define", "t={frame}"]].concat());
    let mean = |frame| read_exr(&out.join(format!("{frame:04}/image.exr")));
    assert!((mean(2) / mean(1) - 2.0).abs() < 0.1, "{} {}", mean(1), mean(2));
    fail(&args, &["does not say where the number of the frame stands", "--define", ".blend"]);
    for wrong in ["1-", "1-9x0", "--fps", "a"] {
        fail(&["render", "--frames", wrong, text(&scene)], &["such as 1-240, 1-100x5, 1,5,9 or -3--1"]);
    }
}

/// Mean radiance of a picture.
fn read_exr(path: &Path) -> f32 {
    let image = noisefloor_image::read_exr(path).unwrap();
    image.pixels.iter().flatten().sum::<f32>() / (3 * image.pixels.len()) as f32
}
