//! What a session says of each mistake in a picture with a lamp in view, the built-in Cornell box:
//! `fed_wrongly [EDGE [SEEDS]]` prints the table of the guide to embedding, for square pictures in tiles of 64
//! pixels and up to 512 samples.
#![allow(clippy::print_stdout, reason = "an example prints")]

use noisefloor_ptwne::{Ptwne, RenderOptions, Sampling, scenes};
use noisefloor_tests::mistakes::{Mistake, Outcome, Samples, feed};
use std::collections::BTreeMap;

fn main() {
    let mut numbers = std::env::args().skip(1).map(|word| word.parse().expect("a number"));
    let (edge, seeds) = (numbers.next().unwrap_or(128), numbers.next().unwrap_or(4) as u64);
    println!("| pushed | in | said, at spp, of {seeds} seeds | first stop |\n|---|---|---|---|");
    let renders: Vec<Samples> = (0..seeds)
        .map(|seed| {
            let options = RenderOptions { sampling: Sampling::Independent, seed, ..RenderOptions::default() };
            let scene = scenes::by_name("cornell-box").expect("built in");
            Samples::of(Ptwne::new(scene, edge, edge, options).expect("a renderer"), 512)
        })
        .collect();
    for mistake in Mistake::ALL {
        for (passes, how) in [(None, "batches asked for"), (Some(16), "passes of 16")] {
            let outcomes: Vec<Outcome> =
                renders.iter().map(|samples| feed(samples, 64, mistake, passes)).collect();
            println!(
                "| {mistake:?} | {how} | {} | {} |",
                said(&outcomes),
                span(outcomes.iter().filter_map(|o| o.first_stop))
            );
        }
    }
}

/// Each kind of thing said, with how often and at which samples per pixel.
fn said(outcomes: &[Outcome]) -> String {
    let mut kinds: BTreeMap<String, Vec<u64>> = BTreeMap::new();
    for outcome in outcomes {
        for (at, warning) in &outcome.warnings {
            let kind = format!("{warning:?}");
            kinds.entry(kind.split('(').next().unwrap_or_default().to_owned()).or_default().push(*at);
        }
        if let Some((at, _)) = outcome.fault {
            kinds.entry("error".into()).or_default().push(at);
        }
    }
    let kind =
        |(kind, at): (String, Vec<u64>)| format!("{kind} {}× at {}", at.len(), span(at.iter().copied()));
    kinds.into_iter().map(kind).collect::<Vec<_>>().join(", ")
}

fn span(numbers: impl Iterator<Item = u64> + Clone) -> String {
    match (numbers.clone().min(), numbers.max()) {
        (Some(least), Some(most)) if least == most => least.to_string(),
        (Some(least), Some(most)) => format!("{least} to {most}"),
        _ => "–".into(),
    }
}
