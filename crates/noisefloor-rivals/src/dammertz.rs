//! The hierarchical stopping condition of Dammertz et al. 2010.

use crate::pixels::{Seen, half_difference, verdict};
use noisefloor::{CriterionError, Film, Needs, StoppingCriterion, Tile, TileGrid, Verdict, View};
use rayon::prelude::*;
use std::ops::Range;

/// Default of [`Dammertz::stop`].
pub const DEFAULT_STOP: f64 = 0.0002;
/// Default of [`Dammertz::split`] (Dammertz et al. 2010, §2.2).
pub const DEFAULT_SPLIT: f64 = 256.0;

/// Dammertz, Hanika, Keller, Lensch 2010, "A Hierarchical Automatic Stopping Condition for Monte Carlo Global Illumination".
///
/// The error of a pixel is Σ|I − A|/√ΣI over its channels, where I is the mean of all samples and A that of one half. The error
/// of a block is √(block area/image area) times the mean over its pixels. A block, at first the image, is done below `stop`, and
/// is cut in two below `split`·`stop`, across its longer side, where the errors on either side are most alike.
///
/// What differs from the paper: blocks are cut along the borders of tiles and not below a tile, since tiles are what is sampled;
/// the halves of a cut are judged at once, and not after the next pass, since there are many passes between two verdicts here;
/// radiance is exposed as it is displayed, so that the unit of radiance does not matter; a black pixel has no error.
/// Done is done: as in the paper, a block is not looked at again.
#[derive(Clone, Debug)]
pub struct Dammertz {
    /// Error below which a block is done, above 0.
    pub stop: f64,
    /// Error below which a block is cut in two, in units of `stop`, at least 1.
    pub split: f64,
    seen: Seen,
    blocks: Vec<Block>,
    /// Whether each tile is done.
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
    /// The condition with its own constant, and cuts below 256 times that.
    pub fn new(stop: f64) -> Self {
        Self { stop, split: DEFAULT_SPLIT, seen: Seen::default(), blocks: Vec::new(), done: Vec::new() }
    }

    /// Judges a block and all that it is cut into; files what is not done, and returns the error of each tile that is named.
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

impl Default for Dammertz {
    fn default() -> Self {
        Self::new(DEFAULT_STOP)
    }
}

impl Block {
    fn tiles(&self, grid: TileGrid) -> impl Iterator<Item = usize> {
        let columns = self.columns.clone();
        self.rows.clone().flat_map(move |y| columns.clone().map(move |x| y * grid.columns() + x))
    }

    /// Cuts across the longer side (in pixels), where the errors on either side are most alike; at least two tiles.
    fn cut(&self, grid: TileGrid, errors: &[Errors]) -> [Self; 2] {
        let pixels = |tiles: &Range<usize>, edge: usize| (tiles.end * grid.edge()).min(edge) - tiles.start * grid.edge();
        let wide = self.rows.len() == 1
            || self.columns.len() > 1 && pixels(&self.columns, grid.width()) >= pixels(&self.rows, grid.height());
        let at = |place: usize| {
            let (columns, rows) = (self.columns.clone(), self.rows.clone());
            if wide {
                [Self { columns: columns.start..place, rows: rows.clone() }, Self { columns: place..columns.end, rows }]
            } else {
                [Self { columns: columns.clone(), rows: rows.start..place }, Self { columns, rows: place..rows.end }]
            }
        };
        let sum = |block: &Self| block.tiles(grid).map(|t| errors[t].0).sum::<f64>();
        let side = if wide { &self.columns } else { &self.rows };
        let cuts = (side.start + 1..side.end).map(at);
        let uneven = |[a, b]: &[Self; 2]| (sum(a) - sum(b)).abs();
        cuts.min_by(|a, b| uneven(a).total_cmp(&uneven(b))).expect("a block of two tiles has a place to cut")
    }
}

/// √(block area/image area)·mean error; infinite if no pixel has an error to go by.
fn block_error(block: &Block, grid: TileGrid, errors: &[Errors], area: usize) -> f64 {
    let (sum, count) = block.tiles(grid).map(|t| errors[t]).fold((0.0, 0), |(s, n), (e, k)| (s + e, n + k));
    if count == 0 {
        return f64::INFINITY;
    }
    (area as f64 / (grid.width() * grid.height()) as f64).sqrt() * sum / count as f64
}

fn tile_errors(film: &Film, exposure: f64, tile: Tile) -> Errors {
    let pixels = tile.rows(film.grid().width()).flatten();
    pixels.filter_map(|p| half_difference(film, tile.index, p, exposure)).fold((0.0, 0), |(sum, n), (error, intensity)| {
        (sum + if error > 0.0 { error / intensity.max(f64::MIN_POSITIVE).sqrt() } else { 0.0 }, n + 1)
    })
}

impl StoppingCriterion for Dammertz {
    fn name(&self) -> String {
        format!("Dammertz et al. 2010, stop {}", self.stop)
    }

    fn needs(&self) -> Needs {
        Needs { halves: true, reference: false }
    }

    fn judge(&mut self, view: &View<'_>, tiles: &[Tile]) -> Result<Vec<Verdict>, CriterionError> {
        let grid = view.film.grid();
        if self.seen.renew(view.film) {
            self.blocks = vec![Block { columns: 0..grid.columns(), rows: 0..grid.rows() }];
            self.done = vec![false; grid.len()];
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
            let samples = view.film.samples(t.index);
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
