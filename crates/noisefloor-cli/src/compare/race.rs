//! One run that all criteria watch: each sees the same samples, and takes those of a tile until it stops it.

use super::quality::{Quality, Yardstick};
use crate::sources::Source;
use indicatif::ProgressBar;
use noisefloor::{Batch, Display, Film, Params, Request, Session, StopReason, StoppingCriterion, Tile};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// A criterion that watches the run.
pub struct Entrant {
    /// As it was asked for: `cycles:0.01`.
    pub spec: String,
    /// What it is one of: `cycles`. Entrants of one family differ in their constant alone.
    pub family: String,
    session: Session<Box<dyn StoppingCriterion + Send>>,
    /// Seconds in the criterion.
    pub criterion_seconds: f64,
}

impl Entrant {
    pub fn new(
        spec: String,
        criterion: Box<dyn StoppingCriterion + Send>,
        (width, height): (usize, usize),
        params: &Params,
    ) -> anyhow::Result<Self> {
        let family = spec.split(':').next().unwrap_or_default().to_owned();
        let session = Session::new(width, height, criterion, *params)?;
        Ok(Self { spec, family, session, criterion_seconds: 0.0 })
    }

    /// Its picture: each tile as it was when it stopped.
    pub fn film(&self) -> &Film {
        self.session.film()
    }

    /// What it calls itself, with its constant.
    pub fn name(&self) -> String {
        self.session.criterion().name()
    }

    /// Tiles that it was satisfied with, before a limit came.
    pub fn converged(&self) -> usize {
        self.session.stops().filter(|s| s.reason == StopReason::Converged).count()
    }
}

/// A point of the curve that uniform sampling draws.
#[derive(Clone, Copy, Debug)]
pub struct Point {
    /// Samples per pixel, everywhere.
    pub spp: u64,
    pub quality: Quality,
}

/// What came of a run.
pub struct Race {
    pub entrants: Vec<Entrant>,
    pub curve: Vec<Point>,
    /// Seconds that one more sample of each pixel of a tile costs, tile by tile.
    tile_seconds: Vec<f64>,
    /// Whether somebody broke it off.
    pub cancelled: bool,
}

impl Race {
    /// Seconds in the source for the samples of a film.
    pub fn source_seconds(&self, film: &Film) -> f64 {
        self.tile_seconds.iter().enumerate().map(|(tile, seconds)| seconds * film.samples(tile) as f64).sum()
    }

    /// Seconds in the source for so many samples of every pixel.
    pub fn uniform_seconds(&self, spp: f64) -> f64 {
        self.tile_seconds.iter().sum::<f64>() * spp
    }
}

/// Curve points lie this far apart, as a factor on samples.
const SPACING: f64 = std::f64::consts::SQRT_2;

/// Runs until every entrant has stopped every tile, or at `params.max_samples`.
///
/// Each step is half a batch for every tile: sessions fill one half of their film after the other. What a tile costs is measured in the
/// second step, where each is sampled in a call of its own, as shares of what all of them cost together in the calls after the first,
/// which may have to start something up.
pub fn run(
    source: &mut dyn Source,
    mut entrants: Vec<Entrant>,
    params: &Params,
    step: u32,
    yardstick: &dyn Fn(Display) -> Yardstick,
    cancel: &AtomicBool,
    bar: &ProgressBar,
) -> anyhow::Result<(Race, Yardstick)> {
    let info = source.info();
    let grid = noisefloor::TileGrid::new(info.width, info.height, params.tile)?;
    let mut film = Film::without_halves(grid);
    let mut clock = Costs::new(grid.len());
    let mut judge: Option<Yardstick> = None;
    let mut curve = Vec::new();
    let mut done = 0u64;
    let mut cancelled = false;
    bar.set_length(params.max_samples);
    while done < params.max_samples && entrants.iter().any(|e| !e.session.is_done()) {
        cancelled = cancel.load(Ordering::Relaxed);
        let samples = u32::try_from(params.max_samples - done).unwrap_or(step).min(step);
        let requests: Vec<Request> =
            grid.tiles().map(|tile| Request { tile, first: done, samples }).collect();
        let batches = if cancelled { Vec::new() } else { clock.sample(source, &requests)? };
        // The end of a recording, or of somebody's patience.
        if batches.len() < requests.len() || batches.iter().any(|b| b.samples == 0) {
            break;
        }
        for Batch { tile, samples, mean } in &batches {
            film.add(tile.index, *samples, mean)?;
            for entrant in entrants.iter_mut().filter(|e| e.session.is_open(tile.index)) {
                entrant.session.push(tile.index, *samples, mean)?;
            }
        }
        done = film.samples(0);

        // All judge by one way to the screen, settled as a session would.
        let judge = judge.get_or_insert_with(|| {
            let display = params.tone_mapping.settle(&film.image());
            entrants.iter_mut().for_each(|e| e.session.set_display(display));
            yardstick(display)
        });
        for entrant in &mut entrants {
            let began = Instant::now();
            entrant.session.judge()?;
            entrant.criterion_seconds += began.elapsed().as_secs_f64();
        }
        let last = curve.last().map_or(0.0, |point: &Point| point.spp as f64);
        if done as f64 >= SPACING * last {
            curve.push(Point { spp: done, quality: judge.quality(&film.image())? });
        }
        bar.set_position(done);
        let open = entrants.iter().filter(|e| !e.session.is_done()).count();
        bar.set_message(format!("{open} criteria not satisfied yet"));
    }
    for entrant in &mut entrants {
        entrant.session.close_all(if cancelled { StopReason::Cancelled } else { StopReason::MaxSamples });
    }
    let Some(judge) = judge else { anyhow::bail!("the source gave no samples") };
    if curve.last().is_none_or(|point| point.spp < done) {
        curve.push(Point { spp: done, quality: judge.quality(&film.image())? });
    }
    let tile_seconds = clock.tile_seconds(&grid.tiles().collect::<Vec<_>>());
    Ok((Race { entrants, curve, tile_seconds, cancelled }, judge))
}

