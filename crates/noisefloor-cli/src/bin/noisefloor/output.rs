//! The files that `render` writes.

mod denoised;
mod pictures;
mod report;
pub mod summary;
mod tiles;

pub use denoised::{Denoised, ERROR_SCALE};
pub use report::{About, Over};
pub use tiles::open_for_colour;

use crate::job::{CriterionJob, RenderJob};
use anyhow::{Context, bail};
use denoised::DENOISED;
use noisefloor::{Checkpoint, Rgb, Session, driver::Progress, stills::SampleOrigin};
use noisefloor_cli::end::Usage;
use noisefloor_cli::files::write_json;
use noisefloor_cli::folder::{Earlier, Folder};
use noisefloor_cli::say::{note, one_line};
use noisefloor_image::{check_writable, write_atomic, write_csv};
use noisefloor_rivals::metrics::relative_mse;
use report::Report;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::fs::File;
use std::io::{self, BufReader};
use std::path::{Path, PathBuf};
use tiles::TileState;

/// One line of timeline.csv.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct TimelineRow {
    seconds: f64,
    samples: u64,
    active_tiles: usize,
    rel_mse: Option<f64>,
}

/// The output folder, and what has been recorded for it.
pub struct Output {
    folder: Folder,
    pub about: About,
    /// To compare with: as many pixels as are rendered.
    pub reference: Option<Vec<Rgb>>,
    /// Where the samples come from, for whoever compares the picture with another.
    pub origin: Option<SampleOrigin>,
    /// Who denoises the picture, if it is judged and written denoised.
    pub denoised: Option<Denoised>,
    timeline: Vec<TimelineRow>,
    /// Whether there is an earlier render in the folder, and it is not resumed.
    overwrites: bool,
    /// Whether the checkpoint of a finished render is kept: frames of a sequence would fill the disk with them.
    keeps_finished: bool,
}

/// Where an interrupted render continues, in its output folder.
const CHECKPOINT: &str = "checkpoint.nfc";
/// That of a finished render, for whoever asks for more of it.
const FINISHED: &str = "finished.nfc";
pub const REPORT: &str = "report.json";
const PICTURE: &str = "image.exr";
const SHOWN: &str = "image.png";

impl Output {
    /// Makes sure that files can be written, and that no other render is lost by it, before hours are spent.
    pub fn create(
        folder: Folder,
        earlier: Earlier,
        about: About,
        keeps_finished: bool,
    ) -> anyhow::Result<Self> {
        if let Some(occupied) = occupied(&folder, earlier, keeps_finished) {
            return Err(occupied.into());
        }
        check_writable(folder.path().join("image.exr"))?;
        Ok(Self {
            folder,
            about,
            reference: None,
            origin: None,
            denoised: None,
            timeline: Vec::new(),
            overwrites: earlier == Earlier::Overwrite,
            keeps_finished,
        })
    }

