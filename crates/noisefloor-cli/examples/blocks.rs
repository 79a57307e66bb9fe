//! What blocks save: `blocks SIZE TILE REFERENCE SCENE…` renders built-in scenes at SIZE×SIZE pixels with
//! tiles of TILE, with and without blocks and with needs that are known beforehand, and prints a Markdown
//! table. The converged picture has REFERENCE samples of another seed, from which the needs are known, too.
//!
//! `blocks bias SEEDS SCENE…` compares the means of small pictures with those of uniform sampling.
#![allow(clippy::print_stdout, reason = "an example prints")]

use noisefloor::{
    Driver, Film, Oracle, Params, ProgressiveSource, Request, Rgb, Schedule, StoppingCriterion, Tile,
    TileGrid, ToneMapping, Verdict, Viewing,
    criterion::{CriterionError, Needs, View},
    display::Display,
    driver::Clock,
};
use noisefloor_ptwne::{Ptwne, RenderOptions, scenes};
use noisefloor_rivals::metrics;
use noisefloor_vision::VisionModel;
use std::error::Error;

/// Every tile stops here at last.
const MOST: u64 = 600;
/// Where the curve of uniform sampling has points.
const CURVE: [u64; 13] = [24, 32, 48, 64, 80, 100, 140, 200, 280, 400, 560, 800, 1120];
const NAMES: [&str; 6] = [
    "FLIP, tile",
    "FLIP, block",
    "FLIP, 1 % of blocks",
    "butteraugli, tile",
    "butteraugli, block",
    "JOD, tile",
];

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let [first, seeds, names @ ..] = &arguments[..]
        && first == "bias"
    {
        println!("| scene | spp of a block | z of the picture | largest z of 16 blocks |");
        println!("|---|---|---|---|");
        return names.iter().try_for_each(|name| compare_means(name, seeds.parse()?));
    }
    let [size, tile, reference, names @ ..] = &arguments[..] else {
        return Err("SIZE TILE REFERENCE SCENE…".into());
    };
    let (size, tile, reference) = (size.parse()?, tile.parse()?, reference.parse()?);
    println!("| scene | blocks | verdicts every | spp | stopped | seconds, oracle | {} |", NAMES.join(" | "));
    println!("|---|---|---|---|---|---|{}", "---|".repeat(NAMES.len()));
    for name in names {
        measure(name, size, tile, reference)?;
    }
    Ok(())
}

fn source(name: &str, size: usize, seed: u64) -> Result<Ptwne, Box<dyn Error>> {
    let scene = scenes::by_name(name).ok_or_else(|| format!("no built-in scene {name:?}"))?;
    Ok(Ptwne::new(scene, size, size, RenderOptions { seed, ..RenderOptions::default() })?)
}

/// Adds samples to every tile.
fn add(film: &mut Film, source: &mut Ptwne, spp: u64) -> Result<(), Box<dyn Error>> {
    let request = |tile: Tile| Request { tile, first: film.spp(tile.index), spp };
    for batch in source.sample(&film.grid().tiles().map(request).collect::<Vec<_>>())? {
        film.add(batch.tile.index, spp, &batch.mean)?;
    }
    Ok(())
}

