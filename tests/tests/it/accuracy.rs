use noisefloor::{Model, People};
use noisefloor_learn::{SvmParams, TrainParams, leave_one_scene_out, train};
use noisefloor_learn::{
    Table, VISIBLE_CHOICES, choices, choose_and_leave_out, constant_noise_baseline, read_table_with,
    scene_median_baseline, score,
};
use noisefloor_testkit::Noise;

fn fixture(name: &str) -> Table {
    let path = format!("{}/../fixtures/{name}", env!("CARGO_MANIFEST_DIR"));
    read_table_with(std::fs::File::open(path).unwrap(), &[VISIBLE_CHOICES]).unwrap()
}

fn table() -> Table {
    fixture("human-table.csv")
}

#[test]
fn the_bundled_model_is_what_the_table_trains() {
    let (table, bundled) = (table(), Model::bundled());
    assert_eq!(bundled.record().table_digest, table.digest());
    assert_eq!(bundled.record().scenes, table.scenes());
    let trained =
        train(&table, &TrainParams::for_descriptor(&table.descriptor), String::new(), None).unwrap();
    for level in table.zones.iter().flat_map(|z| &z.levels) {
        let p = |model: &Model| model.judge(&level.descriptor).probability;
        // On another machine, exp may round otherwise on the way
        let (trained, bundled) = (p(&trained), p(&bundled));
        assert!((trained - bundled).abs() < 1e-3, "{trained} {bundled}");
    }
}

/// The rules of evidence hold, and so do the scores in README.
#[test]
fn left_out_scenes_are_predicted_better_than_by_one_noise_level() {
    let table = table();
    assert_eq!((table.zones.len(), table.scenes().len(), table.groups().len()), (167, 11, 10));
    let params = TrainParams::for_descriptor(&table.descriptor);
    let predictions = leave_one_scene_out(&table, &params, People::DEFAULT, |_| ()).unwrap();
    let (ours, constant) = (score(predictions.iter()), score(constant_noise_baseline(&table).iter()));
    assert!(ours.error_factor < 1.33 && ours.early_share <= 0.02, "{ours:?}");
    assert!((0.9..1.1).contains(&ours.bias_factor), "{ours:?}");
    assert!(ours.error_factor < constant.error_factor && ours.early_share < constant.early_share);

    // Known from the data's own README, though for eight other scenes: ×1.40, and 2 % early
    let median = score(scene_median_baseline(&table).iter());
    assert!(
        (median.error_factor - 1.40).abs() < 0.06 && (median.early_share - 0.02).abs() < 0.01,
        "{median:?}"
    );
}

/// P is the share of people: of simulated ones, 400 a zone, whose thresholds scatter by 0.5 in ln(samples) around the mean
/// that real people gave. Models that have not seen the scene say how many of them see no noise in each of its levels
/// near that mean. Shares of 400 are known to 0.025 each; what is left are some 1,000 levels in ten bins.
#[test]
fn p_is_the_share_of_simulated_people() {
    let (table, mut noise) = (table(), Noise::new(2));
    let params = TrainParams::for_descriptor(&table.descriptor);
    let mut bins = [(0.0, 0.0, 0usize); 10];
    for group in table.groups() {
        let (rest, left_out): (Vec<_>, Vec<_>) = table.zones.iter().cloned().partition(|z| z.group != group);
        let rest = Table { zones: rest, ..table.clone() };
        let model = train(&rest, &params, String::new(), None).unwrap();
        for zone in left_out {
            let mean = zone.human_as_noise();
            // Log-normal, of that mean
            let people: Vec<f64> = (0..400).map(|_| mean * (0.5 * noise.normal() - 0.125).exp()).collect();
            for level in zone.levels.iter().filter(|l| (l.spp / mean).ln().abs() < 8f64.ln()) {
                let p = f64::from(model.judge(&level.descriptor).probability_without_penalty);
                let content = people.iter().filter(|&&needs| needs <= level.spp).count();
                let bin = &mut bins[((p * 10.0) as usize).min(9)];
                *bin = (bin.0 + p, bin.1 + content as f64 / people.len() as f64, bin.2 + 1);
            }
        }
    }
    let levels: usize = bins.iter().map(|b| b.2).sum();
    let error = bins.iter().map(|b| (b.0 - b.1).abs()).sum::<f64>() / levels as f64;
    assert!(levels > 1000 && error < 0.03, "{levels} {error} {bins:?}");
}

/// The paper's machine on every third of the same levels, with one C and γ: with all of them it takes minutes, and the
/// search hours.
#[test]
fn a_support_vector_machine_predicts_left_out_scenes_too() {
    let params = TrainParams { candidates: vec![SvmParams { c: 0.3, gamma: 0.01 }], ..TrainParams::svm() };
    let mut table = table();
    for zone in &mut table.zones {
        let mut number = 0..;
        zone.levels.retain(|_| number.next().is_some_and(|n| n % 3 == 0));
    }
    let predictions = leave_one_scene_out(&table, &params, People::DEFAULT, |_| ()).unwrap();
    let scores = score(predictions.iter());
    assert!(scores.error_factor < 1.5 && scores.early_share <= 0.05, "{scores:?}");
}

/// The published score with everything chosen without the scene that is predicted.
#[test]
fn with_blind_choices_the_vision_model_errs_less_than_one_noise_level() {
    let every = fixture("human-choices.csv");
    let params = TrainParams::for_descriptor(&every.descriptor);
    assert_eq!((every.zones.len(), every.groups().len()), (167, 10));
    let all = choices(&every).unwrap();
    let (predictions, chosen) = choose_and_leave_out(&all, &params, People::DEFAULT, |_| ()).unwrap();
    assert_eq!(chosen.len(), 10);
    let (ours, constant) = (score(predictions.iter()), score(constant_noise_baseline(&every).iter()));
    assert!(ours.error_factor < 1.33 && ours.early_share <= 0.02, "{ours:?} {chosen:?}");
    assert!(constant.error_factor > 1.5, "{constant:?}");

    // The table of the model that is shipped is one of the choices
    let shipped = table();
    let same = all.iter().find(|c| c.table.descriptor == shipped.descriptor).unwrap();
    assert_eq!(shipped.zones.len(), same.table.zones.len());
    for ours in &shipped.zones {
        let same_zone = |z: &&noisefloor_learn::Zone| (&z.scene, z.zone) == (&ours.scene, ours.zone);
        let theirs = same.table.zones.iter().find(same_zone).unwrap();
        for (a, b) in ours.levels.iter().zip(&theirs.levels) {
            assert_eq!((&ours.scene, ours.zone, a.spp), (&theirs.scene, theirs.zone, b.spp), "{}", same.name);
            // Areas were pixels there, and are equal here: sums round otherwise
            let close = |(a, b): (&f32, &f32)| (a - b).abs() < 1e-5;
            assert!(a.descriptor.iter().zip(&b.descriptor).all(close), "{a:?} {b:?}");
        }
    }
}
