//! `noisefloor judge`.

use crate::args::JudgeArgs;
use anyhow::{Context, bail};
use noisefloor::{Evidence, Oracle, Samples, SnapshotPair, Still, Threshold, Tile, TileGrid, Verdict};
use noisefloor_image::maps::{ColourScale, TileMark, draw_field, draw_tiles, noise_scale};
use noisefloor_image::{RenderLayers, check_writable, read_picture, write_exr};
use serde::Serialize;
use std::path::Path;

/// One line of the verdict.
#[derive(Serialize)]
struct Row {
    tile: usize,
    x: usize,
    y: usize,
    width: usize,
    height: usize,
    probability: f32,
    converged: bool,
    /// Samples per pixel at which the tile should be converged; null if that is out of sight.
    expected_spp: Option<u64>,
    /// Whether its texture is unlike any that the model has been tried on; P is then that of half the samples.
    unfamiliar: bool,
}

#[derive(Serialize)]
struct Report<'a> {
    image: &'a Path,
    spp: f64,
    model: String,
    threshold: Threshold,
    converged_tiles: usize,
    unfamiliar_tiles: usize,
    tiles: &'a [Row],
}

pub fn run(args: &JudgeArgs) -> anyhow::Result<()> {
    // Read and check everything that was typed.
    let tone = args.tone.check()?;
    let oracle = args.oracle.load()?;
    if oracle.model().evidence() != Evidence::Halves {
        bail!(
            "this model does not hold tiles against other samples, as `judge` does: use one that was trained on half buffers"
        );
    }
    if args.spp.len() != 1 + args.against.len() {
        bail!(
            "--spp is needed once for each picture: {} given for {} pictures",
            args.spp.len(),
            1 + args.against.len()
        );
    }
    for path in [&args.heat_map, &args.noise_map, &args.exr].into_iter().flatten() {
        check_writable(path)?;
    }
    let just_visible = oracle.just_visible();
    if args.noise_map.is_some() && just_visible.is_none() {
        let name = oracle.model().descriptor().name();
        bail!(
            "--noise-map: a model with the {name} descriptor has no map of visible noise; use one with the compact descriptor"
        );
    }
    let image = read(&args.image, args.spp[0])?;
    let others: Vec<Still> = args
        .against
        .iter()
        .zip(&args.spp[1..])
        .map(|(path, &spp)| read(path, spp))
        .collect::<anyhow::Result<_>>()?;
    for (other, path) in others.iter().zip(&args.against) {
        image.fits(other).with_context(|| format!("{} against {}", args.image.display(), path.display()))?;
    }
    let (width, height) = image.size;
    let grid = TileGrid::new(width, height, args.tile)?;

    // Hold the picture against the others, and judge.
    let samples = match (args.nested, args.independent) {
        (true, _) => Some(Samples::Nested),
        (_, true) => Some(Samples::Independent),
        _ => None,
    };
    let others: Vec<&Still> = others.iter().collect();
    let held = SnapshotPair::new(Evidence::Halves, &image, &others, tone, samples)?;
    if samples.is_none() && held.samples() == Samples::Nested {
        eprintln!(
            "note: the pictures share samples, as stages of one rendering do, and are judged as --nested; --independent overrules"
        );
    }
    let rows = judge(&oracle, grid, &held)?;
    report(args, &oracle, &rows)?;

    // Draw what was asked for.
    let wants_noise = args.noise_map.is_some() || args.exr.is_some();
    let noise =
        if wants_noise { oracle.map_visible_noise(grid, |t| held.planes(t).map(Some))? } else { None };
    if let (Some(path), Some(noise)) = (&args.noise_map, &noise) {
        let map = draw_field(width, &held.shown(), noise, &noise_scale(just_visible));
        map.save(path)?;
    }
    if let Some(path) = &args.exr {
        let mut probability = vec![f32::NAN; image.pixels.len()];
        for row in &rows {
            grid.tile(row.tile).rows(width).flatten().for_each(|pixel| probability[pixel] = row.probability);
        }
        let layers = RenderLayers {
            probability: Some(&probability),
            visible_noise: noise.as_deref(),
            ..RenderLayers::rgb(width, height, &image.pixels)
        };
        write_exr(path, &layers)?;
    }
    if let Some(path) = &args.heat_map {
        let mark = |row: &Row| TileMark {
            tile: grid.tile(row.tile),
            value: f64::from(row.probability),
            label: format!("{:.2}", row.probability),
            unfamiliar: row.unfamiliar,
        };
        let marks: Vec<TileMark> = rows.iter().map(mark).collect();
        let title = "P(no noise\nis seen)";
        let scale = ColourScale {
            title,
            low: 0.0,
            high: 1.0,
            log: false,
            colours: colorous::CIVIDIS,
            landmark: None,
        };
        let map = draw_tiles(width, &held.shown(), &marks, &scale);
        map.save(path)?;
    }
    Ok(())
}

/// A picture that can be judged; errors name it.
fn read(path: &Path, spp: f64) -> anyhow::Result<Still> {
    let still = read_picture(path)?.into_still(spp);
    still.check().with_context(|| format!("{}", path.display()))?;
    Ok(still)
}

fn judge(oracle: &Oracle, grid: TileGrid, held: &SnapshotPair<'_>) -> anyhow::Result<Vec<Row>> {
    let row = |(tile, verdict): (Tile, Verdict)| {
        let Verdict { converged, probability, expected_spp, unfamiliar, .. } = verdict;
        let Tile { index, x, y, width, height } = tile;
        let (probability, expected_spp) = (probability.unwrap_or(0.0), expected_spp);
        Row { tile: index, x, y, width, height, probability, converged, expected_spp, unfamiliar }
    };
    let described = held.describe(oracle, grid)?;
    Ok(grid.tiles().zip(oracle.judge_described(&described)).map(row).collect())
}

fn report(args: &JudgeArgs, oracle: &Oracle, rows: &[Row]) -> anyhow::Result<()> {
    let converged_tiles = rows.iter().filter(|r| r.converged).count();
    let unfamiliar_tiles = rows.iter().filter(|r| r.unfamiliar).count();
    if args.json {
        let report = Report {
            image: &args.image,
            spp: args.spp[0],
            model: oracle.model().digest(),
            threshold: oracle.threshold(),
            converged_tiles,
            unfamiliar_tiles,
            tiles: rows,
        };
        println!("{}", serde_json::to_string_pretty(&report)?);
        return Ok(());
    }
    println!("tile     x     y   size       P  verdict      expected spp");
    for row in rows {
        let verdict = if row.converged { "converged" } else { "noise seen" };
        let expected = row.expected_spp.filter(|_| !row.converged).map_or(String::new(), |n| n.to_string());
        let size = format!("{}×{}", row.width, row.height);
        println!(
            "{:4} {:5} {:5} {size:>8} {:6.3}  {verdict:10} {expected:>14}{}",
            row.tile,
            row.x,
            row.y,
            row.probability,
            if row.unfamiliar { "  unfamiliar" } else { "" }
        );
    }
    println!(
        "{converged_tiles} of {} tiles converged at {} spp (P ≥ {})",
        rows.len(),
        args.spp[0],
        oracle.threshold()
    );
    if unfamiliar_tiles > 0 {
        println!(
            "{unfamiliar_tiles} tiles have texture unlike any the model was tried on: their P is that of half the samples, and less certain"
        );
    }
    Ok(())
}
