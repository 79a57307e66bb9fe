//! `noisefloor compare`: criteria side by side on one run.

mod canvas;
mod crops;
mod page;
mod plots;
mod quality;
mod race;
mod truth;

use crate::INTERRUPTED;
use crate::args::CompareArgs;
use crate::output::{write_csv, write_json};
use crate::render::{AFTER_THIS_BATCH, cancel_on_signal};
use crate::sources::{self, Opened};
use crate::train::bar;
use anyhow::{Context, bail};
use indicatif::ProgressBar;
use noisefloor::{Params, Schedule, SourceInfo, StoppingCriterion, TileGrid};
use noisefloor_image::write_png;
use noisefloor_rivals::RIVALS;
use plots::Panel;
use quality::{Quality, Yardstick};
use race::{Entrant, Race};
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// One line of runs.csv: a criterion on a scene.
#[derive(Clone, Debug, Serialize)]
pub struct Run {
    pub scene: String,
    pub source: String,
    pub criterion: String,
    /// What the criterion calls itself, with its constant.
    pub name: String,
    pub family: String,
    /// Samples per pixel, on average and in the tile with most.
    pub spp_mean: f64,
    pub spp_most: u64,
    pub tiles: usize,
    /// Tiles that the criterion was satisfied with before `--max-spp`.
    pub tiles_converged: usize,
    /// Seconds in the source for these samples, and in the criterion.
    pub source_seconds: f64,
    pub criterion_seconds: f64,
    pub rel_mse: f64,
    pub psnr: f64,
    pub flip: f64,
    pub flip_worst: f64,
    pub butteraugli: f64,
    pub butteraugli_worst: f64,
    /// Samples that uniform sampling takes until its worst tile is as good, by FLIP, over those of this criterion. Empty if it does
    /// not get there.
    pub uniform_over_this: Option<f64>,
    /// The same by butteraugli.
    pub uniform_over_this_butteraugli: Option<f64>,
}

/// One line of curve.csv: uniform sampling.
#[derive(Serialize)]
struct CurveRow<'a> {
    scene: &'a str,
    spp: u64,
    source_seconds: f64,
    rel_mse: f64,
    psnr: f64,
    flip: f64,
    flip_worst: f64,
    butteraugli: f64,
    butteraugli_worst: f64,
}

/// One line of tiles.csv: where a criterion stopped a tile, and how that tile looks.
#[derive(Serialize)]
struct TileRow<'a> {
    scene: &'a str,
    criterion: &'a str,
    tile: usize,
    x: usize,
    y: usize,
    spp: u64,
    flip: f64,
}

/// What became of one scene.
pub struct Compared {
    pub scene: String,
    pub source: String,
    pub size: (usize, usize),
    pub reference: String,
    pub runs: Vec<Run>,
    pub folder: PathBuf,
    /// Crops, as file names in `folder`, with what they show.
    pub crops: Vec<(String, String)>,
}

pub fn run(args: &CompareArgs) -> anyhow::Result<ExitCode> {
    let params = params(args)?;
    if args.reference.is_some() && args.scenes.len() > 1 {
        bail!("--reference is of one scene; {} are given", args.scenes.len());
    }
    args.renderer.set_threads()?;
    std::fs::create_dir_all(&args.out).with_context(|| {
        format!("{}: cannot make this folder; choose another with --out", args.out.display())
    })?;
    let cancel = Arc::new(AtomicBool::new(false));
    cancel_on_signal(Arc::clone(&cancel), AFTER_THIS_BATCH)?;

    let mut all = Vec::new();
    for scene in &args.scenes {
        let (compared, cancelled) = one(args, scene, &params, &cancel)?;
        // All that there is so far, so that a page is there whatever comes after.
        all.push(compared);
        page::write(&args.out, &all)?;
        write_csv(&args.out.join("runs.csv"), all.iter().flat_map(|c| &c.runs))?;
        write_json(&args.out.join("runs.json"), &all.iter().flat_map(|c| &c.runs).collect::<Vec<_>>())?;
        if cancelled {
            eprintln!("warning: broken off; what is there is in {}", args.out.display());
            return Ok(ExitCode::from(INTERRUPTED));
        }
    }
    if !args.quiet {
        all.iter().for_each(print);
        println!("written to {}", args.out.join("index.html").display());
    }
    Ok(ExitCode::SUCCESS)
}

