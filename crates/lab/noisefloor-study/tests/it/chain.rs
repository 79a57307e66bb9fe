use crate::kit::{Folder, Running, levels, public};
use noisefloor_learn::Corpus;
use noisefloor_study::analysis::CorpusThreshold;
use noisefloor_study::analysis::files::write;
use noisefloor_study::analysis::{AnalysisOptions, analyse};
use noisefloor_study::simulated::drive;
use noisefloor_study::{Class, store};

const OPTIONS: AnalysisOptions = AnalysisOptions { keep_excluded: false, seed: 1, simulated: true };

/// Twelve simulated observers, two groups of which the second needs twice the samples, click through the
/// real server; the analysis finds what they were made of, and its corpus is one.
#[test]
fn thresholds_come_back_from_the_server_as_a_corpus() {
    let levels = levels(24, 1.3);
    let folder = Folder::new("acquisition", &["wall", "door"], &levels, "groups = [\"cs\", \"art\"]");
    let study = folder.study();
    let server = Running::start(study.clone());
    let truth = [150.0, 600.0];
    for seed in 0..12 {
        let (group, factor) = if seed % 2 == 0 { ("cs", 1.0) } else { ("art", 2.0) };
        let mut observer = public(2, &truth.map(|t| factor * t)).draw(seed);
        drive(&server.url, group, &mut observer, |_| ()).unwrap();
    }
    // Simulated observers are not taken for people.
    assert!(
        analyse(&study, AnalysisOptions { simulated: false, ..OPTIONS })
            .unwrap_err()
            .to_string()
            .contains("people")
    );
    // Analysed while it is served.
    // With two tiles, one slip in an identical pair fails a catch trial: everybody counts here.
    let report = analyse(&study, AnalysisOptions { keep_excluded: true, ..OPTIONS }).unwrap();
    assert_eq!((report.observers.len(), report.tiles.len()), (12, 4));
    assert!(report.observers.iter().all(|o| o.finished && o.tiles == 4 && o.catch_trials == 2));
    for tile in &report.tiles {
        // Two groups, at t and 2t: the median lies at √2·t. Twelve observers of scale 0.3 have a median
        // within 4 standard errors of 0.3·2/√12 = 0.17 in ln(spp).
        let expected = truth[tile.tile] * 2f64.sqrt();
        assert!((tile.median / expected).ln().abs() < 0.7, "{tile:?}");
        let (low, high) = tile.level95_low.zip(tile.level95_high).unwrap();
        assert!(low < tile.level95 && tile.level95 < high && tile.level95 > tile.median, "{tile:?}");
    }
    let repeats = report.repeats.unwrap();
    assert!(repeats.pairs == 48 && repeats.factor < 1.5 && repeats.correlation.unwrap() > 0.7, "{repeats:?}");
    let between = report.between.unwrap();
    assert!(between.icc_single > 0.4 && between.icc_mean > between.icc_single, "{between:?}");
    let line = &report.groups[0];
    assert_eq!((line.from.as_str(), line.to.as_str(), line.observers, line.tiles), ("cs", "art", [6, 6], 4));
    let slope = line.least_squares.unwrap().slope;
    assert!((1.0..4.0).contains(&slope), "{line:?}");

    // Files, and the corpus among them, twice: what is there is replaced.
    let out = folder.dir.path().join("out");
    for _ in 0..2 {
        write(&out, &study, &report, CorpusThreshold::Level95).unwrap();
    }
    let corpus = Corpus::open(out.join("corpus-simulated")).unwrap();
    assert_eq!((corpus.scenes(), corpus.zones().len()), (vec!["wall", "door"], 4));
    for (zone, tile) in corpus.zones().iter().zip(&report.tiles) {
        assert!((zone.row.human_spp - tile.level95.min(levels[23] as f64)).abs() < 1e-6);
    }
    assert_eq!(corpus.scene_levels("wall").unwrap().count(), 48);
    for file in [
        "index.html",
        "report.json",
        "observers.csv",
        "tiles.csv",
        "thresholds.svg",
        "curves-wall.svg",
        "grid-door.png",
    ] {
        assert!(out.join(file).metadata().unwrap().len() > 100, "{file}");
    }
}

