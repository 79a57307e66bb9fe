//! `thresholds.csv`.

use super::error::CorpusError;
use crate::stimulus::{REFERENCE, parse_reference};
use csv::{ErrorKind, Position, ReaderBuilder, Trim};
use noisefloor::{Tile, tile::MAX_EDGE};
use serde::{Deserialize, Deserializer, Serialize, de::Error};
use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::{Component, Path};

/// Longest table that is read, in bytes: some hundred thousand zones.
const MAX_TABLE_BYTES: u64 = 16 << 20;

/// A line of `thresholds.csv`: a zone, and what observers said of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ThresholdRow {
    pub scene: String,
    pub renderer: String,
    /// Row-major number of the zone in the scene.
    pub zone: u32,
    /// Left edge in the full picture, in pixels.
    pub x: usize,
    /// Top edge in the full picture, in pixels.
    pub y: usize,
    pub width: usize,
    pub height: usize,
    /// Mean samples per pixel at which observers could no longer tell the zone from the reference; positive.
    pub human_spp: f64,
    /// Samples per pixel of the least converged image observers could choose.
    pub first_spp: u64,
    /// Samples per pixel of the most converged image observers could choose. Not all images up to it need be
    /// here.
    pub last_spp: u64,
    /// As given; by default that of the last running mean, or a clean one beside batches.
    #[serde(default, deserialize_with = "reference", skip_serializing_if = "Option::is_none")]
    pub reference_spp: Option<f64>,
}

impl ThresholdRow {
    /// Where the zone lies in the full picture.
    pub fn tile(&self) -> Tile {
        let Self { x, y, width, height, .. } = *self;
        Tile { index: 0, x, y, width, height }
    }
}

fn reference<'a, D: Deserializer<'a>>(from: D) -> Result<Option<f64>, D::Error> {
    parse_reference(&String::deserialize(from)?).map(Some).map_err(D::Error::custom)
}

pub(super) fn read(path: &Path) -> Result<Vec<ThresholdRow>, CorpusError> {
    let io = |source| CorpusError::Io { path: path.to_owned(), source };
    let bad = |line, what| CorpusError::Row { path: path.to_owned(), line, what };

    let mut text = Vec::new();
    File::open(path).and_then(|file| file.take(MAX_TABLE_BYTES + 1).read_to_end(&mut text)).map_err(io)?;
    if text.len() as u64 > MAX_TABLE_BYTES {
        return Err(bad(1, format!("the table is longer than {MAX_TABLE_BYTES} bytes")));
    }
    let mut reader = ReaderBuilder::new().trim(Trim::All).from_reader(text.as_slice());
    let line_of = |e: &csv::Error| e.position().map_or(1, Position::line);
    let header = reader.headers().map_err(|e| bad(line_of(&e), e.to_string()))?.clone();
    let malformed = |e: csv::Error| {
        let what = match e.kind() {
            ErrorKind::Deserialize { err, .. } => {
                let column = err.field().and_then(|field| header.get(field as usize));
                column.map_or(err.kind().to_string(), |column| format!("{column}: {}", err.kind()))
            }
            _ => e.to_string(),
        };
        bad(line_of(&e), what)
    };

    // Zones, each once
    let mut rows = Vec::new();
    let mut seen: HashMap<(String, u32), u64> = HashMap::new();
    for record in reader.records() {
        let record = record.map_err(malformed)?;
        let line = record.position().map_or(0, Position::line);
        let row: ThresholdRow = record.deserialize(Some(&header)).map_err(malformed)?;
        check(&row).map_err(|what| bad(line, what))?;
        if let Some(before) = seen.insert((row.scene.clone(), row.zone), line) {
            return Err(bad(
                line,
                format!("zone {} of {} was in line {before} already", row.zone, row.scene),
            ));
        }
        rows.push(row);
    }
    if rows.is_empty() { Err(bad(1, "no zones in the table".to_owned())) } else { Ok(rows) }
}

fn check(row: &ThresholdRow) -> Result<(), String> {
    // The scene names a folder: one plain name, nothing that leads elsewhere
    let scene = row.scene.as_str();
    let mut parts = Path::new(scene).components();
    if !matches!((parts.next(), parts.next()), (Some(Component::Normal(name)), None) if name == scene) {
        return Err(format!("scene {scene:?} is not a plain folder name"));
    }
    if row.x > MAX_EDGE || row.y > MAX_EDGE {
        return Err(format!("x and y must be 0…{MAX_EDGE} pixels, not {} and {}", row.x, row.y));
    }
    noisefloor::tile::check_image(row.width, row.height).map_err(|e| e.to_string())?;
    if !row.human_spp.is_finite() || row.human_spp <= 0.0 {
        return Err(format!("human_spp must be positive, not {}", row.human_spp));
    }
    if row.reference_spp.is_some_and(|spp| spp < row.last_spp as f64) {
        return Err(format!("{REFERENCE} is below last_spp {}", row.last_spp));
    }
    if row.first_spp > row.last_spp {
        return Err(format!("first_spp {} is above last_spp {}", row.first_spp, row.last_spp));
    }
    Ok(())
}
