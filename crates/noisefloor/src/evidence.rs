//! What a tile is judged by: its display luminance, and its noise.

use crate::display::{Display, luma_row, luminance};
use crate::film::{Film, blend_row, weights};
pub use crate::plane::Plane;
use crate::rgb::Rgb;
use crate::tile::{Tile, TileGrid};
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
    columns: Columns,
    scratch: Scratch,
}

/// Which columns of the image a row of the planes shows.
#[derive(Default)]
struct Columns {
    all: Vec<usize>,
    /// Those that are not mirrored: they follow one another.
    inside: Range<usize>,
}

impl Columns {
    /// Runs of columns that show one column of tiles, with the place of that in the grid.
    fn by_tile(&self, grid: TileGrid) -> Vec<(Range<usize>, usize)> {
        // The tile's own, and one to each side, as a rule
        let mut runs: Vec<(Range<usize>, usize)> = Vec::with_capacity(3);
        for (at, &x) in self.all.iter().enumerate() {
            let column = grid.index_at(x, 0);
            match runs.last_mut() {
                Some((run, of)) if *of == column => run.end = at + 1,
                _ => runs.push((at..at + 1, column)),
            }
        }
        runs
    }

    /// Takes a row of the planes from one of the image.
    fn read(&self, image: &[Rgb], row: &mut [Rgb]) {
        let Range { start, end } = self.inside;
        let first = self.all[start];
        row[start..end].copy_from_slice(&image[first..first + (end - start)]);
        for i in (0..start).chain(end..row.len()) {
            row[i] = image[self.all[i]];
        }
    }
}

/// A row of each of several pictures, one after the other.
#[derive(Default)]
struct Scratch {
    linear: Vec<Rgb>,
    shown: Vec<f32>,
}

thread_local! {
    static BUFFERS: RefCell<Buffers> = RefCell::default();
}

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
    /// The tile itself within the planes: rows and columns of the planes that belong to it.
    pub inner: Tile,
    /// The tile in its picture.
    pub place: Tile,
}

impl TilePlanes {
    /// Collects the planes of a tile of an image of `width`×`height` pixels, both at least 1; `pixel(x, y)`
    /// gives the display-encoded picture and its residual at image coordinates.
    pub fn gather(
        (width, height): (usize, usize),
        tile: Tile,
        pixel: impl Fn(usize, usize) -> (Rgb, Rgb),
    ) -> Self {
        Self::fill((width, height), tile, |y, columns, _, image, residual| {
            for (&x, (image, residual)) in columns.all.iter().zip(image.iter_mut().zip(residual)) {
                let (shown, noise) = pixel(x, y);
                (*image, *residual) = (luminance(shown), luminance(noise));
            }
        })
    }

    /// Share of the pixels of the tile that carry its noise: (Σr²)² / (N·Σr⁴) of the residuals r, the inverse of
    /// their kurtosis. A third if they are normal and equally strong everywhere, 1/N if one pixel has all of it,
    /// 0 without noise. An energy of noise that is estimated from one residual for each pixel has a relative
    /// variance of about 1/(share·N).
    pub(crate) fn noise_spread(&self) -> f32 {
        let (mut squares, mut fourths) = (0.0f64, 0.0f64);
        for r in self.residual.inside(self.inner) {
            let square = f64::from(r) * f64::from(r);
            (squares, fourths) = (squares + square, fourths + square * square);
        }
        if fourths > 0.0 { (squares * squares / (fourths * self.inner.pixels() as f64)) as f32 } else { 0.0 }
    }

    /// As [`TilePlanes::gather`] of `N` linear pictures. `read(y, columns, pictures, numbers)` reads the pixels of them in
    /// row `y` and these columns, and two numbers more for each; `pixel` makes image and residual of the display
    /// luminances and these numbers. A verdict spends most of its time here: rows are read and tone mapped channel by
    /// channel, in vector instructions.
    fn gather_linear<const N: usize>(
        size: (usize, usize),
        tile: Tile,
        display: &Display,
        mut read: impl FnMut(usize, &Columns, [&mut [Rgb]; N], [&mut [f32]; 2]),
        pixel: impl Fn([f32; N], [f32; 2]) -> [f32; 2] + Copy,
    ) -> Self {
        Self::fill(size, tile, |y, columns, scratch, image, residual| {
            let width = columns.all.len();
            let Scratch { linear, shown } = scratch;
            linear.resize(N * width, [0.0; 3]);
            shown.resize(N * width, 0.0);
            let mut pictures = linear.chunks_exact_mut(width);
            let pictures = std::array::from_fn(|_| pictures.next().expect("one for each picture"));
            read(y, columns, pictures, [&mut *image, &mut *residual]);
            luma_row(display, linear, shown);
            pixel_row(shown, image, residual, pixel);
        })
    }

