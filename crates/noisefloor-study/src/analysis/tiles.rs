//! Thresholds of tiles.

use super::fit::{Logistic, Observation};
use super::interval::bootstrap;
use super::observers::{Observer, TileKey, places};
use crate::config::Study;
use rayon::prelude::*;
use serde::Serialize;

/// Which threshold of a tile goes into the corpus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CorpusThreshold {
    /// Where 95 % of observers see no difference: what `train` takes as the threshold (Takouachet et al.
    /// 2017, §4.2.2).
    Level95,
    /// The mean over observers.
    Mean,
}

/// The threshold of one tile.
#[derive(Clone, Debug, Serialize)]
pub struct TileRow {
    /// Name of the stack.
    pub stack: String,
    /// Row-major index of the tile.
    pub tile: usize,
    /// Left edge in pixels.
    pub x: usize,
    /// Top edge in pixels.
    pub y: usize,
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Observers with a threshold for this tile.
    pub observers: usize,
    /// Mean over observers, in samples per pixel.
    pub mean: f64,
    /// Its 95 % interval.
    pub mean_interval: Option<[f64; 2]>,
    /// Median of the fitted psychometric function, in samples per pixel.
    pub median: f64,
    /// Its 95 % interval.
    pub median_interval: Option<[f64; 2]>,
    /// Scale of the fitted psychometric function, in ln(spp).
    pub scale: f64,
    /// Samples per pixel at which 95 % of observers see no difference.
    pub level95: f64,
    /// Its 95 % interval.
    pub level95_interval: Option<[f64; 2]>,
    /// Whether the 95 % level lies above the last level before the reference, and is therefore
    /// extrapolated.
    pub beyond: bool,
}

/// Thresholds of all tiles that have answers.
pub fn rows(study: &Study, observers: &[&Observer], seed: u64) -> Vec<TileRow> {
    places(study).into_par_iter().filter_map(|place| row(study, observers, place, seed)).collect()
}

fn row(study: &Study, observers: &[&Observer], place: TileKey, seed: u64) -> Option<TileRow> {
    // Threshold and observations of each observer
    let said: Vec<(f64, Vec<Observation>)> = observers
        .iter()
        .filter_map(|o| Some((o.threshold(study, place)?, o.observations(study, place))))
        .collect();
    let once: Vec<f64> = vec![1.0; said.len()];
    let weighted = |weights: &[f64]| {
        let drawn = said.iter().zip(weights).filter(|(_, w)| **w > 0.0);
        pooled(drawn.flat_map(|((_, seen), w)| seen.iter().map(move |o| (o, *w))))
    };
    let mean = |weights: &[f64]| {
        let sum: f64 = said.iter().zip(weights).map(|((t, _), w)| t * w).sum();
        sum / weights.iter().sum::<f64>()
    };
    let fitted = Logistic::fit(&weighted(&once))?;
    let seed = seed ^ (u64::from(place.0) << 32 | u64::from(place.1));
    let statistics = |w: &[f64]| {
        Logistic::fit_with(&weighted(w), fitted.slips).map(|f| [mean(w), f.centre, f.level95().ln()])
    };
    let found = [mean(&once), fitted.centre, fitted.level95().ln()];
    let intervals = bootstrap(said.len(), seed, found, statistics);
    let stack = &study.stacks[place.0 as usize];
    let tile = stack.grid().tile(place.1 as usize);
    let exp = |i: usize| intervals.map(|all| all[i].map(f64::exp));
    Some(TileRow {
        stack: stack.name().to_owned(),
        tile: tile.index,
        x: tile.x,
        y: tile.y,
        width: tile.width,
        height: tile.height,
        observers: said.len(),
        mean: mean(&once),
        mean_interval: intervals.map(|all| all[0]),
        median: fitted.centre.exp(),
        median_interval: exp(1),
        scale: fitted.scale,
        level95: fitted.level95(),
        level95_interval: exp(2),
        beyond: fitted.level95() > stack.levels()[stack.last() as usize - 1] as f64,
    })
}

/// Merges equal stops, because the time of a fit grows with their number.
fn pooled<'a>(all: impl Iterator<Item = (&'a Observation, f64)>) -> Vec<(Observation, f64)> {
    let mut pooled: Vec<(Observation, f64)> = Vec::new();
    for (observation, weight) in all {
        let is_stop = matches!(observation, Observation::Between { .. });
        let same = if is_stop { pooled.iter_mut().find(|(o, _)| o == observation) } else { None };
        match same {
            Some((_, sum)) => *sum += weight,
            None => pooled.push((observation.clone(), weight)),
        }
    }
    pooled
}
