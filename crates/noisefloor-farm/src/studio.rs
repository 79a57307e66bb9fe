//! What a farm asks of whoever renders: it knows no renderer, no criterion and no picture file.

use crate::error::{FarmError, StudioError};
use crate::merge::Problem;
use crate::state::{FrameJob, Round};
use noisefloor::driver::{Clock, Progress};
use noisefloor::{Checkpoint, ProgressiveSource, Session};
use serde::{Serialize, de::DeserializeOwned};
use std::path::{Path, PathBuf};

/// Whoever renders: the `noisefloor` command, or a program that has renderers of its own.
///
/// # For implementers
/// A job is a value. The farm writes it into its plan and into shards, and reads it on other machines: it
/// must hold all that a render is, with absolute paths, and come back as it was.
pub trait Studio {
    type Job: Clone + Serialize + DeserializeOwned;

    /// How checkpoints name such a render; see [`Session::checkpoint`].
    const CHECKPOINT: &'static str;

    /// The job of a frame of a sequence.
    fn of_frame(&self, job: &Self::Job, frame: i32) -> Self::Job;

    /// The job of a frame that has waited for others, which are done: their numbers and folders. By default,
    /// they have changed nothing.
    fn after(&self, job: &Self::Job, frame: i32, first: &[(i32, PathBuf)]) -> Result<Self::Job, StudioError> {
        let _ = (frame, first);
        Ok(job.clone())
    }

    /// Opens the source of a job.
    fn open(&self, job: &Self::Job) -> Result<FrameSource, StudioError>;

    /// The session that a render of that size begins with.
    fn session(&self, job: &Self::Job, size: (usize, usize)) -> Result<Session, StudioError>;

    /// The file that shows that a folder holds a render already, if one does.
    fn occupied(&self, folder: &Path) -> Option<&'static str>;

    /// What a folder holds of the job with this [digest](Checkpoint::job_digest).
    fn finished(&self, folder: &Path, digest: &str) -> Result<Finished, StudioError>;

    /// The files of a render of this job in a folder, which is made if need be; `force` overwrites one that
    /// is there.
    fn files(
        &self,
        job: &Self::Job,
        frame: &FrameJob,
        folder: &Path,
        force: bool,
    ) -> Result<Box<dyn RenderFiles>, StudioError>;

    /// Hears how the farm gets on.
    fn tell(&self, news: News<'_>);
}

/// A source that is ready to sample.
pub struct FrameSource {
    pub source: Box<dyn ProgressiveSource>,
    pub scene: String,
}

/// What a folder holds of a render.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finished {
    /// Nothing, or one under way.
    Not,
    /// The finished picture of this job.
    This,
    /// A picture of another job, or one that cannot be resumed.
    Other,
}

pub trait RenderFiles {
    /// The render under way in the folder; none if there is none. Its history is taken up.
    fn checkpoint(&mut self) -> Result<Option<Checkpoint<'static>>, StudioError>;

    /// Writes how far the render is, with a checkpoint; and with pictures, if `over` says what time it took.
    fn write(
        &mut self,
        session: &Session,
        progress: &Progress,
        over: Option<Clock>,
    ) -> Result<(), StudioError>;
}

/// What happens on a farm, for people.
#[derive(Debug)]
#[non_exhaustive]
pub enum News<'a> {
    /// Tasks of this round were started.
    Round(&'a Round),
    /// Tasks failed, and are planned again.
    Failed {
        failed: usize,
        tasks: usize,
        /// What the first of them said.
        log: PathBuf,
    },
    /// Shards, or some of their batches, cannot be used.
    Problems(&'a [Problem]),
    /// A useless shard has this name now.
    SetAside(&'a Path),
    /// Nobody can tell whether Slurm still works on a round.
    Unsure(usize, &'a FarmError),
    /// The Slurm jobs of a round have vanished, and are submitted again.
    Vanished(usize),
}
