//! Every response as data for others: one long table, and a folder laid out after the Brain Imaging Data
//! Structure (BIDS), with a dictionary of every column.
//!
//! Participants are numbered in the order they began. Their codes, with which answers can be erased, and the
//! identifiers from their addresses are left out.

use super::files::folder;
use super::report::{ObserverRow, StudyReport};
use crate::config::Study;
use crate::error::{StoreError, StudyError};
use crate::event::{Choice, StudyEvent};
use crate::session::{CatchKind, Trial, TrialRole, begin, grids};
use crate::store::SessionRecord;
use noisefloor_image::write_atomic;
use noisefloor_pages::viewing::Conditions;
use serde::Serialize;
use serde_json::{Value, json};
use std::io::Write;
use std::path::Path;
use std::sync::Arc;

/// One response. Columns are described by [`DICTIONARY`].
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ResponseRow {
    participant: String,
    group: String,
    simulated: bool,
    trial: u32,
    role: &'static str,
    picture: String,
    onset: u64,
    response_time: f64,
    response: &'static str,
    tile: Option<u32>,
    x: Option<u32>,
    y: Option<u32>,
    level: Option<u32>,
    spp: Option<u64>,
    reference_side: Option<&'static str>,
    noise_interval: Option<u32>,
    first_interval_ms: Option<f64>,
    second_interval_ms: Option<f64>,
    frames_shown: Option<u32>,
    frames_dropped: Option<u32>,
    pixels_per_degree: Option<f64>,
    distance_mm: Option<f64>,
    gamma: Option<f64>,
    ambient: Option<&'static str>,
    pixel_ratio: Option<f64>,
}

/// Columns of [`ResponseRow`], with what they hold.
pub const DICTIONARY: [(&str, &str); 25] = [
    ("participant", "number of the participant, in the order they began"),
    ("group", "group the participant chose"),
    ("simulated", "whether the observer is simulated"),
    ("trial", "number of the trial, from 0, practice included"),
    ("role", "practice, data, catch-identical or catch-obvious"),
    ("picture", "name of the stack"),
    ("onset", "when the pictures appeared, in milliseconds since 1970 by the clock of the page"),
    ("response_time", "from when an answer was possible until it came, in milliseconds"),
    ("response", "step, done, identical, different, first or second"),
    ("tile", "row-major index of the tile that was clicked or asked about"),
    ("x", "column of the click in image pixels"),
    ("y", "row of the click in image pixels"),
    ("level", "level of the tile from this response on, or asked about; 0 is the noisiest"),
    ("spp", "samples per pixel of that level"),
    ("reference_side", "validation: side of the reference, or both for identical pairs"),
    ("noise_interval", "forced choice: the noisy interval, 1 or 2"),
    ("first_interval_ms", "forced choice: measured display time of the first interval"),
    ("second_interval_ms", "forced choice: measured display time of the second interval"),
    ("frames_shown", "loops: frames that were drawn until the answer"),
    ("frames_dropped", "loops: frames whose time passed before the browser drew them"),
    ("pixels_per_degree", "device pixels per degree of visual angle"),
    ("distance_mm", "distance of the eyes from the screen"),
    ("gamma", "gamma of the screen as matched by the participant"),
    ("ambient", "light in the room: dark, dim, bright or glare"),
    ("pixel_ratio", "device pixels per CSS pixel"),
];

/// All responses of some sessions, in order.
pub fn responses(study: &Arc<Study>, records: &[SessionRecord]) -> Result<Vec<ResponseRow>, StoreError> {
    let grids = grids(study);
    let mut rows = Vec::new();
    for (i, record) in records.iter().enumerate() {
        let mut session = begin(study.clone(), grids.clone(), record)?;
        for envelope in &record.events {
            let shown = session.trial().zip(session.role());
            let conditions = session.conditions().copied();
            session.apply(&envelope.event).map_err(|e| StoreError::Event {
                code: record.code.clone(),
                seq: envelope.seq,
                what: e.to_string(),
            })?;
            if let Some((trial, role)) = shown {
                let mut row = ResponseRow::new(i, record, role, conditions);
                if row.fill(study, &trial, &envelope.event, envelope.at) {
                    rows.push(row);
                }
            }
        }
    }
    Ok(rows)
}

