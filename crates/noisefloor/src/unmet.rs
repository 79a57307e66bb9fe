//! Light that no sample has met yet, estimated from light that only one half of the samples has met.
//!
//! A lamp behind glass may be met by one sample in a million. Until then a tile shows nothing of it, and no
//! noise tells of it either. But what was seen once estimates what was not seen yet (Good 1953, "The
//! population frequencies of species and the estimation of population parameters", after Turing):
//! light that `n` samples have met once makes up as much of the picture, on average, as light that they have
//! missed, wherever that is.
//!
//! Met once is what one half of the film has at a pixel and the other half has nowhere within a pixel of it.
//! Of ordinary noise, that is hardly anything: the largest of nine values of the other half is exceeded one
//! time in ten, by a little, everywhere. How much of it is missing in a place that has less of it than its
//! surroundings hangs on how many finds make it up: m, on average, in the samples of a place as large as
//! people look at. With rates of finding it that are exponentially distributed from place to place, of mean
//! m, a place without a find is expected to have a rate of m/(1 + m) (the mean of the posterior of Poisson
//! counts, a gamma distribution): where finds are many, a place that has none lacks one at the most, and a
//! single one may lie anywhere.
//!
//! Where nothing was met once, nothing tells of what was missed. As much as `NOTHING_MET` is expected all the same, spread
//! over all samples of the picture; a tile that has met light of that order needs none.
//!
//! Whether so much light would be seen if it fell on a tile is for the criterion to say: [`Unmet::shown`]
//! draws it.

use crate::criterion::OpenFor;
use crate::display::Display;
use crate::evidence::TilePlanes;
use crate::film::Film;
use crate::rgb::Rgb;
use crate::tile::{Tile, TileGrid};
use multiversion::multiversion;
use noisefloor_vision::Viewing;
use rayon::prelude::*;
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;

/// Edge of the place that light falls on, in degrees: that of the window in which people look for noise.
const PLACE: f64 = 0.75;
/// What is shown is brightest in the middle of a place, by this factor.
const PEAK: f64 = 4.0;
/// Less on the screen than this is not shown: half a step of eight bits.
const UNSEEN: f32 = 0.5 / 255.0;

/// Light that nothing has met yet, in average greys of one sample, over all samples of a picture: one find of light that makes
/// up a tenth of a picture, and that one sample in 250,000 meets. Small pictures pay for it, and seed 13 of `caustic` shows what
/// it does not hold.
const NOTHING_MET: f64 = 0.1 * 250_000.0;

/// Samples per pixel from which a tile is not expected to lack what nothing has met: pictures of few pixels would never end.
const ENOUGH_SPP: u64 = 100;

/// Mean light of a tile, in average greys, below which it is darkness more than surfaces.
const DARK: f64 = 0.1;

/// Exposed radiance of an average grey.
const GREY: f32 = 0.18;

/// How well light of each channel is seen beside grey light: dots of it on grey have lost as many JODs as grey ones
/// where they are 4.4, 1.4 and 9.4 times as strong. By luminance, blue would count for two thirds of that.
const SEEN: Rgb = [0.22, 0.68, 0.10];

/// Pixels of a row that are looked at together.
const AT_ONCE: usize = 64;

/// A sample of more times an average grey is an accident of arithmetic, and tells of no light. If it did, billions of
/// samples, thousands of each pixel of 1280×800, would have to be taken before a second such find could go unseen.
const ACCIDENT: f32 = 1e7;

/// What only one half has met, in a part of the picture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
pub(crate) struct MetOnce {
    /// Light, as it is [`SEEN`], in the mean of all samples, summed over pixels.
    light: f64,
    /// The same, each times that of the sample that has it all.
    by_sample: f64,
    pixels: f64,
    /// Light of all that was met, in the mean of all samples, summed over pixels.
    all: f64,
}