    /// Fills both planes row by row: `row(y, columns, scratch, image, residual)` fills a row of each, with
    /// the pixels of the image that lie in row `y` and these columns.
    fn fill(
        (width, height): (usize, usize),
        tile: Tile,
        mut row: impl FnMut(usize, &Columns, &mut Scratch, &mut [f32], &mut [f32]),
    ) -> Self {
        let padded = |edge: usize| edge.next_multiple_of(HALO) + 2 * HALO;
        let shape = (padded(tile.height), padded(tile.width));
        let Buffers { planes: [mut image, mut residual], mut columns, mut scratch } = BUFFERS.take();
        image.resize(shape.0 * shape.1, 0.0);
        residual.resize(shape.0 * shape.1, 0.0);
        columns.all.clear();
        columns.all.extend((0..shape.1).map(|place| mirror(tile.x + place, width)));
        columns.inside = HALO.saturating_sub(tile.x)..(width + HALO - tile.x).min(shape.1);
        let rows = image.chunks_exact_mut(shape.1).zip(residual.chunks_exact_mut(shape.1));
        for (place, (image, residual)) in rows.enumerate() {
            row(mirror(tile.y + place, height), &columns, &mut scratch, image, residual);
        }
        BUFFERS.set(Buffers { planes: Default::default(), columns, scratch });
        let [image, residual] = [image, residual].map(|values| Plane::new(shape, values));
        let inner = Tile { x: HALO, y: HALO, ..tile };
        Self { image, residual, rounding: 0.0, viewing: Viewing::default(), inner, place: tile }
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
        let grid = film.grid();
        let mut runs = Vec::new();
        let read = |y, columns: &Columns, [mean, a, b]: [&mut [Rgb]; 3], [of_a, of_b]: [&mut [f32]; 2]| {
            for (half, row) in [&mut *a, &mut *b].into_iter().enumerate() {
                match film.half_row(half, y) {
                    Some(of_half) => columns.read(of_half, row),
                    None => row.fill([0.0; 3]),
                }
            }
            // The numbers of samples change from tile to tile, and from pixel to pixel where some were kept
            // out.
            let row_of_tiles = grid.index_at(0, y);
            let mut blend = |Range { start: from, end: to }: Range<usize>, column: usize| {
                let counts = film.pixel_counts(row_of_tiles + column, y * grid.width() + columns.all[from]);
                let weights = weights(counts.map(|n| n as f64));
                blend_row([&a[from..to], &b[from..to]], weights, &mut mean[from..to]);
                of_a[from..to].fill(weights[0]);
                of_b[from..to].fill(weights[1]);
            };
            if runs.is_empty() {
                runs = columns.by_tile(grid);
            }
            for (run, column) in &runs {
                if film.rejected() == 0 {
                    blend(run.clone(), *column);
                } else {
                    run.clone().for_each(|at| blend(at..at + 1, *column));
                }
            }
        };
        Self::gather_linear(grid.size(), tile, display, read, of_mean)
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
        let read = |y, columns: &Columns, [mean, a, b]: [&mut [Rgb]; 3], numbers: [&mut [f32]; 2]| {
            for (picture, rendering) in [&mut *a, &mut *b].into_iter().zip(renderings) {
                columns.read(&rendering.pixels[y * width..(y + 1) * width], picture);
            }
            blend_row([a, b], weights, mean);
            numbers.into_iter().zip(weights).for_each(|(row, weight)| row.fill(weight));
        };
        let planes = Self::gather_linear((width, height), tile, display, read, of_mean);
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
        let read = |y, columns: &Columns, pictures: [&mut [Rgb]; 2], _: [&mut [f32]; 2]| {
            for (picture, rendering) in pictures.into_iter().zip([image, other]) {
                columns.read(&rendering.pixels[y * width..(y + 1) * width], picture);
            }
        };
        let pixel = |[a, b]: [f32; 2], _| [0.5 * (a + b), (a - b) * scale];
        let planes = Self::gather_linear((width, height), tile, display, read, pixel);
        Some(Self { rounding: (image.rounding + other.rounding) * scale * scale, ..planes })
    }

    /// Evidence from a noise-free reference: the whole image, display-encoded, row-major.
    ///
    /// # Panics
    /// If `reference` has fewer pixels than the film.
    pub fn from_reference(film: &Film, display: &Display, reference: &[Rgb], tile: Tile) -> Self {
        let grid = film.grid();
        let read = |y, columns: &Columns, [picture]: [&mut [Rgb]; 1], [references, _]: [&mut [f32]; 2]| {
            for (pixel, &x) in picture.iter_mut().zip(&columns.all) {
                *pixel = film.pixel(tile.owner(grid, x, y), y * grid.width() + x);
            }
            for (number, &x) in references.iter_mut().zip(&columns.all) {
                *number = luminance(reference[y * grid.width() + x]);
            }
        };
        let pixel =
            |[shown]: [f32; 1], [reference, _]: [f32; 2]| [0.5 * (shown + reference), shown - reference];
        Self::gather_linear(grid.size(), tile, display, read, pixel)
    }
}

/// Image and residual of a row, which hold two numbers for each pixel, from these and `N` pictures, whose rows follow one
/// another.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn pixel_row<const N: usize, F: Fn([f32; N], [f32; 2]) -> [f32; 2]>(
    shown: &[f32],
    image: &mut [f32],
    residual: &mut [f32],
    pixel: F,
) {
    let width = image.len();
    let (shown, residual) = (&shown[..N * width], &mut residual[..width]);
    for i in 0..width {
        let mut of_pixel = [0.0; N];
        for (n, value) in of_pixel.iter_mut().enumerate() {
            *value = shown[n * width + i];
        }
        [image[i], residual[i]] = pixel(of_pixel, [image[i], residual[i]]);
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
