//! A converged picture that is rendered, kept in a folder, and resumed.

use crate::advance::{Advance, Watch};
use crate::error::LabError;
use crate::files::write_json;
use noisefloor::{Film, ProgressiveSource, Repeats, Request, Rgb, SourceInfo, TileGrid};
use noisefloor_image::{RenderLayers, SampleFacts, read_exr, write_exr};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// The converged picture of a scene.
#[derive(Clone, Debug)]
pub struct Converged {
    /// Linear radiance, row-major.
    pub pixels: Vec<Rgb>,
    /// Where it comes from, for people.
    pub origin: String,
}

/// What a reference is of, beside what the source says.
#[derive(Clone, Debug)]
pub struct ReferenceJob<'a> {
    /// Where it is kept: reference.exr, and reference.json beside it.
    pub folder: &'a Path,
    /// The scene.
    pub scene: &'a str,
    /// Seed of the source.
    pub seed: u64,
    /// Longest path.
    pub max_depth: Option<u32>,
    /// What else changes the picture that it converges to.
    pub filter: String,
    /// Largest radiance of a sample.
    pub clamp: Option<f32>,
    /// Tile edge in pixels.
    pub tile: usize,
    /// Samples per pixel that are enough.
    pub spp: u64,
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
    filter: String,
    clamp: Option<f32>,
    /// Samples per pixel so far.
    spp: u64,
}

/// Samples per pixel between two looks at the clock.
const STEP: u64 = 64;
/// What a kill may cost.
const SAVE_EVERY: Duration = Duration::from_secs(30);

/// The converged picture of a job: read if the folder has it, resumed if it has some of it and the source
/// promises to repeat its samples, and rendered otherwise. It is saved every half a minute.
///
/// # Errors
/// [`LabError`] if the source fails or has too few samples, or a file cannot be read or written;
/// [`LabError::Cancelled`] once `cancel` is set and what there is has been saved.
pub fn render_reference(
    source: &mut dyn ProgressiveSource,
    job: &ReferenceJob<'_>,
    cancel: &AtomicBool,
    watch: Watch<'_>,
) -> Result<Converged, LabError> {
    let info = source.info();
    let mut kept = Kept::new(job, &info)?;
    kept.resume(job, info.repeats == Repeats::Samples)?;
    let mut saved = Instant::now();
    while kept.spp() < job.spp {
        let (first, tiles) = (kept.spp(), kept.film.grid().tiles());
        let spp = (job.spp - first).min(STEP);
        let requests: Vec<Request> = tiles.map(|tile| Request { tile, first, spp }).collect();
        for batch in source.sample(&requests)? {
            if batch.spp == 0 {
                return Err(LabError::ShortOfSamples { spp: first });
            }
            kept.film.add(batch.tile.index, batch.spp, &batch.mean)?;
        }
        watch(Advance { what: "samples of the reference", done: kept.spp(), of: job.spp, detail: "" });
        let cancelled = cancel.load(Ordering::Relaxed);
        if cancelled || saved.elapsed() >= SAVE_EVERY || kept.spp() >= job.spp {
            kept.save(job.folder)?;
            saved = Instant::now();
        }
        if cancelled {
            return Err(LabError::Cancelled { path: job.folder.join(PICTURE) });
        }
    }
    let origin = format!("a render with {} samples per pixel of another seed", kept.spp());
    Ok(Converged { pixels: kept.film.image(), origin })
}

const PICTURE: &str = "reference.exr";
const FACTS: &str = "reference.json";

/// A reference under way.
struct Kept {
    facts: Facts,
    film: Film,
}

impl Kept {
    fn new(job: &ReferenceJob<'_>, info: &SourceInfo) -> Result<Self, LabError> {
        let facts = Facts {
            scene: job.scene.into(),
            source: info.name.clone(),
            width: info.width,
            height: info.height,
            seed: job.seed,
            max_depth: job.max_depth,
            filter: job.filter.clone(),
            clamp: job.clamp,
            spp: 0,
        };
        let film = Film::without_halves(TileGrid::new(info.width, info.height, job.tile)?);
        Ok(Self { facts, film })
    }

    /// Samples per pixel so far.
    fn spp(&self) -> u64 {
        self.film.spp(0)
    }

    /// Takes up what the folder has, if it is of the same picture, and enough or of samples that can be
    /// told from new ones.
    fn resume(&mut self, job: &ReferenceJob<'_>, repeats: bool) -> Result<(), LabError> {
        let text = std::fs::read(job.folder.join(FACTS)).ok();
        let Some(kept) = text.and_then(|text| serde_json::from_slice::<Facts>(&text).ok()) else {
            return Ok(());
        };
        let same = Facts { spp: 0, ..kept.clone() } == self.facts;
        if !same || (kept.spp < job.spp && !repeats) {
            return Ok(());
        }
        let path = job.folder.join(PICTURE);
        let image = read_exr(&path)?;
        let finite = image.pixels.iter().flatten().all(|c| c.is_finite());
        if kept.spp == 0 || !finite || (image.width, image.height) != (kept.width, kept.height) {
            return Err(LabError::KeptReference { path });
        }
        for tile in self.film.grid().tiles() {
            let of_tile: Vec<Rgb> =
                tile.rows(image.width).flatten().map(|pixel| image.pixels[pixel]).collect();
            self.film.add(tile.index, kept.spp, &of_tile)?;
        }
        Ok(())
    }

    fn save(&self, folder: &Path) -> Result<(), LabError> {
        let (pixels, Facts { width, height, .. }) = (self.film.image(), self.facts.clone());
        let facts = SampleFacts { samples: Some((self.spp(), self.spp())), origin: None };
        let layers = RenderLayers { facts: Some(&facts), ..RenderLayers::rgb(width, height, &pixels) };
        write_exr(folder.join(PICTURE), &layers)?;
        write_json(&folder.join(FACTS), &Facts { spp: self.spp(), ..self.facts.clone() })?;
        Ok(())
    }
}
