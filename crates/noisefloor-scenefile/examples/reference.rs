//! What the ray-traced reference costs, and how free of noise it is: `reference SIZE SCENE…`, scenes by name
//! or file; prints a table in Markdown.
//!
//! Two references of different seeds share no random number. What they differ by, divided by √2, is the error
//! of one; through tone mapping and the noise mask it is what the oracle would take for noise.

#![expect(clippy::print_stdout, reason = "a table for people")]

use noisefloor::{
    ProgressiveSource, Request, Rgb, Tile, TileGrid, ToneMapping, descriptor::NoiseMask, evidence::Plane,
};
use noisefloor_ptwne::{Ptwne, RenderOptions, Scene, scenes};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

/// Samples per pixel of the small picture that the reference takes its exposure from; the path tracer is
/// timed with them.
const PREVIEW: u64 = 8;
/// Samples per pixel at the first verdict of a render. In scenes where most pixels are black after a few, the
/// picture is darker by then.
const FIRST: u64 = 100;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [size, names @ ..] = args.as_slice() else { return Err("reference SIZE SCENE…".into()) };
    let size: usize = size.parse()?;
    println!(
        "| scene | samples | seconds | as many as … spp | mask deviation, /255, at the exposure of {PREVIEW} samples | of {FIRST} | worst tile | its own estimate | blocks unsettled |"
    );
    println!("|---|---|---|---|---|---|---|---|---|");
    for name in names {
        let scene = match scenes::by_name(name) {
            Some(scene) => scene,
            None => noisefloor_scenefile::load(Path::new(name))?.scene,
        };
        println!("{}", row(&Arc::new(scene), size)?);
    }
    Ok(())
}

fn row(scene: &Arc<Scene>, size: usize) -> Result<String, Box<dyn Error>> {
    let source =
        |seed| Ptwne::new(scene.clone(), size, size, RenderOptions { seed, ..RenderOptions::default() });
    let (mut images, mut samples, mut own, mut unsettled) = (Vec::new(), 0.0, 0.0, 0.0);
    let start = Instant::now();
    for seed in [1, 2] {
        let mut source = source(seed)?;
        images.push(source.reference()?.pixels);
        let noise = source.reference_noise().ok_or("no reference")?;
        samples += 0.5 * noise.samples;
        own += 0.5 * 255.0 * noise.deviation();
        unsettled += 50.0 * noise.unsettled as f64 / noise.deviations.len() as f64;
    }
    let seconds = start.elapsed().as_secs_f64() / 2.0;
    let tile = Tile { index: 0, x: 0, y: 0, width: size, height: size };
    let rendered =
        |samples| source(1)?.sample(&[Request::new(tile, 0, samples)]).map_err(Into::<Box<dyn Error>>::into);
    let start = Instant::now();
    let preview = rendered(PREVIEW)?;
    let spp = seconds / start.elapsed().as_secs_f64() * PREVIEW as f64;
    let first = rendered(FIRST)?;
    let [at_preview, at_first] = [preview, first].map(|batches| deviations(&images, &batches[0].mean, size));
    let ([early, _], [all, worst]) = (at_preview?, at_first?);
    let name = scene.name();
    Ok(format!(
        "| {name} | {samples:.0} | {seconds:.0} | {spp:.0} | {early:.2} | {all:.2} | {worst:.2} | {own:.2} | {unsettled:.0} % |"
    ))
}

/// Deviations of the noise mask of one of two references, of all and of the worst tile, in 1/255, shown as
/// `picture` is.
fn deviations(references: &[Vec<Rgb>], picture: &[Rgb], size: usize) -> Result<[f64; 2], Box<dyn Error>> {
    let display = ToneMapping::default().settle(picture);
    let error = |y: usize, x: usize| {
        let luma = |image: usize| display.luma(references[image][y * size + x]);
        (luma(0) - luma(1)) * std::f32::consts::FRAC_1_SQRT_2 * 255.0
    };
    let mask = NoiseMask::default().apply(&Plane::from_fn((size, size), |(y, x)| error(y, x)));
    let tiles: Vec<f64> = TileGrid::new(size, size, 128)?
        .tiles()
        .map(|t| {
            let squares = (t.y..t.y + t.height).flat_map(|y| (t.x..t.x + t.width).map(move |x| (y, x)));
            squares.map(|at| f64::from(mask[at]).powi(2)).sum::<f64>() / t.pixels() as f64
        })
        .collect();
    let worst = tiles.iter().copied().fold(0.0, f64::max).sqrt();
    Ok([(tiles.iter().sum::<f64>() / tiles.len() as f64).sqrt(), worst])
}
