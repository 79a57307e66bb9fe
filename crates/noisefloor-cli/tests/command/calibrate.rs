use crate::kit::{column, command, fail, json, stderr, succeed, text, tiny};
use noisefloor::{Model, Viewing};
use noisefloor_eyes::{Eyes, Person, SeenDisplay};
use std::path::Path;

/// At the default display: finer pixels would hide noise, and take back what the factor adds.
fn keep(path: &Path, name: &str, factor: f64, model: &str) {
    let pixels_per_degree = Viewing::default().pixels_per_degree();
    let display =
        SeenDisplay { pixels_per_degree, distance_mm: 600.0, gamma: 2.2, ambient: "dim".to_owned() };
    let person = Person {
        name: name.to_owned(),
        factor,
        interval: [0.8 * factor, 1.25 * factor],
        scatter: 0.2,
        answers: 40,
        date: "2026-11-24".to_owned(),
        model: model.to_owned(),
        display,
    };
    Eyes::keep(path, person).unwrap();
}

/// Without a browser, as for a build server: the factor is found, guessing is an error, nothing is kept.
#[test]
fn simulated_observers_are_calibrated() {
    let home = tempfile::tempdir().unwrap();
    let run = |what: &str| {
        let mut command = command(&["calibrate", "--simulate", what]);
        command.env("XDG_CONFIG_HOME", home.path()).output().unwrap()
    };
    let said = String::from_utf8(run("factor=1.7,scatter=0.15,seed=3").stdout).unwrap();
    let found: f64 = said.split_whitespace().nth(1).unwrap().parse().unwrap();
    assert!((1.7 / 1.4..1.7 * 1.4).contains(&found), "{said}");
    assert_eq!(run("factor=1.7,scatter=0.15,seed=3").stdout, said.as_bytes());
    let guessed = run("factor=1.7,slips=1");
    assert!(guessed.status.code() == Some(1) && stderr(&guessed).contains("as by guessing"));
    assert_eq!(std::fs::read_dir(home.path()).unwrap().count(), 0);
    fail(&["calibrate", "--simulate", "scatter=1"], &["factor is missing"]);
    fail(&["calibrate", "--simulate", "factor=0"], &["0.05…20"]);
}

/// Renders stop at twice the samples for eyes that need twice as many, and say so; other options that say who
/// looks come first, and `--eyes none` goes without.
#[test]
fn renders_stop_for_the_eyes_that_are_kept() {
    let home = tempfile::tempdir().unwrap();
    let own = home.path().join("noisefloor/eyes.toml");
    let digest = Model::bundled().digest();
    keep(&own, "me", 2.0, &digest);
    let render = |name: &str, more: &[&str]| {
        let out = home.path().join(name);
        let output = command(&tiny(text(&out), more)).env("XDG_CONFIG_HOME", home.path()).output().unwrap();
        assert!(output.status.success(), "{}", stderr(&output));
        (json(&out.join("report.json")), stderr(&output), column(&out.join("stops.csv"), "spp"))
    };
    let spp = |stops: &[String]| stops.iter().map(|spp| spp.parse::<f64>().unwrap()).sum::<f64>();
    let whole = ["--size", "32x32", "--max-spp", "4000"];
    let short = ["--max-spp", "16"];
    let (report, said, mine) = render("mine", &whole);
    assert!(
        said.contains("for the eyes of me (2.00 times") && said.contains("38 pixels per degree"),
        "{said}"
    );
    assert_eq!(report["params"]["audience"]["slope"], 2.0, "{report:#}");
    let (_, said, theirs) = render("theirs", &[&whole[..], &["--eyes", "none"]].concat());
    assert!(!said.contains("eyes of me"), "{said}");
    assert!(spp(&mine) > 1.3 * spp(&theirs), "{mine:?} {theirs:?}");
    let (_, said, _) = render("typed", &[&short[..], &["--audience", "1,0"]].concat());
    assert!(!said.contains("eyes of me"), "{said}");

    // A studio: nine of ten are content, of three the one who needs most
    let studio = home.path().join("studio.toml");
    for (name, factor) in [("a", 0.5), ("b", 3.0), ("c", 1.0)] {
        keep(&studio, name, factor, &digest);
    }
    let (_, said, _) =
        render("studio", &[&short[..], &["--eyes", text(&studio), "--criterion", "oracle"]].concat());
    assert!(said.contains("for the eyes of b (3.00 times"), "{said}");
    let shown = succeed(&["calibrate", "--show", "--out", text(&studio)]);
    assert!(shown.contains("b: 3.00 times") && shown.lines().count() == 4, "{shown}");

    // Somebody of another model is left out, by name, and is no reason against the others
    keep(&studio, "old", 9.0, "another");
    let (_, said, _) = render("left-out", &[&short[..], &["--eyes", text(&studio)]].concat());
    assert!(said.contains("the eyes of old were measured") && said.contains("for the eyes of b"), "{said}");
    // Beside other criteria it is opened, and said to have no effect
    let (_, said, _) = render("unused", &["--eyes", text(&studio), "--criterion", "spp:8"]);
    assert!(said.contains("--eyes has no effect"), "{said}");
    let absent = home.path().join("absent");
    fail(&tiny("x", &["--eyes", text(&absent), "--criterion", "spp:8"]), &["absent"]);

    // Of another model: not used by default, an error when asked for
    let other = home.path().join("other.toml");
    keep(&other, "me", 2.0, "another");
    let out = home.path().join("x");
    fail(&tiny(text(&out), &["--eyes", text(&other)]), &["another model", "calibrate again"]);
    let both = tiny(text(&out), &["--eyes", text(&studio), "--viewing", "tv"]);
    fail(&both, &["--eyes and --viewing both"]);
    fail(&tiny(text(&out), &["--eyes", text(&home.path().join("absent"))]), &["absent"]);
    keep(&own, "me", 2.0, "another");
    let (_, said, _) = render("stale", &short);
    assert!(said.contains("beside another model, and are not used"), "{said}");
    std::fs::write(&own, "colour = 1").unwrap();
    let output = command(&tiny(text(&out), &[])).env("XDG_CONFIG_HOME", home.path()).output().unwrap();
    assert!(stderr(&output).contains("--eyes none goes without"), "{}", stderr(&output));
}

/// Before the first question, and not after the last.
#[test]
fn what_could_not_be_kept_is_said_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let ask = |out: &Path, more: &[&str], words: &[&str]| {
        fail(&[&["calibrate", "--listen", "127.0.0.1:0", "--out", text(out)], more].concat(), words);
    };
    ask(folder.path(), &[], &["nothing was asked", "cannot be kept", "is a folder"]);
    let file = folder.path().join("eyes.toml");
    ask(&file, &["--for", ""], &["empty"]);
    std::fs::write(&file, "version = 9\neyes = 2").unwrap();
    ask(&file, &[], &["version 9 of a newer noisefloor"]);
}
