//! The film: batches of every tile, in two independent halves.

use crate::display::exposure::{self, NoisyBlock, NoisyPixel};
use crate::display::{Settled, ToneMapping, luminance};
use crate::rgb::Rgb;
use crate::source::{Request, Sequence};
use crate::tile::{Tile, TileGrid, TilePixels};
use multiversion::multiversion;
use rayon::prelude::*;
use thiserror::Error;

#[cfg(feature = "files")]
pub(crate) mod planes;

/// Samples per pixel that no half of a tile has: sums over the largest picture, of 2²⁸ pixels, stay within 64 bits.
const COUNTABLE: u64 = 1 << 34;

/// One half: a mean for each pixel, with the rounding error of its last bits kept beside it.
///
/// A plain f32 running mean stops changing once a batch weighs less than 2⁻²⁴ of it. `mean + carry·ulp/2¹⁶`
/// is a 40-bit number in 6 bytes: each update then errs by at most 2⁻¹⁷ ulp, and since update j is averaged
/// with weight j/K, K updates err by at most K·2⁻¹⁸ ulp; 10⁹ samples in batches of 100 (K = 10⁷) stay within
/// 39 ulp, 2.4·10⁻⁶ relative, in the worst case, and within 0.02 ulp if roundings are independent.
#[derive(Clone, Debug)]
struct Half {
    mean: Vec<Rgb>,
    carry: Vec<[i16; 3]>,
    /// Rejected samples per pixel; empty until there are any.
    rejected: Vec<u32>,
}

const CARRY: f64 = 65_536.0;

/// Rows of the picture that a thread adds to at once.
const BAND: usize = 16;

/// Distance of neighbouring f32 numbers around `x`; 0 for subnormal `x`.
fn ulp(x: f32) -> f64 {
    f64::from(f32::from_bits(x.to_bits() & 0x7f80_0000)) * f64::from(f32::EPSILON)
}

impl Half {
    fn new(pixels: usize) -> Self {
        Self { mean: vec![[0.0; 3]; pixels], carry: vec![[0; 3]; pixels], rejected: Vec::new() }
    }

    fn rejected(&self, pixel: usize) -> u64 {
        rejected(&self.rejected, pixel)
    }

    fn reject(&mut self, pixel: usize, spp: u64) {
        if self.rejected.is_empty() {
            self.rejected = vec![0; self.mean.len()];
        }
        let spp = u32::try_from(spp).unwrap_or(u32::MAX);
        self.rejected[pixel] = self.rejected[pixel].saturating_add(spp);
    }
}

/// Samples that a pixel lost, by the counts of [`Half::rejected`].
fn rejected(counts: &[u32], pixel: usize) -> u64 {
    counts.get(pixel).map_or(0, |&count| u64::from(count))
}

/// Weight of a batch in the mean of all samples, of which `before` came before it.
fn weight(spp: u64, before: u64) -> f64 {
    spp as f64 / (before + spp) as f64
}

/// Adds means of new samples to numbers of a half, all with one weight.
///
/// Without branches, calls or divisions, so that it becomes vector instructions; the results are those of IEEE 754
/// with any of them.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn add_numbers(mean: &mut [f32], carry: &mut [i16], new: &[f32], weight: f64) {
    /// Adding and subtracting it rounds a small f64 to a whole one, to even at ties; the last bits of the sum are it.
    const WHOLE: f64 = 1.5 * (1u64 << 52) as f64;
    /// Exponent bits of 2¹⁰²³: less those of a power of two, they are its inverse's.
    const INVERSE: u64 = 2046 << 52;
    for ((mean, carry), &value) in mean.iter_mut().zip(carry).zip(new) {
        let old = f64::from(*mean) + f64::from(*carry) * (ulp(*mean) / CARRY);
        let new = old + (f64::from(value) - old) * weight;
        *mean = new as f32;
        let unit = ulp(*mean) / CARRY;
        let rest = (new - f64::from(*mean)) * f64::from_bits(INVERSE.wrapping_sub(unit.to_bits()));
        // Ties are rounded away from 0. Within ±2¹⁵, of which the upper end is no i16
        let size = rest.abs();
        let even = (size + WHOLE) - WHOLE;
        let whole = (if size - even == 0.5 { even + 1.0 } else { even }).copysign(rest);
        let whole = if whole > 32_767.0 { 32_767.0 } else { whole };
        *carry = (if unit > 0.0 { whole } else { 0.0 } + WHOLE).to_bits() as i16;
    }
}

