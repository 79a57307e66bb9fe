//! What is left out for a scene that does not need it: `left_out ROUNDS SCENE…`. Renders built-in scenes with
//! and without opacity tests, in turns, and prints a table in Markdown with the ratios of median times.

#![expect(clippy::print_stdout, reason = "a table for people")]

use noisefloor::{ProgressiveSource, Request, TileGrid};
use noisefloor_ptwne::{Ptwne, RenderOptions, Scene, scenes};
use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

const SIZE: usize = 256;
const SAMPLES: u64 = 4;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [rounds, names @ ..] = args.as_slice() else { return Err("left_out ROUNDS SCENE…".into()) };
    let rounds: usize = rounds.parse()?;
    println!("| scene | M samples/s | + opacity tests | background | idle lights | bytes per surface |");
    println!("|---|---|---|---|---|---|");
    for name in names {
        let scene = scenes::by_name(name).ok_or("no such scene")?;
        println!("{}", row(&Arc::new(scene), rounds)?);
    }
    Ok(())
}

/// One line of the table.
fn row(scene: &Arc<Scene>, rounds: usize) -> Result<String, Box<dyn Error>> {
    let mut plain = Ptwne::new(scene.clone(), SIZE, SIZE, RenderOptions::default())?;
    let mut tested = Ptwne::new(scene.clone(), SIZE, SIZE, RenderOptions::default())?;
    tested.force_opacity_tests();
    let (mut own, mut with_tests) = (vec![], vec![]);
    for round in 0..=rounds {
        let (a, b) = (seconds(&mut plain, round)?, seconds(&mut tested, round)?);
        // The first round warms up
        if round > 0 {
            own.push(a);
            with_tests.push(b);
        }
    }
    let (own, with_tests) = (median(own), median(with_tests));
    let counts = plain.counts();
    let tests = if scene.has_opacity() { "needed".into() } else { format!("×{:.3}", with_tests / own) };
    let rate = (SIZE * SIZE) as f64 * SAMPLES as f64 / own / 1e6;
    let background = 100.0 * counts.background as f64 / counts.samples as f64;
    let bytes = scene.geometry_bytes() / scene.surfaces().max(1);
    let idle = format!("{} of {}", scene.idle_lights(), scene.lights());
    Ok(format!("| {} | {rate:.2} | {tests} | {background:.0} % | {idle} | {bytes} |", scene.name()))
}

/// Time of one round of samples.
fn seconds(source: &mut Ptwne, round: usize) -> Result<f64, Box<dyn Error>> {
    let first = round as u64 * SAMPLES;
    let tiles = TileGrid::new(SIZE, SIZE, 64)?.tiles();
    let requests: Vec<Request> = tiles.map(|tile| Request::new(tile, first, SAMPLES)).collect();
    let start = Instant::now();
    source.sample(&requests)?;
    Ok(start.elapsed().as_secs_f64())
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied().unwrap_or(f64::NAN)
}
