//! What a tile is judged by: its display luminance, and what of it is noise.

use crate::display::Display;
use crate::film::Film;
use crate::tile::{Tile, TileGrid};
use ndarray::Array2;
use serde::{Deserialize, Serialize};

/// How far filters may read beyond a tile, in pixels, where neighbours exist.
pub const APRON: usize = 8;

/// What the noisy tile is held against.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Evidence {
    /// The other half buffer: no reference is needed.
    Halves,
    /// A quick ray-traced, noise-free reference (Takouachet et al. 2017, §4.3).
    Reference,
}

/// Display-encoded luminance of a tile and of an apron around it, as far as the image reaches.
#[derive(Clone, Debug, PartialEq)]
pub struct TilePlanes {
    /// What is on the screen, in [0, 1]; shape (rows, columns) with the apron.
    pub image: Array2<f32>,
    /// What of it is noise: `image` minus what it is held against, scaled so that its standard deviation is that of the
    /// noise in `image`. Same shape.
    pub residual: Array2<f32>,
    /// The tile itself within the planes: rows and columns of the planes that belong to it.
    pub inner: Tile,
}

impl TilePlanes {
    /// Collects both planes; `pixel(x, y)` gives luminance and residual at image coordinates.
    pub fn gather(grid: TileGrid, tile: Tile, pixel: impl Fn(usize, usize) -> (f32, f32)) -> Self {
        let (x0, y0) = (tile.x.saturating_sub(APRON), tile.y.saturating_sub(APRON));
        let (x1, y1) = (
            (tile.x + tile.width + APRON).min(grid.width()),
            (tile.y + tile.height + APRON).min(grid.height()),
        );
        let shape = (y1 - y0, x1 - x0);
        let (mut image, mut residual) = (Array2::zeros(shape), Array2::zeros(shape));
        for ((row, column), value) in image.indexed_iter_mut() {
            (*value, residual[(row, column)]) = pixel(x0 + column, y0 + row);
        }
        Self { image, residual, inner: Tile { x: tile.x - x0, y: tile.y - y0, ..tile } }
    }

    /// Evidence from the film's two halves.
    ///
    /// With n_A and n_B samples, Var(A − B) = σ²/n_A + σ²/n_B = σ²·(n_A + n_B)/(n_A·n_B), and the mean of all samples has
    /// σ²/(n_A + n_B); so (A − B)·√(n_A·n_B)/(n_A + n_B) has exactly the noise of the mean, also for uneven halves. The
    /// halves are tone mapped first, since people see display values.
    ///
    /// A pixel of which one half has no valid sample gives no evidence: its residual is 0.
    pub fn from_halves(film: &Film, display: &Display, tile: Tile) -> Self {
        let grid = film.grid();
        Self::gather(grid, tile, |x, y| {
            let (owner, pixel) = (grid.index_at(x, y), y * grid.width() + x);
            let image = display.luma(film.pixel(owner, pixel));
            let [(a, na), (b, nb)] = film.pixel_halves(owner, pixel);
            let (na, nb) = (na as f32, nb as f32);
            let scale = if na > 0.0 && nb > 0.0 { (na / (na + nb) * (nb / (na + nb))).sqrt() } else { 0.0 };
            (image, (display.luma(a) - display.luma(b)) * scale)
        })
    }

    /// Evidence from a noise-free reference: the display luminance of the whole image, row-major.
    ///
    /// # Panics
    /// If `reference` has fewer pixels than the film.
    pub fn from_reference(film: &Film, display: &Display, reference: &[f32], tile: Tile) -> Self {
        let grid = film.grid();
        Self::gather(grid, tile, |x, y| {
            let pixel = y * grid.width() + x;
            let image = display.luma(film.pixel(grid.index_at(x, y), pixel));
            (image, image - reference[pixel])
        })
    }
}

/// How two pictures of one scene were made from samples, for [`residual_scale`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Samples {
    /// No sample is in both.
    Independent,
    /// The smaller set of samples is part of the larger one: two stages of one progressive rendering.
    Nested,
}

