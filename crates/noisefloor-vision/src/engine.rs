//! The steps from code values to visible differences by band and channel, on a workspace.

use crate::bands::{Bands, sensitivity, sensitivity_row};
use crate::csf::{KNOTS, place};
use crate::lanes::map_rows;
use crate::masking::{
    BLUR_RADIUS, Blur, Masking, Row, blur, blur_row, contrast_row, mask_row, transient_row,
};
use crate::part::Part;
use crate::photometry::{CHANNELS, Photometry, grey_row, opponent_row};
use crate::pyramid::{Size, expand_row, reduce};
use crate::temporal::{ALL_CHANNELS, TRANSIENT, gains};
use crate::viewing::Viewing;
use crate::workspace::VisionWorkspace;
use multiversion::multiversion;
use std::ops::Range;

/// What eyes are adapted to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Adapted {
    /// The reference, as in ColorVideoVDP.
    ToReference,
    /// The mean of both pictures, where neither is the reference.
    ToBoth,
}

/// What is constant for a display.
#[derive(Clone, Debug)]
pub(crate) struct Engine {
    photometry: Photometry,
    pub(crate) bands: Bands,
    masking: Masking,
    blur: Blur,
    /// Gains of noise that is new in every frame, by channel; `None` for stills.
    pub(crate) film: Option<[f32; ALL_CHANNELS]>,
}