    /// The output folder, for people.
    pub fn folder(&self) -> impl std::fmt::Display + '_ {
        self.folder.path().display()
    }

    /// A file in the output folder.
    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The file of the checkpoint, for people.
    pub fn checkpoint_file(&self) -> String {
        self.resumed_from().display().to_string()
    }

    fn resumed_from(&self) -> PathBuf {
        self.path(if self.is_finished() { FINISHED } else { CHECKPOINT })
    }

    /// Whether the checkpoint in the folder is of a finished render.
    pub fn is_finished(&self) -> bool {
        self.keeps_finished && self.folder.first_of(&[CHECKPOINT, FINISHED]) == Some(FINISHED)
    }

    /// The checkpoint in the folder, if there is one: of a render under way, or of a finished one.
    pub fn checkpoint(&self) -> anyhow::Result<Option<Checkpoint<'static>>> {
        // Opening a pipe might never end
        match std::fs::metadata(self.resumed_from()) {
            Ok(about) if about.is_file() => {}
            Ok(_) => bail!("{}: is no regular file; remove it to begin anew", self.checkpoint_file()),
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error).with_context(|| self.checkpoint_file()),
        }
        let file = File::open(self.resumed_from()).with_context(|| self.checkpoint_file())?;
        let checkpoint = Checkpoint::read(BufReader::new(file))
            .with_context(|| format!("{}: remove it to begin anew", self.checkpoint_file()))?;
        Ok(Some(checkpoint))
    }

    /// Takes up the history of the render that is resumed, up to its samples. If it cannot be read, that is
    /// no reason to throw samples away.
    pub fn take_up(&mut self, samples: u64) {
        let rows = csv::Reader::from_path(self.path("timeline.csv")).map(csv::Reader::into_deserialize);
        let rows = rows.into_iter().flatten().map_while(Result::ok);
        self.timeline = rows.take_while(|row: &TimelineRow| row.samples <= samples).collect();
        self.about.seconds_before = self.timeline.last().map_or(0.0, |row| row.seconds);
    }

    pub fn record(&mut self, session: &Session, progress: &Progress) {
        let rel_mse = self
            .reference
            .as_ref()
            .and_then(|reference| relative_mse(&session.film().image(), reference).ok());
        let noisefloor::driver::TimelinePoint { seconds, samples, active_tiles, .. } = progress.now;
        let seconds = self.about.seconds_before + seconds;
        self.timeline.push(TimelineRow { seconds, samples, active_tiles, rel_mse });
    }

    /// Writes every file, with the time that the run took and what became of the samples: it is over.
    pub fn write(
        &mut self,
        session: &Session,
        checkpoint: Option<Checkpoint<'_>>,
        over: Over<'_>,
    ) -> anyhow::Result<()> {
        self.write_pictures(session)?;
        if self.denoised.is_some() {
            // A denoiser that fails, or is killed, must not cost the samples
            self.write_tables(session, checkpoint.clone(), None)?;
        }
        if let Some(denoised) = &mut self.denoised {
            match denoised.write(session, self.folder.path()) {
                Err(error) if denoised.is_given_up() => {
                    note!("warning: the picture is not denoised: {}; --resume does it", one_line(&error));
                    return Ok(());
                }
                written => written.context("everything else is saved; --resume denoises the picture")?,
            }
        }
        self.write_tables(session, checkpoint, Some(over))
    }

    /// Writes what is known so far, pictures excepted: tables, and the checkpoint of a render that can be
    /// resumed.
    pub fn write_progress(
        &mut self,
        session: &Session,
        checkpoint: Option<Checkpoint<'_>>,
    ) -> anyhow::Result<()> {
        self.write_tables(session, checkpoint, None)
    }

    fn write_tables(
        &mut self,
        session: &Session,
        checkpoint: Option<Checkpoint<'_>>,
        over: Option<Over<'_>>,
    ) -> anyhow::Result<()> {
        self.forget_earlier()?;
        let tiles = tiles::states(session);
        write_csv(self.path("stops.csv"), tiles.iter().map(TileState::row))?;
        write_csv(self.path("timeline.csv"), self.timeline.iter())?;
        // The report goes before a checkpoint is removed: whatever is killed in between, one of them says
        // how far the render is. While a picture is missing, the render is not done, even if all tiles are
        let done = over.is_some() && session.is_done() && tiles.iter().all(TileState::is_final);
        let job = checkpoint.as_ref().map(Checkpoint::job_digest);
        let under_way = checkpoint.is_some() && !done;
        if let Some(checkpoint) = checkpoint.filter(|_| under_way || self.keeps_finished) {
            write_atomic(self.path(if done { FINISHED } else { CHECKPOINT }), |to| checkpoint.write(to))?;
        }
        let rel_mse = self.timeline.last().and_then(|row| row.rel_mse);
        let denoised = self.denoised.as_ref().map(|denoised| denoised.report(session));
        let mut report = Report::new(&self.about, session, &tiles, job.as_deref(), over);
        (report.rel_mse, report.denoised) = (rel_mse, denoised);
        write_json(&self.path(REPORT), &report)?;
        if under_way { Ok(()) } else { remove(&self.path(CHECKPOINT)) }
    }

    /// A report is of the pictures beside it: one of an earlier render is none any more.
    fn forget_earlier(&mut self) -> anyhow::Result<()> {
        if std::mem::take(&mut self.overwrites) {
            remove(&self.path(REPORT))?;
            remove(&self.path(FINISHED))?;
        }
        Ok(())
    }
}