/// What sampling costs, tile by tile.
struct Costs {
    calls: usize,
    /// Seconds of the call that sampled each tile alone.
    alone: Vec<f64>,
    /// Seconds and pixel samples of the calls for all tiles together, the first one left out.
    seconds: f64,
    samples: f64,
    /// Of the first call, in case there is no other.
    first: (f64, f64),
}

impl Costs {
    fn new(tiles: usize) -> Self {
        Self { calls: 0, alone: vec![1.0; tiles], seconds: 0.0, samples: 0.0, first: (0.0, 1.0) }
    }

    fn sample(&mut self, source: &mut dyn Source, requests: &[Request]) -> anyhow::Result<Vec<Batch>> {
        self.calls += 1;
        if self.calls == 2 && source.info().aims {
            let mut batches = Vec::with_capacity(requests.len());
            for (request, seconds) in requests.iter().zip(&mut self.alone) {
                let began = Instant::now();
                batches.extend(source.sample(std::slice::from_ref(request))?);
                *seconds = began.elapsed().as_secs_f64().max(1e-9);
            }
            return Ok(batches);
        }
        let began = Instant::now();
        let batches = source.sample(requests)?;
        let seconds = began.elapsed().as_secs_f64();
        let samples: f64 = batches.iter().map(|b| f64::from(b.samples) * b.tile.pixels() as f64).sum();
        if self.calls == 1 {
            self.first = (seconds, samples.max(1.0));
        } else {
            self.seconds += seconds;
            self.samples += samples;
        }
        Ok(batches)
    }

    /// Seconds that one sample of each pixel of a tile costs, such that all together cost what they did.
    fn tile_seconds(&self, tiles: &[Tile]) -> Vec<f64> {
        let (seconds, samples) = if self.samples > 0.0 { (self.seconds, self.samples) } else { self.first };
        let pixels: f64 = tiles.iter().map(|t| t.pixels() as f64).sum();
        let all: f64 = self.alone.iter().sum();
        self.alone.iter().map(|alone| seconds / samples * pixels * alone / all).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costs_of_tiles_add_up_to_what_all_cost() {
        let grid = noisefloor::TileGrid::new(64, 32, 32).unwrap();
        let costs =
            Costs { calls: 9, alone: vec![0.3, 0.1], seconds: 5.0, samples: 1000.0, first: (9.0, 10.0) };
        let tiles: Vec<Tile> = grid.tiles().collect();
        let each = costs.tile_seconds(&tiles);
        // 5 ms a pixel sample, 2048 pixels: 10.24 s a sample everywhere, three quarters of it in the first tile.
        assert!((each[0] - 7.68).abs() < 1e-9 && (each[1] - 2.56).abs() < 1e-9, "{each:?}");
        let started = Costs { samples: 0.0, ..costs };
        assert!((started.tile_seconds(&tiles).iter().sum::<f64>() - 0.9 * 2048.0).abs() < 1e-9);
    }
}
