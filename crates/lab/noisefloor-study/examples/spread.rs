//! How many people it takes to measure how far people lie from each other: prints the table of the guide to studies.
//! Takes minutes.
//!
//! ```sh
//! cargo run --release -p noisefloor-study --example spread -- 200
//! ```

#![allow(clippy::print_stdout, clippy::expect_used, reason = "prints a table")]

use noisefloor_image::write_png;
use noisefloor_study::analysis::{Observer, PeopleSpread, spreads};
use noisefloor_study::simulated::{Public, SpreadShape, run};
use noisefloor_study::{ParticipantSession, Plan, Study, grids};
use std::sync::Arc;
use tempfile::TempDir;

/// A study of one stack with this many tiles. The pictures are grey: simulated observers do not look at them.
fn study_of(levels: &[u64], tiles: usize) -> (TempDir, Arc<Study>) {
    let dir = tempfile::tempdir().expect("a temporary folder");
    let stack = dir.path().join("wall");
    std::fs::create_dir(&stack).expect("a folder for the stack");
    for spp in levels {
        let grey = vec![128; 3 * 16 * tiles * 16];
        write_png(stack.join(format!("{spp:05}.png")), 16 * tiles, 16, &grey).expect("a picture");
    }
    let text = "protocol = \"acquisition\"\ndatabase = \"answers.sqlite\"\ntile = 16\n\
                [text.en]\ntitle = \"Walls\"\nconsent = \"I take part.\"\n\
                [[stack]]\nname = \"wall\"\nfolder = \"wall\"\n";
    let file = dir.path().join("study.toml");
    std::fs::write(&file, text).expect("a study file");
    (dir, Arc::new(Study::open(file).expect("a valid study")))
}

/// Those of `study stack`.
fn levels() -> Vec<u64> {
    (0..20).map(|i| (8.0 * 1.35f64.powi(i)).round() as u64).collect()
}

fn observers(study: &Arc<Study>, public: &Public, count: u64, seed: u64) -> Vec<Observer> {
    let grids = grids(study);
    let observe = |i: u64| {
        let seed = 1000 * seed + i;
        let mut session = ParticipantSession::new(study.clone(), grids.clone(), Plan::draw(study, seed));
        run(&mut session, &mut public.draw(seed)).expect("simulated observers answer what is asked");
        Observer::of(&format!("simulated {i}"), "", &session)
    };
    (0..count).map(observe).collect()
}

fn main() {
    let studies: u64 = std::env::args().nth(1).and_then(|n| n.parse().ok()).unwrap_or(200);
    println!("| people | found: mean, scatter | within ±0.05 | intervals that hold it; median half-width |");
    println!("|---|---|---|---|");
    let (truth, tiles) = (0.5, 24);
    for (shape, words) in [(SpreadShape::Logistic, ""), (SpreadShape::Lognormal, ", lognormal")] {
        for people in [10, 20, 40, 80] {
            let (_dir, study) = study_of(&levels(), tiles);
            let thresholds = vec![(0..tiles).map(|t| 90.0 * 2f64.powf(t as f64 / tiles as f64)).collect()];
            let public = Public { thresholds, shape, ..Public::made_up(&study).spread_by(truth) };
            let found: Vec<PeopleSpread> = (0..studies)
                .map(|seed| {
                    let all = observers(&study, &public, people, seed);
                    spreads(&study, &all.iter().collect::<Vec<_>>()).swap_remove(0)
                })
                .collect();
            let n = studies as f64;
            let mean = found.iter().map(|s| s.people).sum::<f64>() / n;
            let scatter = (found.iter().map(|s| (s.people - mean).powi(2)).sum::<f64>() / n).sqrt();
            let share = |of: &dyn Fn(&PeopleSpread) -> bool| {
                100.0 * found.iter().filter(|s| of(s)).count() as f64 / n
            };
            let near = share(&|s| (s.people - truth).abs() <= 0.05);
            let held = share(&|s| s.interval.is_some_and(|[low, high]| low <= truth && truth <= high));
            let mut widths: Vec<f64> =
                found.iter().filter_map(|s| s.interval.map(|[low, high]| 0.5 * (high - low))).collect();
            widths.sort_by(f64::total_cmp);
            println!(
                "| {people}{words} | {mean:.2}, {scatter:.2} | {near:.0} % | {held:.0} %; ±{:.2} |",
                widths[widths.len() / 2]
            );
        }
    }
}