/// Session parameters, checked.
fn params(args: &CompareArgs) -> anyhow::Result<Params> {
    let params = Params {
        tile: args.tile,
        tone_mapping: args.tone.check()?,
        schedule: Schedule::Every { step: args.batch },
        max_samples: args.max_spp,
        ..Params::default()
    };
    params.check().with_context(|| {
        format!("--tile {}, --batch {}, --max-spp {}", args.tile, args.batch, args.max_spp)
    })?;
    Ok(params)
}

/// Every criterion that was asked for, and the same ones at other constants if a sweep was.
fn criteria(args: &CompareArgs) -> anyhow::Result<Vec<(String, Box<dyn StoppingCriterion + Send>)>> {
    let mut all: Vec<(String, Box<dyn StoppingCriterion + Send>)> = Vec::new();
    for spec in &args.criteria {
        all.push((spec.clone(), criterion(spec, args)?));
        let Some(rival) = RIVALS.iter().find(|rival| rival.name == spec) else { continue };
        let (strict, lax) = rival.range;
        for i in 0..args.sweep {
            let place = (f64::from(i) + 0.5) / f64::from(args.sweep);
            let constant = strict * (lax / strict).powf(place);
            // Rounded, so that what is said is what was used.
            let spec = format!("{}:{constant:.2e}", rival.name);
            all.push((spec.clone(), criterion(&spec, args)?));
        }
    }
    Ok(all)
}

/// The criterion of a specification.
pub fn criterion(spec: &str, args: &CompareArgs) -> anyhow::Result<Box<dyn StoppingCriterion + Send>> {
    Ok(if spec == "oracle" { Box::new(args.oracle.load()?) } else { noisefloor_rivals::parse(spec)? })
}

/// Compares on one scene.
fn one(
    args: &CompareArgs,
    scene: &str,
    params: &Params,
    cancel: &AtomicBool,
) -> anyhow::Result<(Compared, bool)> {
    let Opened { mut source, scene: name, warnings } = sources::open(Some(scene), &args.renderer)?;
    if !args.quiet {
        warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    }
    let SourceInfo { width, height, name: source_name, .. } = source.info();
    let size = (width, height);
    let grid = TileGrid::new(width, height, args.tile)?;
    let folder = args.out.join(&name);
    std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;

    // What is wrong with a criterion is found before the reference is rendered.
    let entrants = criteria(args)?
        .into_iter()
        .map(|(spec, criterion)| Entrant::new(spec, criterion, size, params))
        .collect::<anyhow::Result<Vec<_>>>()?;
    let truth = truth::get(args, scene, &folder, size, cancel)?;
    let reference_bar = if args.quiet { ProgressBar::hidden() } else { bar(0, "samples per pixel") };
    let yardstick = |display| Yardstick::new(grid, display, truth.pixels.clone(), args.pixels_per_degree);
    let step = args.batch.div_ceil(2);
    let (race, yardstick) =
        race::run(source.as_mut(), entrants, params, step, &yardstick, cancel, &reference_bar)?;
    reference_bar.finish_and_clear();

    let runs = runs(&race, &yardstick, &name, &source_name)?;
    write(&folder, &name, &race, &yardstick, &runs)?;
    let crops = crops::write(&folder, &race, &yardstick)?;
    let compared =
        Compared { scene: name, source: source_name, size, reference: truth.origin, runs, folder, crops };
    Ok((compared, race.cancelled))
}

