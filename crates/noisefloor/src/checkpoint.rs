//! What a session has come to, kept to go on with later.

use crate::container::{Fault, Format, MAX_PAYLOAD};
use crate::display::Display;
use crate::film::Film;
use crate::params::Params;
use crate::session::TileState;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::io::{self, Read, Write};
use thiserror::Error;

const FORMAT: Format = Format { magic: *b"NFCHECK\0", version: VERSION };
const VERSION: u32 = 1;

/// All that a session has come to: samples, verdicts and the display; made by [`Session::checkpoint`](crate::Session::checkpoint), gone
/// on with by [`Session::resume`](crate::Session::resume) and [`Driver::resume`](crate::Driver::resume). Its file has up to 21 bytes a pixel for
/// each half that is kept, and writing it takes as much memory again.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Checkpoint<'a> {
    pub(crate) job: Cow<'a, str>,
    pub(crate) criterion: String,
    /// What the criterion keeps.
    pub(crate) state: Vec<u8>,
    pub(crate) params: Params,
    pub(crate) display: Option<Display>,
    pub(crate) film: Cow<'a, Film>,
    pub(crate) tiles: Cow<'a, [TileState]>,
}

/// Why a checkpoint cannot be used.
#[derive(Debug, Error)]
pub enum CheckpointError {
    /// The file cannot be read or written.
    #[error("the checkpoint cannot be read or written: {0}")]
    Io(#[from] io::Error),
    /// Not a checkpoint.
    #[error("this is not a noisefloor checkpoint: it does not begin with the magic of one")]
    Foreign,
    /// Of another release.
    #[error("the checkpoint has format version {0}, and this release reads version {VERSION}: begin anew")]
    Version(u32),
    /// The content is not what was written.
    #[error("the checkpoint is damaged: {0}")]
    Damaged(String),
    /// More than the limit.
    #[error("the checkpoint has {0} bytes, more than the limit of {MAX_PAYLOAD}")]
    Oversized(u64),
    /// It is of another job.
    #[error("the checkpoint is of another job: its {what} is {kept}, not {now}")]
    Other {
        /// What differs.
        what: &'static str,
        /// What the checkpoint says of it.
        kept: String,
        /// What is asked for.
        now: String,
    },
    /// The content contradicts itself.
    #[error("the checkpoint does not hold together: {0}")]
    Invalid(&'static str),
    /// The source does not say that it repeats its samples: after a new start, old ones could be taken for new.
    #[error("{0} does not promise to go on with new samples where it stood: it cannot be resumed")]
    Source(String),
}

impl From<Fault> for CheckpointError {
    fn from(fault: Fault) -> Self {
        match fault {
            Fault::Io(error) => Self::Io(error),
            Fault::Foreign => Self::Foreign,
            Fault::Version(found) => Self::Version(found),
            Fault::Damaged(what) => Self::Damaged(what),
            Fault::Oversized(bytes) => Self::Oversized(bytes),
        }
    }
}

impl Checkpoint<'_> {
    /// Reads a checkpoint. What it holds is checked when it is gone on with.
    ///
    /// # Errors
    /// [`CheckpointError`] if it is foreign, damaged, oversized, or of another version.
    pub fn read(from: impl Read) -> Result<Checkpoint<'static>, CheckpointError> {
        Ok(FORMAT.read(from)?)
    }

    /// Writes the checkpoint.
    ///
    /// # Errors
    /// [`CheckpointError::Io`] if it cannot be written, [`CheckpointError::Oversized`] if it has more than 2 GiB: some 50 million pixels.
    pub fn write(&self, to: impl Write) -> Result<(), CheckpointError> {
        Ok(FORMAT.write(self, to)?)
    }

