//! The image as a grid of tiles.

use crate::rgb::Rgb;
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Smallest tile edge, in pixels: below it a descriptor has too few pixels to pool over.
#[doc(hidden)]
pub const MIN_TILE: usize = 16;
/// Largest tile edge, in pixels.
#[doc(hidden)]
pub const MAX_TILE: usize = 512;
/// Default tile edge, in pixels (Takouachet et al. 2017, §4.2.2).
#[doc(hidden)]
pub const DEFAULT_TILE: usize = 128;
/// Largest image edge that is accepted, in pixels: a limit before anything is allocated.
#[doc(hidden)]
pub const MAX_EDGE: usize = 65_536;
/// Largest number of pixels that is accepted.
#[doc(hidden)]
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
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
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

/// The pixels of a tile, in an array of their own or in that of the whole picture.
#[derive(Clone, Copy)]
pub(crate) struct TilePixels<'a> {
    /// From the first pixel of the tile on.
    pixels: &'a [Rgb],
    /// From one row to the next.
    stride: usize,
    width: usize,
    height: usize,
}

impl<'a> TilePixels<'a> {
    /// Of an array of the tile alone.
    pub(crate) fn alone(tile: Tile, pixels: &'a [Rgb]) -> Self {
        let Tile { width, height, .. } = tile;
        Self { pixels, stride: width, width, height }
    }

    /// Of a picture, which is `stride` pixels wide.
    pub(crate) fn in_image(tile: Tile, image: &'a [Rgb], stride: usize) -> Self {
        let Tile { x, y, width, height, .. } = tile;
        Self { pixels: &image[y * stride + x..], stride, width, height }
    }

    #[inline]
    pub(crate) fn row(self, y: usize) -> &'a [Rgb] {
        &self.pixels[y * self.stride..][..self.width]
    }

    /// All of its pixels, row by row.
    pub(crate) fn iter(self) -> impl Iterator<Item = Rgb> + Clone {
        (0..self.height).flat_map(move |y| self.row(y).iter().copied())
    }
}

/// Why an image cannot be divided into such tiles.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum TileError {
    /// The tile edge is outside 16…512 pixels.
    #[error("tile size {0} is outside {MIN_TILE}…{MAX_TILE} pixels; the default is {DEFAULT_TILE}")]
    Edge(usize),
    /// The image is empty or larger than 65,536 pixels along an edge, or 2²⁸ in all.
    #[error(
        "an image of {0}×{1} pixels cannot be judged: each edge must be 1…{MAX_EDGE} and the area at most {MAX_PIXELS}"
    )]
    Image(usize, usize),
}

/// A grid of square tiles over an image, row-major from the top left. Those of the last column and row take
/// what is left: they have half to one and a half times the edge of the others, since nobody judges slivers,
/// whose few pixels say little of noise. In an image of less than half an edge, they have what there is.
///
/// ```
/// let grid = noisefloor::TileGrid::new(800, 600, 128)?;
/// assert_eq!((grid.columns(), grid.rows(), grid.len()), (6, 5, 30));
/// let last = grid.tile(29);
/// assert_eq!((last.width, last.height), (128 + 32, 600 - 4 * 128));
/// # Ok::<(), noisefloor::tile::TileError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "files", serde(try_from = "Unchecked"))]
pub struct TileGrid {
    width: usize,
    height: usize,
    edge: usize,
}

/// A grid as it was read.
#[cfg_attr(feature = "files", derive(Deserialize))]
struct Unchecked {
    width: usize,
    height: usize,
    edge: usize,
}

impl TryFrom<Unchecked> for TileGrid {
    type Error = TileError;

    fn try_from(Unchecked { width, height, edge }: Unchecked) -> Result<Self, TileError> {
        Self::new(width, height, edge)
    }
}

impl TileGrid {
    /// Divides an image of `width`×`height` pixels into tiles of `edge` pixels.
    ///
    /// # Errors
    /// [`TileError`] if `edge` is outside 16…512 pixels or the image is empty or too large.
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

    /// Image width and height in pixels.
    pub fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Tile edge in pixels.
    pub fn edge(&self) -> usize {
        self.edge
    }

    /// Tiles in a row.
    pub fn columns(&self) -> usize {
        Self::count(self.width, self.edge)
    }

    /// Tiles in a column.
    pub fn rows(&self) -> usize {
        Self::count(self.height, self.edge)
    }

    /// Tiles along one side: what is left of less than half an edge is joined to the last of them.
    #[inline]
    fn count(length: usize, edge: usize) -> usize {
        ((2 * length + edge) / (2 * edge)).max(1)
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
        let (columns, rows) = (self.columns(), self.rows());
        let (column, row) = (index % columns, index / columns);
        let (x, y) = (column * self.edge, row * self.edge);
        let width = if column + 1 < columns { self.edge } else { self.width - x };
        let height = if row + 1 < rows { self.edge } else { self.height - y };
        Tile { index, x, y, width, height }
    }

    /// The row-major place of the tile that holds pixel (`x`, `y`), which must lie in the image.
    #[inline]
    pub fn index_at(&self, x: usize, y: usize) -> usize {
        let (columns, rows) = (self.columns(), self.rows());
        (y / self.edge).min(rows - 1) * columns + (x / self.edge).min(columns - 1)
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
                for (length, whole) in [(tile.width, w), (tile.height, h)] {
                    // No sliver, and nothing of more than one and a half edges
                    prop_assert!(2 * length < 3 * edge && (2 * length >= edge || length == whole));
                }
                prop_assert_eq!(grid.index_at(tile.x, tile.y), tile.index);
                let last = (tile.x + tile.width - 1, tile.y + tile.height - 1);
                prop_assert_eq!(grid.index_at(last.0, last.1), tile.index);
                for row in tile.rows(w) {
                    seen[row].iter_mut().for_each(|s| *s += 1);
                }
            }
            prop_assert!(seen.iter().all(|&s| s == 1));
        }
    }

    /// 1921 pixels have no tile one pixel wide, and 270 none of 14 rows.
    #[test]
    fn slivers_are_joined_to_their_neighbours() {
        let edges = |length, edge| {
            let grid = TileGrid::new(length, 16, edge).unwrap();
            grid.tiles().map(|tile| tile.width).collect::<Vec<_>>()
        };
        assert_eq!(edges(1921, 128)[13..], [128, 129]);
        assert_eq!(edges(270, 64), [64, 64, 64, 78]);
        assert_eq!((edges(96, 64), edges(95, 64), edges(9, 64)), (vec![64, 32], vec![95], vec![9]));
    }

    #[test]
    fn limits_are_errors() {
        assert_eq!(TileGrid::new(10, 10, 0), Err(TileError::Edge(0)));
        assert_eq!(TileGrid::new(10, 10, 513), Err(TileError::Edge(513)));
        assert_eq!(TileGrid::new(0, 10, 64), Err(TileError::Image(0, 10)));
        assert_eq!(TileGrid::new(usize::MAX, usize::MAX, 64), Err(TileError::Image(usize::MAX, usize::MAX)));
    }
}
