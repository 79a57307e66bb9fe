//! Compares the estimated error of denoised pictures with the true one, tile by tile.
//!
//! `validate_denoised FOLDER…`: each folder has the stacks of `noisefloor-lab study stack` of two halves, `a` and
//! `b`, and of the converged picture, `t`, whose two last levels are used. If it also has renders `ga` and `gb`
//! with albedo.exr and normal.exr, all is done once more with these ("guided"). One line of CSV a tile and level
//! goes to standard output. Denoised pictures are kept in the folder. benchmarks/denoising.sh runs all of it.
#![allow(clippy::print_stdout, reason = "it is what this example is for")]

use noisefloor::{Rgb, Tile, TileGrid, ToneMapping, Viewing, source::FirstHits};
use noisefloor_denoise::{DenoisedError, DenoisedHalves, Denoiser, Guides, NoisyPicture, Oidn};
use noisefloor_image::{RenderLayers, read_exr, write_exr};
use noisefloor_sidecar::FilterPlan;
use noisefloor_vision::{VisionModel, VisionWorkspace};
use std::error::Error;
use std::path::{Path, PathBuf};

const TILE: usize = 64;

type Outcome<T> = Result<T, Box<dyn Error>>;

fn main() -> Outcome<()> {
    println!("scene,spp,tile,kind,jods_lost,rms");
    let mut oidn = Oidn::start(FilterPlan::default())?;
    for folder in std::env::args().skip(1).map(PathBuf::from) {
        validate(&folder, &mut oidn)?;
    }
    Ok(())
}

/// The levels of a stack, by samples per pixel.
fn levels(stack: &Path) -> Outcome<Vec<(u64, PathBuf)>> {
    let mut levels = Vec::new();
    for entry in std::fs::read_dir(stack)? {
        let path = entry?.path();
        let spp = path.file_stem().and_then(|stem| stem.to_str()).and_then(|stem| stem.parse().ok());
        levels.extend(spp.map(|spp| (spp, path)));
    }
    levels.sort();
    Ok(levels)
}

fn load(path: &Path) -> Outcome<Vec<Rgb>> {
    Ok(read_exr(path)?.pixels)
}

fn mean(a: &[Rgb], b: &[Rgb]) -> Vec<Rgb> {
    a.iter().zip(b).map(|(a, b)| std::array::from_fn(|c| 0.5 * (a[c] + b[c]))).collect()
}

/// Albedo and normals of a half, if they were rendered.
fn guide(render: &Path) -> Outcome<Option<FirstHits>> {
    if !render.join("normal.exr").exists() {
        return Ok(None);
    }
    let albedo = read_exr(render.join("albedo.exr"))?;
    let normal = load(&render.join("normal.exr"))?;
    Ok(Some(FirstHits::new((albedo.width, albedo.height), albedo.pixels, normal)))
}

fn validate(folder: &Path, oidn: &mut Oidn) -> Outcome<()> {
    let truths = levels(&folder.join("t"))?;
    let [.., (_, earlier), (_, converged)] = truths.as_slice() else {
        return Err("two truths are needed".into());
    };
    let first = read_exr(converged)?;
    let (size, truth) = ((first.width, first.height), first.pixels);
    let display = ToneMapping::default().settle(&truth);
    let scene = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let print = |spp: u64, kind: &str, error: &DenoisedError| print_tiles(&scene, spp, kind, error);
    // Of n samples that contain half as many: their difference is as large as the noise of all
    print(0, "truth", &DenoisedError::known(size, &load(earlier)?, &truth, &display)?)?;
    let others = levels(&folder.join("b"))?;
    let mut guides = vec![("", None)];
    if let (Some(a), Some(b)) = (guide(&folder.join("ga"))?, guide(&folder.join("gb"))?) {
        let guide = Guides::new([a, b]);
        let [a, b] = guide.halves().clone();
        guides.push(("guided-", Some(([a, b, guide.together()], guide.is_clean()))));
    }
    for (half, path) in levels(&folder.join("a"))? {
        let Some((_, other)) = others.iter().find(|(spp, _)| *spp == half) else { continue };
        let (a, b) = (load(&path)?, load(other)?);
        let whole = mean(&a, &b);
        print(2 * half, "noisy", &DenoisedError::known(size, &whole, &truth, &display)?)?;
        for (kind, guides) in &guides {
            let mut denoise = |which: usize, noisy: &[Rgb]| -> Outcome<Vec<Rgb>> {
                let kept = folder.join(format!("{kind}{}{half:05}.exr", ["da", "db", "df"][which]));
                if kept.exists() {
                    return load(&kept);
                }
                let picture = NoisyPicture::new(size, noisy);
                let picture = match guides {
                    Some((guides, clean)) => picture.guided(&guides[which], *clean, oidn.wants()),
                    None => picture,
                };
                let made = oidn.denoise(&picture)?;
                write_exr(&kept, &RenderLayers::rgb(size.0, size.1, &made))?;
                Ok(made)
            };
            let (da, db, all) = (denoise(0, &a)?, denoise(1, &b)?, denoise(2, &whole)?);
            let halves = DenoisedHalves { size, noisy: [&a, &b], denoised: [&da, &db] };
            print(2 * half, &format!("{kind}estimate"), &DenoisedError::new(&halves, &display)?)?;
            print(2 * half, &format!("{kind}true"), &DenoisedError::known(size, &all, &truth, &display)?)?;
        }
    }
    Ok(())
}

fn print_tiles(scene: &str, spp: u64, kind: &str, error: &DenoisedError) -> Outcome<()> {
    let (eyes, mut room) = (VisionModel::new(&Viewing::default()), VisionWorkspace::default());
    let grid = TileGrid::new(error.size().0, error.size().1, TILE)?;
    for tile in grid.tiles() {
        let lost = error.jods_lost(tile, &eyes, &mut room)?;
        println!("{scene},{spp},{},{kind},{lost:.5},{:.4}", tile.index, rms(error, tile));
    }
    Ok(())
}

/// In 8-bit steps.
fn rms(error: &DenoisedError, tile: Tile) -> f32 {
    let squares = tile.rows(error.size().0).flatten().map(|pixel| error.residual()[pixel].powi(2));
    255.0 * (squares.sum::<f32>() / tile.pixels() as f32).sqrt()
}
