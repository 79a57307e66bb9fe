use crate::kit::{command, grey_exr, text, tiny};
use std::fs::File;
use std::path::Path;
use tempfile::{TempDir, tempdir};

/// Commands that write results to standard output.
struct Talkers {
    folder: TempDir,
}

impl Talkers {
    fn new() -> Self {
        let folder = tempdir().unwrap();
        grey_exr(&folder.path().join("a.exr"), (32, 32), 1, 0.4);
        grey_exr(&folder.path().join("b.exr"), (32, 32), 2, 0.4);
        Self { folder }
    }

    fn path(&self, name: &str) -> String {
        text(&self.folder.path().join(name)).to_owned()
    }

    fn all(&self) -> Vec<Vec<String>> {
        let owned = |args: &[&str]| -> Vec<String> { args.iter().map(|&a| a.to_owned()).collect() };
        let [a, b, out] = ["a.exr", "b.exr", "out"].map(|name| self.path(name));
        let judge =
            ["judge", &a, "--spp", "9", "--against", &b, "--spp", "9", "--tile", "32", "--independent"];
        // Not quiet: its summary goes to standard output
        let render: Vec<&str> =
            tiny(&out, &["--criterion", "spp:4"]).into_iter().filter(|a| *a != "--quiet").collect();
        let mut all = vec![
            owned(&["scenes"]),
            owned(&["inspect"]),
            owned(&["inspect", "--json"]),
            owned(&judge),
            owned(&[&judge[..], &["--json"]].concat()),
            owned(&render),
            owned(&["--help"]),
            owned(&["render", "--help"]),
            owned(&["--version"]),
        ];
        let reference = self.path("reference.exr");
        let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/cornell-box.xml");
        all.push(owned(&["reference", "cornell-box", "--size", "16x16", "--out", &reference]));
        all.push(owned(&["scenes", "check", scene]));
        all.push(owned(&["doctor"]));
        let table = self.path("pairs.csv");
        std::fs::write(&table, "observers,audience\n1,2\n2,4\n3,6\n").unwrap();
        all.push(owned(&["audience", "fit", &table]));
        all.push(owned(&["audience", "fit", &table, "--json"]));
        let small = ["compare", "bulb", "--size", "32x32", "--tile", "32", "--criteria", "spp:4"];
        let few = ["--max-spp", "100", "--reference-spp", "4", "--out"];
        all.push(owned(&[&small[..], &few, &[self.path("compared").as_str()]].concat()));
        let stack = self.path("stack");
        let small = ["study", "stack", "bulb", "--size", "64x64", "--levels", "1,2", "--out", &stack];
        all.push(owned(&small));
        all
    }
}

/// Runs with that as standard output: exit code, and what standard error says.
fn run_into(args: &[String], stdout: impl Into<std::process::Stdio>, cache: &Path) -> (Option<i32>, String) {
    let output = command(args).stdout(stdout).env("XDG_CACHE_HOME", cache).output().unwrap();
    (output.status.code(), String::from_utf8(output.stderr).unwrap())
}

/// `noisefloor scenes > /dev/full`: an error in one line, never a panic.
#[test]
fn a_full_disk_is_an_error() {
    let talkers = Talkers::new();
    for args in talkers.all() {
        let (code, said) = run_into(&args, File::create("/dev/full").unwrap(), talkers.folder.path());
        assert_eq!(code, Some(1), "{args:?}: {said}");
        let line = said.lines().last().unwrap_or_default();
        assert!(line.starts_with("error: standard output cannot be written to"), "{args:?}: {said}");
        assert!(!said.contains("panicked"), "{args:?}: {said}");
    }
}

/// `noisefloor scenes | head -1`: nobody reads on, and nothing is wrong.
#[test]
fn a_reader_who_has_had_enough_is_no_fault() {
    let talkers = Talkers::new();
    for args in talkers.all() {
        let (reader, writer) = std::io::pipe().unwrap();
        drop(reader);
        let (code, said) = run_into(&args, writer, talkers.folder.path());
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
