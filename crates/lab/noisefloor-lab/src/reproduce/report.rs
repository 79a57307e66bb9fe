//! All results together: reproduce.json, and the tables that are printed and written to reproduce.md.

use super::job::Reproduction;
use super::outcome::{Count, MachineResult, ProtocolOutcome, QueryCost};
use super::protocol::PairProtocol;
use serde::Serialize;

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReproductionReport {
    /// Zones' edge in pixels.
    pub edge: usize,
    pub levels: usize,
    /// What to know before reading a number.
    pub notes: Vec<String>,
    /// One for each representation, scaling and protocol.
    pub outcomes: Vec<ProtocolOutcome>,
}

impl ReproductionReport {
    pub(super) fn new(job: &Reproduction, outcomes: Vec<ProtocolOutcome>) -> Self {
        let real = outcomes.first().map(|o| total(o).1).unwrap_or_default();
        let notes = vec![
            format!(
                "All levels that are learned are synthesised: \
                 {} a zone with equal steps up to its most converged image, \
                 noise ∝ 1/√n from two realisations in turn. Real images ({}) are asked about, \
                 never learned, and counted apart; \
                 but the noise that is laid over a scene is taken from them.",
                job.levels,
                real.noisy + real.identical,
            ),
            "Where a scene has no reference.exr, \
             the most converged image stands in for the ray-traced reference. \
             The paper's reference has no noise, and other light."
                .into(),
            "The paper states neither the scaling of its values nor which pairs its accuracy is of. Here: \
             display values, white at 1, \
             and each number standardised over all synthesised pairs (also those that are asked about); \
             and four ways to choose the pairs."
                .into(),
            "A pair is right if the sign of its decision value is. \
             \"Always identical\" is what a machine gets that never sees noise; \
             one that always sees it gets the rest."
                .into(),
            "Two machines train at once, where there are several.".into(),
        ];
        Self { edge: job.edge, levels: job.levels, notes, outcomes }
    }

    pub fn markdown(&self) -> String {
        let learned = self.outcomes.iter().flat_map(|o| &o.machines).map(|m| m.examples).max().unwrap_or(0);
        let mut text = format!("{learned} pairs of {e}×{e} pixels, C = 2, γ = 2.\n\n", e = self.edge);

        let shares = [SHARES, SHARES_OF_REAL].concat();
        let header = [&["pairs of", "values", "asked about"], &shares[..], &["support vectors"]].concat();
        text += &table(&header, self.outcomes.iter().map(scores).collect());
        text += "\n";

        let header =
            ["pairs of", "values", "distances, s", "training, s", "query, s", "model, MB", "f32 − f64"];
        let costs = self.outcomes.iter().filter_map(|o| o.query.as_ref().map(|q| cost(o, q)));
        text += &table(&header, costs.collect());
        text += "\n";

        let header = [&["pairs of", "values", "scene left out"], &shares[..]].concat();
        let left_out = self.outcomes.iter().filter(|o| o.of.protocol == PairProtocol::SceneLeftOut);
        text += &table(&header, left_out.flat_map(scenes).collect());
        text += "\n";
        for note in &self.notes {
            text += &format!("- {note}\n");
        }
        text
    }
}

const SHARES: [&str; 4] = ["right", "noisy right", "identical right", "always identical"];
const SHARES_OF_REAL: [&str; 4] =
    ["real images right", "of them noisy", "of them identical", "real, always identical"];

/// Synthesised and real pairs that were asked about, over all machines.
fn total(outcome: &ProtocolOutcome) -> (Count, Count) {
    let sum = |of: fn(&MachineResult) -> Count| outcome.machines.iter().map(of).sum();
    (sum(|m| m.synthesised), sum(|m| m.real))
}

fn percent(part: usize, all: usize) -> String {
    if all == 0 { "–".into() } else { format!("{:.2} %", 100.0 * part as f64 / all as f64) }
}

