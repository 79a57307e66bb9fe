//! A rectangle of numbers, one a pixel.

use crate::tile::Tile;
use std::ops::{Index, IndexMut};

/// Numbers of the pixels of a rectangle, row by row; places in it are (row, column).
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    columns: usize,
    values: Vec<f32>,
}

impl Plane {
    /// Takes the numbers row by row.
    ///
    /// # Panics
    /// If there are not rows × columns of them.
    pub fn new((rows, columns): (usize, usize), values: Vec<f32>) -> Self {
        assert_eq!(values.len(), rows * columns, "one number a pixel");
        Self { columns, values }
    }

    /// The same number everywhere.
    pub fn filled((rows, columns): (usize, usize), value: f32) -> Self {
        Self { columns, values: vec![value; rows * columns] }
    }

    /// The number of each place, asked for row by row.
    pub fn from_fn((rows, columns): (usize, usize), mut value: impl FnMut((usize, usize)) -> f32) -> Self {
        let mut values = Vec::with_capacity(rows * columns);
        for y in 0..rows {
            values.extend((0..columns).map(|x| value((y, x))));
        }
        Self { columns, values }
    }

    /// Rows and columns.
    pub fn size(&self) -> (usize, usize) {
        (self.values.len().checked_div(self.columns).unwrap_or(0), self.columns)
    }

    /// All numbers, row by row.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// All numbers, row by row.
    pub fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }

    /// All numbers, row by row.
    pub fn into_values(self) -> Vec<f32> {
        self.values
    }

    /// The numbers of one row.
    pub fn row(&self, y: usize) -> &[f32] {
        &self.values[y * self.columns..][..self.columns]
    }

    /// Sums over the pixels of a tile of what `of` makes of each number, eight at a time: one after the other, each
    /// addition would wait for the one before.
    #[inline]
    pub(crate) fn sums_inside<const N: usize>(&self, tile: Tile, of: impl Fn(f64) -> [f64; N]) -> [f64; N] {
        const LANES: usize = 8;
        let mut lanes = [[0.0; LANES]; N];
        let mut sums = [0.0; N];
        for y in tile.y..tile.y + tile.height {
            let (groups, rest) = self.row(y)[tile.x..][..tile.width].as_chunks::<LANES>();
            for group in groups {
                for (lane, &value) in group.iter().enumerate() {
                    for (lanes, term) in lanes.iter_mut().zip(of(f64::from(value))) {
                        lanes[lane] += term;
                    }
                }
            }
            for &value in rest {
                sums.iter_mut().zip(of(f64::from(value))).for_each(|(sum, term)| *sum += term);
            }
        }
        sums.iter_mut().zip(lanes).for_each(|(sum, lanes)| *sum += lanes.iter().sum::<f64>());
        sums
    }

    /// The numbers of a tile of the plane, row by row.
    pub fn inside(&self, tile: Tile) -> impl Iterator<Item = f32> + Clone {
        (tile.y..tile.y + tile.height).flat_map(move |y| self.row(y)[tile.x..][..tile.width].iter().copied())
    }
}

impl Index<(usize, usize)> for Plane {
    type Output = f32;

    #[inline]
    fn index(&self, (y, x): (usize, usize)) -> &f32 {
        &self.row(y)[x]
    }
}

impl IndexMut<(usize, usize)> for Plane {
    #[inline]
    fn index_mut(&mut self, (y, x): (usize, usize)) -> &mut f32 {
        &mut self.values[y * self.columns..][..self.columns][x]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_rows_and_columns() {
        let mut plane = Plane::from_fn((2, 3), |(y, x)| (10 * y + x) as f32);
        assert_eq!((plane.size(), plane.values()), ((2, 3), &[0.0, 1.0, 2.0, 10.0, 11.0, 12.0][..]));
        plane[(1, 2)] = 5.0;
        assert_eq!((plane[(1, 2)], plane.row(1)), (5.0, &[10.0, 11.0, 5.0][..]));
        let tile = Tile { index: 0, x: 1, y: 0, width: 2, height: 2 };
        assert_eq!(plane.inside(tile).collect::<Vec<_>>(), [1.0, 2.0, 11.0, 5.0]);
        assert_eq!(Plane::filled((0, 0), 1.0).size(), (0, 0));
    }
}
