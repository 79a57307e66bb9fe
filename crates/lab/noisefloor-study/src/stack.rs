//! A stack of pictures of one view, from noisy to converged, cut into the 8-bit tiles that observers see.

use crate::error::{FileFault, StudyError};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, ImageError};
use noisefloor::{Rgb, Tile, TileGrid, ToneMapping, display::Display};
use noisefloor_image::{Frame, Picture, read_picture, running_means};
use rayon::prelude::*;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

pub(crate) const MAX_LEVELS: usize = 2000;
/// The share of the threshold that makes the noisy class (Takouachet et al. 2017, §7.2).
pub(crate) const NOISY_SHARE: f64 = 0.3;
const MAX_TILES: usize = 1024;
/// Most pixels of a picture; a larger one would not fit on a screen unscaled.
const MAX_PIXELS: usize = 16 << 20;
const MAX_FRAMES: usize = 240;
/// Most lines of a table of stops.
const MAX_STOPS: usize = 100_000;

/// A stack as a study file names it; paths start at that file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub(crate) struct StackEntry {
    pub(crate) name: String,
    pub(crate) folder: PathBuf,
    #[serde(default)]
    pub(crate) renderer: String,
    /// Where each tile stopped: `stops.csv` of `noisefloor render`, or a table with the columns `tile` and
    /// `spp`.
    pub(crate) stops: Option<PathBuf>,
    /// Frames per second of a loop: the folder then has a folder of pictures for each frame.
    pub(crate) fps: Option<f64>,
}

/// Pictures of one view, ordered by samples per pixel. The last one is the reference. Each is a still, or a
/// loop of frames that are shown one after the other.
#[derive(Debug)]
pub struct StudyStack {
    name: String,
    renderer: String,
    folder: PathBuf,
    grid: TileGrid,
    levels: Vec<u64>,
    /// By frame and level.
    paths: Vec<Vec<PathBuf>>,
    /// Frames per second of a loop.
    fps: Option<f64>,
    /// Tone mapping of linear pictures, fitted to the reference of the first frame and shared by all. `None`
    /// for PNGs.
    display: Option<Display>,
    /// Level at which each tile had stopped: the first with at least that many samples.
    stops: Option<Vec<u32>>,
    /// Level at 30 % of those samples.
    noisy: Option<Vec<u32>>,
}

impl StudyStack {
    pub(crate) fn open(entry: StackEntry, beside: &Path, tile: usize) -> Result<Self, StudyError> {
        let StackEntry { name, renderer, folder, stops, fps } = entry;
        let folder = beside.join(folder);
        let folders = if fps.is_some() { frames_of(&folder)? } else { vec![folder.clone()] };
        let (levels, first) = running(&folders[0])?;
        if !(2..=MAX_LEVELS).contains(&levels.len()) {
            return Err(StudyError::Levels { name, levels: levels.len(), max: MAX_LEVELS });
        }
        let mut paths = vec![first];
        for other in &folders[1..] {
            let (has, pictures) = running(other)?;
            if has != levels {
                let what = format!(
                    "a frame of stack {name} whose levels are not those of {}: all frames have the same",
                    folders[0].display()
                );
                return Err(StudyError::at(other, what));
            }
            paths.push(pictures);
        }

        // The reference determines the size and the tone mapping
        let reference = read_picture(&paths[0][levels.len() - 1])?;
        let (width, height) = reference.size();
        let grid = TileGrid::new(width, height, tile)
            .map_err(|source| StudyError::Tile { name: name.clone(), source })?;
        if grid.len() > MAX_TILES || width * height > MAX_PIXELS {
            let what = format!(
                "stack {name}: {width}×{height} pixels in {} tiles; \
                 the limits are {MAX_PIXELS} pixels and {MAX_TILES} tiles, so use larger tiles or a crop",
                grid.len()
            );
            return Err(StudyError::at(&folder, what));
        }
        let display = match &reference {
            Picture::Linear(image) => Some(ToneMapping::default().settle(&image.pixels)),
            Picture::Display(_) => None,
        };

        // Where the tiles stopped, as levels
        let spp = stops.map(|path| read_stops(&beside.join(path), grid)).transpose()?;
        let level_of =
            |spp: f64| levels.iter().position(|&l| l as f64 >= spp).unwrap_or(levels.len() - 1) as u32;
        let share = |share: f64| -> Option<Vec<u32>> {
            Some(spp.as_ref()?.iter().map(|spp| level_of(share * spp)).collect())
        };
        let (stops, noisy) = (share(1.0), share(NOISY_SHARE));
        Ok(Self { name, renderer, folder, grid, levels, paths, fps, display, stops, noisy })
    }

