//! Rounds: what all open tiles need for their next verdicts, cut into batches.

use super::Session;
use crate::criterion::StoppingCriterion;
use crate::params::Schedule;
use crate::session::Goal;
use crate::source::Request;

/// Most pixel samples requested in one call. A fast renderer takes about a second for it, so that cancelling,
/// the time limit and progress are prompt. A constant rather than a time, so that batches are the same on
/// every machine.
pub(crate) const CALL_SAMPLES: u64 = 1 << 22;

impl<C: StoppingCriterion> Session<C> {
    /// The next batch of each open tile that is not due, in row-major order: how a
    /// [`Driver`](crate::Driver) cuts [`Session::requests`]. Empty when the round is
    /// [complete](Session::is_round_complete).
    ///
    /// The cut depends on the tile's own samples, on the parameters and on the size of the picture, and on
    /// nothing else. So the same batches come, and the film is the same to the bit, in whatever order and on
    /// how many machines tiles are sampled. In a large picture a tile's batches begin with one sample and
    /// double, so that the whole picture is seen soon.
    #[doc(hidden)]
    pub fn next_batches(&self) -> Vec<Request> {
        let wish = |index: usize| {
            let goal = self.tiles[index].goal.spp();
            let counts = self.film.half_counts(index);
            (!self.is_due(index)).then(|| self.batch(index, counts, goal))
        };
        (0..self.tiles.len()).filter(|&index| self.is_open(index)).filter_map(wish).collect()
    }

    /// Whether every open tile has what its next verdict needs. A driver judges then, and no sooner: verdicts
    /// depend on the whole picture, and so not on the order in which tiles are sampled.
    #[doc(hidden)]
    pub fn is_round_complete(&self) -> bool {
        (0..self.tiles.len()).all(|index| !self.is_open(index) || self.is_due(index))
    }

    /// The batches that an open tile is going to need, in the order of its samples: up to its next verdict
    /// and, if verdicts are due after [every](Schedule::Every) step, beyond it for most of the way to where
    /// the criterion expects to be satisfied, at most doubling what the tile has. For those who render ahead
    /// of the verdicts, on other machines. Batches beyond a stop are never asked for by
    /// [`Session::next_batches`].
    ///
    /// # Panics
    /// If the tile does not exist.
    #[doc(hidden)]
    pub fn batches_ahead(&self, tile: usize) -> Vec<Request> {
        let mut batches = Vec::new();
        if !self.is_open(tile) {
            return batches;
        }
        let mut counts = self.film.half_counts(tile);
        let (mut goal, last) = (self.tiles[tile].goal.spp(), self.look_ahead(tile));
        loop {
            while !self.has_enough(counts, goal) {
                let batch = self.batch(tile, counts, goal);
                counts[batch.sequence.number as usize] += batch.spp;
                batches.push(batch);
            }
            let samples = counts[0] + counts[1];
            let next = self.params.schedule.next(samples, None, 1.0).min(self.params.max_spp);
            if next > last || next <= samples {
                return batches;
            }
            goal = next;
        }
    }

    /// Samples up to which a tile is unlikely to stop.
    fn look_ahead(&self, tile: usize) -> u64 {
        let expected = self.tiles[tile].verdict.and_then(|verdict| self.expected(&verdict));
        match (self.params.schedule, expected, self.tiles[tile].goal) {
            (Schedule::Every { step }, Some(expected), Goal::Verdict { spp, streak: 0 }) => {
                Schedule::Spaced { step }.next(self.film.spp(tile), Some(expected), 1.0).max(spp)
            }
            (_, _, goal) => goal.spp(),
        }
    }

    /// The next batch of a tile that has these samples in its halves.
    fn batch(&self, index: usize, counts: [u64; 2], goal: u64) -> Request {
        let tile = self.film.grid().tile(index);
        let pixels = self.film.grid().width() * self.film.grid().height();
        let had = if self.film.has_halves() { counts[0].min(counts[1]) } else { counts[0] };
        let most = had.max(CALL_SAMPLES / pixels as u64).min(CALL_SAMPLES / tile.pixels() as u64);
        let spp = self.wanted(counts, goal).min(most).max(1);
        self.film.request_after(index, counts, spp)
    }

    /// Samples that one half of a tile lacks for a verdict at `goal`.
    pub(super) fn wanted(&self, [a, b]: [u64; 2], goal: u64) -> u64 {
        let missing = goal.saturating_sub(a + b);
        if self.film.has_halves() { goal.div_ceil(2).saturating_sub(a.min(b)).min(missing) } else { missing }
    }

    /// Whether a tile with these samples in its halves can be judged at `goal`.
    pub(super) fn has_enough(&self, [a, b]: [u64; 2], goal: u64) -> bool {
        a + b >= goal && (!self.film.has_halves() || a.min(b) > 0)
    }
}

#[cfg(test)]
mod tests;
