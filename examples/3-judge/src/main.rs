//! Judge: says of each tile of an EXR file whether people would see noise in it, by another rendering of the
//! same view.
#![allow(clippy::print_stdout, reason = "an example prints")]

use noisefloor::{
    Oracle, TileGrid, ToneMapping,
    evidence::{Rendering, Samples, TilePlanes},
    tile::DEFAULT_TILE,
};
use noisefloor_image::{LinearImage, read_exr};
use std::error::Error;
use std::process::ExitCode;

const USAGE: &str = "usage: example-judge IMAGE.exr SPP OTHER.exr SPP, with\n\
    two renderings of one view that share no samples, and the samples per pixel of each";

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn Error>> {
    // Read and check both pictures.
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [image, image_spp, other, other_spp] = args.as_slice() else { return Err(USAGE.into()) };
    let (image, spp) = (read(image)?, samples(image_spp)?);
    let (other, other_spp) = (read(other)?, samples(other_spp)?);
    let size = (image.width, image.height);
    if size != (other.width, other.height) {
        return Err(format!(
            "{}×{} and {}×{} pixels: not the same view",
            size.0, size.1, other.width, other.height
        )
        .into());
    }
    if image.pixels == other.pixels {
        return Err("both files hold the same samples: render one of them with another seed".into());
    }

    // How the picture is shown, the same for both: people see display values, not radiance.
    let display = ToneMapping::default().settle(&image.pixels);
    let rendering = |picture, spp: u64| Rendering { pixels: picture, spp: spp as f64, rounding: 0.0 };
    let pair = (rendering(&image.pixels[..], spp), rendering(&other.pixels[..], other_spp));

    let oracle = Oracle::bundled();
    let grid = TileGrid::new(image.width, image.height, DEFAULT_TILE)?;
    let mut described = Vec::new();
    for tile in grid.tiles() {
        // The two differ by the noise of both; of it, the evidence is the noise of the first.
        let planes = TilePlanes::from_pair(size, tile, &display, pair, Samples::Independent)
            .ok_or("no samples, no evidence")?;
        described.push(oracle.describe(&planes, spp as f64)?);
    }
    // A tile is judged in its picture, as people do.
    let mut converged = 0;
    for (tile, verdict) in grid.tiles().zip(oracle.judge_described(&described)) {
        let says = match verdict.expected_spp {
            _ if verdict.converged => "no noise seen".into(),
            Some(expected) => format!("noise seen; clean at about {expected} spp"),
            None => "noise seen".into(),
        };
        println!(
            "tile at ({:4}, {:4})  P = {:.3}  {says}",
            tile.x,
            tile.y,
            verdict.probability.unwrap_or(0.0)
        );
        converged += usize::from(verdict.converged);
    }
    println!("{converged} of {} tiles need no more samples (P ≥ {})", grid.len(), oracle.people());
    Ok(())
}

fn read(path: &str) -> Result<LinearImage, Box<dyn Error>> {
    let image = read_exr(path)?;
    match image.pixels.iter().flatten().all(|value| value.is_finite()) {
        true => Ok(image),
        false => Err(format!("{path}: some pixels are not finite").into()),
    }
}

fn samples(text: &str) -> Result<u64, String> {
    let samples = text.parse().ok().filter(|&samples| samples > 0);
    samples.ok_or(format!("{text:?} is not a number of samples per pixel, such as 64\n{USAGE}"))
}