    /// Name of the stack; a plain folder name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Renderer, as the study file names it.
    pub fn renderer(&self) -> &str {
        &self.renderer
    }

    pub fn folder(&self) -> &Path {
        &self.folder
    }

    pub fn grid(&self) -> TileGrid {
        self.grid
    }

    /// Samples per pixel of each level: increasing, at least two. The last level is the reference.
    pub fn levels(&self) -> &[u64] {
        &self.levels
    }

    /// Frames of the loop; one of a still.
    pub fn frames(&self) -> u32 {
        self.paths.len() as u32
    }

    /// Frames per second of a loop; `None` of a still.
    pub fn fps(&self) -> Option<f64> {
        self.fps
    }

    /// The level of the reference.
    pub fn last(&self) -> u32 {
        (self.levels.len() - 1) as u32
    }

    /// Level at which each tile had stopped, if the study file names a table of stops.
    pub fn stops(&self) -> Option<&[u32]> {
        self.stops.as_deref()
    }

    /// Level with 30 % of the samples at which each tile had stopped, if the study file names a table of
    /// stops.
    pub fn noisy(&self) -> Option<&[u32]> {
        self.noisy.as_deref()
    }

    /// Whether the pictures are tone mapped for display.
    pub(crate) fn is_tone_mapped(&self) -> bool {
        self.display.is_some()
    }

    /// A level as displayed, its first frame if it is a loop: sRGB-encoded, three bytes a pixel, row-major.
    ///
    /// # Panics
    /// If there is no such level.
    pub fn shown(&self, level: u32) -> Result<Vec<u8>, StudyError> {
        self.shown_frame(level, 0)
    }

    fn shown_frame(&self, level: u32, frame: u32) -> Result<Vec<u8>, StudyError> {
        let path = &self.paths[frame as usize][level as usize];
        let picture = read_picture(path)?;
        let want = (self.grid.width(), self.grid.height());
        if picture.size() != want {
            return Err(StudyError::at(path, FileFault::Size { got: picture.size(), want }));
        }
        let byte = |c: f32| (c.clamp(0.0, 1.0) * 255.0).round() as u8;
        let bytes = |pixels: &mut dyn Iterator<Item = Rgb>| pixels.flatten().map(byte).collect();
        match (&picture, &self.display) {
            (Picture::Display(image), None) => Ok(bytes(&mut image.pixels.iter().copied())),
            (Picture::Linear(image), Some(display)) => {
                if !image.pixels.iter().flatten().all(|c| c.is_finite()) {
                    return Err(StudyError::at(path, FileFault::NotFinite));
                }
                Ok(bytes(&mut image.pixels.iter().map(|&p| display.encode(p))))
            }
            _ => Err(StudyError::at(path, "a stack holds either PNGs or EXRs, not both".to_owned())),
        }
    }

    /// The tiles of a frame of a level as PNG files, row-major.
    ///
    /// # Panics
    /// If there is no such level or frame.
    pub fn tile_pngs(&self, level: u32, frame: u32) -> Result<Vec<Vec<u8>>, StudyError> {
        let pixels = self.shown_frame(level, frame)?;
        self.grid.tiles().map(|tile| self.png(level, &pixels, tile)).collect()
    }

