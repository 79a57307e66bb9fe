//! The hierarchical stopping condition of Dammertz et al. 2010.

use crate::pixels::{half_difference, verdict};
use noisefloor::{
    Film, StoppingCriterion, Tile, TileGrid, Verdict,
    criterion::{CriterionError, Needs, View},
};
use rayon::prelude::*;
use std::ops::Range;

pub(crate) const DEFAULT_STOP: f64 = 0.0046;
/// Default of [`Dammertz::split`] (Dammertz et al. 2010, §2.2).
const DEFAULT_SPLIT: f64 = 256.0;

/// Dammertz, Hanika, Keller, Lensch 2010, "A Hierarchical Automatic Stopping Condition for Monte Carlo Global
/// Illumination".
///
/// The error of a pixel is Σ|I − A|/√ΣI over its channels, where I is the mean of all samples and A that of
/// one half. The error of a block is √(block area/image area) times the mean over its pixels. A block,
/// initially the image, is done if its error is below `stop`. Below `split`·`stop` it is cut in two, across
/// its longer side, where the errors on both sides are most alike. As in the paper, a finished block is never
/// judged again.
///
/// Differences from the paper: blocks are cut along the borders of tiles, since tiles are sampled as a whole;
/// the halves of a cut are judged at once instead of after the next pass, since many passes lie between two
/// verdicts here; radiance is multiplied by the exposure of the display, so that its unit does not matter; a
/// pixel that is black, or negative by a filter or by synthesised noise, has no error.
#[derive(Clone, Debug)]
pub struct Dammertz {
    /// Error below which a block is done, above 0. The default of 0.0046 agrees with people on average
    /// (`noisefloor-lab evaluate --rivals`).
    pub stop: f64,
    /// Error below which a block is cut in two, in units of `stop`, at least 1; 256 by default.
    pub split: f64,
    blocks: Vec<Block>,
    done: Vec<bool>,
}

/// A rectangle of tiles that is not done.
#[derive(Clone, Debug)]
struct Block {
    columns: Range<usize>,
    rows: Range<usize>,
}

/// Sum of the errors of a tile's pixels, and the number of those that have one.
type Errors = (f64, usize);

impl Dammertz {
    /// The criterion with this constant, and cuts below 256 times that.
    pub fn new(stop: f64) -> Self {
        Self { stop, split: DEFAULT_SPLIT, blocks: Vec::new(), done: Vec::new() }
    }

    /// Judges a block and all its parts: records unfinished blocks, and in `expected` the error of the block
    /// of each of their tiles.
    fn refine(&mut self, block: Block, grid: TileGrid, errors: &[Errors], expected: &mut [f64]) {
        let area: usize = block.tiles(grid).map(|t| grid.tile(t).pixels()).sum();
        let error = block_error(&block, grid, errors, area);
        if error < self.stop {
            block.tiles(grid).for_each(|t| self.done[t] = true);
        } else if error < self.split * self.stop && block.tiles(grid).count() > 1 {
            for half in block.cut(grid, errors) {
                self.refine(half, grid, errors, expected);
            }
        } else {
            block.tiles(grid).for_each(|t| expected[t] = error);
            self.blocks.push(block);
        }
    }
}

impl Block {
    fn tiles(&self, grid: TileGrid) -> impl Iterator<Item = usize> {
        let columns = self.columns.clone();
        self.rows.clone().flat_map(move |y| columns.clone().map(move |x| y * grid.columns() + x))
    }

    /// Cuts across the longer side (in pixels), where the errors on either side are most alike; at least two
    /// tiles.
    fn cut(&self, grid: TileGrid, errors: &[Errors]) -> [Self; 2] {
        // The last tile may be longer or shorter than the others
        let pixels = |tiles: &Range<usize>, count: usize, length: usize| {
            let end = if tiles.end == count { length } else { tiles.end * grid.edge() };
            end - tiles.start * grid.edge()
        };
        let wide = self.rows.len() == 1
            || self.columns.len() > 1
                && pixels(&self.columns, grid.columns(), grid.width())
                    >= pixels(&self.rows, grid.rows(), grid.height());
        let at = |place: usize| {
            let (columns, rows) = (self.columns.clone(), self.rows.clone());
            if wide {
                [
                    Self { columns: columns.start..place, rows: rows.clone() },
                    Self { columns: place..columns.end, rows },
                ]
            } else {
                [
                    Self { columns: columns.clone(), rows: rows.start..place },
                    Self { columns, rows: place..rows.end },
                ]
            }
        };
        let sum = |block: &Self| block.tiles(grid).map(|t| errors[t].0).sum::<f64>();
        let side = if wide { &self.columns } else { &self.rows };
        let cuts = (side.start + 1..side.end).map(at);
        let uneven = |[a, b]: &[Self; 2]| (sum(a) - sum(b)).abs();
        cuts.min_by(|a, b| uneven(a).total_cmp(&uneven(b))).expect("a block of two tiles has a place to cut")
    }
}

/// √(block area/image area)·mean error; infinite if no pixel has a known error.
fn block_error(block: &Block, grid: TileGrid, errors: &[Errors], area: usize) -> f64 {
    let (sum, count) = block.tiles(grid).map(|t| errors[t]).fold((0.0, 0), |(s, n), (e, k)| (s + e, n + k));
    if count == 0 {
        return f64::INFINITY;
    }
    (area as f64 / (grid.width() * grid.height()) as f64).sqrt() * sum / count as f64
}

fn tile_errors(film: &Film, exposure: f64, tile: Tile) -> Errors {
    let pixels = tile.rows(film.grid().width()).flatten();
    pixels.filter_map(|p| half_difference(film, tile.index, p, exposure)).fold(
        (0.0, 0),
        |(sum, n), (error, intensity)| {
            (sum + if error > 0.0 && intensity > 0.0 { error / intensity.sqrt() } else { 0.0 }, n + 1)
        },
    )
}

