//! `noisefloor judge`.

use crate::args::JudgeArgs;
use crate::heat_map::{self, Mark, Scale};
use anyhow::{Context, bail};
use ndarray::Array2;
use noisefloor::{
    Display, Evidence, NoiseMask, Oracle, Rendering, Rgb, Samples, Tile, TileGrid, TilePlanes, Verdict,
};
use noisefloor_exr::{Picture, RenderLayers, check_writable, read_picture, write_exr, write_png};
use rayon::prelude::*;
use serde::Serialize;
use std::path::Path;

/// A picture, linear, and how many samples it has.
struct Input {
    size: (usize, usize),
    pixels: Vec<Rgb>,
    spp: f64,
    /// Shown as it is, not tone mapped.
    display_referred: bool,
    /// Variance of the rounding of its display values.
    rounding: f32,
}

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
    threshold: f32,
    converged_tiles: usize,
    unfamiliar_tiles: usize,
    tiles: &'a [Row],
}

pub fn run(args: &JudgeArgs) -> anyhow::Result<()> {
    // Read and check everything that was typed.
    let tone = args.tone.check()?;
    let oracle = args.oracle.load()?;
    if oracle.model().evidence != Evidence::Halves {
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
        let name = oracle.model().descriptor.name();
        bail!(
            "--noise-map: a model with the {name} descriptor has no map of visible noise; use one with the compact descriptor"
        );
    }
    let image = read(&args.image, args.spp[0])?;
    let others: Vec<Input> = args
        .against
        .iter()
        .zip(&args.spp[1..])
        .map(|(path, &spp)| read(path, spp))
        .collect::<anyhow::Result<_>>()?;
    for (other, path) in others.iter().zip(&args.against) {
        fits(&image, other)
            .with_context(|| format!("{} against {}", args.image.display(), path.display()))?;
    }
    let (width, height) = image.size;
    let grid = TileGrid::new(width, height, args.tile)?;

    // Pool what the picture is held against, and judge.
    let display = if image.display_referred { Display::SRGB } else { tone.settle(&image.pixels) };
    let samples =
        if args.nested || (!args.independent && others.iter().any(|o| shares_samples(&image, o, &display))) {
            Samples::Nested
        } else {
            Samples::Independent
        };
    if samples == Samples::Nested && !args.nested {
        eprintln!(
            "note: the pictures share samples, as stages of one rendering do, and are judged as --nested; --independent overrules"
        );
    }
    let other = pool(others, image.spp, samples)?;
    let evidence = |tile: Tile| evidence(tile, (&image, &other), &display, samples);
    let rows = judge(&oracle, grid, image.spp, evidence)?;
    report(args, &oracle, &rows)?;

    // Draw what was asked for.
    let wants_noise = args.noise_map.is_some() || args.exr.is_some();
    let noise = if wants_noise { oracle.map_visible_noise(grid, |t| evidence(t).map(Some))? } else { None };
    let encode = || image.pixels.iter().map(|&p| display.encode(p)).collect::<Vec<Rgb>>();
    if let (Some(path), Some(noise)) = (&args.noise_map, &noise) {
        let map = heat_map::draw_field(width, &encode(), noise, &heat_map::noise_scale(just_visible));
        write_png(path, map.width, map.height, &map.bytes)?;
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
        let mark = |row: &Row| Mark {
            tile: grid.tile(row.tile),
            value: f64::from(row.probability),
            label: format!("{:.2}", row.probability),
            unfamiliar: row.unfamiliar,
        };
        let marks: Vec<Mark> = rows.iter().map(mark).collect();
        let title = "P(no noise\nis seen)";
        let scale =
            Scale { title, low: 0.0, high: 1.0, log: false, colours: colorous::CIVIDIS, landmark: None };
        let map = heat_map::draw(width, &encode(), &marks, &scale);
        write_png(path, map.width, map.height, &map.bytes)?;
    }
    Ok(())
}

impl Input {
    fn rendering(&self) -> Rendering<'_> {
        Rendering { pixels: &self.pixels, spp: self.spp, rounding: self.rounding }
    }
}

fn read(path: &Path, spp: f64) -> anyhow::Result<Input> {
    if !(spp.is_finite() && spp > 0.0) {
        bail!("{} needs a positive number of samples per pixel, not {spp}", path.display());
    }
    let picture = read_picture(path)?;
    let (size, rounding) = (picture.size(), picture.rounding());
    let display_referred = matches!(picture, Picture::Display(_));
    let pixels = picture.into_linear().pixels;
    if let Some(bad) = pixels.iter().position(|p| !p.iter().all(|c| c.is_finite())) {
        let (x, y) = (bad % size.0, bad / size.0);
        bail!(
            "{}: pixel ({x}, {y}) is not finite; mend the render, or paint over it, before it is judged",
            path.display()
        );
    }
    Ok(Input { size, pixels, spp, display_referred, rounding })
}

