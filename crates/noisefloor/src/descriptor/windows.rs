//! Means of the squared visible contrast over windows of the picture, and of its fourth power, whatever tiles it is
//! divided into.
//!
//! Powers of contrast are summed over blocks of the picture; a tile keeps its share of each block that it has pixels
//! of. The blocks of all tiles make up those of the picture, and summed-area tables (Crow 1984, "Summed-area tables
//! for texture mapping") give the mean over any window of them.

use super::kind::Described;
use crate::tile::Tile;
use noisefloor_vision::DifferenceBand;
use rayon::prelude::*;
use std::ops::Range;

/// Edge of a block in pixels of the picture, from its top left on: a seventh of a window on a monitor.
pub(super) const BLOCK: usize = 4;
/// Rows of blocks that one thread looks at, at least: those of a tile.
const ROWS_AT_ONCE: usize = 16;

/// Columns or rows of blocks that pixels from..from + count lie in.
fn blocks_of(from: usize, count: usize) -> Range<usize> {
    from / BLOCK..(from + count).div_ceil(BLOCK)
}

/// How many blocks a tile has pixels of.
pub(super) fn block_count(place: Tile) -> usize {
    blocks_of(place.x, place.width).len() * blocks_of(place.y, place.height).len()
}

/// The sums of a map and of its square over the pixels of a tile, by block of the picture, row by row.
pub(super) fn block_sums(map: DifferenceBand<'_>, place: Tile) -> Vec<[f32; 2]> {
    let columns = blocks_of(place.x, place.width);
    let mut sums = vec![[0.0; 2]; block_count(place)];
    let rows: Vec<&[f32]> = map.rows().collect();
    for y in 0..place.height {
        // A map may have a value for several pixels, and begin up to a value before the tile
        let row = rows[(y / map.step).min(rows.len() - 1)];
        let of_row = ((place.y + y) / BLOCK - place.y / BLOCK) * columns.len();
        let sums = &mut sums[of_row..of_row + columns.len()];
        for ([sum, squares], column) in sums.iter_mut().zip(columns.clone()) {
            let from = (column * BLOCK).max(place.x) - place.x;
            let to = ((column + 1) * BLOCK - place.x).min(place.width);
            for x in from..to {
                let value = row[if map.step == 1 { x } else { (x / map.step).min(row.len() - 1) }];
                *sum += value;
                *squares += value * value;
            }
        }
    }
    sums
}

/// Visible contrast, of one sample per pixel, over a picture.
pub(super) struct PictureContrast {
    rows: Range<usize>,
    columns: Range<usize>,
    /// Sums of squares, of fourth powers, and pixels, of all blocks above and to the left: one row and column more than
    /// blocks.
    tables: Vec<[f64; 3]>,
}

/// Means over a window, or the largest of several windows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct WindowContrast {
    /// Of the squares of contrast.
    pub(super) square: f64,
    /// Of its fourth powers.
    pub(super) fourth: f64,
}

impl WindowContrast {
    /// The larger of both means.
    fn or(self, other: Self) -> Self {
        Self { square: self.square.max(other.square), fourth: self.fourth.max(other.fourth) }
    }

    /// The contrast of so many samples: the root mean square, or the mean of fourth order over `crest` if that is more.
    pub(super) fn amplitude(self, spp: f64, crest: f64) -> f64 {
        let (square, fourth) = (self.square / spp, self.fourth / (spp * spp));
        square.sqrt().max(fourth.sqrt().sqrt() / crest)
    }
}