/// The factor that turns the difference of two pictures into a residual with the noise of the first one, which has `image`
/// samples per pixel; the other has `other`.
///
/// Independent samples: Var(difference) = σ²(1/image + 1/other); nested ones: σ²·|1/image − 1/other|. The noise of the first
/// picture is σ²/image. `None` if one has no samples or nested ones have the same number: the difference then says nothing.
pub fn residual_scale(image: f64, other: f64, samples: Samples) -> Option<f32> {
    let variance = match samples {
        Samples::Independent => 1.0 / image + 1.0 / other,
        Samples::Nested => (1.0 / image - 1.0 / other).abs(),
    };
    let scale = (1.0 / image / variance).sqrt();
    (image > 0.0 && other > 0.0 && scale.is_finite()).then_some(scale as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A seeded standard normal by the sum of twelve uniforms: variance exactly 1.
    fn noise(state: &mut u64) -> f32 {
        let mut sum = -6.0;
        for _ in 0..12 {
            *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            sum += (*state >> 40) as f32 / (1u64 << 24) as f32;
        }
        sum
    }

    #[test]
    fn residual_has_the_noise_of_the_mean_also_when_halves_are_uneven() {
        let grid = TileGrid::new(64, 64, 64).unwrap();
        for batches in [&[50u32, 50][..], &[10, 90], &[400, 100]] {
            let (mut film, mut state) = (Film::new(grid), 7u64);
            for &n in batches {
                // Mean of n samples of standard deviation 0.1 around 0.5.
                let batch: Vec<_> =
                    (0..4096).map(|_| [0.5 + 0.1 * noise(&mut state) / (n as f32).sqrt(); 3]).collect();
                film.add(0, n, &batch).unwrap();
            }
            let planes = TilePlanes::from_halves(&film, &Display::SRGB, grid.tile(0));
            let mean = planes.image.mean().unwrap();
            let spread = planes.image.mapv(|v| (v - mean).powi(2)).mean().unwrap();
            let residual = planes.residual.mapv(|v| v * v).mean().unwrap();
            // Each variance estimate over 4096 pixels errs by √(2/4096) = 2.2 %; 13 % is 4 σ of their ratio: 1 in 16,000.
            assert!((residual / spread - 1.0).abs() < 0.13, "{batches:?}: {residual} against {spread}");
        }
    }

    #[test]
    fn scale_of_two_pictures() {
        assert_eq!(residual_scale(100.0, 100.0, Samples::Independent), Some(0.5f32.sqrt()));
        assert_eq!(residual_scale(100.0, 100.0, Samples::Nested), None);
        assert_eq!(residual_scale(0.0, 100.0, Samples::Nested), None);
        // 900 samples that contain 100: Var(difference) = σ²(1/100 − 1/900).
        let nested = residual_scale(900.0, 100.0, Samples::Nested).unwrap();
        assert!((nested - (1.0f32 / 900.0 / (1.0 / 100.0 - 1.0 / 900.0)).sqrt()).abs() < 1e-6);
    }

    #[test]
    fn the_apron_ends_at_the_image() {
        let grid = TileGrid::new(100, 40, 32).unwrap();
        let planes = TilePlanes::gather(grid, grid.tile(0), |x, y| (x as f32, y as f32));
        assert_eq!(planes.image.dim(), (40, 40));
        assert_eq!((planes.inner.x, planes.inner.y), (0, 0));
        let planes = TilePlanes::gather(grid, grid.tile(7), |x, y| (x as f32, y as f32));
        assert_eq!(planes.image.dim(), (16, 12)); // rows 24…39, columns 88…99
        assert_eq!((planes.inner.x, planes.inner.y, planes.inner.width), (8, 8, 4));
        assert_eq!((planes.image[(8, 8)], planes.residual[(8, 8)]), (96.0, 32.0));
    }
}
