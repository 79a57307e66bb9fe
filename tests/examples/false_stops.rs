//! How often the oracle stops a tile of a stiff scene too early: `false_stops [SEEDS]` renders scenes whose
//! light is hard to find with many seeds, holds each stopped tile against a converged picture, and prints a
//! Markdown table, with and without the guards there are.
#![allow(clippy::print_stdout, reason = "an example prints")]

use noisefloor::{
    Driver, FixedSpp, Oracle, Params, Rgb, Schedule, StopReason, Tile, descriptor::NoiseMask,
    display::Display, evidence::Plane,
};
use noisefloor_ptwne::{Ptwne, RenderOptions, scenes};
use std::error::Error;

const EDGE: usize = 64;
const TILE: usize = 32;
const MOST: u64 = 2000;
/// Samples of each of two pictures whose mean counts as converged.
const CONVERGED: u64 = 6000;
/// Deviation of the noise mask of a tile's error that nobody overlooked, in 8-bit steps: the human thresholds
/// are 1.0 to 2.8.
const SEEN: f64 = 2.8;
/// Error of a tile's mean that is seen as another brightness, in 8-bit steps.
const DARKER: f64 = 2.0;
const SCENES: [&str; 3] = ["caustic", "keyhole", "glass-spheres"];

fn source(scene: &str, seed: u64) -> Result<Ptwne, Box<dyn Error>> {
    let built_in = scenes::by_name(scene).ok_or("no such scene")?;
    Ok(Ptwne::new(built_in, EDGE, EDGE, RenderOptions { seed, ..RenderOptions::default() })?)
}

/// Deviation of the noise mask of the error of a tile, and the error of its mean, in 8-bit steps.
fn error(image: &[Rgb], truth: &[Rgb], display: &Display, tile: Tile) -> (f64, f64) {
    let error = Plane::from_fn((tile.height, tile.width), |(y, x)| {
        let pixel = (tile.y + y) * EDGE + tile.x + x;
        255.0 * (display.luma(image[pixel]) - display.luma(truth[pixel]))
    });
    let mask = NoiseMask::default().apply(&error);
    let count = error.values().len() as f64;
    let noise = mask.values().iter().map(|v| f64::from(v * v)).sum::<f64>() / count;
    (noise.sqrt(), error.values().iter().map(|&v| f64::from(v)).sum::<f64>() / count)
}

fn main() -> Result<(), Box<dyn Error>> {
    let seeds: u64 = std::env::args().nth(1).map_or(Ok(20), |n| n.parse())?;
    println!(
        "| scene | guard | tiles | stopped | mean spp | noise still seen | of another brightness | worst noise |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for scene in SCENES {
        let converged = |seed| -> Result<Vec<Rgb>, Box<dyn Error>> {
            let schedule = Schedule::Every { step: CONVERGED };
            let params = Params::default().with_schedule(schedule).with_max_spp(CONVERGED);
            let mut driver = Driver::new(source(scene, seed)?, FixedSpp(CONVERGED), params)?;
            driver.run(|_, _| ())?;
            Ok(driver.session().film().image())
        };
        let [one, other] = [converged(u64::MAX)?, converged(u64::MAX - 1)?];
        let truth: Vec<Rgb> =
            one.iter().zip(&other).map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect();
        for (guard, min_spp, consecutive) in [("none", 100, 1), ("--consecutive 3", 100, 3)] {
            let params = Params::default()
                .with_tile(TILE)
                .with_min_spp(min_spp)
                .with_consecutive(consecutive)
                .with_max_spp(MOST);
            let (mut tiles, mut samples, mut stopped) = (0, 0, Vec::new());
            for seed in 0..seeds {
                let mut driver = Driver::new(source(scene, seed)?, Oracle::bundled(), params.clone())?;
                driver.run(|_, _| ())?;
                let session = driver.session();
                let (image, display) = (session.film().image(), session.display().ok_or("no display")?);
                for stop in session.stops() {
                    tiles += 1;
                    samples += stop.spp;
                    if stop.reason == StopReason::Converged {
                        // Half of what the two differ by is the noise of their mean.
                        let own = error(&one, &other, display, stop.tile).0 / 2.0;
                        let (noise, shift) = error(&image, &truth, display, stop.tile);
                        stopped.push(((noise * noise - own * own).max(0.0).sqrt(), shift, own));
                    }
                }
            }
            let share = |seen: &dyn Fn(&(f64, f64, f64)) -> bool| {
                100.0 * stopped.iter().filter(|error| seen(error)).count() as f64
                    / stopped.len().max(1) as f64
            };
            println!(
                "| {scene} | {guard} | {tiles} | {} | {:.0} | {:.1} % | {:.1} % | {:.1} | {:.1} |",
                stopped.len(),
                samples as f64 / f64::from(tiles),
                share(&|e| e.0 > SEEN),
                share(&|e| e.1.abs() > DARKER),
                stopped.iter().map(|e| e.0).fold(0.0, f64::max),
                stopped.iter().map(|e| e.2).fold(0.0, f64::max),
            );
        }
    }
    Ok(())
}
