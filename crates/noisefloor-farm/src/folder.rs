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

use crate::error::FarmError;
use crate::plan::Task;
use crate::shard::{ShardFile, ShardJob};
use noisefloor_image::write_atomic;
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

/// Longest file of JSON that is written and read: a round of some ten million batches.
const MAX_JSON: u64 = 1 << 30;
/// Most frames of one farm.
pub const MOST_FRAMES: u32 = 1_000_000;
/// An empty hidden file. The lock itself ends with the process that holds it, however that ends.
const LOCK: &str = ".noisefloor-farm.lock";

/// What a farm renders.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FarmJob {
    /// Options of `noisefloor render`; {frame} and {frame:04} stand for the number of the frame.
    pub arguments: Vec<String>,
    /// First and last frame of a sequence.
    pub frames: Option<(u32, u32)>,
    /// The folder that relative paths begin at.
    pub folder: PathBuf,
    /// Most tasks of a round.
    pub tasks: usize,
    /// Whether shards are kept once they are merged.
    pub keep: bool,
}

impl FarmJob {
    /// Names of the frames: of their folders.
    pub fn names(&self) -> Vec<String> {
        match self.frames {
            Some((first, last)) => (first..=last).map(|frame| format!("frame-{frame:04}")).collect(),
            None => vec!["frame".to_owned()],
        }
    }

    /// Options of `noisefloor render` for a frame.
    pub fn arguments_of(&self, frame: usize) -> Vec<String> {
        match self.frames {
            Some((first, _)) => frame_arguments(&self.arguments, first.saturating_add(frame as u32)),
            None => self.arguments.clone(),
        }
    }
}

/// Fills in the number of a frame: {frame} as it is, {frame:04} with at least four digits.
///
/// ```
/// use noisefloor_farm::frame_arguments;
/// let typed = ["shots/{frame:04}.xml".to_owned(), "--seed".to_owned(), "{frame}".to_owned()];
/// assert_eq!(frame_arguments(&typed, 7), ["shots/0007.xml", "--seed", "7"]);
/// ```
pub fn frame_arguments(arguments: &[String], frame: u32) -> Vec<String> {
    let fill = |argument: &String| {
        let mut filled = argument.replace("{frame}", &frame.to_string());
        for digits in 1..=9 {
            filled = filled.replace(&format!("{{frame:0{digits}}}"), &format!("{frame:0digits$}"));
        }
        filled
    };
    arguments.iter().map(fill).collect()
}

/// What a frame is, found out when it is planned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FrameJob {
    /// Name of the scene.
    pub scene: String,
    /// Name of the source.
    pub source: String,
    /// What its samples are of.
    pub shards: ShardJob,
}

/// How far a frame is.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FrameState {
    /// All tiles.
    pub tiles: usize,
    /// Tiles that are still open.
    pub open: usize,
    /// Samples in the film, over all pixels.
    pub samples: u64,
    /// Samples of all shards that are used up, over all pixels: those in the film, and those beyond a stop.
    pub sampled: u64,
    /// Samples still expected, over all pixels.
    pub to_go: Option<u64>,
    /// Seconds in the source, of all tasks together.
    pub source_seconds: f64,
    /// Seconds of merging and judging.
    pub merge_seconds: f64,
    /// Rounds that were merged.
    pub rounds: usize,
    /// Whether the picture is there, with all the samples it should have.
    pub done: bool,
}

/// How far a frame is, with the digest of the job that it is of.
#[derive(Serialize, Deserialize)]
struct KeptState {
    #[serde(default)]
    of: String,
    #[serde(flatten)]
    state: FrameState,
}

/// The tasks of a round.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Round {
    /// Counts from 1.
    pub number: usize,
    /// One process each.
    pub tasks: Vec<Task>,
    /// Seconds since 1970 when it was planned.
    pub planned: f64,
    /// Seconds that the round before took, from its plan to this one.
    pub took: f64,
    /// Samples of all films when it was planned, over all pixels.
    pub samples: u64,
    /// Samples that all films got in the round before.
    pub brought: u64,
    /// Rounds in a row that brought nothing; `usize::MAX` where the next one is not counted.
    pub barren: usize,
    /// Whether its tasks were started.
    pub started: bool,
    /// What Slurm runs it as.
    pub slurm: Option<SlurmJobs>,
}

