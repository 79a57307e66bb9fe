//! Pictures to learn from how wrong denoised pictures are: benchmarks/denoised_corpus.py runs it.
//!
//! `denoised_corpus render FOLDER SCENE EDGE`: renders a scene with the built-in path tracer, square, as `render --denoise oidn`
//! does, and writes it at many numbers of samples: both halves, what Open Image Denoise makes of each half and of all samples with
//! clean first hits, and the mean of four mirror images; two references with other seeds, and their denoised mean. All files hold
//! linear radiance, `f32`, little-endian, row-major. Halves and references that are there already, from another renderer for instance,
//! are taken as they are. Goes on where it was stopped; `samples.csv` says that all is there.
//!
//! `denoised_corpus estimate FOLDER`: JODs that each tile of 32 pixels, and the square of 64 around it, is estimated to have lost
//! at each number of samples, has truly lost, and its noise has, as lines of CSV.
//!
//! `denoised_corpus jods`: reads pairs of square grey pictures, test and reference, as displayed: the edge as `u32`, then the pixels;
//! and writes the JODs lost, a line each.
#![allow(clippy::print_stdout, reason = "it is what this example is for")]

use noisefloor::{Film, ProgressiveSource, Rgb, Tile, TileGrid, ToneMapping, Viewing, evidence::TilePlanes};
use noisefloor_denoise::{
    DenoisePasses, DenoisedError, DenoisedHalves, Denoiser, Guides, MirrorMean, NoisyPicture, Oidn,
};
use noisefloor_ptwne::{Ptwne, RenderOptions, Scene, scenes};
use noisefloor_sidecar::FilterPlan;
use noisefloor_vision::{VisionModel, VisionWorkspace};
use std::error::Error;
use std::fmt::Write as _;
use std::io::{BufWriter, Read, Write};
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

const TILE: usize = 32;
const SQUARE: usize = 64;
/// Samples per pixel of both halves together.
const LEVELS: [u64; 12] = [16, 32, 48, 64, 96, 128, 192, 256, 384, 512, 768, 1024];
/// Samples per pixel of each of the two references.
const REFERENCE: u64 = 4096;
/// Rays a pixel for first hits, at most, as `render` has it.
const RAYS: u64 = 128;
const SEEDS: [u64; 3] = [1, 77, 78];

type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> Outcome<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["render", folder, scene, edge] => render(Path::new(folder), scene, edge.parse()?),
        ["estimate", folder] => estimate(Path::new(folder)),
        ["jods"] => jods(),
        _ => Err("see the first lines of denoised_corpus.rs".into()),
    }
}

fn load(path: &Path) -> Outcome<Vec<Rgb>> {
    let bytes = std::fs::read(path).map_err(|error| format!("{}: {error}", path.display()))?;
    let values: Vec<f32> =
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    Ok(values.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect())
}

fn keep(path: PathBuf, pixels: &[Rgb]) -> Outcome<()> {
    let bytes: Vec<u8> = pixels.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
    Ok(std::fs::write(path, bytes)?)
}

fn mean(a: &[Rgb], b: &[Rgb]) -> Vec<Rgb> {
    a.iter().zip(b).map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect()
}

fn halves(film: &Film) -> [Vec<Rgb>; 2] {
    let grid = film.grid();
    let mut halves = [0, 1].map(|_| vec![[0.0; 3]; grid.width() * grid.height()]);
    for tile in grid.tiles() {
        for pixel in tile.rows(grid.width()).flatten() {
            let [(a, _), (b, _)] = film.pixel_halves(tile.index, pixel);
            (halves[0][pixel], halves[1][pixel]) = (a, b);
        }
    }
    halves
}

/// Takes samples until each tile has so many.
fn sample(source: &mut Ptwne, film: &mut Film, spp: u64) -> Outcome<()> {
    while film.spp(0) < spp {
        let requests: Vec<_> = film.grid().tiles().map(|tile| film.request(tile.index, 8)).collect();
        for batch in source.sample(&requests)? {
            film.add(batch.tile.index, batch.spp, &batch.mean)?;
        }
    }
    Ok(())
}

