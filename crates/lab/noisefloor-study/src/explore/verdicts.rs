//! Verdicts on a picture. It is described once, and judged again whenever the people change.

use super::gallery::{Gallery, GalleryError, GalleryPicture};
use noisefloor::{
    Audience, Model, Oracle, People, Rgb, Tile, TileGrid, ToneMapping, Verdict, Viewing,
    descriptor::{Described, Descriptor},
    display::Display,
    evidence::{Evidence, Samples},
    stills::{SnapshotPair, Still},
};
use noisefloor_vision::{VisionModel, VisionWorkspace};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::sync::Arc;

#[derive(Debug)]
pub(crate) struct Tiles {
    pub(crate) grid: TileGrid,
    pub(crate) spp: f64,
    pub(crate) samples: Samples,
    pub(crate) described: Vec<Described>,
    /// The picture in linear light, and the display that shows it.
    pub(crate) still: Arc<Still>,
    pub(crate) display: Display,
    /// Visible noise as a multiple of what is just seen, row-major; `None` if the descriptor has no such map.
    pub(crate) noise: Option<Vec<f32>>,
}

/// Cache of described pictures, valid for one revision of the gallery. All models in use share descriptor
/// and evidence, so one description serves them all.
#[derive(Debug, Default)]
pub(crate) struct Judged {
    revision: u64,
    tiles: HashMap<String, Arc<Tiles>>,
}

impl Judged {
    /// The tiles of a picture, as `model` describes them.
    pub(crate) fn tiles(
        &mut self,
        gallery: &Gallery,
        id: &str,
        model: &Model,
        viewing: Viewing,
    ) -> Result<Arc<Tiles>, GalleryError> {
        if self.revision != gallery.revision {
            *self = Self { revision: gallery.revision, tiles: HashMap::new() };
        }
        if let Some(tiles) = self.tiles.get(id) {
            return Ok(tiles.clone());
        }
        let tiles = Arc::new(describe(gallery, id, model, viewing)?);
        self.tiles.insert(id.to_owned(), tiles.clone());
        Ok(tiles)
    }
}

/// A picture with known samples, beside all others of the gallery.
fn beside<'a>(
    gallery: &'a Gallery,
    id: &str,
    model: &Model,
    viewing: Viewing,
) -> Result<(&'a GalleryPicture, SnapshotPair<'a>), GalleryError> {
    let picture = gallery.pictures.iter().find(|p| p.id == id).ok_or(GalleryError::Gone)?;
    if picture.spp().is_none() {
        return Err(GalleryError::NoSamples(picture.name.clone()));
    }
    let others: Vec<&Still> =
        gallery.pictures.iter().filter(|p| p.id != id && p.counted).map(|p| &*p.still).collect();
    let (evidence, tone) = (model.evidence(), ToneMapping::default());
    let held = SnapshotPair::new(evidence, &picture.still, &others, tone, gallery.samples)?;
    Ok((picture, held.seen_on(viewing)))
}

/// JODs that a picture has lost around each pixel, row-major: by what its noise is held against, a picture with as much
/// noise as it has is compared with the same one without.
pub(crate) fn jods_lost(
    gallery: &Gallery,
    id: &str,
    model: &Model,
    viewing: Viewing,
) -> Result<Vec<f32>, GalleryError> {
    let (picture, held) = beside(gallery, id, model, viewing)?;
    let (width, height) = picture.still.size;
    let planes = held.planes(Tile { index: 0, x: 0, y: 0, width, height })?;
    // Planes reach over the edges of the picture
    let inner = planes.inner;
    let with = |noise: f32| -> Vec<Rgb> {
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (inner.y + y, inner.x + x)));
        places.map(|at| [planes.image[at] + noise * planes.residual[at]; 3]).collect()
    };
    let (test, reference) = (with(1.0), with(0.0));
    let (eyes, mut room) = (VisionModel::new(&viewing), VisionWorkspace::default());
    Ok(eyes.compare(&test, &reference, (width, height), &mut room)?.map().to_vec())
}

