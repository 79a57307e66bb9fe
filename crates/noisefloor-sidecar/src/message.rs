//! The headers of requests and replies.

use noisefloor::{Repeats, Unit};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

pub(crate) const PROTOCOL: u32 = 1;

#[derive(Serialize)]
pub(crate) struct Init<'a> {
    pub(crate) op: &'static str,
    pub(crate) protocol: u32,
    pub(crate) scene: &'a str,
    pub(crate) seed: u64,
    pub(crate) width: Option<usize>,
    pub(crate) height: Option<usize>,
    pub(crate) max_depth: Option<u32>,
    pub(crate) frame: Option<i32>,
    pub(crate) threads: Option<usize>,
    pub(crate) device: Option<&'a str>,
    pub(crate) options: &'a BTreeMap<String, String>,
}

#[derive(Serialize)]
pub(crate) struct Sample {
    pub(crate) op: &'static str,
    pub(crate) tiles: Vec<TileRequest>,
}

#[derive(Serialize)]
pub(crate) struct TileRequest {
    pub(crate) index: usize,
    pub(crate) x: usize,
    pub(crate) y: usize,
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) first: u64,
    pub(crate) samples: u64,
    /// Number of the sequence that they belong to, and index of the first of them in it.
    pub(crate) sequence: u32,
    pub(crate) point: u64,
}

/// In every reply.
#[derive(Deserialize)]
pub(crate) struct Status {
    pub(crate) ok: bool,
    pub(crate) error: Option<String>,
    pub(crate) tile: Option<usize>,
}

#[derive(Deserialize)]
pub(crate) struct Hello {
    pub(crate) name: String,
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) unit: Unit,
    pub(crate) repeats: Repeats,
    /// Samples that it may give beyond those requested, over all pixels of a tile, because it cannot stop in
    /// time.
    #[serde(default)]
    pub(crate) late: u64,
    /// [`noisefloor::SourceInfo::stratified`].
    #[serde(default)]
    pub(crate) stratified: bool,
    #[serde(default)]
    pub(crate) warnings: Vec<String>,
}

#[derive(Deserialize)]
pub(crate) struct Sampled {
    pub(crate) samples: Vec<u64>,
}

/// To a filter, in place of [`Init`].
#[derive(Serialize)]
pub(crate) struct InitFilter<'a> {
    pub(crate) op: &'static str,
    pub(crate) protocol: u32,
    pub(crate) threads: Option<usize>,
    pub(crate) device: Option<&'a str>,
}

/// What a filter says of itself.
#[derive(Deserialize)]
pub(crate) struct FilterHello {
    pub(crate) name: String,
    #[serde(default)]
    pub(crate) warnings: Vec<String>,
}

/// The pictures of each frame follow as payload, in this order.
#[derive(Serialize)]
pub(crate) struct Filtering<'a> {
    pub(crate) op: &'static str,
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) frames: usize,
    pub(crate) pictures: &'a [&'a str],
}

/// A picture for each frame is its payload.
#[derive(Deserialize)]
pub(crate) struct Filtered {}

#[derive(Serialize)]
pub(crate) struct HitFirst {
    pub(crate) op: &'static str,
    pub(crate) index: u64,
    pub(crate) samples: u64,
}

/// Albedo and normals are its payload, if there are any.
#[derive(Deserialize)]
pub(crate) struct FirstHitsMade {
    pub(crate) first_hits: bool,
}

/// A whole picture, or a part of it (x, y, width, height), sampled by the renderer's own adaptive sampling.
#[derive(Serialize)]
pub(crate) struct Adaptive {
    pub(crate) op: &'static str,
    pub(crate) threshold: f64,
    pub(crate) samples: Option<u64>,
    pub(crate) seed: u32,
    pub(crate) part: Option<[usize; 4]>,
}

/// The picture is its payload, if the renderer has such a threshold, and the samples of pixels if it tells them: the fewest, those
/// with a threshold finer by √2, and the most.
#[derive(Deserialize)]
pub(crate) struct Adapted {
    pub(crate) adaptive: bool,
    #[serde(default)]
    pub(crate) counts: Option<[f32; 3]>,
}
