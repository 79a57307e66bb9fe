//! When tiles are judged, and how early or late they stop by it: `verdicts SEEDS SCENE…` renders built-in
//! scenes with many seeds, lets sessions with different schedules watch, and prints a Markdown table.
//!
//! What a tile needs is where half of all seeds are judged converged from, at every fourth sample. The
//! sessions see the same samples, so that they differ in nothing but when they judge.
#![allow(clippy::print_stdout, reason = "an example prints")]

use noisefloor::{
    Oracle, Params, ProgressiveSource, Request, Schedule, Session, StoppingCriterion, Tile, TileGrid,
    Verdict,
    criterion::{CriterionError, Needs, View},
};
use noisefloor_ptwne::{Ptwne, RenderOptions, scenes};
use std::error::Error;

const EDGE: usize = 128;
const TILE: usize = 32;
/// Samples of a step, half of them for either half.
const STEP: u64 = 4;
const MOST: u64 = 600;

/// What is compared: a name, and what is set.
fn rules() -> Vec<(&'static str, Params)> {
    let params = Params::default().with_tile(TILE).with_max_spp(MOST).with_min_spp(0);
    let every = |step| params.clone().with_schedule(Schedule::Every { step });
    let fine = |min_spp, consecutive| params.clone().with_min_spp(min_spp).with_consecutive(consecutive);
    vec![
        ("every 100", every(100)),
        ("every 8", every(8)),
        ("fine, from 16", fine(16, 1)),
        ("fine, from 48", fine(48, 1)),
        ("fine, from 100", fine(100, 1)),
        ("fine, from 16, two in a row", fine(16, 2)),
    ]
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [seeds, names @ ..] = &arguments[..] else { return Err("SEEDS SCENE…".into()) };
    println!(
        "| scene | verdicts | mean spp | verdicts a tile | stop / need | error | below ½ | below ⅔ | above 2 |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    let mut all: Vec<Vec<Stopped>> = vec![Vec::new(); rules().len()];
    for name in names {
        let scene = measure(name, seeds.parse()?)?;
        for ((rule, of_rule), all) in rules().iter().zip(&scene).zip(&mut all) {
            print_row(name, rule.0, of_rule);
            all.extend(of_rule);
        }
    }
    for (rule, of_rule) in rules().iter().zip(&all) {
        print_row("all", rule.0, of_rule);
    }
    Ok(())
}

/// A tile that stopped.
#[derive(Clone, Copy)]
struct Stopped {
    spp: f64,
    /// Of the tile; `None` beyond the limit.
    need: Option<f64>,
    /// Verdicts on it.
    verdicts: f64,
}

fn print_row(scene: &str, rule: &str, stops: &[Stopped]) {
    let mean = |value: &dyn Fn(&Stopped) -> f64, of: &[&Stopped]| {
        of.iter().map(|stop| value(stop)).sum::<f64>() / of.len().max(1) as f64
    };
    let all: Vec<&Stopped> = stops.iter().collect();
    let known: Vec<&Stopped> = stops.iter().filter(|stop| stop.need.is_some()).collect();
    let ratio = |stop: &Stopped| stop.spp / stop.need.unwrap_or(MOST as f64);
    let share =
        |counts: &dyn Fn(f64) -> bool| 100.0 * mean(&|stop| f64::from(u8::from(counts(ratio(stop)))), &known);
    println!(
        "| {scene} | {rule} | {:.0} | {:.1} | ×{:.2} | ×{:.2} | {:.1} % | {:.1} % | {:.1} % |",
        mean(&|stop| stop.spp, &all),
        mean(&|stop| stop.verdicts, &all),
        mean(&|stop| ratio(stop).ln(), &known).exp(),
        mean(&|stop| ratio(stop).ln().abs(), &known).exp(),
        share(&|r| r < 0.5 - 1e-9),
        share(&|r| r < 2.0 / 3.0 - 1e-9),
        share(&|r| r > 2.0 + 1e-9),
    );
}

/// Where tiles stopped, rule by rule, over all seeds.
fn measure(name: &str, seeds: u64) -> Result<Vec<Vec<Stopped>>, Box<dyn Error>> {
    let mut stops: Vec<Vec<(usize, u64, f64)>> = vec![Vec::new(); rules().len()];
    // Of each tile and step, the probabilities of all seeds
    let tiles = TileGrid::new(EDGE, EDGE, TILE)?.len();
    let mut probabilities = vec![vec![Vec::new(); (MOST / STEP) as usize]; tiles];
    for seed in 1..=seeds {
        watch(name, seed, &mut stops, &mut probabilities)?;
    }
    let needs: Vec<Option<f64>> = probabilities.iter_mut().map(|of_tile| need(of_tile)).collect();
    let stopped =
        |&(tile, spp, verdicts): &(usize, u64, f64)| Stopped { spp: spp as f64, need: needs[tile], verdicts };
    Ok(stops.iter().map(|of_rule| of_rule.iter().map(stopped).collect()).collect())
}

/// Samples from which on half of the seeds are judged converged.
fn need(of_tile: &mut [Vec<f32>]) -> Option<f64> {
    let mut converged = of_tile.iter_mut().map(|seeds| {
        seeds.sort_by(f32::total_cmp);
        seeds[seeds.len() / 2] >= 0.9
    });
    let last_seen = converged.rposition(|converged| !converged).map_or(0, |step| step + 1);
    let need = STEP * (last_seen as u64 + 1);
    (need <= MOST).then_some(need as f64)
}

/// One seed: every session watches until it has stopped all tiles.
fn watch(
    name: &str,
    seed: u64,
    stops: &mut [Vec<(usize, u64, f64)>],
    probabilities: &mut [Vec<Vec<f32>>],
) -> Result<(), Box<dyn Error>> {
    let scene = scenes::by_name(name).ok_or_else(|| format!("no built-in scene {name:?}"))?;
    let mut source = Ptwne::new(scene, EDGE, EDGE, RenderOptions { seed, ..RenderOptions::default() })?;
    let session =
        |params| Session::new(EDGE, EDGE, Counting { oracle: Oracle::bundled(), counts: Vec::new() }, params);
    let mut sessions = rules().into_iter().map(|rule| session(rule.1)).collect::<Result<Vec<_>, _>>()?;
    let schedule = Schedule::Every { step: STEP };
    let params = Params::default().with_tile(TILE).with_schedule(schedule).with_min_spp(0).with_max_spp(MOST);
    let mut onlooker = session(params.with_consecutive(u32::MAX))?;
    let tiles: Vec<Tile> = onlooker.film().grid().tiles().collect();
    for step in 0..(MOST / STEP) as usize {
        for _half in 0..2 {
            let film = onlooker.film();
            let requests: Vec<Request> =
                tiles.iter().map(|tile| film.request(tile.index, STEP / 2)).collect();
            for batch in source.sample(&requests)? {
                for session in sessions.iter_mut().filter(|s| s.is_open(batch.tile.index)) {
                    session.push(batch.tile.index, batch.spp, &batch.mean)?;
                }
                onlooker.push(batch.tile.index, batch.spp, &batch.mean)?;
            }
        }
        onlooker.judge()?;
        for session in &mut sessions {
            if let (None, Some(display)) = (session.display(), onlooker.display()) {
                session.set_display(display.clone())?;
            }
            session.judge()?;
        }
        for (tile, of_tile) in probabilities.iter_mut().enumerate() {
            of_tile[step].extend(onlooker.verdict(tile).and_then(|verdict| verdict.probability));
        }
    }
    for (session, stops) in sessions.iter().zip(stops) {
        let counts = &session.criterion().counts;
        stops.extend(session.stops().map(|stop| (stop.tile.index, stop.spp, counts[stop.tile.index])));
    }
    Ok(())
}

/// The oracle, which counts its verdicts on each tile.
struct Counting {
    oracle: Oracle,
    counts: Vec<f64>,
}

impl StoppingCriterion for Counting {
    fn name(&self) -> String {
        self.oracle.name()
    }

    fn fingerprint(&self) -> String {
        self.oracle.fingerprint()
    }

    fn begin(&mut self, grid: TileGrid) {
        self.counts = vec![0.0; grid.len()];
        self.oracle.begin(grid);
    }

    fn needs(&self) -> Needs {
        self.oracle.needs()
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        tiles.iter().for_each(|tile| self.counts[tile.index] += 1.0);
        self.oracle.judge(view, tiles)
    }
}
