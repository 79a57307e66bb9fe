use crate::kit::{LAB, stderr, succeed, words};

#[test]
fn every_command_explains_itself() {
    let options = [
        ("farm", "plan run merge status --local {frame:04}"),
        ("reference", "--out --size --seed --quiet"),
        (
            "render",
            "--out --size --tile --batch --min-spp --max-spp --time --seed --threads --model --source",
        ),
        (
            "render",
            "--timeout --tone-mapping --audience --criterion --against --autosave --schedule --people",
        ),
        ("render", "--viewing --lut-input"),
        (
            "judge",
            "--spp --against --nested --json --frames --check --heat-map --noise-map --exr --tile --model",
        ),
        ("judge", "--tone-mapping"),
        ("metrics", "IMAGE REFERENCE --viewing --map --flip-map --json --tone-mapping cvvdp_jod"),
        ("audit", "DIR --places --seed --lost --check --json"),
        ("inspect", "MODEL --json"),
        ("doctor", "--install --json NOISEFLOOR_NAME_PYTHON"),
        ("scenes", "--help"),
        ("explore", "IMAGE --model --people --audience --database --table --listen"),
        ("train", "--corpus --table --out --save-table --machine --disagreements"),
        ("evaluate", "--corpus --model --leave-one-scene-out --json --csv --rivals"),
        ("audience", "fit"),
        ("reproduce", "--corpus --out --edge --levels"),
        ("study", "stack serve links analyse data simulate backup export erase"),
    ];
    let all = succeed(&["--help"]);
    for (name, options) in options {
        assert!(LAB.contains(&name) || all.contains(name), "{name} is not in\n{all}");
        let help = succeed(&[name, "--help"]);
        for option in words(options) {
            assert!(help.contains(option), "{option} is not in the help of {name}:\n{help}");
        }
    }
    // What people need first, and no more
    let short = succeed(&["render", "-h"]);
    let first = short.lines().filter(|line| line.trim_start().starts_with('-')).count();
    assert!((10..=14).contains(&first), "{first} options in\n{short}");
    let render = succeed(&["render", "--help"]);
    for heading in ["Renderer:", "Verdicts:", "What people see:", "To look on:"] {
        assert!(render.contains(&format!("\n{heading}\n")), "{heading} is not in\n{render}");
    }
    assert!(succeed(&["--version"]).starts_with("noisefloor "));
}

#[test]
fn at_least_six_scenes_are_listed() {
    let scenes = succeed(&["scenes"]);
    assert!(scenes.lines().count() >= 6 && scenes.contains("cornell-box"), "{scenes}");
    assert!(
        scenes.lines().all(|line| line.split_whitespace().count() > 2),
        "a name and what it shows:\n{scenes}"
    );
}

/// Shells complete the options that there are, and every command has a page.
#[test]
fn shells_and_man_know_the_command() {
    let bash = succeed(&["completions", "bash"]);
    assert!(bash.contains("_noisefloor") && bash.contains("--max-spp"), "{bash}");
    // Of `render` and of `tune`: scenes where one is asked for, and the words that options take
    for words in ["cornell-box", "cycles", "art-students", "reinhard", "laptop", "relative-error"] {
        assert!(bash.contains(words), "{words}");
    }
    let folder = tempfile::tempdir().unwrap();
    succeed(&["man", folder.path().to_str().unwrap()]);
    let page = std::fs::read_to_string(folder.path().join("noisefloor-render.1")).unwrap();
    assert!(page.contains("max\\-spp") && folder.path().join("noisefloor-farm-plan.1").exists(), "{page}");
    let lab = || std::process::Command::new(env!("CARGO_BIN_EXE_noisefloor-lab"));
    let bash = lab().args(["completions", "bash"]).output().unwrap().stdout;
    assert!(String::from_utf8(bash).unwrap().contains("--leave-one-scene-out"));
    assert!(lab().arg("man").arg(folder.path()).status().unwrap().success());
    assert!(folder.path().join("noisefloor-lab-study-serve.1").exists());
    let elsewhere = lab().args(["render", "hall.xml"]).output().unwrap();
    assert_eq!(elsewhere.status.code(), Some(2));
    let said = stderr(&elsewhere);
    assert!(said.contains("'render' is a command of noisefloor: `cargo run --release -- …`"), "{said}");
}