impl PictureContrast {
    /// Of the tiles that there are. Where none is known, windows are means of what they have of others.
    pub(super) fn new(tiles: &[Described]) -> Self {
        let known = || tiles.iter().filter(|t| !t.blocks.is_empty());
        let hull = |of: fn(Tile) -> Range<usize>| {
            let start = known().map(|t| of(t.place).start).min().unwrap_or(0);
            start..known().map(|t| of(t.place).end).max().unwrap_or(0)
        };
        let rows = hull(|t| blocks_of(t.y, t.height));
        let columns = hull(|t| blocks_of(t.x, t.width));
        let stride = columns.len() + 1;
        let mut tables = vec![[0.0; 3]; (rows.len() + 1) * stride];
        for tile in known() {
            let place = tile.place;
            let (of_rows, of_columns) = (blocks_of(place.y, place.height), blocks_of(place.x, place.width));
            let mut sums = tile.blocks.iter();
            for y in of_rows {
                let height = overlap(y, place.y, place.height);
                for x in of_columns.clone() {
                    let entry = &mut tables[(y - rows.start + 1) * stride + x - columns.start + 1];
                    let [squares, fourths] = sums.next().copied().unwrap_or_default();
                    entry[0] += f64::from(squares) * tile.spp;
                    entry[1] += f64::from(fourths) * tile.spp * tile.spp;
                    entry[2] += (height * overlap(x, place.x, place.width)) as f64;
                }
            }
        }
        // Along the rows, each by itself, and then down, where all columns of a row can be added at once
        tables.par_chunks_exact_mut(stride).for_each(|row| {
            let mut along = [0.0; 3];
            for entry in row {
                for (along, value) in along.iter_mut().zip(entry) {
                    *along += *value;
                    *value = *along;
                }
            }
        });
        for y in 1..=rows.len() {
            let (above, row) = tables[(y - 1) * stride..(y + 1) * stride].split_at_mut(stride);
            for (entry, above) in row.as_flattened_mut().iter_mut().zip(above.as_flattened()) {
                *entry += above;
            }
        }
        Self { rows, columns, tables }
    }

    /// The blocks of a tile, as rows and columns.
    pub(super) fn blocks(&self, place: Tile) -> (Range<usize>, Range<usize>) {
        (blocks_of(place.y, place.height), blocks_of(place.x, place.width))
    }

    /// The worst window around any of these blocks.
    pub(super) fn worst(
        &self,
        (rows, columns): (Range<usize>, Range<usize>),
        window: usize,
    ) -> WindowContrast {
        let worst = |row| self.worst_in_row(row, columns.clone(), window);
        rows.into_par_iter()
            .with_min_len(ROWS_AT_ONCE)
            .map(worst)
            .reduce(WindowContrast::default, WindowContrast::or)
    }

    /// The same of blocks of one row.
    fn worst_in_row(&self, row: usize, columns: Range<usize>, window: usize) -> WindowContrast {
        if !self.rows.contains(&row) {
            return WindowContrast::default();
        }
        let stride = self.columns.len() + 1;
        let (top, bottom) = span(row, &self.rows, window);
        let [above, below] = [top, bottom].map(|y| &self.tables[y * stride..(y + 1) * stride]);
        let columns = columns.filter(|column| self.columns.contains(column));
        let around = |column| {
            let (left, right) = span(column, &self.columns, window);
            mean([above, below], left, right)
        };
        columns.map(around).fold(WindowContrast::default(), WindowContrast::or)
    }

