use crate::kit::{FILES, command, fail, json, stderr, succeed, table, text, wait_for, words};
use crate::learn::Corpora;
use noisefloor_image::{read_exr, read_picture};
use std::fs::File;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::Duration;
use tempfile::tempdir;

/// A render that would take days.
fn long(out: &Path, autosave: &str, stderr: Stdio) -> Child {
    let args = ["render", "--size", "64x64", "--tile", "32", "--criterion", "spp:1000000000", "--quiet"];
    let mut command = command(&args);
    command.args(["--threads", "1", "--autosave", autosave, "--out"]).arg(out);
    command.stdout(Stdio::null()).stderr(stderr).spawn().unwrap()
}

fn signal(child: &Child, name: &str) {
    assert!(Command::new("kill").args([name, &child.id().to_string()]).status().unwrap().success());
}

fn end(mut child: Child) -> ExitStatus {
    wait_for("the end", || child.try_wait().unwrap())
}

/// Every file can be read from beginning to end.
fn assert_whole(out: &Path) {
    assert!(FILES.iter().all(|name| out.join(name).is_file()));
    assert_eq!(read_exr(out.join("image.exr")).unwrap().pixels.len(), 64 * 64);
    read_picture(out.join("image.png")).unwrap();
    read_picture(out.join("stops.png")).unwrap();
    assert_eq!(table(&out.join("stops.csv")).1.len(), 4);
    table(&out.join("timeline.csv"));
    assert_eq!(json(&out.join("report.json"))["tiles"], 4);
}

#[test]
fn an_interrupt_ends_with_what_is_there_written() {
    let folder = tempdir().unwrap();
    let out = folder.path();
    for name in ["-INT", "-TERM"] {
        let child = long(out, "0.5", Stdio::null());
        // The handler is set before the first batch
        wait_for("the first save", || out.join("report.json").exists().then_some(()));
        std::thread::sleep(Duration::from_millis(200));
        signal(&child, name);
        assert_eq!(end(child).code(), Some(130), "{name}");
        assert_whole(out);
        assert!(table(&out.join("stops.csv")).1.iter().all(|row| row[7] == "cancelled" && row[5] != "0"));
        assert_eq!(json(&out.join("report.json"))["complete"], false);
        std::fs::remove_dir_all(out).unwrap();
    }
    std::fs::create_dir(out).unwrap();
}

#[test]
fn what_was_saved_survives_a_kill() {
    let folder = tempdir().unwrap();
    let out = folder.path();
    let child = long(out, "0.2", Stdio::null());
    // The report is written last. Then let it save a few times more, and die wherever it is
    wait_for("the first save", || out.join("report.json").exists().then_some(()));
    std::thread::sleep(Duration::from_millis(555));
    signal(&child, "-KILL");
    assert_eq!(end(child).code(), None);
    assert_whole(out);
    let report = json(&out.join("report.json"));
    assert_eq!(report["complete"], false);
    assert!(table(&out.join("stops.csv")).1.iter().all(|row| row[7] == "open"));

    // And the next run overwrites it only if it is told to
    let small = "render --size 64x64 --tile 32 --criterion spp:100 --quiet --force --out";
    succeed(&[words(small), vec![text(out)]].concat());
    assert_whole(out);
    assert_eq!(json(&out.join("report.json"))["complete"], true);
}

/// The disk may have room again: rendering goes on, and says what it could not save, to a log file too.
#[test]
fn a_save_that_fails_is_told() {
    let folder = tempdir().unwrap();
    let (out, away) = (folder.path().join("out"), folder.path().join("away"));
    let log = folder.path().join("stderr");
    let child = long(&out, "0.2", File::create(&log).unwrap().into());
    wait_for("the first save", || out.join("report.json").exists().then_some(()));
    std::fs::rename(&out, &away).unwrap();
    let told = || std::fs::read_to_string(&log).unwrap().contains("warning: not saved").then_some(());
    wait_for("the warning", told);
    std::fs::rename(&away, &out).unwrap();
    signal(&child, "-INT");
    assert_eq!(end(child).code(), Some(130));
    assert_whole(&out);
}

