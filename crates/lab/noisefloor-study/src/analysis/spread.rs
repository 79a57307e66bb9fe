//! How far single people lie from each other: the spread of thresholds that P counts.
//!
//! An observer's ln(threshold) at a showing of a tile is that of the tile, plus what this person always asks for, plus
//! what this person asks for in this tile, plus what differs from showing to showing. The first two of the person make
//! up the spread of people. What only one showing has, slips included, is in no covariance of two showings; nor is
//! the width of a level, as long as showings differ by half of it or more (Sheppard's corrections, for two variables).
//! So the covariance of two showings, over observers, is the variance between people, and that of two tiles its part
//! that is common to all tiles.

use super::observers::{Observer, TileKey, between, places};
use super::summary::median;
use crate::config::Study;
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, StudentsT};

/// How many times a tile's median has to be the first level, and the last before the reference that median: for a
/// spread of 0.7, one person of fifty then lies beyond at either side, and the spread comes out 3 % low.
const ROOM: f64 = 4.0;
/// Fewest observers whose spread is given.
const LEAST: usize = 4;
/// How many times as wide as the jackknife's the intervals are. A variance of few people is known less well than their
/// own scatter says where a few need much more than the rest: without this, 90 of 100 intervals of simulated studies
/// held the truth instead of 95.
const CAUTION: f64 = 1.2;

/// Standard deviations of ln(samples per pixel).
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PeopleSpread {
    /// Name of the stack; `None` for all of them together.
    pub stack: Option<String>,
    /// Observers who saw all these tiles twice.
    pub observers: usize,
    pub tiles: usize,
    /// Tiles left out, since the stack has no room around their median.
    pub left_out: usize,
    /// Of single people, in one place: what P counts.
    pub people: f64,
    /// Its 95 % interval, by the jackknife over observers, widened; `None` if the observers hardly differ.
    pub interval: Option<[f64; 2]>,
    /// The part that a person has in all tiles.
    pub common: f64,
    /// The part that differs from tile to tile.
    pub by_place: f64,
    /// Of one person, from showing to showing; not in `people`.
    pub within: f64,
}

/// ln(threshold) at two showings, and the squared width of their levels.
#[derive(Clone, Copy, Debug)]
struct Twice {
    ln: [f64; 2],
    squared_width: f64,
}

/// The spread over all stacks, then of each if there are several; empty unless four observers saw tiles twice.
pub fn spreads(study: &Study, observers: &[&Observer]) -> Vec<PeopleSpread> {
    let all = places(study);
    let mut found: Vec<PeopleSpread> = spread(study, observers, &all).into_iter().collect();
    if study.stacks.len() > 1 {
        for (number, stack) in study.stacks.iter().enumerate() {
            let own: Vec<TileKey> = all.iter().copied().filter(|p| p.0 as usize == number).collect();
            let of_stack = spread(study, observers, &own);
            found.extend(of_stack.map(|s| PeopleSpread { stack: Some(stack.name().to_owned()), ..s }));
        }
    }
    found
}

fn spread(study: &Study, observers: &[&Observer], places: &[TileKey]) -> Option<PeopleSpread> {
    let kept: Vec<TileKey> = places.iter().copied().filter(|&p| has_room(study, observers, p)).collect();
    let of = |o: &&Observer| kept.iter().map(|&p| twice(study, o, p)).collect::<Option<Vec<Twice>>>();
    let table: Vec<Vec<Twice>> = observers.iter().filter_map(of).collect();
    if table.len() < LEAST || kept.is_empty() {
        return None;
    }
    let all = Variances::of(&table.iter().collect::<Vec<_>>());
    Some(PeopleSpread {
        stack: None,
        observers: table.len(),
        tiles: kept.len(),
        left_out: places.len() - kept.len(),
        people: all.people.max(0.0).sqrt(),
        interval: interval(&table, all),
        common: all.common.max(0.0).sqrt(),
        by_place: (all.people - all.common).max(0.0).sqrt(),
        within: all.within.max(0.0).sqrt(),
    })
}

fn has_room(study: &Study, observers: &[&Observer], place: TileKey) -> bool {
    let levels = study.stacks[place.0 as usize].levels();
    let Some(last) = levels.len().checked_sub(2) else { return false };
    let thresholds = observers.iter().filter_map(|o| o.threshold(study, place)).collect();
    let (low, high) = (levels[0].max(1) as f64, levels[last] as f64);
    median(thresholds).is_some_and(|middle| (ROOM * low..=high / ROOM).contains(&middle))
}

