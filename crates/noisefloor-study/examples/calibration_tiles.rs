//! Renders the pictures of `noisefloor calibrate`: `calibration_tiles FOLDER [NAME…]` writes one PNG for each
//! tile, whose colour is the converged picture as displayed and whose alpha is 128 + 16 log₂ of the standard
//! deviation of one sample, relative to the pixel's light.

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
            render(scene, [x, y])?.save(Path::new(&folder).join(format!("{name}.png")))?;
        }
    }
    Ok(())
}

fn render(scene: &str, [x, y]: [usize; 2]) -> Result<image::RgbaImage, Box<dyn Error>> {
    let scene = scenes::by_name(scene).ok_or("no such built-in scene")?;
    let mut source =
        Ptwne::new(scene, PICTURE, PICTURE, RenderOptions { seed: 1, ..RenderOptions::default() })?;
    let whole: Vec<Tile> = TileGrid::new(PICTURE, PICTURE, PICTURE)?.tiles().collect();
    let mut mean = |tile: Tile, first, spp| -> Result<Vec<Rgb>, Box<dyn Error>> {
        let batch = source.sample(&[Request { tile, first, spp }])?.into_iter().next();
        Ok(batch.ok_or("no samples")?.mean)
    };
    let display = ToneMapping::default().settle(&mean(whole[0], 0, PREVIEW)?);
    let tile = Tile { index: 0, x, y, width: EDGE, height: EDGE };

    let mut sum = vec![[0.0f64; 3]; EDGE * EDGE];
    // Of the luminance, as displayed
    let mut moments = vec![[0.0f64; 2]; EDGE * EDGE];
    for batch in 0..BATCHES {
        for (i, radiance) in mean(tile, batch * BATCH, BATCH)?.into_iter().enumerate() {
            let [r, g, b] = display.encode(radiance).map(|code| f64::from(srgb_decode(code)));
            let light = 0.2126 * r + 0.7152 * g + 0.0722 * b;
            moments[i][0] += light / BATCHES as f64;
            moments[i][1] += light * light / BATCHES as f64;
            (0..3).for_each(|c| sum[i][c] += f64::from(radiance[c]) / BATCHES as f64);
        }
    }
    // Averaged over neighbours, since a variance of 64 numbers errs by 18 %
    let relative = |i: usize| {
        let (row, column) = (i / EDGE, i % EDGE);
        let near = |at: usize| at.saturating_sub(1)..(at + 2).min(EDGE);
        let around = near(row).flat_map(|y| near(column).map(move |x| y * EDGE + x));
        let of = |[mean, square]: [f64; 2]| {
            (square - mean * mean).max(0.0) * BATCH as f64 / (mean * mean).max(1e-12)
        };
        let all: Vec<f64> = around.map(|at| of(moments[at])).collect();
        (all.iter().sum::<f64>() / all.len() as f64 * BATCHES as f64 / (BATCHES - 1) as f64).sqrt()
    };
    Ok(image::RgbaImage::from_fn(EDGE as u32, EDGE as u32, |x, y| {
        let i = y as usize * EDGE + x as usize;
        let [r, g, b] = display.encode(sum[i].map(|v| v as f32)).map(|code| (255.0 * code).round() as u8);
        let code = 128.0 + 16.0 * relative(i).max(1e-9).log2();
        image::Rgba([r, g, b, code.round().clamp(0.0, 255.0) as u8])
    }))
}
