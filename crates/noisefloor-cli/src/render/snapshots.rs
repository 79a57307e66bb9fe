//! How a render is saved and resumed: known where the criterion is, used where it is not.

use crate::output::Output;
use crate::say::note;
use crate::sources::Source;
use anyhow::Context;
use noisefloor::{
    Checkpoint, Driver, Session, StoppingCriterion, checkpoint::CheckpointError, criterion::Resumable,
};

/// A render under way.
pub(super) type Rendering<C> = Driver<Box<dyn Source>, C>;

/// All that must be the same for a render to be resumed, the library checks.
pub const JOB: &str = "noisefloor render";

type Resume<C> = fn(Rendering<C>, &str, Checkpoint<'_>) -> Result<Rendering<C>, CheckpointError>;

/// Of a criterion that is [`Resumable`], on a source that repeats its samples.
pub(super) struct Snapshots<C> {
    save: for<'a> fn(&'a Session<C>, &'a str) -> Checkpoint<'a>,
    resume: Resume<C>,
}

impl<C: Resumable> Snapshots<C> {
    pub(super) fn new() -> Self {
        Self { save: Session::checkpoint, resume: Driver::resume }
    }
}

impl<C: StoppingCriterion> Snapshots<C> {
    /// Everything that has to be known to continue.
    pub(super) fn of<'a>(&'a self, session: &'a Session<C>) -> Checkpoint<'a> {
        (self.save)(session, JOB)
    }

    /// The driver of the render that the output folder holds; as it is if there is none.
    pub(super) fn resume(
        &self,
        driver: Rendering<C>,
        output: &mut Output,
        quiet: bool,
    ) -> anyhow::Result<Rendering<C>> {
        let Some(checkpoint) = output.checkpoint()? else {
            if !quiet {
                note!("nothing to resume in {}: starting from the beginning", output.folder());
            }
            return Ok(driver);
        };
        let driver = (self.resume)(driver, JOB, checkpoint)
            .with_context(|| format!("{} (--force renders anew)", output.checkpoint_file()))?;
        output.take_up(driver.session().film().total_samples());
        Ok(driver)
    }
}
