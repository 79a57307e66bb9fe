//! One frame: planned, and merged as far as its shards go.

use crate::batch::PlannedBatch;
use crate::error::{FarmError, PathFault};
use crate::folder::FarmFolder;
use crate::merge::ShardSet;
use crate::shard::{ShardFile, ShardJob};
use crate::state::{FrameJob, FrameState};
use crate::studio::{Finished, FrameSource, News, Studio};
use noisefloor::driver::{Clock, Progress, TimelinePoint};
use noisefloor::source::SourceIdentity;
use noisefloor::{ProgressiveSource, Repeats, Session};
use std::path::PathBuf;
use std::time::Instant;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pictures {
    /// Of frames that are done.
    WhenDone,
    /// As far as they are.
    Always,
}

pub(crate) struct Frame<'a, S: Studio> {
    pub(crate) studio: &'a S,
    pub(crate) folder: &'a FarmFolder,
    pub(crate) name: &'a str,
    pub(crate) job: S::Job,
    /// Whether merged shards are kept.
    pub(crate) keep: bool,
}

impl<S: Studio> Frame<'_, S> {
    /// Opens the scene once, and keeps what it is; `waits` says whether its job is to change once others are
    /// done.
    pub(crate) fn plan(&self, waits: bool) -> Result<(), FarmError> {
        let path = self.folder.frame(self.name);
        if let Some(file) = self.studio.occupied(&path) {
            let what = format!(
                "holds a render already ({file}), which the farm would overwrite; move it away, \
                 or choose another folder for the farm"
            );
            return Err(FarmError::at(&path, what));
        }
        let FrameSource { source, scene } = self.studio.open(&self.job)?;
        let (info, identity) = (source.info(), source.identity()?);
        if info.repeats != Repeats::Samples {
            return Err(FarmError::Repeats(info.name));
        }
        let session = self.session((info.width, info.height), identity.clone())?;
        if session.criterion().needs().reference {
            return Err(FarmError::Reference);
        }
        let shards = ShardJob::of(identity, &session);
        self.folder.write_frame_job(self.name, &FrameJob { scene, source: info.name, shards, waits })
    }

    /// Takes up the job that follows from the frames that this one has waited for. Its scene is not opened
    /// again.
    pub(crate) fn begin(&self) -> Result<(), FarmError> {
        let frame = self.folder.frame_job(self.name)?;
        if !frame.waits {
            return Ok(());
        }
        let ShardJob { source, width, height, .. } = frame.shards;
        let session = self.session((width, height), source.clone())?;
        let shards = ShardJob::of(source, &session);
        self.folder.write_frame_job(self.name, &FrameJob { shards, waits: false, ..frame })
    }

    /// The session that a render of that source would have. Its state must be known.
    fn session(&self, size: (usize, usize), source: SourceIdentity) -> Result<Session, FarmError> {
        let mut session = self.studio.session(&self.job, size)?;
        session.set_source(source);
        session.checkpoint(S::CHECKPOINT)?;
        Ok(session)
    }

    /// Merges the shards that are there; how far the frame then is, and what it needs next.
    pub(crate) fn merge(&self, pictures: Pictures) -> Result<(FrameState, Vec<PlannedBatch>), FarmError> {
        let began = Instant::now();
        let Self { studio, folder, name, .. } = self;
        let mut state = folder.state(name)?;
        if state.done {
            return Ok((state, Vec::new()));
        }
        let frame = folder.frame_job(name)?;
        let shards = &frame.shards;
        let mut session = self.session((shards.width, shards.height), shards.source.clone())?;
        shards.check(&ShardJob::of(shards.source.clone(), &session)).map_err(FarmError::Edited)?;

        // A merge that was killed may have written the last picture without saying so in its state
        let place = folder.frame(name);
        match studio.finished(&place, &session.checkpoint(S::CHECKPOINT)?.job_digest())? {
            Finished::This => {
                state = FrameState { done: true, open: 0, ..state };
                folder.write_state(name, &state)?;
                return Ok((state, Vec::new()));
            }
            Finished::Other => return Err(FarmError::at(&place, PathFault::OtherPicture)),
            Finished::Not => {}
        }

        // Take up the frame where the last merge left it
        let mut files = studio.files(&self.job, &frame, &place, true)?;
        if let Some(checkpoint) = files.checkpoint()? {
            session = session.resume(S::CHECKPOINT, checkpoint)?;
        }

        // Add what is there, and keep it before anything is removed
        let mut set = ShardSet::gather(shards, &folder.shards(name)?);
        let merged = set.merge_into(&mut session)?;
        let used_up = set.used_up(&session);
        state.rounds += merged.rounds;
        let clock = count(&mut state, &session, &used_up, began);
        let show = state.done || pictures == Pictures::Always;
        if show || merged.batches > 0 {
            let progress = progress(&session, clock.total_seconds);
            files.write(&session, &progress, show.then_some(clock))?;
        }
        folder.write_state(name, &state)?;
        self.put_away(&set, &used_up)?;

        let mut wanted = PlannedBatch::ahead(&session);
        wanted.retain(|batch| !set.has(batch));
        Ok((state, wanted))
    }

    /// Puts away the shards that are used up, and those that cannot be used.
    fn put_away(&self, shards: &ShardSet, used_up: &[&ShardFile]) -> Result<(), FarmError> {
        let Self { studio, folder, name, keep, .. } = self;
        studio.tell(News::Problems(shards.problems()));
        let useless: Vec<_> = shards.problems().iter().filter(|problem| problem.useless).collect();
        for shard in used_up.iter().filter(|shard| useless.iter().all(|problem| problem.path != shard.path()))
        {
            folder.retire(name, shard, *keep)?;
        }
        for problem in useless {
            studio.tell(News::SetAside(&folder.set_aside(&problem.path)?));
        }
        Ok(())
    }
}