/// Rows of the picture whose film is added to as one: a band for each thread, within a row of tiles.
struct Band<'a> {
    /// The first row, and how many.
    y: usize,
    rows: usize,
    /// Width of the picture.
    width: usize,
    halves: Vec<HalfBand<'a>>,
}

struct HalfBand<'a> {
    mean: &'a mut [Rgb],
    carry: &'a mut [[i16; 3]],
    /// Of all pixels of the picture.
    rejected: &'a [u32],
}

#[derive(Clone, Copy)]
struct TileBatch<'a> {
    tile: Tile,
    pixels: TilePixels<'a>,
    spp: u64,
    /// The half they belong to, and the samples that it has.
    half: usize,
    had: u64,
}

/// What a film found in new samples.
#[derive(Default)]
struct Found {
    /// Pixels with negative luminance.
    below_zero: u64,
    /// Pixels that are not finite, with their half.
    lost: Vec<(usize, usize)>,
}

impl Band<'_> {
    /// Adds a row of new means to the half that they belong to.
    fn add_row(&mut self, y: usize, batch: &TileBatch<'_>, found: &mut Found) {
        let &TileBatch { tile, spp, half, had, .. } = batch;
        let new = batch.pixels.row(y - tile.y);
        let from = (y - self.y) * self.width + tile.x;
        let first = y * self.width + tile.x;
        let HalfBand { mean, carry, rejected: lost } = &mut self.halves[half];
        let (mean, carry) = (&mut mean[from..][..tile.width], &mut carry[from..][..tile.width]);
        let numbers = new.as_flattened();
        // A sum, because a search would end at the first and so not become vector instructions
        let finite = numbers.iter().fold(true, |all, c| all & c.is_finite());
        if finite && lost.is_empty() {
            add_numbers(mean.as_flattened_mut(), carry.as_flattened_mut(), numbers, weight(spp, had));
        } else {
            for (i, ((mean, carry), value)) in mean.iter_mut().zip(carry).zip(new).enumerate() {
                if value.iter().all(|c| c.is_finite()) {
                    let before = had - rejected(lost, first + i);
                    add_numbers(mean, carry, value, weight(spp, before));
                } else {
                    found.lost.push((half, first + i));
                }
            }
        }
        if numbers.iter().fold(false, |any, &c| any | (c < 0.0)) {
            let finite = new.iter().filter(|value| value.iter().all(|c| c.is_finite()));
            found.below_zero += finite.filter(|&&value| luminance(value) < 0.0).count() as u64;
        }
    }
}

/// Weights of two halves in the mean of all samples, by their numbers of samples: 0 for a half without any.
pub(crate) fn weights([a, b]: [f64; 2]) -> [f32; 2] {
    let all = (a + b).max(f64::MIN_POSITIVE);
    [(a / all) as f32, (b / all) as f32]
}

/// The means of two halves in a row of pixels, by their weights: the same bits whichever half is which, and what both
/// have where they are equal.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
pub(crate) fn blend_row([a, b]: [&[Rgb]; 2], weights: [f32; 2], mean: &mut [Rgb]) {
    let halves = a.as_flattened().iter().zip(b.as_flattened());
    for (mean, (&a, &b)) in mean.as_flattened_mut().iter_mut().zip(halves) {
        *mean = blend([a, b], weights);
    }
}

/// [`blend_row`] of one number.
#[inline(always)]
pub(crate) fn blend([a, b]: [f32; 2], [of_a, of_b]: [f32; 2]) -> f32 {
    let (low, high, of_high) = if a < b { (a, b, of_b) } else { (b, a, of_a) };
    let near = low + (high - low) * of_high;
    // The difference of two huge values may be none
    if near.is_finite() { near } else { low * (1.0 - of_high) + high * of_high }
}

