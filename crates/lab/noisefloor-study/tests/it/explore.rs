use crate::kill::process;
use crate::kit::{Running, stack};
use noisefloor::{
    Model, Oracle, People, TileGrid, ToneMapping,
    descriptor::Descriptor,
    evidence::{Evidence, Samples},
    stills::{SnapshotPair, Still},
};
use noisefloor_image::read_picture;
use noisefloor_learn::{Level, Origin, Table, TrainParams, Zone};
use noisefloor_pages::languages::{check, parse_language};
use noisefloor_study::explore::{Disagreements, ExploreSetup, read_answers, retrain};
use noisefloor_testkit::HANG;
use serde_json::{Value, json};
use std::path::Path;

/// Two stages and a reference of one rendering, 128×64 pixels, in a new folder.
pub(crate) fn setup(dir: &Path) -> ExploreSetup {
    stack(&dir.join("wall"), (128, 64), &[100, 400, 1600]);
    setup_of(dir)
}

/// The same of a folder that has them.
pub(crate) fn setup_of(dir: &Path) -> ExploreSetup {
    let pictures = [100, 400, 1600].map(|spp| dir.join(format!("wall/{spp:05}.png"))).to_vec();
    ExploreSetup { pictures, tile: 64, ..ExploreSetup::new(dir.join("explore.sqlite")) }
}

pub(crate) fn question(picture: &Value) -> Value {
    json!({ "picture": picture["id"], "people": 0.95, "audience": [1.0, 0.0], "retrained": false })
}

/// What `judge` computes: the picture held against the others, all tiles described and judged in their
/// picture.
fn judged(
    paths: &[std::path::PathBuf],
    spp: &[f64],
    at: usize,
) -> (Vec<Vec<f32>>, Vec<noisefloor::Verdict>, Samples) {
    let still = |i: usize| read_picture(&paths[i]).unwrap().into_still(spp[i]);
    let stills: Vec<Still> = (0..paths.len()).map(still).collect();
    let others: Vec<&Still> = (0..paths.len()).filter(|&i| i != at).map(|i| &stills[i]).collect();
    let held =
        SnapshotPair::new(Evidence::Halves, &stills[at], &others, ToneMapping::default(), None).unwrap();
    let oracle = Oracle::bundled();
    let described = held.describe(&oracle, TileGrid::new(128, 64, 64).unwrap()).unwrap();
    let numbers = oracle.model().descriptor().in_picture(&described);
    (numbers, oracle.judge_described(&described), held.samples())
}

/// What the page is told of each level, and what is kept of a disagreement, is what the library says of the
/// same files.
#[test]
fn verdicts_and_descriptors_are_those_of_judge() {
    let dir = tempfile::tempdir().unwrap();
    let server = Running::explorer(setup(dir.path()));
    let state = server.get("/api/state");
    let shown = state["pictures"].as_array().unwrap();
    assert_eq!(shown.iter().map(|p| p["spp"].as_f64().unwrap()).collect::<Vec<_>>(), [100.0, 400.0, 1600.0]);
    let paths = [100, 400, 1600].map(|spp| dir.path().join(format!("wall/{spp:05}.png")));
    for (at, picture) in shown.iter().enumerate() {
        let (numbers, verdicts, samples) = judged(&paths, &[100.0, 400.0, 1600.0], at);
        let (status, said) = server.post("/api/verdicts", &question(picture));
        assert_eq!(status, 200, "{said}");
        assert_eq!(said["nested"], samples == Samples::Nested);
        for (tile, verdict) in said["tiles"].as_array().unwrap().iter().zip(&verdicts) {
            assert_eq!(tile["probability"].as_f64().unwrap() as f32, verdict.probability.unwrap());
            assert_eq!(tile["converged"], verdict.converged);
            assert_eq!(tile["expected_spp"].as_u64(), verdict.expected_spp);
        }
        let (status, kept) = server.post(
            "/api/disagreements",
            &json!({ "question": question(picture), "tile": 1, "sees_noise": verdicts[1].converged }),
        );
        assert_eq!((status, &kept["before"]), (201, &Value::Null), "{kept}");
        let all = read_answers(dir.path().join("explore.sqlite")).unwrap();
        let last = &all.last().unwrap().said;
        assert_eq!(last.numbers, numbers[1]);
        assert_eq!(last.probability, verdicts[1].probability.unwrap());
        assert_eq!((last.tile, last.sees_noise), ([64, 0, 64, 64], verdicts[1].converged));
        assert_eq!((last.model.clone(), last.evidence), (Model::bundled().digest(), Evidence::Halves));
        assert!(
            last.fits(&Descriptor::default(), Evidence::Halves)
                && !last.fits(&Descriptor::default(), Evidence::Reference)
        );
    }
    // Pictures are those of the files, and maps are there.
    let id = shown[0]["id"].as_str().unwrap();
    for which in ["shown", "noise"] {
        let (status, head, body) = server.raw("GET", &format!("/api/pictures/{id}/{which}.png"), "", b"");
        assert!(status == 200 && head.contains("image/png") && body.starts_with(b"\x89PNG"), "{head}");
        std::fs::write(dir.path().join("back.png"), body).unwrap();
        let back = read_picture(dir.path().join("back.png")).unwrap();
        assert_eq!(back == read_picture(&paths[0]).unwrap(), which == "shown");
    }
}

