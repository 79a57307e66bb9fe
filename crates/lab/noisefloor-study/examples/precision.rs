//! What a click is worth: prints the table in docs/studies.md. Takes minutes.
//!
//! ```sh
//! cargo run --release -p noisefloor-study --example precision
//! ```

#![allow(clippy::print_stdout, clippy::expect_used, reason = "prints a table")]

mod kit;

use kit::{papers_levels, simulate, study};
use noisefloor_study::Study;
use noisefloor_study::simulated::{Public, SpreadShape};
use std::sync::Arc;

const OBSERVERS: u64 = 200;

/// Levels that grow by a factor, from 10 on.
fn geometric_levels(count: i32, factor: f64) -> Vec<u64> {
    (0..count).map(|i| (10.0 * factor.powi(i)).round() as u64).collect()
}

/// Root mean square error of single observers' ln(threshold), and clicks per tile.
fn precision(study: &Arc<Study>, public: &Public) -> (f64, f64) {
    let (_, all) = simulate(study, public, OBSERVERS, 7);
    let (mut squares, mut clicks) = (0.0, 0);
    for (i, observer) in all.iter().enumerate() {
        let truth = public.draw(7000 + i as u64);
        for tile in 0..2 {
            let found = observer.threshold(study, (0, tile)).expect("every tile is answered").ln();
            squares += (found - truth.ln_threshold(0, tile as usize)).powi(2);
        }
        clicks += observer.clicks;
    }
    let n = 2.0 * OBSERVERS as f64;
    ((squares / n).sqrt(), clicks as f64 / n)
}

fn main() {
    for (name, levels) in
        [("100 levels, even", papers_levels()), ("24 levels, by 1.35", geometric_levels(24, 1.35))]
    {
        for (within, lapse, bias) in [(0.1, 0.0, 0.0), (0.1, 0.02, 0.0), (0.25, 0.02, 0.0), (0.1, 0.02, 0.2)]
        {
            let thresholds = vec![vec![1000.0, 2500.0]];
            let public = Public {
                thresholds,
                shape: SpreadShape::Logistic,
                between: 0.25,
                by_place: 0.0,
                within,
                lapse,
                bias,
            };
            let (_dir, pointing) = study("acquisition", &levels, "");
            let (error, clicks) = precision(&pointing, &public);
            println!("{name}, within {within}, slips {lapse}, bias {bias}");
            println!("    acquisition, twice: error {error:.3} with {clicks:.1} clicks per tile");
            for trials in [8, 12, 16, 24, 32, 48] {
                let (_dir, choosing) = study("forced-choice", &levels, &format!("trials = {trials}"));
                let (error, clicks) = precision(&choosing, &public);
                println!("    forced choice: error {error:.3} with {clicks:.1}");
            }
        }
    }
}
