//! What a tile is judged by: its display luminance, and its noise.

use crate::display::{Display, encode_channels, luminance, split_channels};
use crate::film::{Film, blend, weights};
pub use crate::plane::Plane;
use crate::rgb::Rgb;
use crate::tile::Tile;
use multiversion::multiversion;
use noisefloor_vision::Viewing;
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};
use std::cell::RefCell;
use std::ops::Range;

/// How far filters read beyond a tile, in pixels, and the edge of the blocks that a tile is divided into.
pub const HALO: usize = 8;

/// What a noisy tile is compared with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "files", serde(rename_all = "kebab-case"))]
pub enum Evidence {
    /// The other half buffer: no reference is needed.
    Halves,
    /// A noise-free reference: in the paper a quick ray-traced one (Takouachet et al. 2017, §4.3).
    Reference,
}

/// Buffers that a thread keeps for its next tile.
#[derive(Default)]
struct Buffers {
    planes: [Vec<f32>; 2],
    shown: [Channels<Vec<f32>>; 2],
}

/// Pixels of a row that are worked on at a time: few enough to stay in the nearest cache.
const PIXELS: usize = 128;

/// Display values R′, G′ and B′ of so many pixels, and their luminance Y′: of the mean of all samples, and of both halves.
struct Scratch {
    codes: [[[f32; PIXELS]; 3]; 3],
    shown: [[f32; PIXELS]; 3],
}

impl Scratch {
    const EMPTY: Self = Self { codes: [[[0.0; PIXELS]; 3]; 3], shown: [[0.0; PIXELS]; 3] };
}

thread_local! {
    static BUFFERS: RefCell<Buffers> = RefCell::default();
}

/// Noise in R′ and B′ beside what it would be in the colour of the picture, over the strongest in Y′, from which on it counts as
/// strongly coloured. Lamps of 2500 K on grey have 0.7 of B′, dots of green and cyan 0.8 to 1, of which greys still tell what they
/// cost within 0.05 JOD; dots of magenta have 2.6, of red 3.7, of blue 12.
const OTHER_COLOUR: f32 = 1.4;
/// Noise in R′ − Y′ and in B′ − Y′, over the strongest in Y′, from which on it counts as strongly coloured even in the colour of
/// the picture. At these, the contrast in units of the vision model's threshold is below one and a half times that of Y′ in all
/// bands from one cycle per degree on, and as large in the finer ones, where noise of single pixels is seen.
const SATURATED: [f32; 2] = [5.2, 6.3];
/// What nobody sees of it: a step of eight bits. At ten cycles per degree and fewer, the eye is four to ten times as sensitive
/// to Y′ as to either.
const UNSEEN: f32 = 1.0 / 255.0;
/// Edge of the squares in which noise is looked at for its colour: of a window, a lone dot has a third or more.
const SQUARE: usize = 16;
/// Columns that squares are looked at in together.
const TINTED: usize = 4 * SQUARE;

/// Two pictures of a tile as displayed, and what they differ by. All planes are display-encoded and have the same shape
/// (rows, columns): the tile, whose edges are rounded up to multiples of [`HALO`], with a halo of that width around
/// it. Neighbours are read where they exist; beyond the image, it is mirrored.
///
/// What is judged is `image` + `residual`/2 beside `image` − `residual`/2. Neither of them is the right one, so that
/// nothing changes if all of the residual changes its sign.
#[derive(Clone, Debug, PartialEq)]
pub struct TilePlanes {
    /// Luminance Y′ of the middle between the two pictures, in [0, 1].
    pub image: Plane,
    /// Residual of the luminance Y′: the difference of the two pictures, scaled so that its standard deviation is that
    /// of the noise that is judged.
    pub residual: Plane,
    /// Variance of known white rounding noise in each of the residuals of R′, G′ and B′; 0 for pictures in
    /// floating point.
    pub rounding: f32,
    /// On which display the picture is seen, and from how far: the default, unless changed.
    pub viewing: Viewing,
    /// The same in R′, G′ and B′, where noise is so strongly coloured that greys may show too little of it.
    pub colour: Option<ColourPlanes>,
    /// The tile itself within the planes: rows and columns of the planes that belong to it.
    pub inner: Tile,
    /// The tile in its picture.
    pub place: Tile,
}

/// Planes of R′, G′ and B′, as large as those of the [`TilePlanes`].
#[derive(Clone, Debug, PartialEq)]
pub struct ColourPlanes {
    /// The middle between the two pictures.
    pub image: [Plane; 3],
    /// What they differ by.
    pub residual: [Plane; 3],
}

impl ColourPlanes {
    /// Squares of the residual, summed over channels.
    pub(crate) fn energy(&self) -> Plane {
        let [red, green, blue] = self.residual.each_ref().map(Plane::values);
        let pixels = red.iter().zip(green).zip(blue);
        Plane::new(self.residual[0].size(), pixels.map(|((r, g), b)| r * r + g * g + b * b).collect())
    }
}

