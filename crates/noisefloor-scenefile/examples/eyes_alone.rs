//! What it costs to count what is not known: samples that a scene takes as the oracle judges, and by its eyes alone, which take
//! exposure, noise and light for known. `benchmarks/figures.py guards` runs it.
//!
//! `eyes_alone SCENE WIDTHxHEIGHT TILE SEED MOST [dot]`: SCENE is built-in or a file; `dot` gives one sample in the middle 10,000
//! times the light of the picture. Prints the mean samples per pixel of both, tiles that have converged with both, the mean of
//! both over these, tiles that have converged with either, and what tiles were last open for, as lines `NAME VALUE`.
#![allow(clippy::print_stdout, reason = "it is what this example is for")]

use noisefloor::criterion::{CriterionError, Needs, OpenFor, View};
use noisefloor::descriptor::Described;
use noisefloor::evidence::TilePlanes;
use noisefloor::{
    Batch, Driver, Oracle, Params, ProgressiveSource, Request, SourceError, SourceInfo, StopReason,
    StoppingCriterion, Tile, TileGrid, Verdict,
};
use noisefloor_ptwne::{Ptwne, RenderOptions, scenes};
use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;

/// Light of the dot, in means of its first batch.
const DOT: f32 = 1e4;

/// The oracle's verdicts on noise, with nothing that is not known.
struct EyesAlone {
    oracle: Oracle,
    described: Vec<Option<Described>>,
}

impl StoppingCriterion for EyesAlone {
    fn name(&self) -> String {
        "eyes alone".into()
    }

    fn fingerprint(&self) -> String {
        self.oracle.fingerprint()
    }

    fn begin(&mut self, grid: TileGrid) {
        self.described = vec![None; grid.len()];
    }

    fn needs(&self) -> Needs {
        self.oracle.needs()
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        for tile in view.film.grid().tiles() {
            let spp = view.film.spp(tile.index) as f64;
            let due = tiles.iter().any(|due| due.index == tile.index);
            if due || self.described[tile.index].as_ref().is_none_or(|seen| seen.spp != spp) {
                let planes = TilePlanes::from_halves(view.film, view.display, tile);
                self.described[tile.index] = Some(self.oracle.describe(&planes, spp)?);
            }
        }
        let all: Vec<Described> = self.described.iter().flatten().cloned().collect();
        let verdicts = self.oracle.judge_described(&all);
        Ok(tiles.iter().map(|tile| verdicts[tile.index]).collect())
    }
}

/// A renderer whose first batch of the tile in the middle has a dot.
struct Dotted(Ptwne);

impl ProgressiveSource for Dotted {
    fn info(&self) -> SourceInfo {
        self.0.info()
    }

    fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
        let SourceInfo { width, height, .. } = self.info();
        let (x, y) = (width / 2 + 6, height / 2 + 6);
        let mut batches = self.0.sample(requests)?;
        for (batch, request) in batches.iter_mut().zip(requests) {
            let Tile { x: left, y: top, width, height, .. } = batch.tile;
            if request.first == 0 && (left..left + width).contains(&x) && (top..top + height).contains(&y) {
                let mean = batch.mean.iter().map(|pixel| pixel[1]).sum::<f32>() / batch.mean.len() as f32;
                batch.mean[(y - top) * width + x - left] = [DOT * mean / batch.spp as f32; 3];
            }
        }
        Ok(batches)
    }
}

/// Of each tile: samples, whether it has converged, and what it was last open for.
type Ends = Vec<(u64, bool, Option<OpenFor>)>;

fn render(
    source: Box<dyn ProgressiveSource>,
    criterion: impl StoppingCriterion,
    params: Params,
) -> Result<Ends, Box<dyn Error>> {
    let mut driver = Driver::new(source, criterion, params)?;
    let mut last = vec![None; driver.session().film().grid().len()];
    driver.run(|session, _| {
        for (tile, last) in last.iter_mut().enumerate().filter(|(tile, _)| session.verdict(*tile).is_some()) {
            *last = session.open_for(tile).or(*last);
        }
    })?;
    let stops = driver.session().stops().zip(last);
    Ok(stops.map(|(stop, last)| (stop.spp, stop.reason == StopReason::Converged, last)).collect())
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let (scene, size, tile, seed, most, dot) = match words.iter().map(String::as_str).collect::<Vec<_>>()[..]
    {
        [scene, size, tile, seed, most] => (scene, size, tile, seed, most, false),
        [scene, size, tile, seed, most, "dot"] => (scene, size, tile, seed, most, true),
        _ => return Err("see the first lines of eyes_alone.rs".into()),
    };
    let (width, height) = size.split_once('x').ok_or("a size is WIDTHxHEIGHT")?;
    let params = Params::default().with_tile(tile.parse()?).with_max_spp(most.parse()?);
    let scene = match scenes::by_name(scene) {
        Some(scene) => std::sync::Arc::new(scene),
        None => noisefloor_scenefile::load(Path::new(scene))?.scene.into(),
    };
    let options = RenderOptions { seed: seed.parse()?, ..RenderOptions::default() };
    let source = || -> Result<Box<dyn ProgressiveSource>, Box<dyn Error>> {
        let source = Ptwne::new(scene.clone(), width.parse()?, height.parse()?, options)?;
        Ok(if dot { Box::new(Dotted(source)) } else { Box::new(source) })
    };
    let oracle = render(source()?, Oracle::bundled(), params.clone())?;
    let eyes = render(source()?, EyesAlone { oracle: Oracle::bundled(), described: Vec::new() }, params)?;

    let mean = |ends: &Ends| ends.iter().map(|end| end.0 as f64).sum::<f64>() / ends.len() as f64;
    let (all, both): (Ends, Ends) =
        oracle.iter().zip(&eyes).filter(|(a, b)| a.1 && b.1).map(|(a, b)| (*a, *b)).unzip();
    println!(
        "oracle {:.1}\neyes {:.1}\ntiles {}\nboth {}",
        mean(&oracle),
        mean(&eyes),
        oracle.len(),
        both.len()
    );
    println!("oracle-both {:.1}\neyes-both {:.1}", mean(&all), mean(&both));
    let done = |ends: &Ends| ends.iter().filter(|end| end.1).count();
    println!("oracle-done {}\neyes-done {}", done(&oracle), done(&eyes));
    let mut counts: BTreeMap<OpenFor, usize> = BTreeMap::new();
    oracle.iter().for_each(|end| *counts.entry(end.2.unwrap_or(OpenFor::Noise)).or_default() += 1);
    counts.into_iter().for_each(|(why, count)| println!("{} {count}", why.name()));
    Ok(())
}
