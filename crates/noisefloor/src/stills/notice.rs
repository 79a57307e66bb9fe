//! What is noticed of two pictures, wherever two pictures are compared.

use super::{BLOCK, CERTAIN, NOTABLE, SnapshotPair, Still, StillError, StillWarning};
use crate::display::{Display, luminance};
use crate::tile::{Tile, TileGrid};
use crate::watch::{ImpossibleLight, PictureValues, check_light};
use rayon::prelude::*;

/// Mean difference of a tile from which it may be unlike, as a share of the display's range.
const UNLIKE: f64 = 0.1;
/// Ratio of brightness worth a warning. Where one picture has few samples, most of its blocks are darker than
/// the mean, since few pixels have found what light is seldom found.
const BRIGHTER: f64 = 1.25;

/// What two pictures say against a verdict on them.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Noticed {
    /// What is likely wrong with them.
    pub warnings: Vec<StillWarning>,
    /// For each tile, whether its brightness differs between the two by more than their noise explains: by a tenth of
    /// the display's range on average, and three times the standard deviation from pixel to pixel. Renderings of one
    /// view have no such tiles, and a verdict on one means nothing.
    pub unlike: Vec<bool>,
}

impl SnapshotPair<'_> {
    /// What the whole pictures say against a verdict on them. Whoever judges two pictures asks first.
    ///
    /// - Light: the mean luminance of a picture is negative.
    /// - Unlike tiles: see [`Noticed::unlike`]. Where all are, nothing can be judged.
    /// - Neighbours: the correlation of the displayed difference with itself one pixel beside or below, within blocks and
    ///   without their means, which a picture of few samples has below the mean.
    /// - Brightness: the mean radiance and the median of blocks both differ, in one direction; a few bright pixels make the
    ///   one, and noise of many dark ones the other.
    /// - Values: all are 8-bit numbers in place of linear radiance, or noise ends at white where nothing is above.
    ///
    /// # Errors
    /// [`StillError::Light`] and [`StillError::Unlike`], [`StillError::Tile`] if the grid is of another picture.
    pub fn notice(&self, grid: TileGrid) -> Result<Noticed, StillError> {
        let [one, other] = &self.pair;
        notice((one, other), &self.display, grid)
    }

    /// [`Noticed::unlike`] alone.
    ///
    /// # Panics
    /// If the grid is larger than the pictures.
    pub fn unlike_tiles(&self, grid: TileGrid) -> Vec<bool> {
        let [one, other] = &self.pair;
        unlike_tiles((one, other), &self.display, grid)
    }

    /// [`Noticed::warnings`] of the pictures as a whole.
    pub fn warnings(&self) -> Vec<StillWarning> {
        let [one, other] = &self.pair;
        warnings(one, other, &self.display)
    }
}

/// The same of any two pictures of one size.
fn notice(
    (image, other): (&Still, &Still),
    display: &Display,
    grid: TileGrid,
) -> Result<Noticed, StillError> {
    if grid.size() != image.size {
        return Err(StillError::Tile { tile: grid.tile(grid.len() - 1), size: image.size });
    }
    for picture in [image, other] {
        check_light(picture.pixels.iter().copied()).map_err(|light| match light {
            ImpossibleLight::Negative { mean } => StillError::Light(mean),
            // `Still::check` finds the first of them
            ImpossibleLight::NotFinite { .. } => StillError::Nothing,
        })?;
    }
    let unlike = unlike_tiles((image, other), display, grid);
    let tiles = unlike.iter().filter(|unlike| **unlike).count();
    if tiles == grid.len() {
        return Err(StillError::Unlike);
    }
    let mut all = warnings(image, other, display);
    if tiles > 0 {
        all.push(StillWarning::Unlike { tiles, of: grid.len() });
    }
    Ok(Noticed { warnings: all, unlike })
}

fn unlike_tiles((image, other): (&Still, &Still), display: &Display, grid: TileGrid) -> Vec<bool> {
    let light = |still: &Still, pixel: usize| luminance(display.encode(still.pixels[pixel]));
    let is_unlike = |tile: &Tile| {
        let rows = tile.rows(image.size.0);
        let differences: Vec<Vec<f32>> =
            rows.map(|row| row.map(|p| light(image, p) - light(other, p)).collect()).collect();
        is_unlike(&differences)
    };
    grid.tiles().collect::<Vec<_>>().par_iter().map(is_unlike).collect()
}

fn warnings(image: &Still, other: &Still, display: &Display) -> Vec<StillWarning> {
    let neighbours = correlation_of_neighbours(image, other, display).map(StillWarning::Neighbours);
    let brightness = ratio_of_brightness(image, other).map(StillWarning::Brightness);
    let mut found: Vec<StillWarning> = neighbours.into_iter().chain(brightness).collect();
    // What a screen shows is of few bits, and ends at white, as it should
    if !image.display_referred {
        let mut values = PictureValues::default();
        for (&a, &b) in image.pixels.iter().zip(&other.pixels) {
            values.see(a, b);
        }
        found.extend(values.quantised().map(StillWarning::Quantised));
        found.extend(values.clipped().map(StillWarning::Clipped));
    }
    found
}

