use crate::kit::{command, grey_exr, text};
use std::fs::File;
use std::path::Path;
use tempfile::{TempDir, tempdir};

/// A folder, and commands that write results to standard output; `@` is the folder.
fn talkers() -> (TempDir, Vec<Vec<String>>) {
    let folder = tempdir().unwrap();
    grey_exr(&folder.path().join("a.exr"), (32, 32), 1, 0.4);
    grey_exr(&folder.path().join("b.exr"), (32, 32), 2, 0.4);
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/cornell-box.xml");
    std::fs::copy(scene, folder.path().join("box.xml")).unwrap();
    std::fs::write(folder.path().join("pairs.csv"), "observers,audience\n1,2\n2,4\n3,6\n").unwrap();
    let judge = "judge @/a.exr --spp 9 --against @/b.exr --spp 9 --tile 32 --independent";
    let compare =
        "compare bulb --size 32x32 --tile 32 --criteria spp:4 --max-spp 100 --reference-spp 4 --out";
    let lines = [
        "scenes",
        "inspect",
        "inspect --json",
        judge,
        &format!("{judge} --json"),
        "render --size 64x64 --tile 32 --criterion spp:4 --out @/out",
        "--help",
        "render --help",
        "--version",
        "reference cornell-box --size 16x16 --out @/reference.exr",
        "scenes check @/box.xml",
        "doctor",
        "audience fit @/pairs.csv",
        "audience fit @/pairs.csv --json",
        &format!("{compare} @/compared"),
        "study stack bulb --size 64x64 --levels 1,2 --out @/stack",
    ];
    let words = |line: &str| line.split(' ').map(|word| word.replace('@', text(folder.path()))).collect();
    let all = lines.into_iter().map(words).collect();
    (folder, all)
}

/// Runs with that as standard output: exit code, and what standard error says.
fn run_into(args: &[String], stdout: impl Into<std::process::Stdio>, cache: &Path) -> (Option<i32>, String) {
    let output = command(args).stdout(stdout).env("XDG_CACHE_HOME", cache).output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

/// `noisefloor scenes > /dev/full`: an error in one line, never a panic.
#[test]
fn a_full_disk_is_an_error() {
    let (folder, talkers) = talkers();
    for args in talkers {
        let (code, said) = run_into(&args, File::create("/dev/full").unwrap(), folder.path());
        assert_eq!(code, Some(1), "{args:?}: {said}");
        let line = said.lines().last().unwrap_or_default();
        assert!(line.starts_with("error: standard output cannot be written to"), "{args:?}: {said}");
        assert!(!said.contains("panicked"), "{args:?}: {said}");
    }
}

/// `noisefloor scenes | head -1`: nobody reads on, and nothing is wrong.
#[test]
fn a_reader_who_has_had_enough_is_no_fault() {
    let (folder, talkers) = talkers();
    for args in talkers {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let (code, said) = run_into(&args, writer, folder.path());
        assert_eq!(code, Some(0), "{args:?}: {said}");
        assert!(!said.contains("error"), "{args:?}: {said}");
    }
}

/// Standard error that cannot be written to changes nothing.
#[test]
fn asides_may_get_lost() {
    let args = ["render", "no-such-scene"];
    let status = command(&args).stderr(File::create("/dev/full").unwrap()).status().unwrap();
    assert_eq!(status.code(), Some(1));
}
