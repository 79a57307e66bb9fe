use crate::kit::{column, fail, json, run, said_json, succeed, text};
use noisefloor::evidence::Evidence;
use noisefloor_image::{RenderLayers, write_exr, write_png};
use noisefloor_learn::read_table;
use noisefloor_study::explore::{Disagreements, TileAnswer};
use noisefloor_testkit::Noise;
use serde_json::Value;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use tempfile::{TempDir, tempdir};

const HEADER: &str = "scene,renderer,zone,x,y,width,height,human_spp,first_spp,last_spp\n";
const EDGE: usize = 64;
const ZONES: usize = 4;
const LEVELS: [u32; 7] = [20, 40, 80, 200, 1000, 4000, 9000];
/// Noise, in steps of 8 bits, at which these people stop seeing it.
const SEEN: f64 = 1.6;

/// Standard deviation of one sample of a zone, in display values: thresholds from 250 to 1600 spp.
fn deviation(scene: usize, zone: usize) -> f64 {
    0.1 * (1.0 + 0.35 * zone as f64 + 0.15 * scene as f64)
}

fn rows(scene: &str, index: usize, at: impl Fn(usize) -> (usize, usize)) -> String {
    let mut rows = String::new();
    for zone in 0..ZONES {
        let (x, y) = at(zone);
        let human = (deviation(index, zone) * 255.0 / SEEN).powi(2);
        writeln!(rows, "{scene},synthetic,{zone},{x},{y},{EDGE},{EDGE},{human:.0},20,9000").unwrap();
    }
    rows
}

/// Running means of a zone after each level, in display values: a grey checker and white noise. Checkers
/// differ within a scene, so that no scene has textures that no other one has.
fn running_means(scene: usize, zone: usize) -> Vec<Vec<f64>> {
    let mut noise = Noise::keyed(&[scene as u64, zone as u64]);
    let (grey, sigma) = (0.4 + 0.05 * zone as f64, deviation(scene, zone));
    let contrast = 0.02 + 0.03 * ((zone + scene) % ZONES) as f64;
    let clean =
        |i: usize| grey + if (i % EDGE / 6 + i / EDGE / 6).is_multiple_of(2) { contrast } else { 0.0 };
    let (mut sums, mut first) = (vec![0.0; EDGE * EDGE], 0);
    let mut means = Vec::new();
    for last in LEVELS {
        let new = f64::from(last - first);
        for (i, sum) in sums.iter_mut().enumerate() {
            *sum += new * clean(i) + new.sqrt() * sigma * noise.normal();
        }
        means.push(sums.iter().map(|sum| sum / f64::from(last)).collect());
        first = last;
    }
    means
}

/// Three synthetic scenes where people stop at one noise level: two in one folder of running means, one in
/// batches.
pub(crate) struct Corpora {
    folder: TempDir,
    pub(crate) paths: [PathBuf; 2],
}

impl Corpora {
    pub(crate) fn new() -> Self {
        let folder = tempdir().unwrap();
        let paths = ["means", "batches"].map(|name| folder.path().join(name));
        paths.iter().for_each(|path| std::fs::create_dir(path).unwrap());

        // A folder a scene, with running means as PNGs of 128×128 pixels
        let at = |zone: usize| (zone % 2 * EDGE, zone / 2 * EDGE);
        let mut thresholds = HEADER.to_owned();
        for (index, scene) in ["Attic", "Barn"].into_iter().enumerate() {
            thresholds += &rows(scene, index, at);
            std::fs::create_dir(paths[0].join(scene)).unwrap();
            let zones: Vec<_> = (0..ZONES).map(|zone| running_means(index, zone)).collect();
            for (level, spp) in LEVELS.iter().enumerate() {
                let pixel = |i: usize| {
                    let (x, y) = (i % (2 * EDGE), i / (2 * EDGE));
                    let value = zones[x / EDGE + 2 * (y / EDGE)][level][x % EDGE + y % EDGE * EDGE];
                    [(value * 255.0).round().clamp(0.0, 255.0) as u8; 3]
                };
                let rgb: Vec<u8> = (0..4 * EDGE * EDGE).flat_map(pixel).collect();
                write_png(paths[0].join(scene).join(format!("{spp:05}.png")), 2 * EDGE, 2 * EDGE, &rgb)
                    .unwrap();
            }
        }
        std::fs::write(paths[0].join("thresholds.csv"), thresholds).unwrap();

        // A folder a zone, with batches as EXRs
        std::fs::write(paths[1].join("thresholds.csv"), HEADER.to_owned() + &rows("Cellar", 2, at)).unwrap();
        for zone in 0..ZONES {
            write_batches(&paths[1].join(format!("zone{zone:02}")), &running_means(2, zone));
        }
        Self { folder, paths }
    }