/// R′, G′ and B′ from Y′, R′ and B′.
fn with_green(luma: &Plane, red: Plane, blue: Plane) -> [Plane; 3] {
    let [of_red, of_green, of_blue] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(luminance);
    let red_and_blue = red.values().iter().zip(blue.values());
    let green = luma.values().iter().zip(red_and_blue);
    let green = green.map(|(luma, (r, b))| (luma - of_red * r - of_blue * b) * (1.0 / of_green)).collect();
    let green = Plane::new(luma.size(), green);
    [red, green, blue]
}

impl TilePlanes {
    /// Collects the planes of a tile of an image of `width`×`height` pixels, both at least 1; `pixel(x, y)`
    /// gives the display-encoded picture and its residual at image coordinates.
    pub fn gather(size: (usize, usize), tile: Tile, pixel: impl Fn(usize, usize) -> (Rgb, Rgb)) -> Self {
        let shown = Shown::of_rows(size, &[tile], |y, columns, mut row| {
            for (i, x) in columns.enumerate() {
                let (image, residual) = pixel(x, y);
                for (of, pixel) in [image, residual].into_iter().enumerate() {
                    let numbers = [luminance(pixel), pixel[0], pixel[2]];
                    row[of].iter_mut().zip(numbers).for_each(|(plane, number)| plane[i] = number);
                }
            }
        });
        shown.into_planes(tile)
    }

    /// How many pixels of the tile carry its noise: (Σr²)²/Σr⁴ of the residuals r. A third of them if they are normal and
    /// equally strong everywhere, 1 if one pixel has all of it, 0 without noise. An energy of noise that is estimated from
    /// one residual for each pixel has a relative variance of about the inverse.
    pub(crate) fn noise_carriers(&self) -> f64 {
        let [squares, fourths] = match &self.colour {
            None => self.residual.sums_inside(self.inner, |r| [r * r, (r * r) * (r * r)]),
            Some(colour) => colour.energy().sums_inside(self.inner, |square| [square, square * square]),
        };
        if fourths > 0.0 { squares * squares / fourths } else { 0.0 }
    }

    /// Returns its memory to this thread's buffers, so that the next verdict does not allocate.
    pub(crate) fn recycle(self) {
        let planes = [self.image, self.residual].map(Plane::into_values);
        BUFFERS.with_borrow_mut(|buffers| buffers.planes = planes);
    }

    /// Evidence from the film's two halves, on the mean of all samples.
    ///
    /// With n_A and n_B samples, Var(A − B) = σ²/n_A + σ²/n_B = σ²·(n_A + n_B)/(n_A·n_B), and the mean of all
    /// samples has σ²/(n_A + n_B); so (A − B)·√(n_A·n_B)/(n_A + n_B) has exactly the noise of the mean, also
    /// for uneven halves. The halves are tone mapped first, since people see display values. Where tone mapping lets the
    /// mean be as bright as the brighter half, as at a white dot, all of their difference is seen.
    ///
    /// A pixel without valid samples in one half gives no evidence: its residual is 0. The planes of exchanged halves
    /// are the same to the bit but for the sign of the residual.
    pub fn from_halves(film: &Film, display: &Display, tile: Tile) -> Self {
        Shown::of_halves(film, display, &[tile]).into_planes(tile)
    }

    /// Evidence on the mean of two renderings of a view that share no samples, both `width`×`height` pixels: that of
    /// [`TilePlanes::from_halves`] of a film that has them as its halves, to the bit.
    ///
    /// # Panics
    /// If a rendering has fewer pixels than that.
    pub fn from_both(
        (width, height): (usize, usize),
        tile: Tile,
        display: &Display,
        renderings: [Rendering<'_>; 2],
    ) -> Self {
        let weights = weights(renderings.map(|rendering| rendering.spp));
        let mut scratch = Scratch::EMPTY;
        let shown = Shown::of_rows((width, height), &[tile], |y, columns, row| {
            let here = y * width + columns.start..y * width + columns.end;
            let halves = renderings.map(|rendering| &rendering.pixels[here.clone()]);
            halves_row(display, halves, weights, row, &mut scratch);
        });
        let planes = shown.into_planes(tile);
        let [a, b] = renderings.map(|rendering| rendering.rounding);
        Self { rounding: (a + b) * weights[0] * weights[1], ..planes }
    }

    /// Evidence on `image` from another rendering of the same view, both `width`×`height` pixels. `None` if
    /// their difference says nothing about the noise: see [`residual_scale`].
    ///
    /// # Panics
    /// If a rendering has fewer pixels than that.
    pub fn from_pair(
        (width, height): (usize, usize),
        tile: Tile,
        display: &Display,
        (image, other): (Rendering<'_>, Rendering<'_>),
        samples: Samples,
    ) -> Option<Self> {
        let scale = residual_scale(image.spp, other.spp, samples)?;
        let mut scratch = Scratch::EMPTY;
        let shown = Shown::of_rows((width, height), &[tile], |y, columns, row| {
            let here = y * width + columns.start..y * width + columns.end;
            let pair = [image, other].map(|rendering| &rendering.pixels[here.clone()]);
            pair_row(display, pair, scale, row, &mut scratch);
        });
        let planes = shown.into_planes(tile);
        Some(Self { rounding: (image.rounding + other.rounding) * scale * scale, ..planes })
    }

    /// Evidence from a noise-free reference: the whole image, display-encoded, row-major.
    ///
    /// # Panics
    /// If `reference` has fewer pixels than the film.
    pub fn from_reference(film: &Film, display: &Display, reference: &[Rgb], tile: Tile) -> Self {
        let grid = film.grid();
        Self::gather(grid.size(), tile, |x, y| {
            let pixel = y * grid.width() + x;
            let shown = display.encode(film.pixel(tile.owner(grid, x, y), pixel));
            middle_and_difference(shown, reference[pixel], 1.0)
        })
    }
}

/// What lies in the middle between two pixels, and what they differ by, times `scale`.
#[inline(always)]
pub(crate) fn middle_and_difference(a: Rgb, b: Rgb, scale: f32) -> (Rgb, Rgb) {
    (std::array::from_fn(|c| 0.5 * (a[c] + b[c])), std::array::from_fn(|c| (a[c] - b[c]) * scale))
}

/// Y′, R′ and B′ of pixels, as far as a plane or a row has them: G′ follows.
type Channels<T> = [T; 3];
/// Where a row of pixels of the image goes, and of the residual.
type Row<'a> = [Channels<&'a mut [f32]>; 2];