/// Notes how far the frame is, and the time that this merge stands for.
fn count(state: &mut FrameState, session: &Session, used_up: &[&ShardFile], began: Instant) -> Clock {
    let source_seconds: f64 = used_up.iter().map(|shard| shard.seconds()).sum();
    let criterion_seconds = began.elapsed().as_secs_f64();
    state.samples = session.film().total_samples();
    state.sampled += used_up.iter().map(|shard| shard.samples()).sum::<u64>();
    state.source_seconds += source_seconds;
    state.merge_seconds += criterion_seconds;
    (state.tiles, state.open) = (session.film().grid().len(), session.open_tiles());
    (state.to_go, state.done) = (session.expected_samples_to_go(), session.is_done());
    Clock::new(source_seconds, criterion_seconds)
}

fn progress(session: &Session, seconds: f64) -> Progress {
    let (samples, active_tiles) = (session.film().total_samples(), session.open_tiles());
    Progress::new(TimelinePoint::new(seconds, samples, active_tiles), session.film().grid().len())
}

/// A merge of shards from the beginning, without a farm.
#[derive(Debug)]
pub struct MergedShards {
    /// Batches that were added.
    pub batches: usize,
    /// Shards that could be used.
    pub shards: usize,
    pub tiles: usize,
    /// First and last sample, exclusive, of what each open tile needs next.
    pub missing: Vec<(usize, u64, u64)>,
}

/// Merges the shards of the job that the first one belongs to, and writes what there is into a folder;
/// `force` overwrites a render in it.
///
/// # Errors
/// [`FarmError::NoShard`] if none of the files is one; [`FarmError`] if its job cannot be set up, or the
/// folder cannot be written.
pub fn merge_shards<S: Studio>(
    studio: &S,
    paths: &[PathBuf],
    out: &std::path::Path,
    force: bool,
) -> Result<MergedShards, FarmError> {
    let mut first_error = None;
    let opened = paths.iter().find_map(|path| match ShardFile::open(path) {
        Ok(file) => Some(file),
        Err(source) => {
            first_error.get_or_insert(FarmError::NoShard { path: path.clone(), source });
            None
        }
    });
    let no_file = || FarmError::at(out, "there are no shards to merge".to_owned());
    let Some(first) = opened else { return Err(first_error.unwrap_or_else(no_file)) };
    let unknown = |fault| FarmError::at(first.path(), PathFault::Unknown(fault));
    let job: S::Job = first.render().map_err(unknown)?;
    let shards = first.job().clone();
    let mut session = studio.session(&job, (shards.width, shards.height))?;
    session.set_source(shards.source.clone());
    let now = ShardJob::of(shards.source.clone(), &session);
    now.check(&shards).map_err(FarmError::Edited)?;

    let (scene, source) = first.names().unwrap_or(("unnamed scene", "unnamed renderer"));
    let frame = FrameJob { scene: scene.to_owned(), source: source.to_owned(), shards, waits: false };
    let mut files = studio.files(&job, &frame, out, force)?;
    let mut set = ShardSet::gather(&now, paths);
    let merged = set.merge_into(&mut session)?;
    set.find_overlaps(&session);
    studio.tell(News::Problems(set.problems()));
    let seconds: f64 = set.files().iter().map(ShardFile::seconds).sum();
    files.write(&session, &progress(&session, seconds), Some(Clock::new(seconds, 0.0)))?;
    let missing = session.next_batches();
    Ok(MergedShards {
        batches: merged.batches,
        shards: set.files().len(),
        tiles: session.film().grid().len(),
        missing: missing
            .iter()
            .map(|batch| (batch.tile.index, batch.first, batch.first + batch.spp))
            .collect(),
    })
}
