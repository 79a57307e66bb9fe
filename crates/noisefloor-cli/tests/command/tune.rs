use crate::kit::{command, fail, json, said_json, stderr, succeed, text, words};
use noisefloor_testkit::require_python;
use serde_json::Value;
use tempfile::tempdir;

const SMALL: [&str; 5] = ["tune", "cornell-box", "--size", "64x64", "--quiet"];

/// Two renders of the samples found, with seeds that the search has not seen: no tile needs many more.
#[test]
fn samples_that_were_found_are_enough_for_other_seeds() {
    let folder = tempdir().unwrap();
    let keep = folder.path().join("kept");
    let report = said_json(&["tune", "cornell-box", "--size", "64x64", "--json", "--keep", text(&keep)]);
    assert_eq!((report["ending"].as_str(), report["knob"].as_str()), (Some("found"), Some("samples")));
    let (setting, coarse) = (report["setting"].as_f64().unwrap(), report["too_coarse"].as_f64().unwrap());
    assert!(coarse < setting, "{report}");
    let ratios: Vec<f64> =
        report["steps"].as_array().unwrap().iter().map(|step| step["ratio"].as_f64().unwrap()).collect();
    let (last, before) = ratios.split_last().unwrap();
    assert_eq!(report["steps"][before.len()]["setting"].as_f64(), Some(setting), "claimed as judged");
    assert!(*last <= 1.0 && before.iter().all(|ratio| *ratio > 1.0), "{report}");
    for name in ["image.exr", "image.png", "noise.png"] {
        assert!(keep.join(name).exists(), "{name}");
    }
    assert_eq!(json(&keep.join("tune.json"))["setting"], report["setting"]);
    // Not over what is there
    let again = ["tune", "cornell-box", "--size", "64x64", "--keep", text(&keep)];
    fail(&again, &["tune.json", "--force"]);

    let pictures = ["11", "12"].map(|seed| {
        let out = folder.path().join(seed);
        let spp = format!("spp:{setting}");
        succeed(&words(&format!(
            "render cornell-box --size 64x64 --criterion {spp} --seed {seed} --out {} --quiet",
            text(&out)
        )));
        out.join("image.exr")
    });
    let [a, b] = pictures.each_ref().map(|path| text(path));
    let judged = said_json(&["judge", a, "--against", b, "--json"]);
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
    let said = succeed(&["tune", "cornell-box", "--size", "64x64", "--viewing", "desk,fps=24"]);
    assert!(said.contains("fps=24") && said.contains("come from stills"), "{said}");
    // What other settings would leave and take, with the one that was found: more samples leave less, and take longer
    let words = |line: &str| line.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    let table: Vec<Vec<String>> = said.lines().filter(|line| line.contains('▇')).map(words).collect();
    let numbers =
        |at: usize| table.iter().map(|line| line[line.len() - at].parse().unwrap()).collect::<Vec<f64>>();
    let (spp, left, seconds) = (numbers(4), numbers(3), numbers(2));
    assert!(spp.is_sorted() && seconds.is_sorted() && left.is_sorted_by(|a, b| a >= b), "{said}");
    assert!(spp.len() > 1 && left[0] > 1.0, "{said}");
    let found = table.iter().filter(|line| line[0] == ">").map(|line| line[1].clone()).collect::<Vec<_>>();
    assert_eq!(found, [film.to_string()], "{said}");
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
        light = 0.47 if how == 'darker' and threshold > 0.02 else 0.5\n\
        draw = random.Random(seed).gauss\n\
        values = array.array('f', (draw(light, threshold) for _ in range(96 * 80) for _ in range(3)))\n\
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
    // Two and a half times too coarse; from farther off, strong noise hides a part of itself, and a third step is due
    let (code, said, report) = tune("well", &["--from", "0.025"]);
    assert!(code == Some(0) && !said.contains("as bright"), "{said}");
    let said = tune("darker", &["--from", "0.025"]).1;
    assert!(said.matches("the picture is 1.06 times as bright as with 0.025").count() == 1, "{said}");
    let report = report.unwrap();
    let steps = report["steps"].as_array().unwrap();
    let ratio = |step: &Value| step["ratio"].as_f64().unwrap() / step["setting"].as_f64().unwrap();
    // Noise that is in proportion is found in proportion, and the second step is the last
    assert_eq!((steps.len(), report["ending"].as_str()), (2, Some("found")), "{report}");
    assert!((ratio(&steps[0]) / ratio(&steps[1])).ln().abs() < 0.35, "{report}");
    let each = steps[0]["each"].as_f64().unwrap();
    assert!((each / 0.025 - std::f64::consts::SQRT_2).abs() < 1e-6);

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

/// A sequence whose second frame is the hardest: its program draws noise in proportion to the threshold and to what the
/// frame is. It writes down what it was asked for.
#[test]
fn a_setting_for_a_sequence_is_that_of_its_hardest_frame() {
    let Some(python) = require_python() else { return };
    let folder = tempdir().unwrap();
    let (script, asked) = (folder.path().join("render.py"), folder.path().join("asked"));
    let program = "import array, random, sys\n\
        threshold, seed, out, scene, asked = float(sys.argv[1]), int(sys.argv[2]), *sys.argv[3:]\n\
        times = float(open(scene).read())\n\
        open(asked, 'a').write(f'{scene[-1]} {threshold}\\n')\n\
        draw = random.Random(seed).gauss\n\
        values = array.array('f', (draw(0.5, times * threshold) for _ in range(96 * 80) for _ in range(3)))\n\
        open(out, 'wb').write(b'PF\\n96 80\\n-1\\n' + values.tobytes())\n";
    std::fs::write(&script, program).unwrap();
    let times = [1.0, 2.5, 0.5];
    for (frame, times) in (1..).zip(times) {
        std::fs::write(folder.path().join(format!("shot{frame}")), times.to_string()).unwrap();
    }
    let source = format!(
        "command: {} {} {{threshold}} {{seed}} {{out}}.pfm {{scene}} {}",
        text(&python),
        script.display(),
        asked.display()
    );
    let scene = folder.path().join("shot{frame}");
    let keep = folder.path().join("kept");
    let search = |scene: &str, more: &[&str]| {
        let args = ["tune", scene, "--source", &source, "--tone-mapping", "srgb", "--from", "0.02", "--json"];
        let answer = succeed(&[&args, more].concat());
        serde_json::from_str::<Value>(&answer).unwrap()
    };
    let all = search(text(&scene), &["--frames", "1,2,3", "--keep", text(&keep)]);
    let order: Vec<u64> =
        all["frames"].as_array().unwrap().iter().map(|frame| frame.as_u64().unwrap()).collect();
    assert_eq!(order, [2, 1, 3], "{all}");
    assert!(all["steps"].as_array().unwrap().iter().all(|step| step["frame"] == 2), "{all}");
    // What its second frame alone needs, with the seed that it has in the sequence
    let alone = search(text(&scene), &["--frames", "2"]);
    assert_eq!(all["setting"], alone["setting"]);

    // The coarsest setting is tried in all, the others in the hardest until it passes, and then in all
    let log = std::fs::read_to_string(&asked).unwrap();
    let steps = all["steps"].as_array().unwrap().len();
    let pairs = log.lines().count() / 2 - alone["steps"].as_array().unwrap().len();
    assert_eq!(pairs, 3 + (steps - 2) + 3, "{log}");

    // A search that was cut goes on where it was, by the order that it had
    let report = keep.join("tune.json");
    let mut cut = json(&report);
    cut["steps"].as_array_mut().unwrap().pop();
    std::fs::write(&report, cut.to_string()).unwrap();
    std::fs::write(&asked, "").unwrap();
    let again = search(text(&scene), &["--frames", "1,2,3", "--keep", text(&keep), "--resume"]);
    assert_eq!(again["setting"], all["setting"]);
    assert_eq!(std::fs::read_to_string(&asked).unwrap().lines().count(), 2 * 3);
    assert_eq!(json(&report)["setting"], all["setting"]);
    // One that is done renders nothing
    std::fs::write(&asked, "").unwrap();
    let done = search(text(&scene), &["--frames", "1,2,3", "--keep", text(&keep), "--resume"]);
    assert_eq!(done["setting"], all["setting"]);
    assert_eq!(std::fs::read_to_string(&asked).unwrap(), "");
    // And another is not it
    let base = ["tune", text(&scene), "--source", &source, "--tone-mapping", "srgb", "--resume"];
    let base = [&base[..], &["--keep", text(&keep)]].concat();
    fail(&[&base[..], &["--frames", "1,2,3", "--seed", "9"]].concat(), &["cannot be resumed", "--force"]);
    fail(&[&base[..], &["--frames", "1,2"]].concat(), &["other frames", "--force"]);
    fail(&["tune", "cornell-box", "--frames", "1,2"], &["{frame}"]);
    std::fs::write(folder.path().join("shot3"), "0.6").unwrap();
    fail(&[&base[..], &["--frames", "1,2,3"]].concat(), &["shot3", "has changed"]);
}

/// A program with two noisy places, which renders what part of the picture it is asked for, and writes that down.
#[test]
fn only_the_worst_places_are_looked_at_again() {
    let Some(python) = require_python() else { return };
    let folder = tempdir().unwrap();
    let (script, asked) = (folder.path().join("render.py"), folder.path().join("asked"));
    let program = "import array, random, sys\n\
        threshold, seed, out, asked = float(sys.argv[1]), int(sys.argv[2]), *sys.argv[3:5]\n\
        x0, y0, x1, y1 = map(int, sys.argv[5:])\n\
        open(asked, 'a').write(f'{x0} {y0} {x1} {y1}\\n')\n\
        def times(x, y): return 2.5 if x >= 256 and y < 64 else 2 if x < 64 and y >= 128 else 0.5\n\
        draw = random.Random(seed).gauss\n\
        rows = [[[draw(0.5, times(x, y) * threshold) for _ in range(3)] for x in range(320)] for y in range(192)]\n\
        part = [v for row in reversed(rows[y0:y1]) for pixel in row[x0:x1] for v in pixel]\n\
        open(out, 'wb').write(b'PF\\n%d %d\\n-1\\n' % (x1 - x0, y1 - y0) + array.array('f', part).tobytes())\n";
    std::fs::write(&script, program).unwrap();
    let (python, script) = (text(&python).to_owned(), script.display());
    let asked_path = asked.display();
    let whole =
        format!("command: {python} {script} {{threshold}} {{seed}} {{out}}.pfm {asked_path} 0 0 320 192");
    let parts = whole.replace("0 0 320 192", "{x0} {y0} {x1} {y1}");
    let search = |source: &str, more: &[&str]| {
        let args = ["tune", "--source", source, "--size", "320x192", "--from", "0.02", "--json"];
        let answer = succeed(&[&args, more].concat());
        (serde_json::from_str::<Value>(&answer).unwrap(), std::fs::read_to_string(&asked).unwrap())
    };
    let (all, _) = search(&whole, &[]);
    std::fs::write(&asked, "").unwrap();
    let (some, log) = search(&parts, &["--regions", "2"]);
    // The lower left is worse than the rest, the upper right worse still: squares with half of one around
    assert_eq!(some["regions"][0], serde_json::json!([192, 0, 128, 128]), "{some}");
    assert_eq!(some["regions"][1][0], 0, "{some}");
    let lines: Vec<&str> = log.lines().collect();
    assert_eq!(lines[..4], ["0 0 320 192", "0 0 320 192", "192 0 320 128", "192 0 320 128"]);
    // The whole again in the end, with what was enough for the crops
    let (crops, last) = lines[2..].split_at(lines.len() - 4);
    assert!(crops.iter().all(|line| *line != "0 0 320 192"), "{log}");
    assert_eq!(last, ["0 0 320 192", "0 0 320 192"]);
    let steps = some["steps"].as_array().unwrap();
    // One picture of each crop was enough with it
    assert_eq!(steps[steps.len() - 1]["setting"], some["setting"]);
    assert_eq!(steps[steps.len() - 2]["each"], some["setting"]);
    assert_eq!(steps[steps.len() - 2]["crops"], 2);
    // The same worst place says the same, with the exposure of the whole; windows at the crop's edge see less
    let [all_ratio, some_ratio] = [&all, &some].map(|report| report["steps"][1]["ratio"].as_f64().unwrap());
    assert!((all_ratio / some_ratio).ln().abs() < 0.1, "{all} {some}");
    let place = |report: &Value| {
        let worst = &report["steps"][1];
        (worst["x"].as_u64().unwrap() >= 256, worst["y"].as_u64().unwrap() < 64)
    };
    assert_eq!([place(&all), place(&some)], [(true, true); 2]);

    let (whole, size) = (whole.as_str(), ["--size", "320x192", "--regions", "2"]);
    fail(&[&["tune", "--source", whole][..], &size].concat(), &["{x0}"]);
    let half = parts.replace(" {y1}", "");
    fail(&[&["tune", "--source", &half][..], &size].concat(), &["{y1} is missing"]);
    fail(
        &["tune", "--source", "luxcore", "scene.cfg", "--regions", "2"],
        &["--regions", "as it is in the whole"],
    );
    fail(&["tune", "cornell-box", "--regions", "2", "--keep", "out"], &["--keep"]);
}

/// Tiles of the worst place alone get more samples, which find what all of them would.
#[test]
fn samples_are_found_in_the_worst_place_alone() {
    let args = ["tune", "cornell-box", "--size", "192x96", "--json"];
    let search = |more: &[&str]| said_json(&[&args, more].concat());
    let (all, some) = (search(&[]), search(&["--regions", "1"]));
    assert_eq!(some["regions"].as_array().unwrap().len(), 1, "{some}");
    // The crop is judged as a picture of its own
    let first = |report: &Value| report["steps"][0]["ratio"].as_f64().unwrap();
    assert!((first(&some) / first(&all)).ln().abs() < 0.1, "{all} {some}");
    let setting = |report: &Value| report["setting"].as_f64().unwrap();
    // The worst place of later settings may be another
    assert!((setting(&some) / setting(&all)).ln().abs() < 0.4, "{all} {some}");
}

/// Samples grow from nothing again, to the same pictures.
#[test]
fn a_search_for_samples_is_resumed() {
    let folder = tempdir().unwrap();
    let keep = folder.path().join("kept");
    let args = ["tune", "cornell-box", "--size", "64x64", "--quiet", "--keep", text(&keep)];
    let setting = succeed(&args);
    let report = keep.join("tune.json");
    let mut cut = json(&report);
    assert_eq!(setting.trim(), cut["setting"].as_f64().unwrap().to_string(), "in one word");
    cut["steps"].as_array_mut().unwrap().pop();
    std::fs::write(&report, cut.to_string()).unwrap();
    assert_eq!(succeed(&[&args[..], &["--resume"]].concat()), setting);
    let steps = |value: &Value| {
        value["steps"].as_array().unwrap().iter().map(|s| s["ratio"].clone()).collect::<Vec<_>>()
    };
    assert_eq!(steps(&json(&report))[..steps(&cut).len()], steps(&cut));
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
