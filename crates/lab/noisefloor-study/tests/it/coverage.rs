use crate::kit::{Folder, levels, stack};
use noisefloor_study::analysis::{AnalysisOptions, Observer, PeopleSpread, StudyReport, report, spreads};
use noisefloor_study::simulated::{Public, run};
use noisefloor_study::{ParticipantSession, Plan, Study, grids};
use std::sync::Arc;

/// So many simulated observers of a study, without a server.
fn observed(study: &Arc<Study>, public: &Public, observers: u64, seed: u64) -> Vec<Observer> {
    let grids = grids(study);
    let observe = |i: u64| {
        let seed = 1000 * seed + i;
        let mut session = ParticipantSession::new(study.clone(), grids.clone(), Plan::draw(study, seed));
        run(&mut session, &mut public.draw(seed)).unwrap();
        Observer::of(&format!("simulated {i}"), "", &session)
    };
    (0..observers).map(observe).collect()
}

fn reported(study: &Arc<Study>, public: &Public, observers: u64, seed: u64) -> StudyReport {
    let options = AnalysisOptions { keep_excluded: false, seed, simulated: true };
    report(study, &observed(study, public, observers, seed), options)
}

/// Shares of intervals that hold the truth: of the median, and of the level where 95 % see no difference;
/// and the mean ratio of the latter to the truth. Studies are of the two publics in turn.
fn coverage(study: &Arc<Study>, publics: [Public; 2], observers: u64, studies: u64) -> (f64, f64, f64) {
    let truths = publics.each_ref().map(|public| [0.5, 0.95].map(|share| public.quantile(0, 0, share)));
    let (mut median, mut level95, mut ratio) = (0.0, 0.0, 0.0);
    for seed in 0..studies {
        let (public, truth) = (&publics[seed as usize % 2], truths[seed as usize % 2]);
        let tile = &reported(study, public, observers, seed).tiles[0];
        let holds = |low: Option<f64>, high: Option<f64>, truth: f64| {
            f64::from(low.zip(high).is_some_and(|(low, high)| low <= truth && truth <= high))
        };
        median += holds(tile.median_low, tile.median_high, truth[0]);
        level95 += holds(tile.level95_low, tile.level95_high, truth[1]);
        ratio += (tile.level95 / truth[1]).ln();
    }
    let n = studies as f64;
    (median / n, level95 / n, (ratio / n).exp())
}

/// The paper's hundred levels, 100 to 10 000 samples per pixel, and thresholds in the range that it found.
fn papers(protocol: &str, size: (usize, usize)) -> (Folder, Arc<Study>) {
    let levels: Vec<u64> = (1..=100).map(|i| 100 * i).collect();
    let folder = Folder::new(protocol, &["wall"], &levels, "");
    stack(&folder.dir.path().join("wall"), size, &levels);
    let study = folder.study();
    (folder, study)
}

fn public(within: f64, lapse: f64) -> Public {
    Public { between: 0.25, within, lapse, ..Public::of(vec![vec![1000.0, 2500.0]]) }
}

/// 33 observers, as in the paper. Of 40 studies of a tile, 95 % of intervals should hold the truth: a share below
/// 0.83 comes by chance once in 300 if 95 % is true, and once in 50 if the intervals hold in 93 %. Seeded: it does so
/// never or always.
#[test]
fn intervals_hold_the_truth_about_as_often_as_they_say() {
    let (_folder, study) = papers("acquisition", (32, 32));
    let publics = [1000.0, 2500.0].map(|t| Public { thresholds: vec![vec![t]], ..public(0.1, 0.0) });
    let (median, level95, ratio) = coverage(&study, publics, 33, 40);
    println!("coverage: median {median:.3}, level of 95 % {level95:.3}, ratio {ratio:.3}");
    assert!(median >= 0.83 && level95 >= 0.83, "{median} {level95}");
    assert!((ratio - 1.0).abs() < 0.1, "{ratio}");
}

/// Levels by ×1.35: a chosen level is the first above a threshold, ×1.17 too high in the mean. With 33 observers of a spread
/// of 0.45 in ln(spp), the mean over twelve studies is known to 0.45/√396 = 0.023, times 3.
#[test]
fn means_are_those_of_thresholds_not_of_levels() {
    let folder = Folder::new("acquisition", &["wall"], &levels(24, 1.35), "");
    let (study, public) = (folder.study(), public(0.1, 0.0));
    let truths = [0, 1].map(|tile| public.levels(0, tile)[1]);
    let (mut ratio, mut holds) = (0.0, 0);
    for seed in 0..12 {
        for tile in &reported(&study, &public, 33, seed).tiles {
            let truth = truths[tile.tile];
            ratio += (tile.mean / truth).ln() / 24.0;
            let interval = tile.mean_low.zip(tile.mean_high);
            holds += usize::from(interval.is_some_and(|(low, high)| low <= truth && truth <= high));
        }
    }
    println!("mean: ratio {:.3}, intervals that hold it {holds} of 24", f64::exp(ratio));
    assert!(ratio.abs() < 0.07, "{ratio}");
    // Of 12 independent ones, each 0.9 at least: fewer than 8 by chance once in 200
    assert!(holds >= 16, "{holds}");
}