/// Some pixels of a row.
fn part<'a>(row: &'a mut Row<'_>, pixels: Range<usize>) -> Row<'a> {
    row.each_mut().map(|channels| channels.each_mut().map(|plane| &mut plane[pixels.clone()]))
}

/// The squared noise of a pixel from Y′, R′ and B′: as far as it is coloured, in units in which more than grey noise is strongly
/// coloured, and as greys.
#[inline(always)]
fn tint([luma, r, b]: Channels<f32>, [noise, noise_r, noise_b]: Channels<f32>) -> [f32; 2] {
    let larger = |a: f32, b: f32| if a > b { a } else { b };
    // Noise in the colour of the picture has one ratio to all channels
    let ratio = noise / larger(luma, UNSEEN);
    let other = larger((noise_r - r * ratio).abs(), (noise_b - b * ratio).abs()) * (1.0 / OTHER_COLOUR);
    let [from_r, from_b] = SATURATED.map(|limit| 1.0 / limit);
    let saturated = larger((noise_r - noise).abs() * from_r, (noise_b - noise).abs() * from_b);
    let coloured = larger(other, saturated);
    [coloured * coloured, noise * noise]
}

/// Adds the [`tint`] of the pixels of a row to the sums of their columns, and the squares of it.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn add_tints(image: Channels<&[f32]>, residual: Channels<&[f32]>, sums: &mut [[f32; TINTED]; 4]) {
    let n = image[0].len();
    let [coloured, grey, coloured_squares, grey_squares] = sums.each_mut().map(|sums| &mut sums[..n]);
    let ([luma, r, b], [noise, noise_r, noise_b]) = (image, residual);
    let (luma, r, b) = (&luma[..n], &r[..n], &b[..n]);
    let (noise, noise_r, noise_b) = (&noise[..n], &noise_r[..n], &noise_b[..n]);
    for i in 0..n {
        let [of_colour, of_grey] = tint([luma[i], r[i], b[i]], [noise[i], noise_r[i], noise_b[i]]);
        coloured[i] += of_colour;
        grey[i] += of_grey;
        coloured_squares[i] += of_colour * of_colour;
        grey_squares[i] += of_grey * of_grey;
    }
}

/// Pixels of the picture that planes with their halos show, each of which is worked out once.
struct Region {
    size: (usize, usize),
    rows: Range<usize>,
    columns: Range<usize>,
}

impl Region {
    /// Of tiles beside each other.
    fn new(size: (usize, usize), tiles: &[Tile]) -> Self {
        let (width, height) = size;
        let rows = reach(tiles[0].y, tiles[0].height, height);
        let of_tiles = || tiles.iter().map(|tile| reach(tile.x, tile.width, width));
        let columns = of_tiles().fold(of_tiles().next().unwrap_or_default(), |all, reach| {
            all.start.min(reach.start)..all.end.max(reach.end)
        });
        Self { size, rows, columns }
    }

    fn pixels(&self) -> usize {
        self.rows.len() * self.columns.len()
    }

    /// The plane of one of the tiles, from the pixels of the region; returns its rows and columns.
    fn pad<T: Copy>(&self, tile: Tile, shown: &[T], plane: &mut Vec<T>) -> (usize, usize) {
        let padded = |edge: usize| edge.next_multiple_of(HALO) + 2 * HALO;
        let (rows, columns) = (padded(tile.height), padded(tile.width));
        let (width, height) = self.size;
        // Columns of the plane that show the picture and no mirror image of it
        let inside = HALO.saturating_sub(tile.x)..(width + HALO - tile.x).min(columns);
        let first = tile.x + inside.start - HALO - self.columns.start;
        plane.resize(rows * columns, shown[0]);
        for (place, row) in plane.chunks_exact_mut(columns).enumerate() {
            let y = mirror(tile.y + place, height) - self.rows.start;
            let shown = &shown[y * self.columns.len()..][..self.columns.len()];
            row[inside.clone()].copy_from_slice(&shown[first..][..inside.len()]);
            for i in (0..inside.start).chain(inside.end..columns) {
                row[i] = shown[mirror(tile.x + i, width) - self.columns.start];
            }
        }
        (rows, columns)
    }
}