fn describe(gallery: &Gallery, id: &str, model: &Model, viewing: Viewing) -> Result<Tiles, GalleryError> {
    let (picture, held) = beside(gallery, id, model, viewing)?;
    let spp = picture.still.spp;
    let (width, height) = picture.still.size;
    let grid = TileGrid::new(width, height, gallery.tile)?;
    // Other people change verdicts only; 1 in the map is where the default share of them sees noise
    let oracle = Oracle::new(model.clone(), People::DEFAULT);
    let described = held.describe(&oracle, grid)?;
    let noise = oracle.map_visible_noise(grid, &described, model.audience());
    let (still, display) = (picture.still.clone(), held.display().clone());
    Ok(Tiles { grid, spp, samples: held.samples(), described, still, display, noise })
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Question {
    pub(crate) picture: String,
    /// Share of people who are to see no noise.
    pub(crate) people: f32,
    /// Slope and offset of the audience.
    pub(crate) audience: [f64; 2],
    /// Whether to ask the retrained model.
    pub(crate) retrained: bool,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct TileView {
    pub(crate) tile: usize,
    pub(crate) x: usize,
    pub(crate) y: usize,
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) probability: f32,
    pub(crate) converged: bool,
    pub(crate) expected_spp: Option<u64>,
    pub(crate) unfamiliar: bool,
    /// The answer about this tile, with its row number.
    pub(crate) said: Option<Answered>,
}

#[derive(Clone, Debug, Serialize)]
pub(crate) struct Answered {
    pub(crate) id: i64,
    pub(crate) sees_noise: bool,
}

#[derive(Debug, Serialize)]
pub(crate) struct VerdictView {
    pub(crate) picture: String,
    pub(crate) spp: f64,
    pub(crate) nested: bool,
    pub(crate) model: String,
    pub(crate) columns: usize,
    pub(crate) tiles: Vec<TileView>,
    pub(crate) has_noise_map: bool,
}

/// A model with a share of people and their audience.
#[derive(Debug)]
pub(crate) struct Judge {
    pub(crate) oracle: Oracle,
    pub(crate) audience: Audience,
}

impl Judge {
    /// Errors name the value out of range.
    pub(crate) fn new(model: Model, people: People, [slope, offset]: [f64; 2]) -> Result<Self, String> {
        let sound = (0.0..=100.0).contains(&slope) && (-1e9..=1e9).contains(&offset);
        if !sound {
            return Err(format!("the audience line T' = {slope} T + {offset} needs a slope of 0 to 100"));
        }
        let audience = model.audience().then(Audience { slope, offset });
        Ok(Self { oracle: Oracle::new(model, people), audience })
    }

    pub(crate) fn verdicts(&self, tiles: &Tiles) -> Result<Vec<Verdict>, String> {
        let verdicts = self.oracle.judge_described_for(&tiles.described, self.audience);
        verdicts.ok_or_else(|| {
            let name = self.oracle.model().descriptor().name();
            format!(
                "a model with the {name} descriptor cannot follow an audience; use the visible descriptor"
            )
        })
    }

    /// The raw descriptor of a tile in its picture.
    pub(crate) fn numbers(&self, tiles: &Tiles, tile: usize) -> Option<Vec<f32>> {
        self.oracle.model().descriptor().in_picture(&tiles.described).into_iter().nth(tile)
    }

    pub(crate) fn kind(&self) -> (&Descriptor, Evidence) {
        let model = self.oracle.model();
        (model.descriptor(), model.evidence())
    }

    pub(crate) fn view(
        &self,
        picture: &GalleryPicture,
        tiles: &Tiles,
        said: &HashMap<[usize; 4], Answered>,
    ) -> Result<VerdictView, String> {
        let view = |(tile, verdict): (Tile, Verdict)| {
            let Tile { index, x, y, width, height } = tile;
            TileView {
                tile: index,
                x,
                y,
                width,
                height,
                probability: verdict.probability.unwrap_or(0.0),
                converged: verdict.converged,
                expected_spp: verdict.expected_spp,
                unfamiliar: verdict.unfamiliar,
                said: said.get(&[x, y, width, height]).cloned(),
            }
        };
        Ok(VerdictView {
            picture: picture.id.clone(),
            spp: tiles.spp,
            nested: tiles.samples == Samples::Nested,
            model: self.oracle.model().digest(),
            columns: tiles.grid.columns(),
            tiles: tiles.grid.tiles().zip(self.verdicts(tiles)?).map(view).collect(),
            has_noise_map: tiles.noise.is_some(),
        })
    }
}
