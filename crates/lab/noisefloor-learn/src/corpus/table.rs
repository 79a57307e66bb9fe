//! `thresholds.csv`.

use super::error::CorpusError;
use super::zone::{CENSORED_SPP, JudgedZone, ZoneImages};
use crate::stimulus::{REFERENCE, parse_reference};
use csv::{ReaderBuilder, StringRecord, Trim};
use noisefloor::tile::MAX_EDGE;
use std::collections::HashMap;
use std::fs::File;
use std::io::Read;
use std::path::{Component, Path};
use std::str::FromStr;

/// Longest table that is read, in bytes: some hundred thousand zones.
const MAX_TABLE_BYTES: u64 = 16 << 20;
const COLUMNS: [&str; 10] =
    ["scene", "renderer", "zone", "x", "y", "width", "height", "human_spp", "first_spp", "last_spp"];

pub(super) struct Row {
    pub(super) scene: String,
    renderer: String,
    pub(super) zone: u32,
    x: usize,
    y: usize,
    width: usize,
    height: usize,
    human_spp: f64,
    first_spp: u64,
    last_spp: u64,
    /// As given; by default that of the last running mean, or a clean one beside batches.
    reference_spp: Option<f64>,
}

impl Row {
    pub(super) fn into_zone(self, stack: ZoneImages) -> JudgedZone {
        let censored = self.human_spp >= CENSORED_SPP || self.human_spp >= self.last_spp as f64;
        let nested = matches!(stack, ZoneImages::RunningMeans(_));
        let reference_spp =
            self.reference_spp.unwrap_or(if nested { self.last_spp as f64 } else { f64::INFINITY });
        let Row { scene, renderer, zone, x, y, width, height, human_spp, first_spp, last_spp, .. } = self;
        JudgedZone {
            scene,
            renderer,
            zone,
            x,
            y,
            width,
            height,
            human_spp,
            censored,
            first_spp,
            last_spp,
            reference_spp,
            stack,
        }
    }
}

pub(super) fn read(path: &Path) -> Result<Vec<Row>, CorpusError> {
    let io = |source| CorpusError::Io { path: path.to_owned(), source };
    let bad = |line, what| CorpusError::Row { path: path.to_owned(), line, what };

    let mut text = Vec::new();
    File::open(path).and_then(|file| file.take(MAX_TABLE_BYTES + 1).read_to_end(&mut text)).map_err(io)?;
    if text.len() as u64 > MAX_TABLE_BYTES {
        return Err(bad(1, format!("the table is longer than {MAX_TABLE_BYTES} bytes")));
    }
    let mut reader = ReaderBuilder::new().trim(Trim::All).from_reader(text.as_slice());
    let malformed = |e: csv::Error| bad(e.position().map_or(1, csv::Position::line), e.to_string());

    // Columns, in any order
    let header = reader.headers().map_err(malformed)?.clone();
    let reference = header.iter().position(|name| name == REFERENCE);
    let mut places = [0; COLUMNS.len()];
    for (place, column) in places.iter_mut().zip(COLUMNS) {
        let found = header.iter().position(|name| name == column);
        *place = found.ok_or_else(|| bad(1, format!("no column {column}")))?;
    }

    // Zones, each once
    let mut rows = Vec::new();
    let mut seen: HashMap<(String, u32), u64> = HashMap::new();
    for record in reader.records() {
        let record = record.map_err(malformed)?;
        let line = record.position().map_or(0, csv::Position::line);
        let row = parse(&record, &places, reference).map_err(|what| bad(line, what))?;
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

fn parse(
    record: &StringRecord,
    places: &[usize; COLUMNS.len()],
    reference: Option<usize>,
) -> Result<Row, String> {
    let text = |column: usize| record.get(places[column]).unwrap_or_default();

    // The scene names a folder: one plain name, nothing that leads elsewhere
    let scene = text(0).to_owned();
    let mut parts = Path::new(&scene).components();
    if !matches!((parts.next(), parts.next()), (Some(Component::Normal(name)), None) if name == scene.as_str())
    {
        return Err(format!("scene {scene:?} is not a plain folder name"));
    }

    let row = Row {
        scene,
        renderer: text(1).to_owned(),
        zone: number(text(2), 2)?,
        x: number(text(3), 3)?,
        y: number(text(4), 4)?,
        width: number(text(5), 5)?,
        height: number(text(6), 6)?,
        human_spp: number(text(7), 7)?,
        first_spp: number(text(8), 8)?,
        last_spp: number(text(9), 9)?,
        reference_spp: reference.map(|at| parse_reference(record.get(at).unwrap_or_default())).transpose()?,
    };
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
    Ok(row)
}

fn number<T: FromStr>(text: &str, column: usize) -> Result<T, String> {
    text.parse().map_err(|_| format!("{} is {text:?}, not a number in range", COLUMNS[column]))
}