/// What Slurm runs a round as.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SlurmJobs {
    /// The array of tasks; none if there was nothing to sample.
    pub tasks: String,
    /// The job that merges them, judges, and submits the next round.
    pub step: String,
}

/// The folder of a farm.
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

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.0
    }

    /// Keeps other coordinators out of the folder, on every machine whose file system shares locks. A
    /// coordinator that was killed holds no lock.
    ///
    /// # Errors
    /// [`FarmError::Locked`] if there is one; [`FarmError::Read`] if the folder cannot be made or locked.
    pub fn lock(&self) -> Result<FarmLock, FarmError> {
        let path = self.0.join(LOCK);
        let failed = |source| FarmError::Read { path: path.clone(), source };
        fs::create_dir_all(self.0.join("log")).map_err(failed)?;
        let file = OpenOptions::new().create(true).truncate(false).write(true).open(&path).map_err(failed)?;
        match file.try_lock() {
            Ok(()) => Ok(FarmLock(file)),
            Err(TryLockError::WouldBlock) => Err(FarmError::Locked(self.0.clone())),
            Err(TryLockError::Error(error)) => Err(failed(error)),
        }
    }

    /// What is rendered; none if nothing was planned here.
    ///
    /// # Errors
    /// [`FarmError`] if it cannot be read.
    pub fn planned_job(&self) -> Result<Option<FarmJob>, FarmError> {
        let path = self.0.join("farm.json");
        let job: Option<FarmJob> = read_json(&path)?;
        match job.as_ref().and_then(|job| job.frames) {
            Some((first, last)) if first > last || last - first >= MOST_FRAMES => {
                let what = format!(
                    "frames {first} to {last} are none, or more than {MOST_FRAMES}; plan them in several farms"
                );
                Err(FarmError::Folder { path, what })
            }
            _ => Ok(job),
        }
    }

    /// What is rendered.
    ///
    /// # Errors
    /// [`FarmError::Folder`] if nothing was planned here; [`FarmError`] if it cannot be read.
    pub fn job(&self) -> Result<FarmJob, FarmError> {
        self.planned_job()?.ok_or_else(|| FarmError::Folder {
            path: self.0.clone(),
            what: "no farm was planned in this folder; `noisefloor farm plan DIR -- SCENE` does".into(),
        })
    }

    /// Writes what is rendered.
    ///
    /// # Errors
    /// [`FarmError::Write`].
    pub fn write_job(&self, job: &FarmJob) -> Result<(), FarmError> {
        write_json(&self.0.join("farm.json"), job)
    }

    /// The round under way, or the last one; none before the first.
    ///
    /// # Errors
    /// [`FarmError`] if it cannot be read.
    pub fn round(&self) -> Result<Option<Round>, FarmError> {
        read_json(&self.0.join("round.json"))
    }

    /// Writes the round.
    ///
    /// # Errors
    /// [`FarmError::Write`].
    pub fn write_round(&self, round: &Round) -> Result<(), FarmError> {
        write_json(&self.0.join("round.json"), round)
    }

    /// The folder of a frame.
    pub fn frame(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// What a frame is; none before it is planned.
    ///
    /// # Errors
    /// [`FarmError`] if it cannot be read.
    pub fn frame_job(&self, name: &str) -> Result<Option<FrameJob>, FarmError> {
        read_json(&self.frame(name).join("frame.json"))
    }

    /// Writes what a frame is, and makes its folders.
    ///
    /// # Errors
    /// [`FarmError`] if they cannot be made or written.
    pub fn write_frame_job(&self, name: &str, job: &FrameJob) -> Result<(), FarmError> {
        let shards = self.frame(name).join("shards");
        fs::create_dir_all(&shards).map_err(|source| FarmError::Read { path: shards, source })?;
        write_json(&self.frame(name).join("frame.json"), job)
    }

    /// How far a frame is: nowhere, if what is kept of it is of another job than the one planned.
    ///
    /// # Errors
    /// [`FarmError`] if it cannot be read.
    pub fn state(&self, name: &str) -> Result<FrameState, FarmError> {
        let kept: Option<KeptState> = read_json(&self.frame(name).join("state.json"))?;
        let job = self.job_of(name)?;
        Ok(kept.filter(|kept| kept.of == job).map(|kept| kept.state).unwrap_or_default())
    }

    /// Writes how far a frame is.
    ///
    /// # Errors
    /// [`FarmError`] if it cannot be written, or the frame's job cannot be read.
    pub fn write_state(&self, name: &str, state: &FrameState) -> Result<(), FarmError> {
        let kept = KeptState { of: self.job_of(name)?, state: state.clone() };
        write_json(&self.frame(name).join("state.json"), &kept)
    }

    /// The digest of a frame's job; empty before it is planned.
    fn job_of(&self, name: &str) -> Result<String, FarmError> {
        Ok(self.frame_job(name)?.map_or_else(String::new, |job| job.shards.digest()))
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
    ///
    /// # Errors
    /// [`FarmError::Read`].
    pub fn shards(&self, name: &str) -> Result<Vec<PathBuf>, FarmError> {
        let folder = self.frame(name).join("shards");
        let failed = |source| FarmError::Read { path: folder.clone(), source };
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
    ///
    /// # Errors
    /// [`FarmError::Read`].
    pub fn retire(&self, name: &str, shard: &ShardFile, keep: bool) -> Result<(), FarmError> {
        let failed = |source| FarmError::Read { path: shard.path().to_owned(), source };
        if !keep {
            return fs::remove_file(shard.path()).map_err(failed);
        }
        let folder = self.frame(name).join("merged");
        fs::create_dir_all(&folder).map_err(failed)?;
        fs::rename(shard.path(), folder.join(shard.path().file_name().unwrap_or_default())).map_err(failed)
    }

    /// Puts a shard that cannot be used aside, under the name it returns.
    ///
    /// # Errors
    /// [`FarmError::Read`].
    pub fn set_aside(&self, shard: &Path) -> Result<PathBuf, FarmError> {
        let aside = shard.with_extension("nfs.bad");
        let failed = |source| FarmError::Read { path: shard.to_owned(), source };
        fs::rename(shard, &aside).map_err(failed)?;
        Ok(aside)
    }
}

/// Opens a file for reading, unless it is a pipe or a device: these might block, or never end.
pub(crate) fn open_regular(path: &Path) -> io::Result<File> {
    if !fs::metadata(path)?.is_file() {
        let what = "it is a folder, a pipe or a device, and not a file";
        return Err(io::Error::new(io::ErrorKind::InvalidInput, what));
    }
    File::open(path)
}

fn read_json<T: DeserializeOwned>(path: &Path) -> Result<Option<T>, FarmError> {
    let failed = |source| FarmError::Read { path: path.to_owned(), source };
    let file = match open_regular(path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(error) => return Err(failed(error)),
    };
    let mut text = Vec::new();
    file.take(MAX_JSON).read_to_end(&mut text).map_err(failed)?;
    let content = serde_json::from_slice(&text);
    content.map(Some).map_err(|source| FarmError::Json { path: path.to_owned(), source })
}

fn write_json<T: Serialize>(path: &Path, content: &T) -> Result<(), FarmError> {
    Ok(write_atomic(path, |to| {
        let mut to = UpTo { to, left: MAX_JSON };
        serde_json::to_writer(&mut to, content).map_err(io::Error::from).and_then(|()| to.write_all(b"\n"))
    })?)
}

/// Writes no more than can be read back.
struct UpTo<W> {
    to: W,
    left: u64,
}

impl<W: Write> Write for UpTo<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let Some(left) = self.left.checked_sub(bytes.len() as u64) else {
            let what = "it would be too long to be read back: render fewer frames in one farm";
            return Err(io::Error::new(io::ErrorKind::FileTooLarge, what));
        };
        let written = self.to.write(bytes)?;
        self.left = left + (bytes.len() - written) as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}

#[cfg(test)]
mod tests;