/// What a folder holds of a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finished {
    /// Nothing, or a render under way.
    Not,
    This,
    /// All of it but a picture, which somebody has removed.
    Lost,
    /// A picture of another job, or one whose job nobody knows.
    Other,
}

/// By the digest of a job, compared with what the report in the folder says.
pub fn finished(folder: &Path, job: &str) -> anyhow::Result<noisefloor_farm::Finished> {
    Ok(match finished_by(folder, |report| report["job"] == job)? {
        Finished::Not => noisefloor_farm::Finished::Not,
        Finished::This => noisefloor_farm::Finished::This,
        Finished::Lost | Finished::Other => noisefloor_farm::Finished::Other,
    })
}

/// The same of a frame; a render that has no digest, since it cannot be resumed, is compared by its options.
pub fn finished_frame(folder: &Path, digest: Option<&str>, job: &RenderJob) -> anyhow::Result<Finished> {
    let asked = serde_json::to_value(job)?;
    finished_by(folder, |report| match digest {
        Some(digest) => report["job"] == digest,
        None => report["job"].is_null() && report["render"] == asked,
    })
}

fn finished_by(folder: &Path, is_this: impl Fn(&Value) -> bool) -> anyhow::Result<Finished> {
    let path = folder.join(REPORT);
    if folder.join(CHECKPOINT).exists() {
        return Ok(Finished::Not);
    }
    let report = match std::fs::read(&path) {
        Ok(report) => serde_json::from_slice::<Value>(&report).unwrap_or_default(),
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Finished::Not),
        Err(error) => return Err(error).with_context(|| path.display().to_string()),
    };
    let pictures = [PICTURE, SHOWN].iter().all(|name| folder.join(name).is_file());
    Ok(match report["complete"] == true && is_this(&report) {
        true if pictures => Finished::This,
        true => Finished::Lost,
        false => Finished::Other,
    })
}

/// The picture that people look at.
pub fn picture_of(job: &RenderJob) -> &'static str {
    if matches!(job.criterion, CriterionJob::Denoised { .. }) { DENOISED } else { PICTURE }
}

/// The file that shows that a folder holds a render, whosever it is.
pub fn render_in(folder: &Path) -> Option<&'static str> {
    [CHECKPOINT, REPORT, PICTURE].into_iter().find(|name| folder.join(name).exists())
}

/// The render that must not be overwritten, if there is one.
fn occupied(folder: &Folder, earlier: Earlier, keeps_finished: bool) -> Option<Usage> {
    let (found, path) = (folder.first_of(&[CHECKPOINT, REPORT, PICTURE])?, folder.path().display());
    let resumable = found == CHECKPOINT;
    let what = match earlier {
        Earlier::Overwrite => return None,
        Earlier::Resume if found != REPORT => return None,
        Earlier::Resume if keeps_finished && folder.first_of(&[FINISHED]).is_some() => return None,
        Earlier::Resume => {
            "holds a render that is finished, or that cannot be resumed; --force overwrites it"
        }
        Earlier::Keep if resumable => {
            "holds a render that is not finished; --resume resumes it, --force overwrites it"
        }
        Earlier::Keep => "holds a render; --force overwrites it",
    };
    Some(Usage(format!("{path}: {what}, and --out names another folder")))
}

/// Removes a file if it is there.
fn remove(path: &Path) -> anyhow::Result<()> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => {
            Err(error).with_context(|| path.display().to_string())
        }
        _ => Ok(()),
    }
}