/// Image and residual of tiles beside each other in a row of the grid.
pub(crate) struct Shown {
    region: Region,
    planes: [Channels<Vec<f32>>; 2],
}

impl Shown {
    /// What `row(y, columns, to)` makes of each row of the picture. `tiles` are beside each other.
    fn of_rows(
        size: (usize, usize),
        tiles: &[Tile],
        mut row: impl FnMut(usize, Range<usize>, Row<'_>),
    ) -> Self {
        let region = Region::new(size, tiles);
        let mut planes = BUFFERS.with_borrow_mut(|buffers| std::mem::take(&mut buffers.shown));
        planes.as_flattened_mut().iter_mut().for_each(|plane| plane.resize(region.pixels(), 0.0));
        let width = region.columns.len();
        for (n, y) in region.rows.clone().enumerate() {
            let to = planes
                .each_mut()
                .map(|channels| channels.each_mut().map(|plane| &mut plane[n * width..][..width]));
            row(y, region.columns.clone(), to);
        }
        Self { region, planes }
    }

    /// Whether the coloured noise of some square of a tile is stronger than the grey noise of all, by the root mean square or by
    /// that of fourth order, as the worst window is judged, and seen.
    fn is_coloured(&self, tile: Tile) -> bool {
        let Region { rows, columns, .. } = &self.region;
        let (top, left) = (tile.y - rows.start, tile.x - columns.start);
        let mut most = [0.0f32; 4];
        for y in (top..top + tile.height).step_by(SQUARE) {
            let bottom = (y + SQUARE).min(top + tile.height);
            for x in (left..left + tile.width).step_by(TINTED) {
                let right = (x + TINTED).min(left + tile.width);
                let mut sums = [[0.0; TINTED]; 4];
                for row in y..bottom {
                    let here = row * columns.len() + x..row * columns.len() + right;
                    let [image, residual] = self
                        .planes
                        .each_ref()
                        .map(|channels| channels.each_ref().map(|plane| &plane[here.clone()]));
                    add_tints(image, residual, &mut sums);
                }
                let mean = |square: &[f32]| square.iter().sum::<f32>() / (square.len() * (bottom - y)) as f32;
                for (most, sums) in most.iter_mut().zip(&sums) {
                    *most = sums[..right - x].chunks(SQUARE).map(mean).fold(*most, f32::max);
                }
            }
        }
        let [coloured, grey, coloured_squares, grey_squares] = most;
        let unseen = UNSEEN * UNSEEN;
        coloured > grey + unseen || coloured_squares > grey_squares + unseen * unseen
    }

    /// That of [`TilePlanes::from_halves`].
    pub(crate) fn of_halves(film: &Film, display: &Display, tiles: &[Tile]) -> Self {
        let grid = film.grid();
        // Columns in a row whose pixels have as many samples, and these: they change from tile to tile, and from pixel to
        // pixel where some were kept out
        let mut runs: Vec<(Range<usize>, [u64; 2])> = Vec::with_capacity(tiles.len() + 2);
        let (mut row_of_runs, mut scratch) = (None, Scratch::EMPTY);
        Self::of_rows(grid.size(), tiles, |y, columns, mut row| {
            let row_of_tiles = grid.index_at(0, y);
            if film.rejected() > 0 || row_of_runs != Some(row_of_tiles) {
                row_of_runs = Some(row_of_tiles);
                runs.clear();
                for x in columns.clone() {
                    let counts = film.pixel_counts(row_of_tiles + grid.index_at(x, 0), y * grid.width() + x);
                    match runs.last_mut() {
                        Some((run, of_run)) if *of_run == counts => run.end = x + 1,
                        _ => runs.push((x..x + 1, counts)),
                    }
                }
            }
            let halves = [0, 1].map(|half| film.half_row(half, y));
            for (run, counts) in &runs {
                let to = part(&mut row, run.start - columns.start..run.end - columns.start);
                match halves {
                    [Some(a), Some(b)] => {
                        let halves = [&a[run.clone()], &b[run.clone()]];
                        let weights = weights(counts.map(|n| n as f64));
                        halves_row(display, halves, weights, to, &mut scratch);
                    }
                    // One half alone gives no evidence
                    [a, _] => {
                        let one = &a.unwrap_or_default()[run.clone()];
                        pair_row(display, [one; 2], 0.0, to, &mut scratch);
                    }
                }
            }
        })
    }

    /// The planes of one of the tiles.
    pub(crate) fn planes(&self, tile: Tile) -> TilePlanes {
        let greys = BUFFERS.with_borrow_mut(|buffers| std::mem::take(&mut buffers.planes));
        let padded = |channel: usize, planes: [Vec<f32>; 2]| {
            let mut of = self.planes.iter();
            planes.map(|mut plane| {
                let size = of.next().map(|from| self.region.pad(tile, &from[channel], &mut plane));
                Plane::new(size.unwrap_or_default(), plane)
            })
        };
        let [image, residual] = padded(0, greys);
        let colour = self.is_coloured(tile).then(|| {
            let [red, blue] = [1, 2].map(|channel| padded(channel, Default::default()));
            let [red_image, red_residual] = red;
            let [blue_image, blue_residual] = blue;
            ColourPlanes {
                image: with_green(&image, red_image, blue_image),
                residual: with_green(&residual, red_residual, blue_residual),
            }
        });
        let inner = Tile { x: HALO, y: HALO, ..tile };
        TilePlanes { image, residual, rounding: 0.0, viewing: Viewing::default(), colour, inner, place: tile }
    }

    fn into_planes(self, tile: Tile) -> TilePlanes {
        let planes = self.planes(tile);
        self.recycle();
        planes
    }

    /// Returns its memory to this thread's buffers.
    pub(crate) fn recycle(self) {
        BUFFERS.with_borrow_mut(|buffers| buffers.shown = self.planes);
    }
}

/// Pixels along an edge of the picture that the planes of a tile show, which has so many of them from one on.
fn reach(from: usize, count: usize, edge: usize) -> Range<usize> {
    let places = || (0..count.next_multiple_of(HALO) + 2 * HALO).map(|place| mirror(from + place, edge));
    let least = places().min().unwrap_or(0);
    least..places().max().unwrap_or(0) + 1
}

/// Image and residual of a row of pixels from both halves, each channel by itself, by their weights in the mean of all samples. A verdict spends
/// most of its time here and in the vision model: all of it in vector instructions, and in the nearest cache.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn halves_row(
    display: &Display,
    halves: [&[Rgb]; 2],
    weights: [f32; 2],
    mut row: Row<'_>,
    Scratch { codes, shown }: &mut Scratch,
) {
    let [[width, ..], _] = row.each_ref().map(|channels| channels.each_ref().map(|plane| plane.len()));
    for from in (0..width).step_by(PIXELS) {
        let n = PIXELS.min(width - from);
        let [mean, a, b] = &mut *codes;
        split_channels(&halves[0][from..][..n], a);
        split_channels(&halves[1][from..][..n], b);
        for ((mean, a), b) in mean.iter_mut().zip(&*a).zip(&*b) {
            for ((mean, &a), &b) in mean[..n].iter_mut().zip(&a[..n]).zip(&b[..n]) {
                *mean = blend([a, b], weights);
            }
        }
        show(display, codes, shown, n);
        let [image, residual] = &mut row;
        let of_channels =
            [shown.each_ref(), codes.each_ref().map(|of| &of[0]), codes.each_ref().map(|of| &of[2])];
        for ((image, residual), [mean, a, b]) in image.iter_mut().zip(residual).zip(of_channels) {
            let (mean, a, b) = (&mean[..n], &a[..n], &b[..n]);
            let (image, residual) = (&mut image[from..][..n], &mut residual[from..][..n]);
            for i in 0..n {
                [image[i], residual[i]] = of_mean([mean[i], a[i], b[i]], weights);
            }
        }
    }
}

