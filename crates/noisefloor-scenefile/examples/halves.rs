//! Renders a scene file twice, independently: `halves SCENE WIDTHxHEIGHT SPP OUT`. Writes OUT-1.exr and
//! OUT-2.exr, for comparison with another renderer (`benchmarks/agreement.py`).

use noisefloor::{ProgressiveSource, Request, TileGrid};
use noisefloor_image::{RenderLayers, write_exr};
use noisefloor_ptwne::{Ptwne, RenderOptions};
use noisefloor_scenefile::{LoadOptions, load_with};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [path, size, spp, out] = args.as_slice() else { return Err("halves SCENE SIZE SPP OUT".into()) };
    let (width, height) = size.split_once('x').ok_or("a size is WIDTHxHEIGHT")?;
    let (width, height): (usize, usize) = (width.parse()?, height.parse()?);
    let mut options = LoadOptions::default();
    options.ignore_volumes = true;
    options.root = std::env::var_os("SCENE_ROOT").map(Into::into);
    let loaded = load_with(Path::new(path), &options)?;
    let scene = Arc::new(loaded.scene);
    for seed in [1, 2] {
        let options =
            RenderOptions { seed, max_depth: loaded.max_depth.unwrap_or(65), ..RenderOptions::default() };
        let mut source = Ptwne::new(scene.clone(), width, height, options)?;
        let tile = TileGrid::new(width, height, width.max(height))?.tile(0);
        let batches = source.sample(&[Request::new(tile, 0, spp.parse()?)])?;
        let layers = RenderLayers::rgb(width, height, &batches[0].mean);
        write_exr(format!("{out}-{seed}.exr"), &layers)?;
    }
    Ok(())
}
