//! Snapshots of sessions.

use super::{Goal, Session};
use crate::checkpoint::{Checkpoint, CheckpointError};
use crate::criterion::StoppingCriterion;
use crate::params::Params;
use crate::session::{Stop, StopReason};
use std::borrow::Cow;

impl<C: StoppingCriterion> Session<C> {
    /// A snapshot, for resuming the session later. `job` is how the caller identifies the job, beside what
    /// [`Session::set_source`] said.
    ///
    /// # Errors
    /// [`CheckpointError::Criterion`] if the criterion keeps a state that cannot be saved.
    pub fn checkpoint<'a>(&'a self, job: &'a str) -> Result<Checkpoint<'a>, CheckpointError> {
        let unsaid = || CheckpointError::Criterion(self.criterion.name());
        Ok(Checkpoint {
            job: job.into(),
            source: Cow::Borrowed(&self.source),
            criterion: self.criterion.fingerprint(),
            state: self.criterion.state().ok_or_else(unsaid)?,
            params: self.params.clone(),
            display: self.display.clone(),
            settling: self.settling,
            film: Cow::Borrowed(&self.film),
            tiles: Cow::Borrowed(&self.tiles),
            watch: Cow::Borrowed(&self.watch),
        })
    }

    /// Resumes another session of the same job where it stood. Tiles that were ended by a limit or a failure
    /// are open again; those that have converged, or have as many samples as are allowed, are not. More samples may be
    /// allowed than before ([`Params::max_spp`](crate::Params::max_spp)): tiles that ended at the old limit are open for
    /// their next verdict then, which need not come where it would have come with the new limit from the start. The criterion
    /// may ask for more than before ([`StoppingCriterion::asks_for_more_than`]), such as a larger share of people or a smaller
    /// loss: tiles that were done are then judged again, with the samples that they have.
    ///
    /// If the same samples are pushed, everything that follows equals the session that was not interrupted,
    /// to the bit: its [warnings](Session::warnings) and faults, too. Pixels share samples if either session
    /// was told so ([`Session::set_pixels`]).
    ///
    /// # Errors
    /// [`CheckpointError`] if job, source, criterion (its [fingerprint](crate::StoppingCriterion::fingerprint):
    /// model, threshold, constants), parameters or image size are not those of the checkpoint, or if it
    /// contradicts itself.
    pub fn resume(mut self, job: &str, checkpoint: Checkpoint<'_>) -> Result<Self, CheckpointError> {
        checkpoint.check(job, &self.source, &self.criterion, &self.params, &self.film)?;
        let asks_for_more = checkpoint.criterion != self.criterion.fingerprint();
        if !self.criterion.restore(self.film.grid(), &checkpoint.state) {
            return Err(CheckpointError::Invalid("the state of its criterion is not valid"));
        }
        if !self.watch.restore(checkpoint.watch.into_owned()) {
            return Err(CheckpointError::Invalid("what it says of the samples is not of its picture"));
        }
        let mut tiles = checkpoint.tiles.into_owned();
        let film = checkpoint.film.into_owned();
        let Params { schedule, max_spp, .. } = self.params;
        for (tile, state) in tiles.iter_mut().enumerate() {
            let spp = film.spp(tile);
            if state.stop.is_some_and(|stop| stop.reason == StopReason::MaxSpp) && spp < max_spp {
                state.stop = None;
                state.goal = Goal::Verdict { spp: schedule.next(spp, None, 1.0).min(max_spp), streak: 0 };
            }
            if asks_for_more && state.stop.is_some_and(|stop| stop.reason.is_satisfied()) {
                (state.stop, state.goal) = (None, Goal::Verdict { spp, streak: 0 });
            }
            state.stop = state.stop.filter(|stop: &Stop| stop.reason.is_final());
        }
        let Checkpoint { display, settling, .. } = checkpoint;
        Ok(Self { film, tiles, display, settling, displayed_reference: None, ..self })
    }
}