fn measure(name: &str, size: usize, tile: usize, reference: u64) -> Result<(), Box<dyn Error>> {
    let grid = TileGrid::new(size, size, tile)?;
    let (mut converged, mut other) = (Film::new(grid), source(name, size, 2)?);
    for _ in 0..2 {
        add(&mut converged, &mut other, reference / 2)?;
    }
    let display = ToneMapping::default().settle(&converged.image());
    let yardstick = Yardstick::new(grid, display, &converged.image());

    let (mut film, mut even, mut curve) = (Film::without_halves(grid), source(name, size, 1)?, Vec::new());
    let mut runs = Vec::new();
    for (blocks, known, step) in
        [(0, false, 100), (0, false, 20), (16, false, 100), (16, false, 20), (32, false, 20), (16, true, 20)]
    {
        let criterion = Known { oracle: Oracle::bundled(), film: known.then_some(&converged), until: None };
        let schedule = Schedule::Every { step };
        let params = Params { tile, blocks, schedule, min_spp: 0, max_spp: MOST, ..Params::default() };
        let mut driver = Driver::new(source(name, size, 1)?, criterion, params)?;
        driver.session_mut().set_display(display);
        driver.run(|_, _| ())?;
        let Clock { criterion_seconds, total_seconds, .. } = driver.clock();
        let film = driver.session().film();
        let stopped = driver.session().stops().filter(|stop| stop.reason.is_satisfied()).count();
        let spp = film.total_samples() as f64 / (size * size) as f64;
        let what = format!("{blocks}{}", if known { ", known" } else { "" });
        let said = format!(
            "| {name} | {what} | {step} | {spp:.0} | {stopped}/{} | {total_seconds:.0}, {criterion_seconds:.2} |",
            grid.len()
        );
        runs.push((said, spp, yardstick.distances(&film.image())?));
    }
    let furthest = runs.iter().map(|(_, spp, _)| *spp).fold(0.0, f64::max) * 1.9;
    for spp in CURVE.into_iter().take_while(|&spp| (spp as f64) < furthest.max(64.0)) {
        let new = spp - film.spp(0);
        add(&mut film, &mut even, new)?;
        curve.push((spp as f64, yardstick.distances(&film.image())?));
    }
    for (said, spp, distances) in runs {
        let ratio = |(i, &distance): (usize, &f64)| {
            let points: Vec<(f64, f64)> = curve.iter().map(|(spp, d)| (*spp, d[i])).collect();
            crossing(&points, distance).map_or("–".to_owned(), |uniform| format!("{:.2}", uniform / spp))
        };
        let ratios: Vec<String> = distances.iter().enumerate().map(ratio).collect();
        println!("{said} {} |", ratios.join(" | "));
    }
    Ok(())
}

/// Where a curve that falls first comes down to a value, between its points on logarithms.
fn crossing(curve: &[(f64, f64)], value: f64) -> Option<f64> {
    let (a, b) =
        curve.windows(2).map(|pair| (pair[0], pair[1])).find(|(a, b)| a.1 >= value && b.1 <= value)?;
    let share = if a.1 > b.1 { (a.1 / value).ln() / (a.1 / b.1).ln() } else { 0.0 };
    Some(a.0 * (b.0 / a.0).powf(share))
}

/// Samples per pixel of the pictures that are compared.
const UNTIL: u64 = 128;

/// Whether pictures are as bright with blocks as without, over many seeds: differences of means in standard
/// errors.
fn compare_means(name: &str, seeds: u64) -> Result<(), Box<dyn Error>> {
    let grid = TileGrid::new(64, 64, 16)?;
    // Of each block, and of the whole picture last: sums and sums of squares with blocks and without
    let mut sums = vec![[[0.0; 2]; 2]; grid.len() + 1];
    let mut range = (u64::MAX, 0);
    for seed in 0..seeds {
        for (way, blocks) in [16, 0].into_iter().enumerate() {
            let film = count_only(name, blocks, 2 * seed + way as u64 + 100)?;
            if blocks > 0 {
                let (least, most) = film.spp_range(0);
                range = (range.0.min(least), range.1.max(most));
            }
            let light: Vec<f32> = film.image().iter().map(|pixel| pixel.iter().sum()).collect();
            let of_block = |block: Tile| {
                let sum: f64 = block.rows(64).flatten().map(|pixel| f64::from(light[pixel])).sum();
                sum / block.pixels() as f64
            };
            let mut means: Vec<f64> = grid.tiles().map(of_block).collect();
            means.push(means.iter().sum::<f64>() / means.len() as f64);
            for (sum, mean) in sums.iter_mut().zip(means) {
                sum[way][0] += mean;
                sum[way][1] += mean * mean;
            }
        }
    }
    let n = seeds as f64;
    let z = |sum: &[[f64; 2]; 2]| {
        let variance = sum.map(|[sum, squares]| (squares - sum * sum / n) / (n - 1.0) / n);
        (sum[0][0] - sum[1][0]) / n / (variance[0] + variance[1]).max(f64::MIN_POSITIVE).sqrt()
    };
    let (blocks, whole) = sums.split_at(grid.len());
    let largest = blocks.iter().map(|sum| z(sum).abs()).fold(0.0, f64::max);
    println!("| {name} | {} to {} | {:.2} | {largest:.2} |", range.0, range.1, z(&whole[0]));
    Ok(())
}

