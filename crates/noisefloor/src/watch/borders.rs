//! Whether tiles fit together at their borders.

use super::points::level;
use crate::display::luminance;
use crate::film::Film;
use crate::tile::{Tile, TileGrid};
use rayon::prelude::*;
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};
use std::fmt;

/// Pixels of a border that are one term.
const BLOCK: usize = 4;
/// Terms without which nothing is said.
const LEAST_BLOCKS: usize = 16;
// No theory says how pictures vary along lines of pixels. In 3,290 looks at 16 scenes in five sizes, rendered
// right, no mix-up left 0.7 or less of the misfit at 2 standard errors or more; of 120 renders with tiles
// mixed up, all four bounds together say so of 103.
/// Standard errors by which borders have to fit better otherwise.
const CLEAR: f64 = 2.0;
/// What is left then of the misfit, at most.
const BETTER: f64 = 0.5;
/// How much worse borders fit than lines of pixels within tiles, at least.
const WORSE: f64 = 1.2;
/// How much of white a pixel of a border varies by, at least, on average.
const ROUGH: f64 = 1e-3;
/// How much of what the picture varies by along the borders it would vary by then, at least: black fits to
/// black.
const ALIKE: f64 = 0.5;

/// How tiles seem to have been mixed up: what they would have to be for their borders to fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[non_exhaustive]
pub enum MixUp {
    /// Rows, of pixels or of tiles, are counted from the bottom.
    UpsideDown,
    /// Columns, of pixels or of tiles, are counted from the right.
    Mirrored,
    /// Both.
    Turned,
    /// Pixels of a tile, or tiles, are counted column by column.
    Transposed,
    /// Each tile is pushed under the number of its neighbour.
    Shifted,
}

impl fmt::Display for MixUp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::UpsideDown => "upside down: are rows, of pixels or of tiles, counted from the bottom?",
            Self::Mirrored => "mirrored: are columns, of pixels or of tiles, counted from the right?",
            Self::Turned => "turned around: do pixels or tiles begin at the bottom right?",
            Self::Transposed => {
                "transposed: are pixels, or tiles, counted column by column instead of row by row?"
            }
            Self::Shifted => {
                "moved by one: are tiles numbered from 1, or pushed under their neighbour's number?"
            }
        })
    }
}

#[derive(Clone, Copy)]
enum Side {
    Top,
    Right,
    Bottom,
    Left,
}

/// A side of a tile.
type Edge = (usize, Side);
/// Two sides that lie beside each other.
type Border = [Edge; 2];

/// The borders between tiles as they lie, and between the same tiles if they had been mixed up; as many of
/// each. Where tiles have moved by one, the borders left of column `torn` do not fit.
fn borders(grid: TileGrid, mix_up: MixUp, torn: usize) -> (Vec<Border>, Vec<Border>) {
    use Side::{Bottom, Left, Right, Top};
    let (columns, rows) = (grid.columns(), grid.rows());
    let at = |column: usize, row: usize| row * columns + column;
    let beside = || (0..rows).flat_map(move |row| (1..columns).map(move |column| (column - 1, column, row)));
    let below = || (1..rows).flat_map(move |row| (0..columns).map(move |column| (column, row - 1, row)));
    let (mut now, mut then) = (Vec::new(), Vec::new());
    let mut see = |is: Border, would_be: Border| {
        now.push(is);
        then.push(would_be);
    };
    // Tiles counted column by column have, in a square grid, the same borders as tiles whose pixels are
    let transposed = mix_up == MixUp::Transposed;
    if transposed || matches!(mix_up, MixUp::UpsideDown | MixUp::Turned) {
        below().for_each(|(column, a, b)| {
            let (a, b) = (at(column, a), at(column, b));
            let would_be = if transposed { [(a, Right), (b, Left)] } else { [(a, Top), (b, Bottom)] };
            see([(a, Bottom), (b, Top)], would_be);
        });
    }
    if transposed || matches!(mix_up, MixUp::Mirrored | MixUp::Turned) {
        beside().for_each(|(a, b, row)| {
            let (a, b) = (at(a, row), at(b, row));
            let would_be = if transposed { [(a, Bottom), (b, Top)] } else { [(a, Left), (b, Right)] };
            see([(a, Right), (b, Left)], would_be);
        });
    }
    if mix_up == MixUp::Shifted && columns > 1 {
        // A row goes on in the next
        (1..rows).for_each(|row| {
            let is = [(at(torn - 1, row), Right), (at(torn, row), Left)];
            see(is, [(at(columns - 1, row - 1), Right), (at(0, row), Left)]);
        });
    }
    (now, then)
}

/// How much the picture differs along two lines of pixels, and how much it varies along each.
#[derive(Clone, Copy, Default)]
struct Misfit {
    difference: f64,
    size: f64,
}

impl Misfit {
    /// As a share of what varies.
    fn share(self) -> f64 {
        if self.size > 0.0 { self.difference / self.size } else { 0.0 }
    }

    fn add(&mut self, more: Self) {
        self.difference += more.difference;
        self.size += more.size;
    }
}

