//! How the samples of a tile are spread over its blocks.

use super::{Session, SessionError};
use crate::blocks::{BlockRequest, BlockSamples, shares, spread};
use crate::criterion::{StoppingCriterion, View};
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
        let had: Vec<u64> = self.film.block_counts(request.tile.index)?.map(|[a, b]| a + b).collect();
        Some(self.spread_over(request, &had))
    }

    /// [`Session::batches_ahead`] spread over the blocks of the tile, as [`Session::block_request`] will
    /// spread them; none unless [`Params::blocks`](crate::Params::blocks) is set.
    ///
    /// # Panics
    /// If the tile does not exist.
    pub fn block_requests_ahead(&self, tile: usize) -> Option<Vec<BlockRequest>> {
        let mut had: Vec<u64> = self.film.block_counts(tile)?.map(|[a, b]| a + b).collect();
        let mut ahead = Vec::new();
        for batch in self.batches_ahead(tile) {
            let request = self.spread_over(&batch, &had);
            had.iter_mut().zip(&request.blocks).for_each(|(had, new)| *had += new.spp);
            ahead.push(request);
        }
        Some(ahead)
    }

    /// Spreads a request over blocks that have these samples.
    fn spread_over(&self, request: &Request, had: &[u64]) -> BlockRequest {
        let &Request { tile, spp, .. } = request;
        let edge = self.params.blocks;
        let new = match &self.shares[tile.index] {
            None => vec![spp; had.len()],
            Some(shares) => spread(shares, tile, edge, spp),
        };
        let blocks = had.iter().zip(new).map(|(&first, spp)| BlockSamples { first, spp }).collect();
        BlockRequest { tile, spp, edge, blocks }
    }

    /// Adds the mean of the new samples of each pixel that [`Session::block_request`] asked for, row-major
    /// over the tile.
    ///
    /// # Errors
    /// As of [`Session::push`].
    pub fn push_blocks(&mut self, request: &BlockRequest, mean: &[Rgb]) -> Result<(), SessionError> {
        let place = self.film.check(request.tile.index, mean.len())?;
        self.watch.check_light(&self.film, place, request.spp, mean)?;
        self.film.add_blocks(request, mean)?;
        self.watch.see(place, request.spp, mean);
        Ok(())
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