/// A line for each entrant.
fn runs(race: &Race, yardstick: &Yardstick, scene: &str, source: &str) -> anyhow::Result<Vec<Run>> {
    let run = |entrant: &Entrant| {
        let film = entrant.film();
        let grid = film.grid();
        let pixels = (grid.width() * grid.height()) as f64;
        let spp_mean = film.total_samples() as f64 / pixels;
        let quality = yardstick.quality(&film.image())?;
        let Quality { rel_mse, psnr, flip, flip_worst, butteraugli, butteraugli_worst } = quality;
        let over = |error: fn(&Quality) -> f64| {
            uniform_samples(race, error, error(&quality)).map(|spp| spp / spp_mean)
        };
        Ok(Run {
            scene: scene.into(),
            source: source.into(),
            criterion: entrant.spec.clone(),
            name: entrant.name(),
            family: entrant.family.clone(),
            spp_mean,
            spp_most: (0..grid.len()).map(|t| film.samples(t)).max().unwrap_or(0),
            tiles: grid.len(),
            tiles_converged: entrant.converged(),
            source_seconds: race.source_seconds(film),
            criterion_seconds: entrant.criterion_seconds,
            rel_mse,
            psnr,
            flip,
            flip_worst,
            butteraugli,
            butteraugli_worst,
            uniform_over_this: over(|q| q.flip_worst),
            uniform_over_this_butteraugli: over(|q| q.butteraugli_worst),
        })
    };
    race.entrants.iter().map(run).collect()
}

/// Samples per pixel at which uniform sampling is as good, between points of its curve along a straight line in logarithms; `None`
/// outside the curve.
fn uniform_samples(race: &Race, error: fn(&Quality) -> f64, wanted: f64) -> Option<f64> {
    let points: Vec<(f64, f64)> =
        race.curve.iter().map(|point| (point.spp as f64, error(&point.quality))).collect();
    crossing(&points, wanted)
}

/// Where a falling curve first comes down to a value.
fn crossing(points: &[(f64, f64)], wanted: f64) -> Option<f64> {
    points.windows(2).find_map(|pair| {
        let [(x0, y0), (x1, y1)] = [pair[0], pair[1]];
        (y0 >= wanted && wanted >= y1 && y1 > 0.0).then(|| {
            let place = if y0 > y1 { (y0 / wanted).ln() / (y0 / y1).ln() } else { 0.0 };
            x0 * (x1 / x0).powf(place)
        })
    })
}

