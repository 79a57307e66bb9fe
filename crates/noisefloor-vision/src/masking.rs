//! From contrasts to visible differences: contrast, masking by the picture across channels, and the limit of
//! large differences (Mantiuk et al. 2024, §3.5 to §3.6), with the constants of `cvvdp_parameters.json`
//! 0.5.7.

use crate::lanes::{change_row, map_rows};
use crate::math::{exp2, pow};
use crate::photometry::CHANNELS;
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
}

/// Most pixels of a row that are worked on at a time: few enough to stay in the nearest cache.
const PIXELS: usize = 128;

/// Turns differences of contrasts into visible differences, in `N` channels at once, and in the transient one of
/// a film. `smaller[channel]` has
/// the rows of the masking contrast from [`BLUR_RADIUS`] above to as far below; `None` if the band is too
/// small for a blur, in which case the middle row counts.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
pub(crate) fn mask_row<const N: usize>(
    masking: &Masking,
    blur: Option<&Blur>,
    smaller: [[&[f32]; 2 * BLUR_RADIUS + 1]; N],
    differences: [&mut [f32]; N],
    transient: Option<&mut [f32]>,
) {
    let width = differences[0].len();
    let mut channels = [const { None }; ALL_CHANNELS];
    differences.into_iter().enumerate().for_each(|(channel, row)| channels[channel] = Some(row));
    channels[TRANSIENT] = transient;
    let mut powers = [[0.0; PIXELS]; N];
    let [mut mask, mut visible] = [[0.0; PIXELS]; 2];
    for from in (0..width).step_by(PIXELS) {
        let n = PIXELS.min(width - from);
        for (channel, power) in powers.iter_mut().enumerate() {
            let (power, rows) = (&mut power[..n], smaller[channel].map(|row| &row[from..][..n]));
            match blur {
                Some(blur) => blend(blur, rows, power),
                None => power.copy_from_slice(rows[BLUR_RADIUS]),
            }
            let (exponent, offset) = (MASK_EXPONENTS[channel], masking.offsets[channel]);
            change_row(power, |value| safe_pow(value * MASK_GAIN, exponent, offset));
        }
        for (channel, out) in channels.iter_mut().enumerate() {
            let Some(out) = out else { continue };
            let mask = &mut mask[..n];
            mask.fill(1.0);
            for (power, weights) in powers.iter().zip(&masking.weights) {
                let weight = weights[channel];
                mask.iter_mut().zip(power).for_each(|(mask, power)| *mask += weight * power);
            }
            let row = &mut out[from..][..n];
            visible[..n].copy_from_slice(row);
            map_rows([&visible[..n], mask], [row], |[difference, mask]| {
                let difference = safe_pow(difference, EXPONENT, masking.offset) / mask;
                [LARGEST * difference / (LARGEST + difference)]
            });
        }
    }
}
