//! The image as a grid of tiles.

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Smallest tile edge, in pixels: below it a descriptor has too few pixels to pool over.
pub const MIN_TILE: usize = 16;
/// Largest tile edge, in pixels.
pub const MAX_TILE: usize = 512;
/// Default tile edge, in pixels (Takouachet et al. 2017, §4.2.2).
pub const DEFAULT_TILE: usize = 128;
/// Largest image edge that is accepted, in pixels: a limit before anything is allocated.
pub const MAX_EDGE: usize = 65_536;
/// Largest number of pixels that is accepted.
pub const MAX_PIXELS: usize = 1 << 28;

/// Checks an image's size against the limits, before anything of that size is allocated.
///
/// # Errors
/// [`TileError::Image`] if it is empty or too large.
#[doc(hidden)]
pub fn check_image(width: usize, height: usize) -> Result<(), TileError> {
    let fits = (1..=MAX_EDGE).contains(&width) && (1..=MAX_EDGE).contains(&height);
    if fits && width * height <= MAX_PIXELS { Ok(()) } else { Err(TileError::Image(width, height)) }
}

/// One tile: its place in the row-major order of the grid, and its pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct Tile {
    /// Row-major place in the grid.
    pub index: usize,
    /// Left edge, in pixels.
    pub x: usize,
    /// Top edge, in pixels.
    pub y: usize,
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
}

impl Tile {
    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.width * self.height
    }

    /// The place in the grid of the tile that holds pixel (`x`, `y`), which is mostly this one.
    #[inline]
    pub(crate) fn owner(&self, grid: TileGrid, x: usize, y: usize) -> usize {
        let inside = x.wrapping_sub(self.x) < self.width && y.wrapping_sub(self.y) < self.height;
        if inside { self.index } else { grid.index_at(x, y) }
    }

    /// The rows of this tile as ranges into a row-major image `image_width` pixels wide.
    pub fn rows(self, image_width: usize) -> impl Iterator<Item = std::ops::Range<usize>> {
        (self.y..self.y + self.height).map(move |y| {
            let start = y * image_width + self.x;
            start..start + self.width
        })
    }
}

/// Why an image cannot be divided into such tiles.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
pub enum TileError {
    /// The tile edge is outside [`MIN_TILE`]…[`MAX_TILE`].
    #[error("tile size {0} is outside {MIN_TILE}…{MAX_TILE} pixels; the default is {DEFAULT_TILE}")]
    Edge(usize),
    /// The image is empty or larger than [`MAX_EDGE`] or [`MAX_PIXELS`] allow.
    #[error(
        "an image of {0}×{1} pixels cannot be judged: each edge must be 1…{MAX_EDGE} and the area at most {MAX_PIXELS}"
    )]
    Image(usize, usize),
}

/// A grid of square tiles over an image, row-major from the top left; those of the last column and row may be
/// narrower.
///
/// ```
/// let grid = noisefloor::TileGrid::new(800, 600, 128)?;
/// assert_eq!((grid.columns(), grid.rows(), grid.len()), (7, 5, 35));
/// assert_eq!(grid.tile(34).width, 800 - 6 * 128);
/// # Ok::<(), noisefloor::tile::TileError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct TileGrid {
    width: usize,
    height: usize,
    edge: usize,
}

impl TileGrid {
    /// Divides an image of `width`×`height` pixels into tiles of `edge` pixels.
    ///
    /// # Errors
    /// [`TileError`] if `edge` is outside [`MIN_TILE`]…[`MAX_TILE`] or the image is empty or too large.
    pub fn new(width: usize, height: usize, edge: usize) -> Result<Self, TileError> {
        check_image(width, height)?;
        if !(MIN_TILE..=MAX_TILE).contains(&edge) {
            return Err(TileError::Edge(edge));
        }
        Ok(Self { width, height, edge })
    }

    /// Image width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Image height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Tile edge in pixels.
    pub fn edge(&self) -> usize {
        self.edge
    }

    /// Tiles in a row.
    pub fn columns(&self) -> usize {
        self.width.div_ceil(self.edge)
    }

    /// Tiles in a column.
    pub fn rows(&self) -> usize {
        self.height.div_ceil(self.edge)
    }

    /// Number of tiles, at least one.
    #[expect(clippy::len_without_is_empty, reason = "a grid is never empty")]
    pub fn len(&self) -> usize {
        self.columns() * self.rows()
    }

    /// The tile at row-major place `index`.
    ///
    /// # Panics
    /// If `index` is not below [`TileGrid::len`].
    pub fn tile(&self, index: usize) -> Tile {
        assert!(index < self.len(), "tile {index} of {}", self.len());
        let (x, y) = (index % self.columns() * self.edge, index / self.columns() * self.edge);
        let (width, height) = (self.edge.min(self.width - x), self.edge.min(self.height - y));
        Tile { index, x, y, width, height }
    }

    /// The row-major place of the tile that holds pixel (`x`, `y`), which must lie in the image.
    #[inline]
    pub fn index_at(&self, x: usize, y: usize) -> usize {
        y / self.edge * self.columns() + x / self.edge
    }

    /// All tiles, row-major.
    pub fn tiles(self) -> impl ExactSizeIterator<Item = Tile> {
        (0..self.len()).map(move |index| self.tile(index))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn tiles_cover_every_pixel_once(w in 1usize..200, h in 1usize..200, edge in 16usize..80) {
            let grid = TileGrid::new(w, h, edge).unwrap();
            let mut seen = vec![0u8; w * h];
            for tile in grid.tiles() {
                prop_assert!(tile.width <= edge && tile.height <= edge);
                prop_assert_eq!(grid.index_at(tile.x + tile.width - 1, tile.y), tile.index);
                for row in tile.rows(w) {
                    seen[row].iter_mut().for_each(|s| *s += 1);
                }
            }
            prop_assert!(seen.iter().all(|&s| s == 1));
        }
    }

    #[test]
    fn limits_are_errors() {
        assert_eq!(TileGrid::new(10, 10, 0), Err(TileError::Edge(0)));
        assert_eq!(TileGrid::new(10, 10, 513), Err(TileError::Edge(513)));
        assert_eq!(TileGrid::new(0, 10, 64), Err(TileError::Image(0, 10)));
        assert_eq!(TileGrid::new(usize::MAX, usize::MAX, 64), Err(TileError::Image(usize::MAX, usize::MAX)));
    }
}
