//! A frame or a sequence over many machines.
//!
//! - A [`Shard`] is a file of batches, each the samples of one tile in one range, or in one range for each of
//!   its blocks ([`PlannedBatch`]). It says which job they are of ([`ShardJob`]).
//! - [`sample`] takes the samples of a shard; [`split`] divides work into tasks of about equal length.
//! - [`ShardSet`] merges shards into a [`Session`](noisefloor::Session), batch by batch as a
//!   [`Driver`](noisefloor::Driver) on one machine would take them. So the film, every verdict and every stop
//!   are those of one machine, to the bit, whatever the order, number and size of the shards.
//! - [`FarmFolder`] is all the state of a farm: what is rendered, the round under way, and how far each frame
//!   is.
//! - [`Slurm`] and [`run_local`] run the tasks of a round.
//!
//! ```
//! use noisefloor::{FixedSpp, Params, Session, TileGrid};
//! use noisefloor_farm::{PlannedBatch, ShardJob, ShardSet, sample, split};
//! use noisefloor_ptwne::{Ptwne, RenderOptions, scenes};
//!
//! let (criterion, params) = (FixedSpp(100), Params::default().with_tile(32));
//! let mut source = Ptwne::new(scenes::by_name("bulb").unwrap(), 64, 32, RenderOptions::default())?;
//! let mut session = Session::new(64, 32, criterion, params)?;
//! let job = ShardJob::new(&source, &session)?;
//! let folder = tempfile::tempdir()?;
//!
//! // On one machine: what is to be done, in two tasks. On others: doing it.
//! let wanted = PlannedBatch::ahead(&session);
//! let mut files = Vec::new();
//! for (index, task) in split(vec![(job.grid()?, wanted)], 2).iter().enumerate() {
//!     let shard = sample(&mut source, job.clone(), &task.batches, || false)?;
//!     files.push(folder.path().join(format!("{index}.nfs")));
//!     shard.write(&files[index])?;
//! }
//!
//! let mut shards = ShardSet::gather(&job, &files);
//! shards.merge_into(&mut session)?;
//! assert!(session.is_done() && shards.problems().is_empty());
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod batch;
mod error;
mod folder;
mod local;
mod merge;
mod plan;
mod shard;
mod slurm;
mod task;

pub use batch::PlannedBatch;
pub use error::{FarmError, ShardError};
pub use folder::{
    FarmFolder, FarmJob, FarmLock, FrameJob, FrameState, MOST_FRAMES, Round, SlurmJobs, frame_arguments,
};
pub use local::run_local;
pub use merge::{Merged, Problem, ShardSet};
pub use plan::{Task, split};
pub use shard::{BatchEntry, Shard, ShardFile, ShardJob};
pub use slurm::Slurm;
pub use task::sample;
