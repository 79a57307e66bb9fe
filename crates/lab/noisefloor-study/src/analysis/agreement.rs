//! Agreement of observers with themselves and with each other.

use super::observers::{Observer, places};
use super::summary::{median, pearson};
use crate::config::Study;
use crate::stack::ln_spp;
use serde::Serialize;

/// Agreement of observers with themselves, over the first two showings of each tile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RepeatAgreement {
    pub pairs: usize,
    /// exp(median |ln ratio|) of the two thresholds: 1 if they are equal.
    pub factor: f64,
    /// Share of pairs that stop at most one level apart.
    pub within_one_level: f64,
    /// Pearson correlation of ln(threshold); `None` if one side is constant.
    pub correlation: Option<f64>,
}

/// Agreement of observers with each other.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BetweenObservers {
    /// Observers with a threshold for every tile.
    pub observers: usize,
    pub tiles: usize,
    /// Intraclass correlation ICC(2,1) of ln(threshold) (Shrout and Fleiss 1979): the share of variance due
    /// to tiles, for one observer.
    pub icc_single: f64,
    /// ICC(2,k): the same for the mean of all observers.
    pub icc_mean: f64,
}

/// Repeatability of all observers; `None` without repeats.
pub(super) fn repeats(study: &Study, observers: &[&Observer]) -> Option<RepeatAgreement> {
    let mut pairs = Vec::new();
    let mut near = 0;
    for observer in observers {
        for (place, stops) in observer.stops.iter().filter(|(_, stops)| stops.len() > 1) {
            let spp = study.stacks[place.0 as usize].levels();
            pairs.push((ln_spp(spp, stops[0]), ln_spp(spp, stops[1])));
            near += usize::from(stops[0].abs_diff(stops[1]) <= 1);
        }
    }
    let factor = median(pairs.iter().map(|(a, b)| (a - b).abs()).collect())?.exp();
    let within_one_level = near as f64 / pairs.len() as f64;
    Some(RepeatAgreement { pairs: pairs.len(), factor, within_one_level, correlation: pearson(&pairs) })
}

/// Agreement of the observers with a threshold for every tile; `None` for fewer than two of them, or of
/// tiles.
pub(super) fn between(study: &Study, observers: &[&Observer]) -> Option<BetweenObservers> {
    let places = places(study);
    let whole = |o: &&Observer| -> Option<Vec<f64>> {
        places.iter().map(|&p| o.threshold(study, p).map(f64::ln)).collect()
    };
    let table: Vec<Vec<f64>> = observers.iter().filter_map(whole).collect();
    icc(&table)
}

/// ICC(2,1) and ICC(2,k) of ratings indexed by rater, then target (Shrout and Fleiss 1979, table 1 and the
/// two formulas of case 2).
fn icc(table: &[Vec<f64>]) -> Option<BetweenObservers> {
    let (raters, targets) = (table.len(), table.first()?.len());
    if raters < 2 || targets < 2 {
        return None;
    }
    let (k, n) = (raters as f64, targets as f64);
    let grand = table.iter().flatten().sum::<f64>() / (k * n);
    let of_rater = |r: usize| table[r].iter().sum::<f64>() / n;
    let of_target = |t: usize| table.iter().map(|row| row[t]).sum::<f64>() / k;
    let raters_ss: f64 = (0..raters).map(|r| n * (of_rater(r) - grand).powi(2)).sum();
    let targets_ss: f64 = (0..targets).map(|t| k * (of_target(t) - grand).powi(2)).sum();
    let total: f64 = table.iter().flatten().map(|v| (v - grand).powi(2)).sum();
    let rest = (total - raters_ss - targets_ss).max(0.0) / ((k - 1.0) * (n - 1.0));
    let (bms, jms) = (targets_ss / (n - 1.0), raters_ss / (k - 1.0));
    let icc_single = (bms - rest) / (bms + (k - 1.0) * rest + k * (jms - rest) / n);
    let icc_mean = (bms - rest) / (bms + (jms - rest) / n);
    let both = icc_single.is_finite() && icc_mean.is_finite();
    both.then_some(BetweenObservers { observers: raters, tiles: targets, icc_single, icc_mean })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example in Shrout and Fleiss 1979, table 2: six targets, four judges; ICC(2,1) = 0.29, ICC(2,4)
    /// = 0.62.
    #[test]
    fn the_published_example_is_met() {
        let targets = [[9, 2, 5, 8], [6, 1, 3, 2], [8, 4, 6, 8], [7, 1, 2, 6], [10, 5, 6, 9], [6, 2, 4, 7]];
        let table: Vec<Vec<f64>> =
            (0..4).map(|judge| targets.iter().map(|t| f64::from(t[judge])).collect()).collect();
        let found = icc(&table).unwrap();
        assert!(
            (found.icc_single - 0.29).abs() < 0.005 && (found.icc_mean - 0.62).abs() < 0.005,
            "{found:?}"
        );
        assert!(icc(&table[..1]).is_none() && icc(&[]).is_none());
    }
}