/// Sixteen results, of which the first is there: it is whole, and no report claims to have all.
#[test]
fn what_is_reproduced_so_far_survives_an_interrupt() {
    let (corpora, folder) = (Corpora::new(), tempdir().unwrap());
    let out = folder.path();
    let [means, batches] = &corpora.paths;
    let args = ["reproduce", "--edge", "64", "--levels", "60", "--corpus", text(means), text(batches)];
    let child = command(&args).args(["--out", text(out)]).stderr(Stdio::null()).spawn().unwrap();
    let first = out.join("luminance-pair-display-learned.json");
    wait_for("the first result", || first.exists().then_some(()));
    signal(&child, "-INT");
    assert_eq!(end(child).code(), Some(130));
    assert_eq!(json(&first)["machines"][0]["examples"], 720);
    assert!(!out.join("reproduce.json").exists());
}

/// A render of a few seconds, of which each call of the renderer is a small part.
fn short<'a>(out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let args = ["render", "--size", "64x64", "--tile", "32", "--criterion", "spp:1500", "--threads", "1"];
    [&args[..], &["--quiet", "--autosave", "0.1", "--out", out], more].concat()
}

#[test]
fn a_checkpoint_of_another_render_is_refused() {
    let folder = tempdir().unwrap();
    let out = text(folder.path());
    succeed(&short(out, &["--time", "0.01"]));
    let refused = |more: &[&str], says: &str| fail(&short(out, more), &[says]);
    refused(&["--resume", "--seed", "2"], "belongs to another job");
    refused(&["--resume", "--batch", "50"], "its schedule is spaced by");
    refused(&["--resume", "--audience", "2,0"], "its audience is one of 1 times the samples");
    let rival = ["render", "--size", "64x64", "--resume", "--out", out, "--criterion", "cycles:0.01"];
    fail(&rival, &["leave it out"]);
    let source = [
        "render",
        "--source",
        "command: render {seed} {spp} {out}",
        "--size",
        "64x64",
        "--out",
        out,
        "--resume",
    ];
    fail(&source, &["cannot be resumed", "leave it out"]);
    let file = folder.path().join("checkpoint.nfc");
    let bytes = std::fs::read(&file).unwrap();
    std::fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
    refused(&["--resume"], "remove it to begin anew");
    std::fs::remove_file(&file).unwrap();
    refused(&["--resume"], "--force");
    succeed(&short(out, &["--force", "--time", "0.01"]));
}

/// Two scenes, of which the second would take minutes: the page says that it has one.
#[test]
fn the_page_of_an_interrupted_comparison_says_so() {
    let folder = tempdir().unwrap();
    let out = folder.path();
    let args = ["compare", "bulb", "cornell-box", "--size", "32x32", "--tile", "32", "--criteria", "spp:4"];
    let args = [&args[..], &["--max-spp", "100", "--reference-spp", "1000", "--out"]].concat();
    let child = command(&args).arg(out).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
    let page = || std::fs::read_to_string(out.join("index.html")).ok();
    let first = wait_for("the first scene", page);
    signal(&child, "-INT");
    let code = end(child).code();
    assert!(first.contains("<b>Not finished:</b> 1 of 2 scenes"), "{first:.2000}");
    // A fast machine may have finished
    let done = !page().unwrap().contains("Not finished");
    assert_eq!(code, Some(if done { 0 } else { 130 }));
}

/// Another build may take other samples: what one has begun, the other does not resume.
#[test]
#[cfg(target_os = "linux")]
fn a_checkpoint_of_another_build_is_refused() {
    use std::os::unix::fs::PermissionsExt;
    let folder = tempdir().unwrap();
    let (out, other) = (folder.path().join("out"), folder.path().join("noisefloor"));
    succeed(&short(text(&out), &["--time", "0.01"]));
    // What follows the end of an executable does not change what it does
    let program = std::fs::read(env!("CARGO_BIN_EXE_noisefloor")).unwrap();
    std::fs::write(&other, [&program[..], b"."].concat()).unwrap();
    std::fs::set_permissions(&other, std::fs::Permissions::from_mode(0o755)).unwrap();
    let mut resume = std::process::Command::new(&other);
    resume.args(short(text(&out), &["--resume"])).env("XDG_CONFIG_HOME", "/nowhere");
    // A child that another test has forked meanwhile holds the file open for writing until it is a program of its own
    let run = || match resume.output() {
        Err(error) if error.kind() == std::io::ErrorKind::ExecutableFileBusy => None,
        said => Some(said.unwrap()),
    };
    let said = wait_for("the copy", run);
    assert_eq!(said.status.code(), Some(1));
    assert!(stderr(&said).contains("`the build of this program` has changed"), "{}", stderr(&said));
}