/// Accumulates batches of each tile into two independent halves, A and B.
///
/// Each batch goes to whichever half of its tile has fewer samples, so that the two stay as even as the
/// batches allow. Non-finite pixels of a batch are rejected and counted.
///
/// Memory: 36 bytes per pixel, 18 without halves.
#[derive(Clone, Debug)]
pub struct Film {
    grid: TileGrid,
    /// A and B; only A where no criterion needs halves.
    halves: Vec<Half>,
    counts: Vec<[u64; 2]>,
    rejected: u64,
    /// Samples whose batch was below zero; not in files.
    negative: u64,
}

impl Film {
    /// Checks that there is memory for a film with so many halves: without it, making one ends the process.
    pub(crate) fn check_memory(grid: TileGrid, halves: usize) -> Result<(), FilmError> {
        // Three f32 and three i16 in a half
        const PIXEL: usize = 18;
        let (width, height) = grid.size();
        let bytes = halves * PIXEL * width * height;
        let there = Vec::<u8>::new().try_reserve_exact(bytes);
        there.map_err(|_| FilmError::Memory { width, height, bytes })
    }

    /// An empty film that keeps two halves.
    pub fn new(grid: TileGrid) -> Self {
        Self::with_halves(grid, 2)
    }

    /// An empty film that keeps only the mean, for criteria that need no halves.
    pub fn without_halves(grid: TileGrid) -> Self {
        Self::with_halves(grid, 1)
    }

    fn with_halves(grid: TileGrid, halves: usize) -> Self {
        let halves = vec![Half::new(grid.width() * grid.height()); halves];
        Self { grid, halves, counts: vec![[0; 2]; grid.len()], rejected: 0, negative: 0 }
    }

    /// The grid.
    pub fn grid(&self) -> TileGrid {
        self.grid
    }

    /// Image width in pixels.
    pub fn width(&self) -> usize {
        self.grid.width()
    }

    /// Image height in pixels.
    pub fn height(&self) -> usize {
        self.grid.height()
    }

    /// Whether the film keeps two halves.
    pub fn has_halves(&self) -> bool {
        self.halves.len() == 2
    }

    /// Samples per pixel in halves A and B of a tile; all in A where no halves are kept.
    ///
    /// # Panics
    /// If the tile does not exist.
    #[doc(hidden)]
    pub fn half_counts(&self, tile: usize) -> [u64; 2] {
        self.counts[tile]
    }

    /// Samples per pixel of a tile, both halves together.
    ///
    /// # Panics
    /// If the tile does not exist.
    pub fn spp(&self, tile: usize) -> u64 {
        let [a, b] = self.counts[tile];
        a + b
    }

    /// A request for the next samples of a tile, which belong to the half with fewer.
    ///
    /// # Panics
    /// If the tile does not exist.
    #[doc(hidden)]
    pub fn request(&self, tile: usize, spp: u64) -> Request {
        self.request_after(tile, self.counts[tile], spp)
    }

    /// The same once the halves of the tile have these samples.
    pub(crate) fn request_after(&self, tile: usize, counts: [u64; 2], spp: u64) -> Request {
        let half = self.half_with_fewer(counts);
        let sequence = Sequence { number: half as u32, first: counts[half] };
        Request::new(self.grid.tile(tile), counts[0] + counts[1], spp).in_sequence(sequence)
    }

    /// The half that the next batch goes to, of a tile whose halves have these samples.
    fn half_with_fewer(&self, [a, b]: [u64; 2]) -> usize {
        usize::from(self.has_halves() && b < a)
    }

    /// Samples rejected so far, over all pixels, because their batch was not finite. They count as their
    /// batch does, by the average of the tile.
    pub fn rejected(&self) -> u64 {
        self.rejected
    }

    /// Samples so far, over all pixels, whose batch had negative luminance; of a film that was read, since then.
    pub fn negative(&self) -> u64 {
        self.negative
    }

    /// All samples taken, over all pixels; no more than fit.
    pub fn total_samples(&self) -> u64 {
        let of_tile = |t: Tile| self.spp(t.index).saturating_mul(t.pixels() as u64);
        self.grid.tiles().map(of_tile).fold(0, u64::saturating_add)
    }

