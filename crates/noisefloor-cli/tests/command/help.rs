use crate::kit::succeed;

// Long: a list of cases
#[test]
fn every_subcommand_explains_itself() {
    let options: [(&str, &[&str]); 15] = [
        ("farm", &["plan", "run", "merge", "status", "--local", "{frame:04}"]),
        ("merge", &["--out", "--force", "render --resume"]),
        ("reference", &["--out", "--size", "--seed", "--quiet"]),
        (
            "render",
            &[
                "--out",
                "--size",
                "--tile",
                "--batch",
                "--min-spp",
                "--max-spp",
                "--time",
                "--seed",
                "--threads",
                "--model",
                "--source",
                "--timeout",
            ],
        ),
        (
            "judge",
            &[
                "--spp",
                "--against",
                "--nested",
                "--json",
                "--heat-map",
                "--noise-map",
                "--exr",
                "--tile",
                "--model",
                "--tone-mapping",
            ],
        ),
        (
            "metrics",
            &[
                "IMAGE",
                "REFERENCE",
                "--viewing",
                "--map",
                "--flip-map",
                "--json",
                "--tone-mapping",
                "cvvdp_jod",
            ],
        ),
        ("explore", &["IMAGE", "--model", "--threshold", "--audience", "--database", "--table", "--listen"]),
        ("train", &["--corpus", "--table", "--out", "--save-table", "--sigma", "--disagreements"]),
        ("evaluate", &["--corpus", "--model", "--leave-one-scene-out", "--json", "--csv"]),
        ("audience", &["fit"]),
        ("reproduce", &["--corpus", "--out", "--edge", "--levels", "--dump-subset"]),
        ("study", &["stack", "serve", "links", "analyse", "data", "simulate", "backup", "export", "erase"]),
        ("inspect", &["MODEL", "--json"]),
        ("doctor", &["--install", "NOISEFLOOR_NAME_PYTHON"]),
        ("scenes", &["--help"]),
    ];
    let all = succeed(&["--help"]);
    for (name, options) in options {
        assert!(all.contains(name), "{name} is not in\n{all}");
        let help = succeed(&[name, "--help"]);
        for option in options {
            assert!(help.contains(option), "{option} is not in the help of {name}:\n{help}");
        }
    }
    let render = succeed(&["render", "--help"]);
    for option in [
        "--tone-mapping",
        "--audience",
        "--criterion",
        "--against",
        "--autosave",
        "--schedule",
        "--threshold",
        "--viewing",
        "--lut-input",
    ] {
        assert!(render.contains(option), "{option} is not in\n{render}");
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
