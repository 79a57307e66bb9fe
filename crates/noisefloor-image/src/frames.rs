//! Which samples are in which file, by file names.

use crate::error::{StackError, StackFault};
use std::path::{Path, PathBuf};

/// What the images of a stack hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Layout {
    /// `00100.png`: the mean of all samples so far.
    RunningMeans,
    /// `batch_00060_00100.exr`: the mean of samples 61…100 only.
    Batches,
}

/// One image of a stack: it adds samples `first`+1…`last`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Frame {
    /// Samples per pixel before it.
    pub first: u64,
    /// Samples per pixel with it, above `first`.
    pub last: u64,
    /// The file.
    pub path: PathBuf,
}

/// The running means of a folder, by ascending samples; each frame starts where the previous one ends. Other
/// files are ignored.
///
/// # Errors
/// [`StackError`] if the folder cannot be listed, has no running mean, or has two of the same sample count.
pub fn running_means(dir: &Path) -> Result<Vec<Frame>, StackError> {
    let mut frames = Vec::new();
    for path in files(dir)? {
        let Some(digits) = running_mean_name(&path) else { continue };
        let last = match digits.parse::<u32>() {
            Ok(0) => return Err(StackFault::Name("an image of no samples").of(&path)),
            Ok(last) => u64::from(last),
            Err(_) => return Err(StackFault::Name("the number of samples is too large").of(&path)),
        };
        frames.push(Frame { first: 0, last, path });
    }
    frames.sort_by_key(|frame| frame.last);
    for i in 1..frames.len() {
        if frames[i].last == frames[i - 1].last {
            return Err(StackFault::Overlap(frames[i].path.clone()).of(&frames[i - 1].path));
        }
        frames[i].first = frames[i - 1].last;
    }
    if frames.is_empty() { Err(StackFault::Nothing.of(dir)) } else { Ok(frames) }
}

/// The batches of a folder, by ascending samples: from 0, without gaps or overlaps. Other files are ignored.
///
/// # Errors
/// [`StackError`] if the folder cannot be listed, a name does not say which samples are in the image, or
/// samples are missing or overlap.
pub fn batches(dir: &Path) -> Result<Vec<Frame>, StackError> {
    let mut frames = Vec::new();
    for path in files(dir)? {
        let Some(range) = batch_name(&path) else { continue };
        let ends = range.split_once('_').and_then(|(a, b)| Some((count(a)?, count(b)?)));
        let Some((first, last)) = ends else {
            return Err(StackFault::Name("it does not say which samples the batch holds").of(&path));
        };
        if first >= last {
            return Err(StackFault::Name("a batch of no samples").of(&path));
        }
        frames.push(Frame { first, last, path });
    }
    frames.sort_by_key(|frame| (frame.first, frame.last));

    let Some(start) = frames.first() else { return Err(StackFault::Nothing.of(dir)) };
    if start.first != 0 {
        return Err(StackFault::Start(start.first).of(&start.path));
    }
    for pair in frames.windows(2) {
        let (one, other) = (&pair[0], &pair[1]);
        if other.first > one.last {
            let next = other.path.clone();
            return Err(StackFault::Gap { next, from: one.last, to: other.first }.of(&one.path));
        }
        if other.first < one.last {
            return Err(StackFault::Overlap(other.path.clone()).of(&one.path));
        }
    }
    Ok(frames)
}

/// Which layout the file names in a folder follow.
pub(crate) fn detect(dir: &Path) -> Result<Layout, StackError> {
    let files = files(dir)?;
    let running = files.iter().any(|path| running_mean_name(path).is_some());
    let batches = files.iter().any(|path| batch_name(path).is_some());
    match (running, batches) {
        (true, false) => Ok(Layout::RunningMeans),
        (false, true) => Ok(Layout::Batches),
        (true, true) => Err(StackFault::Ambiguous.of(dir)),
        (false, false) => Err(StackFault::Nothing.of(dir)),
    }
}

fn files(dir: &Path) -> Result<Vec<PathBuf>, StackError> {
    let failed = |source| StackFault::Folder(source).of(dir);
    std::fs::read_dir(dir).map_err(failed)?.map(|entry| Ok(entry.map_err(failed)?.path())).collect()
}

/// `00100` of `00100.png` or `00100.exr`.
fn running_mean_name(path: &Path) -> Option<&str> {
    let (stem, extension) = path.file_name()?.to_str()?.rsplit_once('.')?;
    let known = ["png", "exr"].iter().any(|known| extension.eq_ignore_ascii_case(known));
    (known && !stem.is_empty() && stem.bytes().all(|b| b.is_ascii_digit())).then_some(stem)
}

/// `00060_00100` of `batch_00060_00100.exr`.
fn batch_name(path: &Path) -> Option<&str> {
    path.file_name()?.to_str()?.strip_prefix("batch_")?.strip_suffix(".exr")
}

/// A number of samples: only digits, so that every difference fits [`noisefloor::Batch::samples`].
fn count(digits: &str) -> Option<u64> {
    digits.bytes().all(|b| b.is_ascii_digit()).then(|| digits.parse::<u32>().ok().map(u64::from)).flatten()
}