impl MetOnce {
    /// In a tile of a film that keeps two halves, of which both have samples there; else nothing.
    pub(crate) fn of(film: &Film, display: &Display, tile: Tile) -> Self {
        let grid = film.grid();
        let accident = ACCIDENT * GREY / display.exposure();
        let mut met = Self { pixels: tile.pixels() as f64, ..Self::default() };
        if film.half_counts(tile.index).contains(&0) {
            return met;
        }
        let mut halves = [Rows::new(tile.width), Rows::new(tile.width)];
        let of_tile = HalfSamples::new(film.half_counts(tile.index));
        let inside = |y: usize| y.min(grid.height() - 1);
        for (half, rows) in halves.iter_mut().enumerate() {
            rows.push(film, half, tile, tile.y.saturating_sub(1));
            rows.push(film, half, tile, tile.y);
        }
        for y in tile.y..tile.y + tile.height {
            for (half, rows) in halves.iter_mut().enumerate() {
                rows.push(film, half, tile, inside(y + 1));
                rows.find_highest();
            }
            let [a, b] = &halves;
            let own = [a.here(), b.here()];
            // Exchanged halves add up to the same bits
            let sums = own.map(|row| row.iter().map(|&light| f64::from(light)).sum::<f64>());
            met.all += of_tile.shares[0] * sums[0] + of_tile.shares[1] * sums[1];
            let around = [&a.highest[..], &b.highest];
            if film.rejected() == 0 {
                let mut found = [0.0; AT_ONCE];
                for from in (0..tile.width).step_by(AT_ONCE) {
                    let found = &mut found[..AT_ONCE.min(tile.width - from)];
                    let here = from..from + found.len();
                    let [own, around] = [own, around].map(|rows| rows.map(|row| &row[here.clone()]));
                    found_row(own, around, of_tile, accident, found);
                    found.iter().for_each(|&light| met.add(light, of_tile));
                }
                continue;
            }
            for x in 0..tile.width {
                let pixel = y * grid.width() + tile.x + x;
                let samples = HalfSamples::new(film.pixel_counts(tile.index, pixel));
                let [[a, b], [around_a, around_b]] = [own, around].map(|rows| rows.map(|row| row[x]));
                met.add(light_found([a - around_b, b - around_a], samples, accident), samples);
            }
        }
        met
    }

    #[inline]
    fn add(&mut self, light: f64, samples: HalfSamples) {
        self.light += light;
        self.by_sample += light * light * samples.all;
    }

    fn and(self, other: Self) -> Self {
        Self {
            light: self.light + other.light,
            by_sample: self.by_sample + other.by_sample,
            pixels: self.pixels + other.pixels,
            all: self.all + other.all,
        }
    }

    /// Light for each pixel.
    fn density(self) -> f64 {
        self.light / self.pixels.max(1.0)
    }

    /// How much of this light is likely to be missing, for each pixel, where `own` is what was met in `spp`
    /// samples of each pixel, and a place has so many pixels.
    fn missing(self, own: Self, spp: f64, place: f64) -> f64 {
        if self.light <= 0.0 {
            return 0.0;
        }
        // A find as most of the light is made up of: the mean by light
        let find = self.by_sample / self.light;
        let finds = self.density() * place * spp / find;
        (self.density() - own.density()).max(0.0) / (1.0 + finds)
    }

    #[cfg(feature = "files")]
    pub(crate) fn is_sound(self) -> bool {
        let Self { light, by_sample, pixels, all } = self;
        [light, by_sample, pixels, all].into_iter().all(|v| v.is_finite() && v >= 0.0)
    }
}

/// Samples of the halves at a pixel.
#[derive(Clone, Copy)]
struct HalfSamples {
    counts: [f32; 2],
    /// Of all samples.
    shares: [f64; 2],
    all: f64,
}

impl HalfSamples {
    fn new([a, b]: [u64; 2]) -> Self {
        let all = (a + b) as f64;
        Self { counts: [a as f32, b as f32], shares: [a as f64 / all, b as f64 / all], all }
    }
}

/// Three rows of a half, each with a pixel more to both sides; the picture's edge repeats.
struct Rows {
    rows: [Vec<f32>; 3],
    /// The largest of each column, and for each pixel of the tile that of the nine around it.
    columns: Vec<f32>,
    highest: Vec<f32>,
}

