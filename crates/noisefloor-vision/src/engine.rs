//! The steps from code values to visible differences by band and channel, on a workspace.

use crate::bands::{Bands, sensitivity, sensitivity_row};
use crate::csf::{KNOTS, place};
use crate::lanes::{STRIP, map_rows};
use crate::masking::{
    BLUR_RADIUS, Blur, Masking, Row, blur, blur_row, contrast_row, mask_rows, transient_row,
};
use crate::photometry::{CHANNELS, Photometry, greys, opponent_planes, opponent_row};
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
    pub(crate) masking: Masking,
    /// The same, but that colour hides no light and dark.
    pub(crate) greys_unmasked: Masking,
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
            greys_unmasked: Masking::new().without_colour_on_greys(),
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
        let VisionWorkspace { gauss, strip, .. } = workspace;
        let codes = &mut strip.codes[..size.width];
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

    /// Converts planes of red, green and blue into the finest level of picture `of`: of a picture and a share of its residual.
    pub(crate) fn load_planes<const N: usize>(
        &self,
        of: usize,
        size: Size,
        workspace: &mut VisionWorkspace,
        picture: [&[f32]; 3],
        (share, residual): (f32, [&[f32]; 3]),
    ) {
        let mut channels = workspace.gauss[of].iter_mut();
        let mut next = || channels.next().map(|levels| &mut levels[0][..size.area()]);
        let mut planes: [&mut [f32]; N] = std::array::from_fn(|_| next().expect("at most three channels"));
        opponent_planes(&self.photometry, picture, (share, residual), &mut planes);
    }

    /// Converts greys into the finest level of picture `of`, only its achromatic channel: of a picture and a share of its residual.
    pub(crate) fn load_grey(
        &self,
        of: usize,
        size: Size,
        workspace: &mut VisionWorkspace,
        picture: &[f32],
        (share, residual): (f32, &[f32]),
    ) {
        let out = &mut workspace.gauss[of][0][0][..size.area()];
        greys(&self.photometry, picture, (share, residual), out);
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

    /// Visible differences of a band, of `N` channels and that of films, in some of its rows. Contrasts are worked out in
    /// the first of these rows, which have to have [`BLUR_RADIUS`] more on both sides, where there are any, than the
    /// second, in which differences are.
    pub(crate) fn band<const N: usize>(
        &self,
        band: usize,
        size: Size,
        (contrasts, differences): (Range<usize>, Range<usize>),
        (adapted, masking): (Adapted, &Masking),
        workspace: &mut VisionWorkspace,
    ) {
        let blurs = size.width > BLUR_RADIUS && size.height > BLUR_RADIUS;
        for rows in strips(contrasts, size.width) {
            self.contrasts::<N>((band, size), rows, (adapted, blurs), workspace);
        }
        let VisionWorkspace { smaller, differences: planes, strip: room, .. } = workspace;
        let smaller: [&[f32]; N] = std::array::from_fn(|channel| &smaller[channel][..size.area()]);
        for rows in strips(differences, size.width) {
            let [a, b, c, transient] = &mut *planes;
            let mut still = [a, b, c].into_iter();
            let strip = rows.start * size.width..rows.end * size.width;
            let channels: [_; N] = std::array::from_fn(|_| still.next().expect("at most three channels"));
            let channels = channels.map(|bands| &mut bands[band][strip.clone()]);
            let transient = self.film.map(|_| &mut transient[band][strip.clone()]);
            let blur = blurs.then_some(&self.blur);
            let place = (smaller, size, rows.start);
            mask_rows(masking, blur, place, channels, transient, &mut room.mask);
        }
    }

    /// Differences of contrasts and masking contrasts in rows of a band, as many as a strip has.
    fn contrasts<const N: usize>(
        &self,
        (band, size): (usize, Size),
        ys: Range<usize>,
        (adapted, blurs): (Adapted, bool),
        workspace: &mut VisionWorkspace,
    ) {
        let VisionWorkspace { gauss, flicker, differences, smaller, strip, .. } = workspace;
        let here = ys.start * size.width..ys.end * size.width;
        for (channels, coarse) in gauss.iter().zip(&mut strip.coarse) {
            for (levels, coarse) in channels.iter().zip(coarse).take(N) {
                for (y, row) in ys.clone().zip(coarse.chunks_exact_mut(size.width)) {
                    expand_row(&levels[band + 1], size, y, &mut strip.narrow, row);
                }
            }
        }
        let coarse: [[&[f32]; CHANNELS]; 2] = [0, 1].map(|of| {
            std::array::from_fn(|channel| {
                &strip.coarse[of][channel][..if channel < N { here.len() } else { 0 }]
            })
        });
        // What eyes are adapted to, and what the flicker of a film is seen on
        let [sensitive_to, flickers_on] = match adapted {
            Adapted::ToReference => [coarse[1][0], coarse[0][0]],
            Adapted::ToBoth => {
                let mean = &mut strip.mean[..here.len()];
                mean_row(coarse[0][0], coarse[1][0], mean);
                [&*mean; 2]
            }
        };
        let places = &mut strip.places[..here.len()];
        place_row(sensitive_to, places);
        let sensitivity = &mut strip.sensitivity[..here.len()];
        for channel in 0..N {
            sensitivity_row(&self.bands.curves[band][channel], places, sensitivity);
            let [test, reference] = std::array::from_fn(|of| Row {
                fine: &gauss[of][channel][band][here.clone()],
                coarse: coarse[of][channel],
                background: coarse[of][0],
            });
            let difference = &mut differences[channel][band][here.clone()];
            let smaller = &mut smaller[channel][here.clone()];
            if !blurs {
                contrast_row(test, reference, sensitivity, difference, smaller);
                continue;
            }
            let sharp = &mut strip.sharp[..here.len()];
            contrast_row(test, reference, sensitivity, difference, sharp);
            let padded = &mut strip.padded[..size.width + 2 * BLUR_RADIUS];
            for (row, out) in sharp.chunks_exact(size.width).zip(smaller.chunks_exact_mut(size.width)) {
                padded[BLUR_RADIUS..][..size.width].copy_from_slice(row);
                pad(padded);
                blur_row(&self.blur, padded, out);
            }
        }
        if self.film.is_some() {
            for (y, row) in ys.zip(strip.flicker.chunks_exact_mut(size.width)) {
                expand_row(&flicker[band + 1], size, y, &mut strip.narrow, row);
            }
            sensitivity_row(&self.bands.curves[band][TRANSIENT], places, sensitivity);
            let noise = Row {
                fine: &flicker[band][here.clone()],
                coarse: &strip.flicker[..here.len()],
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
    let VisionWorkspace { gauss, flicker, strip, .. } = workspace;
    let of_stills = gauss.iter_mut().flat_map(|channels| &mut channels[..N]);
    for levels in of_stills.chain(film.then_some(flicker)) {
        for (level, &size) in sizes[..sizes.len() - 1].iter().enumerate() {
            let (fine, coarse) = levels.split_at_mut(level + 1);
            reduce(&fine[level], size, &mut strip.narrow, &mut coarse[0]);
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
    map_rows([luminances], [places], |[luminance]| [place_of(luminance)]);
}

/// The place of a luminance that is seen, among the knots.
#[inline(always)]
fn place_of(luminance: f32) -> f32 {
    const LAST: f32 = (KNOTS - 1) as f32;
    let at = place(if luminance > 0.01 { luminance } else { 0.01 });
    if at < LAST { at } else { LAST }
}

/// The mean of two rows.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
fn mean_row(a: &[f32], b: &[f32], mean: &mut [f32]) {
    map_rows([a, b], [mean], |[a, b]| [0.5 * (a + b)]);
}

/// Rows that are worked on together: as many as [`STRIP`] has room for.
fn strips(rows: Range<usize>, width: usize) -> impl Iterator<Item = Range<usize>> {
    let at_once = (STRIP / width).max(1);
    rows.clone().step_by(at_once).map(move |y| y..(y + at_once).min(rows.end))
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