/// Validation: pictures stop at 136 samples, and noisy ones at 40; observers see noise below about 80.
#[test]
fn the_table_of_the_paper_comes_back() {
    let levels = levels(20, 1.3);
    let folder = Folder::new("validation", &["wall", "door"], &levels, "repeats = 2");
    let study = folder.study();
    let server = Running::start(study.clone());
    for seed in 0..10 {
        let mut observer = public(2, &[80.0, 80.0]).draw(seed);
        drive(&server.url, "", &mut observer, |_| ()).unwrap();
    }
    // All ten: one who calls noisy pairs identical as often as others, by chance, would be set aside.
    let report = analyse(&study, AnalysisOptions { keep_excluded: true, ..OPTIONS }).unwrap();
    let share = |class: Class| report.classes.iter().find(|c| c.class == class).unwrap();
    assert!(report.tiles.is_empty() && share(Class::Reference).answers == 40);
    // Reference pairs are called different by lapses alone: 0.5 % of 40 answers, 4 or more of them once in
    // 100 000.
    assert!(share(Class::Reference).share > 0.9);
    assert!(share(Class::Noisy).share < share(Class::Test).share);
    let test = share(Class::Test);
    assert!(test.wilson_low < test.wilson_high && (test.wilson_low..=test.wilson_high).contains(&test.share));
    let out = folder.dir.path().join("out");
    write(&out, &study, &report, CorpusThreshold::Mean).unwrap();
    let page = std::fs::read_to_string(out.join("index.html")).unwrap();
    assert!(out.join("classes.csv").is_file() && page.contains("<td>reference</td><td>40</td>"), "{page}");
}

/// Forced choice over the server; export and erasure by code.
#[test]
fn forced_choices_are_measured_exported_and_erased() {
    let levels = levels(24, 1.3);
    let folder = Folder::new("forced-choice", &["wall"], &levels, "trials = 24");
    let study = folder.study();
    let server = Running::start(study.clone());
    let mut codes = Vec::new();
    for seed in 0..6 {
        let mut observer = public(1, &[150.0, 600.0]).draw(seed);
        codes.push(drive(&server.url, "", &mut observer, |_| ()).unwrap());
    }
    let report = analyse(&study, OPTIONS).unwrap();
    assert_eq!((report.observers.len(), report.tiles.len()), (6, 2));
    for (tile, truth) in report.tiles.iter().zip([150.0f64, 600.0]) {
        // Six observers of scale 0.3, each measured to about 0.15: standard error 0.25, here times 4.
        assert!((tile.median / truth).ln().abs() < 1.0, "{tile:?}");
    }
    let design = study.design();
    let record = store::read_one(&study.database, &design, &codes[0]).unwrap();
    assert_eq!(record.events.len(), 2 + 4 + 48 + 10);
    store::erase_one(&study.database, &design, &codes[0]).unwrap();
    assert!(store::read_one(&study.database, &design, &codes[0]).is_err());
    assert_eq!(analyse(&study, OPTIONS).unwrap().observers.len(), 5);
    // Nothing of the code is left in any file of the database.
    drop(server);
    for entry in std::fs::read_dir(folder.dir.path()).unwrap() {
        let path = entry.unwrap().path();
        if path.file_name().unwrap().to_str().unwrap().starts_with("answers.sqlite") {
            // The log vanishes when the database is closed
            let Ok(bytes) = std::fs::read(&path) else { continue };
            assert!(!bytes.windows(12).any(|w| w == codes[0].as_bytes()), "{}", path.display());
            assert!(
                bytes.windows(12).any(|w| w == codes[1].as_bytes())
                    || bytes.is_empty()
                    || path.extension().is_some_and(|e| e != "sqlite")
            );
        }
    }
}
