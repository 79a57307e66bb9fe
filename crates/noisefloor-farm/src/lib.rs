//! A frame or a sequence over many machines.
//!
//! This crate serves the commands: any release may change its interface.
//!
//! - A [`Shard`] is a file of batches, each the samples of one tile in one range
//!   ([`PlannedBatch`]). It says which job they are of ([`ShardJob`]).
//! - [`sample`] takes the samples of a shard; [`split`] divides work into tasks of about equal length.
//! - [`ShardSet`] merges shards into a [`Session`](noisefloor::Session), batch by batch as a
//!   [`Driver`](noisefloor::Driver) on one machine would take them. So the film, every verdict and every stop
//!   are those of one machine, to the bit, whatever the order, number and size of the shards.
//! - A [`Farm`] is planned once; a [`Coordinator`] then runs rounds of tasks and merges on this machine or on
//!   [`Slurm`]. A [`FarmFolder`] is all its state: what is rendered, the round under way, and how far each frame is.
//! - A [`Forecast`] says what a sequence will take, from some of its frames.
//! - A [`Studio`] opens sources and writes pictures; the farm knows neither.
//!
//! ```
//! use noisefloor::{FixedSpp, Params, Session, TileGrid};
//! use noisefloor_farm::{PlannedBatch, ShardJob, ShardSet, sample, split};
//! use noisefloor_ptwne::{Ptwne, RenderOptions, scenes};
//!
//! let (criterion, params) = (FixedSpp(100), Params::default().with_tile(32).with_min_spp(100));
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

#![allow(missing_docs, reason = "serves the commands: any release may change what is public here")]

mod batch;
mod error;
mod farm;
mod file;
mod folder;
mod forecast;
mod frame;
mod local;
mod merge;
mod plan;
mod shard;
mod slurm;
mod state;
mod studio;
mod task;

pub use batch::PlannedBatch;
pub use error::{FarmError, PathFault, ShardError, StudioError};
pub use farm::{Coordinator, Delivery, Farm, FarmProgress, FrameProgress, Order};
pub use folder::{FarmFolder, FarmLock};
pub use forecast::Forecast;
pub use frame::{MergedShards, merge_shards};
pub use local::run_local;
pub use merge::{Merged, Problem, ShardSet};
pub use plan::{Task, split};
pub use shard::{BatchEntry, Shard, ShardFile, ShardJob};
pub use slurm::Slurm;
pub use state::{FarmPlan, FrameJob, FrameState, Frames, Round, RoundState, SlurmJobs};
pub use studio::{Finished, FrameSource, News, RenderFiles, Studio};
pub use task::sample;