/// Middle and difference, times `scale`, of a row of pixels of two pictures.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn pair_row(
    display: &Display,
    pair: [&[Rgb]; 2],
    scale: f32,
    mut row: Row<'_>,
    Scratch { codes, shown }: &mut Scratch,
) {
    let [[width, ..], _] = row.each_ref().map(|channels| channels.each_ref().map(|plane| plane.len()));
    for from in (0..width).step_by(PIXELS) {
        let n = PIXELS.min(width - from);
        for (picture, codes) in pair.into_iter().zip(&mut codes[1..]) {
            split_channels(&picture[from..][..n], codes);
        }
        show(display, &mut codes[1..], &mut shown[1..], n);
        let [image, residual] = &mut row;
        let of_channels =
            [shown.each_ref(), codes.each_ref().map(|of| &of[0]), codes.each_ref().map(|of| &of[2])];
        for ((image, residual), [_, a, b]) in image.iter_mut().zip(residual).zip(of_channels) {
            let (a, b) = (&a[..n], &b[..n]);
            let (image, residual) = (&mut image[from..][..n], &mut residual[from..][..n]);
            for i in 0..n {
                (image[i], residual[i]) = (0.5 * (a[i] + b[i]), (a[i] - b[i]) * scale);
            }
        }
    }
}

/// Replaces linear light of pictures by display values, and adds their luminances Y′.
#[inline(always)]
fn show(display: &Display, codes: &mut [[[f32; PIXELS]; 3]], shown: &mut [[f32; PIXELS]], n: usize) {
    for (codes, shown) in codes.iter_mut().zip(shown) {
        encode_channels(display, codes.each_mut().map(|channel| &mut channel[..n]));
        let [r, g, b] = &*codes;
        for (((shown, r), g), b) in shown[..n].iter_mut().zip(r).zip(g).zip(b) {
            *shown = luminance([*r, *g, *b]);
        }
    }
}

