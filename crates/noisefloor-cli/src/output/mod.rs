//! The files that `render` writes.

mod pictures;
mod report;
mod summary;
mod tiles;

pub use summary::say_noise;

use crate::files::{write_csv, write_json};
use crate::sources::Source;
use anyhow::Context;
use noisefloor::{
    Checkpoint, Clock, Progress, Rgb, SampleOrigin, Session, Stop, StopReason, StoppingCriterion,
};
use noisefloor_image::{check_writable, write_atomic};
use noisefloor_rivals::metrics::relative_mse;
use report::Report;
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{self, BufReader};
use std::path::PathBuf;
use tiles::TileState;

/// One line of timeline.csv.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct TimelineRow {
    seconds: f64,
    samples: u64,
    active_tiles: usize,
    rel_mse: Option<f64>,
}

/// What reports say of a model.
pub struct ModelFacts {
    /// BLAKE3 of the model.
    pub digest: String,
    /// Visible noise from which it is seen.
    pub just_visible: Option<f32>,
}

/// The output folder, and what has been recorded for it.
pub struct Output {
    folder: PathBuf,
    scene: String,
    source: String,
    seed: u64,
    pub model: Option<ModelFacts>,
    /// To compare with: as many pixels as are rendered.
    pub reference: Option<Vec<Rgb>>,
    /// Where the samples come from, for whoever compares the picture with another.
    pub origin: Option<SampleOrigin>,
    timeline: Vec<TimelineRow>,
    seconds_before: f64,
}

/// Where an interrupted render continues, in its output folder.
const CHECKPOINT: &str = "checkpoint.nfc";

impl Output {
    /// Makes the folder, and makes sure that files can be written before hours are spent.
    pub fn create(folder: PathBuf, scene: String, source: String, seed: u64) -> anyhow::Result<Self> {
        std::fs::create_dir_all(&folder).with_context(|| {
            format!("{}: this folder cannot be made; choose another with --out", folder.display())
        })?;
        check_writable(folder.join("image.exr"))?;
        let (timeline, seconds_before) = (Vec::new(), 0.0);
        let (model, reference, origin) = (None, None, None);
        Ok(Self { folder, scene, source, seed, model, reference, origin, timeline, seconds_before })
    }

    /// The output folder, for people.
    pub fn folder(&self) -> impl std::fmt::Display + '_ {
        self.folder.display()
    }

    /// The file of the checkpoint, for people.
    pub fn checkpoint_file(&self) -> String {
        self.folder.join(CHECKPOINT).display().to_string()
    }

    /// The checkpoint in the folder, if there is one.
    pub fn checkpoint(&self) -> anyhow::Result<Option<Checkpoint<'static>>> {
        let file = match File::open(self.folder.join(CHECKPOINT)) {
            Ok(file) => file,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error).with_context(|| self.checkpoint_file()),
        };
        let checkpoint = Checkpoint::read(BufReader::new(file))
            .with_context(|| format!("{}: remove it to begin anew", self.checkpoint_file()))?;
        Ok(Some(checkpoint))
    }

    /// Takes up the history of the render that is resumed, up to its samples. If it cannot be read, that is
    /// no reason to throw samples away.
    pub fn take_up(&mut self, samples: u64) {
        let rows =
            csv::Reader::from_path(self.folder.join("timeline.csv")).map(csv::Reader::into_deserialize);
        let rows = rows.into_iter().flatten().map_while(Result::ok);
        self.timeline = rows.take_while(|row: &TimelineRow| row.samples <= samples).collect();
        self.seconds_before = self.timeline.last().map_or(0.0, |row| row.seconds);
    }

    /// Notes one batch.
    pub fn record<C: StoppingCriterion>(&mut self, session: &Session<C>, progress: &Progress) {
        let rel_mse = self
            .reference
            .as_ref()
            .and_then(|reference| relative_mse(&session.film().image(), reference).ok());
        let noisefloor::TimelinePoint { seconds, samples, active_tiles } = progress.now;
        let seconds = self.seconds_before + seconds;
        self.timeline.push(TimelineRow { seconds, samples, active_tiles, rel_mse });
    }

    /// Writes every file: the checkpoint of a render that can be resumed; with the time it took and what
    /// became of the samples when the run is over.
    pub fn write<C: StoppingCriterion>(
        &self,
        session: &Session<C>,
        checkpoint: Option<Checkpoint<'_>>,
        over: Option<(Clock, &dyn Source)>,
    ) -> anyhow::Result<()> {
        let tiles = tiles::states(session);
        self.write_pictures(session, &tiles)?;
        write_csv(&self.folder.join("stops.csv"), tiles.iter().map(TileState::row))?;
        write_csv(&self.folder.join("timeline.csv"), self.timeline.iter())?;
        if let Some(checkpoint) = checkpoint {
            self.write_checkpoint(session, &checkpoint)?;
        }
        let report = Report::new(self, session, &tiles, over);
        write_json(&self.folder.join("report.json"), &report)
    }

    /// Writes the checkpoint of a render that is not done, and removes that of one that is.
    fn write_checkpoint<C: StoppingCriterion>(
        &self,
        session: &Session<C>,
        checkpoint: &Checkpoint<'_>,
    ) -> anyhow::Result<()> {
        let path = self.folder.join(CHECKPOINT);
        let done = |stop: Stop| matches!(stop.reason, StopReason::Converged | StopReason::MaxSpp);
        if !session.is_done() || !session.stops().all(done) {
            return Ok(write_atomic(path, |to| checkpoint.write(to))?);
        }
        match std::fs::remove_file(&path) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                Err(error).with_context(|| self.checkpoint_file())
            }
            _ => Ok(()),
        }
    }
}

/// Samples that uniform rendering at the largest stop would take, over all pixels.
fn uniform_samples<C: StoppingCriterion>(session: &Session<C>) -> u64 {
    let grid = session.film().grid();
    let most = (0..grid.len()).map(|t| session.film().spp(t)).max().unwrap_or(0);
    most * (grid.width() * grid.height()) as u64
}