    pub(crate) fn args<'a>(&'a self, command: &'a str) -> Vec<&'a str> {
        let [means, batches] = self.paths.each_ref().map(|path| text(path));
        let all = [command, "--corpus", means, "--corpus", batches];
        [&all[..], &["--c", "1", "--gamma", "0.01,0.03"]].concat()
    }
}

/// Batches in linear light whose running means are almost the given ones: decoding bends noise of a few per
/// cent little.
fn write_batches(folder: &Path, means: &[Vec<f64>]) {
    std::fs::create_dir(folder).unwrap();
    let linear = |i: usize, pixel: usize| f64::from(noisefloor::display::srgb_decode(means[i][pixel] as f32));
    let mut first = 0;
    for (i, last) in LEVELS.into_iter().enumerate() {
        let (n1, n2) = (f64::from(first), f64::from(last));
        let batch = |pixel: usize| {
            let before = if i > 0 { n1 * linear(i - 1, pixel) } else { 0.0 };
            [((n2 * linear(i, pixel) - before) / (n2 - n1)) as f32; 3]
        };
        let rgb: Vec<[f32; 3]> = (0..EDGE * EDGE).map(batch).collect();
        let name = format!("batch_{first:05}_{last:05}.exr");
        write_exr(folder.join(name), &RenderLayers::rgb(EDGE, EDGE, &rgb)).unwrap();
        first = last;
    }
}

fn assert_scores(report: &Value, zones: u64) {
    assert_eq!(report["zones"].as_u64(), Some(zones));
    let constant = &report["baselines"]["constant"]["error_factor"];
    let median = &report["baselines"]["scene_median"]["error_factor"];
    for factor in [&report["error_factor"], constant, median] {
        assert!(factor.as_f64() >= Some(1.0), "{report}");
    }
    assert!(report["bias_factor"].as_f64() > Some(0.0), "{report}");
    for share in [&report["early_share"], &report["image_accuracy"]] {
        assert!(share.as_f64().is_some_and(|s| (0.0..=1.0).contains(&s)), "{report}");
    }
}

// Long: one run, looked at from all sides
#[test]
fn train_inspect_evaluate() {
    let corpora = Corpora::new();
    let [model, again, scores, zones, saved] =
        ["my.nfm", "again.nfm", "scores.json", "zones.csv", "table.csv"]
            .map(|name| corpora.folder.path().join(name));

    // Train; from the table that is saved, the same machine
    let mut args = corpora.args("train");
    args.extend(["--out", text(&model), "--save-table", text(&saved)]);
    let said = succeed(&args);
    assert!(said.contains("a line from") && said.contains("on left-out scenes"), "{said}");
    let table_args =
        ["train", "--table", text(&saved), "--c", "1", "--gamma", "0.01,0.03", "--out", text(&again)];
    succeed(&table_args);
    let inspect = |model: &Path| -> Value { said_json(&["inspect", text(model), "--json"]) };
    let (one, two) = (inspect(&model), inspect(&again));
    assert_eq!(one["support_vectors"], two["support_vectors"]);
    assert_eq!(one["record"]["table_digest"], two["record"]["table_digest"]);
    assert_eq!(one["record"]["scenes"].as_array().unwrap().len(), 3);
    assert!(one["record"]["leave_one_scene_out"]["error_factor"].as_f64() >= Some(1.0));
    let said = succeed(&["inspect", text(&model)]);
    assert!(said.contains("Attic, Barn, Cellar") && said.contains(one["digest"].as_str().unwrap()), "{said}");

    // Evaluate the model on what it has seen, and say so
    let mut args = corpora.args("evaluate");
    args.extend(["--model", text(&model), "--json", text(&scores), "--csv", text(&zones)]);
    let said = succeed(&args);
    assert!(said.contains("the model was trained on these scenes"), "{said}");
    let report = json(&scores);
    assert_scores(&report, 12);
    // Noise alone decides here: whoever measures it is right within the spread that P = 0.9 against 95 % of
    // observers leaves
    assert!(report["error_factor"].as_f64() < Some(1.6), "{report}");
    assert!(report["baselines"]["constant"]["error_factor"].as_f64() < Some(1.3), "{report}");
    let scenes: Vec<_> =
        report["scenes"].as_array().unwrap().iter().map(|s| s["scene"].as_str().unwrap()).collect();
    assert_eq!(scenes, ["Attic", "Barn", "Cellar"]);
    report["scenes"].as_array().unwrap().iter().for_each(|scene| assert_scores(scene, 4));

    // A line a zone, of columns in the order that is documented
    let header = "scene,zone,human_spp,predicted_spp,stop_spp,censored,unfamiliar";
    assert_eq!(std::fs::read_to_string(&zones).unwrap().lines().next(), Some(header));
    let numbers = |name: &str| column(&zones, name).iter().map(|n| n.parse().unwrap()).collect::<Vec<f64>>();
    assert_eq!(column(&zones, "scene")[3..5], ["Attic", "Barn"]);
    assert_eq!(numbers("zone"), [0.0, 1.0, 2.0, 3.0].repeat(3));
    assert!(numbers("human_spp").iter().all(|&n| n > 200.0));
    assert!(numbers("predicted_spp").iter().all(|n| (20.0..=9000.0).contains(n)));
    assert_eq!(column(&zones, "censored"), ["false"; 12]);

    // Scenes left out: from pictures and from the table, the same
    let mut args = corpora.args("evaluate");
    args.extend(["--leave-one-scene-out", "--json", text(&scores)]);
    succeed(&args);
    let left_out = json(&scores);
    assert_scores(&left_out, 12);
    assert!(left_out["error_factor"].as_f64() < Some(1.8), "{left_out}");
    let args =
        ["evaluate", "--table", text(&saved), "--leave-one-scene-out", "--c", "1", "--gamma", "0.01,0.03"];
    succeed(&[&args[..], &["--json", text(&scores)]].concat());
    let difference =
        json(&scores)["error_factor"].as_f64().unwrap() - left_out["error_factor"].as_f64().unwrap();
    assert!(difference.abs() < 1e-4, "{difference}");
}

