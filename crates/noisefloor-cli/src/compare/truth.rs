//! The converged picture: given, kept from the last time, or rendered.

use crate::args::{CompareArgs, RendererArgs};
use crate::output::{read_reference, write_json};
use crate::sources::{self, Opened};
use crate::train::bar;
use anyhow::{Context, bail};
use indicatif::ProgressBar;
use noisefloor::{Film, Repeats, Request, Rgb, TileGrid};
use noisefloor_image::{RenderLayers, write_exr};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The converged picture of a scene.
pub struct Truth {
    /// Linear radiance, row-major.
    pub pixels: Vec<Rgb>,
    /// Where it comes from, for people.
    pub origin: String,
}

/// What reference.json says of reference.exr.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Facts {
    scene: String,
    source: String,
    width: usize,
    height: usize,
    seed: u64,
    max_depth: Option<u32>,
    /// What changes the picture that it converges to.
    filter: String,
    clamp: Option<f32>,
    /// Samples per pixel so far.
    spp: u64,
}

/// Its samples have a seed of their own, so that no run shares any with it.
const SEED: u64 = 0x5eed_0f7e_0000_0000;
/// Samples per pixel between two looks at the clock.
const STEP: u32 = 64;
/// What a kill may cost.
const SAVE_EVERY: Duration = Duration::from_secs(30);

/// The picture that `--reference` names, or one with `--reference-spp` samples, rendered on from what is in the folder.
pub fn get(
    args: &CompareArgs,
    scene: &str,
    folder: &Path,
    (width, height): (usize, usize),
    cancel: &AtomicBool,
) -> anyhow::Result<Truth> {
    if let Some(path) = &args.reference {
        let pixels = read_reference(path, (width, height))?;
        return Ok(Truth { pixels, origin: path.display().to_string() });
    }
    let renderer = RendererArgs { seed: args.renderer.seed ^ SEED, ..args.renderer.clone() };
    let Opened { mut source, .. } = sources::open(Some(scene), &renderer)?;
    let info = source.info();
    let facts = Facts {
        scene: scene.into(),
        source: info.name,
        width,
        height,
        seed: renderer.seed,
        max_depth: renderer.max_depth,
        filter: format!("{:?}", renderer.filter),
        clamp: renderer.clamp,
        spp: 0,
    };
    let (image, json) = (folder.join("reference.exr"), folder.join("reference.json"));

    // Go on from what is there, if it is of the same picture and its samples can be told from new ones.
    let grid = TileGrid::new(width, height, args.tile)?;
    let mut film = Film::without_halves(grid);
    let kept = std::fs::read(&json).ok().and_then(|text| serde_json::from_slice::<Facts>(&text).ok());
    if let Some(kept) = kept.filter(|kept| Facts { spp: 0, ..kept.clone() } == facts) {
        let enough = kept.spp >= args.reference_spp;
        if enough || info.repeats == Repeats::Samples {
            let pixels = read_reference(&image, (width, height))?;
            let samples = u32::try_from(kept.spp).context("reference.json: too many samples")?;
            if enough {
                return Ok(Truth { pixels, origin: origin(kept.spp) });
            }
            for tile in grid.tiles() {
                let of_tile: Vec<Rgb> = tile.rows(width).flatten().map(|pixel| pixels[pixel]).collect();
                film.add(tile.index, samples, &of_tile)?;
            }
        }
    }

    let bar =
        if args.quiet { ProgressBar::hidden() } else { bar(args.reference_spp, "samples of the reference") };
    let save = |film: &Film| -> anyhow::Result<()> {
        let pixels = film.image();
        write_exr(&image, &RenderLayers::rgb(width, height, &pixels))?;
        write_json(&json, &Facts { spp: film.samples(0), ..facts.clone() })
    };
    let mut saved = Instant::now();
    while film.samples(0) < args.reference_spp {
        let first = film.samples(0);
        let samples = u32::try_from(args.reference_spp - first).unwrap_or(STEP).min(STEP);
        let requests: Vec<Request> = grid.tiles().map(|tile| Request { tile, first, samples }).collect();
        for batch in source.sample(&requests)? {
            if batch.samples == 0 {
                bail!(
                    "the source has {first} samples per pixel, no more: give a converged picture with --reference, or lower --reference-spp"
                );
            }
            film.add(batch.tile.index, batch.samples, &batch.mean)?;
        }
        bar.set_position(film.samples(0));
        let cancelled = cancel.load(Ordering::Relaxed);
        if cancelled || saved.elapsed() >= SAVE_EVERY {
            save(&film)?;
            saved = Instant::now();
        }
        if cancelled {
            bail!(
                "the reference is not finished: it is kept in {}, and the same command goes on from there",
                image.display()
            );
        }
    }
    bar.finish_and_clear();
    save(&film)?;
    Ok(Truth { pixels: film.image(), origin: origin(film.samples(0)) })
}

fn origin(spp: u64) -> String {
    format!("a render with {spp} samples per pixel of another seed")
}
