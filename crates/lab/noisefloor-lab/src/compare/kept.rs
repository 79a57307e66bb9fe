//! A converged picture that is rendered, kept in a folder, and resumed.

use crate::advance::{Advance, Watch};
use crate::error::LabError;
use crate::files::write_json;
use noisefloor::{
    Film, ProgressiveSource, Repeats, Request, Rgb, SourceInfo, TileGrid, source::SourceIdentity,
};
use noisefloor_image::{RenderLayers, SampleFacts, read_exr, write_exr};
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io;
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

/// Which reference is wanted, beside what the source says of itself.
#[derive(Clone, Debug)]
pub struct ReferenceJob<'a> {
    /// Where it is kept: reference.exr, and reference.json beside it.
    pub folder: &'a Path,
    /// Tile edge in pixels.
    pub tile: usize,
    /// Samples per pixel that are enough.
    pub spp: u64,
    /// Whether a kept picture of something else is rendered anew.
    pub overwrite: bool,
}

/// What reference.json says of reference.exr.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Facts {
    source: SourceIdentity,
    width: usize,
    height: usize,
    /// BLAKE3 of reference.exr.
    digest: String,
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
/// A kept picture of another scene, or of the scene before an edit, is refused unless
/// [`ReferenceJob::overwrite`] is set.
pub fn render_reference(
    source: &mut dyn ProgressiveSource,
    job: &ReferenceJob<'_>,
    cancel: &AtomicBool,
    watch: Watch<'_>,
) -> Result<Converged, LabError> {
    let info = source.info();
    let mut kept = Kept::new(job, &info, source.identity()?)?;
    kept.resume(job, info.repeats == Repeats::Samples)?;
    let mut saved = Instant::now();
    while kept.spp() < job.spp {
        let (first, tiles) = (kept.spp(), kept.film.grid().tiles());
        let spp = (job.spp - first).min(STEP);
        let requests: Vec<Request> = tiles.map(|tile| Request::new(tile, first, spp)).collect();
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

struct Kept {
    facts: Facts,
    film: Film,
}

impl Kept {
    fn new(job: &ReferenceJob<'_>, info: &SourceInfo, source: SourceIdentity) -> Result<Self, LabError> {
        let facts = Facts { source, width: info.width, height: info.height, digest: String::new(), spp: 0 };
        let film = Film::without_halves(TileGrid::new(info.width, info.height, job.tile)?);
        Ok(Self { facts, film })
    }

    /// Samples per pixel so far.
    fn spp(&self) -> u64 {
        self.film.spp(0)
    }

    /// Takes up what the folder has, if it is enough, or of samples that can be told from new ones.
    fn resume(&mut self, job: &ReferenceJob<'_>, repeats: bool) -> Result<(), LabError> {
        let kept = match self.kept(job.folder) {
            Ok(Some(kept)) => kept,
            Err(error) if !job.overwrite => return Err(error),
            _ => return Ok(()),
        };
        if kept.spp < job.spp && !repeats {
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

    /// What the folder says of its picture; `None` if there is none.
    fn kept(&self, folder: &Path) -> Result<Option<Facts>, LabError> {
        let path = folder.join(PICTURE);
        let unlike = || LabError::KeptReference { path: path.clone() };
        let text = match std::fs::read(folder.join(FACTS)) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound && !path.exists() => return Ok(None),
            Err(_) => return Err(unlike()),
        };
        let kept: Facts = serde_json::from_slice(&text).map_err(|_| unlike())?;
        let other = |what: String| LabError::OtherReference { path: path.clone(), what };
        if let Some(change) = self.facts.source.change_since(&kept.source) {
            return Err(other(change.to_string()));
        }
        let size = |facts: &Facts| format!("{}×{} pixels", facts.width, facts.height);
        if size(&kept) != size(&self.facts) {
            return Err(other(format!("it has {}, not {}", size(&kept), size(&self.facts))));
        }
        // A kill may come between the picture and the file beside it
        if digest(&path).ok().as_ref() != Some(&kept.digest) {
            return Err(unlike());
        }
        Ok(Some(kept))
    }

    fn save(&self, folder: &Path) -> Result<(), LabError> {
        let (pixels, Facts { width, height, .. }) = (self.film.image(), self.facts.clone());
        let facts = SampleFacts { samples: Some((self.spp(), self.spp())), origin: None };
        let layers = RenderLayers { facts: Some(&facts), ..RenderLayers::rgb(width, height, &pixels) };
        write_exr(folder.join(PICTURE), &layers)?;
        let digest = digest(&folder.join(PICTURE))
            .map_err(|source| LabError::Folder { path: folder.to_owned(), source })?;
        write_json(&folder.join(FACTS), &Facts { spp: self.spp(), digest, ..self.facts.clone() })?;
        Ok(())
    }
}

/// BLAKE3 of a file.
fn digest(path: &Path) -> io::Result<String> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(File::open(path)?)?;
    Ok(hasher.finalize().to_hex().to_string())
}
