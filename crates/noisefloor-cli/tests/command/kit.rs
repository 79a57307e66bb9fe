use noisefloor_image::{RenderLayers, write_exr};
use noisefloor_testkit::{HANG, Noise};
use serde_json::Value;
use std::fmt::Debug;
use std::path::Path;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

/// Commands of `noisefloor-lab`; all others are those of `noisefloor`.
pub(crate) const LAB: [&str; 7] =
    ["train", "evaluate", "audience", "compare", "reproduce", "study", "explore"];
pub(crate) fn command<S: AsRef<str>>(args: &[S]) -> Command {
    let lab = args.first().is_some_and(|command| LAB.contains(&command.as_ref()));
    let program = if lab { env!("CARGO_BIN_EXE_noisefloor-lab") } else { env!("CARGO_BIN_EXE_noisefloor") };
    let mut command = Command::new(program);
    command.args(args.iter().map(AsRef::as_ref));
    // Whoever runs the tests may have calibrated their eyes
    command.env("XDG_CONFIG_HOME", "/nowhere").env("APPDATA", "/nowhere");
    command
}

/// The words of a line without quotes.
pub(crate) fn words(line: &str) -> Vec<&str> {
    line.split(' ').collect()
}

pub(crate) fn run<S: AsRef<str>>(args: &[S]) -> Output {
    command(args).output().unwrap()
}

/// Waits until something is so.
pub(crate) fn wait_for<T>(what: &str, mut found: impl FnMut() -> Option<T>) -> T {
    let began = Instant::now();
    loop {
        if let Some(found) = found() {
            return found;
        }
        assert!(began.elapsed() < HANG, "{what} did not happen");
        std::thread::sleep(Duration::from_millis(5));
    }
}

pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

/// Runs what must succeed; its standard output.
pub(crate) fn succeed<S: AsRef<str> + Debug>(args: &[S]) -> String {
    let output = run(args);
    assert!(output.status.success(), "{args:?}: {}\n{}", output.status, stderr(&output));
    String::from_utf8(output.stdout).unwrap()
}

/// Runs what must fail with exit code 1 and one line that has all of `words` in it. What clap refuses has
/// exit code 2, and may say more.
pub(crate) fn fail<S: AsRef<str> + Debug>(args: &[S], words: &[&str]) {
    let output = run(args);
    let said = stderr(&output);
    assert!(!said.contains("panicked"), "{args:?} panicked:\n{said}");
    assert!(said.starts_with("error: "), "{args:?}: {said:?}");
    match output.status.code() {
        Some(1) => {
            assert!(said.ends_with('\n') && said.lines().count() == 1, "{args:?}, in one line:\n{said}")
        }
        Some(2) => {}
        code => panic!("{args:?}: exit code {code:?}\n{said}"),
    }
    for word in words {
        assert!(said.contains(word), "{args:?}: {word:?} is not in {said:?}");
    }
}

/// A render of 64×64 pixels in four tiles, in about half a second.
pub(crate) fn tiny<'a>(out: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let small = ["render", "--size", "64x64", "--tile", "32", "--max-spp", "200", "--quiet", "--out", out];
    small.iter().chain(more).copied().collect()
}

/// What every render writes; the oracle adds noise.png.
pub(crate) const FILES: [&str; 6] =
    ["image.exr", "image.png", "stops.csv", "stops.png", "timeline.csv", "report.json"];

pub(crate) fn text(path: &Path) -> &str {
    path.to_str().unwrap()
}

pub(crate) fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// Header and rows.
pub(crate) fn table(path: &Path) -> (Vec<String>, Vec<Vec<String>>) {
    let mut reader = csv::Reader::from_path(path).unwrap();
    let fields = |record: &csv::StringRecord| record.iter().map(str::to_owned).collect::<Vec<_>>();
    let header = fields(reader.headers().unwrap());
    (header, reader.records().map(|r| fields(&r.unwrap())).collect())
}

/// One column of a table.
pub(crate) fn column(path: &Path, name: &str) -> Vec<String> {
    let (header, rows) = table(path);
    let at = header.iter().position(|h| h == name).unwrap_or_else(|| panic!("{name} is not in {header:?}"));
    rows.into_iter().map(|mut row| row.swap_remove(at)).collect()
}

/// A channel of an EXR.
pub(crate) fn channel(path: &Path, name: &str) -> Vec<f32> {
    let layers = exr::prelude::read_all_flat_layers_from_file(path).unwrap();
    let channels = &layers.layer_data[0].channel_data.list;
    channels.iter().find(|c| c.name.to_string() == name).unwrap().sample_data.values_as_f32().collect()
}

/// What is said as JSON.
pub(crate) fn said_json(args: &[&str]) -> Value {
    serde_json::from_str(&succeed(args)).unwrap()
}

/// An EXR of noise around grey, drawn from (seed, pixel); pixel 0 is `first`.
pub(crate) fn grey_exr(path: &Path, (width, height): (usize, usize), seed: u64, first: f32) {
    let mut noise = Noise::new(seed);
    let mut rgb: Vec<[f32; 3]> =
        (0..width * height).map(|_| [0.4 + 0.1 * noise.normal() as f32; 3]).collect();
    rgb[0] = [first; 3];
    write_exr(path, &RenderLayers::rgb(width, height, &rgb)).unwrap();
}