/// Both languages have the same texts with the same gaps to fill, and all that the pages name.
#[test]
fn texts_are_complete_in_both_languages() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("pages/explore");
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    let [english, french] = ["en", "fr"].map(|code| {
        let file = format!("languages/{code}.toml");
        parse_language(&read(&file), Path::new(&file)).unwrap()
    });
    check(&french, &english, Path::new("fr")).unwrap();
    for page in ["index.html", "explore.js", "grid.js", "learn.js", "line.js"] {
        let text = read(page);
        let after = |mark: &'static str, end: &'static [char]| {
            let names = text.split(mark).skip(1).map(|t| t.split(end).next().unwrap().to_owned());
            names.filter(|n| !n.is_empty()).collect::<Vec<_>>()
        };
        let ends: &[char] = &[' ', ',', ')', ';', '.', '`', '}', ']', ':', '"', '\n'];
        let used = [
            after("data-t=\"", &['"']),
            after("data-t-label=\"", &['"']),
            after(" t.", ends),
            after("(t.", ends),
        ];
        assert!(used.concat().len() > 3, "{page}");
        for name in used.concat() {
            assert!(english.text.contains_key(&name), "{page}: {name:?}");
        }
    }
}

/// Threshold and audience act on what is described: a higher P, or people who look harder, leave no more
/// tiles converged.
#[test]
fn people_and_audience_move_verdicts() {
    let dir = tempfile::tempdir().unwrap();
    let server = Running::explorer(setup(dir.path()));
    let picture = server.get("/api/state")["pictures"][1].clone();
    let ask = |people: f64, audience: [f64; 2]| {
        let mut asked = question(&picture);
        asked["people"] = json!(people);
        asked["audience"] = json!(audience);
        server.post("/api/verdicts", &asked)
    };
    let p = |said: &Value| said["tiles"][0]["probability"].as_f64().unwrap();
    let (_, own) = ask(0.9, [1.0, 0.0]);
    let (_, lower) = ask(p(&own) * 0.99, [1.0, 0.0]);
    assert!(lower["tiles"][0]["converged"] == true && p(&lower) == p(&own));
    let (_, higher) = ask((p(&own) + 1e-3).min(0.9999), [1.0, 0.0]);
    assert_eq!(higher["tiles"][0]["converged"], false);
    let (_, harder) = ask(0.9, [2.0, 0.0]);
    assert!(p(&harder) < p(&own), "{harder}");
    assert!(
        harder["tiles"][0]["expected_spp"].as_u64().unwrap()
            > own["tiles"][0]["expected_spp"].as_u64().unwrap()
    );
    for (people, audience) in [(0.0, [1.0, 0.0]), (1.0, [1.0, 0.0]), (0.9, [-1.0, 0.0]), (0.9, [1.0, 1e300])]
    {
        assert_eq!(ask(people, audience).0, 422, "{people} {audience:?}");
    }
}