/// Root mean square error of single observers' ln(threshold), and clicks a tile.
fn precision(study: &Arc<Study>, public: &Public, observers: u64) -> (f64, f64) {
    let all = observed(study, public, observers, 7);
    let mut squares = 0.0;
    for (i, observer) in all.iter().enumerate() {
        let truth = public.draw(7000 + i as u64);
        for tile in 0..2 {
            let found = observer.threshold(study, (0, tile)).unwrap().ln();
            squares += (found - truth.ln_threshold(0, tile as usize)).powi(2);
        }
    }
    let clicks: u64 = all.iter().map(|o| o.clicks).sum();
    ((squares / (2.0 * observers as f64)).sqrt(), clicks as f64 / (2.0 * observers as f64))
}

/// What a click is worth. On the paper's linear stack, observers whose threshold varies by a scale of 0.1
/// from showing to showing, and who slip in 2 % of their answers: the forced choice errs less than pointing
/// does, with fewer clicks. Without slips the two are about equal. 100
/// observers with two tiles; seeded.
#[test]
fn forced_choice_needs_fewer_clicks_for_the_same_precision() {
    let public = public(0.1, 0.02);
    let (_folder, pointing) = papers("acquisition", (64, 32));
    let (pointing_error, pointing_clicks) = precision(&pointing, &public, 100);
    let (_folder, choosing) = papers("forced-choice", (64, 32));
    let (choosing_error, choosing_clicks) = precision(&choosing, &public, 100);
    println!(
        "pointing: {pointing_error:.3} with {pointing_clicks:.1} clicks; \
         choosing: {choosing_error:.3} with {choosing_clicks:.1}"
    );
    assert!(choosing_clicks < pointing_clicks && choosing_error < pointing_error);
}

/// The study that measures people's scatter, in small: levels by ×1.35, six stacks with two tiles each, shown twice.
fn spread_study() -> (Folder, Arc<Study>) {
    let levels: Vec<u64> = (0..20).map(|i| (8.0 * 1.35f64.powi(i)).round() as u64).collect();
    let names = ["a", "b", "c", "d", "e", "f"];
    let rules = "[screening]\nbt500 = false\noutlying = 1000.0\n";
    let folder = Folder::new("acquisition", &names, &levels, "");
    let text = std::fs::read_to_string(&folder.file).unwrap();
    std::fs::write(&folder.file, text + rules).unwrap();
    let study = folder.study();
    (folder, study)
}

/// People who differ by so much in one place, and slip in 1 % of their answers.
fn spread_by(study: &Study, deviation: f64) -> Public {
    let within = Public::made_up(study).spread_by(deviation);
    // Thresholds of noisy pictures and of denoised ones differ in level alone; every tile has one of its own
    let thresholds = (0..6).map(|s| vec![110.0 + 20.0 * f64::from(s), 260.0 - 20.0 * f64::from(s)]).collect();
    Public { thresholds, ..within }
}

fn found_spread(study: &Arc<Study>, public: &Public, observers: u64, seed: u64) -> PeopleSpread {
    let all = observed(study, public, observers, seed);
    spreads(study, &all.iter().collect::<Vec<_>>()).swap_remove(0)
}

/// Twelve people and twelve tiles, 30 studies of each spread: the variance is found on average, and its intervals hold
/// the truth. The square of one study's estimate scatters by some 35 %, the mean of 30 by 6.4 %: 3.5 of
/// these are 22 %. Of 30 intervals that hold it in 93 of 100 cases, fewer than 23 do once in 800. Seeded.
#[test]
fn the_spread_of_people_is_found() {
    let (_folder, study) = spread_study();
    for truth in [0.3, 0.5, 0.7] {
        let public = spread_by(&study, truth);
        assert!((public.deviation() - truth).abs() < 1e-9);
        let found: Vec<PeopleSpread> = (0..30).map(|seed| found_spread(&study, &public, 12, seed)).collect();
        let mean = |of: fn(&PeopleSpread) -> f64| found.iter().map(of).sum::<f64>() / found.len() as f64;
        let ratio = mean(|s| s.people * s.people) / (truth * truth);
        let held =
            found.iter().filter(|s| s.interval.is_some_and(|[low, high]| low <= truth && truth <= high));
        let held = held.count();
        println!("{truth}: variance ×{ratio:.3}, {held} of 30 intervals, within {:.3}", mean(|s| s.within));
        assert!((ratio - 1.0).abs() < 0.22 && held >= 23, "{truth}: {ratio} {held}");
        // Slips and showings are not people's: 0.1·π/√3 by showing, and slips anywhere on the stack
        assert!(mean(|s| s.within) > 0.15);
        // A tile whose median comes near an end of the stack is left out
        assert!(found.iter().all(|s| s.observers == 12 && s.tiles + s.left_out == 12 && s.tiles >= 9));
    }
}

/// What no showing has alone: people who differ in nothing but slips and showings are found to be alike.
#[test]
fn showings_and_slips_are_no_spread_of_people() {
    let (_folder, study) = spread_study();
    let public = Public { within: 0.2, lapse: 0.05, ..spread_by(&study, 0.0) };
    let found = found_spread(&study, &public, 24, 1);
    // By showing 0.2·π/√3 = 0.36, slips of 5 % over 5.7 in ln(samples) 0.38 more; covariances over 24·12 pairs are 0
    // to within 0.28/√288 = 0.017, a deviation of 0.13
    assert!(found.people < 0.2 && found.within > 0.3, "{found:?}");
}
