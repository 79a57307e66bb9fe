//! Renders the pictures of `noisefloor calibrate`: `calibration_tiles FOLDER [NAME…]` writes two PNGs for each
//! tile, the converged picture as displayed, and NAME-noise.png with 128 + 16 log₂ of the standard deviation of one
//! sample, relative to the pixel's light, channel by channel. It prints how the channels' noise correlates: red
//! with green, red with blue, green with blue.
#![allow(clippy::print_stdout, reason = "an example prints")]

use noisefloor::display::srgb_decode;
use noisefloor::{ProgressiveSource, Request, Rgb, Tile, TileGrid, ToneMapping};
use noisefloor_ptwne::{Ptwne, RenderOptions, scenes};
use std::error::Error;
use std::path::Path;

/// Edge of the whole picture and of a tile, in pixels.
const PICTURE: usize = 512;
const EDGE: usize = 128;
/// Batches, and the samples per pixel of each.
const BATCHES: u64 = 64;
const BATCH: u64 = 96;
/// Samples per pixel that exposure is settled by.
const PREVIEW: u64 = 64;

/// Name, built-in scene, and the tile's left and top edge in the picture.
const TILES: [(&str, &str, usize, usize); 4] = [
    ("smooth", "cornell-box", 272, 110),
    ("dark", "cornell-box", 256, 350),
    ("textured", "arcade", 220, 140),
    ("edge", "softbox", 232, 240),
];

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = arguments.next().ok_or("FOLDER [NAME…]")?;
    let names: Vec<String> = arguments.collect();
    for (name, scene, x, y) in TILES {
        if names.is_empty() || names.iter().any(|wanted| wanted == name) {
            let Rendered { clean, noise, correlations: [rg, rb, gb] } = render(scene, [x, y])?;
            clean.save(Path::new(&folder).join(format!("{name}.png")))?;
            noise.save(Path::new(&folder).join(format!("{name}-noise.png")))?;
            println!("{name}: {rg:.2}, {rb:.2}, {gb:.2}");
        }
    }
    Ok(())
}

struct Rendered {
    clean: image::RgbImage,
    noise: image::RgbImage,
    correlations: [f64; 3],
}

fn render(scene: &str, [x, y]: [usize; 2]) -> Result<Rendered, Box<dyn Error>> {
    let scene = scenes::by_name(scene).ok_or("no such built-in scene")?;
    let mut source =
        Ptwne::new(scene, PICTURE, PICTURE, RenderOptions { seed: 1, ..RenderOptions::default() })?;
    let whole: Vec<Tile> = TileGrid::new(PICTURE, PICTURE, PICTURE)?.tiles().collect();
    let mut mean = |tile: Tile, first, spp| -> Result<Vec<Rgb>, Box<dyn Error>> {
        let batch = source.sample(&[Request::new(tile, first, spp)])?.into_iter().next();
        Ok(batch.ok_or("no samples")?.mean)
    };
    let display = ToneMapping::default().settle(&mean(whole[0], 0, PREVIEW)?);
    let tile = Tile { index: 0, x, y, width: EDGE, height: EDGE };

    let mut sum = vec![[0.0f64; 3]; EDGE * EDGE];
    // Of light as displayed: means, and products of the channels
    let mut means = vec![[0.0f64; 3]; EDGE * EDGE];
    let mut products = vec![[[0.0f64; 3]; 3]; EDGE * EDGE];
    for batch in 0..BATCHES {
        for (i, radiance) in mean(tile, batch * BATCH, BATCH)?.into_iter().enumerate() {
            let light = display.encode(radiance).map(|code| f64::from(srgb_decode(code)));
            for c in 0..3 {
                sum[i][c] += f64::from(radiance[c]) / BATCHES as f64;
                means[i][c] += light[c] / BATCHES as f64;
                (0..3).for_each(|d| products[i][c][d] += light[c] * light[d] / BATCHES as f64);
            }
        }
    }
    // Of one sample, relative to the light
    let covariance = |i: usize, c: usize, d: usize| {
        let light = (means[i][c] * means[i][d]).max(1e-12);
        let unbiased = (BATCH * BATCHES) as f64 / (BATCHES - 1) as f64;
        (products[i][c][d] - means[i][c] * means[i][d]) * unbiased / light
    };
    // Averaged over neighbours, since a variance of 64 numbers errs by 18 %
    let deviation = |i: usize, c: usize| {
        let (row, column) = (i / EDGE, i % EDGE);
        let near = |at: usize| at.saturating_sub(1)..(at + 2).min(EDGE);
        let around = near(row).flat_map(|y| near(column).map(move |x| y * EDGE + x));
        let all: Vec<f64> = around.map(|at| covariance(at, c, c).max(0.0)).collect();
        (all.iter().sum::<f64>() / all.len() as f64).sqrt()
    };
    let correlation = |c: usize, d: usize| {
        let all = (0..EDGE * EDGE)
            .map(|i| covariance(i, c, d) / (covariance(i, c, c) * covariance(i, d, d)).max(1e-18).sqrt());
        all.sum::<f64>() / (EDGE * EDGE) as f64
    };
    let picture = |of: &dyn Fn(usize) -> [f64; 3]| {
        image::RgbImage::from_fn(EDGE as u32, EDGE as u32, |x, y| {
            image::Rgb(of(y as usize * EDGE + x as usize).map(|code| code.round().clamp(0.0, 255.0) as u8))
        })
    };
    let code = |i: usize| [0, 1, 2].map(|c| 128.0 + 16.0 * deviation(i, c).max(1e-9).log2());
    Ok(Rendered {
        clean: picture(&|i| display.encode(sum[i].map(|v| v as f32)).map(|code| 255.0 * f64::from(code))),
        noise: picture(&code),
        correlations: [correlation(0, 1), correlation(0, 2), correlation(1, 2)],
    })
}
