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
        let step = 1usize << level;
        let across = self.smooth(step, true);
        let rest = across.smooth(step, false);
        let fine = self.values.par_iter().zip(&rest.values).map(|(whole, rest)| whole - rest).collect();
        let size = self.size;
        *self = rest;
        Plane { size, values: fine }
    }

    /// The spline with holes of `step`, along rows or columns.
    fn smooth(&self, step: usize, along_rows: bool) -> Plane {
        let (width, height) = self.size;
        let mut out = vec![0.0; self.values.len()];
        out.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
            for (distance, weight) in SPLINE.iter().enumerate() {
                let signs: &[isize] = if distance == 0 { &[1] } else { &[1, -1] };
                for sign in signs {
                    let offset = sign * (distance * step) as isize;
                    if along_rows {
                        let from = &self.values[y * width..(y + 1) * width];
                        for (x, out) in row.iter_mut().enumerate() {
                            *out += weight * from[mirrored(x as isize + offset, width)];
                        }
                    } else {
                        let from = mirrored(y as isize + offset, height) * width;
                        let from = &self.values[from..from + width];
                        row.iter_mut().zip(from).for_each(|(out, value)| *out += weight * value);
                    }
                }
            }
        });
        Plane { size: self.size, values: out }
    }

    /// The mean over a square of `2·radius + 1` pixels around each pixel, of what of it lies in the picture.
    pub(crate) fn local_mean(&self, radius: usize) -> Plane {
        let width = self.size.0;
        // Sums over rows, then over columns of these
        let mut across = vec![0.0f64; self.values.len()];
        let rows = self.values.par_chunks_exact(width).zip(across.par_chunks_exact_mut(width));
        rows.for_each(|(row, out)| {
            let mut sum: f64 = row[..radius.min(width)].iter().map(|&v| f64::from(v)).sum();
            for (x, out) in out.iter_mut().enumerate() {
                if let Some(&entering) = row.get(x + radius) {
                    sum += f64::from(entering);
                }
                if x > radius {
                    sum -= f64::from(row[x - radius - 1]);
                }
                *out = sum / window(x, radius, width);
            }
        });
        // Columns are added up by themselves, a strip of them for each thread
        let strips: Vec<Vec<f32>> = (0..width)
            .step_by(STRIP)
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|from| means_down(&across, self.size, radius, from..(from + STRIP).min(width)))
            .collect();
        let mut values = vec![0.0; self.values.len()];
        values.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
            for (row, strip) in row.chunks_mut(STRIP).zip(&strips) {
                row.copy_from_slice(&strip[y * row.len()..][..row.len()]);
            }
        });
        Plane { size: self.size, values }
    }
}

/// Columns that one thread adds up.
const STRIP: usize = 128;

/// Means along some columns, over `2·radius + 1` rows around each.
fn means_down(
    across: &[f64],
    (width, height): (usize, usize),
    radius: usize,
    columns: Range<usize>,
) -> Vec<f32> {
    let row = |y: usize| &across[y * width..][columns.clone()];
    let mut sums = vec![0.0f64; columns.len()];
    for y in 0..radius.min(height) {
        sums.iter_mut().zip(row(y)).for_each(|(sum, v)| *sum += v);
    }
    let mut means = Vec::with_capacity(columns.len() * height);
    for y in 0..height {
        if y + radius < height {
            sums.iter_mut().zip(row(y + radius)).for_each(|(sum, v)| *sum += v);
        }
        if y > radius {
            sums.iter_mut().zip(row(y - radius - 1)).for_each(|(sum, v)| *sum -= v);
        }
        let rows = window(y, radius, height);
        means.extend(sums.iter().map(|sum| (sum / rows) as f32));
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
            let mean = plane.local_mean(radius);
            for (i, found) in mean.values.iter().enumerate() {
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
