//! At which exposure tiles may first stop: `exposure WIDTHxHEIGHT SPP SCENE…`, scenes by name or file;
//! prints a table in Markdown (docs/benchmarks/exposure.md).
//!
//! Each row is a render whose criterion is satisfied with anything, so that the first tile stops as soon
//! as the exposure counts as known. *Off* is by how much it is wrong then, against the log-average of the
//! same view at SPP samples per pixel of another seed, pixel by pixel.

#![expect(clippy::print_stdout, reason = "a table for people")]

use noisefloor::criterion::{CriterionError, Needs, View};
use noisefloor::{
    Driver, Event, FixedSpp, Params, Schedule, StoppingCriterion, Tile, ToneMapping, Verdict,
    display::Display,
};
use noisefloor_ptwne::{Ptwne, RenderOptions, Scene, scenes};
use std::error::Error;
use std::path::Path;
use std::sync::Arc;

struct Hasty {
    halves: bool,
}

impl StoppingCriterion for Hasty {
    fn name(&self) -> String {
        "hasty".into()
    }

    fn fingerprint(&self) -> String {
        self.name()
    }

    fn needs(&self) -> Needs {
        if self.halves { Needs::HALVES } else { Needs::default() }
    }

    fn judge(&mut self, _: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        Ok(vec![Verdict::new(true); tiles.len()])
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [size, spp, names @ ..] = args.as_slice() else {
        return Err("exposure WIDTHxHEIGHT SPP SCENE…".into());
    };
    let (width, height) = size.split_once('x').ok_or("WIDTHxHEIGHT")?;
    let (size, spp): ((usize, usize), u64) = ((width.parse()?, height.parse()?), spp.parse()?);
    let batch = |step| Params::default().with_schedule(Schedule::Spaced { step });
    let options = [
        ("default", true, Params::default()),
        ("seed 2", true, Params::default()),
        ("--batch 16", true, batch(16)),
        ("--batch 64", true, batch(64)),
        ("--batch 256", true, batch(256)),
        ("--min-spp 64", true, Params::default().with_min_spp(64)),
        ("--tile 32", true, Params::default().with_tile(32)),
        ("--tile 64", true, Params::default().with_tile(64)),
        ("without halves", false, Params::default()),
    ];
    println!("| scene | {} | converged |", options.clone().map(|(name, ..)| name).join(" | "));
    println!("|---|{}---|", "---|".repeat(options.len()));
    for name in names {
        let scene = Arc::new(match scenes::by_name(name) {
            Some(scene) => scene,
            None => noisefloor_scenefile::load(Path::new(name))?.scene,
        });
        let mut cells = Vec::new();
        let converged = converged(&scene, size, spp)?;
        for (option, halves, params) in options.clone() {
            let seed = if option == "seed 2" { 2 } else { 1 };
            let (exposure, at) = first_stop(source(&scene, size, seed)?, Hasty { halves }, params)?;
            cells.push(format!("{:+.1} % ({at})", 100.0 * (exposure / converged - 1.0)));
        }
        println!("| {} | {} | {converged:.3} |", scene.name(), cells.join(" | "));
    }
    Ok(())
}

fn source(scene: &Arc<Scene>, (width, height): (usize, usize), seed: u64) -> Result<Ptwne, Box<dyn Error>> {
    Ok(Ptwne::new(scene.clone(), width, height, RenderOptions { seed, ..RenderOptions::default() })?)
}

fn converged(scene: &Arc<Scene>, size: (usize, usize), spp: u64) -> Result<f32, Box<dyn Error>> {
    let params = Params::default().with_max_spp(spp);
    let mut driver = Driver::new(source(scene, size, 7)?, FixedSpp(spp), params)?;
    driver.run(|_, _| ())?;
    Ok(ToneMapping::default().settle(&driver.session().film().image()).exposure())
}

/// The exposure when a tile first stops, and its samples per pixel.
fn first_stop(source: Ptwne, criterion: Hasty, params: Params) -> Result<(f32, u64), Box<dyn Error>> {
    let mut driver = Driver::new(source, criterion, params)?;
    let mut first = None;
    driver.run(|session, event| {
        if let Event::TileStopped(stop) = event {
            first = first.or(session.display().map(|display| (Display::exposure(display), stop.spp)));
        }
    })?;
    first.ok_or_else(|| "no tile has stopped".into())
}