    /// Blocks whose windows overlap with the worst window of the picture, as rows and columns; `None` if these make up more than
    /// a share of it.
    pub(super) fn worst_place(
        &self,
        share: f64,
        window: usize,
        amplitude: impl Fn(WindowContrast) -> f64 + Sync,
    ) -> Option<(Range<usize>, Range<usize>)> {
        let of_row = |row: usize| {
            let around = |column: usize| amplitude(self.worst_in_row(row, column..column + 1, window));
            let worst = self.columns.clone().map(|column| (around(column), column));
            worst.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(most, column)| (most, row, column))
        };
        let of_rows: Vec<_> =
            self.rows.clone().into_par_iter().with_min_len(ROWS_AT_ONCE).map(of_row).collect();
        let (_, row, column) = of_rows.into_iter().flatten().max_by(|a, b| a.0.total_cmp(&b.0))?;
        let around = |at: usize, all: &Range<usize>| {
            (at + 1).saturating_sub(window).max(all.start)..(at + window).min(all.end)
        };
        let (rows, columns) = (around(row, &self.rows), around(column, &self.columns));
        let blocks = (self.rows.len() * self.columns.len()) as f64;
        ((rows.len() * columns.len()) as f64 <= share * blocks).then_some((rows, columns))
    }

    /// How many zones there are, of near `edge` blocks.
    pub(super) fn zone_count(&self, edge: usize) -> usize {
        count_of(&self.rows, edge) * count_of(&self.columns, edge)
    }

    /// The worst window around a block of each of the zones that the picture divides into, with as many blocks as it has:
    /// of equal size, near `edge` blocks. Blocks of `without`, as rows and columns, do not count.
    pub(super) fn zones(
        &self,
        edge: usize,
        window: usize,
        without: Option<&(Range<usize>, Range<usize>)>,
    ) -> Vec<(WindowContrast, usize)> {
        let divide = |all: &Range<usize>| {
            let count = count_of(all, edge);
            let (start, length) = (all.start, all.len());
            (0..count).map(move |i| start + i * length / count..start + (i + 1) * length / count)
        };
        let zone = |(rows, columns): (Range<usize>, Range<usize>)| {
            let blocks = rows.len() * columns.len();
            let of_row = |row: usize| match without {
                Some((rows, place)) if rows.contains(&row) => {
                    let before = columns.start..columns.end.min(place.start);
                    let after = columns.start.max(place.end)..columns.end;
                    self.worst_in_row(row, before, window).or(self.worst_in_row(row, after, window))
                }
                _ => self.worst_in_row(row, columns.clone(), window),
            };
            (rows.map(of_row).fold(WindowContrast::default(), WindowContrast::or), blocks)
        };
        let (rows, columns) = (&self.rows, &self.columns);
        let zones = divide(rows).flat_map(|rows| divide(columns).map(move |columns| (rows.clone(), columns)));
        zones.collect::<Vec<_>>().into_par_iter().map(zone).collect()
    }

    /// The mean over a window of `edge` blocks around a block; at the edge of the picture, over the nearest window
    /// that lies in it.
    pub(super) fn around(&self, row: usize, column: usize, edge: usize) -> WindowContrast {
        if self.columns.contains(&column) {
            self.worst_in_row(row, column..column + 1, edge)
        } else {
            WindowContrast::default()
        }
    }
}

/// Where a window of `edge` blocks around one begins and ends, counted in the blocks of the picture: the nearest that lies in it.
fn span(at: usize, of: &Range<usize>, edge: usize) -> (usize, usize) {
    let edge = edge.min(of.len());
    let start = (at - of.start).saturating_sub(edge / 2).min(of.len() - edge);
    (start, start + edge)
}

/// The mean over a window, of the rows of the tables above it and at its lower end.
fn mean([above, below]: [&[[f64; 3]]; 2], left: usize, right: usize) -> WindowContrast {
    let sum = |of: usize| below[right][of] - above[right][of] - below[left][of] + above[left][of];
    let pixels = sum(2);
    // Differences of sums may miss 0 by their rounding
    let mean = |of: usize| if pixels > 0.0 { (sum(of) / pixels).max(0.0) } else { 0.0 };
    WindowContrast { square: mean(0), fourth: mean(1) }
}

/// Pixels of a block that lie within from..from + count.
fn overlap(block: usize, from: usize, count: usize) -> usize {
    ((block + 1) * BLOCK).min(from + count) - (block * BLOCK).max(from)
}