fn render(folder: &Path, scene: &str, edge: usize) -> Outcome<()> {
    if folder.join("samples.csv").exists() {
        return Ok(());
    }
    std::fs::create_dir_all(folder)?;
    let (scene, depth, clamp): (Arc<Scene>, _, _) = match scenes::by_name(scene) {
        Some(scene) => (scene.into(), None, None),
        None => {
            let loaded = noisefloor_scenefile::load(Path::new(scene))?;
            (loaded.scene.into(), loaded.max_depth, loaded.clamp)
        }
    };
    let open = |seed: u64| {
        let defaults = RenderOptions { seed, threads: NonZeroUsize::new(1), ..RenderOptions::default() };
        let options = RenderOptions { max_depth: depth.unwrap_or(defaults.max_depth), clamp, ..defaults };
        Ptwne::new(Arc::clone(&scene), edge, edge, options)
    };
    let size = (edge, edge);
    let mut oidn = Arc::new(Mutex::new(Oidn::start(FilterPlan::default())?));
    let wants = oidn.wants();
    let mut source = open(SEEDS[0])?;
    let guides = Guides::render(&mut source, &mut oidn, RAYS)?.ok_or("no first hits")?;
    let [ga, gb] = guides.halves().clone();
    let (both, clean) = (guides.together(), guides.is_clean());
    let mut four = MirrorMean::new(Arc::clone(&oidn), DenoisePasses::Four);
    keep(folder.join("albedo.f32"), &both.albedo)?;
    keep(folder.join("normal.f32"), &both.normal)?;

    let grid = TileGrid::new(edge, edge, TILE)?;
    let mut film = Film::new(grid);
    for level in LEVELS {
        let kept = ["a", "b"].map(|name| folder.join(format!("{name}-{level:05}.f32")));
        let [a, b] = if kept.iter().all(|path| path.exists()) {
            [load(&kept[0])?, load(&kept[1])?]
        } else {
            sample(&mut source, &mut film, level)?;
            halves(&film)
        };
        let all = mean(&a, &b);
        let [pa, pb, pall] = [(&a, &ga), (&b, &gb), (&all, &both)]
            .map(|(noisy, guide)| NoisyPicture::new(size, noisy).guided(guide, clean, wants));
        let [da, db] = oidn.denoise_both([&pa, &pb])?;
        let (once, shown) = (oidn.denoise(&pall)?, four.denoise(&pall)?);
        for (name, picture) in
            [("a", &a), ("b", &b), ("da", &da), ("db", &db), ("once", &once), ("shown", &shown)]
        {
            keep(folder.join(format!("{name}-{level:05}.f32")), picture)?;
        }
    }
    let mut references = Vec::new();
    for (seed, name) in [(SEEDS[1], "reference-a"), (SEEDS[2], "reference-b")] {
        let path = folder.join(format!("{name}.f32"));
        if !path.exists() {
            let (mut source, mut film) = (open(seed)?, Film::without_halves(grid));
            sample(&mut source, &mut film, REFERENCE)?;
            keep(path.clone(), &film.image())?;
        }
        references.push(load(&path)?);
    }
    let truth = mean(&references[0], &references[1]);
    let made = four.denoise(&NoisyPicture::new(size, &truth).guided(&both, clean, wants))?;
    keep(folder.join("reference-denoised.f32"), &made)?;
    Ok(std::fs::write(folder.join("samples.csv"), format!("edge,clean\n{edge},{clean}\n"))?)
}

/// The tile, grown to a square within the picture, as a verdict sees it.
fn around(tile: Tile, edge: usize) -> Tile {
    let at = |place: usize| (place + TILE / 2).saturating_sub(SQUARE / 2).min(edge - SQUARE);
    Tile { index: tile.index, x: at(tile.x), y: at(tile.y), width: SQUARE, height: SQUARE }
}

