//! The model: two pictures → visible differences by band and channel → quality and a map.

use crate::bands::{Bands, sensitivity, sensitivity_row};
use crate::csf::{KNOTS, place};
use crate::error::VisionError;
use crate::masking::{BLUR_RADIUS, Blur, EPSILON, Masking, Row, blur, blur_row, contrast_row, mask_row};
use crate::photometry::{CHANNELS, Photometry, opponent_row};
use crate::pooling;
use crate::pyramid::{Size, expand_row, reduce};
use crate::viewing::Viewing;
use crate::workspace::VisionWorkspace;
use multiversion::multiversion;
use std::ops::Range;

/// Most pixels of a picture.
const MOST: usize = 1 << 28;

/// ColorVideoVDP for still pictures (Mantiuk et al. 2024) on one display: what is constant of it, worked out
/// once. About 20 kB.
#[derive(Clone, Debug)]
pub struct VisionModel {
    viewing: Viewing,
    pub(crate) photometry: Photometry,
    pub(crate) bands: Bands,
    masking: Masking,
    blur: Blur,
}

/// What [`VisionModel::compare`] found. It borrows the workspace, from which the map is made when it is asked
/// for.
#[derive(Debug)]
pub struct VisionComparison<'a> {
    jod: f64,
    sizes: Vec<Size>,
    workspace: &'a mut VisionWorkspace,
}

/// Columns and rows of a level that are worked on.
#[derive(Clone, Copy)]
pub(crate) struct Part {
    x: (usize, usize),
    y: (usize, usize),
}

impl Part {
    pub(crate) fn whole(size: Size) -> Self {
        Self { x: (0, size.width), y: (0, size.height) }
    }

    pub(crate) fn columns(self) -> Range<usize> {
        self.x.0..self.x.1
    }

    pub(crate) fn rows(self) -> Range<usize> {
        self.y.0..self.y.1
    }

    /// That part of a level 2^`band` times as coarse.
    pub(crate) fn at(self, band: usize) -> Self {
        let ends = |(from, to): (usize, usize)| (from >> band, to.div_ceil(1 << band));
        Self { x: ends(self.x), y: ends(self.y) }
    }

    /// With as many pixels more on each side, as far as there are any.
    pub(crate) fn wider(self, by: usize, size: Size) -> Self {
        let ends = |(from, to): (usize, usize), most: usize| (from.saturating_sub(by), (to + by).min(most));
        Self { x: ends(self.x, size.width), y: ends(self.y, size.height) }
    }

    pub(crate) fn new(columns: Range<usize>, rows: Range<usize>) -> Self {
        Self { x: (columns.start, columns.end), y: (rows.start, rows.end) }
    }
}

impl VisionModel {
    /// Works out what depends on the display alone.
    pub fn new(viewing: &Viewing) -> Self {
        Self {
            viewing: *viewing,
            photometry: Photometry::new(viewing),
            bands: Bands::new(viewing.pixels_per_degree()),
            masking: Masking::new(),
            blur: blur(),
        }
    }

    /// The display it is made for.
    pub fn viewing(&self) -> &Viewing {
        &self.viewing
    }