    /// Adds the mean of `spp` new samples per pixel; `mean` is row-major over the tile.
    ///
    /// # Errors
    /// [`FilmError`] if the tile does not exist, the size differs or `spp` is zero; the film is then
    /// unchanged.
    pub fn add(&mut self, tile: usize, spp: u64, mean: &[Rgb]) -> Result<(), FilmError> {
        let tile = self.check(tile, mean.len())?;
        self.check_new(tile.index, spp)?;
        self.add_tiles(spp, &[tile], |tile| TilePixels::alone(tile, mean));
        Ok(())
    }

    /// Adds the means of `spp` new samples per pixel to tiles, in the order of the grid, which pass
    /// [`Film::check_new`]. Rows of the picture are distributed over threads.
    pub(crate) fn add_tiles<'a>(
        &mut self,
        spp: u64,
        tiles: &[Tile],
        pixels: impl Fn(Tile) -> TilePixels<'a> + Sync,
    ) {
        let batch = |&tile: &Tile| {
            let half = self.half_with_fewer(self.counts[tile.index]);
            TileBatch { tile, pixels: pixels(tile), spp, half, had: self.counts[tile.index][half] }
        };
        let batches: Vec<TileBatch<'_>> = tiles.iter().map(batch).collect();
        // One tile alone is not worth the way to other threads
        let rows_at_once = if tiles.len() == 1 { usize::MAX } else { BAND };
        let in_rows: Vec<&[TileBatch<'_>]> = batches.chunk_by(|a, b| a.tile.y == b.tile.y).collect();
        let add = |(mut band, batches): (Band<'_>, &[TileBatch<'_>])| {
            let mut found = Found::default();
            for y in band.y..band.y + band.rows {
                batches.iter().for_each(|batch| band.add_row(y, batch, &mut found));
            }
            found
        };
        let found: Vec<Found> = self.bands(&in_rows, rows_at_once).into_par_iter().map(add).collect();
        for Found { below_zero, lost } in found {
            self.negative += below_zero * spp;
            self.rejected += lost.len() as u64 * spp;
            lost.into_iter().for_each(|(half, pixel)| self.halves[half].reject(pixel, spp));
        }
        for TileBatch { tile, half, .. } in batches {
            self.counts[tile.index][half] += spp;
        }
    }

    /// Cuts the film into bands of at most so many rows, of those rows of tiles that get samples.
    fn bands<'a, 'b>(
        &'a mut self,
        in_rows: &[&'b [TileBatch<'b>]],
        rows_at_once: usize,
    ) -> Vec<(Band<'a>, &'b [TileBatch<'b>])> {
        let width = self.grid.width();
        let mut bands: Vec<(Band<'_>, &[TileBatch<'_>])> = Vec::new();
        for &batches in in_rows {
            let Tile { y: top, height, .. } = batches[0].tile;
            bands.extend((top..top + height).step_by(rows_at_once.min(height)).map(|y| {
                let rows = rows_at_once.min(top + height - y);
                (Band { y, rows, width, halves: Vec::with_capacity(2) }, batches)
            }));
        }
        for Half { mean, carry, rejected } in &mut self.halves {
            let (mut mean, mut carry, mut row) = (&mut mean[..], &mut carry[..], 0);
            for (band, _) in &mut bands {
                let (skip, take) = ((band.y - row) * width, band.rows * width);
                let (of_mean, of_carry);
                (of_mean, mean) = mean.split_at_mut(skip).1.split_at_mut(take);
                (of_carry, carry) = carry.split_at_mut(skip).1.split_at_mut(take);
                row = band.y + band.rows;
                band.halves.push(HalfBand { mean: of_mean, carry: of_carry, rejected });
            }
        }
        bands
    }

    /// Checks that a tile can get `spp` new samples per pixel.
    pub(crate) fn check_new(&self, tile: usize, spp: u64) -> Result<(), FilmError> {
        let had = self.spp(tile);
        let now = had.saturating_add(spp);
        match spp {
            0 => Err(FilmError::NothingNew { tile, had, now }),
            _ if now < COUNTABLE => Ok(()),
            _ => Err(FilmError::TooMany { tile, now }),
        }
    }

    /// The number of new samples in a running mean of a tile, and their mean.
    pub(crate) fn new_of_running(
        &self,
        tile: Tile,
        total: u64,
        mean: TilePixels<'_>,
    ) -> Result<(u64, Vec<Rgb>), FilmError> {
        let had = self.spp(tile.index);
        let new = total.checked_sub(had).filter(|&n| n > 0);
        let Some(new) = new else { return Err(FilmError::NothingNew { tile: tile.index, had, now: total }) };
        let (before, after) = (had as f64 / new as f64, total as f64 / new as f64);
        let pixels = tile.rows(self.grid.width()).flatten().zip(mean.iter());
        let new_of = |(pixel, value): (usize, Rgb)| -> Rgb {
            let old = self.pixel(tile.index, pixel);
            std::array::from_fn(|c| (f64::from(value[c]) * after - f64::from(old[c]) * before) as f32)
        };
        Ok((new, pixels.map(new_of).collect()))
    }

    /// The same of tiles in a running mean of the whole image.
    pub(crate) fn new_of_running_image(
        &self,
        tiles: &[Tile],
        total: u64,
        image: &[Rgb],
    ) -> Vec<Result<(u64, Vec<Rgb>), FilmError>> {
        let width = self.width();
        let new_of =
            |&tile: &Tile| self.new_of_running(tile, total, TilePixels::in_image(tile, image, width));
        tiles.par_iter().map(new_of).collect()
    }

    pub(crate) fn check(&self, tile: usize, pixels: usize) -> Result<Tile, FilmError> {
        if tile >= self.grid.len() {
            return Err(FilmError::Tile(tile, self.grid.len()));
        }
        let tile = self.grid.tile(tile);
        if pixels != tile.pixels() {
            return Err(FilmError::Pixels { tile: tile.index, got: pixels, expected: tile.pixels() });
        }
        Ok(tile)
    }

    /// Validates a film that was read, against an empty one of the same job.
    #[cfg(feature = "files")]
    pub(crate) fn check_like(&self, fresh: &Self) -> Result<(), &'static str> {
        if self.grid != fresh.grid || self.halves.len() != fresh.halves.len() {
            return Err("its film is not of this job");
        }
        let pixels = self.grid.width() * self.grid.height();
        let complete = |half: &Half| {
            half.mean.len() == pixels
                && half.carry.len() == pixels
                && [0, pixels].contains(&half.rejected.len())
        };
        if !self.halves.iter().all(complete) || self.counts.len() != self.grid.len() {
            return Err("its film has too few or too many pixels");
        }
        if !self.halves.iter().flat_map(|half| &half.mean).flatten().all(|c| c.is_finite()) {
            return Err("a pixel of its film is not finite");
        }
        let possible = |tile: Tile| {
            let halves = || self.halves.iter().zip(self.counts[tile.index]);
            self.counts[tile.index].iter().all(|&count| count < COUNTABLE)
                && tile
                    .rows(self.grid.width())
                    .flatten()
                    .all(|pixel| halves().all(|(half, count)| half.rejected(pixel) <= count))
        };
        if !self.grid.tiles().all(possible) || self.rejected > self.total_samples() {
            return Err("its film counts samples that there cannot be");
        }
        Ok(())
    }

    /// Number of pixels of a tile that lack a valid sample in one of the halves kept.
    ///
    /// # Panics
    /// If the tile does not exist.
    #[doc(hidden)]
    pub fn unsampled_pixels(&self, tile: usize) -> usize {
        let rect = self.grid.tile(tile);
        let kept_out = self.halves.iter().any(|half| !half.rejected.is_empty());
        if !kept_out && self.halves.iter().zip(self.counts[tile]).all(|(_, count)| count > 0) {
            return 0; // as nearly always
        }
        let lacks = |pixel: usize| {
            self.halves.iter().zip(self.counts[tile]).any(|(half, count)| half.rejected(pixel) >= count)
        };
        rect.rows(self.grid.width()).flatten().filter(|&pixel| lacks(pixel)).count()
    }

    /// The mean linear radiance of either half, A and B, at one pixel of `tile`, each with its number of
    /// valid samples; black where there are none, as in all of B where no halves are kept. `pixel` is
    /// row-major over the image, and must lie in `tile`: counts of samples are kept by tile.
    ///
    /// # Panics
    /// If the tile or the pixel does not exist.
    #[inline]
    pub fn pixel_halves(&self, tile: usize, pixel: usize) -> [(Rgb, u64); 2] {
        let counts = self.pixel_counts(tile, pixel);
        std::array::from_fn(|h| (self.halves.get(h).map_or([0.0; 3], |half| half.mean[pixel]), counts[h]))
    }

    /// The means of half A, 0, or B, 1, in a row of the image; none if the half is not kept.
    pub(crate) fn half_row(&self, half: usize, y: usize) -> Option<&[Rgb]> {
        let width = self.grid.width();
        Some(&self.halves.get(half)?.mean[y * width..(y + 1) * width])
    }

    /// The numbers of samples of [`Film::pixel_halves`].
    #[inline]
    pub(crate) fn pixel_counts(&self, tile: usize, pixel: usize) -> [u64; 2] {
        std::array::from_fn(|h| {
            self.halves.get(h).map_or(0, |half| self.counts[tile][h] - half.rejected(pixel))
        })
    }

    /// Mean linear radiance of all valid samples of one pixel of `tile`; black where there are none. `pixel`
    /// is row-major over the image, and must lie in `tile`.
    ///
    /// # Panics
    /// If the tile or the pixel does not exist.
    #[inline]
    pub fn pixel(&self, tile: usize, pixel: usize) -> Rgb {
        let [(a, na), (b, nb)] = self.pixel_halves(tile, pixel);
        let weights = weights([na as f64, nb as f64]);
        std::array::from_fn(|c| blend([a[c], b[c]], weights))
    }

    /// Whether every pixel has this mean.
    pub(crate) fn is_all(&self, mean: Rgb) -> bool {
        self.grid.tiles().all(|tile| {
            let pixel = self.pixels_of(tile.index);
            tile.rows(self.grid.width()).flatten().all(|place| pixel(place) == mean)
        })
    }

    /// [`Film::pixel`] of many pixels of a tile.
    pub(crate) fn pixels_of(&self, tile: usize) -> impl Fn(usize) -> Rgb {
        // As all pixels have the samples of their tile, but where some were kept out
        let of_tile = weights(self.counts[tile].map(|n| n as f64));
        move |pixel| match &self.halves[..] {
            [a, b] if self.rejected == 0 => {
                let [a, b] = [a.mean[pixel], b.mean[pixel]];
                std::array::from_fn(|c| blend([a[c], b[c]], of_tile))
            }
            _ => self.pixel(tile, pixel),
        }
    }

    /// Settles the exposure that the picture will have once it has converged. The halves tell noise from
    /// texture; without them, what differs among 2×2 pixels counts as noise. Pixels without samples are left
    /// out.
    ///
    /// # Panics
    /// If [`ToneMapping::check`] refuses the parameters.
    pub(crate) fn settle(&self, tone: &ToneMapping) -> Settled {
        let (grid, halves) = (self.grid, self.has_halves());
        // Found once for each column and row
        let columns: Vec<usize> = (0..grid.width()).map(|x| grid.index_at(x, 0)).collect();
        let rows: Vec<usize> = (0..grid.height()).map(|y| grid.index_at(0, y)).collect();
        let pixel = |x: usize, y: usize| {
            let [a, b] = self.pixel_halves(rows[y] + columns[x], y * grid.width() + x);
            let pixel = exposure::of_halves([a, b].map(|(mean, spp)| (mean, spp as f64)))?;
            Some(NoisyPixel { deviation: pixel.deviation.filter(|_| halves), ..pixel })
        };
        let block = |corner: [isize; 2]| match self.block_of_halves(corner, &columns, &rows) {
            Some(block) => block,
            None => NoisyBlock::gather(corner, grid.size(), pixel),
        };
        tone.settle_by(|| exposure::estimate_by_blocks(grid.size(), block))
    }

    /// The pixels of a block, by its first; `columns` and `rows` add up to the tile of a pixel. `None` if it does not lie
    /// within the picture, or not all its pixels have the samples of their tile, or halves are not kept.
    fn block_of_halves(
        &self,
        [left, top]: [isize; 2],
        columns: &[usize],
        rows: &[usize],
    ) -> Option<NoisyBlock> {
        let (left, top) = (usize::try_from(left).ok()?, usize::try_from(top).ok()?);
        let (right, bottom) = (left + exposure::BLOCK, top + exposure::BLOCK);
        let [_, _] = &self.halves[..] else { return None };
        if right > self.width() || bottom > self.height() || self.rejected > 0 {
            return None;
        }
        let mut pixels = [[[0.0; 3]; exposure::PIXELS]; 2];
        for (half, pixels) in self.halves.iter().zip(&mut pixels) {
            // All of it before anything is done with it: reading waits for memory, row by row
            for (row, y) in pixels.chunks_exact_mut(exposure::BLOCK).zip(top..) {
                row.copy_from_slice(&half.mean[y * self.width() + left..][..exposure::BLOCK]);
            }
        }
        let mut counts = [[0.0; exposure::PIXELS]; 2];
        let (columns, rows) = (&columns[left..right], &rows[top..bottom]);
        let alike = columns[0] == columns[exposure::BLOCK - 1] && rows[0] == rows[exposure::BLOCK - 1];
        for (half, counts) in counts.iter_mut().enumerate() {
            if alike {
                counts.fill(self.counts[rows[0] + columns[0]][half] as f64);
                continue;
            }
            for (counts, row) in counts.chunks_exact_mut(exposure::BLOCK).zip(rows) {
                for (count, column) in counts.iter_mut().zip(columns) {
                    *count = self.counts[row + column][half] as f64;
                }
            }
        }
        Some(exposure::block_of_halves(&pixels, &counts))
    }

    /// The picture so far: mean linear radiance, row-major.
    pub fn image(&self) -> Vec<Rgb> {
        let mut out = vec![[0.0; 3]; self.grid.width() * self.grid.height()];
        for tile in self.grid.tiles() {
            for pixel in tile.rows(self.grid.width()).flatten() {
                out[pixel] = self.pixel(tile.index, pixel);
            }
        }
        out
    }
}