/// Of blocks of pixels along two lines of one length. What one is brighter by as a whole says nothing: it may
/// be a horizon.
fn misfit(one: &[f64], other: &[f64]) -> Option<Vec<Misfit>> {
    if one.len() != other.len() {
        return None;
    }
    let mean = |line: &[f64]| line.iter().sum::<f64>() / line.len() as f64;
    let (mean_one, mean_other) = (mean(one), mean(other));
    let block = |(one, other): (&[f64], &[f64])| {
        let mut sum = Misfit::default();
        for (p, q) in one.iter().zip(other).map(|(p, q)| (p - mean_one, q - mean_other)) {
            sum.add(Misfit { difference: (p - q).abs(), size: (p.abs() + q.abs()) / 2.0 });
        }
        sum
    };
    Some(one.chunks(BLOCK).zip(other.chunks(BLOCK)).map(block).collect())
}

/// The picture along the four sides of each tile, compressed as a screen shows it, and along the pixels one
/// further in.
struct Sides(Vec<[[Vec<f64>; 2]; 4]>);

impl Sides {
    fn of(film: &Film) -> Self {
        let width = film.grid().width();
        let sides = |tile: Tile| {
            let picture = film.pixels_of(tile.index);
            let light = |x: usize, y: usize| f64::from(luminance(picture((tile.y + y) * width + tile.x + x)));
            let row = |y: usize| (0..tile.width).map(|x| light(x, y)).collect();
            let column = |x: usize| (0..tile.height).map(|y| light(x, y)).collect();
            let (right, bottom) = (tile.width - 1, tile.height - 1);
            [
                [row(0), row(bottom.min(1))],
                [column(right), column(right.saturating_sub(1))],
                [row(bottom), row(bottom.saturating_sub(1))],
                [column(0), column(right.min(1))],
            ]
        };
        let tiles: Vec<Tile> = film.grid().tiles().collect();
        let mut all: Vec<[[Vec<f64>; 2]; 4]> = tiles.into_par_iter().map(sides).collect();
        let typical = level(&all.as_flattened().as_flattened().concat());
        let lines = all.as_flattened_mut().as_flattened_mut();
        lines.par_iter_mut().flatten_iter().for_each(|v| *v = v.max(0.0) / (typical + v.max(0.0)));
        Self(all)
    }

    fn get(&self, (tile, side): Edge) -> Option<&[Vec<f64>; 2]> {
        self.0.get(tile).map(|sides| &sides[side as usize])
    }

    /// What would be left of the misfit if tiles were mixed up so; none if that is not much less, or borders
    /// fit now as lines of pixels within tiles do.
    fn improvement(&self, grid: TileGrid, mix_up: MixUp, torn: usize) -> Option<f64> {
        let (mut sum, mut squares, mut blocks) = (0.0, 0.0, 0);
        let [mut now, mut then, mut inside] = [Misfit::default(); 3];
        let (is, would_be) = borders(grid, mix_up, torn);
        for (is, would_be) in is.into_iter().zip(would_be) {
            let [Some(a), Some(b), Some(c), Some(d)] =
                [is[0], is[1], would_be[0], would_be[1]].map(|e| self.get(e))
            else {
                continue;
            };
            let (Some(is), Some(would_be)) = (misfit(&a[0], &b[0]), misfit(&c[0], &d[0])) else { continue };
            for (is, would_be) in is.into_iter().zip(would_be) {
                let term = is.difference - would_be.difference;
                (sum, squares, blocks) = (sum + term, squares + term * term, blocks + 1);
                now.add(is);
                then.add(would_be);
            }
            [a, b]
                .into_iter()
                .filter_map(|[edge, next]| misfit(edge, next))
                .flatten()
                .for_each(|m| inside.add(m));
        }
        let better = sum > CLEAR * f64::sqrt(squares)
            && blocks >= LEAST_BLOCKS
            && now.size > ROUGH * (blocks * BLOCK) as f64
            && now.share() > WORSE * inside.share()
            && then.share() < BETTER * now.share()
            && then.size > ALIKE * now.size;
        better.then_some(then.share() / now.share())
    }
}

/// How the tiles of a picture seem to have been mixed up, if their borders fit much better then.
pub(super) fn mix_up(film: &Film) -> Option<MixUp> {
    use MixUp::{Mirrored, Shifted, Transposed, Turned, UpsideDown};
    if film.grid().len() < 2 || film.grid().tiles().any(|tile| film.spp(tile.index) == 0) {
        return None;
    }
    let (sides, grid) = (Sides::of(film), film.grid());
    let alone = [UpsideDown, Mirrored, Turned, Transposed].map(|mix_up| (mix_up, 1));
    // To the right, or to the left
    let moved = [(Shifted, 1), (Shifted, grid.columns() - 1)];
    let all: Vec<(MixUp, usize)> = alone.into_iter().chain(moved).collect();
    let found = |(mix_up, torn)| Some((mix_up, sides.improvement(grid, mix_up, torn)?));
    let found: Vec<Option<(MixUp, f64)>> = all.into_par_iter().map(found).collect();
    found.into_iter().flatten().min_by(|a, b| a.1.total_cmp(&b.1)).map(|found| found.0)
}
