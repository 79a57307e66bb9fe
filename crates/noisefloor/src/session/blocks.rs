//! How the samples of a tile are spread over its blocks.

use super::Session;
use crate::blocks::{BlockRequest, BlockSamples, shares, spread};
use crate::criterion::{StoppingCriterion, View};
use crate::film::FilmError;
use crate::rgb::Rgb;
use crate::source::Request;
use crate::tile::Tile;

impl<C: StoppingCriterion> Session<C> {
    /// A request of [`Session::requests`] or [`Session::next_batches`] spread over the blocks of its tile,
    /// for renderers that can give different blocks different numbers of samples; none unless
    /// [`Params::blocks`](crate::Params::blocks) is set. Answer it with [`Session::push_blocks`].
    ///
    /// A renderer that cannot answers the request itself with [`Session::push`], as if there were no blocks.
    pub fn block_request(&self, request: &Request) -> Option<BlockRequest> {
        let (tile, edge, spp) = (request.tile, self.params.blocks, request.spp);
        let had = self.film.block_counts(tile.index)?.map(|[a, b]| a + b);
        let blocks = match &self.shares[tile.index] {
            None => had.map(|first| BlockSamples { first, spp }).collect(),
            Some(shares) => {
                let new = spread(shares, tile, edge, spp);
                had.zip(new).map(|(first, spp)| BlockSamples { first, spp }).collect()
            }
        };
        Some(BlockRequest { tile, spp, edge, blocks })
    }

    /// Adds the mean of the new samples of each pixel that [`Session::block_request`] asked for, row-major
    /// over the tile.
    ///
    /// # Errors
    /// [`FilmError`] if it does not fit; nothing is changed then.
    pub fn push_blocks(&mut self, request: &BlockRequest, mean: &[Rgb]) -> Result<(), FilmError> {
        self.film.add_blocks(request, mean)
    }

    /// Decides the shares of the blocks of those of these tiles that are open.
    pub(super) fn share_out(&mut self, mut tiles: Vec<Tile>) {
        let edge = self.params.blocks;
        tiles.retain(|tile| edge > 0 && self.is_open(tile.index));
        if tiles.is_empty() {
            return;
        }
        let view = View::of(&self.film, &self.display, &self.params, &self.displayed_reference);
        let needs = view.and_then(|view| self.criterion.block_needs(&view, &tiles, edge));
        for (tile, needs) in tiles.into_iter().zip(needs.into_iter().flatten()) {
            self.shares[tile.index] = needs.map(|needs| shares(&needs, tile, edge));
        }
    }
}

#[cfg(test)]
mod tests;
