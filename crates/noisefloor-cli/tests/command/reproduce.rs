use crate::kit::{fail, json, run, stderr, succeed, text};
use crate::learn::Corpora;
use serde_json::Value;
use std::path::Path;
use tempfile::tempdir;

/// Two representations, two scalings, four protocols.
const RESULTS: usize = 16;
const PROTOCOLS: [&str; 4] = ["learned", "pairs-held-out", "half-the-scenes", "scene-left-out"];

fn args<'a>(corpora: &'a Corpora, out: &'a Path) -> Vec<&'a str> {
    let [means, batches] = &corpora.paths;
    let small = ["--edge", "32", "--levels", "12", "--out", text(out)];
    [&["reproduce", "--corpus", text(means), text(batches)][..], &small].concat()
}

/// Without the times, which differ from run to run.
fn timeless(value: &Value) -> Value {
    match value {
        Value::Object(fields) => {
            let kept = fields.iter().filter(|(name, _)| !name.starts_with("seconds"));
            kept.map(|(name, value)| (name.clone(), timeless(value))).collect()
        }
        Value::Array(items) => items.iter().map(timeless).collect(),
        other => other.clone(),
    }
}

// Long: one run, looked at from all sides
#[test]
fn all_protocols_are_run_and_resumed() {
    let (corpora, folder) = (Corpora::new(), tempdir().unwrap());
    let out = folder.path();
    let said = succeed(&args(&corpora, out));
    let report = json(&out.join("reproduce.json"));
    assert_eq!(said, std::fs::read_to_string(out.join("reproduce.md")).unwrap());
    assert!(said.contains("synthesised") && said.contains("ray-traced"), "{said}");

    // 12 zones of 12 levels; real images are those below the most converged one, of batches those with two
    // halves
    let outcomes = report["outcomes"].as_array().unwrap();
    assert_eq!(outcomes.len(), RESULTS);
    for (outcome, protocol) in outcomes.iter().zip(PROTOCOLS.iter().cycle()) {
        assert_eq!(outcome["protocol"], *protocol);
        let machines = outcome["machines"].as_array().unwrap();
        let sum = |of: &str| -> u64 {
            machines
                .iter()
                .map(|m| m[of]["noisy"].as_u64().unwrap() + m[of]["identical"].as_u64().unwrap())
                .sum()
        };
        let (synthesised, machine_count) = match *protocol {
            "learned" => (144, 1),
            "pairs-held-out" => (28, 1),
            "half-the-scenes" => (144, 2),
            _ => (144, 3),
        };
        assert_eq!((sum("synthesised"), machines.len()), (synthesised, machine_count), "{protocol}");
        assert_eq!(sum("real"), 8 * 6 + 4 * 5, "{protocol}");
        for machine in machines {
            let learned = machine["examples"].as_u64().unwrap();
            assert!(machine["support_vectors"].as_u64().unwrap() <= learned);
            let asked = ["noisy", "identical"].map(|c| machine["synthesised"][c].as_u64().unwrap());
            let all = if *protocol == "learned" { learned } else { learned + asked[0] + asked[1] };
            assert_eq!(all, 144, "{machine}");
        }
        if let Some(query) = outcome["query"].as_object() {
            assert_eq!(*protocol, "learned");
            assert!(query["largest_difference"].as_f64().unwrap() < 1e-3, "{outcome}");
        }
    }

    // Again: nothing is computed, and nothing changes
    let before = std::fs::read(out.join("reproduce.json")).unwrap();
    let again = run(&args(&corpora, out));
    assert!(again.status.success());
    assert_eq!(stderr(&again).matches(" is there").count(), RESULTS);
    assert_eq!(std::fs::read(out.join("reproduce.json")).unwrap(), before);

    // One lost, one broken: these two are computed, and the same
    std::fs::remove_file(out.join("mask-pair-display-learned.json")).unwrap();
    std::fs::write(out.join("luminance-pair-standardised-scene-left-out.json"), "{\"half\": ").unwrap();
    let resumed = run(&args(&corpora, out));
    assert!(resumed.status.success());
    assert_eq!(stderr(&resumed).matches(" is there").count(), RESULTS - 2);
    assert_eq!(stderr(&resumed).matches(" written").count(), 2);
    assert_eq!(timeless(&json(&out.join("reproduce.json"))), timeless(&report));

    // Other pairs: all is computed
    let mut others = args(&corpora, out);
    let levels = others.iter().position(|a| *a == "12").unwrap();
    others[levels] = "10";
    assert_eq!(stderr(&run(&others)).matches(" written").count(), RESULTS);
}

#[test]
fn what_cannot_be_reproduced_is_named() {
    let (corpora, folder) = (Corpora::new(), tempdir().unwrap());
    let [means, batches] = &corpora.paths;
    let out = folder.path().join("out");
    let with = |corpus: &[&str], more: &[&str], words: &[&str]| {
        fail(&[&["reproduce", "--out", text(&out), "--corpus"], corpus, more].concat(), words);
    };
    let both = [text(means), text(batches)];
    with(&["absent"], &[], &["absent", "thresholds.csv"]);
    with(&both, &[], &["Attic, zone", "128×128", "64×64"]);
    with(&both, &["--edge", "9"], &["--edge", "16…512"]);
    with(&both, &["--levels", "1000000"], &["--levels", "10…1000"]);
    with(&both[..1], &["--edge", "16"], &["3 groups", "Attic, Barn"]);
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    fail(
        &["reproduce", "--corpus", both[0], both[1], "--out", text(&file.join("out"))],
        &["file/out", "folder"],
    );
}
