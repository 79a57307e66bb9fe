//! Renders a built-in scene to a PNG: `picture SCENE SPP SIZE OUT.png [reference|reinhard]…`. For a quick
//! look at a scene; the `noisefloor` command does this properly.

use noisefloor::{ProgressiveSource, Request, Rgb, TileGrid};
use noisefloor_ptwne::{Estimator, Ptwne, RenderOptions, scenes};
use std::error::Error;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [name, spp, size, out, rest @ ..] = args.as_slice() else {
        return Err("picture SCENE SPP SIZE OUT.png [reference|reinhard]…".into());
    };
    let (spp, size): (u64, usize) = (spp.parse()?, size.parse()?);
    let scene = scenes::by_name(name).ok_or("no such scene")?;
    eprint!("{name}: {} surfaces, {} lights", scene.surfaces(), scene.lights());
    let plain = rest.iter().any(|a| a == "plain");
    let estimator = if plain { Estimator::NextEvents } else { Estimator::Mis };
    let mut source = Ptwne::new(scene, size, size, RenderOptions { estimator, ..RenderOptions::default() })?;
    let start = Instant::now();
    let mut image = vec![[0.0; 3]; size * size];
    if rest.iter().any(|a| a == "reference") {
        image = source.reference()?.pixels;
        eprint!(", reference in {:.2} s", start.elapsed().as_secs_f64());
    } else {
        let tiles = TileGrid::new(size, size, 128)?.tiles();
        let requests: Vec<Request> = tiles.map(|tile| Request::new(tile, 0, spp)).collect();
        for batch in source.sample(&requests)? {
            for (row, values) in batch.tile.rows(size).zip(batch.mean.chunks(batch.tile.width)) {
                image[row].copy_from_slice(values);
            }
        }
        let seconds = start.elapsed().as_secs_f64();
        eprint!(", {seconds:.2} s, {:.2} M samples/s", (size * size) as f64 * spp as f64 / seconds / 1e6);
    }
    let luminance = |c: &Rgb| f64::from(0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]);
    let n = image.len() as f64;
    let log = (image.iter().map(|c| (1e-4 + luminance(c)).ln()).sum::<f64>() / n).exp();
    let white = image.iter().filter(|c| luminance(c) > 1.0).count() as f64 / n;
    eprintln!(
        ", mean {:.3}, log mean {log:.3}, {:.1} % above 1",
        image.iter().map(luminance).sum::<f64>() / n,
        white * 100.0
    );
    // Reinhard et al. 2002, global: L·0.18/log mean, then L/(1+L)
    let reinhard = rest.iter().any(|a| a == "reinhard");
    let bytes = image.iter().flat_map(|c| {
        let scaled = luminance(c) * 0.18 / log;
        let factor = if reinhard { 0.18 / log / (1.0 + scaled) } else { 1.0 };
        c.map(|v| {
            let v = (f64::from(v) * factor).clamp(0.0, 1.0);
            let v = if v <= 0.003_130_8 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
            (v * 255.0).round() as u8
        })
    });
    let buffer = image::RgbImage::from_raw(size as u32, size as u32, bytes.collect()).ok_or("size")?;
    buffer.save(out)?;
    Ok(())
}