/// What `explore` has kept is learned beside the table: the model differs, and what it costs is said.
#[test]
fn disagreements_are_learned_beside_the_table() {
    let corpora = Corpora::new();
    let [model, saved, database] =
        ["my.nfm", "table.csv", "explore.sqlite"].map(|name| corpora.folder.path().join(name));
    let mut args = corpora.args("train");
    args.extend(["--out", text(&model), "--save-table", text(&saved), "--no-scores"]);
    succeed(&args);
    let plain = std::fs::read(&model).unwrap();

    let kept = Disagreements::open(&database).unwrap();
    let learn = ["train", "--table", text(&saved), "--c", "1", "--gamma", "0.01,0.03", "--out", text(&model)];
    let learn = [&learn[..], &["--disagreements", text(&database)]].concat();
    fail(&learn, &["explore.sqlite", "none of 0 disagreements"]);
    // A table has an evidence of its own
    fail(&[&learn[..], &["--evidence", "halves"]].concat(), &["--evidence", "cannot be used with"]);
    let table = read_table(std::fs::File::open(&saved).unwrap()).unwrap();
    // Noise is seen where the table's people were far beyond their threshold.
    let clean = table.zones[0].levels.last().unwrap();
    for x in 0..2 {
        let said = TileAnswer {
            picture: "a picture".into(),
            name: "a.png".into(),
            scene: "mine".into(),
            spp: clean.spp,
            tile: [64 * x, 0, 64, 64],
            sees_noise: true,
            probability: 0.99,
            threshold: 0.9,
            audience: [1.0, 0.0],
            model: "another".into(),
            descriptor: table.descriptor.spec(),
            descriptor_version: table.descriptor.version(),
            evidence: if x == 0 { table.evidence } else { Evidence::Reference },
            numbers: clean.descriptor.clone(),
        };
        kept.keep(&said).unwrap();
    }
    let said = succeed(&learn);
    for words in [
        "before on left-out scenes",
        "after  on left-out scenes",
        "of 1 disagreements, the verdict is right for 0 before",
    ] {
        assert!(said.contains(words), "{words:?} is not in\n{said}");
    }
    assert_ne!(std::fs::read(&model).unwrap(), plain);
    assert!(succeed(&["inspect", text(&model)]).contains("1 answers about tiles of mine"));
    fail(&[&learn[..9], &["--disagreements", text(&saved)]].concat(), &["table.csv", "database"]);
    assert_eq!(run(&[&learn[..], &["--no-scores"]].concat()).status.code(), Some(2));
}

#[test]
fn a_scene_alone_cannot_be_left_out() {
    let corpora = Corpora::new();
    let out = corpora.folder.path().join("my.nfm");
    for args in [
        vec!["train", "--corpus", text(&corpora.paths[1]), "--out", text(&out)],
        vec!["evaluate", "--corpus", text(&corpora.paths[0]), "--leave-one-scene-out"],
    ] {
        let output = run(&args);
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(
            said.lines().last().is_some_and(|l| l.starts_with("error: ") && l.contains("groups")),
            "{said}"
        );
    }
    assert!(!out.exists());
}
