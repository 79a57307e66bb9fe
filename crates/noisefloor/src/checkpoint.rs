//! A snapshot of a session, for resuming it.

use crate::container::{self, FileFault, Format, MAX_PAYLOAD};
use crate::criterion::StoppingCriterion;
use crate::display::Display;
use crate::film::{Film, planes::FilmHead};
use crate::params::{Audience, Params, Schedule};
use crate::session::{Goal, Settling, TileState};
use crate::source::{IdentityChange, SourceIdentity};
use crate::watch::Watch;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::io::{self, Read, Write};
use thiserror::Error;

const FORMAT: Format = Format { magic: *b"NFCHECK\0", version: VERSION };
const VERSION: u32 = 17;

/// A snapshot of a session, for resuming it: samples, verdicts, the display, and what was noticed of the
/// samples. Made by [`Session::checkpoint`](crate::Session::checkpoint), resumed by
/// [`Session::resume`](crate::Session::resume) and [`Driver::resume`](crate::Driver::resume). Its file has 18
/// bytes per pixel for each half that is kept, and what the criterion keeps; writing it takes next to no more memory.
#[derive(Clone, Debug)]
pub struct Checkpoint<'a> {
    pub(crate) job: Cow<'a, str>,
    pub(crate) source: Cow<'a, SourceIdentity>,
    /// Fingerprint of the criterion.
    pub(crate) criterion: String,
    /// State of the criterion.
    pub(crate) state: Vec<u8>,
    pub(crate) params: Params,
    pub(crate) display: Option<Display>,
    pub(crate) settling: Option<Settling>,
    pub(crate) film: Cow<'a, Film>,
    pub(crate) tiles: Cow<'a, [TileState]>,
    pub(crate) watch: Cow<'a, Watch>,
}

/// A checkpoint in its file, without the pixels of its film, which follow.
#[derive(Serialize, Deserialize)]
struct Head<'a> {
    job: Cow<'a, str>,
    source: Cow<'a, SourceIdentity>,
    criterion: Cow<'a, str>,
    state: Cow<'a, [u8]>,
    params: Params,
    display: Option<Display>,
    settling: Option<Settling>,
    film: FilmHead,
    tiles: Cow<'a, [TileState]>,
    watch: Cow<'a, Watch>,
}