fn participant(index: usize) -> String {
    format!("sub-{:03}", index + 1)
}

impl ResponseRow {
    fn new(index: usize, record: &SessionRecord, role: TrialRole, conditions: Option<Conditions>) -> Self {
        let role = match role {
            TrialRole::Practice => "practice",
            TrialRole::Data => "data",
            TrialRole::Catch(CatchKind::Identical) => "catch-identical",
            TrialRole::Catch(CatchKind::Obvious) => "catch-obvious",
        };
        Self {
            participant: participant(index),
            group: record.group.clone(),
            simulated: record.simulated,
            role,
            pixels_per_degree: conditions.map(|c| c.pixels_per_degree()),
            distance_mm: conditions.map(|c| c.distance_mm),
            gamma: conditions.map(|c| c.gamma),
            ambient: conditions.map(|c| c.ambient.name()),
            pixel_ratio: conditions.map(|c| c.pixel_ratio),
            ..Self::default()
        }
    }

    /// Fills in what was shown and answered; false if the event is no response.
    fn fill(&mut self, study: &Study, trial: &Trial, event: &StudyEvent, at: u64) -> bool {
        let (number, index) = match trial {
            Trial::Acquisition { number, stack, .. } => (*number, *stack),
            Trial::Validation { number, stack, left, right, .. } => {
                let last = study.stacks[*stack as usize].last();
                let reference = |levels: &[u32]| levels.iter().all(|level| *level == last);
                self.reference_side = Some(match (reference(left), reference(right)) {
                    (true, true) => "both",
                    (true, false) => "left",
                    _ => "right",
                });
                (*number, *stack)
            }
            Trial::ForcedChoice { number, stack, tile, first, second, .. } => {
                (self.tile, self.level) = (Some(*tile), Some(*first.min(second)));
                self.noise_interval = Some(if first < second { 1 } else { 2 });
                (*number, *stack)
            }
        };
        let stack = &study.stacks[index as usize];
        (self.trial, self.picture) = (number, stack.name().to_owned());
        match event {
            StudyEvent::Step { tile, level, at: place, ms, .. } => {
                (self.tile, self.level) = (Some(*tile), Some(*level));
                (self.x, self.y) = (place.map(|p| p[0]), place.map(|p| p[1]));
                (self.response, self.response_time) = ("step", *ms);
                self.onset = at.saturating_sub(*ms as u64);
            }
            StudyEvent::Done { timing, .. } | StudyEvent::Answer { timing, .. } => {
                self.response = match event {
                    StudyEvent::Answer { choice: Choice::Identical, .. } => "identical",
                    StudyEvent::Answer { choice: Choice::Different, .. } => "different",
                    StudyEvent::Answer { choice: Choice::First, .. } => "first",
                    StudyEvent::Answer { choice: Choice::Second, .. } => "second",
                    _ => "done",
                };
                (self.onset, self.response_time) = (timing.onset, timing.ms);
                self.first_interval_ms = timing.intervals.first().copied();
                self.second_interval_ms = timing.intervals.get(1).copied();
                self.frames_shown = timing.frames.map(|frames| frames.shown);
                self.frames_dropped = timing.frames.map(|frames| frames.dropped);
            }
            _ => return false,
        }
        self.spp = self.level.and_then(|level| stack.levels().get(level as usize).copied());
        true
    }
}