/// The line of who answers is learned from the stored answers, and turns verdicts the way that was said.
#[test]
fn answers_become_a_line() {
    let dir = tempfile::tempdir().unwrap();
    let server = Running::explorer(setup(dir.path()));
    let line = || server.post("/api/line", &json!({ "people": 0.9 }));
    assert_eq!(line(), (200, Value::Null));
    let state = server.get("/api/state");
    for (picture, tile) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
        let asked = question(&state["pictures"][picture]);
        let said = json!({ "question": asked, "tile": tile, "sees_noise": false });
        assert_eq!(server.post("/api/disagreements", &said).0, 201);
    }
    let (status, learned) = line();
    assert_eq!((status, &learned["answers"]), (200, &json!(4)), "{learned}");
    assert!(learned["slope"].as_f64().unwrap() < 1.0, "{learned}");
    assert!(learned["agree_now"].as_u64() >= learned["agreed_before"].as_u64(), "{learned}");
    let p = |audience: Value| {
        let mut asked = question(&state["pictures"][1]);
        asked["audience"] = audience;
        server.post("/api/verdicts", &asked).1["tiles"][0]["probability"].as_f64().unwrap()
    };
    assert!(p(json!([learned["slope"], learned["offset"]])) > p(json!([1.0, 0.0])), "{learned}");
    assert_eq!(server.post("/api/line", &json!({ "people": 1.5 })).0, 422);
}

/// A single picture cannot be compared, and the page says what is missing.
#[test]
fn a_single_picture_is_told_what_is_missing() {
    let dir = tempfile::tempdir().unwrap();
    let mut one = setup(dir.path());
    one.pictures.truncate(1);
    let server = Running::explorer(one);
    let picture = server.get("/api/state")["pictures"][0].clone();
    let (status, said) = server.post("/api/verdicts", &question(&picture));
    assert_eq!(status, 422);
    assert!(said["what"].as_str().unwrap().contains("converged reference"), "{said}");
    assert!(said["what_to_do"].as_str().unwrap().contains("another rendering of the same view"), "{said}");
}

/// Renaming the scene renames what was said of its pictures: it is left out as one.
#[test]
fn answers_follow_the_name_of_their_scene() {
    let dir = tempfile::tempdir().unwrap();
    let server = Running::explorer(setup(dir.path()));
    let pictures = server.get("/api/state")["pictures"].clone();
    let disagree = |at: usize| {
        let said = json!({ "question": question(&pictures[at]), "tile": 0, "sees_noise": true });
        assert_eq!(server.post("/api/disagreements", &said).0, 201);
    };
    disagree(0);
    let scenes = || {
        let all = read_answers(dir.path().join("explore.sqlite")).unwrap();
        all.into_iter().map(|d| d.said.scene).collect::<Vec<_>>()
    };
    assert!(scenes()[0].starts_with("picture-"), "{:?}", scenes());
    let named = server.put("/api/arrangement", &json!({ "tile": 64, "samples": null, "scene": "hall" }));
    assert_eq!((named.0, &named.1["scene"]), (200, &json!("hall")));
    disagree(1);
    assert_eq!(scenes(), ["hall", "hall"]);
}

