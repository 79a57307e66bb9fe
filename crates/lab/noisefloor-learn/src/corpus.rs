//! Thresholds that observers gave, and the images they judged.
//!
//! A corpus is a folder with `thresholds.csv` (columns scene, renderer, zone, x, y, width, height, human_spp,
//! first_spp, last_spp, and, if wanted, reference_spp; one line a zone, in any order of columns) and one of two
//! layouts:
//! - a folder a scene, named as in the table, with running means named by samples per pixel
//!   (`<scene>/00100.png`), for any number of scenes; zones are rectangles of these images;
//! - a folder a zone (`zone07/batch_00060_00100.exr`) with batch means, for one scene; an image is only
//!   the zone, and x, y say where it lay in the full picture.
//!
//! `reference_spp` says how many samples the picture has that people compared with, if it contains those of the
//! pictures they judged, or `inf` if it has no noise. Without that column it is the last running mean, and
//! clean beside batches.
//!
//! A scene may have a noise-free reference of the full picture, in linear light, in its folder or beside
//! those of its zones: `reference.exr`.

mod error;
mod levels;
mod table;
mod zone;

pub use error::CorpusError;
pub use levels::{Encoding, JudgedImage, JudgedImages, Patch};
pub use table::ThresholdRow;
pub use zone::{JudgedZone, ZoneImages};

use noisefloor_image::{batches, running_means};
use std::path::Path;

/// A corpus: zones with thresholds, in the order of the table.
#[derive(Clone, Debug)]
pub struct Corpus {
    zones: Vec<JudgedZone>,
}

impl Corpus {
    /// Reads `thresholds.csv` and checks that the images of every zone are there, by name; opens none of
    /// them.
    pub fn open(dir: impl AsRef<Path>) -> Result<Self, CorpusError> {
        let dir = dir.as_ref();
        let rows = table::read(&dir.join("thresholds.csv"))?;
        let mut zones: Vec<JudgedZone> = Vec::with_capacity(rows.len());
        for row in rows {
            let stack = images(dir, &row.scene, row.zone)?;

            // JudgedZone folders carry no scene name: one scene only. Scene folders are checked once a scene
            let same = zones.iter().rev().find(|zone| zone.stack == stack);
            match &stack {
                ZoneImages::Batches(folder) => {
                    let other = |zone: &&JudgedZone| {
                        matches!(zone.stack, ZoneImages::Batches(_)) && zone.row.scene != row.scene
                    };
                    if let Some(other) = zones.iter().find(other) {
                        let (one, other) = (other.row.scene.clone(), row.scene);
                        return Err(CorpusError::Scenes { dir: dir.to_owned(), one, other });
                    }
                    batches(folder)?;
                }
                ZoneImages::RunningMeans(folder) if same.is_none() => {
                    running_means(folder)?;
                }
                ZoneImages::RunningMeans(_) => {}
            }
            zones.push(JudgedZone { row, stack });
        }
        Ok(Self { zones })
    }

    /// All zones, in the order of the table; at least one.
    pub fn zones(&self) -> &[JudgedZone] {
        &self.zones
    }

    /// Names of the scenes, each once, in the order of the table.
    pub fn scenes(&self) -> Vec<&str> {
        let mut scenes: Vec<&str> = Vec::new();
        for zone in &self.zones {
            if !scenes.contains(&zone.row.scene.as_str()) {
                scenes.push(&zone.row.scene);
            }
        }
        scenes
    }

    /// Every real image of every zone of a scene, each image decoded once however many zones share it.
    /// Running means come image by image, batches zone by zone, samples ascending.
    pub fn scene_levels(&self, scene: &str) -> Result<JudgedImages<'_>, CorpusError> {
        JudgedImages::of(&self.scene_zones(scene)?)
    }

    /// The noise-free reference of a scene in linear light, cut into patches like those of its images, in the
    /// order of its zones; `None` if there is none.
    pub(crate) fn scene_reference(&self, scene: &str) -> Result<Option<Vec<Patch>>, CorpusError> {
        levels::reference(&self.scene_zones(scene)?)
    }

    fn scene_zones(&self, scene: &str) -> Result<Vec<&JudgedZone>, CorpusError> {
        let zones: Vec<&JudgedZone> = self.zones.iter().filter(|zone| zone.row.scene == scene).collect();
        if zones.is_empty() {
            return Err(CorpusError::Unknown { scene: scene.to_owned(), known: self.scenes().join(", ") });
        }
        Ok(zones)
    }
}

/// Where the images of a zone are: the scene's folder, or the zone's.
fn images(dir: &Path, scene: &str, zone: u32) -> Result<ZoneImages, CorpusError> {
    let of_scene = dir.join(scene);
    let of_zone = dir.join(format!("zone{zone:02}"));
    if of_scene.is_dir() {
        Ok(ZoneImages::RunningMeans(of_scene))
    } else if of_zone.is_dir() {
        Ok(ZoneImages::Batches(of_zone))
    } else {
        Err(CorpusError::NoImages { dir: dir.to_owned(), scene: scene.to_owned(), zone, of_scene, of_zone })
    }
}
