//! Planes split by scale, and local means.

use rayon::prelude::*;
use std::ops::Range;

/// A plane of values, row-major, with its width and height.
#[derive(Clone, Debug)]
pub(crate) struct Plane {
    pub(crate) size: (usize, usize),
    pub(crate) values: Vec<f32>,
}

/// The B₃ spline of the "à trous" transform (Starck & Murtagh 2006, §A.2), from its middle.
const SPLINE: [f32; 3] = [6.0 / 16.0, 4.0 / 16.0, 1.0 / 16.0];

impl Plane {
    pub(crate) fn new(size: (usize, usize), values: Vec<f32>) -> Self {
        debug_assert_eq!(values.len(), size.0 * size.1);
        Self { size, values }
    }

    /// Splits off what is finer than `2^(level + 1)` pixels; what is left is the coarser rest. The picture is
    /// mirrored at its edges.
    pub(crate) fn split(&mut self, level: u32) -> Plane {
        let (size, step) = (self.size, 1usize << level);
        let (width, height) = size;
        let mut across = vec![0.0; self.values.len()];
        let rows = across.par_chunks_exact_mut(width).zip(self.values.par_chunks_exact(width));
        rows.for_each(|(out, row)| smooth_row(row, step, out));
        let mut rest = vec![0.0; self.values.len()];
        // What is finer takes the place of the whole
        let rows = rest.par_chunks_exact_mut(width).zip(self.values.par_chunks_exact_mut(width));
        rows.enumerate().for_each(|(y, (rest, fine))| {
            let at = |offset: isize| {
                let from = mirrored(y as isize + offset * step as isize, height) * width;
                &across[from..][..width]
            };
            smooth([0, 1, -1, 2, -2].map(at), rest);
            fine.iter_mut().zip(rest).for_each(|(fine, rest)| *fine -= *rest);
        });
        Plane { size, values: std::mem::replace(&mut self.values, rest) }
    }
}

/// The spline with holes of `step`, along a row.
fn smooth_row(row: &[f32], step: usize, out: &mut [f32]) {
    let (width, reach) = (row.len(), 2 * step);
    let mut edge = |x: usize| {
        let at = |offset: isize| &row[mirrored(x as isize + offset * step as isize, width)..][..1];
        smooth([0, 1, -1, 2, -2].map(at), &mut out[x..=x]);
    };
    (0..reach.min(width)).chain(width.saturating_sub(reach).max(reach)..width).for_each(&mut edge);
    if width > 2 * reach {
        let at = |from: usize| &row[from..][..width - 2 * reach];
        smooth([reach, reach + step, reach - step, 2 * reach, 0].map(at), &mut out[reach..width - reach]);
    }
}

/// The spline of the pixels in its middle, of those to both sides of it, and of those beyond these.
fn smooth([here, after, before, beyond, behind]: [&[f32]; 5], out: &mut [f32]) {
    let n = out.len();
    let (here, after, before) = (&here[..n], &after[..n], &before[..n]);
    let (beyond, behind) = (&beyond[..n], &behind[..n]);
    let [middle, side, end] = SPLINE;
    for i in 0..n {
        out[i] = middle * here[i] + side * after[i] + side * before[i] + end * beyond[i] + end * behind[i];
    }
}

/// Columns that one thread adds up.
const STRIP: usize = 128;

/// Means of several values, in strips of columns.
pub(crate) struct LocalMeans<const N: usize> {
    width: usize,
    strips: Vec<Vec<[f32; N]>>,
}

impl<const N: usize> LocalMeans<N> {
    /// Of what `of` says of each pixel: the mean over a square of `2·radius + 1` pixels around it, of what of that lies in the
    /// picture.
    pub(crate) fn new(
        (width, height): (usize, usize),
        radius: usize,
        of: impl Fn(usize) -> [f32; N] + Sync,
    ) -> Self {
        // Sums over rows, then over columns of these
        let mut across = vec![[0.0f64; N]; width * height];
        across.par_chunks_exact_mut(width).enumerate().for_each(|(y, out)| {
            let row: Vec<[f32; N]> = (y * width..(y + 1) * width).map(&of).collect();
            let mut sums = [0.0f64; N];
            let ahead = row[..radius.min(width)].iter();
            ahead.for_each(|values| add(&mut sums, values.map(f64::from)));
            for (x, out) in out.iter_mut().enumerate() {
                if let Some(entering) = row.get(x + radius) {
                    add(&mut sums, entering.map(f64::from));
                }
                if x > radius {
                    add(&mut sums, row[x - radius - 1].map(|value| -f64::from(value)));
                }
                let columns = window(x, radius, width);
                *out = sums.map(|sum| sum / columns);
            }
        });
        // Columns are added up by themselves, a strip of them for each thread
        let starts: Vec<usize> = (0..width).step_by(STRIP).collect();
        let down =
            |&from: &usize| means_down(&across, (width, height), radius, from..(from + STRIP).min(width));
        Self { width, strips: starts.par_iter().map(down).collect() }
    }

    /// Those of a row of the picture.
    pub(crate) fn row(&self, y: usize) -> impl Iterator<Item = &[f32; N]> {
        self.strips.iter().enumerate().flat_map(move |(n, strip)| {
            let columns = STRIP.min(self.width - n * STRIP);
            &strip[y * columns..][..columns]
        })
    }
}

fn add<const N: usize>(sums: &mut [f64; N], values: [f64; N]) {
    sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
}

