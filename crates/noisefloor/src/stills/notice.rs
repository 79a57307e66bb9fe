//! What is noticed of two pictures, wherever two pictures are compared.

use super::{Noticed, SnapshotPair, Still, StillError, StillWarning};
use crate::display::{Display, luminance};
use crate::tile::{Tile, TileGrid};
use crate::watch::{ImpossibleLight, PictureValues, check_picture};
use rayon::prelude::*;

/// Edge of the blocks in which pictures are compared for [`StillWarning`], in pixels.
const BLOCK: usize = 8;
/// Standard errors that chance does not reach, and the correlation worth a warning: those of
/// [`crate::watch`].
const CERTAIN: f64 = 6.5;
const NOTABLE: f64 = 0.1;
/// Mean difference of a tile from which it may be unlike, as a share of the display's range.
const UNLIKE: f64 = 0.1;
/// Ratio of brightness worth a warning: verdicts take as much for noise. Where one picture has few samples, most of its
/// blocks are darker than the mean, since few pixels have found what light is seldom found, and the mean is not.
const BRIGHTER: f64 = 1.03;

impl SnapshotPair<'_> {
    /// What the whole pictures say against a verdict on them. Whoever judges two pictures asks first.
    ///
    /// - Light: the mean luminance of a picture is negative.
    /// - Unlike tiles: see [`Noticed::unlike`]. Where all are, nothing can be judged.
    /// - Neighbours: the correlation of the displayed difference with itself one pixel beside or below, within blocks and
    ///   without their means, which a picture of few samples has below the mean.
    /// - Brightness: the mean radiance and the median of blocks both differ, in one direction; a few bright pixels make the
    ///   one, and noise of many dark ones the other. Where both pictures have as many samples, blocks alone tell, as noise
    ///   makes either of two darker.
    /// - Values: all are 8-bit numbers in place of linear radiance, or noise ends at white where nothing is above.
    ///
    /// # Errors
    /// [`StillError::Light`] and [`StillError::Unlike`], [`StillError::Tile`] if the grid is of another picture.
    pub fn notice(&self, grid: TileGrid) -> Result<Noticed, StillError> {
        let [one, other] = &self.pair;
        notice([one, other], &self.display, grid)
    }

    /// [`Noticed::unlike`] alone.
    ///
    /// # Panics
    /// If the grid is larger than the pictures.
    pub fn unlike_tiles(&self, grid: TileGrid) -> Vec<bool> {
        let [one, other] = &self.pair;
        Shown::new([one, other], &self.display).unlike_tiles(grid)
    }

    /// [`Noticed::warnings`] of the pictures as a whole.
    pub fn warnings(&self) -> Vec<StillWarning> {
        let [one, other] = &self.pair;
        Shown::new([one, other], &self.display).warnings()
    }
}

/// The same of any two pictures of one size.
fn notice(pictures: [&Still; 2], display: &Display, grid: TileGrid) -> Result<Noticed, StillError> {
    let size = pictures[0].size;
    if grid.size() != size {
        return Err(StillError::Tile { tile: grid.tile(grid.len() - 1), size });
    }
    for picture in pictures {
        check_picture(&picture.pixels).map_err(|light| match light {
            ImpossibleLight::Negative { mean } => StillError::Light(mean),
            // `Still::check` finds the first of them
            ImpossibleLight::NotFinite { .. } => StillError::Nothing,
        })?;
    }
    let shown = Shown::new(pictures, display);
    let unlike = shown.unlike_tiles(grid);
    let tiles = unlike.iter().filter(|unlike| **unlike).count();
    if tiles == grid.len() {
        return Err(StillError::Unlike);
    }
    let mut all = shown.warnings();
    if tiles > 0 {
        all.push(StillWarning::Unlike { tiles, of: grid.len() });
    }
    Ok(Noticed { warnings: all, unlike })
}

/// Two pictures, and the luminance Y′ of their pixels as displayed.
struct Shown<'a> {
    pictures: [&'a Still; 2],
    light: [Vec<f32>; 2],
}

