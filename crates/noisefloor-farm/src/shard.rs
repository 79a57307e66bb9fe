//! Files of samples.
//!
//! Layout: the container of models and checkpoints (magic, version, length and BLAKE3 of the header), whose
//! payload is a header of JSON; then for each batch of the header, in its order, three f32 per pixel,
//! row-major over its tile. Numbers are little-endian. The header has the BLAKE3 of each batch, so that a
//! merge reads only the batch it needs.

use crate::batch::PlannedBatch;
use crate::error::{MAX_HEADER, ShardError, VERSION};
use crate::file::open_regular;
use noisefloor::{
    ProgressiveSource, Rgb, Session, SourceError, StoppingCriterion, Tile, TileGrid, internal::Format,
    source::SourceIdentity,
};
use noisefloor_image::{WriteError, write_atomic};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::Value;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

const FORMAT: Format = Format { magic: *b"NFSHARD\0", version: VERSION };
/// Bytes per pixel: three f32.
const PIXEL: usize = 12;

/// What the samples of a shard are of. Shards of different jobs are never merged.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ShardJob {
    /// What the samples depend on: scene, seed, options of the renderer.
    pub source: SourceIdentity,
    /// Width of the picture in pixels.
    pub width: usize,
    /// Height of the picture in pixels.
    pub height: usize,
    /// Edge of the tiles in pixels.
    pub tile: usize,
    pub criterion: String,
    /// Parameters of the session, as files keep them.
    pub params: Value,
}

impl ShardJob {
    /// The job of a source and a session that has its size.
    pub fn new<C: StoppingCriterion>(
        source: &impl ProgressiveSource,
        session: &Session<C>,
    ) -> Result<Self, SourceError> {
        Ok(Self::of(source.identity()?, session))
    }

    /// The job of a session whose samples depend on `source`.
    pub fn of<C: StoppingCriterion>(source: SourceIdentity, session: &Session<C>) -> Self {
        let (grid, params) = (session.film().grid(), session.params());
        Self {
            source,
            width: grid.width(),
            height: grid.height(),
            tile: params.tile,
            criterion: session.criterion().fingerprint(),
            // None of them fails to be written
            params: serde_json::to_value(params).unwrap_or_default(),
        }
    }

    pub fn grid(&self) -> Result<TileGrid, ShardError> {
        Ok(TileGrid::new(self.width, self.height, self.tile)?)
    }

    /// A digest of all of it, for files that must not be taken for those of another job.
    pub fn digest(&self) -> String {
        digest(&serde_json::to_vec(self).unwrap_or_default())
    }

    /// Checks that `kept` is the same job as this one.
    pub fn check(&self, kept: &Self) -> Result<(), ShardError> {
        self.source.change_since(&kept.source).map_or(Ok(()), Err)?;
        let size = |job: &Self| format!("{}×{} in tiles of {}", job.width, job.height, job.tile);
        for (what, kept, now) in [
            ("picture", size(kept), size(self)),
            ("criterion", kept.criterion.clone(), self.criterion.clone()),
        ] {
            if kept != now {
                return Err(ShardError::Other { what: what.to_owned(), kept, now });
            }
        }
        if kept.params == self.params {
            return Ok(());
        }
        let names = || self.params.as_object().into_iter().flat_map(|params| params.keys());
        let differing = names().find(|name| self.params.get(name) != kept.params.get(name));
        let differing_value =
            |params: &Value| differing.and_then(|name| params.get(name)).unwrap_or(params).to_string();
        let what = differing.map_or("set of parameters", String::as_str).to_owned();
        Err(ShardError::Other {
            what,
            kept: differing_value(&kept.params),
            now: differing_value(&self.params),
        })
    }
}

#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct BatchEntry {
    pub tile: usize,
    /// Index of its first sample.
    pub first: u64,
    /// Samples per pixel asked for.
    pub asked: u64,
    /// Samples per pixel that the source gave; 0 if it has no more.
    pub spp: u64,
    /// BLAKE3 of its pixels.
    digest: String,
}

impl BatchEntry {
    /// Whether it can be a batch of these tiles.
    fn is_possible(&self, grid: &TileGrid) -> bool {
        let &Self { tile, first, asked, spp, .. } = self;
        tile < grid.len() && [first, asked, spp].into_iter().all(|n| n < 1 << 34)
    }
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Header {
    job: ShardJob,
    /// The render that the samples are of, as whoever made the shard keeps it.
    #[serde(default, skip_serializing_if = "Value::is_null")]
    render: Value,
    /// Names of scene and source, for people and for the picture's file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    names: Option<(String, String)>,
    seconds: f64,
    batches: Vec<BatchEntry>,
}

/// Samples in memory, on their way to a file.
#[derive(Clone, Debug)]
pub struct Shard {
    header: Header,
    pixels: Vec<Vec<Rgb>>,
}

impl Shard {
    pub fn new(job: ShardJob) -> Self {
        Self {
            header: Header { job, render: Value::Null, names: None, seconds: 0.0, batches: vec![] },
            pixels: vec![],
        }
    }

    /// Adds the render that the samples are of, so that the file alone is enough to merge it. What cannot be
    /// written is left out.
    #[must_use]
    pub fn with_render(mut self, render: &impl Serialize) -> Self {
        self.header.render = serde_json::to_value(render).unwrap_or_default();
        self
    }

    /// Adds the names of scene and source.
    #[must_use]
    pub fn with_names(mut self, scene: String, source: String) -> Self {
        self.header.names = Some((scene, source));
        self
    }

