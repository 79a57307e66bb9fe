//! What the blocks of a film have.

use super::{Film, FilmError};
use crate::blocks::{BlockCounts, BlockRequest};
use crate::rgb::Rgb;
use crate::tile::{TileError, TileGrid};

impl Film {
    /// The film with its samples counted by blocks of this edge, too, which has to divide that of the tiles.
    pub(crate) fn by_blocks(self, edge: usize) -> Result<Self, TileError> {
        let blocks = TileGrid::new(self.grid.width(), self.grid.height(), edge)?;
        Ok(Self { blocks: Some(BlockCounts::new(blocks)), ..self })
    }

    /// Samples that one pixel of `tile` got, those that were rejected included: those of its block.
    ///
    /// # Panics
    /// If the tile does not exist.
    pub fn samples_at(&self, tile: usize, pixel: usize) -> u64 {
        let Some(blocks) = &self.blocks else { return self.spp(tile) };
        let width = self.grid.width();
        blocks.counts[blocks.grid.index_at(pixel % width, pixel / width)].iter().sum()
    }

    /// The fewest and the most samples per pixel that blocks of a tile have.
    ///
    /// # Panics
    /// If the tile does not exist.
    pub fn spp_range(&self, tile: usize) -> (u64, u64) {
        let Some(counts) = self.block_counts(tile) else { return (self.spp(tile), self.spp(tile)) };
        counts.map(|[a, b]| a + b).fold((u64::MAX, 0), |(least, most), n| (least.min(n), most.max(n)))
    }

    /// Samples per pixel that each block of a tile has in halves A and B, row-major; none if blocks are not
    /// counted.
    pub(crate) fn block_counts(&self, tile: usize) -> Option<impl Iterator<Item = [u64; 2]>> {
        let blocks = self.blocks.as_ref()?;
        Some(blocks.places(self.grid.tile(tile)).map(|place| blocks.counts[place]))
    }

    /// Whether this film counts the same blocks.
    pub(super) fn counts_blocks_like(&self, fresh: &Self) -> bool {
        let shape = |blocks: &BlockCounts| (blocks.grid, blocks.counts.len());
        self.blocks.as_ref().map(shape) == fresh.blocks.as_ref().map(shape)
    }

    /// Adds the mean of the new samples of each pixel that `request` asked for; `mean` is row-major over the
    /// tile. Every pixel of the batch counts as [`BlockRequest::spp`] samples.
    ///
    /// # Errors
    /// [`FilmError`] as [`Film::add`], and [`FilmError::Blocks`] if the film does not count such blocks, or
    /// one of them gets no samples; the film is then unchanged.
    pub fn add_blocks(&mut self, request: &BlockRequest, mean: &[Rgb]) -> Result<(), FilmError> {
        let tile = self.check(request.tile.index, mean.len())?;
        let fits = |blocks: &BlockCounts| {
            let sampled = request.blocks.iter().all(|block| block.spp > 0);
            blocks.grid.edge() == request.edge
                && request.blocks.len() == blocks.places(tile).count()
                && sampled
        };
        if tile != request.tile || request.spp == 0 || !self.blocks.as_ref().is_some_and(fits) {
            return Err(FilmError::Blocks(tile.index));
        }
        let (_, most) = self.spp_range(tile.index);
        for spp in request.blocks.iter().map(|block| block.spp).chain([request.spp]) {
            Self::countable(tile, most, spp)?;
        }
        let half = self.accumulate(tile, request.spp, mean);
        if let Some(blocks) = &mut self.blocks {
            blocks.count(tile, half, request.blocks.iter().map(|block| block.spp));
        }
        Ok(())
    }
}