fn correlation_of_neighbours(image: &Still, other: &Still, display: &Display) -> Option<f64> {
    let light = |still: &Still, pixel: usize| f64::from(luminance(display.encode(still.pixels[pixel])));
    const PAIRS: usize = 2 * (BLOCK - 1) * (BLOCK - 1);
    // Displays take most of the time, and blocks need not wait for each other there
    let of_block = |block: Vec<usize>| -> Vec<f64> {
        block.iter().map(|&pixel| light(image, pixel) - light(other, pixel)).collect()
    };
    let all: Vec<Vec<f64>> = blocks(image.size).collect::<Vec<_>>().into_par_iter().map(of_block).collect();
    let (mut sum, mut squares, mut energy) = (0.0, 0.0, 0.0);
    for differences in all {
        let mean = differences.iter().sum::<f64>() / differences.len() as f64;
        let at = |x: usize, y: usize| differences[y * BLOCK + x] - mean;
        for (x, y) in (0..BLOCK - 1).flat_map(|y| (0..BLOCK - 1).map(move |x| (x, y))) {
            for beside in [at(x + 1, y), at(x, y + 1)] {
                let product = at(x, y) * beside;
                (sum, squares) = (sum + product, squares + product * product);
            }
        }
        energy += differences.iter().map(|d| (d - mean) * (d - mean)).sum::<f64>();
    }
    // By Hoeffding's bound, as in `watch`, with care: two pairs share each pixel
    let correlation = sum / PAIRS as f64 / (energy / (BLOCK * BLOCK) as f64);
    (sum.abs() > CERTAIN * (2.0 * squares).sqrt() && correlation.abs() > NOTABLE).then_some(correlation)
}

/// Whether rows of differences have a mean that their changes from pixel to pixel do not explain.
fn is_unlike(differences: &[Vec<f32>]) -> bool {
    let count: usize = differences.iter().map(Vec::len).sum();
    let mean = differences.iter().flatten().map(|&d| f64::from(d)).sum::<f64>() / count.max(1) as f64;
    let beside = differences.iter().flat_map(|row| row.windows(2)).map(|pair| pair[1] - pair[0]);
    let below = differences.windows(2).flat_map(|rows| rows[0].iter().zip(&rows[1])).map(|(a, b)| b - a);
    let steps: Vec<f64> = beside.chain(below).map(|step| f64::from(step).powi(2)).collect();
    // Of two independent pixels, the difference has twice the variance of one
    let variance = steps.iter().sum::<f64>() / (2 * steps.len().max(1)) as f64;
    !steps.is_empty() && mean.abs() > UNLIKE && mean.abs() > 3.0 * variance.sqrt()
}

/// The pixels of each whole block, row by row.
fn blocks((width, height): (usize, usize)) -> impl Iterator<Item = Vec<usize>> {
    let corners =
        (0..height / BLOCK).flat_map(move |y| (0..width / BLOCK).map(move |x| (x * BLOCK, y * BLOCK)));
    corners.map(move |(x, y)| (0..BLOCK * BLOCK).map(|i| (y + i / BLOCK) * width + x + i % BLOCK).collect())
}

/// How many times as bright one picture is as the other, if that is neither chance nor a few pixels.
fn ratio_of_brightness(one: &Still, other: &Still) -> Option<f64> {
    let light = |still: &Still, pixel: usize| f64::from(luminance(still.pixels[pixel]));
    let (mut sums, mut squares, mut ratios) = ([0.0; 2], 0.0, Vec::new());
    for block in blocks(one.size) {
        let sum = |still: &Still| block.iter().map(|&pixel| light(still, pixel)).sum::<f64>();
        let (a, b) = (sum(one), sum(other));
        squares += block.iter().map(|&p| (light(one, p) - light(other, p)).powi(2)).sum::<f64>();
        (sums[0], sums[1]) = (sums[0] + a, sums[1] + b);
        // Black in both says nothing
        ratios.extend((a > 0.0 || b > 0.0).then_some(a / b));
    }
    ratios.sort_by(f64::total_cmp);
    let (mean, median) = (sums[0] / sums[1], *ratios.get(ratios.len() / 2)?);
    let differs =
        (mean > BRIGHTER && median > BRIGHTER) || (mean < 1.0 / BRIGHTER && median < 1.0 / BRIGHTER);
    ((sums[0] - sums[1]).abs() > CERTAIN * squares.sqrt() && differs).then_some(mean)
}