    /// Adds seconds that the source took.
    pub fn add_seconds(&mut self, seconds: f64) {
        self.header.seconds += seconds;
    }

    /// Adds what came of `batch`: `spp` samples per pixel, as many as asked for or fewer, and none at the
    /// source's end; `mean` is row-major over the tile.
    pub fn add(&mut self, batch: PlannedBatch, spp: u64, mean: Vec<Rgb>) {
        let PlannedBatch { tile, first, spp: asked, .. } = batch;
        let digest = digest(&bytes(&mean));
        self.header.batches.push(BatchEntry { tile, first, asked, spp, digest });
        self.pixels.push(mean);
    }

    pub fn len(&self) -> usize {
        self.header.batches.len()
    }

    pub fn is_empty(&self) -> bool {
        self.header.batches.is_empty()
    }

    /// Writes the file, which appears complete or not at all.
    pub fn write(&self, path: impl AsRef<Path>) -> Result<(), WriteError> {
        write_atomic(path, |to| -> io::Result<()> {
            FORMAT.write_bytes(&serde_json::to_vec(&self.header)?, &mut *to)?;
            self.pixels.iter().try_for_each(|mean| to.write_all(&bytes(mean)))
        })
    }
}

fn bytes(pixels: &[Rgb]) -> Vec<u8> {
    pixels.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn digest(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// A shard on disk, of which the header has been read and checked.
#[derive(Clone, Debug)]
pub struct ShardFile {
    path: PathBuf,
    header: Header,
    grid: TileGrid,
    /// Where each batch begins.
    offsets: Vec<u64>,
}

impl ShardFile {
    /// Reads the header, and checks that the file is as long as it says. Memory grows with the header that
    /// arrives, not with what the file claims to hold.
    pub fn open(path: impl Into<PathBuf>) -> Result<Self, ShardError> {
        let path = path.into();
        let file = open_regular(&path)?;
        let there = file.metadata()?.len();
        let mut from = BufReader::new(file);
        let header = FORMAT.read_bytes(&mut from, MAX_HEADER)?;
        let begin = from.stream_position()?;
        let header = serde_json::from_slice(&header).map_err(|e| ShardError::Damaged(e.to_string()))?;
        Self::check(path, header, begin, there)
    }

    /// Checks that the header holds together, and that the file has `there` bytes as it says.
    fn check(path: PathBuf, header: Header, begin: u64, there: u64) -> Result<Self, ShardError> {
        let grid = header.job.grid()?;
        let (mut offsets, mut end) = (Vec::new(), begin);
        for entry in &header.batches {
            if !entry.is_possible(&grid) {
                return Err(ShardError::Damaged(format!(
                    "it has an impossible batch of tile {}",
                    entry.tile
                )));
            }
            offsets.push(end);
            end += length(grid.tile(entry.tile), entry.spp) as u64;
        }
        if there != end {
            let relation = if there < end { "is cut short" } else { "is too long" };
            return Err(ShardError::Damaged(format!("it {relation}: it has {there} bytes of {end}")));
        }
        if !(header.seconds.is_finite() && header.seconds >= 0.0) {
            return Err(ShardError::Damaged("its seconds are no time".into()));
        }
        Ok(Self { path, header, grid, offsets })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// What its samples are of.
    pub fn job(&self) -> &ShardJob {
        &self.header.job
    }

    /// The render that its samples are of, as its maker keeps it.
    pub fn render<J: DeserializeOwned>(&self) -> Result<J, serde_json::Error> {
        J::deserialize(&self.header.render)
    }

    /// Names of scene and source; none if whoever made the shard did not say.
    pub fn names(&self) -> Option<(&str, &str)> {
        self.header.names.as_ref().map(|(scene, source)| (scene.as_str(), source.as_str()))
    }

    pub fn seconds(&self) -> f64 {
        self.header.seconds
    }

    /// Its samples, over all pixels.
    pub fn samples(&self) -> u64 {
        let samples = |entry: &BatchEntry| entry.spp * self.grid.tile(entry.tile).pixels() as u64;
        self.header.batches.iter().map(samples).sum()
    }

    pub fn batches(&self) -> &[BatchEntry] {
        &self.header.batches
    }

    /// The mean of the samples of a batch, row-major over its tile.
    ///
    /// # Panics
    /// If there is no such batch.
    pub fn read(&self, batch: usize) -> Result<Vec<Rgb>, ShardError> {
        let entry = &self.header.batches[batch];
        let mut file = File::open(&self.path)?;
        file.seek(SeekFrom::Start(self.offsets[batch]))?;
        let mut bytes = vec![0; length(self.grid.tile(entry.tile), entry.spp)];
        file.read_exact(&mut bytes)?;
        if digest(&bytes) != entry.digest {
            let BatchEntry { tile, first, .. } = entry;
            let what = format!("the checksum of tile {tile} from sample {first} on differs");
            return Err(ShardError::Damaged(what));
        }
        let value = |at: &[u8]| f32::from_le_bytes(at.try_into().unwrap_or_default());
        let pixel = |at: &[u8]| std::array::from_fn(|c| value(&at[4 * c..4 * c + 4]));
        Ok(bytes.chunks_exact(PIXEL).map(pixel).collect())
    }
}

/// Bytes of a batch.
fn length(tile: Tile, spp: u64) -> usize {
    if spp == 0 { 0 } else { tile.pixels() * PIXEL }
}

#[cfg(test)]
mod tests;
