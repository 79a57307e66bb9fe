//! The folder of a farm: all the state there is.
//!
//! ```text
//! DIR/farm.json               what is rendered
//!     round.json              the tasks of the round under way
//!     log/                    what the tasks of each round said
//!     FRAME/frame.json        what the samples of a frame are of
//!     FRAME/state.json        how far it is
//!     FRAME/shards/*.nfs      samples that are not merged yet
//!     FRAME/…                 the files of `noisefloor render`
//! ```

use crate::error::{FarmError, PLAN_VERSION, PathFault};
use crate::file::{read_json, write_json};
use crate::shard::ShardFile;
use crate::state::{FarmPlan, FrameJob, FrameState, Round};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::Value;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io;
use std::path::{Path, PathBuf};

/// An empty hidden file. The lock itself ends with the process that holds it, however that ends.
const LOCK: &str = ".noisefloor-farm.lock";

/// How far a frame is, with the digest of the job that it is of.
#[derive(Serialize, Deserialize)]
struct KeptState {
    #[serde(default)]
    of: String,
    #[serde(flatten)]
    state: FrameState,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FarmFolder(PathBuf);

/// Held by whoever plans and merges.
#[derive(Debug)]
pub struct FarmLock(#[expect(dead_code, reason = "the lock lives as long as the file is open")] File);

impl FarmFolder {
    /// A folder, which need not exist yet.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self(path.into())
    }

    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Keeps other coordinators out of the folder, on every machine whose file system shares locks. A
    /// coordinator that was killed holds no lock.
    pub fn lock(&self) -> Result<FarmLock, FarmError> {
        let path = self.0.join(LOCK);
        let failed = |fault: io::Error| FarmError::at(&path, fault);
        fs::create_dir_all(self.0.join("log")).map_err(failed)?;
        let file = OpenOptions::new().create(true).truncate(false).write(true).open(&path).map_err(failed)?;
        match file.try_lock() {
            Ok(()) => Ok(FarmLock(file)),
            Err(TryLockError::WouldBlock) => Err(FarmError::at(&self.0, PathFault::Locked)),
            Err(TryLockError::Error(error)) => Err(failed(error)),
        }
    }

    /// What is rendered; none if nothing was planned here.
    pub fn planned<J: DeserializeOwned>(&self) -> Result<Option<FarmPlan<J>>, FarmError> {
        let path = self.0.join("farm.json");
        let Some(plan) = read_json::<Value>(&path)? else { return Ok(None) };
        // What is no plan at all is said by what it lacks
        match plan.as_object().map(|plan| plan.get("version").and_then(Value::as_u64).unwrap_or(1)) {
            Some(found) if found != PLAN_VERSION => Err(FarmError::at(&path, PathFault::Version(found))),
            _ => serde_json::from_value(plan).map(Some).map_err(|fault| FarmError::at(&path, fault)),
        }
    }

    pub fn plan<J: DeserializeOwned>(&self) -> Result<FarmPlan<J>, FarmError> {
        let what = "no farm was planned in this folder; `noisefloor farm plan DIR -- SCENE` does";
        self.planned()?.ok_or_else(|| FarmError::at(&self.0, what.to_owned()))
    }

    pub fn write_plan<J: Serialize>(&self, plan: &FarmPlan<J>) -> Result<(), FarmError> {
        write_json(&self.0.join("farm.json"), plan)
    }

    /// The round under way, or the last one; number 0, without tasks, before the first.
    pub fn round(&self) -> Result<Round, FarmError> {
        Ok(read_json(&self.0.join("round.json"))?.unwrap_or_default())
    }

    pub fn write_round(&self, round: &Round) -> Result<(), FarmError> {
        write_json(&self.0.join("round.json"), round)
    }

    pub fn frame(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    pub fn frame_job(&self, name: &str) -> Result<FrameJob, FarmError> {
        let path = self.frame(name).join("frame.json");
        let what = "is missing: the frame was not planned; plan the farm anew in another folder";
        read_json(&path)?.ok_or_else(|| FarmError::at(&path, what.to_owned()))
    }

    /// Writes what a frame is, and makes its folders.
    pub fn write_frame_job(&self, name: &str, job: &FrameJob) -> Result<(), FarmError> {
        let shards = self.frame(name).join("shards");
        fs::create_dir_all(&shards).map_err(|fault| FarmError::at(&shards, fault))?;
        write_json(&self.frame(name).join("frame.json"), job)
    }

    /// How far a frame is: nowhere, if what is kept of it is of another job than the one planned.
    pub fn state(&self, name: &str) -> Result<FrameState, FarmError> {
        let kept: Option<KeptState> = read_json(&self.frame(name).join("state.json"))?;
        let job = self.job_of(name)?;
        Ok(kept.filter(|kept| kept.of == job).map(|kept| kept.state).unwrap_or_default())
    }

    /// Writes how far a frame is.
    pub fn write_state(&self, name: &str, state: &FrameState) -> Result<(), FarmError> {
        let kept = KeptState { of: self.job_of(name)?, state: state.clone() };
        write_json(&self.frame(name).join("state.json"), &kept)
    }

    /// The digest of a frame's job.
    fn job_of(&self, name: &str) -> Result<String, FarmError> {
        Ok(self.frame_job(name)?.shards.digest())
    }

    /// The file that a task writes.
    pub fn shard(&self, name: &str, round: usize, task: usize) -> PathBuf {
        self.frame(name).join("shards").join(format!("{round:04}-{task:05}.nfs"))
    }

    /// What a task says.
    pub fn log(&self, round: usize, task: usize) -> PathBuf {
        self.0.join("log").join(format!("{round:04}-{task}.log"))
    }

    /// The shards of a frame, in the order of their names.
    pub fn shards(&self, name: &str) -> Result<Vec<PathBuf>, FarmError> {
        let folder = self.frame(name).join("shards");
        let failed = |fault: io::Error| FarmError::at(&folder, fault);
        let mut shards = Vec::new();
        for entry in fs::read_dir(&folder).map_err(failed)? {
            let path = entry.map_err(failed)?.path();
            // Names that begin with a dot are files on their way
            let hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
            if !hidden && path.extension().is_some_and(|extension| extension == "nfs") {
                shards.push(path);
            }
        }
        shards.sort();
        Ok(shards)
    }

    /// Removes a shard that is used up, or puts it into the folder `merged` of its frame.
    pub fn retire(&self, name: &str, shard: &ShardFile, keep: bool) -> Result<(), FarmError> {
        let failed = |fault: io::Error| FarmError::at(shard.path(), fault);
        if !keep {
            return fs::remove_file(shard.path()).map_err(failed);
        }
        let folder = self.frame(name).join("merged");
        fs::create_dir_all(&folder).map_err(failed)?;
        fs::rename(shard.path(), folder.join(shard.path().file_name().unwrap_or_default())).map_err(failed)
    }

    /// Puts a shard that cannot be used aside, under the name it returns.
    pub fn set_aside(&self, shard: &Path) -> Result<PathBuf, FarmError> {
        let aside = shard.with_extension("nfs.bad");
        fs::rename(shard, &aside).map_err(|fault| FarmError::at(shard, fault))?;
        Ok(aside)
    }
}

#[cfg(test)]
mod tests;
