//! The gallery: several pictures of one view.

use crate::error::{FileFault, StudyError};
use noisefloor::{
    TileGrid,
    evidence::Samples,
    stills::{Still, StillError},
    tile::TileError,
};
use noisefloor_image::{ReadOptions, read_facts, read_picture_with};
use noisefloor_vision::VisionError;
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;
use thiserror::Error;

pub(crate) const MAX_PICTURES: usize = 64;
/// Most pixels of all pictures together; each takes 12 bytes.
pub(crate) const MAX_GALLERY_PIXELS: usize = 48 << 20;
const MAX_TILES: usize = 1024;

#[derive(Debug, Error)]
pub(crate) enum GalleryError {
    #[error("there are {MAX_PICTURES} pictures already; take some away")]
    Many,
    #[error(
        "all pictures together would have more than {MAX_GALLERY_PIXELS} pixels; take some away, or crop them"
    )]
    Large,
    #[error("{name} does not fit the pictures that are there: {source}; begin anew for another view")]
    Misfit { name: String, source: StillError },
    #[error("there is no such picture; it may have been taken away")]
    Gone,
    #[error("say how many samples per pixel {0} was made of")]
    NoSamples(String),
    #[error(transparent)]
    Still(#[from] StillError),
    #[error(transparent)]
    Tile(#[from] TileError),
    #[error("{0} tiles are more than {MAX_TILES}; take larger ones")]
    Tiles(usize),
    #[error(transparent)]
    Vision(#[from] VisionError),
}

#[derive(Clone, Debug)]
pub struct GalleryPicture {
    /// BLAKE3 digest of the file, hexadecimal: equal files are the same picture, whatever their names.
    pub id: String,
    pub name: String,
    /// Whether the samples per pixel are known.
    pub(crate) counted: bool,
    /// The pixels. The sample count is a placeholder while unknown.
    pub(crate) still: Arc<Still>,
}

/// A picture as the page sees it.
#[derive(Debug, Serialize)]
pub(crate) struct PictureView {
    id: String,
    name: String,
    width: usize,
    height: usize,
    spp: Option<f64>,
}

impl GalleryPicture {
    /// Reads a PNG, EXR or PFM file, of an EXR the named layer if it has it. An EXR may state its samples per
    /// pixel, as those of `noisefloor render` do; otherwise its name may: `00100.png`, `kitchen-64spp.exr`.
    pub fn read(path: impl AsRef<Path>, layer: Option<&str>) -> Result<Self, StudyError> {
        let path = path.as_ref();
        let name = path.file_name().map_or_else(String::new, |n| n.to_string_lossy().into_owned());
        let layer = layer.map(str::to_owned);
        let options = ReadOptions { most_pixels: MAX_GALLERY_PIXELS, layer, ..ReadOptions::default() };
        let picture = read_picture_with(path, &options)?;
        let facts = read_facts(path)?;
        // Tiles of different counts have none in common: the page asks
        let spp = match facts.samples {
            Some(_) => facts.spp().map(|spp| spp as f64),
            None => samples_in(&name),
        };
        let still = picture.into_still(spp.unwrap_or(1.0)).with_origin(facts.origin);
        still.check().map_err(|_| StudyError::at(path, FileFault::NotFinite))?;
        let mut hash = blake3::Hasher::new();
        let hashed = std::fs::File::open(path).and_then(|mut file| std::io::copy(&mut file, &mut hash));
        hashed.map_err(|fault| StudyError::at(path, fault))?;
        let id = hash.finalize().to_hex()[..32].to_owned();
        Ok(Self { id, name, counted: spp.is_some(), still: Arc::new(still) })
    }

    /// The same by another name.
    pub(crate) fn called(self, name: String) -> Self {
        Self { name, ..self }
    }

    /// Samples per pixel, if known.
    pub fn spp(&self) -> Option<f64> {
        self.counted.then_some(self.still.spp)
    }

    pub(crate) fn view(&self) -> PictureView {
        let (width, height) = self.still.size;
        PictureView { id: self.id.clone(), name: self.name.clone(), width, height, spp: self.spp() }
    }
}

/// Samples per pixel stated by a file name: `00100.png`, `100spp.exr`, `kitchen_100spp.png`, `spp100.png`.
fn samples_in(name: &str) -> Option<f64> {
    let stem = name.rsplit_once('.').map_or(name, |(stem, _)| stem).to_lowercase();
    let whole = stem.parse::<u32>().ok();
    let found = whole.or_else(|| words(&stem).find_map(samples_of_word));
    found.filter(|&n| n > 0).map(f64::from)
}

fn words(stem: &str) -> impl Iterator<Item = &str> {
    stem.split(|c: char| !c.is_alphanumeric()).filter(|word| !word.is_empty())
}

fn samples_of_word(word: &str) -> Option<u32> {
    let word = word.to_lowercase();
    let digits = word.strip_suffix("spp").or_else(|| word.strip_prefix("spp")).filter(|d| !d.is_empty());
    digits?.parse().ok()
}

#[derive(Clone, Debug)]
pub(crate) struct Gallery {
    /// Ordered by samples per pixel; unknown counts come last.
    pub(crate) pictures: Vec<GalleryPicture>,
    /// The name given to the scene, if any.
    pub(crate) named: Option<String>,
    pub(crate) tile: usize,
    /// The relation of their samples, if stated.
    pub(crate) samples: Option<Samples>,
    /// Incremented by every change; older descriptions are stale.
    pub(crate) revision: u64,
}

impl Gallery {
    pub(crate) fn new(tile: usize) -> Self {
        Self { pictures: Vec::new(), named: None, tile, samples: None, revision: 0 }
    }

    /// Adds a picture, unless it is there already.
    pub(crate) fn add(&mut self, mut picture: GalleryPicture) -> Result<(), GalleryError> {
        if self.pictures.iter().any(|p| p.id == picture.id) {
            return Ok(());
        }
        if self.pictures.len() >= MAX_PICTURES {
            return Err(GalleryError::Many);
        }
        let all = self.pictures.iter().chain([&picture]).map(|p| p.still.pixels.len()).sum::<usize>();
        if all > MAX_GALLERY_PIXELS {
            return Err(GalleryError::Large);
        }
        if let Some(first) = self.pictures.first() {
            let misfit = |source| GalleryError::Misfit { name: picture.name.clone(), source };
            first.still.fits(&picture.still).map_err(misfit)?;
        }
        check_grid(&picture.still, self.tile)?;
        // A browser does not say from which folder a file comes
        let (own, mut copies) = (picture.name.clone(), 1);
        while self.pictures.iter().any(|p| p.name == picture.name) {
            copies += 1;
            picture.name = format!("{own} ({copies})");
        }
        self.pictures.push(picture);
        self.changed();
        Ok(())
    }

    pub(crate) fn set_spp(&mut self, id: &str, spp: f64) -> Result<(), GalleryError> {
        if !(spp.is_finite() && (1.0..=1e9).contains(&spp)) {
            return Err(StillError::Spp(spp).into());
        }
        let picture = self.pictures.iter_mut().find(|p| p.id == id).ok_or(GalleryError::Gone)?;
        Arc::make_mut(&mut picture.still).spp = spp;
        picture.counted = true;
        self.changed();
        Ok(())
    }

    pub(crate) fn remove(&mut self, id: &str) -> Result<(), GalleryError> {
        let before = self.pictures.len();
        self.pictures.retain(|p| p.id != id);
        if self.pictures.len() == before {
            return Err(GalleryError::Gone);
        }
        self.changed();
        Ok(())
    }

    pub(crate) fn clear(&mut self) {
        *self = Self { revision: self.revision + 1, ..Self::new(self.tile) };
    }

    pub(crate) fn arrange(
        &mut self,
        tile: usize,
        samples: Option<Samples>,
        scene: Option<String>,
    ) -> Result<(), GalleryError> {
        match self.pictures.first() {
            Some(first) => check_grid(&first.still, tile)?,
            None => TileGrid::new(tile.max(1), tile.max(1), tile).map(drop)?,
        }
        (self.tile, self.samples, self.named) = (tile, samples, scene);
        self.changed();
        Ok(())
    }

    /// Name of the scene: the one given, else that of the picture with most samples, else its digest.
    pub(crate) fn scene(&self) -> String {
        let last = self.pictures.iter().rev().find(|p| p.counted).or(self.pictures.last());
        let of_file = || {
            let picture = last?;
            let stem = picture.name.rsplit_once('.').map_or(&picture.name[..], |(stem, _)| stem);
            let name = words(stem).filter(|w| samples_of_word(w).is_none()).collect::<Vec<_>>().join("-");
            let telling = name.chars().any(char::is_alphabetic);
            Some(if telling { name } else { format!("picture-{}", &picture.id[..8]) })
        };
        self.named.clone().or_else(of_file).unwrap_or_default()
    }

    fn changed(&mut self) {
        self.revision += 1;
        let samples = |p: &GalleryPicture| p.spp().unwrap_or(f64::INFINITY);
        self.pictures.sort_by(|a, b| samples(a).total_cmp(&samples(b)));
    }
}

fn check_grid(still: &Still, tile: usize) -> Result<(), GalleryError> {
    let tiles = TileGrid::new(still.size.0, still.size.1, tile)?.len();
    if tiles > MAX_TILES { Err(GalleryError::Tiles(tiles)) } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_samples() {
        for (name, spp) in
            [("00100.png", 100.0), ("hall_64spp.exr", 64.0), ("spp8.png", 8.0), ("a-12SPP-b.png", 12.0)]
        {
            assert_eq!(samples_in(name), Some(spp), "{name}");
        }
        for name in
            ["a.png", "a1.png", "00000.png", "spp.png", "99999999999.png", "-5.png", ".png", "1.5.png"]
        {
            assert_eq!(samples_in(name), None, "{name}");
        }
    }
}