    fn png(&self, level: u32, pixels: &[u8], tile: Tile) -> Result<Vec<u8>, StudyError> {
        let rows = tile.rows(self.grid.width());
        let cut: Vec<u8> = rows.flat_map(|row| &pixels[3 * row.start..3 * row.end]).copied().collect();
        let failed = |e: ImageError| StudyError::at(&self.paths[0][level as usize], e.to_string());
        png((tile.width, tile.height), &cut).map_err(failed)
    }

    pub(crate) fn check_pictures(&self) -> Result<(), StudyError> {
        let all = (0..self.frames()).flat_map(|frame| (0..=self.last()).map(move |level| (level, frame)));
        let all: Vec<(u32, u32)> = all.collect();
        all.into_par_iter().try_for_each(|(level, frame)| self.shown_frame(level, frame).map(drop))
    }
}

/// A picture of three bytes a pixel as a PNG file.
pub(crate) fn png((width, height): (usize, usize), rgb: &[u8]) -> Result<Vec<u8>, ImageError> {
    let mut png = Vec::new();
    PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Sub).write_image(
        rgb,
        width as u32,
        height as u32,
        ExtendedColorType::Rgb8,
    )?;
    Ok(png)
}

/// ln(samples per pixel) of a level.
pub(crate) fn ln_spp(spp: &[u64], level: u32) -> f64 {
    (spp[level as usize].max(1) as f64).ln()
}

/// Levels and pictures of one folder.
fn running(folder: &Path) -> Result<(Vec<u64>, Vec<PathBuf>), StudyError> {
    Ok(running_means(folder)?.into_iter().map(|Frame { last, path, .. }| (last, path)).unzip())
}

/// The folders of the frames of a loop, in the order of their names.
fn frames_of(folder: &Path) -> Result<Vec<PathBuf>, StudyError> {
    let io = |fault: std::io::Error| StudyError::at(folder, fault);
    let mut frames = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let path = entry.map_err(io)?.path();
        if path.is_dir() {
            frames.push(path);
        }
    }
    frames.sort();
    if !(2..=MAX_FRAMES).contains(&frames.len()) {
        let what = format!(
            "{} folders of frames; a loop (a stack with fps) has 2 to {MAX_FRAMES}: 0001, 0002 and so on, \
             each with pictures of all levels",
            frames.len()
        );
        return Err(StudyError::at(folder, what));
    }
    Ok(frames)
}

/// Reads the samples at which each tile stopped from a table with the columns `tile` and `spp`.
fn read_stops(path: &Path, grid: TileGrid) -> Result<Vec<f64>, StudyError> {
    let bad = |what: String| StudyError::at(path, what);
    let mut csv = csv::ReaderBuilder::new()
        .trim(csv::Trim::All)
        .from_path(path)
        .map_err(|e| bad(format!("cannot be read: {e}")))?;
    let header = csv.headers().map_err(|e| bad(e.to_string()))?.clone();
    let column = |name: &str| {
        header.iter().position(|h| h == name).ok_or_else(|| bad(format!("line 1: no column {name:?}")))
    };
    let (tile, spp) = (column("tile")?, column("spp")?);
    let mut found = BTreeMap::new();
    for record in csv.records().take(MAX_STOPS) {
        let record = record.map_err(|e| bad(e.to_string()))?;
        let line = record.position().map_or(0, csv::Position::line);
        let text = |column: usize| record.get(column).unwrap_or_default();
        let (index, samples) = (text(tile).parse::<usize>(), text(spp).parse::<f64>());
        match (index, samples) {
            (Ok(index), Ok(samples)) if index < grid.len() && samples.is_finite() && samples > 0.0 => {
                found.insert(index, samples)
            }
            _ => {
                return Err(bad(format!(
                    "line {line}: tile {:?} and spp {:?} are not a tile below {} and its samples per pixel; \
                     is the tile size that of the study?",
                    text(tile),
                    text(spp),
                    grid.len()
                )));
            }
        };
    }
    if found.len() != grid.len() {
        return Err(bad(format!("stops of {} tiles, but the grid has {}", found.len(), grid.len())));
    }
    Ok(found.into_values().collect())
}
