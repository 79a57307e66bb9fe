//! Adaptive sampling as in Blender Cycles.

use crate::pixels::{DEFAULT_SHARE, enough, half_difference, need_of_share, verdict};
use noisefloor::{
    Film, StoppingCriterion, Tile, TileGrid, Verdict,
    criterion::{CriterionError, Needs, View},
};
use rayon::prelude::*;

/// Default of [`CyclesAdaptive::threshold`]: Blender's.
pub(crate) const DEFAULT_THRESHOLD: f64 = 0.01;
/// Keeps black pixels from dividing by zero.
const EPSILON: f64 = 1e-4;

/// The criterion of Blender Cycles (`film/adaptive_sampling.h` and `scene/integrator.cpp` of Blender 4).
///
/// The error of a pixel is Σ|I − A|/(10⁻⁴ + n) over its channels, with exposure applied: I is the mean of all
/// samples, A that of half of them; n is √ΣI if ΣI < 1, otherwise ΣI. A pixel with an error below `threshold` has
/// converged for good, unless one of its eight neighbours has not. No pixel converges before
/// [`CyclesAdaptive::min_spp`].
///
/// A tile is done when a `share` of its pixels has converged. Finished tiles count as converged for their
/// neighbours.
#[derive(Clone, Debug)]
pub struct CyclesAdaptive {
    /// Error below which a pixel has converged, above 0; 0.01 by default, as in Blender. 0.08 agrees with
    /// people on average (`noisefloor-lab evaluate --rivals`).
    pub threshold: f64,
    /// Share of a tile's pixels that must converge, in (0, 1]; 0.95 by default.
    pub share: f64,
    /// Whether each pixel of the image has converged.
    converged: Vec<bool>,
}

impl CyclesAdaptive {
    /// The criterion with this constant, and 95 % of a tile's pixels.
    pub fn new(threshold: f64) -> Self {
        Self { threshold, share: DEFAULT_SHARE, converged: Vec::new() }
    }

    /// Samples per pixel before which no pixel converges, as Cycles chooses them: 16/threshold^0.3, rounded
    /// up, at least
    /// 4. That is 32 for a threshold of 0.1, 64 for 0.01 and 128 for 0.001.
    pub fn min_spp(&self) -> u64 {
        ((16.0 / self.threshold.powf(0.3)).ceil() as u64).max(4)
    }
}

/// Error of one pixel; infinite where a half has no valid sample.
fn error(film: &Film, exposure: f64, tile: usize, pixel: usize) -> f64 {
    half_difference(film, tile, pixel, exposure).map_or(f64::INFINITY, |(difference, intensity)| {
        let intensity = intensity.max(0.0);
        difference / (EPSILON + if intensity < 1.0 { intensity.sqrt() } else { intensity })
    })
}