fn estimate(folder: &Path) -> Outcome<()> {
    let scene = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let picture = |name: &str| load(&folder.join(format!("{name}.f32")));
    let (one, other) = (picture("reference-a")?, picture("reference-b")?);
    let truth = mean(&one, &other);
    let edge = truth.len().isqrt();
    let (size, grid) = ((edge, edge), TileGrid::new(edge, edge, TILE)?);
    let display = ToneMapping::default().settle(&truth);
    let (eyes, mut room) = (VisionModel::new(&Viewing::default()), VisionWorkspace::default());
    let mut out = String::new();
    let mut print = |spp: u64, kind: &str, error: &DenoisedError| -> Outcome<()> {
        for tile in grid.tiles() {
            let [own, square] =
                [tile, around(tile, edge)].map(|part| error.jods_lost(part, &eyes, &mut room));
            writeln!(out, "{scene},{spp},{},{kind},{:.5},{:.5}", tile.index, own?, square?)?;
        }
        Ok(())
    };
    // As strong as the noise of their mean
    let half_of: Vec<Rgb> =
        truth.iter().zip(&one).map(|(&t, a)| std::array::from_fn(|c| (a[c] - t[c]) + t[c])).collect();
    print(0, "reference", &DenoisedError::known(size, &half_of, &truth, &display)?)?;
    let clean = picture("reference-denoised")?;
    print(0, "reference-denoised", &DenoisedError::known(size, &clean, &truth, &display)?)?;
    for level in LEVELS {
        let picture = |name: &str| picture(&format!("{name}-{level:05}"));
        let (a, b, da, db) = (picture("a")?, picture("b")?, picture("da")?, picture("db")?);
        let error =
            DenoisedError::new(&DenoisedHalves { size, noisy: [&a, &b], denoised: [&da, &db] }, &display)?;
        print(level, "estimate", &error)?;
        let shown = picture("shown")?;
        print(level, "true", &DenoisedError::known(size, &shown, &truth, &display)?)?;
        print(level, "true-denoised", &DenoisedError::known(size, &shown, &clean, &display)?)?;
        print(level, "once", &DenoisedError::known(size, &picture("once")?, &truth, &display)?)?;
        print(level, "noisy", &DenoisedError::known(size, &mean(&a, &b), &truth, &display)?)?;
        // The noise as a verdict knows it: half the difference of the halves, on what the denoiser made
        let mut film = Film::new(grid);
        for tile in grid.tiles() {
            for half in [&a, &b] {
                let own: Vec<Rgb> = tile.rows(edge).flatten().map(|pixel| half[pixel]).collect();
                film.add(tile.index, level / 2, &own)?;
            }
        }
        let (mut noise, mut on) = (vec![0.0; edge * edge], error.shown().to_vec());
        for tile in grid.tiles() {
            let planes = TilePlanes::from_halves(&film, &display, tile);
            let values = planes.residual.inside(planes.inner);
            for (pixel, value) in tile.rows(edge).flatten().zip(values) {
                noise[pixel] = value;
            }
        }
        let name = |kind: &str| folder.join(format!("{kind}-{level:05}.luma"));
        for (kind, plane) in
            [("noise", &mut noise), ("on", &mut on), ("error", &mut error.residual().to_vec())]
        {
            std::fs::write(
                name(kind),
                plane.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>(),
            )?;
        }
    }
    Ok(std::io::stdout().write_all(out.as_bytes())?)
}

fn jods() -> Outcome<()> {
    let (mut from, mut to) = (std::io::stdin().lock(), BufWriter::new(std::io::stdout().lock()));
    let (eyes, mut room) = (VisionModel::new(&Viewing::default()), VisionWorkspace::default());
    let mut edge = [0; 4];
    loop {
        match from.read_exact(&mut edge) {
            Err(error) if error.kind() == std::io::ErrorKind::UnexpectedEof => return Ok(to.flush()?),
            read => read?,
        }
        let side = u32::from_le_bytes(edge) as usize;
        if side > 1024 {
            return Err("pictures of at most 1024 pixels to a side".into());
        }
        let mut bytes = vec![0; 8 * side * side];
        from.read_exact(&mut bytes)?;
        let grey: Vec<Rgb> =
            bytes.chunks_exact(4).map(|b| [f32::from_le_bytes([b[0], b[1], b[2], b[3]]); 3]).collect();
        let (test, reference) = grey.split_at(side * side);
        writeln!(to, "{:.5}", 10.0 - eyes.compare(test, reference, (side, side), &mut room)?.jod())?;
    }
}
