//! How often the intervals of an analysis hold the truth: prints the table in docs/study.md. Takes minutes.
//!
//! ```sh
//! cargo run --release -p noisefloor-study --example coverage
//! ```

#![allow(clippy::print_stdout, clippy::expect_used, reason = "prints a table")]

mod kit;

use kit::{papers_levels, simulate, study};
use noisefloor_study::Study;
use noisefloor_study::simulated::{Public, SpreadShape};
use std::sync::Arc;

fn public(within: f64, lapse: f64) -> Public {
    Public {
        thresholds: vec![vec![1000.0, 2500.0]],
        shape: SpreadShape::Logistic,
        between: 0.25,
        within,
        lapse,
        bias: 0.0,
    }
}

/// Shares of intervals that hold the median and the 95 % level of `truth`, and the mean ratio of the latter
/// to it.
fn coverage(study: &Arc<Study>, drawn: &Public, truth: &Public, observers: u64, studies: u64) -> String {
    let truths: Vec<[f64; 2]> = (0..2).map(|t| [0.5, 0.95].map(|s| truth.quantile(0, t, s))).collect();
    let (mut median, mut level95, mut ratio) = (0, 0, 0.0);
    for seed in 0..studies {
        for tile in &simulate(study, drawn, observers, seed).0.tiles {
            let holds = |i: Option<[f64; 2]>, t: f64| i.is_some_and(|[low, high]| low <= t && t <= high);
            median += u64::from(holds(tile.median_interval, truths[tile.tile][0]));
            level95 += u64::from(holds(tile.level95_interval, truths[tile.tile][1]));
            ratio += (tile.level95 / truths[tile.tile][1]).ln();
        }
    }
    let n = 2.0 * studies as f64;
    let share = |count: u64| 100.0 * count as f64 / n;
    format!(
        "median {:.1} %, 95 % level {:.1} %, estimated/true {:.3}",
        share(median),
        share(level95),
        (ratio / n).exp()
    )
}

fn main() {
    let (_dir, acquisition) = study("acquisition", &papers_levels(), "");
    for (observers, within, lapse) in [
        (33, 0.0, 0.0),
        (33, 0.1, 0.0),
        (33, 0.1, 0.02),
        (33, 0.1, 0.05),
        (33, 0.25, 0.02),
        (12, 0.1, 0.02),
        (100, 0.1, 0.02),
    ] {
        let public = public(within, lapse);
        let found = coverage(&acquisition, &public, &public, observers, 200);
        println!("acquisition, {observers} observers, within {within}, slips {lapse}: {found}");
    }
    // A forced choice measures the observer alone: the spread from showing to showing does not enter
    let (_dir, choice) = study("forced-choice", &papers_levels(), "");
    for within in [0.1, 0.25] {
        let found = coverage(&choice, &public(within, 0.02), &public(0.0, 0.02), 33, 100);
        println!("forced choice, 33 observers, within {within}, slips 0.02: {found}");
    }
}
