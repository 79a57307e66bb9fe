use crate::kit::{command, fail, succeed, text, wait_for, words};
use noisefloor_image::{read_exr, read_picture};
use noisefloor_testkit::HANG;
use std::process::Stdio;
use std::time::{Duration, Instant};
use tempfile::tempdir;

#[test]
fn a_reference_is_written_the_same_whatever_the_threads() {
    let folder = tempdir().unwrap();
    let written = |name: &str, threads: &str| {
        let out = folder.path().join(name);
        let args = ["reference", "cornell-box", "--size", "40x24", "--threads", threads, "--out", text(&out)];
        let said = succeed(&args);
        assert!(said.contains("the reference took") && said.contains(text(&out)), "{said}");
        assert_eq!(read_picture(out.with_extension("png")).unwrap().size(), (40, 24));
        read_exr(out).unwrap()
    };
    let one = written("one.exr", "1");
    assert_eq!((one.width, one.height), (40, 24));
    // The lamp is seen, and what it lights
    assert!(one.pixels.iter().any(|pixel| pixel[0] > 1.0));
    assert!(one.pixels.iter().filter(|pixel| pixel[0] > 0.01).count() > 40 * 24 / 4);
    assert_eq!(one.pixels, written("two.exr", "2").pixels);
}

#[test]
fn what_has_none_is_refused() {
    let folder = tempdir().unwrap();
    let (out, png) = (folder.path().join("reference.exr"), folder.path().join("reference.png"));
    fail(&["reference", "cornell-box", "--out", text(&png)], &["reference.png", ".exr"]);
    fail(&["reference", "no-such-scene", "--out", text(&out)], &["no built-in scene"]);
    let away = folder.path().join("away/reference.exr");
    fail(&["reference", "cornell-box", "--out", text(&away)], &["away"]);

    let stack = folder.path().join("stack");
    std::fs::create_dir(&stack).unwrap();
    succeed(&words(&format!(
        "reference cornell-box --size 16x16 --quiet --out {}",
        text(&stack.join("00100.exr"))
    )));
    std::fs::remove_file(stack.join("00100.png")).unwrap();
    fail(&["reference", text(&stack), "--source", "exr", "--out", text(&out)], &["has no quick reference"]);
    assert!(!out.exists());
}

/// References that would take minutes, alone and before a render: Ctrl-C ends them at once, nothing half
/// done is left, and the render writes what it has.
#[test]
#[cfg(target_os = "linux")]
fn an_interrupt_gives_it_up() {
    let folder = tempdir().unwrap();
    let model = concat!(env!("CARGO_MANIFEST_DIR"), "/../noisefloor/models/human-reference.nfm");
    let (alone, out) = (folder.path().join("alone.exr"), folder.path().join("render"));
    let hard = ["door-ajar", "--size", "512x512", "--threads", "1", "--quiet"];
    for (command_of, rest) in [("reference", vec![]), ("render", vec!["--model", model])] {
        let to = if command_of == "reference" { &alone } else { &out };
        let args = [&[command_of], &hard[..], &rest, &["--out", text(to)]].concat();
        let child = command(&args).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let id = child.id().to_string();

        // Once it catches SIGINT, bit 1 of the mask
        let status = format!("/proc/{id}/status");
        let begun = Instant::now();
        let catches = || {
            let text = std::fs::read_to_string(&status).unwrap();
            let mask = text.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap();
            u64::from_str_radix(mask.trim(), 16).unwrap() & 2 != 0
        };
        wait_for("its handler", || catches().then_some(()));
        std::thread::sleep(Duration::from_millis(200));
        assert!(std::process::Command::new("kill").args(["-INT", &id]).status().unwrap().success());
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(130), "{said}");
        assert!(said.contains("the reference was cancelled"), "{said}");
        assert!(begun.elapsed() < HANG);
    }
    assert!(!alone.exists() && !alone.with_extension("png").exists());
    assert!(out.join("report.json").exists());
}
