//! Fourier transforms of planes.

use rayon::prelude::*;
use rustfft::num_complex::Complex32;
use rustfft::{Fft, FftPlanner};
use std::fmt;
use std::sync::Arc;

/// Transforms of planes of one size. Spectra are transposed: row by row of horizontal frequencies.
#[derive(Clone)]
pub(super) struct Fourier {
    pub(super) width: usize,
    pub(super) height: usize,
    rows: [Arc<dyn Fft<f32>>; 2],
    columns: [Arc<dyn Fft<f32>>; 2],
}

impl fmt::Debug for Fourier {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Fourier({}×{})", self.width, self.height)
    }
}

/// The smallest length, at least `least`, without prime factors above 5: its transform is fast.
pub(super) fn quick_length(least: usize) -> usize {
    let rest = |n: usize| {
        [2, 3, 5].into_iter().fold(n, |mut n, p| {
            while n % p == 0 {
                n /= p;
            }
            n
        })
    };
    (least.max(1)..).find(|&n| rest(n) == 1).unwrap_or(least)
}

fn transpose(plane: &[Complex32], width: usize) -> Vec<Complex32> {
    let height = plane.len() / width;
    let mut out = vec![Complex32::default(); plane.len()];
    // Columns in bundles, so that each cache line is read once per bundle
    const BUNDLE: usize = 8;
    out.par_chunks_mut(BUNDLE * height).enumerate().for_each(|(bundle, columns)| {
        for y in 0..height {
            for (i, column) in columns.chunks_exact_mut(height).enumerate() {
                column[y] = plane[y * width + bundle * BUNDLE + i];
            }
        }
    });
    out
}

fn each_row(plane: &mut [Complex32], fft: &dyn Fft<f32>) {
    let scratch = || vec![Complex32::default(); fft.get_inplace_scratch_len()];
    plane
        .par_chunks_mut(fft.len())
        .for_each_init(scratch, |scratch, row| fft.process_with_scratch(row, scratch));
}

impl Fourier {
    pub(super) fn new(width: usize, height: usize) -> Self {
        let mut planner = FftPlanner::new();
        let mut both = |length| [planner.plan_fft_forward(length), planner.plan_fft_inverse(length)];
        Self { width, height, rows: both(width), columns: both(height) }
    }

    /// A row-major plane → its transposed spectrum.
    pub(super) fn forward(&self, mut plane: Vec<Complex32>) -> Vec<Complex32> {
        each_row(&mut plane, &*self.rows[0]);
        let mut spectrum = transpose(&plane, self.width);
        each_row(&mut spectrum, &*self.columns[0]);
        spectrum
    }

    /// A transposed spectrum → its row-major plane, width × height times as large as what
    /// [`Fourier::forward`] was given.
    pub(super) fn inverse(&self, mut spectrum: Vec<Complex32>) -> Vec<Complex32> {
        each_row(&mut spectrum, &*self.columns[1]);
        let mut plane = transpose(&spectrum, self.height);
        each_row(&mut plane, &*self.rows[1]);
        plane
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_quick() {
        assert_eq!([1, 7, 17, 544, 545].map(quick_length), [1, 8, 18, 576, 576]);
    }

    #[test]
    fn there_and_back() {
        let fourier = Fourier::new(20, 12);
        let plane: Vec<Complex32> = (0..240).map(|i| Complex32::new((i * 7 % 31) as f32, 0.0)).collect();
        let back = fourier.inverse(fourier.forward(plane.clone()));
        assert!(plane.iter().zip(&back).all(|(a, b)| (a * 240.0 - b).norm() < 0.01));
    }

    #[test]
    fn a_wave_is_one_frequency() {
        let fourier = Fourier::new(20, 12);
        let wave = |i: usize| {
            (std::f32::consts::TAU * (3.0 * (i % 20) as f32 / 20.0 + 2.0 * (i / 20) as f32 / 12.0)).cos()
        };
        let spectrum = fourier.forward((0..240).map(|i| Complex32::new(wave(i), 0.0)).collect());
        let loud: Vec<usize> = (0..240).filter(|&i| spectrum[i].norm() > 1.0).collect();
        assert_eq!(loud, [3 * 12 + 2, 17 * 12 + 10]);
    }
}