/// Image and residual of a pixel from the display luminances of the mean of all samples and of both halves, and the
/// weights of these in the mean, 0 where one of them has no samples.
///
/// Where the display is as good as linear, the mean lies between the halves as its weights say, and is the middle of
/// what is compared. At a white dot that one half alone has, it is as white as that half: what is seen of the dot is then
/// not its share, but all that the two differ by, and the middle lies halfway between them.
#[inline(always)]
fn of_mean([mean, a, b]: [f32; 3], [of_a, of_b]: [f32; 2]) -> [f32; 2] {
    let apart = (a - b).abs();
    let held = held([mean, a, b], [of_a, of_b]);
    let scale = (of_a * of_b).sqrt();
    let scale = if scale > 0.0 { scale + (1.0 - scale) * held } else { 0.0 };
    [mean - 0.5 * apart * held, (a - b) * scale]
}

/// How far the display holds the mean at the brighter of two halves: 0 if it lies between them as their weights say, 1 if
/// it is as bright as that half. Squared, so that the bend of a tone curve within the noise counts for nothing. Where the
/// brighter half has nearly all samples, the mean is as bright as that half in any case: below a fiftieth of the samples,
/// the darker half tells the less, the fewer it has.
#[inline(always)]
pub fn held([mean, a, b]: [f32; 3], [of_a, of_b]: [f32; 2]) -> f32 {
    let linear = of_a * a + of_b * b;
    let of_darker = if a < b { of_a } else { of_b };
    let most = (a - b).abs() * of_darker;
    let drawn = if most > 0.0 { ((mean - linear) / most).clamp(0.0, 1.0) } else { 0.0 };
    drawn * drawn * (50.0 * of_darker).min(1.0)
}

/// The image coordinate that shows at `place` of a plane that begins [`HALO`] before the image, mirrored at
/// its first and last pixel.
fn mirror(place: usize, edge: usize) -> usize {
    let period = (2 * (edge - 1)).max(1);
    let distance = place.abs_diff(HALO) % period;
    distance.min(period - distance).min(edge - 1)
}

/// A picture of linear radiance, row-major, with its samples per pixel.
#[derive(Clone, Copy, Debug)]
pub struct Rendering<'a> {
    /// Linear radiance, width × height pixels.
    pub pixels: &'a [Rgb],
    /// Samples per pixel, above 0.
    pub spp: f64,
    /// Variance of the rounding of its display values; 0 for pictures in floating point.
    pub rounding: f32,
}

/// How two pictures of one scene were made from samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Samples {
    /// They share no samples.
    Independent,
    /// The smaller set of samples is part of the larger one: two stages of one progressive rendering.
    Nested,
}

