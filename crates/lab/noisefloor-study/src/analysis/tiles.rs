//! Thresholds of tiles.

use super::fit::{Observation, ThresholdFit};
use super::interval::bootstrap;
use super::observers::{Observer, TileKey, places};
use super::summary::median;
use crate::config::Study;
use crate::stack::ln_spp;
use rayon::prelude::*;
use serde::Serialize;

/// Fewest observers whose intervals are given: with fewer the simulations do not support them.
pub const LEAST_OBSERVERS: usize = 8;
/// Weight of an observer, below 1 because the true spread has none of the shapes considered exactly.
const CAUTION: f64 = 0.9;
/// Standard deviation of a normal distribution in units of its median absolute deviation.
const MAD_TO_SD: f64 = 1.4826;

/// Which threshold of a tile goes into the corpus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CorpusThreshold {
    /// Where 95 % of observers see no difference (Takouachet et al. 2017, §4.2.2).
    Level95,
    /// The mean over observers: what `train` takes as the threshold, since P counts the scatter of observers
    /// around it.
    Mean,
}

/// The threshold of one tile: a line of `tiles.csv`. Ends of 95 % intervals are `None` for fewer than
/// [`LEAST_OBSERVERS`].
#[derive(Clone, Debug, Serialize)]
pub struct TileRow {
    pub stack: String,
    /// Row-major index of the tile.
    pub tile: usize,
    /// Left edge in pixels.
    pub x: usize,
    /// Top edge in pixels.
    pub y: usize,
    pub width: usize,
    pub height: usize,
    /// Observers with a threshold for this tile.
    pub observers: usize,
    /// Mean over observers, in samples per pixel.
    pub mean: f64,
    pub mean_low: Option<f64>,
    pub mean_high: Option<f64>,
    /// Samples per pixel at which half of the observers see no difference.
    pub median: f64,
    pub median_low: Option<f64>,
    pub median_high: Option<f64>,
    /// Distance between the quartiles of the observers, in ln(spp).
    pub quartiles: f64,
    /// Samples per pixel at which 95 % of observers see no difference.
    pub level95: f64,
    pub level95_low: Option<f64>,
    pub level95_high: Option<f64>,
    /// Whether the 95 % level lies above the last level before the reference, and is therefore extrapolated.
    pub beyond: bool,
    /// Acquisition: probability of stops at least as unlike the fitted spread, if it were true. Below 0.01
    /// the estimates of the tile are doubtful.
    pub fit_probability: Option<f64>,
    /// Samples per pixel of the reference, above which nothing is known.
    #[serde(skip)]
    pub reference: u64,
    #[serde(skip)]
    pub(super) fit: ThresholdFit,
}

impl TileRow {
    pub(super) fn threshold(&self, which: CorpusThreshold) -> f64 {
        match which {
            CorpusThreshold::Level95 => self.level95,
            CorpusThreshold::Mean => self.mean,
        }
    }
}

/// Thresholds of all tiles that have answers.
pub fn rows(study: &Study, observers: &[&Observer], seed: u64) -> Vec<TileRow> {
    let alike = repeat_correlation(study, observers);
    places(study).into_par_iter().filter_map(|place| row(study, observers, place, alike, seed)).collect()
}

fn row(study: &Study, observers: &[&Observer], place: TileKey, alike: f64, seed: u64) -> Option<TileRow> {
    let stack = &study.stacks[place.0 as usize];
    // Showings to one observer repeat each other: k of them weigh as much as k/(1 + (k−1)ρ) observers
    let mut observations: Vec<(Observation, f64)> = Vec::new();
    let (mut thresholds, mut stops) = (Vec::new(), Vec::new());
    for observer in observers {
        let Some(threshold) = observer.threshold(study, place) else { continue };
        thresholds.push(threshold);
        stops.extend(observer.stops.get(&place).into_iter().flatten().copied());
        let seen = observer.observations(study, place);
        let weight = CAUTION / (1.0 + (seen.len() as f64 - 1.0) * alike);
        seen.into_iter().for_each(|o| add(&mut observations, o, weight));
    }
    let n = thresholds.len();
    let fit = ThresholdFit::new(&observations)?;
    let mean = |weights: &[f64]| {
        let sum: f64 = thresholds.iter().zip(weights).map(|(t, w)| t * w).sum();
        Some([sum / weights.iter().sum::<f64>()])
    };
    let enough = n >= LEAST_OBSERVERS;
    let found = mean(&vec![1.0; n])?;
    let seed = seed ^ (u64::from(place.0) << 32 | u64::from(place.1));
    let mean_interval = bootstrap(n, seed, found, mean).map(|[i]| i);
    let ends = |interval: Option<[f64; 2]>| [0, 1].map(|end| Some(interval.filter(|_| enough)?[end]));
    let [mean_low, mean_high] = ends(mean_interval);
    let [median_low, median_high] = ends(Some(fit.median.interval.map(f64::exp)));
    let [level95_low, level95_high] = ends(Some(fit.level95.interval.map(f64::exp)));
    let tile = stack.grid().tile(place.1 as usize);
    let design = stops.len() as f64 / observations.iter().map(|(_, w)| w).sum::<f64>();
    Some(TileRow {
        stack: stack.name().to_owned(),
        tile: tile.index,
        x: tile.x,
        y: tile.y,
        width: tile.width,
        height: tile.height,
        observers: n,
        mean: found[0],
        mean_low,
        mean_high,
        median: fit.median.value.exp(),
        median_low,
        median_high,
        quartiles: fit.width,
        level95: fit.level95.value.exp(),
        level95_low,
        level95_high,
        reference: stack.levels()[stack.last() as usize],
        beyond: fit.level95.value.exp() > stack.levels()[stack.last() as usize - 1] as f64,
        fit_probability: fit.fit_probability(&stops, stack.levels(), design),
        fit,
    })
}

/// Merges equal stops, because the time of a fit grows with their number.
fn add(all: &mut Vec<(Observation, f64)>, observation: Observation, weight: f64) {
    let is_stop = matches!(observation, Observation::Between { .. });
    match all.iter_mut().find(|(o, _)| is_stop && *o == observation) {
        Some((_, sum)) => *sum += weight,
        None => all.push((observation, weight)),
    }
}

/// Correlation between two showings of a tile to one observer, from medians, so that slips hardly matter.
/// Where levels are too coarse to tell, it is 1, which makes intervals wider.
fn repeat_correlation(study: &Study, observers: &[&Observer]) -> f64 {
    let (mut within, mut deviations) = (Vec::new(), Vec::new());
    for place in places(study) {
        let spp = study.stacks[place.0 as usize].levels();
        let ln = |level: &u32| ln_spp(spp, *level);
        let stops = || observers.iter().filter_map(|o| o.stops.get(&place));
        within.extend(stops().filter(|s| s.len() > 1).map(|s| (ln(&s[0]) - ln(&s[1])).abs()));
        if let Some(middle) = median(stops().flatten().map(ln).collect()) {
            deviations.extend(stops().flatten().map(|level| (ln(level) - middle).abs()));
        }
    }
    let (Some(within), Some(total)) = (median(within), median(deviations)) else { return 1.0 };
    let variance = |deviation: f64| (MAD_TO_SD * deviation).powi(2);
    if total <= 0.0 { 1.0 } else { (1.0 - 0.5 * variance(within) / variance(total)).clamp(0.0, 1.0) }
}