/// Writes the folder: `responses.csv` with all responses, and for BIDS `dataset_description.json`,
/// `participants.tsv` and its dictionary, and a table of responses per participant under `sub-NNN/beh`.
pub fn write_raw(
    dir: &Path,
    study: &Arc<Study>,
    records: &[SessionRecord],
    report: &StudyReport,
) -> Result<(), StudyError> {
    let rows = responses(study, records)?;
    let task = serde_json::to_value(study.protocol).ok().and_then(|v| v.as_str().map(str::to_owned));
    // BIDS allows no hyphens in labels
    let task = task.unwrap_or_default().replace('-', "");
    folder(dir)?;
    table(&dir.join("responses.csv"), b',', &rows)?;
    let columns: serde_json::Map<String, Value> =
        DICTIONARY.iter().map(|(name, text)| ((*name).to_owned(), json!({ "Description": text }))).collect();
    write_json(&dir.join("responses.json"), &columns)?;
    write_json(&dir.join(format!("task-{task}_beh.json")), &columns)?;
    let title = study.text.values().next().map_or("", |t| &t.title);
    let maker = json!([{ "Name": "noisefloor", "Version": env!("CARGO_PKG_VERSION") }]);
    let description =
        json!({ "Name": title, "BIDSVersion": "1.10.0", "DatasetType": "raw", "GeneratedBy": maker });
    write_json(&dir.join("dataset_description.json"), &description)?;
    let design: Value = serde_json::from_str(&study.design()).unwrap_or_default();
    write_json(&dir.join("design.json"), &design)?;
    participants(dir, study, records, report)?;
    for (i, _) in records.iter().enumerate() {
        let name = participant(i);
        let own: Vec<&ResponseRow> = rows.iter().filter(|row| row.participant == name).collect();
        let beh = dir.join(&name).join("beh");
        folder(&beh)?;
        table(&beh.join(format!("{name}_task-{task}_beh.tsv")), b'\t', &own)?;
    }
    Ok(())
}

/// `participants.tsv`: one row per session, with the answers to the questions and the reasons of an
/// exclusion.
fn participants(
    dir: &Path,
    study: &Arc<Study>,
    records: &[SessionRecord],
    report: &StudyReport,
) -> Result<(), StudyError> {
    let grids = grids(study);
    let mut columns: Vec<(String, String)> = [
        ("participant_id", "number of the participant"),
        ("group", "group the participant chose"),
        ("language", "language of the consent"),
        ("begun", "start of the session, in milliseconds since 1970"),
        ("seed", "seed of the order of trials, together with that of the study in design.json"),
        ("finished", "whether all trials were answered"),
        ("excluded", "rules of the study that exclude the participant; n/a if none does"),
    ]
    .map(|(name, text)| (name.to_owned(), text.to_owned()))
    .to_vec();
    for question in &study.questions {
        columns.push((question.id.clone(), question.text.values().next().cloned().unwrap_or_default()));
    }
    let mut rows = Vec::new();
    for (i, record) in records.iter().enumerate() {
        let session = crate::session::replay(study.clone(), grids.clone(), record)?;
        let row = report.observers.iter().find(|o| o.code == record.code);
        let excluded = row.and_then(|o: &ObserverRow| o.excluded.clone());
        let mut cells = vec![
            participant(i),
            record.group.clone(),
            session.language().unwrap_or_default().to_owned(),
            record.begun_ms.to_string(),
            record.seed.to_string(),
            row.is_some_and(|o| o.finished).to_string(),
            excluded.unwrap_or_default(),
        ];
        let answer = |id: &String| session.answers().get(id).cloned().unwrap_or_default();
        cells.extend(study.questions.iter().map(|q| answer(&q.id)));
        rows.push(cells);
    }
    write_atomic(dir.join("participants.tsv"), |to| {
        let mut tsv = csv::WriterBuilder::new().delimiter(b'\t').from_writer(to);
        tsv.write_record(columns.iter().map(|(name, _)| name))?;
        for row in &rows {
            tsv.write_record(row.iter().map(|cell| if cell.is_empty() { "n/a" } else { cell }))?;
        }
        tsv.flush().map_err(csv::Error::from)
    })?;
    let dictionary: serde_json::Map<String, Value> =
        columns.into_iter().map(|(name, text)| (name, json!({ "Description": text }))).collect();
    write_json(&dir.join("participants.json"), &dictionary)
}

fn table<T: Serialize>(path: &Path, delimiter: u8, rows: &[T]) -> Result<(), StudyError> {
    write_atomic(path, |to| {
        let mut csv = csv::WriterBuilder::new().delimiter(delimiter).from_writer(to);
        for row in rows {
            csv.serialize(row)?;
        }
        csv.flush().map_err(csv::Error::from)
    })?;
    Ok(())
}

fn write_json(path: &Path, value: &impl Serialize) -> Result<(), StudyError> {
    let text = serde_json::to_string_pretty(value).unwrap_or_default() + "\n";
    Ok(write_atomic(path, |to| to.write_all(text.as_bytes()))?)
}
