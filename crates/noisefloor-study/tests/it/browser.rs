use crate::kit::{Running, levels, stack};
use noisefloor_study::analysis::{Options, analyse};
use noisefloor_study::{Study, store};
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use tempfile::TempDir;

/// Levels of the stacks that the browser is shown.
const LEVELS: usize = 8;

fn study(protocol: &str, extra: &str) -> (TempDir, Arc<Study>) {
    let dir = tempfile::tempdir().unwrap();
    // A forced choice takes two seconds: few tiles
    let size = if protocol == "forced-choice" { (256, 128) } else { (384, 256) };
    stack(&dir.path().join("wall"), size, &levels(LEVELS, 2.0));
    let mut text = format!(
        "protocol = \"{protocol}\"\ndatabase = \"answers.sqlite\"\ntile = 128\ntrials = 1\ninterval-ms = 60\n{extra}\n"
    );
    for (code, title, consent) in [
        ("en", "Noise in rendered pictures", "You take part of your own will, and may stop at any time."),
        (
            "fr",
            "Le bruit des images de synthèse",
            "Vous participez de votre plein gré et pouvez arrêter à tout moment.",
        ),
    ] {
        text += &format!("[text.{code}]\ntitle = \"{title}\"\nconsent = \"{consent}\"\n");
    }
    text += "[[stack]]\nname = \"wall\"\nfolder = \"wall\"\n";
    if protocol == "validation" {
        text += "stops = \"stops.csv\"\n";
        let rows: String = (0..6).map(|tile| format!("{tile},300\n")).collect();
        std::fs::write(dir.path().join("stops.csv"), format!("tile,spp\n{rows}")).unwrap();
    }
    std::fs::write(dir.path().join("study.toml"), text).unwrap();
    let study = Arc::new(Study::open(dir.path().join("study.toml")).unwrap());
    (dir, study)
}

/// What the pages need to be tested; `None`, said aloud, where it is missing. With NOISEFLOOR_REQUIRE_BROWSER=1 that is a failure.
fn browser() -> Option<()> {
    let there =
        |program: &str| Command::new(program).arg("--version").output().is_ok_and(|o| o.status.success());
    let modules = Path::new(env!("CARGO_MANIFEST_DIR")).join("browser/node_modules/playwright-core");
    let missing: Vec<&str> = [
        (there("node"), "node"),
        (Path::new("/usr/bin/chromium").exists(), "/usr/bin/chromium (apt-get install chromium)"),
        (modules.exists(), "playwright-core (npm ci --ignore-scripts in crates/noisefloor-study/browser)"),
    ]
    .into_iter()
    .filter(|(there, _)| !there)
    .map(|(_, name)| name)
    .collect();
    if missing.is_empty() {
        return Some(());
    }
    assert!(std::env::var_os("NOISEFLOOR_REQUIRE_BROWSER").is_none(), "no browser to test with: {missing:?}");
    println!("\n*** SKIPPED: the study's pages are NOT tested, since these are missing: {missing:?} ***\n");
    None
}

/// Whole sessions by mouse and by keyboard alone, in two sizes and languages: browser/test.mjs. Simulated observers look at the real pages; what
/// they clicked is what the analysis finds.
#[test]
fn observers_use_the_pages_in_a_browser() {
    if browser().is_none() {
        return;
    }
    let studies = [
        ("ACQUISITION", study("acquisition", "repeats = 1\ngroups = [\"painters\", \"programmers\"]")),
        ("VALIDATION", study("validation", "")),
        ("FORCED", study("forced-choice", "")),
    ];
    let servers: Vec<Running> = studies.iter().map(|(_, (_, study))| Running::start(study.clone())).collect();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("browser");
    let mut node = Command::new("node");
    node.args(["--test", "--test-reporter=spec", "test.mjs"]).current_dir(folder);
    for ((name, _), server) in studies.iter().zip(&servers) {
        node.env(name, &server.url);
    }
    let output = node.output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    println!("{said}{}", String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "the browser's tests failed; what they said is above");

    // What was clicked: two observers left the six tiles at levels 1 to 6 (by mouse) and at 2 (by keyboard).
    let study = &studies[0].1.1;
    let report = analyse(study, Options { keep_outliers: true, seed: 1, simulated: false }).unwrap();
    let finished: Vec<_> = report.observers.iter().filter(|o| o.finished).collect();
    assert_eq!(finished.len(), 2, "{:?}", report.observers);
    let records = store::read_all(&study.database, &study.design()).unwrap();
    let replayed = noisefloor_study::analysis::observers::replay_all(study, &records).unwrap();
    let mut stops: Vec<Vec<u32>> = replayed
        .iter()
        .filter(|o| o.finished)
        .map(|o| (0..6).map(|t| o.stops[&(0, t)][0]).collect())
        .collect();
    stops.sort();
    assert_eq!(stops, [vec![1, 2, 3, 4, 5, 6], vec![2; 6]]);
    let conditions = replayed[0].conditions.unwrap();
    assert!((conditions.pixels_per_mm - 324.0 / 85.6).abs() < 1e-9 && conditions.distance_mm == 600.0);
}
