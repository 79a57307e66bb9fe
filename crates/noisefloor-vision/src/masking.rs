//! From contrasts to visible differences: contrast, masking by the picture across channels, and the limit of
//! large differences (Mantiuk et al. 2024, §3.5 to §3.6), with the constants of `cvvdp_parameters.json`
//! 0.5.7.

use crate::lanes::{STRIP, change_row, map_rows};
use crate::math::{exp2, pow};
use crate::photometry::CHANNELS;
use crate::pyramid::Size;
use crate::temporal::{ALL_CHANNELS, TRANSIENT};
use multiversion::multiversion;

/// Exponent of the difference of contrasts.
pub(crate) const EXPONENT: f32 = 2.264_355_2; // mask_p
/// The largest difference: 10^d_max.
pub(crate) const LARGEST: f32 = 366.644_74;
/// Keeps powers differentiable at 0 in the original; small differences depend on it.
pub(crate) const EPSILON: f32 = 1e-5;
/// Gain of the masking contrast: 10^mask_c.
const MASK_GAIN: f32 = 0.160_141_13;
/// Exponents of the masking contrasts, by channel.
const MASK_EXPONENTS: [f32; CHANNELS] = [1.302_622_7, 2.888_590_8, 3.680_771_4]; // mask_q
/// log₂ of how much the contrast of a channel (first index) masks another (second index): `xcm_weights`,
/// without the row of the transient channel, in which the reference has nothing that masks.
const CROSS_MASKING: [[f32; ALL_CHANNELS]; CHANNELS] = [
    [-0.189_501_05, -5.962_151, -4.318_346, -1.932_158_7],
    [2.565_559_4, 0.344_067_13, -2.719_646_5, -0.497_042_48],
    [3.811_837_2, -1.005_170_6, -0.519_337_65, -0.565_364_8],
];
/// Sensitivity beside that of the table, by channel: −0.28 dB for all, and 1.45 for red–green.
pub(crate) const CHANNEL_GAINS: [f64; ALL_CHANNELS] = [1.0, 1.45, 1.0, 1.0];
/// Correction of all sensitivities, in dB.
pub(crate) const SENSITIVITY_DB: f64 = -0.279_742_330_312_728_9;
/// Weber contrasts above this are cut off.
const LARGEST_CONTRAST: f32 = 1000.0;

/// Masking contrasts spread over neighbours: a Gaussian of σ = 3 pixels of the band, cut off at this radius.
pub(crate) const BLUR_RADIUS: usize = 6; // pu_dilate
const BLUR_SIGMA: f64 = 3.0;

/// Weights of the blur, from the centre outwards.
pub(crate) type Blur = [f32; BLUR_RADIUS + 1];

/// Weights that sum to one over both sides.
pub(crate) fn blur() -> Blur {
    let weight = |i: usize| (-0.5 * (i as f64 / BLUR_SIGMA).powi(2)).exp();
    let sum: f64 = (0..=BLUR_RADIUS).map(|i| if i == 0 { 1.0 } else { 2.0 * weight(i) }).sum();
    std::array::from_fn(|i| (weight(i) / sum) as f32)
}

/// A row of a level of one channel, of one of the two pictures.
#[derive(Clone, Copy)]
pub(crate) struct Row<'a> {
    /// The level of the Gaussian pyramid.
    pub(crate) fine: &'a [f32],
    /// The next coarser level, interpolated.
    pub(crate) coarse: &'a [f32],
    /// The achromatic channel of that: the luminance that eyes are adapted to.
    pub(crate) background: &'a [f32],
}

/// Contrasts in units of the threshold: their difference, and the smaller of the two, which masks.
/// `sensitivity` is log₂ of it.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
pub(crate) fn contrast_row(
    test: Row<'_>,
    reference: Row<'_>,
    sensitivity: &[f32],
    difference: &mut [f32],
    smaller: &mut [f32],
) {
    let weber = |fine: f32, coarse: f32, background: f32| {
        let contrast = (fine - coarse) / (if background > 0.01 { background } else { 0.01 });
        if contrast < LARGEST_CONTRAST { contrast } else { LARGEST_CONTRAST }
    };
    let rows = [
        test.fine,
        test.coarse,
        test.background,
        reference.fine,
        reference.coarse,
        reference.background,
        sensitivity,
    ];
    map_rows(rows, [difference, smaller], |[tf, tc, tb, rf, rc, rb, sensitivity]| {
        let (t, r) = (weber(tf, tc, tb), weber(rf, rc, rb));
        let s = exp2(sensitivity);
        let difference = (t - r).abs() * s;
        let (t, r) = (t.abs(), r.abs());
        [difference, (if t < r { t } else { r }) * s]
    });
}