impl Rows {
    fn new(width: usize) -> Self {
        let row = || vec![0.0; width + 2];
        Self { rows: [row(), row(), row()], columns: row(), highest: vec![0.0; width] }
    }

    /// Forgets the uppermost row, and takes row `y` of the picture.
    fn push(&mut self, film: &Film, half: usize, tile: Tile, y: usize) {
        self.rows.rotate_left(1);
        let [.., last] = &mut self.rows;
        let Some(row) = film.half_row(half, y) else { return };
        let (left, right) = (tile.x.saturating_sub(1), (tile.x + tile.width).min(film.grid().width() - 1));
        let [first, inner @ .., end] = &mut last[..] else { return };
        light_row(&row[tile.x..][..inner.len()], inner);
        (*first, *end) = (light(row[left]), light(row[right]));
    }

    fn find_highest(&mut self) {
        highest_of_nine(self.rows.each_ref().map(Vec::as_slice), &mut self.columns, &mut self.highest);
    }

    /// The row in the middle, without the pixels beside the tile.
    fn here(&self) -> &[f32] {
        let row = &self.rows[1];
        &row[1..row.len() - 1]
    }
}

/// What a pixel has of it: as much as a grey that is seen as well.
#[inline(always)]
fn light([r, g, b]: Rgb) -> f32 {
    let light = SEEN[0] * r + SEEN[1] * g + SEEN[2] * b;
    if light > 0.0 { light } else { 0.0 }
}

/// That of a row of pixels.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn light_row(pixels: &[Rgb], out: &mut [f32]) {
    out.iter_mut().zip(pixels).for_each(|(out, &pixel)| *out = light(pixel));
}

/// The largest of each column, and of nine around each pixel but the first and the last. None is NaN.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn highest_of_nine([above, here, below]: [&[f32]; 3], columns: &mut [f32], highest: &mut [f32]) {
    let n = highest.len();
    let (above, here, below, columns) =
        (&above[..n + 2], &here[..n + 2], &below[..n + 2], &mut columns[..n + 2]);
    let larger = |a: f32, b: f32| if a > b { a } else { b };
    for x in 0..n + 2 {
        columns[x] = larger(larger(above[x], here[x]), below[x]);
    }
    for x in 0..n {
        highest[x] = larger(larger(columns[x], columns[x + 1]), columns[x + 2]);
    }
}

/// Light in the mean of all samples of a pixel, by what each half has more than the other around it; none if one sample of
/// it is an accident.
#[inline(always)]
fn light_found([a, b]: [f32; 2], samples: HalfSamples, accident: f32) -> f64 {
    let HalfSamples { counts, shares, .. } = samples;
    let [a, b] = [if a > 0.0 { a } else { 0.0 }, if b > 0.0 { b } else { 0.0 }];
    let is_accident = a * counts[0] > accident || b * counts[1] > accident;
    let is_light = !is_accident && counts[0] > 0.0 && counts[1] > 0.0;
    // Of a half, the mean of all samples has its share
    let light = f64::from(a) * shares[0] + f64::from(b) * shares[1];
    if is_light { light } else { 0.0 }
}

/// [`light_found`] at the pixels of a row, by what the halves have there and around.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn found_row(
    [a, b]: [&[f32]; 2],
    [around_a, around_b]: [&[f32]; 2],
    samples: HalfSamples,
    accident: f32,
    found: &mut [f64],
) {
    let n = found.len();
    let (a, b, around_a, around_b) = (&a[..n], &b[..n], &around_a[..n], &around_b[..n]);
    for x in 0..n {
        found[x] = light_found([a[x] - around_b[x], b[x] - around_a[x]], samples, accident);
    }
}

/// What the tiles of a picture tell of light that they have not met.
#[derive(Debug)]
pub struct Unmet {
    grid: TileGrid,
    tiles: Vec<Option<MetOnce>>,
    picture: MetOnce,
    /// Light for each pixel that none of the samples may have met.
    nothing: f64,
    /// Radiance of an average grey.
    grey: f64,
    /// Edge of a place in pixels.
    place: f64,
}