/// A picture of 64×64 pixels, one tile, whose blocks get what the oracle says they need.
fn count_only(name: &str, blocks: usize, seed: u64) -> Result<Film, Box<dyn Error>> {
    let criterion = Known { oracle: Oracle::bundled(), film: None, until: Some(UNTIL) };
    let schedule = Schedule::Every { step: 32 };
    let params = Params { tile: 64, blocks, schedule, min_spp: 0, max_spp: UNTIL, ..Params::default() };
    let mut driver = Driver::new(source(name, 64, seed)?, criterion, params)?;
    driver.run(|_, _| ())?;
    Ok(driver.into_parts().1.into_film().0)
}

/// The oracle, which knows what blocks need from a converged film if it is given one, and only counts samples
/// if it is given a number.
struct Known<'a> {
    oracle: Oracle,
    film: Option<&'a Film>,
    until: Option<u64>,
}

impl StoppingCriterion for Known<'_> {
    fn name(&self) -> String {
        self.oracle.name()
    }

    fn fingerprint(&self) -> String {
        self.oracle.fingerprint()
    }

    fn begin(&mut self, grid: TileGrid) {
        self.oracle.begin(grid);
    }

    fn needs(&self) -> Needs {
        self.oracle.needs()
    }

    fn block_needs(&self, view: &View<'_>, tiles: &[Tile], edge: usize) -> Option<Vec<Option<Vec<f64>>>> {
        self.oracle.block_needs(&View { film: self.film.unwrap_or(view.film), ..*view }, tiles, edge)
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let Some(until) = self.until else { return self.oracle.judge(view, tiles) };
        let enough = |tile: &Tile| view.film.spp(tile.index) >= until;
        Ok(tiles.iter().map(|tile| Verdict { converged: enough(tile), ..Verdict::default() }).collect())
    }
}

/// The converged picture, and how far others are from it.
struct Yardstick {
    grid: TileGrid,
    blocks: TileGrid,
    display: Display,
    shown: Vec<Rgb>,
    vision: VisionModel,
}

impl Yardstick {
    fn new(grid: TileGrid, display: Display, image: &[Rgb]) -> Self {
        let blocks = TileGrid::new(grid.width(), grid.height(), 16).expect("blocks of 16 pixels");
        let shown = image.iter().map(|&pixel| display.encode(pixel)).collect();
        Self { grid, blocks, display, shown, vision: VisionModel::new(&Viewing::default()) }
    }

    /// In the order of [`NAMES`], greater where it is worse.
    fn distances(&self, image: &[Rgb]) -> Result<[f64; 6], Box<dyn Error>> {
        let (width, height) = (self.grid.width(), self.grid.height());
        let shown: Vec<Rgb> = image.iter().map(|&pixel| self.display.encode(pixel)).collect();
        let flip =
            metrics::flip(&self.shown, &shown, width, height, Viewing::default().pixels_per_degree())?.values;
        let butteraugli = metrics::butteraugli(&self.shown, &shown, width, height)?.values;
        let tiles: Vec<Tile> = self.grid.tiles().collect();
        let jods = metrics::cvvdp_of_tiles(&self.shown, &shown, self.grid, &tiles, &self.vision)?;
        let flips = pooled(self.blocks, &flip, 1);
        Ok([
            *pooled(self.grid, &flip, 1).last().expect("tiles"),
            *flips.last().expect("blocks"),
            flips[flips.len() * 99 / 100],
            *pooled(self.grid, &butteraugli, 3).last().expect("tiles"),
            *pooled(self.blocks, &butteraugli, 3).last().expect("blocks"),
            10.0 - jods.into_iter().fold(10.0, f64::min),
        ])
    }
}

/// Means of this order over the cells of a grid, in rising order.
fn pooled(grid: TileGrid, values: &[f32], order: i32) -> Vec<f64> {
    let of = |cell: Tile| {
        let powers: f64 =
            cell.rows(grid.width()).flatten().map(|pixel| f64::from(values[pixel]).powi(order)).sum();
        (powers / cell.pixels() as f64).powf(1.0 / f64::from(order))
    };
    let mut all: Vec<f64> = grid.tiles().map(of).collect();
    all.sort_by(f64::total_cmp);
    all
}