/// Why a checkpoint cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CheckpointError {
    /// The file cannot be read or written.
    #[error("the checkpoint cannot be read or written: {0}")]
    Io(#[from] io::Error),
    /// Not a checkpoint.
    #[error("this is not a noisefloor checkpoint: its first bytes are not those of one")]
    Foreign,
    /// Of another release.
    #[error(
        "the checkpoint has format version {0}, and this release reads version {VERSION}: start again without it"
    )]
    Version(u32),
    /// The content is not what was written.
    #[error("the checkpoint is damaged: {0}")]
    Damaged(String),
    /// More than the limit.
    #[error("the checkpoint has {0} bytes, more than the limit of {MAX_PAYLOAD}")]
    Oversized(u64),
    /// It belongs to another job.
    #[error("the checkpoint belongs to another job: its {what} is {kept}, not {now}")]
    Other {
        /// What differs.
        what: &'static str,
        /// What the checkpoint says of it.
        kept: String,
        /// What is asked for.
        now: String,
    },
    /// Its samples are of another scene, or of other options.
    #[error("the checkpoint belongs to another job: {0}")]
    Changed(#[from] IdentityChange),
    /// The content contradicts itself.
    #[error("the checkpoint contradicts itself: {0}")]
    Invalid(&'static str),
    /// The source does not promise to repeat its samples: after a restart it could return the same ones again
    /// as new.
    #[error("{0} cannot be resumed: it does not promise new samples after a restart")]
    Source(String),
    /// The criterion does not say its state ([`StoppingCriterion::state`]).
    #[error("a render stopped by {0} cannot be resumed: this criterion does not keep its state")]
    Criterion(String),
}

impl From<FileFault> for CheckpointError {
    fn from(fault: FileFault) -> Self {
        match fault {
            FileFault::Io(error) => Self::Io(error),
            FileFault::Foreign => Self::Foreign,
            FileFault::Version(found) => Self::Version(found),
            FileFault::Damaged(what) => Self::Damaged(what),
            FileFault::Oversized(bytes) => Self::Oversized(bytes),
        }
    }
}

impl Checkpoint<'_> {
    /// Reads a checkpoint. Its content is validated on resume.
    ///
    /// # Errors
    /// [`CheckpointError`] if it is foreign, damaged, oversized, or of another version.
    pub fn read(from: impl Read) -> Result<Checkpoint<'static>, CheckpointError> {
        let whole = |head: Head<'static>, from: &mut dyn Read| {
            let Head { job, source, criterion, state, params, display, settling, film, tiles, watch } = head;
            let film = Film::read_pixels(film, from).map_err(ended)?;
            let film = film.ok_or_else(|| FileFault::Damaged("there is no such film".into()))?;
            let (criterion, state, film) = (criterion.into_owned(), state.into_owned(), Cow::Owned(film));
            Ok(Checkpoint { job, source, criterion, state, params, display, settling, film, tiles, watch })
        };
        Ok(FORMAT.read_with_body(from, whole)?)
    }

    /// A digest of all that its samples and verdicts depend on: job, source, criterion, parameters and size
    /// of the picture. Whoever finds a finished picture compares it before taking it for its own.
    pub fn job_digest(&self) -> String {
        let (grid, Self { job, source, criterion, params, .. }) = (self.film.grid(), self);
        // Nothing of it can fail to be written into memory
        let all = container::payload(&(job, source, criterion, params, grid.width(), grid.height()));
        blake3::hash(&all.unwrap_or_default()).to_hex().to_string()
    }

    /// Samples in its film, over all pixels.
    pub fn total_samples(&self) -> u64 {
        self.film.total_samples()
    }

    /// Writes the checkpoint.
    ///
    /// # Errors
    /// [`CheckpointError::Io`] if it cannot be written.
    pub fn write(&self, to: impl Write) -> Result<(), CheckpointError> {
        let head = Head {
            job: Cow::Borrowed(&self.job),
            source: Cow::Borrowed(&self.source),
            criterion: Cow::Borrowed(&self.criterion),
            state: Cow::Borrowed(&self.state),
            params: self.params.clone(),
            display: self.display.clone(),
            settling: self.settling,
            film: self.film.head(),
            tiles: Cow::Borrowed(&self.tiles),
            watch: Cow::Borrowed(&self.watch),
        };
        Ok(FORMAT.write_with_body(&head, to, |to| self.film.write_pixels(to))?)
    }

    /// Checks that it belongs to this job, and that nothing in it can lead a session astray. `fresh` is the
    /// film that the session would begin with.
    pub(crate) fn check(
        &self,
        job: &str,
        source: &SourceIdentity,
        criterion: &impl StoppingCriterion,
        params: &Params,
        fresh: &Film,
    ) -> Result<(), CheckpointError> {
        let same = |what, kept: String, now: String| {
            if kept == now { Ok(()) } else { Err(CheckpointError::Other { what, kept, now }) }
        };
        same("job", self.job.to_string(), job.to_owned())?;
        source.change_since(&self.source).map_or(Ok(()), Err)?;
        if !criterion.asks_for_more_than(&self.criterion) {
            same("criterion", self.criterion.clone(), criterion.fingerprint())?;
        }
        // More samples may be allowed than before, and so may more than the fewest be, where these were held to the most
        let Params { min_spp: fewest, max_spp: most, .. } = self.params;
        let held = fewest == most && params.min_spp > fewest;
        let grown = self.params.clone().with_max_spp(most.max(params.max_spp));
        let grown = grown.with_min_spp(if held { params.min_spp } else { fewest });
        if let Some((what, kept, now)) = changed_param(&grown, params) {
            let kept = if what == MOST_SPP { self.params.max_spp.to_string() } else { kept };
            return Err(CheckpointError::Other { what, kept, now });
        }
        let size = |film: &Film| format!("{}×{} pixels", film.grid().width(), film.grid().height());
        same("picture", size(&self.film), size(fresh))?;
        self.film.check_like(fresh).map_err(CheckpointError::Invalid)?;
        let exposed = |display: &Display| display.exposure().is_finite() && display.exposure() > 0.0;
        if !self.display.as_ref().is_none_or(exposed) {
            return Err(CheckpointError::Invalid("its exposure is not a positive finite number"));
        }
        let sound = |settling: &Settling| {
            self.display.is_some() && settling.error >= 0.0 && settling.samples <= self.film.total_samples()
        };
        if !self.settling.as_ref().is_none_or(sound) {
            return Err(CheckpointError::Invalid("it does not say how well its exposure is known"));
        }
        let grid = fresh.grid();
        let fits = |(index, state): (usize, &TileState)| {
            let most = params.max_spp.max(self.film.spp(index) + 1);
            let streak = if let Goal::Verdict { streak, .. } = state.goal { streak } else { 0 };
            streak <= params.consecutive
                && state.goal.spp() <= most
                && state.stop.is_none_or(|stop| stop.tile == grid.tile(index))
        };
        if self.tiles.len() != grid.len() || !self.tiles.iter().enumerate().all(fits) {
            return Err(CheckpointError::Invalid("its tiles are not those of its picture"));
        }
        Ok(())
    }
}

/// The parameter that may grow.
const MOST_SPP: &str = "most samples per pixel";

/// The first parameter that differs, as it was and as it is.
fn changed_param(kept: &Params, now: &Params) -> Option<(&'static str, String, String)> {
    let words = |params: &Params| {
        // A new parameter does not compile until it is here
        let Params { tile, tone_mapping, viewing, schedule, min_spp, max_spp, consecutive, audience } =
            params;
        let Audience { slope, offset } = audience;
        [
            ("tile edge", format!("{tile} pixels")),
            ("audience", format!("one of {slope} times the samples {offset:+}")),
            ("viewing", viewing.to_string()),
            ("schedule", schedule_in_words(*schedule)),
            ("fewest samples per pixel", min_spp.to_string()),
            (MOST_SPP, max_spp.to_string()),
            ("number of verdicts in a row", consecutive.to_string()),
            ("tone mapping", format!("{tone_mapping:?}")),
        ]
    };
    let differs =
        |((what, kept), (_, now)): ((_, String), (_, String))| (kept != now).then_some((what, kept, now));
    words(kept).into_iter().zip(words(now)).find_map(differs)
}

fn schedule_in_words(schedule: Schedule) -> String {
    match schedule {
        Schedule::Spaced { step } => format!("spaced by {step} samples or more"),
        Schedule::Growing { step } => format!("growing from {step} samples"),
        Schedule::Every { step } => format!("every {step} samples"),
    }
}

/// A file that ends early is damaged, and not unreadable.
fn ended(error: io::Error) -> FileFault {
    match error.kind() {
        io::ErrorKind::UnexpectedEof => FileFault::Damaged("it ends within its film".into()),
        _ => FileFault::Io(error),
    }
}

#[cfg(test)]
mod tests;
