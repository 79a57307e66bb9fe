//! Why a batch does not fit a film.

use thiserror::Error;

/// A batch that the film refuses.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum FilmError {
    /// The tile does not exist.
    #[error("tile {0} does not exist: the film has {1}")]
    Tile(usize, usize),
    /// The batch has another number of pixels than the tile.
    #[error("a batch of {got} pixels for tile {tile}, which has {expected}")]
    Pixels {
        /// The tile.
        tile: usize,
        /// Pixels in the batch.
        got: usize,
        /// Pixels in the tile.
        expected: usize,
    },
    /// A batch without samples, or a running mean of no more samples than the film has.
    #[error("a batch for tile {tile} brings no new samples ({had} before, {now} now)")]
    NothingNew {
        /// The tile.
        tile: usize,
        /// Samples before.
        had: u64,
        /// Samples claimed now.
        now: u64,
    },
    /// The system has less memory for a film than it would take.
    #[error("a film of {width}×{height} pixels takes {bytes} bytes of memory, more than there is")]
    Memory {
        /// Width of the picture.
        width: usize,
        /// Height of the picture.
        height: usize,
        /// What it would take.
        bytes: usize,
    },
    /// More samples than a film counts.
    #[error("tile {tile} would have {now} samples per pixel or more; a film counts fewer than 2^34")]
    TooMany {
        /// The tile.
        tile: usize,
        /// Samples that it would have.
        now: u64,
    },
}
