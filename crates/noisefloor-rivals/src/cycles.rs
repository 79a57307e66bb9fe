//! Adaptive sampling as in Blender Cycles.

use crate::pixels::{DEFAULT_SHARE, Seen, enough, half_difference, need_of_share, verdict};
use noisefloor::{CriterionError, Film, Needs, StoppingCriterion, Tile, TileGrid, Verdict, View};
use rayon::prelude::*;

/// Default of [`CyclesAdaptive::threshold`]: Blender's.
pub const DEFAULT_THRESHOLD: f64 = 0.01;
/// Smallest automatic threshold.
const LEAST_AUTOMATIC: f64 = 0.001;
/// Keeps black pixels from dividing by zero.
const EPSILON: f64 = 1e-4;

/// The condition of Blender Cycles (`film/adaptive_sampling.h` and `scene/integrator.cpp` of Blender 4).
///
/// The error of a pixel is Σ|I − A|/(10⁻⁴ + n) over its channels, all exposed: I is the mean of all samples, A that of one half,
/// and n is √ΣI where ΣI is below 1 and ΣI above. A pixel below `threshold` has converged and is not looked at again, unless one
/// of its eight neighbours has not: that takes it back. None converges before [`CyclesAdaptive::min_samples`].
///
/// A tile is done when a `share` of its pixels has converged. Tiles that are done count as converged for their neighbours.
#[derive(Clone, Debug)]
pub struct CyclesAdaptive {
    /// Error below which a pixel has converged, above 0.
    pub threshold: f64,
    /// Share of a tile's pixels that have to converge, in (0, 1].
    pub share: f64,
    seen: Seen,
    /// Whether each pixel of the image has converged.
    converged: Vec<bool>,
}

impl CyclesAdaptive {
    /// The condition with its own constant, and 95 % of a tile's pixels.
    pub fn new(threshold: f64) -> Self {
        Self { threshold, share: DEFAULT_SHARE, seen: Seen::default(), converged: Vec::new() }
    }

    /// The threshold that Cycles chooses itself for renders of at most `max_samples`: 1/`max_samples`, at least 0.001.
    pub fn automatic(max_samples: u64) -> Self {
        Self::new((1.0 / max_samples.max(1) as f64).max(LEAST_AUTOMATIC))
    }

    /// Samples per pixel before which no pixel converges, as Cycles chooses them itself: 16/threshold^0.3, rounded up, at least
    /// 4. That is 32 for a threshold of 0.1, 64 for 0.01 and 128 for 0.001.
    pub fn min_samples(&self) -> u64 {
        ((16.0 / self.threshold.powf(0.3)).ceil() as u64).max(4)
    }
}

impl Default for CyclesAdaptive {
    fn default() -> Self {
        Self::new(DEFAULT_THRESHOLD)
    }
}

/// Error of one pixel; infinite where a half has no valid sample.
fn error(film: &Film, exposure: f64, tile: usize, pixel: usize) -> f64 {
    half_difference(film, tile, pixel, exposure).map_or(f64::INFINITY, |(difference, intensity)| {
        let intensity = intensity.max(0.0);
        difference / (EPSILON + if intensity < 1.0 { intensity.sqrt() } else { intensity })
    })
}

/// Takes the neighbours of active pixels back, within the tiles named.
fn dilate(converged: &mut [bool], grid: TileGrid, tiles: &[Tile]) {
    let mut named = vec![false; grid.len()];
    tiles.iter().for_each(|t| named[t.index] = true);
    let before = converged.to_vec();
    let (width, height) = (grid.width(), grid.height());
    let active = |x: usize, y: usize| !before[y * width + x] && named[grid.index_at(x, y)];
    for tile in tiles {
        for y in tile.y..tile.y + tile.height {
            for x in tile.x..tile.x + tile.width {
                let rows = y.saturating_sub(1)..=(y + 1).min(height - 1);
                let columns = x.saturating_sub(1)..=(x + 1).min(width - 1);
                if rows.flat_map(|v| columns.clone().map(move |u| (u, v))).any(|(u, v)| active(u, v)) {
                    converged[y * width + x] = false;
                }
            }
        }
    }
}

impl StoppingCriterion for CyclesAdaptive {
    fn name(&self) -> String {
        format!("Cycles, threshold {}", self.threshold)
    }

    fn needs(&self) -> Needs {
        Needs { halves: true, reference: false }
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let (film, grid) = (view.film, view.film.grid());
        if self.seen.renew(film) {
            self.converged = vec![false; grid.width() * grid.height()];
        }
        let (least, exposure) = (self.min_samples(), f64::from(view.display.exposure()));
        let tiles_errors: Vec<Vec<f64>> = tiles
            .par_iter()
            .map(|t| t.rows(grid.width()).flatten().map(|p| error(film, exposure, t.index, p)).collect())
            .collect();
        for (tile, errors) in tiles.iter().zip(&tiles_errors) {
            let ripe = film.samples(tile.index) >= least;
            for (pixel, &error) in tile.rows(grid.width()).flatten().zip(errors) {
                self.converged[pixel] |= ripe && error < self.threshold;
            }
        }
        dilate(&mut self.converged, grid, tiles);

        let judge = |(tile, errors): (&Tile, Vec<f64>)| {
            let samples = film.samples(tile.index);
            let passed = tile.rows(grid.width()).flatten().filter(|&p| self.converged[p]).count();
            if enough(passed, tile.pixels(), self.share) {
                return verdict(true, Some(samples));
            }
            // The error of a pixel falls as 1/√n.
            let need = |e: f64| samples as f64 * (e / self.threshold).powi(2);
            let expected = need_of_share(errors.into_iter().map(need).collect(), self.share);
            verdict(false, expected.map(|n| n.max(least)))
        };
        Ok(tiles.iter().zip(tiles_errors).map(judge).collect())
    }
}
