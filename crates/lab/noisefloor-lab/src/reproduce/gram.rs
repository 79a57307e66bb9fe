//! Distances between long rows, all at once, by a blocked matrix product.

use ndarray::linalg::general_mat_mul;
use ndarray::{Array2, ArrayView2, Axis, s};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Rows in a block of the product.
const BLOCK: usize = 256;
/// Columns that are multiplied at a time: two panels of 256×2,048 numbers are 8 MB a thread.
const PANEL: usize = 2048;
/// Squared distances ‖xᵢ − xⱼ‖² of all pairs of rows, n×n, symmetric, in `f64` whatever the rows are kept in.
/// `on_block(done, all)` is told of progress. The same to the bit whatever the number of threads.
///
/// From ‖x‖² + ‖y‖² − 2x·y of rows less their mean, which keeps cancellation small: within (2d + 16)·u·(‖x‖²
/// + ‖y‖²) for rows of d numbers, u = 2⁻⁵³.
pub(super) fn squared_distances<T: Copy + Into<f64> + Send + Sync>(
    rows: ArrayView2<'_, T>,
    on_block: impl Fn(usize, usize) + Sync,
) -> Array2<f64> {
    let (n, dimensions) = rows.dim();
    if n == 0 {
        return Array2::zeros((0, 0));
    }
    let mean: Vec<f64> = (0..dimensions)
        .into_par_iter()
        .map(|c| rows.column(c).iter().map(|&v| v.into()).sum::<f64>() / n as f64)
        .collect();
    let centred = |row: usize, column: usize| rows[(row, column)].into() - mean[column];
    let norms: Vec<f64> =
        (0..n).into_par_iter().map(|i| (0..dimensions).map(|c| centred(i, c)).map(|v| v * v).sum()).collect();

    // A band of rows at a time, against the bands up to itself; panels and blocks in a fixed order.
    let mut squared = Array2::zeros((n, n));
    let bands: Vec<_> = squared.axis_chunks_iter_mut(Axis(0), BLOCK).enumerate().collect();
    let (all, done) = (bands.len() * (bands.len() + 1) / 2, AtomicUsize::new(0));
    bands.into_par_iter().rev().for_each(|(band, mut squared)| {
        let (first, height) = (band * BLOCK, squared.nrows());
        let mut products = Array2::<f64>::zeros((height, first + height));
        for left in (0..dimensions).step_by(PANEL) {
            let width = PANEL.min(dimensions - left);
            let panel = |first: usize, rows: usize| {
                Array2::from_shape_fn((rows, width), |(i, c)| centred(first + i, left + c))
            };
            let ours = panel(first, height);
            for other in (0..=first).step_by(BLOCK) {
                let theirs = panel(other, BLOCK.min(n - other));
                let mut target = products.slice_mut(s![.., other..other + theirs.nrows()]);
                general_mat_mul(1.0, &ours, &theirs.t(), 1.0, &mut target);
            }
        }
        for (((i, j), to), product) in
            squared.slice_mut(s![.., ..first + height]).indexed_iter_mut().zip(&products)
        {
            *to = if first + i == j { 0.0 } else { (norms[first + i] + norms[j] - 2.0 * product).max(0.0) };
        }
        on_block(done.fetch_add(band + 1, Ordering::Relaxed) + band + 1, all);
    });
    for i in 0..n {
        for j in i + 1..n {
            squared[(i, j)] = squared[(j, i)];
        }
    }
    squared
}

#[cfg(test)]
mod tests {
    use super::*;
    use noisefloor_testkit::Noise;

    /// Seeded uniform numbers in [−1, 1].
    fn uniform(seed: u64) -> impl FnMut() -> f32 {
        let mut noise = Noise::new(seed);
        move || (2.0 * noise.uniform() - 1.0) as f32
    }

    fn naive(rows: &Array2<f32>) -> Array2<f64> {
        let n = rows.nrows();
        Array2::from_shape_fn((n, n), |(i, j)| {
            rows.row(i).iter().zip(rows.row(j)).map(|(a, b)| (f64::from(*a) - f64::from(*b)).powi(2)).sum()
        })
    }

    /// More rows than a block and more columns than a panel, neither a multiple; far from the origin, so that
    /// the mean matters.
    #[test]
    fn distances_are_those_of_the_definition() {
        let mut next = uniform(3);
        let rows = Array2::from_shape_fn((BLOCK + 45, PANEL + 77), |_| 10.0 + next());
        let (ours, exact) = (squared_distances(rows.view(), |_, _| ()), naive(&rows));
        // Rows less their mean have squares below 4 each; the definition itself rounds d additions of its
        // result.
        let d = rows.ncols() as f64;
        let bound = (2.0 * d + 16.0) * 0.5 * f64::EPSILON * 8.0 * d + d * 0.5 * f64::EPSILON * 4.0 * d;
        assert!(ours.iter().zip(&exact).all(|(a, b)| (a - b).abs() <= bound));
        assert!((0..rows.nrows()).all(|i| ours[(i, i)] == 0.0));
        assert_eq!(ours, ours.t());
    }

    #[test]
    fn known_distances() {
        let rows = ndarray::array![[0.0f32, 0.0], [3.0, 4.0], [3.0, 0.0]];
        let squared = squared_distances(rows.view(), |done, all| assert_eq!((done, all), (1, 1)));
        let known = ndarray::array![[0.0, 25.0, 9.0], [25.0, 0.0, 16.0], [9.0, 16.0, 0.0]];
        assert!(squared.iter().zip(&known).all(|(a, b)| (a - b).abs() < 1e-13));
    }

    #[test]
    fn threads_do_not_change_a_bit() {
        let mut next = uniform(5);
        let rows = Array2::from_shape_fn((2 * BLOCK + 9, 300), |_| next());
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| squared_distances(rows.view(), |_, _| ()))
        };
        assert_eq!(with(1), with(3));
    }

    #[test]
    fn no_rows_have_no_distances() {
        assert_eq!(squared_distances(Array2::<f32>::zeros((0, 5)).view(), |_, _| ()).dim(), (0, 0));
    }
}