impl Engine {
    pub(crate) fn new(viewing: &Viewing) -> Self {
        Self {
            photometry: Photometry::new(viewing),
            bands: Bands::new(viewing.pixels_per_degree()),
            masking: Masking::new(),
            blur: blur(),
            film: viewing.frames_per_second().map(gains),
        }
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

    /// Converts greys into the finest level of picture `of`, only its achromatic channel.
    pub(crate) fn load_grey(
        &self,
        of: usize,
        size: Size,
        workspace: &mut VisionWorkspace,
        code: impl Fn(usize) -> f32,
    ) {
        let plane = &mut workspace.gauss[of][0][0];
        for from in (0..size.area()).step_by(size.width) {
            let row = &mut plane[from..from + size.width];
            row.iter_mut().enumerate().for_each(|(x, out)| *out = code(from + x));
            grey_row(&self.photometry, row);
        }
    }

    /// In a film, filters the test picture over time: what it has beside `standing`, or beside the reference, is new
    /// in every frame.
    pub(crate) fn filter<const N: usize>(&self, size: Size, standing: bool, workspace: &mut VisionWorkspace) {
        let Some(gains) = self.film else { return };
        let VisionWorkspace { gauss: [test, reference], flicker, standing: planes, .. } = workspace;
        for channel in (0..N).rev() {
            let same = if standing { &planes[channel] } else { &reference[channel][0] };
            let pairs = test[channel][0].iter_mut().zip(same).take(size.area());
            if channel == 0 {
                for ((test, &same), flicker) in pairs.zip(&mut flicker[0]) {
                    *flicker = gains[TRANSIENT] * (*test - same);
                    *test = same + gains[0] * (*test - same);
                }
            } else {
                pairs.for_each(|(test, &same)| *test = same + gains[channel] * (*test - same));
            }
        }
    }

    /// In a film, filters two pictures over time, of which neither is the reference: what they have in common is the same
    /// in every frame.
    pub(crate) fn filter_both<const N: usize>(&self, size: Size, workspace: &mut VisionWorkspace) {
        let Some(gains) = self.film else { return };
        let VisionWorkspace { gauss: [one, other], flicker, .. } = workspace;
        for channel in 0..N {
            let pairs = one[channel][0].iter_mut().zip(&mut other[channel][0]).take(size.area());
            for ((one, other), flicker) in pairs.zip(&mut flicker[0]) {
                let (same, difference) = (0.5 * (*one + *other), *one - *other);
                if channel == 0 {
                    *flicker = gains[TRANSIENT] * difference;
                }
                let apart = 0.5 * gains[channel] * difference;
                (*one, *other) = (same + apart, same - apart);
            }
        }
    }

    /// Visible differences of a band, of `N` channels and that of films. Contrasts are worked out in the first part of it,
    /// which has to have [`BLUR_RADIUS`] more pixels around, where there are any, than the second, in which
    /// differences are.
    pub(crate) fn band<const N: usize>(
        &self,
        band: usize,
        size: Size,
        (contrasts, differences): (Part, Part),
        adapted: Adapted,
        workspace: &mut VisionWorkspace,
    ) {
        let blurs = size.width > BLUR_RADIUS && size.height > BLUR_RADIUS;
        for y in contrasts.rows() {
            self.contrasts::<N>((band, size), y, contrasts.columns(), (adapted, blurs), workspace);
        }
        let VisionWorkspace { smaller, differences: planes, .. } = workspace;
        let columns = differences.columns();
        for y in differences.rows() {
            let around: [usize; 2 * BLUR_RADIUS + 1] =
                std::array::from_fn(|i| if blurs { reflected(y + i, size.height) } else { y });
            let smaller: [_; N] =
                std::array::from_fn(|c| around.map(|y| &smaller[c][y * size.width..][columns.clone()]));
            let [a, b, c, transient] = &mut *planes;
            let mut still = [a, b, c].into_iter();
            let rows: [_; N] = std::array::from_fn(|_| still.next().expect("at most three channels"));
            let from = y * size.width;
            let rows = rows.map(|bands| &mut bands[band][from..][columns.clone()]);
            let transient = self.film.map(|_| &mut transient[band][from..][columns.clone()]);
            mask_row(&self.masking, blurs.then_some(&self.blur), smaller, rows, transient);
        }
    }

    /// Differences of contrasts and masking contrasts in row `y` of a band.
    fn contrasts<const N: usize>(
        &self,
        (band, size): (usize, Size),
        y: usize,
        columns: Range<usize>,
        (adapted, blurs): (Adapted, bool),
        workspace: &mut VisionWorkspace,
    ) {
        let VisionWorkspace { gauss, flicker, differences, smaller, rows, .. } = workspace;
        for (channels, coarse) in gauss.iter().zip(&mut rows.coarse) {
            for (levels, coarse) in channels.iter().zip(coarse).take(N) {
                expand_row(&levels[band + 1], size, y, &mut rows.narrow, coarse);
            }
        }
        let coarse = &rows.coarse;
        // What eyes are adapted to, and what the flicker of a film is seen on
        let [sensitive_to, flickers_on] = match adapted {
            Adapted::ToReference => [1, 0].map(|of| &coarse[of][0][columns.clone()]),
            Adapted::ToBoth => {
                let mean = &mut rows.mean[columns.clone()];
                let [test, reference] = [0, 1].map(|of| &coarse[of][0][columns.clone()]);
                mean_row(test, reference, mean);
                [&*mean; 2]
            }
        };
        let places = &mut rows.places[columns.clone()];
        place_row(sensitive_to, places);
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
        if self.film.is_some() {
            expand_row(&flicker[band + 1], size, y, &mut rows.narrow, &mut rows.flicker);
            let sensitivity = &mut rows.sensitivity[..columns.len()];
            sensitivity_row(&self.bands.curves[band][TRANSIENT], places, sensitivity);
            let noise = Row {
                fine: &flicker[band][here.clone()],
                coarse: &rows.flicker[columns.clone()],
                background: flickers_on,
            };
            transient_row(noise, sensitivity, &mut differences[TRANSIENT][band][here]);
        }
    }

    /// Visible differences of the coarsest level, beside its mean luminance.
    pub(crate) fn baseband(&self, band: usize, size: Size, workspace: &mut VisionWorkspace) {
        let VisionWorkspace { gauss, flicker, differences, .. } = workspace;
        let planes = |of: usize, channel: usize| &gauss[of][channel][band][..size.area()];
        let [test, reference] = [0, 1].map(|of| {
            let sum: f64 = planes(of, 0).iter().map(|&v| f64::from(v.max(0.01))).sum();
            (sum / size.area() as f64) as f32
        });
        let place = place(reference).clamp(0.0, (KNOTS - 1) as f32);
        for (channel, out) in differences[..CHANNELS].iter_mut().enumerate() {
            let s = sensitivity(&self.bands.baseband[channel], place);
            let pairs = planes(0, channel).iter().zip(planes(1, channel));
            for (out, (t, r)) in out[band].iter_mut().zip(pairs) {
                *out = ((t / test).min(1000.0) - (r / reference).min(1000.0)).abs() * s;
            }
        }
        if self.film.is_some() {
            let s = sensitivity(&self.bands.baseband[TRANSIENT], place);
            let noise = flicker[band][..size.area()].iter();
            let out = differences[TRANSIENT][band].iter_mut();
            out.zip(noise).for_each(|(out, noise)| *out = (noise / test).min(1000.0).abs() * s);
        }
    }
}

/// Builds the coarser levels of both pictures, in a film that of its flicker, too.
pub(crate) fn build<const N: usize>(sizes: &[Size], film: bool, workspace: &mut VisionWorkspace) {
    let VisionWorkspace { gauss, flicker, rows, .. } = workspace;
    let of_stills = gauss.iter_mut().flat_map(|channels| &mut channels[..N]);
    for levels in of_stills.chain(film.then_some(flicker)) {
        for (level, &size) in sizes[..sizes.len() - 1].iter().enumerate() {
            let (fine, coarse) = levels.split_at_mut(level + 1);
            reduce(&fine[level], size, &mut rows.narrow, &mut coarse[0]);
        }
    }
}

/// Adds these bands of a map onto the finest of them, in the rows that `rows` gives for each.
pub(crate) fn collapse(
    map: &mut [Vec<f32>],
    bands: Range<usize>,
    sizes: &[Size],
    rows: impl Fn(usize) -> Range<usize>,
    narrow: &mut [f32],
    row: &mut [f32],
) {
    for band in (bands.start..bands.end - 1).rev() {
        let (fine, coarse) = map.split_at_mut(band + 1);
        let size = sizes[band];
        let row = &mut row[..size.width];
        for y in rows(band) {
            expand_row(&coarse[0], size, y, narrow, row);
            let out = &mut fine[band][y * size.width..][..size.width];
            out.iter_mut().zip(&*row).for_each(|(out, coarse)| *out += *coarse);
        }
    }
}

/// Places of luminances among the knots of the table.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn place_row(luminances: &[f32], places: &mut [f32]) {
    const LAST: f32 = (KNOTS - 1) as f32;
    map_rows([luminances], [places], |[luminance]| {
        let at = place(if luminance > 0.01 { luminance } else { 0.01 });
        [if at < LAST { at } else { LAST }]
    });
}