/// The factor that turns the difference of two pictures into a residual with the noise of the first one,
/// which has `image` samples per pixel; the other has `other`.
///
/// Independent samples: Var(difference) = σ²(1/image + 1/other); nested ones: σ²·|1/image − 1/other|. The
/// noise of the first picture is σ²/image. `None` if one has no samples or nested ones have the same number:
/// the difference then says nothing about the noise.
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
    use crate::tile::TileGrid;
    use noisefloor_testkit::Noise;

    #[test]
    fn residual_has_the_noise_of_the_mean_also_when_halves_are_uneven() {
        let grid = TileGrid::new(64, 64, 64).unwrap();
        for batches in [&[50u64, 50][..], &[10, 90], &[400, 100]] {
            let (mut film, mut noise) = (Film::new(grid), Noise::new(7));
            for &n in batches {
                // Mean of n samples of standard deviation 0.1 around 0.5.
                let batch: Vec<_> =
                    (0..4096).map(|_| [0.5 + 0.1 * noise.normal() as f32 / (n as f32).sqrt(); 3]).collect();
                film.add(0, n, &batch).unwrap();
            }
            let planes = TilePlanes::from_halves(&film, &Display::SRGB, grid.tile(0));
            let mean_of = |values: &Plane, of: &dyn Fn(f32) -> f32| {
                values.values().iter().map(|&v| f64::from(of(v))).sum::<f64>() / values.values().len() as f64
            };
            let mean = mean_of(&planes.image, &|v| v) as f32;
            let spread = mean_of(&planes.image, &|v| (v - mean).powi(2));
            let residual = mean_of(&planes.residual, &|v| v * v);
            // Each variance estimate over 4096 pixels errs by √(2/4096) = 2.2 %; 13 % is 4 σ of their ratio:
            // 1 in 16,000.
            assert!((residual / spread - 1.0).abs() < 0.13, "{batches:?}: {residual} against {spread}");
        }
    }

    /// Of what one half alone has and the display holds at white, all is seen, whichever half it is, and however many
    /// samples it has; of what lies between the halves as it should, its share.
    #[test]
    fn a_white_dot_is_seen_as_a_whole() {
        let (dot, wall) = (1.0, 0.4);
        for [one, other] in [[0.5, 0.5], [0.8, 0.2], [0.2, 0.8]] {
            for (halves, sign) in [([dot, wall], 1.0), ([wall, dot], -1.0)] {
                let [middle, residual] = of_mean([dot, halves[0], halves[1]], [one, other]);
                let ends = [middle + 0.5 * residual, middle - 0.5 * residual];
                assert!((residual - sign * (dot - wall)).abs() < 1e-6, "{residual}");
                assert!((ends[0] - halves[0]).abs() < 1e-6 && (ends[1] - halves[1]).abs() < 1e-6, "{ends:?}");
                let mean = one * halves[0] + other * halves[1];
                let [middle, residual] = of_mean([mean, halves[0], halves[1]], [one, other]);
                let scale = (one * other).sqrt();
                assert!(
                    (middle - mean).abs() < 1e-6 && (residual - scale * (halves[0] - halves[1])).abs() < 1e-6
                );
            }
        }
        // A half without samples is no evidence, and neither are halves that are alike
        assert_eq!(of_mean([0.4, 0.4, 0.0], [1.0, 0.0]), [0.4, 0.0]);
        assert_eq!(of_mean([0.4, 0.4, 0.4], [0.3, 0.7]), [0.4, 0.0]);
    }

    /// Greys are enough for noise without colour, for noise in the colour of a wall, and for what nobody sees; not for dots of
    /// one colour. Halves that are exchanged have the same planes, with the other sign.
    #[test]
    fn colour_is_looked_at_where_noise_is_coloured() {
        let grid = TileGrid::new(80, 48, 40).unwrap();
        let planes = |wall: Rgb, colour: Rgb, strength: f32, exchanged: bool| {
            let mut noise = Noise::new(9);
            let mut halves = [0, 1].map(|_| {
                let dot = |x: usize| if x % 80 < 40 && noise.uniform() < 0.02 { strength } else { 0.0 };
                let pixel = |dot: f32| std::array::from_fn(|c| wall[c] + dot * colour[c]);
                (0..80 * 48).map(dot).map(pixel).collect::<Vec<Rgb>>()
            });
            if exchanged {
                halves.swap(0, 1);
            }
            let mut film = Film::new(grid);
            for half in &halves {
                for tile in grid.tiles() {
                    let batch: Vec<Rgb> = tile.rows(80).flatten().map(|i| half[i]).collect();
                    film.add(tile.index, 10, &batch).unwrap();
                }
            }
            [0, 1].map(|tile| TilePlanes::from_halves(&film, &Display::SRGB, grid.tile(tile)))
        };
        let (grey, red) = ([0.2; 3], [0.3, 0.06, 0.04]);
        let in_colour = |wall, colour, strength| -> [bool; 2] {
            planes(wall, colour, strength, false).map(|planes| planes.colour.is_some())
        };
        assert_eq!(in_colour(grey, [1.0; 3], 0.1), [false; 2]);
        assert_eq!(in_colour(red, red, 0.5), [false; 2]);
        assert_eq!(in_colour(grey, [0.0, 0.0, 1.0], 0.001), [false; 2]);
        for colour in [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 1.0]] {
            assert_eq!(in_colour(grey, colour, 0.1), [true, false], "{colour:?}");
        }
        let [one, other] = [false, true].map(|exchanged| planes(grey, [0.0, 0.02, 1.0], 4.0, exchanged));
        let [one, other] = [&one[0], &other[0]].map(|planes| planes.colour.as_ref().unwrap());
        assert_eq!(one.image, other.image);
        for (one, other) in one.residual.iter().zip(&other.residual) {
            assert!(one.values().iter().zip(other.values()).all(|(one, other)| *one == -other));
        }
        // What is shown, and by what it differs
        let pixel = |planes: &[Plane; 3], place| planes.each_ref().map(|plane| plane[place]);
        let wall = Display::SRGB.encode(grey);
        let dots = (0..56).flat_map(|y| (0..56).map(move |x| (y, x)));
        let dots = dots.filter(|&place| pixel(&one.residual, place)[2].abs() > 0.3);
        assert!(dots.clone().count() > 20);
        for place in dots {
            let (middle, residual) = (pixel(&one.image, place), pixel(&one.residual, place));
            // Of what is white in the mean, too, all is seen
            assert!((residual[2].abs() - (1.0 - wall[2])).abs() < 1e-3, "{residual:?}");
            assert!((middle[2] - 0.5 * (1.0 + wall[2])).abs() < 1e-3, "{middle:?}");
            assert!(residual[0].abs() < 2e-3 && residual[1] * residual[2] > 0.0, "{residual:?}");
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

    /// Two pictures of one film's halves say of their mean what the film says of it.
    #[test]
    fn a_pair_of_pictures_is_evidence_as_halves_are() {
        let grid = TileGrid::new(32, 32, 32).unwrap();
        let mut noise = Noise::new(3);
        let mut half = |n: f32| -> Vec<Rgb> {
            (0..1024).map(|_| [0.5 + 0.1 * noise.normal() as f32 / n.sqrt(); 3]).collect()
        };
        let (a, b) = (half(300.0), half(100.0));
        let mut film = Film::new(grid);
        film.add(0, 300, &a).unwrap();
        film.add(0, 100, &b).unwrap();
        let by_film = TilePlanes::from_halves(&film, &Display::SRGB, grid.tile(0));
        let rendering = |pixels, spp| Rendering { pixels, spp, rounding: 0.01 };
        // Half A alone has √(400/300) times the noise of both together.
        let pair = (rendering(&a, 300.0), rendering(&b, 100.0));
        let by_pair =
            TilePlanes::from_pair((32, 32), grid.tile(0), &Display::SRGB, pair, Samples::Independent)
                .unwrap();
        for (f, p) in by_film.residual.values().iter().zip(by_pair.residual.values()) {
            // The bend of the display within the noise, of 3.5 % where it is strongest, counts for 3·10⁻⁴ of it
            assert!((f * (400.0f32 / 300.0).sqrt() - p).abs() < 1e-6 + 1e-3 * p.abs());
        }
        assert!((by_pair.rounding - 0.02 * 0.25).abs() < 1e-6);
        let both = [rendering(&a, 300.0), rendering(&b, 100.0)];
        let [one, other] = [both, [both[1], both[0]]]
            .map(|both| TilePlanes::from_both((32, 32), grid.tile(0), &Display::SRGB, both));
        assert_eq!((&one.image, &one.residual), (&by_film.image, &by_film.residual));
        assert_eq!(one.image, other.image);
        assert!(one.residual.values().iter().zip(other.residual.values()).all(|(one, other)| *one == -other));
        assert!((one.rounding - 0.02 * 0.75 * 0.25).abs() < 1e-6);
    }

    /// Whatever tiles are shown together, however large they are and whatever samples they have, each pixel is what the
    /// halves of the film have there.
    #[test]
    fn tiles_shown_together_are_shown_as_alone_and_pixel_by_pixel() {
        let display = crate::ToneMapping::Reinhard { key: 0.18, white: Some(2.0) }.settle(&[[0.3; 3]]);
        for (size, edge) in [((150, 45), 50), ((117, 33), 16), ((9, 40), 32), ((131, 20), 26)] {
            for lost in [false, true] {
                let grid = TileGrid::new(size.0, size.1, edge).unwrap();
                let (mut film, mut noise) = (Film::new(grid), Noise::new(23));
                for tile in grid.tiles() {
                    // Neighbours have other samples, or as many
                    for spp in [8, 8 << (tile.index / 2 % 2), 3] {
                        let mut batch: Vec<Rgb> =
                            (0..tile.pixels()).map(|_| [0, 1, 2].map(|_| noise.uniform() as f32)).collect();
                        if lost {
                            batch.iter_mut().step_by(7).for_each(|pixel| pixel[1] = f32::NAN);
                        }
                        film.add(tile.index, spp, &batch).unwrap();
                    }
                }
                let pixel = |tile: Tile, x: usize, y: usize| {
                    let (owner, at) = (tile.owner(grid, x, y), y * size.0 + x);
                    let [(a, of_a), (b, of_b)] = film.pixel_halves(owner, at);
                    let shown = [film.pixel(owner, at), a, b].map(|pixel| display.luma(pixel));
                    of_mean(shown, weights([of_a as f64, of_b as f64]))
                };
                let tiles: Vec<Tile> = grid.tiles().collect();
                for run in tiles.chunk_by(|a, b| a.y == b.y).flat_map(|row| row.chunks(3)) {
                    let together = Shown::of_halves(&film, &display, run);
                    for &tile in run {
                        let planes = together.planes(tile);
                        assert_eq!(planes, TilePlanes::from_halves(&film, &display, tile), "{tile:?}");
                        let (rows, columns) = planes.image.size();
                        for (y, x) in (0..rows).flat_map(|y| (0..columns).map(move |x| (y, x))) {
                            let place = (mirror(tile.x + x, size.0), mirror(tile.y + y, size.1));
                            let expected = pixel(tile, place.0, place.1);
                            assert_eq!(
                                [planes.image[(y, x)], planes.residual[(y, x)]],
                                expected,
                                "{place:?}"
                            );
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn the_halo_reads_neighbours_and_mirrors_the_image_beyond_its_edge() {
        let grid = TileGrid::new(112, 48, 32).unwrap();
        let plane =
            |i: usize| TilePlanes::gather((112, 48), grid.tile(i), |x, y| ([x as f32; 3], [y as f32; 3]));
        let close = |a: f32, b: f32| (a - b).abs() < 1e-4;
        let first = plane(0);
        assert_eq!(first.image.size(), (48, 48));
        assert!(
            close(first.image[(8, 8)], 0.0)
                && close(first.image[(8, 7)], 1.0)
                && close(first.image[(8, 40)], 32.0)
        );
        let last = plane(7); // rows 32…47, columns 96…111
        assert_eq!((last.image.size(), last.inner.width), ((32, 32), 16));
        assert!(close(last.image[(8, 8)], 96.0) && close(last.residual[(8, 8)], 32.0));
        assert!(
            close(last.image[(8, 24)], 110.0) && close(last.residual[(24, 8)], 46.0),
            "mirrored at 111 and 47"
        );
        // Images smaller than the halo are mirrored more than once.
        assert!((0..200).all(|place| mirror(place, 1) == 0 && mirror(place, 3) < 3));
    }
}