#[cfg(test)]
impl Film {
    /// Makes one of several things wrong.
    pub(crate) fn corrupt(&mut self, what: usize) {
        match what {
            0 => self.halves[0].mean.truncate(3),
            1 => self.halves[0].mean[0][0] = f32::NAN,
            2 => self.counts[0][0] = COUNTABLE,
            3 => self.rejected = u64::MAX,
            _ => self.halves[0].rejected = vec![u32::MAX; self.halves[0].mean.len()],
        }
    }
}

#[cfg(test)]
mod tests;

// Why a batch does not fit a film.

/// A batch that the film refuses.
#[derive(Debug, Error, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum FilmError {
    /// The tile does not exist.
    #[error("tile {0} does not exist: the film has {1}")]
    Tile(usize, usize),
    /// The batch has another number of pixels than the tile.
    #[error("a batch of {got} pixels for tile {tile}, which has {expected}")]
    Pixels {
        /// The tile.
        tile: usize,
        /// Pixels in the batch.
        got: usize,
        /// Pixels in the tile.
        expected: usize,
    },
    /// A batch without samples, or a running mean of no more samples than the film has.
    #[error("a batch for tile {tile} brings no new samples ({had} before, {now} now)")]
    NothingNew {
        /// The tile.
        tile: usize,
        /// Samples before.
        had: u64,
        /// Samples claimed now.
        now: u64,
    },
    /// The system has less memory for a film than it would take.
    #[error("a film of {width}×{height} pixels takes {bytes} bytes of memory, more than there is")]
    Memory {
        /// Width of the picture.
        width: usize,
        /// Height of the picture.
        height: usize,
        /// What it would take.
        bytes: usize,
    },
    /// More samples than a film counts.
    #[error("tile {tile} would have {now} samples per pixel or more; a film counts fewer than 2^34")]
    TooMany {
        /// The tile.
        tile: usize,
        /// Samples that it would have.
        now: u64,
    },
}
