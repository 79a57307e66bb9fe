//! A batch as plans and shards describe it.

use noisefloor::{
    Request, Session, StoppingCriterion, Tile,
    source::{BlockRequest, BlockSamples},
};
use serde::{Deserialize, Serialize, Serializer};

/// A batch that is asked for.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
pub struct PlannedBatch {
    /// The tile.
    pub tile: usize,
    /// Index of its first sample.
    pub first: u64,
    /// Samples per pixel asked for; with blocks, on average over the tile.
    pub spp: u64,
    /// First sample and number of samples of each block of the tile, row-major. Empty if all of the tile
    /// gets `spp` samples from `first` on.
    #[serde(default)]
    pub blocks: Vec<(u64, u64)>,
}

impl PlannedBatch {
    /// A batch with the same samples for all of the tile.
    pub fn even(tile: usize, first: u64, spp: u64) -> Self {
        Self { tile, first, spp, blocks: Vec::new() }
    }

    /// What all open tiles of a session are going to need; see [`Session::batches_ahead`].
    pub fn ahead<C: StoppingCriterion>(session: &Session<C>) -> Vec<Self> {
        let mut planned = Vec::new();
        for tile in 0..session.film().grid().len() {
            let mut spread = session.block_requests_ahead(tile).into_iter().flatten();
            for Request { first, spp, .. } in session.batches_ahead(tile) {
                let blocks = spread.next().map_or_else(Vec::new, |request| differing(first, &request));
                planned.push(Self { tile, first, spp, blocks });
            }
        }
        planned
    }
}

/// As a short list of numbers: a round can have millions of batches.
impl Serialize for PlannedBatch {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        let Self { tile, first, spp, blocks } = self;
        if blocks.is_empty() {
            (tile, first, spp).serialize(to)
        } else {
            (tile, first, spp, blocks).serialize(to)
        }
    }
}

/// First sample and number of samples of each block; empty if they are those of the tile.
fn differing(first: u64, request: &BlockRequest) -> Vec<(u64, u64)> {
    let even = BlockSamples { first, spp: request.spp };
    if request.blocks.iter().all(|block| *block == even) {
        return Vec::new();
    }
    request.blocks.iter().map(|block| (block.first, block.spp)).collect()
}

/// Whether this can be said of the blocks of a tile. `edge` is that of the blocks in pixels, 0 without any.
pub(crate) fn fit(tile: Tile, edge: usize, blocks: &[(u64, u64)]) -> bool {
    let count = if edge == 0 { 0 } else { tile.width.div_ceil(edge) * tile.height.div_ceil(edge) };
    blocks.is_empty() || blocks.len() == count && blocks.iter().all(|(_, spp)| *spp > 0)
}

/// The request with its blocks, which have to [`fit`]; none without blocks.
pub(crate) fn by_blocks(request: &Request, edge: usize, blocks: &[(u64, u64)]) -> Option<BlockRequest> {
    let &Request { tile, first, spp } = request;
    let blocks = match blocks {
        _ if edge == 0 => return None,
        [] => vec![BlockSamples { first, spp }; tile.width.div_ceil(edge) * tile.height.div_ceil(edge)],
        blocks => blocks.iter().map(|&(first, spp)| BlockSamples { first, spp }).collect(),
    };
    Some(BlockRequest { tile, spp, edge, blocks })
}
