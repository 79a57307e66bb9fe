//! How often the intervals of an analysis hold the truth: prints the table in docs/studies.md. Takes minutes. A
//! text restricts it to the rows whose names contain it.
//!
//! ```sh
//! cargo run --release -p noisefloor-study --example coverage -- 120
//! cargo run --release -p noisefloor-study --example coverage -- 400 "24 levels, 33 observers"
//! ```

#![allow(clippy::print_stdout, clippy::expect_used, reason = "prints a table")]

mod kit;

use kit::{papers_levels, simulate, study};
use noisefloor_study::Study;
use noisefloor_study::simulated::{Public, SpreadShape};
use std::sync::Arc;

fn public(shape: SpreadShape, within: f64, lapse: f64) -> Public {
    Public {
        thresholds: vec![vec![1000.0, 2500.0]],
        shape,
        between: 0.25,
        by_place: 0.0,
        within,
        lapse,
        bias: 0.0,
    }
}

/// Levels that grow by a factor of 1.35, from 10 on, as an ordinary study has them.
fn geometric_levels() -> Vec<u64> {
    (0..24).map(|i| (10.0 * 1.35f64.powi(i)).round() as u64).collect()
}

/// Shares of intervals that hold the median and the 95 % level of `truth`, and the mean ratio of the latter
/// to it.
fn coverage(study: &Arc<Study>, drawn: &Public, truth: &Public, observers: u64, studies: u64) -> String {
    let truths: Vec<[f64; 2]> = (0..2).map(|t| [0.5, 0.95].map(|s| truth.quantile(0, t, s))).collect();
    let (mut median, mut level95, mut below, mut ratio) = (0, 0, 0, 0.0);
    let (mut width, mut intervals) = (0.0, 0.0);
    for seed in 0..studies {
        for tile in &simulate(study, drawn, observers, seed).0.tiles {
            let holds = |i: Option<[f64; 2]>, t: f64| i.is_some_and(|[low, high]| low <= t && t <= high);
            median += u64::from(holds(tile.median_interval, truths[tile.tile][0]));
            level95 += u64::from(holds(tile.level95_interval, truths[tile.tile][1]));
            // The screening may leave too few observers for an interval, which then does not hold the truth
            if let Some([low, high]) = tile.level95_interval {
                below += u64::from(high < truths[tile.tile][1]);
                width += (high / low).ln();
                intervals += 1.0;
            }
            ratio += (tile.level95 / truths[tile.tile][1]).ln();
        }
    }
    let n = 2.0 * studies as f64;
    let share = |count: u64| 100.0 * count as f64 / n;
    format!(
        "median {:.1} %, 95 % level {:.1} % ({:.1} % too low, {:.1} % none), estimated/true {:.3}, width x{:.2}",
        share(median),
        share(level95),
        share(below),
        100.0 * (1.0 - intervals / n),
        (ratio / n).exp(),
        (width / intervals).exp()
    )
}

fn main() {
    let studies = std::env::args().nth(1).and_then(|n| n.parse().ok()).unwrap_or(200);
    let wanted = std::env::args().nth(2).unwrap_or_default();
    let say = |name: String, found: &dyn Fn() -> String| {
        if name.contains(&wanted) {
            println!("{name}: {}", found());
        }
    };
    let all = [SpreadShape::Logistic, SpreadShape::Normal, SpreadShape::Lognormal, SpreadShape::Gamma];
    for (name, levels) in [("24 levels", geometric_levels()), ("100 levels", papers_levels())] {
        let (_dir, acquisition) = study("acquisition", &levels, "");
        for shape in all {
            let public = public(shape, 0.1, 0.01);
            let found = || coverage(&acquisition, &public, &public, 33, studies);
            say(format!("{name}, 33 observers, {shape:?}"), &found);
        }
        for (observers, within, lapse) in
            [(8, 0.1, 0.02), (12, 0.1, 0.02), (100, 0.1, 0.02), (33, 0.25, 0.05)]
        {
            let public = public(SpreadShape::Logistic, within, lapse);
            let found = || coverage(&acquisition, &public, &public, observers, studies / 2);
            say(format!("{name}, {observers} observers, within {within}, slips {lapse}"), &found);
        }
    }
    // A forced choice measures the observer alone: the spread from showing to showing does not enter
    let (_dir, choice) = study("forced-choice", &papers_levels(), "");
    for shape in [SpreadShape::Logistic, SpreadShape::Lognormal] {
        let (drawn, truth) = (public(shape, 0.1, 0.02), public(shape, 0.0, 0.02));
        let found = || coverage(&choice, &drawn, &truth, 33, studies / 8);
        say(format!("forced choice, 33 observers, {shape:?}"), &found);
    }
}
