use crate::kit::{FILES, column, command, grey_exr, json, run, stderr, succeed, text, wait_for};
use noisefloor::Checkpoint;
use noisefloor_image::{read_exr, read_picture};
use noisefloor_testkit::Noise;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Duration;
use tempfile::tempdir;

/// A render of about a second in a build for tests, saved ten times a second.
fn arguments<'a>(out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let args = ["render", "--size", "64x64", "--tile", "32", "--criterion", "spp:250", "--threads", "1"];
    [&args[..], &["--quiet", "--autosave", "0.1", "--out", out], more].concat()
}

/// Every file that is there is complete, whenever the power went.
fn assert_each_whole(out: &Path) {
    for name in FILES {
        let path = out.join(name);
        if !path.exists() {
            continue;
        }
        match path.extension().and_then(|e| e.to_str()) {
            Some("json") => drop(json(&path)),
            Some("csv") => assert!(std::fs::read_to_string(&path).unwrap().ends_with('\n'), "{name}"),
            _ => drop(read_picture(&path).unwrap()),
        }
    }
    if let Ok(file) = std::fs::File::open(out.join("checkpoint.nfc")) {
        Checkpoint::read(file).unwrap();
    }
}

fn temporary_files(out: &Path) -> usize {
    let names = std::fs::read_dir(out).unwrap().map(|entry| entry.unwrap().file_name());
    names.filter(|name| name.to_string_lossy().starts_with(".noisefloor-")).count()
}

/// Kills renders (SIGKILL) at random moments and resumes them, until that has happened so many times. No file
/// is ever half written, at most the temporary file of the last kill is left over, and what comes out in the
/// end is what an undisturbed render gives, to the bit.
fn kill_and_resume(kills: usize) {
    let whole = tempdir().unwrap();
    succeed(&arguments(text(whole.path()), &[]));
    let pixels = |out: &Path| read_exr(out.join("image.exr")).unwrap().pixels;
    let stops = |out: &Path| std::fs::read(out.join("stops.csv")).unwrap();
    let mut random = Noise::new(kills as u64);
    let (mut killed, mut finished, mut most_left, mut went_on) = (0, 0, 0, false);
    while killed < kills || finished == 0 {
        let folder = tempdir().unwrap();
        let out = folder.path();
        // Written last
        let is_saved = || out.join("report.json").exists();
        loop {
            let goes_on = is_saved();
            let mut child =
                command(&arguments(text(out), &["--resume"])).stderr(Stdio::null()).spawn().unwrap();
            // The last one to be killed leaves something to go on with
            if killed + 1 == kills {
                let mut is_due = || is_saved() || child.try_wait().unwrap().is_some();
                wait_for("the first save", || is_due().then_some(()));
            }
            let ended = if killed < kills {
                std::thread::sleep(Duration::from_millis(random.below(700) as u64));
                child.try_wait().unwrap()
            } else {
                Some(child.wait().unwrap())
            };
            if let Some(status) = ended {
                assert!(status.success(), "{status}");
                finished += 1;
                assert!(pixels(out) == pixels(whole.path()), "after {killed} kills it is another picture");
                assert_eq!(stops(out), stops(whole.path()));
                let report = json(&out.join("report.json"));
                assert_eq!(report["complete"], true);
                assert!(!goes_on || report["seconds_before"].as_f64() > Some(0.0), "{report}");
                let samples: Vec<u64> =
                    column(&out.join("timeline.csv"), "samples").iter().map(|n| n.parse().unwrap()).collect();
                assert!(samples.is_sorted() && samples.last().copied() == report["samples"].as_u64());
                assert_eq!((temporary_files(out), out.join("checkpoint.nfc").exists()), (0, false));
                went_on |= goes_on;
                break;
            }
            child.kill().unwrap();
            child.wait().unwrap();
            killed += 1;
            most_left = most_left.max(temporary_files(out));
            assert_each_whole(out);
        }
    }
    assert!(went_on, "none had anything to go on with");
    assert!(most_left <= 1, "temporary files pile up: {most_left}");
    println!(
        "{killed} kills, {finished} renders finished, at most {most_left} temporary file left by a kill"
    );
}

#[test]
fn killed_renders_lose_nothing() {
    kill_and_resume(5);
}

/// `cargo test -p noisefloor-cli --test command -- --ignored --nocapture a_hundred`
#[test]
#[ignore = "takes minutes"]
fn a_hundred_killed_renders_lose_nothing() {
    kill_and_resume(100);
}

