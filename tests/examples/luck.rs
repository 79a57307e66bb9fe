//! How often the oracle stops a tile on luck: `luck [SEEDS [LIGHT [CHANCE]]]` renders pictures of four tiles, one of
//! which holds light that is seldom found, and prints a Markdown table of where that tile stops and what it
//! misses, with and without the guards there are.
#![allow(clippy::print_stdout, reason = "an example prints")]

use noisefloor::{
    Batch, Driver, Oracle, Params, ProgressiveSource, Request, Rgb, Schedule, SourceError, SourceInfo,
    descriptor::NoiseMask, display::Display, evidence::Plane,
};
use std::error::Error;

const MOST: u64 = 10_000;
/// Radiance of the picture, and of what is seldom found.
const BASE: f32 = 0.2;
/// Deviation of one ordinary sample, as a share of its mean.
const SPREAD: f32 = 2.0;

/// Where light that is seldom found falls.
#[derive(Clone, Copy)]
enum Place {
    /// All over the first tile, which is black but for it.
    Black,
    /// On a twentieth of the first tile, which is lit besides: a caustic.
    Caustic,
    /// Anywhere in the first tile: one sample of 10⁶ times the radiance of the rest.
    Firefly,
}

struct Rare {
    edge: usize,
    place: Place,
    /// Of a sample, to find it.
    chance: f64,
    seed: u64,
    /// Samples that found it.
    found: u64,
}

/// SplitMix64 (Steele et al. 2014). Its sequence is that of the published tables (docs/numerics.md), which is
/// why it is not the testkit's `Noise`.
fn mix(state: &mut u64) -> u64 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut z = *state;
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

fn uniform(state: &mut u64) -> f64 {
    ((mix(state) >> 11) as f64 + 0.5) / (1u64 << 53) as f64
}

impl Rare {
    /// Mean radiance of the light that is seldom found, at a pixel of the first tile.
    fn rare(&self, x: usize, y: usize) -> f32 {
        let corner = self.edge / 4;
        match self.place {
            Place::Black => BASE,
            Place::Caustic if x < corner && y < corner * 4 / 5 => 2.0 * BASE,
            Place::Caustic => 0.0,
            Place::Firefly => (1e6 * f64::from(BASE) * self.chance) as f32,
        }
    }

    /// What the picture converges to.
    fn truth(&self, tile: usize, x: usize, y: usize) -> f32 {
        let lit = if tile == 0 && matches!(self.place, Place::Black) { 0.0 } else { BASE };
        lit + if tile == 0 { self.rare(x, y) } else { 0.0 }
    }
}

impl ProgressiveSource for Rare {
    fn info(&self) -> SourceInfo {
        let (width, height) = (2 * self.edge, 2 * self.edge);
        SourceInfo::new("rare", width, height)
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        let mut batches = Vec::new();
        for &Request { tile, first, spp: samples, .. } in requests {
            let mut state = self.seed ^ (first << 20) ^ ((tile.index as u64) << 50);
            let mut mean = vec![[0.0; 3]; tile.pixels()];
            let n = samples as f64;
            for (i, pixel) in mean.iter_mut().enumerate() {
                let (x, y) = (i % tile.width, i / tile.width);
                let rare = if tile.index == 0 { self.rare(x, y) } else { 0.0 };
                let lit = self.truth(tile.index, x, y) - rare;
                // The mean of many samples of an ordinary pixel: normal, by a sum of four uniforms.
                let normal: f64 = (0..4).map(|_| uniform(&mut state) - 0.5).sum::<f64>() * 3f64.sqrt();
                let mut value = f64::from(lit) * (1.0 + f64::from(SPREAD) * normal / n.sqrt());
                if rare > 0.0 {
                    // Distances between finds are geometric.
                    let mut at = (uniform(&mut state).ln() / (-self.chance).ln_1p()).floor();
                    while at < n {
                        value += f64::from(rare) / self.chance / n;
                        self.found += 1;
                        at += 1.0 + (uniform(&mut state).ln() / (-self.chance).ln_1p()).floor();
                    }
                }
                *pixel = [value as f32; 3];
            }
            batches.push(Batch::new(tile, samples, mean));
        }
        Ok(batches)
    }
}