/// Means along some columns, over `2·radius + 1` rows around each.
fn means_down<const N: usize>(
    across: &[[f64; N]],
    (width, height): (usize, usize),
    radius: usize,
    columns: Range<usize>,
) -> Vec<[f32; N]> {
    let row = |y: usize| &across[y * width..][columns.clone()];
    let mut sums = vec![[0.0f64; N]; columns.len()];
    for y in 0..radius.min(height) {
        sums.iter_mut().zip(row(y)).for_each(|(sums, &values)| add(sums, values));
    }
    let mut means = Vec::with_capacity(columns.len() * height);
    for y in 0..height {
        if y + radius < height {
            sums.iter_mut().zip(row(y + radius)).for_each(|(sums, &values)| add(sums, values));
        }
        if y > radius {
            let leaving = sums.iter_mut().zip(row(y - radius - 1));
            leaving.for_each(|(sums, values)| add(sums, values.map(|value| -value)));
        }
        let rows = window(y, radius, height);
        means.extend(sums.iter().map(|sums| sums.map(|sum| (sum / rows) as f32)));
    }
    means
}

/// How many of the places around `at` exist.
fn window(at: usize, radius: usize, edge: usize) -> f64 {
    ((at + radius).min(edge - 1) - at.saturating_sub(radius) + 1) as f64
}

/// A place of an edge, mirrored at its first and last one.
pub(crate) fn mirrored(place: isize, edge: usize) -> usize {
    let period = (2 * (edge - 1)).max(1);
    let distance = place.unsigned_abs() % period;
    distance.min(period - distance).min(edge - 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use noisefloor_testkit::Noise;

    fn noise(size: (usize, usize)) -> Plane {
        let mut noise = Noise::new(5);
        Plane::new(size, (0..size.0 * size.1).map(|_| noise.normal() as f32).collect())
    }

    #[test]
    fn scales_add_up_to_the_plane() {
        for size in [(40, 23), (1, 7), (3, 2)] {
            let whole = noise(size);
            let mut rest = whole.clone();
            let scales: Vec<Plane> = (0..5).map(|scale| rest.split(scale)).collect();
            for (i, value) in whole.values.iter().enumerate() {
                let sum = rest.values[i] + scales.iter().map(|scale| scale.values[i]).sum::<f32>();
                assert!((sum - value).abs() < 1e-5, "{size:?}: {sum} and {value}");
            }
        }
    }

    /// By the definition, pixel by pixel: what is finer is what the spline in both directions leaves.
    #[test]
    fn what_is_finer_is_what_the_mirrored_spline_leaves() {
        for (size, level) in
            [((40, 23), 0), ((40, 23), 2), ((17, 9), 3), ((1, 7), 1), ((3, 2), 4), ((9, 1), 1)]
        {
            let plane = noise(size);
            let spline = |of: &dyn Fn(isize) -> f64| {
                let weights = [(0, 6.0), (1, 4.0), (-1, 4.0), (2, 1.0), (-2, 1.0)];
                weights.iter().map(|&(at, weight)| weight / 16.0 * of(at * (1 << level))).sum::<f64>()
            };
            let smoothed = |x: usize, y: usize| {
                spline(&|dy| {
                    let row = mirrored(y as isize + dy, size.1) * size.0;
                    spline(&|dx| f64::from(plane.values[row + mirrored(x as isize + dx, size.0)]))
                })
            };
            let fine = plane.clone().split(level);
            for (i, found) in fine.values.iter().enumerate() {
                let expected = f64::from(plane.values[i]) - smoothed(i % size.0, i / size.0);
                assert!(
                    (f64::from(*found) - expected).abs() < 1e-6,
                    "{size:?}, {level}, {i}: {found} {expected}"
                );
            }
        }
    }

    #[test]
    fn a_constant_has_no_details() {
        let mut plane = Plane::new((20, 30), vec![0.7; 600]);
        assert!(plane.split(3).values.iter().all(|v| v.abs() < 1e-6));
        assert!(plane.values.iter().all(|v| (v - 0.7).abs() < 1e-6));
    }

    /// A wave of so many pixels is found in the scale that says so.
    #[test]
    fn details_are_in_their_scale() {
        for (period, scale) in [(3.0, 0), (6.0, 1), (12.0, 2), (24.0, 3)] {
            let wave = |i: usize| ((i % 192) as f32 * std::f32::consts::TAU / period).sin();
            let mut rest = Plane::new((192, 64), (0..192 * 64).map(wave).collect());
            let energy = |plane: Plane| plane.values.iter().map(|v| v * v).sum::<f32>();
            let energies: Vec<f32> = (0..5).map(|scale| energy(rest.split(scale))).collect();
            let most = energies.iter().cloned().fold(0.0, f32::max);
            assert_eq!(energies.iter().position(|&e| e == most), Some(scale), "{period}: {energies:?}");
        }
    }

    #[test]
    fn local_means_are_means_of_what_is_there() {
        for (size, radius) in [((17, 9), 2), ((5, 6), 32), ((40, 1), 3)] {
            let plane = noise(size);
            let means = LocalMeans::new(size, radius, |i| [plane.values[i], -plane.values[i]]);
            let rows = (0..size.1).flat_map(|y| means.row(y));
            for (i, [found, other]) in rows.enumerate() {
                assert_eq!(*other, -found);
                let (x, y) = (i % size.0, i / size.0);
                let near =
                    |j: &usize| (j % size.0).abs_diff(x) <= radius && (j / size.0).abs_diff(y) <= radius;
                let there: Vec<f32> = (0..plane.values.len()).filter(near).map(|j| plane.values[j]).collect();
                let expected = there.iter().sum::<f32>() / there.len() as f32;
                assert!((found - expected).abs() < 1e-5, "{size:?} at {x}, {y}: {found} and {expected}");
            }
        }
    }
}
