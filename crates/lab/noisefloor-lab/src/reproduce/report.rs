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

        let [right, noisy, identical, always] = SHARES;
        let [real, real_noisy, real_identical, real_always] = SHARES_OF_REAL;
        let header = [
            "pairs of",
            "values",
            "asked about",
            right,
            noisy,
            identical,
            always,
            real,
            real_noisy,
            real_identical,
            real_always,
            "support vectors",
        ];
        text += &table(header, self.outcomes.iter().map(scores).collect());
        text += "\n";

        let header =
            ["pairs of", "values", "distances, s", "training, s", "query, s", "model, MB", "f32 − f64"];
        let costs = self.outcomes.iter().filter_map(|o| o.query.as_ref().map(|q| cost(o, q)));
        text += &table(header, costs.collect());
        text += "\n";

        let header = [
            "pairs of",
            "values",
            "scene left out",
            right,
            noisy,
            identical,
            always,
            real,
            real_noisy,
            real_identical,
            real_always,
        ];
        let left_out = self.outcomes.iter().filter(|o| o.of.protocol == PairProtocol::SceneLeftOut);
        text += &table(header, left_out.flat_map(scenes).collect());
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

fn scores(outcome: &ProtocolOutcome) -> [String; 12] {
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
    let [pairs, values] = what(outcome);
    let (synthesised, real) = total(outcome);
    let ([a, b, c, d], [e, f, g, h]) = (shares(synthesised), shares(real));
    [pairs, values, asked.to_owned(), a, b, c, d, e, f, g, h, vectors]
}

fn cost(outcome: &ProtocolOutcome, query: &QueryCost) -> [String; 7] {
    let [pairs, values] = what(outcome);
    let training: f64 = outcome.machines.iter().map(|m| m.seconds_training).sum();
    [
        pairs,
        values,
        format!("{:.0}", outcome.seconds_distances),
        format!("{training:.1}"),
        format!("{:.3}", query.seconds),
        format!("{:.0}", query.model_bytes as f64 / 1e6),
        format!("{:.0e}", query.largest_difference),
    ]
}

fn scenes(outcome: &ProtocolOutcome) -> Vec<[String; 11]> {
    let row = |machine: &MachineResult| {
        let [pairs, values] = what(outcome);
        let ([a, b, c, d], [e, f, g, h]) = (shares(machine.synthesised), shares(machine.real));
        [pairs, values, machine.asked.clone(), a, b, c, d, e, f, g, h]
    };
    outcome.machines.iter().map(row).collect()
}

/// A Markdown table that reads well on a terminal, too.
fn table<const COLUMNS: usize>(header: [&str; COLUMNS], rows: Vec<[String; COLUMNS]>) -> String {
    let width = |column: usize| {
        let cells = rows.iter().map(|r| r[column].chars().count());
        cells.chain([header[column].chars().count()]).max().unwrap_or(0)
    };
    let widths: [usize; COLUMNS] = std::array::from_fn(width);
    let line = |cells: &[String; COLUMNS]| {
        let padded = cells.iter().zip(widths).map(|(cell, width)| format!(" {cell:width$} "));
        format!("|{}|\n", padded.collect::<Vec<_>>().join("|"))
    };
    let rule = widths.map(|width| "-".repeat(width));
    line(&header.map(str::to_owned)) + &line(&rule) + &rows.iter().map(line).collect::<String>()
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
        let rows = vec![["×1".to_owned(), "long".into()], ["2".into(), "x".into()]];
        assert_eq!(table(["a", "b"], rows), "| a  | b    |\n| -- | ---- |\n| ×1 | long |\n| 2  | x    |\n");
    }
}