/// Runs the command under a limit on the length of files, in blocks of 512 bytes. That is what a full disk is
/// like to a program: writes fail half-way.
#[cfg(unix)]
fn run_with_files_of(blocks: u32, args: &[&str]) -> Output {
    // Without the signal, writing beyond the limit is an error
    let limited = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$@\"");
    let program = command(args).get_program().to_owned();
    let mut shell = Command::new("sh");
    shell.args(["-c", &limited, "sh"]).arg(program).args(args).output().unwrap()
}

#[cfg(unix)]
#[test]
fn a_disk_that_is_full_is_an_error_and_spoils_nothing() {
    let folder = tempdir().unwrap();
    let out = folder.path();
    let render = ["render", "--size", "64x64", "--criterion", "spp:8", "--quiet", "--out", text(out)];
    succeed(&render);
    let before = std::fs::read(out.join("image.exr")).unwrap();
    let output = run_with_files_of(16, &[&render[..], &["--seed", "2", "--force"]].concat());
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("not written") && said.contains("check the space on the disk"), "{said}");
    assert!(!said.contains("panicked"), "{said}");
    assert_eq!(std::fs::read(out.join("image.exr")).unwrap(), before);
    assert_eq!(temporary_files(out), 0);
    assert_each_whole(out);
}

/// What each command writes, besides `render`: the arguments before the name of the file or folder, and
/// whether it is a file.
#[cfg(unix)]
fn writers(folder: &Path) -> Vec<(Vec<String>, bool)> {
    let path = |name: &str| text(&folder.join(name)).to_owned();
    let mut writers = Vec::new();
    let mut writer = |args: &str, is_file| {
        let words = args.split(' ').map(|word| match word.strip_prefix('@') {
            Some(name) => path(name),
            None => word.to_owned(),
        });
        writers.push((words.collect(), is_file));
    };
    let judge = "judge @a.exr --spp 9 --against @b.exr --spp 9 --tile 32 --independent";
    for option in ["--heat-map", "--noise-map", "--exr"] {
        writer(&format!("{judge} {option}"), true);
    }
    writer("metrics @a.exr @b.exr --map", true);
    writer("reference bulb --size 16x16 --quiet --force --out", true);
    writer("train --table @table.csv --no-scores --out", true);
    writer("train --table @table.csv --no-scores --out @model.nfm --save-table", true);
    writer("evaluate --table @table.csv --json", true);
    writer("evaluate --table @table.csv --csv", true);
    let small = "compare bulb --size 32x32 --tile 32 --criteria spp:4 --max-spp 100 --reference-spp 4";
    writer(&format!("{small} --quiet --out"), false);
    writer("study stack bulb --size 64x64 --levels 1,2 --out", false);
    writers
}

/// Runs each of [`writers`] into a file or folder of its own, and into one that nobody can write.
#[cfg(target_os = "linux")]
#[test]
fn no_command_spoils_a_file_on_a_full_disk() {
    let folder = tempdir().unwrap();
    let (a, b) = (folder.path().join("a.exr"), folder.path().join("b.exr"));
    grey_exr(&a, (32, 32), 1, 0.4);
    grey_exr(&b, (32, 32), 2, 0.4);
    let table = include_str!("../../../../fixtures/human-table.csv");
    std::fs::write(folder.path().join("table.csv"), table).unwrap();
    for (i, (args, is_file)) in writers(folder.path()).into_iter().enumerate() {
        let target = folder.path().join(format!("target{i}{}", if is_file { ".exr" } else { "" }));
        if is_file {
            std::fs::write(&target, "as it was").unwrap();
        }
        let mut args: Vec<&str> = args.iter().map(String::as_str).collect();
        args.push(text(&target));
        let output = run_with_files_of(0, &args);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{args:?}: {said}");
        let error = said.lines().find(|line| line.starts_with("error: ")).unwrap_or_default();
        assert!(error.contains(&format!("target{i}")), "{args:?}: {said}");
        assert!(!said.contains("panicked"), "{args:?}: {said}");
        if is_file {
            assert_eq!(std::fs::read(&target).unwrap(), b"as it was", "{args:?}");
        }

        // In /proc not even the superuser makes files
        *args.last_mut().unwrap() = "/proc/noisefloor.exr";
        let output = run(&args);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(1), "{args:?}: {said}");
        assert!(said.contains("error: ") && said.contains("/proc/noisefloor.exr"), "{args:?}: {said}");
    }
    assert_eq!(temporary_files(folder.path()), 0);
}

/// Refused before anything is rendered. In /proc not even the superuser makes files.
#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_cannot_be_written_is_refused_at_once() {
    for out in ["/proc/noisefloor", "/proc", "/dev/null/render"] {
        let output = run(&arguments(out, &[]));
        assert_eq!(output.status.code(), Some(1), "{out}");
        let said = stderr(&output);
        assert!(said.starts_with("error: ") && said.lines().count() == 1, "{out}: {said}");
    }
}
