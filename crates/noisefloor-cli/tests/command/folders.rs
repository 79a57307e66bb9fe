use crate::kit::{command, fail, json, run, stderr, succeed, text, tiny, wait_for};
use std::path::Path;
use std::process::Stdio;
use tempfile::{TempDir, tempdir};

/// Refused as what was typed wrong is, with one line.
fn refuse(args: &[&str], words: &[&str]) {
    let output = run(args);
    let said = stderr(&output);
    assert_eq!((output.status.code(), said.lines().count()), (Some(2), 1), "{args:?}: {said}");
    assert!(words.iter().all(|word| said.contains(word)), "{args:?}: {said}");
}

const PICTURE: &str = "image.exr";

#[test]
fn a_render_is_overwritten_only_on_request() {
    let folder = tempdir().unwrap();
    let out = text(folder.path());
    let picture = || std::fs::read(folder.path().join(PICTURE)).unwrap();
    let fixed = |more: &[&'static str]| tiny(out, &[&["--criterion", "spp:4"], more].concat());
    succeed(&fixed(&[]));
    let first = picture();
    refuse(&fixed(&["--seed", "2"]), &["holds a render", "--force", "--out"]);
    refuse(&fixed(&["--resume"]), &["finished", "--force"]);
    fail(&fixed(&["--resume", "--force"]), &["--resume", "--force"]);
    assert!(picture() == first);
    succeed(&fixed(&["--seed", "2", "--force"]));
    assert!(picture() != first);

    // One that has just begun, and a picture of somebody else's
    succeed(&tiny(out, &["--time", "0.000001", "--force"]));
    refuse(&tiny(out, &[]), &["not finished", "--resume", "--force"]);
    let other = tempdir().unwrap();
    std::fs::write(other.path().join(PICTURE), "a photograph").unwrap();
    refuse(&tiny(text(other.path()), &[]), &["holds a render"]);
}

#[test]
fn other_results_are_overwritten_only_on_request() {
    let folder = tempdir().unwrap();
    let reference = folder.path().join("reference.exr");
    let args = ["reference", "cornell-box", "--size", "16x16", "--quiet", "--out", text(&reference)];
    succeed(&args);
    refuse(&args, &["reference.exr", "--force"]);
    succeed(&[&args[..], &["--force"]].concat());

    let stack = folder.path().join("stack");
    let args = ["study", "stack", "bulb", "--size", "64x64", "--levels", "1,2", "--out", text(&stack)];
    succeed(&args);
    refuse(&args, &["holds a stack", "--out"]);
}

/// Whoever asks for more of a finished render goes on with its samples.
#[test]
fn a_finished_render_goes_on_if_more_is_asked_for() {
    let folder = tempdir().unwrap();
    let out = text(folder.path());
    let samples = || json(&folder.path().join("report.json"))["samples"].as_u64().unwrap();
    let complete = || json(&folder.path().join("report.json"))["complete"] == true;
    let render = |most: &'static str, more: &[&'static str]| {
        let job = ["render", "plates", "--size", "64x64", "--tile", "64", "--quiet", "--max-spp", most];
        [&job[..], &["--out", out], more].concat()
    };
    succeed(&render("24", &[]));
    assert!(complete() && samples() == 24 * 64 * 64);
    refuse(&render("24", &["--resume"]), &["finished", "--max-spp", "--force"]);
    assert!(complete() && samples() == 24 * 64 * 64);
    // Of a part that was cut short, too
    run(&render("64", &["--resume", "--time", "0.000001"]));
    assert!(samples() > 24 * 64 * 64, "however short a run is, the next begins later");
    succeed(&render("64", &["--resume"]));
    assert!(complete() && samples() == 64 * 64 * 64, "{}", samples());
    assert!(!folder.path().join("checkpoint.nfc").exists());
    succeed(&render("16", &["--force"]));
    assert_eq!(samples(), 16 * 64 * 64);
    succeed(&render("32", &["--resume"]));
    assert_eq!(samples(), 32 * 64 * 64);

    let count = ["render", "bulb", "--size", "16x16", "--quiet", "--out", out];
    succeed(&[&count[..], &["--force", "--criterion", "spp:8"]].concat());
    succeed(&[&count[..], &["--resume", "--criterion", "spp:20"]].concat());
    assert!(complete() && samples() == 20 * 16 * 16, "{}", samples());
}