impl<'a> Shown<'a> {
    fn new(pictures: [&'a Still; 2], display: &Display) -> Self {
        let light =
            |still: &Still| still.pixels.par_iter().map(|&pixel| luminance(display.encode(pixel))).collect();
        Self { pictures, light: pictures.map(light) }
    }

    fn unlike_tiles(&self, grid: TileGrid) -> Vec<bool> {
        let [one, other] = &self.light;
        let is_unlike = |tile: &Tile| {
            let rows = tile.rows(grid.width());
            let differences: Vec<Vec<f32>> =
                rows.map(|row| row.map(|pixel| one[pixel] - other[pixel]).collect()).collect();
            is_unlike(&differences)
        };
        grid.tiles().collect::<Vec<_>>().par_iter().map(is_unlike).collect()
    }

    fn warnings(&self) -> Vec<StillWarning> {
        let [one, other] = self.pictures;
        let neighbours = self.correlation_of_neighbours().map(StillWarning::Neighbours);
        let brightness = ratio_of_brightness(one, other).map(StillWarning::Brightness);
        let mut found: Vec<StillWarning> = neighbours.into_iter().chain(brightness).collect();
        // What a screen shows is of few bits, and ends at white, as it should
        if !one.display_referred {
            let values = PictureValues::of([&one.pixels, &other.pixels]);
            found.extend(values.quantised().map(StillWarning::Quantised));
            found.extend(values.clipped().map(StillWarning::Clipped));
        }
        found
    }

    fn correlation_of_neighbours(&self) -> Option<f64> {
        const PAIRS: usize = 2 * (BLOCK - 1) * (BLOCK - 1);
        let [one, other] = &self.light;
        let of_block = |block: Vec<usize>| {
            let differences: Vec<f64> =
                block.iter().map(|&pixel| f64::from(one[pixel]) - f64::from(other[pixel])).collect();
            let mean = differences.iter().sum::<f64>() / differences.len() as f64;
            let at = |x: usize, y: usize| differences[y * BLOCK + x] - mean;
            let (mut sum, mut squares) = (0.0, 0.0);
            for (x, y) in (0..BLOCK - 1).flat_map(|y| (0..BLOCK - 1).map(move |x| (x, y))) {
                for beside in [at(x + 1, y), at(x, y + 1)] {
                    let product = at(x, y) * beside;
                    (sum, squares) = (sum + product, squares + product * product);
                }
            }
            [sum, squares, differences.iter().map(|d| (d - mean) * (d - mean)).sum::<f64>()]
        };
        let all: Vec<[f64; 3]> =
            blocks(self.pictures[0].size).collect::<Vec<_>>().into_par_iter().map(of_block).collect();
        let total = |n: usize| all.iter().map(|block| block[n]).sum::<f64>();
        let [sum, squares, energy] = [0, 1, 2].map(total);
        // By Hoeffding's bound, as in `watch`, with care: two pairs share each pixel
        let correlation = sum / PAIRS as f64 / (energy / (BLOCK * BLOCK) as f64);
        (sum.abs() > CERTAIN * (2.0 * squares).sqrt() && correlation.abs() > NOTABLE).then_some(correlation)
    }
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
    let of_block = |block: Vec<usize>| {
        let sum = |still: &Still| block.iter().map(|&pixel| light(still, pixel)).sum::<f64>();
        let squares = block.iter().map(|&p| (light(one, p) - light(other, p)).powi(2)).sum::<f64>();
        [sum(one), sum(other), squares]
    };
    let all: Vec<[f64; 3]> = blocks(one.size).collect::<Vec<_>>().into_par_iter().map(of_block).collect();
    let total = |n: usize| all.iter().map(|block| block[n]).sum::<f64>();
    let (sums, squares) = ([total(0), total(1)], total(2));
    // Black in both says nothing
    let lit = || all.iter().filter(|[a, b, _]| *a > 0.0 || *b > 0.0);
    let mut ratios: Vec<f64> = lit().map(|[a, b, _]| a / b).collect();
    ratios.sort_by(f64::total_cmp);
    let (mean, median) = (sums[0] / sums[1], *ratios.get(ratios.len() / 2)?);
    let is_brighter = |ratio: f64| !(1.0 / BRIGHTER..=BRIGHTER).contains(&ratio);
    let is_certain = |sum: f64, squares: f64| sum.abs() > CERTAIN * squares.sqrt();
    let alike = is_brighter(mean) && is_brighter(median) && (mean > 1.0) == (median > 1.0);
    if alike && is_certain(sums[0] - sums[1], squares) {
        return Some(mean);
    }
    // Noise of a lamp hides in the sums what all blocks show: exchanging a block's two changes the sign of its term alone
    let terms = lit().map(|[a, b, _]| (a - b) / (a + b));
    let (sum, squares) = terms.fold((0.0, 0.0), |(sum, squares), term| (sum + term, squares + term * term));
    (one.spp == other.spp && is_brighter(median) && is_certain(sum, squares)).then_some(median)
}