impl StoppingCriterion for Dammertz {
    fn name(&self) -> String {
        format!("Dammertz et al. 2010, stop {}", self.stop)
    }

    fn fingerprint(&self) -> String {
        format!("{}, split {}", self.name(), self.split)
    }

    fn begin(&mut self, grid: TileGrid) {
        self.blocks = vec![Block { columns: 0..grid.columns(), rows: 0..grid.rows() }];
        self.done = vec![false; grid.len()];
    }

    fn needs(&self) -> Needs {
        Needs::HALVES
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let grid = view.film.grid();
        if self.done.len() != grid.len() {
            self.begin(grid);
        }
        let exposure = f64::from(view.display.exposure());
        let done = &self.done;
        let errors: Vec<Errors> = (0..grid.len())
            .into_par_iter()
            .map(|t| if done[t] { (0.0, 0) } else { tile_errors(view.film, exposure, grid.tile(t)) })
            .collect();
        let mut expected = vec![f64::NAN; grid.len()];
        for block in std::mem::take(&mut self.blocks) {
            self.refine(block, grid, &errors, &mut expected);
        }
        let judge = |t: &Tile| {
            let samples = view.film.spp(t.index);
            if self.done[t.index] {
                return verdict(true, Some(samples));
            }
            // The error falls as 1/√n; a cut can only make it fall sooner.
            let need = samples as f64 * (expected[t.index] / self.stop).powi(2);
            verdict(false, need.is_finite().then(|| need.ceil() as u64))
        };
        Ok(tiles.iter().map(judge).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{empty, expose, view};
    use noisefloor_testkit::Noise;

    /// Samples at which each tile is done.
    fn stops(mut criterion: Dammertz, mean: f64, sigma: f64) -> [u64; 4] {
        let (mut film, mut noise) = (empty(), Noise::new(11));
        let mut stops = [0; 4];
        while stops.contains(&0) {
            expose(&mut film, 10, mean, sigma, &mut noise);
            expose(&mut film, 10, mean, sigma, &mut noise);
            let open: Vec<Tile> = film.grid().tiles().filter(|t| stops[t.index] == 0).collect();
            for (tile, verdict) in open.iter().zip(criterion.judge(&view(&film), &open).unwrap()) {
                if verdict.converged {
                    stops[tile.index] = film.spp(tile.index);
                }
            }
        }
        stops
    }

    /// Grey noise: I − A has a deviation of σ/√n for even halves, so that the mean error is
    /// 3·σ·√(2/(πn))/√(3m).
    fn known(mean: f64, sigma: f64, stop: f64) -> f64 {
        (3.0 * sigma * std::f64::consts::FRAC_2_PI.sqrt() / ((3.0 * mean).sqrt() * stop)).powi(2)
    }

    #[test]
    fn an_uncut_image_stops_where_mathematics_says() {
        let (mean, sigma, stop) = (0.5, 0.2, 0.01);
        let whole = stops(Dammertz { split: 1.0, ..Dammertz::new(stop) }, mean, sigma);
        // The mean of 4096 values of |N| errs by 0.756/64 = 1.2 %, n by 2.4 %: three of those, and a step of
        // 20.
        let expected = known(mean, sigma, stop);
        assert!(whole.iter().all(|&n| n == whole[0]));
        assert!((whole[0] as f64 - expected).abs() < 0.071 * expected + 20.0, "{whole:?} {expected}");
    }

    #[test]
    fn tiles_weigh_by_the_root_of_their_area() {
        let (mean, sigma, stop) = (0.5, 0.2, 0.01);
        // A quarter of the area halves the error: a quarter of the samples. 1024 values: 2.4 %, n by 4.7 %;
        // four of those for four tiles.
        let expected = 0.25 * known(mean, sigma, stop);
        for n in stops(Dammertz::new(stop), mean, sigma) {
            assert!((n as f64 - expected).abs() < 0.19 * expected + 20.0, "{n} {expected}");
        }
    }

    #[test]
    fn cuts_are_across_the_longer_side_where_errors_are_even() {
        let grid = TileGrid::new(128, 64, 32).unwrap();
        let errors = [8.0, 1.0, 1.0, 6.0, 0.0, 0.0, 0.0, 0.0].map(|e| (e, 1));
        let [a, b] = Block { columns: 0..4, rows: 0..2 }.cut(grid, &errors);
        assert_eq!((a.columns, a.rows, b.columns), (0..1, 0..2, 1..4));
        let [a, b] = Block { columns: 1..2, rows: 0..2 }.cut(grid, &errors);
        assert_eq!((a.rows, b.rows, b.columns), (0..1, 1..2, 1..2));
    }

    #[test]
    fn the_error_of_known_halves() {
        // A = 0.4, I = 0.5: 3·0.1/√1.5.
        let mut film = empty();
        for value in [0.4, 0.6] {
            film.add(0, 50, &[[value; 3]; 1024]).unwrap();
        }
        let (sum, count) = tile_errors(&film, 1.0, film.grid().tile(0));
        assert!((sum / count as f64 - 0.3 / 1.5f64.sqrt()).abs() < 1e-6);
        // Of pixels that are black or negative as a whole there is no root, and no error, of whatever size
        for half in [-0.6, 0.4] {
            film.add(2, 50, &[[half; 3]; 1024]).unwrap();
        }
        assert_eq!(tile_errors(&film, 1.0, film.grid().tile(2)), (0.0, 1024));
        // A tile without samples gives no evidence, and keeps the image from stopping whole.
        assert_eq!(tile_errors(&film, 1.0, film.grid().tile(1)).1, 0);
    }
}