/// Marks the neighbours of active pixels as active again, within these tiles.
fn dilate(converged: &mut [bool], grid: TileGrid, tiles: &[Tile]) {
    let mut named = vec![false; grid.len()];
    tiles.iter().for_each(|t| named[t.index] = true);
    let before = converged.to_vec();
    let (width, height) = grid.size();
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

    fn fingerprint(&self) -> String {
        format!("{}, share {}", self.name(), self.share)
    }

    fn begin(&mut self, grid: TileGrid) {
        self.converged = vec![false; grid.width() * grid.height()];
    }

    fn needs(&self) -> Needs {
        Needs::HALVES
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let (film, grid) = (view.film, view.film.grid());
        if self.converged.len() != grid.width() * grid.height() {
            self.begin(grid);
        }
        let (least, exposure) = (self.min_spp(), f64::from(view.display.exposure()));
        let tiles_errors: Vec<Vec<f64>> = tiles
            .par_iter()
            .map(|t| t.rows(grid.width()).flatten().map(|p| error(film, exposure, t.index, p)).collect())
            .collect();
        for (tile, errors) in tiles.iter().zip(&tiles_errors) {
            let ripe = film.spp(tile.index) >= least;
            for (pixel, &error) in tile.rows(grid.width()).flatten().zip(errors) {
                self.converged[pixel] |= ripe && error < self.threshold;
            }
        }
        dilate(&mut self.converged, grid, tiles);

        let judge = |(tile, errors): (&Tile, Vec<f64>)| {
            let samples = film.spp(tile.index);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{constant, empty, expose, view};
    use noisefloor::Rgb;
    use noisefloor_testkit::Noise;

    fn all(film: &Film) -> Vec<Tile> {
        film.grid().tiles().collect()
    }

    #[test]
    fn the_error_of_known_halves() {
        for (a, b, expected) in [
            (0.4f32, 0.6f32, 0.3 / (1e-4 + 1.5)),
            (0.04, 0.06, 0.03 / (1e-4 + 0.15f64.sqrt())),
            (0.0, 0.0, 0.0),
        ] {
            let mut film = empty();
            for value in [a, b] {
                film.add(0, 50, &[[value; 3]; 1024]).unwrap();
            }
            assert!((error(&film, 1.0, 0, 0) - expected).abs() < 1e-6);
            assert_eq!(error(&film, 1.0, 1, 32), f64::INFINITY, "no samples, no evidence");
        }
    }

    #[test]
    fn fewest_samples_are_those_of_cycles() {
        let least = [0.1, 0.01, 0.001].map(|t| CyclesAdaptive::new(t).min_spp());
        assert_eq!(least, [32, 64, 128]);
    }

    /// A film of grey but for one pixel, at (32, 10), on the border of tiles 0 and 1.
    fn speck(value: f32) -> Film {
        let mut film = constant(0.2, 100);
        for value in [0.0, value] {
            let mut batch: Vec<Rgb> = vec![[0.2; 3]; 1024];
            batch[10 * 32] = [value; 3];
            film.add(1, 50, &batch).unwrap();
        }
        film
    }

    #[test]
    fn an_active_pixel_keeps_its_neighbours() {
        let film = speck(0.5);
        let mut cycles = CyclesAdaptive { share: 1.0, ..CyclesAdaptive::new(DEFAULT_THRESHOLD) };
        let verdicts = cycles.judge(&view(&film), &all(&film)).unwrap();
        let active: Vec<usize> = (0..64 * 64).filter(|&p| !cycles.converged[p]).collect();
        let expected: Vec<usize> = (9..12).flat_map(|y| (31..34).map(move |x| y * 64 + x)).collect();
        assert_eq!(active, expected);
        assert_eq!(verdicts.iter().map(|v| v.converged).collect::<Vec<_>>(), [false, false, true, true]);

        // Where its tile is not looked at, it keeps nobody.
        let mut cycles = CyclesAdaptive { share: 1.0, ..CyclesAdaptive::new(DEFAULT_THRESHOLD) };
        assert!(cycles.judge(&view(&film), &[film.grid().tile(0)]).unwrap()[0].converged);
    }

    #[test]
    fn what_has_converged_stays_so() {
        let mut film = constant(0.2, 100);
        let mut cycles = CyclesAdaptive { share: 1.0, ..CyclesAdaptive::new(DEFAULT_THRESHOLD) };
        assert!(cycles.judge(&view(&film), &all(&film)).unwrap().iter().all(|v| v.converged));
        for value in [0.1, 0.9] {
            film.add(0, 50, &[[value; 3]; 1024]).unwrap();
        }
        assert!(cycles.judge(&view(&film), &all(&film)).unwrap()[0].converged);
        // And nothing does before its time.
        let early = constant(0.2, 62);
        cycles.begin(early.grid());
        assert!(!cycles.judge(&view(&early), &all(&early)).unwrap()[0].converged);
    }

    #[test]
    fn as_many_pixels_converge_as_mathematics_says() {
        // 3·|I − A| has a deviation of 3σ/√n: at 2.5 of them, p = 0.98758 of the pixels are below, and p⁹
        // stay so beside their neighbours. 51 ± 7 are above, and take 9 each: a share of 1.6 % is one
        // deviation; three of those.
        let (mean, sigma, n) = (0.1f64, 0.05, 100.0f64);
        let threshold = 2.5 * 3.0 * sigma / n.sqrt() / (EPSILON + (3.0 * mean).sqrt());
        let (mut film, mut noise) = (empty(), Noise::new(5));
        for _ in 0..2 {
            expose(&mut film, 50, mean, sigma, &mut noise);
        }
        let mut cycles = CyclesAdaptive::new(threshold);
        cycles.judge(&view(&film), &all(&film)).unwrap();
        let share = cycles.converged.iter().filter(|&&c| c).count() as f64 / 4096.0;
        assert!((share - 0.987_58f64.powi(9)).abs() < 0.048, "{share}");
    }
}
