//! The pixels that are watched.

use crate::display::luminance;
use crate::tile::{Tile, TileGrid, TilePixels};
use rayon::prelude::*;

/// Pixels of a picture up to which one pixel in 4×4 is watched.
const SMALL: usize = 160 * 160;
/// Logarithms that one thread takes, at least.
const LOGS_AT_ONCE: usize = 4096;

/// Where watched pixels lie: in the middle of squares of this edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Points {
    step: usize,
}

impl Points {
    pub(super) fn new(grid: TileGrid) -> Self {
        Self { step: if grid.width() * grid.height() <= SMALL { 4 } else { 8 } }
    }

    /// Places (x, y) within this tile, row-major; each has a neighbour to the left and to the right. None of a
    /// tile that is narrower than three pixels.
    pub(super) fn of(self, tile: Tile) -> impl Iterator<Item = (usize, usize)> + Clone {
        Self::every(self.step, self.step, tile)
    }

    /// As [`Points::of`], four times as many, and eight in small pictures, of which every second pixel of each row is
    /// watched: for the first batches, by which a tile could stop soon.
    pub(super) fn at_first(self, tile: Tile) -> impl Iterator<Item = (usize, usize)> + Clone {
        let step = self.step / 2;
        Self::every(if step > 2 { step } else { 1 }, step, tile)
    }

    fn every(down: usize, across: usize, tile: Tile) -> impl Iterator<Item = (usize, usize)> + Clone {
        let middle = |step: usize| (step / 2).saturating_sub(1);
        let columns = (middle(across).max(1)..tile.width.saturating_sub(1)).step_by(across);
        let rows = (middle(down).min(tile.height - 1)..tile.height).step_by(down);
        rows.flat_map(move |y| columns.clone().map(move |x| (x, y)))
    }
}

/// Places within a tile at which batches are compared with those before: all of a small tile, and at least 512.
pub(super) fn compared(tile: Tile) -> impl Iterator<Item = (usize, usize)> {
    let step = (tile.pixels() / 512).isqrt().max(1);
    (0..tile.height).step_by(step).flat_map(move |y| (0..tile.width).step_by(step).map(move |x| (x, y)))
}

/// Luminance of a pixel's left neighbour, of itself, and of its right neighbour.
#[inline]
pub(super) fn light(mean: TilePixels<'_>, (x, y): (usize, usize)) -> [f32; 3] {
    let row = mean.row(y);
    [row[x - 1], row[x], row[x + 1]].map(luminance)
}

/// A typical one of these values: the geometric mean of those above 0, which a few lamps and fireflies hardly
/// move. 1 if there is none.
pub(super) fn level(values: &[f64]) -> f64 {
    let log = |&value: &f64| (value > 0.0 && value.is_finite()).then(|| value.ln());
    let logs: Vec<Option<f64>> = values.par_iter().with_min_len(LOGS_AT_ONCE).map(log).collect();
    // In their order, so that the sum is the same with any number of threads
    let (sum, count) =
        logs.into_iter().flatten().fold((0.0, 0u64), |(sum, count), log| (sum + log, count + 1));
    if count > 0 { (sum / count as f64).exp() } else { 1.0 }
}