    /// How well `test` stands in for `reference`: both of `width`×`height` pixels, row by row, in code values
    /// of the display (in [0, 1], or in cd/m² if it is linear). Values beyond what the display shows are cut
    /// off. The result is that of ColorVideoVDP 0.5.7 within 0.01 JOD.
    ///
    /// # Errors
    /// If a side has fewer than two pixels, or the pictures are too large, of another size, or not finite.
    pub fn compare<'a>(
        &self,
        test: &[[f32; 3]],
        reference: &[[f32; 3]],
        (width, height): (usize, usize),
        workspace: &'a mut VisionWorkspace,
    ) -> Result<VisionComparison<'a>, VisionError> {
        let size = checked(width, height)?;
        for picture in [test, reference] {
            check_pixels(picture, size)?;
        }
        let sizes = self.sizes(size, self.bands.levels(size));
        workspace.fit(&sizes, CHANNELS);
        for (of, picture) in [test, reference].into_iter().enumerate() {
            self.load::<CHANNELS>(of, size, workspace, |y, row| {
                row.copy_from_slice(&picture[y * width..][..width])
            });
        }
        build::<CHANNELS>(&sizes, workspace);
        let baseband = sizes.len() - 1;
        let mut pooled = Vec::with_capacity(sizes.len());
        for (band, &size) in sizes[..baseband].iter().enumerate() {
            let whole = Part::whole(size);
            self.band::<CHANNELS>(band, size, (whole, whole), workspace);
            pooled.push(pool(&workspace.differences, band, size));
        }
        self.baseband(baseband, sizes[baseband], workspace);
        pooled.push(pool(&workspace.differences, baseband, sizes[baseband]));
        Ok(VisionComparison { jod: pooling::quality(&pooled), sizes, workspace })
    }

    /// Sizes of the levels of the pyramid.
    pub(crate) fn sizes(&self, size: Size, levels: usize) -> Vec<Size> {
        std::iter::successors(Some(size), |size| Some(size.half())).take(levels).collect()
    }

    /// Converts a picture into the finest level of picture `of`; `read(y, row)` gives its rows.
    pub(crate) fn load<const N: usize>(
        &self,
        of: usize,
        size: Size,
        workspace: &mut VisionWorkspace,
        mut read: impl FnMut(usize, &mut [[f32; 3]]),
    ) {
        let VisionWorkspace { gauss, rows, .. } = workspace;
        let codes = &mut rows.codes[..size.width];
        let [a, b, c] = &mut gauss[of];
        for y in 0..size.height {
            read(y, codes);
            let from = y * size.width;
            let mut planes = [&mut *a, &mut *b, &mut *c].into_iter().take(N);
            let mut row = || planes.next().map(|levels| &mut levels[0][from..][..size.width]);
            let mut planes: [&mut [f32]; N] = std::array::from_fn(|_| row().expect("at most three channels"));
            opponent_row(&self.photometry, codes, &mut planes);
        }
    }

    /// Visible differences of a band, of `N` channels. Contrasts are worked out in the first part of it,
    /// which has to have [`BLUR_RADIUS`] more pixels around, where there are any, than the second, in which
    /// differences are.
    pub(crate) fn band<const N: usize>(
        &self,
        band: usize,
        size: Size,
        (contrasts, differences): (Part, Part),
        workspace: &mut VisionWorkspace,
    ) {
        let blurs = size.width > BLUR_RADIUS && size.height > BLUR_RADIUS;
        for y in contrasts.rows() {
            self.contrasts::<N>(band, size, y, contrasts.columns(), blurs, workspace);
        }
        let VisionWorkspace { smaller, differences: planes, .. } = workspace;
        let columns = differences.columns();
        for y in differences.rows() {
            let around: [usize; 2 * BLUR_RADIUS + 1] =
                std::array::from_fn(|i| if blurs { reflected(y + i, size.height) } else { y });
            let smaller: [_; N] =
                std::array::from_fn(|c| around.map(|y| &smaller[c][y * size.width..][columns.clone()]));
            let mut rows = planes.iter_mut().map(|bands| &mut bands[band][y * size.width..][columns.clone()]);
            let rows: [&mut [f32]; N] = std::array::from_fn(|_| rows.next().expect("at most three channels"));
            mask_row(&self.masking, blurs.then_some(&self.blur), smaller, rows);
        }
    }

    /// Differences of contrasts and masking contrasts in row `y` of a band.
    fn contrasts<const N: usize>(
        &self,
        band: usize,
        size: Size,
        y: usize,
        columns: Range<usize>,
        blurs: bool,
        workspace: &mut VisionWorkspace,
    ) {
        let VisionWorkspace { gauss, differences, smaller, rows, .. } = workspace;
        for (channels, coarse) in gauss.iter().zip(&mut rows.coarse) {
            for (levels, coarse) in channels.iter().zip(coarse).take(N) {
                expand_row(&levels[band + 1], size, y, &mut rows.narrow, coarse);
            }
        }
        let coarse = &rows.coarse;
        let places = &mut rows.places[columns.clone()];
        place_row(&coarse[1][0][columns.clone()], places);
        let here = y * size.width + columns.start..y * size.width + columns.end;
        for channel in 0..N {
            let sensitivity = &mut rows.sensitivity[..columns.len()];
            sensitivity_row(&self.bands.curves[band][channel], places, sensitivity);
            let [test, reference] = std::array::from_fn(|of| Row {
                fine: &gauss[of][channel][band][here.clone()],
                coarse: &coarse[of][channel][columns.clone()],
                background: &coarse[of][0][columns.clone()],
            });
            let padded = &mut rows.padded[..columns.len() + 2 * BLUR_RADIUS];
            let difference = &mut differences[channel][band][here.clone()];
            let smaller = &mut smaller[channel][here.clone()];
            if blurs {
                contrast_row(
                    test,
                    reference,
                    sensitivity,
                    difference,
                    &mut padded[BLUR_RADIUS..][..columns.len()],
                );
                pad(padded);
                blur_row(&self.blur, padded, smaller);
            } else {
                contrast_row(test, reference, sensitivity, difference, smaller);
            }
        }
    }

    /// Visible differences of the coarsest level, beside its mean luminance.
    fn baseband(&self, band: usize, size: Size, workspace: &mut VisionWorkspace) {
        let VisionWorkspace { gauss, differences, .. } = workspace;
        let planes = |of: usize, channel: usize| &gauss[of][channel][band][..size.area()];
        let [test, reference] = [0, 1].map(|of| {
            let sum: f64 = planes(of, 0).iter().map(|&v| f64::from(v.max(0.01))).sum();
            (sum / size.area() as f64) as f32
        });
        let place = place(reference).clamp(0.0, (KNOTS - 1) as f32);
        for (channel, out) in differences.iter_mut().enumerate() {
            let s = sensitivity(&self.bands.baseband[channel], place);
            let pairs = planes(0, channel).iter().zip(planes(1, channel));
            for (out, (t, r)) in out[band].iter_mut().zip(pairs) {
                *out = ((t / test).min(1000.0) - (r / reference).min(1000.0)).abs() * s;
            }
        }
    }
}

