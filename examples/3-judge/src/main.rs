//! Judge: says of each tile of an EXR file whether people would see noise in it, by another rendering of the
//! same view.
#![allow(clippy::print_stdout, reason = "an example prints")]

use noisefloor::{
    Audience, Oracle, Params, TileGrid, ToneMapping,
    stills::{Samples, SnapshotPair, Still},
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
    // Read both pictures.
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [image, image_spp, other, other_spp] = args.as_slice() else { return Err(USAGE.into()) };
    let (image, other) = (read(image, samples(image_spp)?)?, read(other, samples(other_spp)?)?);

    // Their difference has the noise of both; the part that is the noise of the first is judged.
    let oracle = Oracle::bundled();
    let (tone, how) = (ToneMapping::default(), Some(Samples::Independent));
    let pair = SnapshotPair::new(oracle.model().evidence(), &image, &[&other], tone, how)?;
    let grid = TileGrid::new(image.size.0, image.size.1, Params::default().tile)?;
    for warning in pair.notice(grid)?.warnings {
        eprintln!("warning: {warning}");
    }
    let mut converged = 0;
    let judged = pair.judge(&oracle, grid, Audience::TRAINED)?;
    for (tile, verdict) in grid.tiles().zip(judged.verdicts()) {
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

fn read(path: &str, spp: u64) -> Result<Still, Box<dyn Error>> {
    let LinearImage { width, height, pixels, .. } = read_exr(path)?;
    Ok(Still::new((width, height), pixels, spp as f64))
}

fn samples(text: &str) -> Result<u64, String> {
    let samples = text.parse().ok().filter(|&samples| samples > 0);
    samples.ok_or(format!("{text:?} is not a number of samples per pixel, such as 64\n{USAGE}"))
}
