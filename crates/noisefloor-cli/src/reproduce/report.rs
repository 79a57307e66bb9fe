//! All results together: reproduce.json, and the tables that are printed and written to reproduce.md.

use super::outcome::{Count, Outcome, Query};
use super::protocol::Protocol;
use crate::args::ReproduceArgs;
use serde::Serialize;

#[derive(Serialize)]
pub struct Report {
    /// Zones' edge in pixels.
    edge: usize,
    /// Levels a zone.
    levels: usize,
    /// What to know before reading a number.
    notes: Vec<String>,
    outcomes: Vec<Outcome>,
}

impl Report {
    pub fn new(args: &ReproduceArgs, outcomes: Vec<Outcome>) -> Self {
        let real = outcomes.first().map(|o| total(o).1).unwrap_or_default();
        let notes = vec![
            format!(
                "All levels that are learned are synthesised: {} a zone with equal steps up to its most converged image, noise ∝ 1/√n \
                 from two realisations in turn. Real images ({}) are asked about, never learned, and counted apart.",
                args.levels,
                real.noisy + real.identical,
            ),
            "No ray-traced reference exists for these scenes: the most converged image stands in for it. The paper's reference has no \
             noise, and other light."
                .into(),
            "The paper states neither the scaling of its values nor which pairs its accuracy is of. Here: display values, white at 1, and \
             each number standardised over all synthesised pairs (also those that are asked about); and four ways to choose the pairs."
                .into(),
            "A pair is right if the sign of its decision value is. \"Always identical\" is what a machine gets that never sees noise; one \
             that always sees it gets the rest."
                .into(),
            "Two machines train at once, where there are several.".into(),
        ];
        Self { edge: args.edge, levels: args.levels, notes, outcomes }
    }

    pub fn markdown(&self) -> String {
        let mut text = format!(
            "{} pairs of {e}×{e} pixels a representation, C = 2, γ = 2.\n\n",
            self.outcomes.first().map_or(0, |o| o.machines.iter().map(|m| m.examples).max().unwrap_or(0)),
            e = self.edge,
        );
        let header = [
            "pairs of",
            "values",
            "asked about",
            "right",
            "noisy right",
            "identical right",
            "always identical",
            "real images right",
            "of them noisy",
            "identical",
            "always identical",
            "support vectors",
        ];
        text += &table(&header, self.outcomes.iter().map(scores).collect());
        text += "\n";
        let header = [
            "pairs of",
            "values",
            "distances, s",
            "coordinates",
            "s",
            "training, s",
            "query, s",
            "model, MB",
            "f32 − f64",
        ];
        let costs = self.outcomes.iter().filter_map(|o| o.query.as_ref().map(|q| cost(o, q)));
        text += &table(&header, costs.collect());
        text += "\n";
        let left_out = self.outcomes.iter().filter(|o| o.of.protocol == Protocol::SceneLeftOut);
        let header = [
            "pairs of",
            "values",
            "scene left out",
            "right",
            "noisy right",
            "identical right",
            "always identical",
            "real images right",
            "of them noisy",
            "identical",
            "always identical",
        ];
        text += &table(&header, left_out.flat_map(scenes).collect());
        text += "\n";
        for note in &self.notes {
            text += &format!("- {note}\n");
        }
        text
    }
}

/// Synthesised and real pairs that were asked about, over all machines.
fn total(outcome: &Outcome) -> (Count, Count) {
    let sum = |of: fn(&super::outcome::Machine) -> Count| {
        outcome.machines.iter().map(of).fold(Count::default(), Count::add)
    };
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

fn what(outcome: &Outcome) -> Vec<String> {
    let pairs = outcome.of.pairs.name().trim_end_matches("-pair");
    vec![pairs.to_owned(), outcome.of.scaling.name().to_owned()]
}

fn scores(outcome: &Outcome) -> Vec<String> {
    let asked = match outcome.of.protocol {
        Protocol::Learned => "the pairs learned",
        Protocol::PairsHeldOut => "a fifth of the pairs, held out",
        Protocol::HalfTheScenes => "the other half of the scenes",
        Protocol::SceneLeftOut => "each scene, left out",
    };
    let (synthesised, real) = total(outcome);
    let vectors = |pick: fn(f64, f64) -> f64| {
        let shares = outcome.machines.iter().map(|m| m.support_vectors as f64 / m.examples as f64);
        shares.reduce(pick).unwrap_or(0.0)
    };
    let vectors = match outcome.machines.as_slice() {
        [one] => format!("{} of {}", one.support_vectors, one.examples),
        _ => format!("{:.0}…{:.0} %", 100.0 * vectors(f64::min), 100.0 * vectors(f64::max)),
    };
    let mut row = what(outcome);
    row.push(asked.into());
    row.extend(shares(synthesised));
    row.extend(shares(real));
    row.push(vectors);
    row
}

fn cost(outcome: &Outcome, query: &Query) -> Vec<String> {
    let mut row = what(outcome);
    row.extend([
        format!("{:.0}", outcome.seconds_distances),
        format!("{:.1}", outcome.machines.iter().map(|m| m.seconds_training).sum::<f64>()),
        format!("{:.3}", query.seconds),
        format!("{:.0}", query.model_bytes as f64 / 1e6),
        format!("{:.0e}", query.largest_difference),
    ]);
    row
}

fn scenes(outcome: &Outcome) -> Vec<Vec<String>> {
    let row = |machine: &super::outcome::Machine| {
        let mut row = what(outcome);
        row.push(machine.asked.clone());
        row.extend(shares(machine.synthesised));
        row.extend(shares(machine.real));
        row
    };
    outcome.machines.iter().map(row).collect()
}

/// A Markdown table that reads well on a terminal, too.
fn table(header: &[&str], rows: Vec<Vec<String>>) -> String {
    let width = |column: usize| {
        let cells = rows.iter().filter_map(|r| r.get(column)).map(|cell| cell.chars().count());
        cells.chain([header[column].chars().count()]).max().unwrap_or(0)
    };
    let widths: Vec<usize> = (0..header.len()).map(width).collect();
    let line = |cells: &[String]| {
        let padded = cells.iter().zip(&widths).map(|(cell, width)| format!(" {cell:width$} "));
        format!("|{}|\n", padded.collect::<Vec<_>>().join("|"))
    };
    let rule: Vec<String> = widths.iter().map(|&width| "-".repeat(width)).collect();
    let header: Vec<String> = header.iter().map(ToString::to_string).collect();
    let rows = rows.iter().map(|row| line(row)).collect::<String>();
    line(&header) + &line(&rule) + &rows
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