/// Contrasts of noise in the transient channel, in units of the threshold: there, the reference is zero.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
pub(crate) fn transient_row(noise: Row<'_>, sensitivity: &[f32], difference: &mut [f32]) {
    let n = difference.len();
    let (fine, coarse, background) = (&noise.fine[..n], &noise.coarse[..n], &noise.background[..n]);
    let sensitivity = &sensitivity[..n];
    for x in 0..n {
        let background = if background[x] > 0.01 { background[x] } else { 0.01 };
        let contrast = ((fine[x] - coarse[x]) / background).abs();
        let contrast = if contrast < LARGEST_CONTRAST { contrast } else { LARGEST_CONTRAST };
        difference[x] = contrast * exp2(sensitivity[x]);
    }
}

/// Blurs along a row that has [`BLUR_RADIUS`] more pixels at each end than `out`.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
pub(crate) fn blur_row(blur: &Blur, padded: &[f32], out: &mut [f32]) {
    let n = out.len();
    let mut rows: [&[f32]; 2 * BLUR_RADIUS + 1] = [&[]; 2 * BLUR_RADIUS + 1];
    for (i, row) in rows.iter_mut().enumerate() {
        *row = &padded[i..i + n];
    }
    blend(blur, rows, out);
}

/// Blurs across thirteen rows as long as `out`.
#[inline(always)]
fn blend(blur: &Blur, rows: [&[f32]; 2 * BLUR_RADIUS + 1], out: &mut [f32]) {
    map_rows(rows, [out], |[f, e, d, c, b, a, centre, g, h, i, j, k, l]| {
        [blur[0] * centre
            + blur[1] * (a + g)
            + blur[2] * (b + h)
            + blur[3] * (c + i)
            + blur[4] * (d + j)
            + blur[5] * (e + k)
            + blur[6] * (f + l)]
    });
}

/// A limited difference d = L·u/(L + u) after the unlimited u has been multiplied by `growth`.
#[inline(always)]
pub(crate) fn grown(difference: f32, growth: f32) -> f32 {
    LARGEST * growth * difference / (LARGEST - difference + growth * difference)
}

/// x^p, bent so that it is smooth at 0.
#[inline(always)]
pub(crate) fn safe_pow(x: f32, p: f32, offset: f32) -> f32 {
    pow(x + EPSILON, p) - offset
}

/// How channels mask each other, with what is constant in it worked out.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Masking {
    weights: [[f32; ALL_CHANNELS]; CHANNELS],
    offsets: [f32; CHANNELS],
    offset: f32,
}

impl Masking {
    pub(crate) fn new() -> Self {
        let offset = |p: f32| f64::from(EPSILON).powf(f64::from(p)) as f32;
        Self {
            weights: CROSS_MASKING.map(|row| row.map(f32::exp2)),
            offsets: MASK_EXPONENTS.map(offset),
            offset: offset(EXPONENT),
        }
    }

    /// As if what is coloured did not mask the achromatic channel.
    pub(crate) fn without_colour_on_greys(mut self) -> Self {
        self.weights[1..].iter_mut().for_each(|of_colour| of_colour[0] = 0.0);
        self
    }

    /// How much a contrast of a channel masks, before it is weighted.
    #[inline(always)]
    fn power(&self, channel: usize, contrast: f32) -> f32 {
        safe_pow(contrast * MASK_GAIN, MASK_EXPONENTS[channel], self.offsets[channel])
    }

    /// A visible difference from one of contrasts, and what masks it.
    #[inline(always)]
    fn visible(&self, difference: f32, mask: f32) -> f32 {
        let difference = safe_pow(difference, EXPONENT, self.offset) / mask;
        LARGEST * difference / (LARGEST + difference)
    }
}