/// Killed (SIGKILL) right after the acknowledgement, five times: the disagreement is there. Whoever answers
/// again for a tile changes the answer.
#[test]
fn a_killed_explorer_has_lost_nothing() {
    let dir = tempfile::tempdir().unwrap();
    setup(dir.path());
    for round in 0..5 {
        let (mut child, server) = process(dir.path());
        let picture = server.get("/api/state")["pictures"][round % 3].clone();
        // The opposite of what was said of this picture before
        let sees_noise = [0, 1].map(|tile| (tile + round / 3) % 2 == 0);
        for (tile, sees_noise) in sees_noise.into_iter().enumerate() {
            let said = json!({ "question": question(&picture), "tile": tile, "sees_noise": sees_noise });
            let (status, answer) = server.post("/api/disagreements", &said);
            assert_eq!(status, 201, "{answer}");
        }
        child.kill().unwrap();
        child.wait().unwrap();
        let all = read_answers(dir.path().join("explore.sqlite")).unwrap();
        assert_eq!(all.len(), 2 * (round + 1).min(3), "round {round}");
        let last: Vec<bool> = all[all.len() - 2..].iter().map(|a| a.said.sees_noise).collect();
        assert_eq!(last, sees_noise, "round {round}");
    }
}

/// Other databases are not touched.
#[test]
fn a_database_of_something_else_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("other.sqlite");
    let other = rusqlite::Connection::open(&path).unwrap();
    other.execute_batch("CREATE TABLE mine (n INTEGER); PRAGMA user_version = 7;").unwrap();
    for error in
        [Disagreements::open(&path).map(drop).unwrap_err(), read_answers(&path).map(drop).unwrap_err()]
    {
        assert!(error.to_string().contains("--database"), "{error}");
    }
    std::fs::write(&path, "text").unwrap();
    assert!(Disagreements::open(&path).is_err());
    assert!(read_answers(dir.path().join("absent.sqlite")).is_err());
    assert!(!dir.path().join("absent.sqlite").exists(), "reading makes no database");
}

/// Four scenes where people stop where noise is no longer too strong.
pub(crate) fn table() -> Table {
    let mut random = fastrand::Rng::with_seed(5);
    let mut zone = |scene: usize, zone: u32| {
        let texture = 1.0 + random.f32();
        let human_spp = 100.0 * (1.0 + 9.0 * f64::from(random.f32()));
        let level = |i: i32| {
            let spp = 20.0 * 1.4f64.powi(i);
            let noise = (human_spp / spp).sqrt() as f32;
            let descriptor = vec![noise.ln(), texture, -texture, noise.ln(), -texture];
            Level { spp, origin: Origin::Real, noise, descriptor }
        };
        let (name, levels) = (format!("Scene{scene}"), (0..18).map(level).collect());
        Zone {
            scene: name.clone(),
            group: name,
            zone,
            human_spp,
            censored: false,
            first_spp: 20.0,
            last_spp: 6000.0,
            reference_spp: f64::INFINITY,
            levels,
        }
    };
    let zones = (0..4).flat_map(|s| (0..5).map(move |z| (s, z))).map(|(s, z)| zone(s, z)).collect();
    Table::new(Descriptor::default(), Evidence::Halves, zones)
}