impl VisionComparison<'_> {
    /// Quality in just-objectionable differences: 10 if nobody sees a difference, 9 if three of four people
    /// prefer the reference.
    pub fn jod(&self) -> f64 {
        self.jod
    }

    /// Where the difference is: JODs lost, row by row, in the size of the pictures. Ten times the raw map of
    /// ColorVideoVDP 0.5.7.
    pub fn map(&mut self) -> &[f32] {
        let VisionWorkspace { differences, map, rows, .. } = &mut *self.workspace;
        let last = self.sizes.len() - 1;
        for (band, (size, map)) in self.sizes.iter().zip(&mut *map).enumerate() {
            let weights = if band == last { pooling::BASEBAND } else { [1.0; CHANNELS] };
            let share = if band == 0 || band == last { 1.0 } else { 0.5 };
            for (i, out) in map[..size.area()].iter_mut().enumerate() {
                let values = differences.each_ref().map(|bands| bands[band][i]);
                *out = pooling::across_channels(values, weights) * share;
            }
        }
        collapse(map, 0, &self.sizes, &mut rows.narrow, &mut rows.places);
        let map = &mut map[0][..self.sizes[0].area()];
        pooling::lost_in(map);
        map
    }
}

/// Adds the bands of a map onto the finest, number `finest`.
pub(crate) fn collapse(
    map: &mut [Vec<f32>],
    finest: usize,
    sizes: &[Size],
    narrow: &mut [f32],
    row: &mut [f32],
) {
    for band in (finest..sizes.len() - 1).rev() {
        let (fine, coarse) = map.split_at_mut(band + 1);
        let size = sizes[band];
        for (y, out) in fine[band][..size.area()].chunks_exact_mut(size.width).enumerate() {
            let row = &mut row[..size.width];
            expand_row(&coarse[0], size, y, narrow, row);
            out.iter_mut().zip(row).for_each(|(out, coarse)| *out += *coarse);
        }
    }
}

pub(crate) fn checked(width: usize, height: usize) -> Result<Size, VisionError> {
    let fits = width.checked_mul(height).is_some_and(|area| area <= MOST);
    if width < 2 || height < 2 || !fits {
        return Err(VisionError::Size { width, height });
    }
    Ok(Size { width, height })
}

pub(crate) fn check_pixels(pixels: &[[f32; 3]], size: Size) -> Result<(), VisionError> {
    let Size { width, height } = size;
    if pixels.len() != size.area() {
        return Err(VisionError::Length { width, height, found: pixels.len() });
    }
    if !all_finite(pixels.as_flattened()) {
        let index = pixels.iter().position(|pixel| !all_finite(pixel)).unwrap_or_default();
        return Err(VisionError::NotFinite { index });
    }
    Ok(())
}

/// Zero times a finite number is zero.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn all_finite(values: &[f32]) -> bool {
    let bad = values.iter().fold(0u32, |bad, v| bad | u32::from(v.abs() >= f32::INFINITY || v.is_nan()));
    bad == 0
}

/// Builds the coarser levels of both pictures.
pub(crate) fn build<const N: usize>(sizes: &[Size], workspace: &mut VisionWorkspace) {
    let VisionWorkspace { gauss, rows, .. } = workspace;
    for levels in gauss.iter_mut().flat_map(|channels| &mut channels[..N]) {
        for (level, &size) in sizes[..sizes.len() - 1].iter().enumerate() {
            let (fine, coarse) = levels.split_at_mut(level + 1);
            reduce(&fine[level], size, &mut rows.narrow, &mut coarse[0]);
        }
    }
}

/// Places of luminances among the knots of the table.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn place_row(luminances: &[f32], places: &mut [f32]) {
    const LAST: f32 = (KNOTS - 1) as f32;
    for (out, &luminance) in places.iter_mut().zip(luminances) {
        let at = place(if luminance > 0.01 { luminance } else { 0.01 });
        *out = if at < LAST { at } else { LAST };
    }
}

/// Row `padded` − [`BLUR_RADIUS`] of `height`, reflected at the border, which is not repeated.
fn reflected(padded: usize, height: usize) -> usize {
    let y = padded.abs_diff(BLUR_RADIUS);
    if y < height { y } else { 2 * (height - 1) - y }
}

/// Reflects both ends of a row, which are not repeated.
fn pad(row: &mut [f32]) {
    let last = row.len() - 1;
    for i in 0..BLUR_RADIUS {
        row[i] = row[2 * BLUR_RADIUS - i];
        row[last - i] = row[last - 2 * BLUR_RADIUS + i];
    }
}

/// Pools each channel of a band over its pixels.
fn pool(differences: &[Vec<Vec<f32>>; CHANNELS], band: usize, size: Size) -> [f64; CHANNELS] {
    std::array::from_fn(|channel| {
        let rows = differences[channel][band][..size.area()].chunks_exact(size.width);
        let sum = rows.map(|row| f64::from(row.iter().map(|d| d * (d + 2.0 * EPSILON)).sum::<f32>())).sum();
        pooling::over_pixels(sum, size.area())
    })
}