/// What is plotted: its name, and its value of a picture and of a criterion's picture.
type Measure = (&'static str, fn(&Quality) -> f64, fn(&Run) -> f64);

/// Tables, plots and pictures of one scene.
fn write(folder: &Path, scene: &str, race: &Race, yardstick: &Yardstick, runs: &[Run]) -> anyhow::Result<()> {
    write_csv(
        &folder.join("curve.csv"),
        race.curve.iter().map(|point| {
            let Quality { rel_mse, psnr, flip, flip_worst, butteraugli, butteraugli_worst } = point.quality;
            let source_seconds = race.uniform_seconds(point.spp as f64);
            CurveRow {
                scene,
                spp: point.spp,
                source_seconds,
                rel_mse,
                psnr,
                flip,
                flip_worst,
                butteraugli,
                butteraugli_worst,
            }
        }),
    )?;

    // Pictures, and what each tile looks like.
    let (width, height) = (yardstick.grid().width(), yardstick.grid().height());
    let mut rows = Vec::new();
    for entrant in &race.entrants {
        let shown = yardstick.encode(&entrant.film().image());
        let file = format!("{}.png", entrant.spec.replace(':', "-"));
        write_png(folder.join(file), width, height, &crate::heat_map::to_bytes(&shown))?;
        let flip = yardstick.flip_of_tiles(&yardstick.flip(&shown)?);
        rows.extend(yardstick.grid().tiles().zip(flip).map(|(tile, flip)| TileRow {
            scene,
            criterion: &entrant.spec,
            tile: tile.index,
            x: tile.x,
            y: tile.y,
            spp: entrant.film().samples(tile.index),
            flip,
        }));
    }
    write_csv(&folder.join("tiles.csv"), rows.into_iter())?;
    write_png(folder.join("reference.png"), width, height, &crate::heat_map::to_bytes(yardstick.shown()))?;

    // Plots.
    let measures: [Measure; 4] = [
        ("relMSE", |q| q.rel_mse, |r| r.rel_mse),
        ("FLIP, worst tile", |q| q.flip_worst, |r| r.flip_worst),
        ("FLIP, mean", |q| q.flip, |r| r.flip),
        ("butteraugli, worst tile", |q| q.butteraugli_worst, |r| r.butteraugli_worst),
    ];
    for (name, label) in
        [("by-samples", "samples per pixel"), ("by-seconds", "seconds, source and criterion")]
    {
        let cost = |run: &Run| match name {
            "by-samples" => run.spp_mean,
            _ => run.source_seconds + run.criterion_seconds,
        };
        let panel = |&(title, error, of_run): &Measure| Panel {
            title,
            curve: race
                .curve
                .iter()
                .map(|point| {
                    let spp = point.spp as f64;
                    (
                        if name == "by-samples" { spp } else { race.uniform_seconds(spp) },
                        error(&point.quality),
                    )
                })
                .collect(),
            markers: families(runs)
                .into_iter()
                .map(|family| {
                    let of = runs.iter().filter(|run| run.family == family);
                    let mut points: Vec<(f64, f64)> = of.map(|run| (cost(run), of_run(run))).collect();
                    points.sort_by(|a, b| a.0.total_cmp(&b.0));
                    (family.to_owned(), points)
                })
                .collect(),
        };
        plots::write(folder, name, label, &measures.iter().map(panel).collect::<Vec<_>>())?;
    }
    Ok(())
}

/// Names of the families, each once, in the order of the entrants.
pub fn families(runs: &[Run]) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    for run in runs {
        if !names.contains(&run.family.as_str()) {
            names.push(&run.family);
        }
    }
    names
}

fn print(compared: &Compared) {
    println!("{} by {}, against {}", compared.scene, compared.source, compared.reference);
    println!(
        "{:24} {:>8} {:>6} {:>9} {:>9} {:>9}  {:>7} {:>7} {:>7} {:>7}  uniform for the same worst tile",
        "criterion",
        "spp mean",
        "most",
        "satisfied",
        "source s",
        "criter. s",
        "relMSE",
        "FLIP",
        "worst",
        "butter."
    );
    for run in &compared.runs {
        println!(
            "{:24} {:8.0} {:6} {:>9} {:9.2} {:9.3}  {:7.5} {:7.4} {:7.4} {:7.3}  {}",
            run.criterion,
            run.spp_mean,
            run.spp_most,
            format!("{}/{}", run.tiles_converged, run.tiles),
            run.source_seconds,
            run.criterion_seconds,
            run.rel_mse,
            run.flip,
            run.flip_worst,
            run.butteraugli_worst,
            run.uniform_over_this.map_or_else(|| "–".to_owned(), |ratio| format!("×{ratio:.2}")),
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_falling_curve_is_crossed_between_its_points() {
        let curve = [(1.0, 1.0), (4.0, 0.5), (16.0, 0.25)];
        assert_eq!(crossing(&curve, 0.5), Some(4.0));
        let middle = crossing(&curve, 0.5 / 2f64.sqrt()).unwrap();
        assert!((middle - 8.0).abs() < 1e-9, "half way in logarithms: {middle}");
        assert_eq!((crossing(&curve, 2.0), crossing(&curve, 0.2)), (None, None), "outside the curve");
    }
}