/// Learned in the background, on the server: P of the tile that was disagreed with moves the way that was
/// said, scores come with it, and are the same as those of the library and of another time.
// Long: one retraining, looked at from all sides
#[test]
fn retraining_moves_p_and_says_what_it_costs() {
    let dir = tempfile::tempdir().unwrap();
    let server = Running::explorer(ExploreSetup { table: Some(table()), ..setup(dir.path()) });
    let (status, said) = server.post("/api/retrain", &json!({ "people": 0.9 }));
    assert!(status == 422 && said["where"] == "disagreements", "{said}");
    let state = server.get("/api/state");
    let picture = &state["pictures"][0];
    let disagree = |tile: usize, sees_noise: bool| {
        let said = json!({ "question": question(picture), "tile": tile, "sees_noise": sees_noise });
        assert_eq!(server.post("/api/disagreements", &said).0, 201);
    };
    let learn = || {
        let (status, begun) = server.post("/api/retrain", &json!({ "people": 0.9 }));
        assert!(status == 202 && begun["state"] == "running", "{begun}");
        let begun = std::time::Instant::now();
        loop {
            let now = server.get("/api/retrain");
            match now["state"].as_str() {
                Some("done") => return now,
                Some("running") => {
                    assert!(now["done"].as_u64() <= now["of"].as_u64(), "{now}");
                    assert!(begun.elapsed() < HANG);
                    std::thread::sleep(std::time::Duration::from_millis(20));
                }
                _ => panic!("{now}"),
            }
        }
    };
    let p = |tile: usize| {
        let mut asked = question(picture);
        asked["retrained"] = json!(true);
        server.post("/api/verdicts", &asked).1["tiles"][tile]["probability"].as_f64().unwrap()
    };
    disagree(0, true);
    disagree(1, true);
    let noisy = learn();
    let seen = p(0);
    disagree(0, false);
    disagree(1, false);
    let clean = learn();
    let unseen = p(0);
    // P is far below the threshold at 100 samples: odds, not differences
    let odds = |p: f64| p / (1.0 - p);
    assert!(odds(unseen) > 1.5 * odds(seen), "{seen} if noise is seen, {unseen} if none is");

    // Of one scene alone: left out, nothing was learned.
    for learned in [&noisy, &clean] {
        let a = &learned["agreement"];
        assert_eq!((&a["of"], &a["left_out"]), (&json!(2), &a["before"]), "{learned}");
        assert!(a["fitted"].as_u64() >= a["before"].as_u64(), "{learned}");
        assert!(
            learned["before"]["error_factor"].as_f64().unwrap() >= 1.0 && learned["before"]["zones"] == 20
        );
        let worse = learned["after"]["error_factor"].as_f64()
            > learned["before"]["error_factor"].as_f64().map(|e| e + 0.0005);
        let said =
            learned["worse"].as_array().unwrap().iter().any(|w| w.as_str().unwrap().contains("error factor"));
        assert_eq!(worse, said, "{learned}");
    }
    assert_eq!(noisy["before"], clean["before"]);
    assert_eq!(clean, learn());

    // The model that can be saved is the one that judged, and the library's.
    let (status, head, file) = server.raw("GET", "/api/retrained.nfm", "", b"");
    assert!(status == 200 && head.contains("retrained.nfm"), "{head}");
    let model = Model::read(&file[..]).unwrap();
    assert_eq!(model.digest(), clean["model"].as_str().unwrap());
    let answers = read_answers(dir.path().join("explore.sqlite")).unwrap();
    let answers = answers.iter().map(|d| d.said.answer()).collect();
    let (bundled, params) = (Model::bundled(), TrainParams::for_descriptor(&table().descriptor));
    // Another table than the bundled model's is not called by its name.
    let corpus = format!("a table of {}", table().scenes().join(", "));
    assert!(model.record().corpus.starts_with(&corpus), "{}", model.record().corpus);
    let again = retrain(&table(), answers, &params, (&bundled, People::DEFAULT), &corpus, |_| ()).unwrap();
    assert_eq!(again.0.digest(), model.digest());
}

/// The map of JODs of a page is the vision model's of the picture with its noise against that without, in colours: where
/// a picture has more samples, it has lost less.
#[test]
fn the_map_of_jods_is_the_vision_models() {
    let dir = tempfile::tempdir().unwrap();
    let server = Running::explorer(setup(dir.path()));
    let state = server.get("/api/state");
    let brightness = |at: usize| {
        let id = state["pictures"][at]["id"].as_str().unwrap();
        let (status, _, bytes) = server.raw("GET", &format!("/api/pictures/{id}/lost.png"), "", &[]);
        assert_eq!(status, 200);
        let map = image::load_from_memory(&bytes).unwrap().to_rgb8();
        assert_eq!(map.dimensions(), (128, 64));
        map.pixels().map(|p| p.0.iter().map(|&c| u64::from(c)).sum::<u64>()).sum::<u64>()
    };
    let (first, second) = (brightness(0), brightness(1));
    assert!(second < first, "{first} {second}");
}