/// The first two showings of a tile to an observer.
fn twice(study: &Study, observer: &Observer, place: TileKey) -> Option<Twice> {
    let levels = study.stacks[place.0 as usize].levels();
    let [first, second, ..] = observer.stops.get(&place)?[..] else { return None };
    let [a, b] = [first, second].map(|level| between(levels, level));
    let squared = |[low, high]: [f64; 2]| (high - low) * (high - low);
    Some(Twice {
        ln: [a, b].map(|[low, high]| 0.5 * (low + high)),
        squared_width: 0.5 * (squared(a) + squared(b)),
    })
}

#[derive(Clone, Copy, Debug)]
struct Variances {
    people: f64,
    common: f64,
    within: f64,
}

impl Variances {
    /// Of observers who all have the same tiles; two observers or more, and a tile or more.
    fn of(table: &[&Vec<Twice>]) -> Self {
        let (n, tiles) = (table.len() as f64, table[0].len());
        let (mut people, mut within) = (0.0, 0.0);
        // The sum of each observer's deviations, of their squares, over tiles
        let mut sums = vec![[0.0; 2]; table.len()];
        for tile in 0..tiles {
            let mean = |showing: usize| table.iter().map(|own| own[tile].ln[showing]).sum::<f64>() / n;
            let means = [mean(0), mean(1)];
            for (own, [sum, squares]) in table.iter().zip(&mut sums) {
                let Twice { ln, squared_width } = own[tile];
                let [a, b] = [ln[0] - means[0], ln[1] - means[1]];
                people += a * b;
                within += 0.5 * (a - b) * (a - b) - squared_width / 12.0 * (n - 1.0) / n;
                *sum += 0.5 * (a + b);
                *squares += 0.25 * (a + b) * (a + b);
            }
        }
        let (of, count) = (n - 1.0, tiles as f64);
        let pairs: f64 = sums.iter().map(|[sum, squares]| sum * sum - squares).sum();
        // One tile does not show what is common to several
        let common = if tiles > 1 { pairs / (of * count * (count - 1.0)) } else { 0.0 };
        Self { people: people / (of * count), common, within: within / (of * count) }
    }
}

/// The jackknife of ln(variance) over observers, with Student's t (Efron and Tibshirani 1993, §11).
fn interval(table: &[Vec<Twice>], all: Variances) -> Option<[f64; 2]> {
    let n = table.len();
    let without = |left_out: usize| {
        let rest: Vec<&Vec<Twice>> =
            table.iter().enumerate().filter(|(i, _)| *i != left_out).map(|(_, own)| own).collect();
        Variances::of(&rest).people.ln()
    };
    let values: Vec<f64> = (0..n).map(without).collect();
    let (mean, count) = (values.iter().sum::<f64>() / n as f64, n as f64);
    let error = (values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() * (count - 1.0) / count).sqrt();
    let t = StudentsT::new(0.0, 1.0, count - 1.0).ok()?.inverse_cdf(0.975);
    // The logarithm of a variance from few people is too low, by as much as leaving one out shows
    let middle = count * all.people.ln() - (count - 1.0) * mean;
    let ends = [-1.0, 1.0].map(|side| (0.5 * (middle + side * CAUTION * t * error)).exp());
    ends.iter().all(|end| end.is_finite()).then_some(ends)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn twice(a: f64, b: f64) -> Twice {
        Twice { ln: [a, b], squared_width: 0.0 }
    }

    /// By hand: two observers, two tiles. Deviations of the first are 1, 1 and 2, 2; those of the second the opposite.
    #[test]
    fn variances_are_those_computed_by_hand() {
        let table = [vec![twice(2.0, 2.0), twice(5.0, 5.0)], vec![twice(0.0, 0.0), twice(1.0, 1.0)]];
        let found = Variances::of(&table.iter().collect::<Vec<_>>());
        // (1 + 1)/1 and (4 + 4)/1, on average; 2·1·2 from each observer, over 2 ordered pairs
        assert!((found.people - 5.0).abs() < 1e-12 && (found.common - 4.0).abs() < 1e-12, "{found:?}");
        assert!(found.within.abs() < 1e-12, "{found:?}");
        // What one showing has alone is within; a shift of all second showings is nowhere
        let table = [vec![twice(0.0, 3.0)], vec![twice(0.0, 1.0)]];
        let found = Variances::of(&table.iter().collect::<Vec<_>>());
        assert!(found.people == 0.0 && (found.within - 1.0).abs() < 1e-12, "{found:?}");
    }
}