fn shares(count: Count) -> [String; 4] {
    let all = count.noisy + count.identical;
    [
        percent(count.noisy_right + count.identical_right, all),
        percent(count.noisy_right, count.noisy),
        percent(count.identical_right, count.identical),
        percent(count.identical, all),
    ]
}

fn what(outcome: &ProtocolOutcome) -> [String; 2] {
    let pairs = outcome.of.pairs.name.trim_end_matches("-pair");
    [pairs.to_owned(), outcome.of.scaling.name().to_owned()]
}

fn scores(outcome: &ProtocolOutcome) -> Vec<String> {
    let asked = match outcome.of.protocol {
        PairProtocol::Learned => "the pairs learned",
        PairProtocol::PairsHeldOut => "a fifth of the pairs, held out",
        PairProtocol::HalfTheScenes => "the other half of the scenes",
        PairProtocol::SceneLeftOut => "each scene, left out",
    };
    let vectors = |pick: fn(f64, f64) -> f64| {
        let shares = outcome.machines.iter().map(|m| m.support_vectors as f64 / m.examples as f64);
        100.0 * shares.reduce(pick).unwrap_or(0.0)
    };
    let vectors = match outcome.machines.as_slice() {
        [one] => format!("{} of {}", one.support_vectors, one.examples),
        _ => format!("{:.0}…{:.0} %", vectors(f64::min), vectors(f64::max)),
    };
    let (synthesised, real) = total(outcome);
    [&what(outcome)[..], &[asked.to_owned()], &shares(synthesised), &shares(real), &[vectors]].concat()
}

fn cost(outcome: &ProtocolOutcome, query: &QueryCost) -> Vec<String> {
    let [pairs, values] = what(outcome);
    let training: f64 = outcome.machines.iter().map(|m| m.seconds_training).sum();
    vec![
        pairs,
        values,
        format!("{:.0}", outcome.seconds_distances),
        format!("{training:.1}"),
        format!("{:.3}", query.seconds),
        format!("{:.0}", query.model_bytes as f64 / 1e6),
        format!("{:.0e}", query.largest_difference),
    ]
}

fn scenes(outcome: &ProtocolOutcome) -> Vec<Vec<String>> {
    let row = |machine: &MachineResult| {
        let [pairs, values] = what(outcome);
        [&[pairs, values, machine.asked.clone()][..], &shares(machine.synthesised), &shares(machine.real)]
            .concat()
    };
    outcome.machines.iter().map(row).collect()
}

/// A Markdown table that reads well on a terminal, too.
fn table(header: &[&str], rows: Vec<Vec<String>>) -> String {
    let width = |(column, name): (usize, &&str)| {
        let cells = rows.iter().map(|row| row[column].chars().count());
        cells.max().unwrap_or(0).max(name.chars().count())
    };
    let widths: Vec<usize> = header.iter().enumerate().map(width).collect();
    let line = |cells: Vec<String>| {
        let padded = cells.iter().zip(&widths).map(|(cell, width)| format!(" {cell:width$} "));
        format!("|{}|\n", padded.collect::<Vec<_>>().join("|"))
    };
    let rule = widths.iter().map(|&width| "-".repeat(width)).collect();
    let header = header.iter().map(|&name| name.to_owned()).collect();
    [header, rule].into_iter().chain(rows).map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_of_their_class() {
        let count = Count { noisy: 4, noisy_right: 1, identical: 12, identical_right: 9 };
        assert_eq!(shares(count), ["62.50 %", "25.00 %", "75.00 %", "75.00 %"]);
        assert_eq!(shares(Count::default()), ["–"; 4]);
    }

    #[test]
    fn tables_line_up() {
        let rows = vec![vec!["×1".to_owned(), "long".into()], vec!["2".into(), "x".into()]];
        assert_eq!(table(&["a", "b"], rows), "| a  | b    |\n| -- | ---- |\n| ×1 | long |\n| 2  | x    |\n");
    }
}
