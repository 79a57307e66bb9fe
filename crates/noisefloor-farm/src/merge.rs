//! Shards back into one film, as one machine would have filled it.

use crate::batch::PlannedBatch;
use crate::error::FarmError;
use crate::shard::{BatchEntry, ShardFile, ShardJob};
use noisefloor::{Request, Rgb, Session, StoppingCriterion, session::Interruption};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Path, PathBuf};

/// Something that is wrong with a shard. What is wrong was not merged.
#[derive(Debug)]
pub struct Problem {
    pub path: PathBuf,
    pub what: String,
    /// Whether nothing in it can be used.
    pub useless: bool,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.path.display(), self.what)
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Merged {
    /// Batches added to the film.
    pub batches: usize,
    /// Samples added, over all pixels.
    pub samples: u64,
    pub rounds: usize,
}

/// Tile, first sample, samples asked for.
type Key = (usize, u64, u64);

/// Shards of one job, found by what they hold. Keeps their headers in memory, and reads one batch at a time.
#[derive(Debug, Default)]
pub struct ShardSet {
    files: Vec<ShardFile>,
    /// Files and batches that hold the same samples.
    index: BTreeMap<Key, Vec<(usize, usize)>>,
    merged: BTreeSet<Key>,
    problems: Vec<Problem>,
}

impl ShardSet {
    /// Reads the headers of these files. Those that are damaged, or of another job, become
    /// [problems](Self::problems). So do two that have different samples for one batch: nobody can tell
    /// which is right, and neither is used.
    pub fn gather(job: &ShardJob, paths: &[PathBuf]) -> Self {
        let mut set = Self::default();
        for path in paths {
            match ShardFile::open(path).and_then(|file| job.check(file.job()).map(|()| file)) {
                Ok(file) => set.add(file),
                Err(error) => set.refuse(path.clone(), error.to_string(), true),
            }
        }
        set
    }

    fn refuse(&mut self, path: PathBuf, what: String, useless: bool) {
        self.problems.push(Problem { path, what, useless });
    }

    /// Files a shard, unless it contradicts another one.
    fn add(&mut self, file: ShardFile) {
        let mut twin = None;
        for entry in file.batches() {
            let Some(&(other, batch)) = self.index.get(&key(entry)).and_then(|places| places.first()) else {
                continue;
            };
            if self.files[other].batches()[batch] != *entry {
                let (path, at) = (self.files[other].path().to_owned(), name(&key(entry)));
                let contradicts =
                    |path: &Path| format!("contradicts {} in {at}: neither is used", path.display());
                self.discard(other, contradicts(file.path()));
                return self.refuse(file.path().to_owned(), contradicts(&path), true);
            }
            twin = Some((other, name(&key(entry))));
        }
        if let Some((other, at)) = twin {
            let what = format!(
                "has samples that {} has, too ({at}): taken once",
                self.files[other].path().display()
            );
            self.refuse(file.path().to_owned(), what, false);
        }
        let place = self.files.len();
        for (batch, entry) in file.batches().iter().enumerate() {
            self.index.entry(key(entry)).or_default().push((place, batch));
        }
        self.files.push(file);
    }

    /// Forgets what a file holds.
    fn discard(&mut self, file: usize, what: String) {
        self.index.values_mut().for_each(|places| places.retain(|(place, _)| *place != file));
        self.index.retain(|_, places| !places.is_empty());
        self.refuse(self.files[file].path().to_owned(), what, true);
    }

    /// What is wrong with the shards, as far as it is known.
    pub fn problems(&self) -> &[Problem] {
        &self.problems
    }

    /// The shards that can be used.
    pub fn files(&self) -> &[ShardFile] {
        &self.files
    }

    pub fn has(&self, batch: &PlannedBatch) -> bool {
        self.index.contains_key(&(batch.tile, batch.first, batch.spp))
    }

    /// Adds the batches that the session asks for, as far as they are there, and judges each round that is
    /// complete: the steps of a [`Driver`](noisefloor::Driver). Repeated, it adds nothing.
    pub fn merge_into<C: StoppingCriterion>(
        &mut self,
        session: &mut Session<C>,
    ) -> Result<Merged, FarmError> {
        let (mut merged, before) = (Merged::default(), session.film().total_samples());
        while !session.is_done() {
            let before = merged.batches;
            for request in session.next_batches() {
                let Some((spp, mean)) = self.take(&request) else { continue };
                let tile = request.tile.index;
                merged.batches += 1;
                if spp == 0 {
                    session.close(tile, Interruption::SourceExhausted);
                } else {
                    session.push(tile, spp, &mean)?;
                }
            }
            if session.is_round_complete() {
                session.judge()?;
                merged.rounds += 1;
            } else if merged.batches == before {
                break;
            }
        }
        merged.samples = session.film().total_samples() - before;
        Ok(merged)
    }

    /// The samples of a batch; none if it is not there, or damaged in every file that has it.
    fn take(&mut self, request: &Request) -> Option<(u64, Vec<Rgb>)> {
        let key = (request.tile.index, request.first, request.spp);
        while let Some(&(file, batch)) = self.index.get(&key).and_then(|places| places.first()) {
            let shard = &self.files[file];
            match shard.read(batch) {
                Ok(mean) => {
                    self.merged.insert(key);
                    return Some((self.files[file].batches()[batch].spp, mean));
                }
                Err(error) => self.discard(file, error.to_string()),
            }
        }
        None
    }

    /// The shards of which a session needs nothing any more: its tiles are done, or have these samples.
    pub fn used_up<C: StoppingCriterion>(&self, session: &Session<C>) -> Vec<&ShardFile> {
        let needed =
            |entry: &BatchEntry| session.is_open(entry.tile) && entry.first >= session.film().spp(entry.tile);
        self.files.iter().filter(|file| !file.batches().iter().any(needed)).collect()
    }

    /// Finds what was not merged although the session has samples of that range: batches that overlap those
    /// of other shards. Call it after a merge into a session that began without samples.
    pub fn find_overlaps<C: StoppingCriterion>(&mut self, session: &Session<C>) {
        let overlaps: Vec<(usize, Key)> = (self.index.iter())
            .filter(|(key, _)| !self.merged.contains(*key) && key.1 < session.film().spp(key.0))
            .flat_map(|(key, places)| places.iter().map(|(file, _)| (*file, *key)))
            .collect();
        for (file, key) in overlaps {
            let what = format!("overlaps samples of other shards in {}: not taken", name(&key));
            self.refuse(self.files[file].path().to_owned(), what, false);
        }
    }
}

fn name((tile, first, spp): &Key) -> String {
    format!("tile {tile}, samples {first} to {}", first + spp)
}

fn key(entry: &BatchEntry) -> Key {
    (entry.tile, entry.first, entry.asked)
}

#[cfg(test)]
mod tests;