/// What became of the first tile: samples, whether any found the rare light, and the deviation of the noise
/// mask of its error on the screen, in 8-bit steps, less than which people see of it.
fn stop(source: Rare, params: Params) -> Result<(u64, bool, f64), Box<dyn Error>> {
    let mut driver = Driver::new(source, Oracle::bundled(), params)?;
    driver.run(|_, _| ())?;
    let (source, session) = driver.into_parts();
    let samples = session.stops().next().ok_or("no stop")?.spp;
    let display: Display = session.display().ok_or("no display")?.clone();
    let (image, edge) = (session.film().image(), source.edge);
    let error = Plane::from_fn((edge, edge), |(y, x)| {
        let truth: Rgb = [source.truth(0, x, y); 3];
        display.luma(image[y * 2 * edge + x]) - display.luma(truth)
    });
    let mask = NoiseMask::default().apply(&error);
    let deviation =
        f64::from(mask.values().iter().map(|v| v * v).sum::<f32>() / mask.values().len() as f32).sqrt();
    Ok((samples, source.found > 0, 255.0 * deviation))
}

fn main() -> Result<(), Box<dyn Error>> {
    let seeds: u64 = std::env::args().nth(1).map_or(Ok(100), |n| n.parse())?;
    let only = std::env::args().nth(2).unwrap_or_default();
    let chances = match std::env::args().nth(3) {
        Some(chance) => vec![chance.parse()?],
        None => vec![1e-3, 1e-4, 1e-5, 1e-6],
    };
    println!(
        "| light | chance | tile | guard | stops at, median | stopped without having found it | noise left, median | 95 % |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    let (spaced, first) = (Schedule::default(), Params::default().min_spp);
    let guards = [
        ("none", spaced, first, 1),
        ("--consecutive 2", spaced, first, 2),
        ("--consecutive 3", spaced, first, 3),
        ("--min-spp 100", spaced, 100, 1),
        ("--min-spp 1000", spaced, 1000, 1),
        ("--schedule every", Schedule::Every { step: 100 }, 100, 1),
        ("--schedule every --consecutive 3", Schedule::Every { step: 100 }, 100, 3),
    ];
    for (name, place) in
        [("in a black tile", Place::Black), ("caustic", Place::Caustic), ("firefly of 10⁶", Place::Firefly)]
    {
        if !name.contains(&only) {
            continue;
        }
        for &chance in &chances {
            for edge in [32, 128] {
                for (guard, schedule, min_spp, consecutive) in guards {
                    let params = Params::default()
                        .with_tile(edge)
                        .with_schedule(schedule)
                        .with_min_spp(min_spp)
                        .with_consecutive(consecutive)
                        .with_max_spp(MOST);
                    let mut runs = Vec::new();
                    for seed in 0..seeds {
                        let source = Rare { edge, place, chance, seed: seed * 0x1_0000_0001 + 1, found: 0 };
                        runs.push(stop(source, params.clone())?);
                    }
                    let missed = runs.iter().filter(|run| !run.1).count();
                    let median = |mut values: Vec<f64>, place: f64| {
                        values.sort_by(f64::total_cmp);
                        values[((values.len() - 1) as f64 * place).round() as usize]
                    };
                    let left = || runs.iter().map(|run| run.2).collect::<Vec<_>>();
                    println!(
                        "| {name} | {chance:.0e} | {edge} | {guard} | {:.0} | {:.0} % | {:.1} | {:.1} |",
                        median(runs.iter().map(|run| run.0 as f64).collect(), 0.5),
                        100.0 * missed as f64 / seeds as f64,
                        median(left(), 0.5),
                        median(left(), 0.95),
                    );
                }
            }
        }
    }
    Ok(())
}