/// Room for a strip: powers of masking contrasts by channel, and differences before they are masked.
#[derive(Clone, Debug)]
pub(crate) struct MaskScratch {
    powers: [[f32; STRIP]; CHANNELS],
    before: [f32; STRIP],
}

impl Default for MaskScratch {
    fn default() -> Self {
        Self { powers: [[0.0; STRIP]; CHANNELS], before: [0.0; STRIP] }
    }
}

/// Turns differences of contrasts into visible differences, in `N` channels at once, and in the transient one of
/// a film: of rows from `first` on. `smaller` has the masking contrast of each channel in all of a band; without a blur,
/// which the band may be too small for, it counts as it is.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
pub(crate) fn mask_rows<const N: usize>(
    masking: &Masking,
    blur: Option<&Blur>,
    (smaller, size, first): ([&[f32]; N], Size, usize),
    differences: [&mut [f32]; N],
    transient: Option<&mut [f32]>,
    MaskScratch { powers, before }: &mut MaskScratch,
) {
    let from = first * size.width;
    let length = differences[0].len();
    let mut channels = [const { None }; ALL_CHANNELS];
    differences.into_iter().enumerate().for_each(|(channel, row)| channels[channel] = Some(row));
    channels[TRANSIENT] = transient;
    let greys = N == 1 && channels[TRANSIENT].is_none();
    // Several rows of the picture, or a part of one
    for at in (0..length).step_by(STRIP) {
        let n = STRIP.min(length - at);
        for (channel, power) in powers[..N].iter_mut().enumerate() {
            let (power, smaller) = (&mut power[..n], smaller[channel]);
            match blur {
                Some(blur) => blur_down(blur, smaller, size, from + at, power),
                None => power.copy_from_slice(&smaller[from + at..][..n]),
            }
            if !greys {
                change_row(power, |contrast| masking.power(channel, contrast));
            }
        }
        for (channel, out) in channels.iter_mut().enumerate() {
            let Some(out) = out else { continue };
            let out = &mut out[at..][..n];
            let before = &mut before[..n];
            before.copy_from_slice(out);
            if greys {
                // In one loop: most of the time of a tile is spent here
                let Masking { weights, .. } = *masking;
                map_rows([before, &powers[0][..n]], [out], |[difference, contrast]| {
                    let mask = 1.0 + weights[0][0] * masking.power(0, contrast);
                    [masking.visible(difference, mask)]
                });
                continue;
            }
            let [a, b, c] = masking.weights.map(|row| row[channel]);
            if N == CHANNELS {
                let rows = [before, &powers[0][..n], &powers[1][..n], &powers[2][..n]];
                map_rows(rows, [out], |[difference, of_a, of_b, of_c]| {
                    [masking.visible(difference, 1.0 + a * of_a + b * of_b + c * of_c)]
                });
            } else {
                map_rows([before, &powers[0][..n]], [out], |[difference, of_a]| {
                    [masking.visible(difference, 1.0 + a * of_a)]
                });
            }
        }
    }
}

/// Blurs down the columns of a band, from a pixel on, counted row by row.
#[inline(always)]
fn blur_down(blur: &Blur, plane: &[f32], size: Size, from: usize, out: &mut [f32]) {
    let mut done = 0;
    while done < out.len() {
        let (y, x) = ((from + done) / size.width, (from + done) % size.width);
        let n = (size.width - x).min(out.len() - done);
        let mut rows: [&[f32]; 2 * BLUR_RADIUS + 1] = [&[]; 2 * BLUR_RADIUS + 1];
        for (i, row) in rows.iter_mut().enumerate() {
            *row = &plane[reflected(y + i, size.height) * size.width + x..][..n];
        }
        blend(blur, rows, &mut out[done..done + n]);
        done += n;
    }
}

/// Row `padded` − [`BLUR_RADIUS`] of `height`, reflected at the border, which is not repeated.
fn reflected(padded: usize, height: usize) -> usize {
    let y = padded.abs_diff(BLUR_RADIUS);
    if y < height { y } else { 2 * (height - 1) - y }
}
