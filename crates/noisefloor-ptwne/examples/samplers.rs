//! What Sobol points save: `samplers SCENE…` renders built-in scenes with independent samples and with Sobol
//! points, and prints a Markdown table of the ratio of their variances. Variances are relative to the squared
//! mean of a pixel, from two pairs of seeds, averaged without the noisiest 5 % of the pixels.
#![allow(clippy::print_stdout, reason = "an example prints")]

use noisefloor::{ProgressiveSource, Request, Rgb, Tile};
use noisefloor_ptwne::{Ptwne, RenderOptions, Sampling, Scene, scenes};
use std::error::Error;
use std::sync::Arc;

const EDGE: usize = 96;
const LEVELS: [u64; 6] = [8, 16, 32, 64, 128, 256];

fn main() -> Result<(), Box<dyn Error>> {
    println!("| scene | {} |", LEVELS.map(|n| n.to_string()).join(" | "));
    println!("|---|{}", "---|".repeat(LEVELS.len()));
    for name in std::env::args().skip(1) {
        let scene = scenes::by_name(&name).ok_or_else(|| format!("no built-in scene {name:?}"))?;
        let scene = Arc::new(scene);
        print!("| {name} |");
        for spp in LEVELS {
            let ratio =
                variance(&scene, spp, Sampling::Independent)? / variance(&scene, spp, Sampling::Sobol)?;
            print!(" ×{ratio:.2} |");
        }
        println!();
    }
    Ok(())
}

fn variance(scene: &Arc<Scene>, spp: u64, sampling: Sampling) -> Result<f64, Box<dyn Error>> {
    let picture = |seed| -> Result<Vec<Rgb>, Box<dyn Error>> {
        let options = RenderOptions { seed, sampling, ..RenderOptions::default() };
        let mut source = Ptwne::new(Arc::clone(scene), EDGE, EDGE, options)?;
        let tile = Tile { index: 0, x: 0, y: 0, width: EDGE, height: EDGE };
        Ok(source.sample(&[Request::new(tile, 0, spp)])?.remove(0).mean)
    };
    let pictures = [picture(1)?, picture(2)?, picture(3)?, picture(4)?];
    let light = |picture: &[Rgb], pixel: usize| picture[pixel].iter().map(|&c| f64::from(c)).sum::<f64>();
    let relative = |pixel: usize| {
        let [a, b, c, d] = pictures.each_ref().map(|picture| light(picture, pixel));
        ((a - b).powi(2) + (c - d).powi(2)) / (0.25 * (a + b + c + d) + 1e-3).powi(2)
    };
    let mut all: Vec<f64> = (0..EDGE * EDGE).map(relative).collect();
    all.sort_by(f64::total_cmp);
    all.truncate(all.len() * 95 / 100);
    Ok(all.iter().sum::<f64>() / all.len() as f64)
}
