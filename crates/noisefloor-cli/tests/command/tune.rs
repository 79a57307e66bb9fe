use crate::kit::{command, fail, json, stderr, succeed, text};
use noisefloor_testkit::require_python;
use serde_json::Value;
use tempfile::tempdir;

const SMALL: [&str; 5] = ["tune", "cornell-box", "--size", "64x64", "--quiet"];

/// Two renders of the samples found, with seeds that the search has not seen: no tile needs many more.
#[test]
fn samples_that_were_found_are_enough_for_other_seeds() {
    let folder = tempdir().unwrap();
    let keep = folder.path().join("kept");
    let report: Value = serde_json::from_str(&succeed(&[
        "tune",
        "cornell-box",
        "--size",
        "64x64",
        "--json",
        "--keep",
        text(&keep),
    ]))
    .unwrap();
    assert_eq!((report["ending"].as_str(), report["knob"].as_str()), (Some("found"), Some("samples")));
    let (setting, coarse) = (report["setting"].as_f64().unwrap(), report["too_coarse"].as_f64().unwrap());
    assert!(coarse < setting && setting <= report["enough"].as_f64().unwrap(), "{report}");
    let ratios: Vec<f64> =
        report["steps"].as_array().unwrap().iter().map(|step| step["ratio"].as_f64().unwrap()).collect();
    let (last, before) = ratios.split_last().unwrap();
    assert!(*last <= 1.0 && before.iter().all(|ratio| *ratio > 1.0), "{report}");
    for name in ["image.exr", "image.png", "noise.png"] {
        assert!(keep.join(name).exists(), "{name}");
    }
    assert_eq!(json(&keep.join("tune.json"))["setting"], report["setting"]);
    // The same again, in one word; and not over what is there
    assert_eq!(succeed(&SMALL).trim(), setting.to_string());
    let again = ["tune", "cornell-box", "--size", "64x64", "--keep", text(&keep)];
    fail(&again, &["tune.json", "--force"]);

    let pictures = ["11", "12"].map(|seed| {
        let out = folder.path().join(seed);
        let spp = format!("spp:{setting}");
        succeed(&[
            "render",
            "cornell-box",
            "--size",
            "64x64",
            "--criterion",
            &spp,
            "--seed",
            seed,
            "--out",
            text(&out),
            "--quiet",
        ]);
        out.join("image.exr")
    });
    let [a, b] = pictures.each_ref().map(|path| text(path));
    let judged: Value = serde_json::from_str(&succeed(&["judge", a, "--against", b, "--json"])).unwrap();
    for tile in judged["tiles"].as_array().unwrap() {
        let needs = tile["expected_spp"].as_f64().unwrap();
        assert!(needs <= 1.35 * setting, "{needs} of {setting}: {tile}");
    }
}

/// The frames of a film need fewer samples than a still, whichever way the rate is given; nobody was asked
/// about that.
#[test]
fn frames_of_a_film_need_fewer_samples() {
    let tune = |more: &[&str]| -> f64 { succeed(&[&SMALL[..], more].concat()).trim().parse().unwrap() };
    let (still, film) = (tune(&[]), tune(&["--fps", "24"]));
    println!("{still} samples of a still, {film} of a frame");
    assert!(film < 0.8 * still, "{film} of {still}");
    assert_eq!(tune(&["--viewing", "desk,fps=24"]), film);
    let said = succeed(&["tune", "cornell-box", "--size", "64x64", "--fps", "24"]);
    assert!(said.contains("fps=24") && said.contains("come from stills"), "{said}");
    fail(&["tune", "--fps", "24", "--viewing", "desk,fps=25"], &["either --fps"]);
    fail(&["tune", "--fps", "4"], &["10…1000 frames per second"]);
}

/// A program whose noise is proportional to its threshold, down to a floor.
#[test]
fn a_program_s_own_threshold_is_found() {
    let Some(python) = require_python() else { return };
    let folder = tempdir().unwrap();
    let script = folder.path().join("render it.py");
    let program = "import array, random, sys\n\
        threshold, seed, out, how = float(sys.argv[1]), int(sys.argv[2]), sys.argv[3], sys.argv[4]\n\
        if how == 'one-seed': seed = 1\n\
        if how == 'no-threshold': threshold = 0.1\n\
        draw = random.Random(seed).gauss\n\
        values = array.array('f', (draw(0.5, threshold) for _ in range(96 * 80) for _ in range(3)))\n\
        open(out, 'wb').write(b'PF\\n96 80\\n-1\\n' + values.tobytes())\n";
    std::fs::write(&script, program).unwrap();
    let source = |how: &str| {
        let (python, script) = (text(&python).to_owned(), script.display());
        format!("command: {python} '{script}' {{threshold}} {{seed}} {{out}}.pfm {how}")
    };
    let tune = |how: &str, more: &[&str]| {
        let source = source(how);
        let args = [&["tune", "--source", &source, "--tone-mapping", "srgb", "--json"], more].concat();
        let output = command(&args).output().unwrap();
        (output.status.code(), stderr(&output), serde_json::from_slice::<Value>(&output.stdout).ok())
    };
    let (code, said, report) = tune("well", &["--from", "0.03"]);
    assert_eq!(code, Some(0), "{said}");
    let report = report.unwrap();
    let steps = report["steps"].as_array().unwrap();
    let ratio = |step: &Value| step["ratio"].as_f64().unwrap() / step["setting"].as_f64().unwrap();
    // Noise that is in proportion is found in proportion, and the second step is the last
    assert_eq!((steps.len(), report["ending"].as_str()), (2, Some("found")), "{report}");
    assert!((ratio(&steps[0]) / ratio(&steps[1])).ln().abs() < 0.35, "{report}");
    let each = steps[0]["each"].as_f64().unwrap();
    assert!((each / 0.03 - std::f64::consts::SQRT_2).abs() < 1e-6);

    // From far away, leaps are made in several steps to the same threshold
    let far = tune("well", &[]).2.unwrap();
    assert!(far["steps"].as_array().unwrap().len() <= 4, "{far}");
    let [near, far] = [&report, &far].map(|report| report["setting"].as_f64().unwrap());
    assert!((near / far).ln().abs() < 0.15, "{near} {far}");

    assert_eq!(tune("no-threshold", &[]).2.unwrap()["ending"], "unchanged");
    let (code, said, _) = tune("one-seed", &[]);
    assert!(code == Some(1) && said.contains("does not look at the seed"), "{said}");
    let (code, _, report) = tune("well", &["--to", "0.15"]);
    assert_eq!((code, report.unwrap()["ending"].as_str()), (Some(1), Some("at-finest")));
}

#[test]
fn what_cannot_be_tuned_is_refused() {
    fail(
        &["tune", "cornell-box", "--knob", "threshold"],
        &["ptwne has no noise threshold", "--knob samples"],
    );
    fail(&["tune", "--source", "exr", "pictures"], &["--source exr"]);
    fail(&["tune", "--from", "100", "--to", "50"], &["between 100 and 50"]);
    fail(&["tune", "--from", "10.5"], &["whole number"]);
    fail(&["tune", "--max-spp", "100"], &["--to"]);
    fail(&["tune", "--lost", "0.1"], &["--denoise"]);
    let source = "command: render {seed} {out}";
    fail(&["tune", "--source", source, "--knob", "threshold"], &["{threshold}"]);
}