fn fits(image: &Input, other: &Input) -> anyhow::Result<()> {
    let ((w, h), (ow, oh)) = (image.size, other.size);
    if (w, h) != (ow, oh) {
        bail!("the pictures have different sizes, {w}×{h} and {ow}×{oh}");
    }
    if image.display_referred != other.display_referred {
        bail!("one is a PNG and one an EXR; compare pictures of one kind");
    }
    if image.pixels == other.pixels {
        bail!(
            "the pictures are the same to the last bit, so that nothing shows their noise; render one with another seed"
        );
    }
    Ok(())
}

/// Independent renderings make one of all their samples. Of nested ones, the one that differs most in its samples says most.
fn pool(others: Vec<Input>, image_spp: f64, samples: Samples) -> anyhow::Result<Input> {
    let distance = |r: &Input| (1.0 / r.spp - 1.0 / image_spp).abs();
    let pooled = match samples {
        Samples::Nested => others.into_iter().max_by(|a, b| distance(a).total_cmp(&distance(b))),
        Samples::Independent => others.into_iter().reduce(|mut all, one| {
            let weight = (one.spp / (all.spp + one.spp)) as f32;
            for (a, b) in all.pixels.iter_mut().flatten().zip(one.pixels.iter().flatten()) {
                *a += (b - *a) * weight;
            }
            all.rounding = all.rounding * (1.0 - weight).powi(2) + one.rounding * weight * weight;
            all.spp += one.spp;
            all
        }),
    };
    pooled.context("nothing to hold the picture against: give --against")
}

/// Whether two pictures look like stages of one rendering, in the noise masks of their green channels.
///
/// With d = A − B and s = A + B, Σd·s is N·(Var A − Var B) = Nσ²·(1/a − 1/b) either way, since texture does not correlate with d. Σd² is
/// Nσ²·(1/a + 1/b) for independent samples, and Nσ²·|1/a − 1/b| for nested ones. Between the two expected ratios, the nearer one in the
/// logarithm decides; where they differ by less than threefold it cannot be told, and matters little. As many samples are not nested.
fn shares_samples(image: &Input, other: &Input, display: &Display) -> bool {
    let (a, b) = (1.0 / image.spp, 1.0 / other.spp);
    let independent = (a + b) / (a - b).abs();
    if !independent.is_finite() || independent < 3.0 {
        return false;
    }
    let mask = NoiseMask::default();
    let green = |input: &Input| {
        let encoded = input.pixels.iter().map(|p| display.encode(*p)[1]).collect();
        Array2::from_shape_vec((input.size.1, input.size.0), encoded).map(|plane| mask.apply(&plane))
    };
    let (Ok(image_mask), Ok(other_mask)) = (green(image), green(other)) else { return false };
    let (mut difference, mut product) = (0.0f64, 0.0f64);
    for (&x, &y) in image_mask.iter().zip(&other_mask) {
        let (d, s) = (f64::from(x - y), f64::from(x + y));
        difference += d * d;
        product += d * s * (a - b).signum();
    }
    let rounding = f64::from(mask.white_noise_gain() * (image.rounding + other.rounding));
    difference -= rounding * image.pixels.len() as f64;
    difference > 0.0 && product > difference / independent.sqrt()
}

/// What a tile is judged by.
fn evidence(
    tile: Tile,
    (image, other): (&Input, &Input),
    display: &Display,
    samples: Samples,
) -> anyhow::Result<TilePlanes> {
    let pair = (image.rendering(), other.rendering());
    TilePlanes::from_pair(image.size, tile, display, pair, samples).with_context(|| {
        format!(
            "nested pictures of the same {} samples per pixel are the same picture: nothing to judge by",
            image.spp
        )
    })
}

fn judge(
    oracle: &Oracle,
    grid: TileGrid,
    spp: f64,
    evidence: impl Fn(Tile) -> anyhow::Result<TilePlanes> + Sync,
) -> anyhow::Result<Vec<Row>> {
    let tiles: Vec<Tile> = grid.tiles().collect();
    let describe = |&tile: &Tile| anyhow::Ok(oracle.describe(&evidence(tile)?, spp.max(1.0))?);
    let described = tiles.par_iter().map(describe).collect::<Result<Vec<_>, _>>()?;
    let row = |(tile, verdict): (Tile, Verdict)| {
        let Verdict { converged, probability, expected_samples, unfamiliar } = verdict;
        let Tile { index, x, y, width, height } = tile;
        let (probability, expected_spp) = (probability.unwrap_or(0.0), expected_samples);
        Row { tile: index, x, y, width, height, probability, converged, expected_spp, unfamiliar }
    };
    Ok(tiles.into_iter().zip(oracle.judge_described(&described)).map(row).collect())
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