/// Into how many parts, of near `edge` blocks each, a side is divided.
fn count_of(side: &Range<usize>, edge: usize) -> usize {
    ((side.len() as f64 / edge as f64).round() as usize).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tile::TileGrid;
    use proptest::prelude::*;

    /// A picture of these squares, divided into tiles of `edge`, with samples of their own.
    fn divided(size: (usize, usize), edge: usize, square: impl Fn(usize, usize) -> f32) -> Vec<Described> {
        let describe = |place: Tile| {
            let spp = 16.0 * (place.index % 3 + 1) as f64;
            let mut blocks = vec![[0.0; 2]; block_count(place)];
            let columns = blocks_of(place.x, place.width);
            for y in place.y..place.y + place.height {
                for x in place.x..place.x + place.width {
                    let row = (y / BLOCK - place.y / BLOCK) * columns.len();
                    let value = square(x, y) / spp as f32;
                    let [sum, squares] = &mut blocks[row + x / BLOCK - columns.start];
                    (*sum, *squares) = (*sum + value, *squares + value * value);
                }
            }
            Described { own: vec![0.0; 3], spp, place, window: 7, blocks }
        };
        TileGrid::new(size.0, size.1, edge).unwrap().tiles().map(describe).collect()
    }

    proptest! {
        /// Whatever the tiles and their samples, a window has the mean of its pixels.
        #[test]
        fn windows_do_not_know_tiles(
            (width, height) in (1usize..90, 1usize..70), edge in 16usize..50, window in 0usize..6, seed: u32,
        ) {
            let window = 2 * window + 1;
            let square = |x: usize, y: usize| {
                let hash = ((x as u32 * 92_821) ^ (y as u32 * 68_917) ^ seed).wrapping_mul(0x9E37_79B1) >> 16;
                hash as f32 / 65_536.0
            };
            let picture = PictureContrast::new(&divided((width, height), edge, square));
            let (rows, columns) = (height.div_ceil(BLOCK), width.div_ceil(BLOCK));
            for (row, column) in [(0, 0), (rows / 2, columns / 3), (rows - 1, columns - 1)] {
                let span = |at: usize, all: usize| {
                    let edge = window.min(all);
                    let start = at.saturating_sub(window.min(all) / 2).min(all - edge);
                    start * BLOCK..(start + edge) * BLOCK
                };
                let (ys, xs) = (span(row, rows), span(column, columns));
                let inside = ys.flat_map(|y| xs.clone().map(move |x| (x, y)));
                let values: Vec<f64> =
                    inside.filter(|&(x, y)| x < width && y < height).map(|(x, y)| square(x, y).into()).collect();
                let found = picture.around(row, column, window);
                for (found, power) in [(found.square, 1), (found.fourth, 2)] {
                    let mean = values.iter().map(|v| v.powi(power)).sum::<f64>() / values.len() as f64;
                    prop_assert!((found - mean).abs() < 1e-5 * mean.max(1e-3), "{power}: {found} {mean}");
                }
            }
        }
    }

    /// Two zones of 25 blocks make up 50: the worst window of one lies in it, of the other it is what reaches over.
    #[test]
    fn zones_divide_the_picture_evenly() {
        let noisy =
            |x: usize, y: usize| if (20..24).contains(&x) && (20..24).contains(&y) { 3.0 } else { 0.0 };
        let picture = PictureContrast::new(&divided((200, 100), 40, noisy));
        let zones = picture.zones(24, 1, None);
        assert_eq!(zones.iter().map(|zone| zone.1).collect::<Vec<_>>(), [625, 625]);
        assert!(
            (zones[0].0.square - 3.0).abs() < 1e-6 && zones[1].0 == WindowContrast::default(),
            "{zones:?}"
        );
        assert_eq!(picture.zones(1000, 1, None).len(), 1);
    }

    /// The worst place is left out with all windows that overlap with it, if it is small enough.
    #[test]
    fn a_picture_without_its_worst_place_has_what_is_left() {
        let noisy = |x: usize, y: usize| match (x / 4, y / 4) {
            (20, 10) => 9.0,
            (40, 10) => 2.0,
            _ => 1.0,
        };
        let picture = PictureContrast::new(&divided((200, 100), 40, noisy));
        let amplitude = |here: WindowContrast| here.amplitude(1.0, 1e6);
        let place = picture.worst_place(0.05, 3, amplitude);
        let most = |without: Option<&_>| picture.zones(1000, 3, without)[0].0.square;
        assert!((most(None) - 17.0 / 9.0).abs() < 1e-5, "{}", most(None));
        assert!((most(place.as_ref()) - 10.0 / 9.0).abs() < 1e-5, "{place:?}");
        // 25 of 1,250 blocks
        assert_eq!(place.map(|(rows, columns)| rows.len() * columns.len()), Some(25));
        assert_eq!(picture.worst_place(0.01, 3, amplitude), None);
    }

    #[test]
    fn a_gap_is_not_noise_and_a_picture_without_tiles_has_none() {
        let mut tiles = divided((64, 32), 32, |_, _| 2.0);
        tiles[0].blocks.clear();
        let picture = PictureContrast::new(&tiles);
        assert_eq!(picture.around(0, 0, 7).square, 0.0);
        assert!((picture.around(0, 8, 7).square - 2.0).abs() < 1e-6);
        assert_eq!(PictureContrast::new(&[]).around(0, 0, 7), WindowContrast::default());
    }
}