impl Unmet {
    /// By a film that keeps two halves, of which one without samples tells nothing.
    pub fn of(film: &Film, display: &Display, viewing: Viewing) -> Self {
        let grid = film.grid();
        let tiles: Vec<Tile> = grid.tiles().collect();
        let met = tiles.par_iter().map(|&tile| Some(MetOnce::of(film, display, tile))).collect();
        Self::new(film, display, met, viewing)
    }

    /// `tiles` has what each tile of the grid has met once; `None` for one without evidence.
    pub(crate) fn new(film: &Film, display: &Display, tiles: Vec<Option<MetOnce>>, viewing: Viewing) -> Self {
        let grid = film.grid();
        let grey = f64::from(GREY / display.exposure());
        let nothing = NOTHING_MET * grey / film.total_samples().max(1) as f64;
        let picture = tiles.iter().flatten().fold(MetOnce::default(), |sum, &tile| sum.and(tile));
        let place = (PLACE * viewing.pixels_per_degree()).max(1.0);
        Self { grid, tiles, picture, nothing, grey, place }
    }

    /// Mean radiance that a tile is likely to lack: by the tiles around it, by the whole picture, or by what nothing has met,
    /// whichever says more.
    pub fn light(&self, film: &Film, tile: Tile) -> f64 {
        self.met_elsewhere(film, tile).max(self.nothing_met(film, tile))
    }

    /// What the light is that a tile is likely to lack.
    pub fn kind(&self, film: &Film, tile: Tile) -> OpenFor {
        let met = self.met_elsewhere(film, tile) >= self.nothing_met(film, tile);
        if met { OpenFor::UnmetLight } else { OpenFor::FewSamples }
    }

    /// Surfaces are as bright by what was met as they would be by other light: empty space shows none of it, and what is darker
    /// than [`DARK`] less.
    fn nothing_met(&self, film: &Film, tile: Tile) -> f64 {
        let Some(own) = self.tiles[tile.index].filter(|_| film.spp(tile.index) < ENOUGH_SPP) else {
            return 0.0;
        };
        let brightness = (own.all / own.pixels.max(1.0) / (DARK * self.grey)).min(1.0);
        (self.nothing * brightness - own.density()).max(0.0)
    }

    fn met_elsewhere(&self, film: &Film, tile: Tile) -> f64 {
        let Some(own) = self.tiles[tile.index] else { return 0.0 };
        let (columns, rows) = (self.grid.columns(), self.grid.rows());
        let (column, row) = (tile.index % columns, tile.index / columns);
        let near = |at: usize, count: usize| at.saturating_sub(1)..(at + 2).min(count);
        let around = near(row, rows)
            .flat_map(|y| near(column, columns).map(move |x| y * columns + x))
            .filter_map(|index| self.tiles[index])
            .fold(MetOnce::default(), MetOnce::and);
        let (spp, place) = (film.spp(tile.index) as f64, self.place * self.place);
        around.missing(own, spp, place).max(self.picture.missing(own, spp, place))
    }

    /// What this would change on the screen if it fell on the tile and all around it, in places as large as
    /// people look at: as the residual of luminance Y′ of the tile's planes, whose image is 0. `None` if that is nothing.
    pub fn shown(&self, film: &Film, display: &Display, tile: Tile) -> Option<TilePlanes> {
        let light = self.light(film, tile);
        let most = (PEAK * light) as f32;
        let step = |on: f32| display.luma([on + most; 3]) - display.luma([on; 3]);
        // Screens show more of it on black or on grey than on anything brighter
        if step(0.0).max(step(GREY / display.exposure())) < UNSEEN {
            return None;
        }
        let width = self.grid.width();
        let wave = |at: usize| 1.0 + libm::cos(TAU * at as f64 / self.place);
        Some(TilePlanes::gather(self.grid.size(), tile, |x, y| {
            let dark = film.pixel(tile.owner(self.grid, x, y), y * width + x);
            let more = (light * wave(x) * wave(y)) as f32;
            ([0.0; 3], [display.luma(dark.map(|c| c + more)) - display.luma(dark); 3])
        }))
    }
}

#[cfg(test)]
mod tests;
