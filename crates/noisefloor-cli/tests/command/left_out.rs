use crate::kit::{run, stderr, succeed};

/// Each command that a build may leave out, the feature that has it, and what can be typed.
const OPTIONAL: [(&str, &str, &[&str], bool); 10] = [
    ("farm", "farm", &["status", "absent"], cfg!(feature = "farm")),
    ("merge", "farm", &["absent.nfs", "--out", "out"], cfg!(feature = "farm")),
    ("doctor", "adapters", &[], cfg!(feature = "adapters")),
    ("compare", "lab", &["cornell-box"], cfg!(feature = "lab")),
    ("reproduce", "lab", &["--corpus", "absent"], cfg!(feature = "lab")),
    ("train", "train", &["--corpus", "absent", "--out", "my.nfm"], cfg!(feature = "train")),
    ("evaluate", "train", &["--corpus", "absent"], cfg!(feature = "train")),
    ("audience", "train", &["fit", "absent.csv"], cfg!(feature = "train")),
    ("explore", "study", &[], cfg!(feature = "study")),
    ("study", "study", &["serve", "absent.toml"], cfg!(feature = "study")),
];

/// A command that is not in the build is known all the same: its help is there, and it says what to type.
#[test]
fn what_is_left_out_says_what_to_type() {
    for (command, feature, rest, present) in OPTIONAL {
        assert!(succeed(&[command, "--help"]).contains("Usage: noisefloor"));
        if present {
            continue;
        }
        let output = run(&[&[command], rest].concat());
        assert_eq!(output.status.code(), Some(2), "{command}");
        let again = format!("cargo run --release --features {feature} -- {command}");
        let said = stderr(&output);
        assert!(
            said.starts_with(&format!("error: this build has no '{command}': run `{again} …`")),
            "{said}"
        );
    }
}

/// Options of a command that is there can be missing, too.
#[test]
#[cfg(feature = "train")]
fn options_that_are_left_out_say_what_to_type() {
    let table = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/human-table.csv");
    let mut all: Vec<(&str, Vec<&str>)> = Vec::new();
    if cfg!(not(feature = "lab")) {
        all.push(("lab", vec!["evaluate", "--table", table, "--figures", "out"]));
        all.push(("lab", vec!["evaluate", "--corpus", "absent", "--rivals", "cycles"]));
    }
    if cfg!(not(feature = "study")) {
        all.push((
            "study",
            vec!["train", "--table", table, "--out", "my.nfm", "--disagreements", "my.sqlite"],
        ));
    }
    for (feature, args) in all {
        let output = run(&args);
        assert_eq!(output.status.code(), Some(2), "{args:?}");
        assert!(stderr(&output).contains(&format!("--features {feature} -- {}", args[0])), "{args:?}");
    }
}