    /// Checks that it is of this job, and that nothing in it can lead a session astray. `fresh` is the film that the session would begin with.
    pub(crate) fn check(
        &self,
        job: &str,
        criterion: &str,
        params: &Params,
        fresh: &Film,
    ) -> Result<(), CheckpointError> {
        let same = |what, kept: String, now: String| {
            if kept == now { Ok(()) } else { Err(CheckpointError::Other { what, kept, now }) }
        };
        same("job", self.job.to_string(), job.to_owned())?;
        same("criterion", self.criterion.clone(), criterion.to_owned())?;
        same("set of parameters", format!("{:?}", self.params), format!("{params:?}"))?;
        let size = |film: &Film| format!("{}×{} pixels", film.grid().width(), film.grid().height());
        same("picture", size(&self.film), size(fresh))?;
        self.film.check_like(fresh).map_err(CheckpointError::Invalid)?;
        let exposed = |display: &Display| display.exposure().is_finite() && display.exposure() > 0.0;
        if !self.display.as_ref().is_none_or(exposed) {
            return Err(CheckpointError::Invalid("its exposure is not a positive finite number"));
        }
        let grid = fresh.grid();
        let fits = |(index, state): (usize, &TileState)| {
            let most = params.max_samples.max(self.film.samples(index) + 1);
            state.streak <= params.consecutive
                && state.next <= most
                && state.target.is_none_or(|target| target <= most)
                && state.stop.is_none_or(|stop| stop.tile == grid.tile(index))
        };
        if self.tiles.len() != grid.len() || !self.tiles.iter().enumerate().all(fits) {
            return Err(CheckpointError::Invalid("its tiles are not those of its picture"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::criterion::{FixedSamples, StoppingCriterion};
    use crate::driver::{Driver, Event};
    use crate::oracle::Oracle;
    use crate::source::{Batch, ProgressiveSource, Repeats, Request, SourceError, SourceInfo, Unit};
    use proptest::prelude::*;
    use std::sync::atomic::Ordering;

    /// Noise that follows from pixel and sample alone, and more of it to the right.
    struct Noise(Repeats);

    impl ProgressiveSource for Noise {
        fn info(&self) -> SourceInfo {
            SourceInfo {
                name: "noise".into(),
                width: 96,
                height: 48,
                unit: Unit::SamplesPerPixel,
                aims: true,
                repeats: self.0,
            }
        }

        fn sample(&mut self, requests: &[Request]) -> Result<Vec<Batch>, SourceError> {
            let sample = |x: usize, y: usize, n: u64| {
                let seed = (y * 96 + x) as u64 ^ n << 20;
                let hash = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
                let hash = (hash ^ hash >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                0.2 + 0.01 * x as f32 * ((hash >> 40) as f32 / (1 << 24) as f32 - 0.5)
            };
            let batch = |&Request { tile, first, samples }: &Request| {
                let pixel = |i: usize| {
                    let (x, y) = (tile.x + i % tile.width, tile.y + i / tile.width);
                    [(first..first + u64::from(samples)).map(|n| sample(x, y, n)).sum::<f32>()
                        / samples as f32; 3]
                };
                Batch { tile, samples, mean: (0..tile.pixels()).map(pixel).collect() }
            };
            Ok(requests.iter().map(batch).collect())
        }
    }

    fn params() -> Params {
        Params {
            tile: 16,
            min_samples: 20,
            max_samples: 2000,
            schedule: crate::Schedule::Every { step: 20 },
            ..Params::default()
        }
    }

    /// A driver of the job, broken off after some batches.
    fn broken_off<C: StoppingCriterion>(criterion: C, batches: usize) -> Driver<Noise, C> {
        let mut driver = Driver::new(Noise(Repeats::Samples), criterion, params()).unwrap();
        let (cancel, mut left) = (driver.cancel_flag(), batches);
        let mut count = |event: &Event| {
            if matches!(event, Event::BatchDone(_)) {
                left = left.saturating_sub(1);
                cancel.store(left == 0, Ordering::Relaxed);
            }
        };
        driver.run(|_, event| count(event)).unwrap();
        driver
    }

    fn kept<C: StoppingCriterion>(driver: &Driver<Noise, C>) -> Vec<u8> {
        let mut bytes = Vec::new();
        driver.session().checkpoint("noise").write(&mut bytes).unwrap();
        bytes
    }

    #[cfg(feature = "bundled-model")]
    #[test]
    fn a_run_that_was_broken_off_goes_on_to_the_bit() {
        let whole = broken_off(Oracle::bundled(), usize::MAX);
        let reasons: Vec<_> = whole.session().stops().map(|s| s.samples).collect();
        assert!(reasons.iter().any(|&n| n != reasons[0]), "tiles stop at different times: {reasons:?}");
        let n = whole.timeline().len();
        assert!(n > 8, "{n} batches");
        for batches in [1, 2, n / 2, n - 1] {
            let bytes = kept(&broken_off(Oracle::bundled(), batches));
            let checkpoint = Checkpoint::read(&bytes[..]).unwrap();
            let driver = Driver::new(Noise(Repeats::Samples), Oracle::bundled(), params()).unwrap();
            let mut driver = driver.resume("noise", checkpoint).unwrap();
            assert!(!driver.session().is_done(), "{batches}");
            driver.run(|_, _| ()).unwrap();
            assert!(kept(&driver) == kept(&whole), "{batches} batches");
        }
    }

    #[cfg(feature = "bundled-model")]
    #[test]
    fn an_oracle_takes_up_no_nonsense() {
        let driver = broken_off(Oracle::bundled(), 3);
        let grid = driver.session().film().grid();
        let state = driver.session().criterion().state();
        let mut oracle = Oracle::bundled();
        assert!(oracle.restore(grid, &state) && oracle.state() == state);
        assert!(!oracle.restore(crate::TileGrid::new(16, 16, 16).unwrap(), &state));
        assert!(!oracle.restore(grid, &state[..state.len() - 1]) && !oracle.restore(grid, &[0xff; 64]));
        assert!(oracle.state() == state);
    }

    #[test]
    fn what_is_done_stays_done() {
        let bytes = kept(&broken_off(FixedSamples(40), usize::MAX));
        let driver = Driver::new(Noise(Repeats::Samples), FixedSamples(40), params()).unwrap();
        let driver = driver.resume("noise", Checkpoint::read(&bytes[..]).unwrap()).unwrap();
        assert!(driver.session().is_done());
    }

    #[test]
    fn another_job_is_refused() {
        let bytes = kept(&broken_off(FixedSamples(40), 1));
        let refused = |repeats, samples, params, job| {
            let driver = Driver::new(Noise(repeats), FixedSamples(samples), params).unwrap();
            driver.resume(job, Checkpoint::read(&bytes[..]).unwrap()).err().map(|e| e.to_string())
        };
        let other = |what: &str| format!("the checkpoint is of another job: its {what} is");
        let begins = |error: Option<String>, with: &str| {
            let error = error.unwrap();
            assert!(error.starts_with(with), "{error}");
        };
        assert_eq!(refused(Repeats::Samples, 40, params(), "noise"), None);
        begins(refused(Repeats::Samples, 40, params(), "silence"), &other("job"));
        begins(refused(Repeats::Samples, 50, params(), "noise"), &other("criterion"));
        begins(
            refused(Repeats::Samples, 40, Params { consecutive: 2, ..params() }, "noise"),
            &other("set of parameters"),
        );
        begins(refused(Repeats::Calls, 40, params(), "noise"), "noise does not promise");
    }

    #[test]
    fn what_does_not_hold_together_is_refused() {
        let driver = broken_off(FixedSamples(40), 1);
        let refused = |change: &dyn Fn(&mut Checkpoint<'_>)| {
            let mut checkpoint = driver.session().checkpoint("noise");
            change(&mut checkpoint);
            let driver = Driver::new(Noise(Repeats::Samples), FixedSamples(40), params()).unwrap();
            matches!(driver.resume("noise", checkpoint), Err(CheckpointError::Invalid(_)))
        };
        assert!(!refused(&|_| ()));
        assert!(refused(&|c| c.tiles.to_mut().truncate(3)));
        assert!(refused(&|c| c.tiles.to_mut()[0].streak = u32::MAX));
        assert!(refused(&|c| c.tiles.to_mut()[0].next = u64::MAX));
        assert!(refused(&|c| c.tiles.to_mut()[0].target = Some(u64::MAX)));
        assert!(refused(&|c| c.tiles.to_mut().swap(0, 1)));
        assert!(refused(&|c| c.display = Some(crate::ToneMapping::Srgb { exposure: f32::NAN }.settle(&[]))));
        assert!(refused(&|c| c.state = vec![1, 2, 3]));
        assert!(refused(&|c| c.film.to_mut().corrupt(0)));
        assert!(refused(&|c| c.film.to_mut().corrupt(1)));
        assert!(refused(&|c| c.film.to_mut().corrupt(2)));
        assert!(refused(&|c| c.film.to_mut().corrupt(3)));
        assert!(refused(&|c| c.film.to_mut().corrupt(4)));
    }

    proptest! {
        /// Damage is found by the checksum; what a checksum was made for that is nonsense, by what reads it.
        #[test]
        fn damage_and_nonsense_are_errors(at in 0usize..10_000, bit in 0u8..8, nonsense in prop::collection::vec(any::<u8>(), 0..200)) {
            let mut bytes = kept(&broken_off(FixedSamples(40), 1));
            let at = at % bytes.len();
            bytes[at] ^= 1 << bit;
            prop_assert!(Checkpoint::read(&bytes[..]).is_err());
            prop_assert!(Checkpoint::read(&bytes[..at]).is_err());
            let mut file = Vec::new();
            FORMAT.write(&nonsense, &mut file).unwrap_or_default();
            prop_assert!(Checkpoint::read(&file[..]).is_err());
        }
    }
}
