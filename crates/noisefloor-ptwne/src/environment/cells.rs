//! The environment map in coarse cells, for the reference's guide.

use super::map::Map;
use crate::math::Vec3;

/// Most columns and rows of [`Cells`].
const MAX_COARSE: [usize; 2] = [32, 16];

/// The environment map in coarse cells, which can be chosen with other probabilities than their brightness.
/// Within one, directions are sampled by brightness: one number chooses the row and the other the column, so
/// that stratified numbers give stratified directions.
#[derive(Debug)]
pub(crate) struct Cells<'a> {
    map: &'a Map,
    columns: usize,
    /// Probability of each cell by its brightness, row-major.
    pub(crate) pmf: Vec<f32>,
}

impl<'a> Cells<'a> {
    pub(crate) fn new(map: &'a Map) -> Self {
        let [columns, rows]: [usize; 2] = std::array::from_fn(|k| map.cells[k].min(MAX_COARSE[k]));
        let mut cells = Self { map, columns, pmf: vec![0.0; columns * rows] };
        cells.pmf = (0..columns * rows).map(|i| cells.rows(i).map(|y| cells.row_pmf(i, y)).sum()).collect();
        cells
    }

    /// The rows of the map's own grid in cell `index`.
    fn rows(&self, index: usize) -> std::ops::Range<usize> {
        let n = self.pmf.len() / self.columns;
        let (i, of) = (index / self.columns, self.map.cells[1]);
        i * of / n..(i + 1) * of / n
    }

    fn columns(&self, index: usize) -> std::ops::Range<usize> {
        let (i, of) = (index % self.columns, self.map.cells[0]);
        i * of / self.columns..(i + 1) * of / self.columns
    }

    fn row_pmf(&self, index: usize, row: usize) -> f32 {
        self.columns(index).map(|x| self.map.pmf[row * self.map.cells[0] + x]).sum()
    }

    /// The cell that `dir` lies in.
    pub(crate) fn cell(&self, dir: Vec3) -> usize {
        let [u, v, _] = self.map.uv(dir);
        let fine = |x: f32, n: usize| ((x * n as f32) as usize).min(n - 1);
        let [columns, rows] = self.map.cells;
        let n = self.pmf.len() / self.columns;
        // The last coarse cell that begins no later
        let coarse = |i: usize, n: usize, of: usize| ((i + 1) * n - 1) / of;
        coarse(fine(v, rows), n, rows) * self.columns + coarse(fine(u, columns), self.columns, columns)
    }

    /// A direction within a cell, and its density per solid angle given the cell.
    pub(crate) fn sample(&self, index: usize, u: [f32; 2]) -> Option<(Vec3, f32)> {
        let (row, v) = pick(self.rows(index), self.pmf[index] * u[0], |y| self.row_pmf(index, y))?;
        let at = |x: usize| self.map.pmf[row * self.map.cells[0] + x];
        let (column, u) = pick(self.columns(index), self.row_pmf(index, row) * u[1], at)?;
        let (dir, pdf) = self.map.direction(row * self.map.cells[0] + column, [u, v]);
        Some((dir, pdf / self.pmf[index]))
    }
}

/// Inverts the sum of probabilities over `range`: the first index at which it exceeds `u`, and where `u` lies
/// within that index's own probability, 0…1.
fn pick(range: std::ops::Range<usize>, mut u: f32, pmf: impl Fn(usize) -> f32) -> Option<(usize, f32)> {
    let mut last = None;
    for (i, p) in range.map(|i| (i, pmf(i))).filter(|(_, p)| *p > 0.0) {
        if u < p {
            return Some((i, u / p));
        }
        u -= p;
        // Rounding may exceed the sum
        last = Some((i, 1.0 - f32::EPSILON));
    }
    last
}