/// The mean of two rows.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn mean_row(a: &[f32], b: &[f32], mean: &mut [f32]) {
    map_rows([a, b], [mean], |[a, b]| [0.5 * (a + b)]);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::workspace::Sizes;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_bands_of_a_pyramid_add_up_to_its_picture(
            (width, height) in (8usize..70, 8usize..70), levels in 1usize..4, seed in any::<u32>(),
        ) {
            let sizes = Sizes::new(Size { width, height }, levels);
            let random = |i: u32| ((i ^ seed).wrapping_mul(0x9E37_79B1) >> 8) as f32 / (1 << 24) as f32;
            let picture: Vec<f32> = (0..(width * height) as u32).map(random).collect();
            let (mut narrow, mut row) = (vec![0.0; width + 4], vec![0.0; width]);
            // Levels, then what the next coarser one lacks of each
            let mut bands = vec![picture.clone()];
            for level in 1..levels {
                let mut coarse = vec![0.0; sizes[level].area()];
                reduce(&bands[level - 1], sizes[level - 1], &mut narrow, &mut coarse);
                bands.push(coarse);
            }
            for level in 0..levels - 1 {
                let coarse = bands[level + 1].clone();
                for (y, fine) in bands[level].chunks_exact_mut(sizes[level].width).enumerate() {
                    expand_row(&coarse, sizes[level], y, &mut narrow, &mut row);
                    fine.iter_mut().zip(&row).for_each(|(fine, coarse)| *fine -= coarse);
                }
            }
            let whole = |band: usize| 0..sizes[band].height;
            collapse(&mut bands, 0..levels, &sizes, whole, &mut narrow, &mut row);
            prop_assert!(bands[0].iter().zip(&picture).all(|(a, b)| (a - b).abs() < 1e-5));
        }
    }
}