/// Two renders in one folder at once: the second does not begin, and the first is not disturbed. A lock ends
/// with its process, however that ends.
#[test]
fn one_folder_takes_one_render_at_a_time() {
    let folder = tempdir().unwrap();
    let out = text(folder.path());
    let long = tiny(out, &["--criterion", "spp:100000", "--autosave", "0.1"]);
    // The largest number of samples was given twice, the last time by the criterion
    let long: Vec<&str> = long.into_iter().filter(|arg| !["--max-spp", "200"].contains(arg)).collect();
    let mut first = command(&long).stdout(Stdio::null()).spawn().unwrap();
    wait_for("the first save", || folder.path().join("report.json").exists().then_some(()));
    for more in [&["--force"], &["--resume"]] {
        fail(&tiny(out, more), &["another noisefloor is writing into this folder"]);
    }
    assert!(first.try_wait().unwrap().is_none());
    first.kill().unwrap();
    first.wait().unwrap();
    succeed(&tiny(out, &["--force"]));
}

/// A scene of two files, in a folder.
fn scene() -> (TempDir, std::path::PathBuf) {
    let folder = tempdir().unwrap();
    let box_ = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/cornell-box.xml");
    std::fs::copy(box_, folder.path().join("rest.xml")).unwrap();
    let scene = folder.path().join("hall.xml");
    std::fs::write(&scene, "<scene version=\"3.0.0\"><include filename=\"rest.xml\"/></scene>").unwrap();
    (folder, scene)
}

/// An edit that changes no picture is one, too: nobody knows.
fn edit(folder: &Path) {
    let path = folder.join("rest.xml");
    let text = std::fs::read_to_string(&path).unwrap();
    std::fs::write(path, text + "<!-- darker -->").unwrap();
}

#[test]
fn a_scene_that_was_edited_is_not_resumed() {
    let (folder, scene) = scene();
    let out = folder.path().join("out");
    let job = ["render", text(&scene), "--size", "64x64", "--tile", "32", "--quiet", "--out", text(&out)];
    let render = |more: &[&'static str]| [&job[..], more].concat();
    succeed(&render(&["--time", "0.000001"]));
    let resume = render(&["--resume", "--time", "0.000001"]);
    succeed(&resume);
    fail(&render(&["--resume", "-D", "level=2"]), &["belongs to another job", "level"]);
    edit(folder.path());
    fail(&resume, &["checkpoint.nfc", "`rest.xml` has changed", "--force"]);
}

#[test]
fn a_reference_of_a_scene_that_was_edited_is_not_used() {
    let (folder, scene) = scene();
    let out = folder.path().join("compared");
    let args = ["compare", text(&scene), "--size", "32x32", "--tile", "32", "--criteria", "spp:4", "--quiet"];
    let few = ["--max-spp", "100", "--reference-spp", "64", "--out", text(&out)];
    let args = [&args[..], &few].concat();
    let force = [&args[..], &["--force"]].concat();
    succeed(&args);
    refuse(&args, &["holds a comparison", "--force"]);
    let picture = out.join("hall/reference.exr");
    let made = || std::fs::metadata(&picture).unwrap().modified().unwrap();
    let first = made();
    succeed(&force);
    assert_eq!(made(), first, "the reference was rendered again");

    edit(folder.path());
    std::fs::remove_file(out.join("index.html")).unwrap();
    fail(&args, &["reference.exr", "`rest.xml` has changed", "--force"]);
    assert_eq!(made(), first);
    succeed(&force);
    assert_ne!(made(), first);
    // A picture that is not the one that was written
    std::fs::write(&picture, "cut").unwrap();
    std::fs::remove_file(out.join("index.html")).unwrap();
    fail(&args, &["reference.exr", "is not the picture"]);
}
