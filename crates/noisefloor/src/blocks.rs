//! Blocks of a tile, each sampled by its need.
//!
//! Where nobody looks for noise, fewer samples do. The shares of the blocks decide how a batch is spread over
//! its tile, and nothing else: in every block the batch counts as what the tile got on average
//! ([`BlockRequest::spp`]), however many samples the block had. So the weight of a batch in the mean does not
//! depend on its own samples or on those before, each batch is right on average, and so is their mean: blocks
//! that look quiet by luck get fewer samples and stay unbiased. Were batches weighted by their counts, a
//! block that had found a rare light would get more samples, and dilute what it had found.

use crate::tile::{Tile, TileGrid};
use serde::{Deserialize, Serialize};

/// Samples per pixel after which blocks get their first shares, unless the first verdict comes earlier.
pub(crate) const PILOT: u64 = 32;

/// No block gets less than this share of the samples of the block with most.
const FLOOR: f64 = 0.25;

/// A request for samples of one tile, block by block.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BlockRequest {
    /// The tile to sample.
    pub tile: Tile,
    /// New samples per pixel, on average over the tile, to within half a sample of each pixel of one block.
    /// The batch has this as its number of samples.
    pub spp: u64,
    /// Edge of the blocks in pixels. They are counted row by row from the top left of the tile; those of the
    /// last column and row may be narrower.
    pub edge: usize,
    /// What each block is to get.
    pub blocks: Vec<BlockSamples>,
}

/// New samples of one block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockSamples {
    /// Samples per pixel that the block already has: the index of the first new one.
    pub first: u64,
    /// New samples per pixel wanted, at least 1.
    pub spp: u64,
}

impl BlockRequest {
    /// What a pixel of the tile is to get; `column` and `row` count from the top left of the tile.
    ///
    /// # Panics
    /// If the pixel is not in the tile.
    pub fn at(&self, column: usize, row: usize) -> BlockSamples {
        assert!(
            column < self.tile.width && row < self.tile.height,
            "pixel ({column}, {row}) of {:?}",
            self.tile
        );
        self.blocks[row / self.edge * self.tile.width.div_ceil(self.edge) + column / self.edge]
    }

    /// All samples asked for, over all pixels.
    pub fn samples(&self) -> u64 {
        let areas = blocks_of(self.tile, self.edge).map(|block| block.pixels() as u64);
        areas.zip(&self.blocks).map(|(pixels, block)| pixels * block.spp).sum()
    }
}

/// The blocks of a tile, row-major, as parts of the image.
pub(crate) fn blocks_of(tile: Tile, edge: usize) -> impl Iterator<Item = Tile> {
    let columns = tile.width.div_ceil(edge);
    (0..columns * tile.height.div_ceil(edge)).map(move |index| {
        let (x, y) = (index % columns * edge, index / columns * edge);
        let (width, height) = (edge.min(tile.width - x), edge.min(tile.height - y));
        Tile { index, x: tile.x + x, y: tile.y + y, width, height }
    })
}

/// The share that each block gets of the samples of its tile: 1 on average over the pixels. From what it
/// needs, in any unit, such as the square of its visible noise. Even where the needs say nothing.
///
/// Needs are estimates. A block is taken to need what it and its neighbours need on average, so that a single
/// quiet block among noisy ones is not believed and shares change gradually, and none gets less than
/// [`FLOOR`] of the largest share.
pub(crate) fn shares(needs: &[f64], tile: Tile, edge: usize) -> Vec<f32> {
    let smooth = smooth(needs, tile.width.div_ceil(edge));
    let most = smooth.iter().copied().fold(0.0, f64::max);
    if !(most > 0.0 && most.is_finite()) {
        return vec![1.0; needs.len()];
    }
    let floored: Vec<f64> = smooth.iter().map(|need| need.max(FLOOR * most)).collect();
    let areas = blocks_of(tile, edge).map(|block| block.pixels() as f64);
    let sum: f64 = areas.zip(&floored).map(|(area, need)| area * need).sum();
    floored.iter().map(|need| (need * tile.pixels() as f64 / sum) as f32).collect()
}

/// Averages each block with its neighbours, by ¼ ½ ¼ along rows and columns; beyond the tile its edge
/// repeats.
fn smooth(needs: &[f64], columns: usize) -> Vec<f64> {
    let rows = needs.len() / columns;
    let blur = |values: &[f64], stride: usize, place: usize, count: usize, at: usize| {
        let before = if place > 0 { at - stride } else { at };
        let after = if place + 1 < count { at + stride } else { at };
        0.25 * values[before] + 0.5 * values[at] + 0.25 * values[after]
    };
    let across: Vec<f64> = (0..needs.len()).map(|at| blur(needs, 1, at % columns, columns, at)).collect();
    (0..needs.len()).map(|at| blur(&across, columns, at / columns, rows, at)).collect()
}

/// Spreads `spp` samples per pixel over blocks by their shares: at least one each, and as many in all as
/// `spp` of every pixel, to within half a sample of each pixel of one block.
pub(crate) fn spread(shares: &[f32], tile: Tile, edge: usize, spp: u64) -> Vec<u64> {
    let mut owed = 0.0; // samples over all pixels that blocks before had too few
    let pixels = blocks_of(tile, edge).map(|block| block.pixels() as f64);
    let counts = pixels.zip(shares).map(|(pixels, &share)| {
        let due = f64::from(share) * spp as f64 + owed / pixels;
        let count = due.round().max(1.0);
        owed = (due - count) * pixels;
        count as u64
    });
    counts.collect()
}

/// Samples that the blocks of a picture have in halves A and B.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct BlockCounts {
    /// The blocks. They divide the tiles evenly, but for those at the right and the bottom of the image.
    pub(crate) grid: TileGrid,
    pub(crate) counts: Vec<[u64; 2]>,
}

impl BlockCounts {
    pub(crate) fn new(grid: TileGrid) -> Self {
        Self { grid, counts: vec![[0; 2]; grid.len()] }
    }

    /// Places of the blocks of a tile, row-major.
    pub(crate) fn places(&self, tile: Tile) -> impl Iterator<Item = usize> {
        let grid = self.grid;
        blocks_of(tile, grid.edge()).map(move |block| grid.index_at(block.x, block.y))
    }

    /// Counts new samples of the blocks of a tile, row-major, in one half.
    pub(crate) fn count(&mut self, tile: Tile, half: usize, new: impl Iterator<Item = u64>) {
        let places: Vec<usize> = self.places(tile).collect();
        places.into_iter().zip(new).for_each(|(place, new)| self.counts[place][half] += new);
    }

    /// All samples, over all pixels.
    pub(crate) fn samples(&self) -> u64 {
        self.grid.tiles().zip(&self.counts).map(|(block, [a, b])| (a + b) * block.pixels() as u64).sum()
    }
}

#[cfg(test)]
mod tests;
