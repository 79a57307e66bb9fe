//! From contrasts to visible differences: contrast, masking by the picture across channels, and the limit of
//! large differences (Mantiuk et al. 2024, §3.5 to §3.6), with the constants of `cvvdp_parameters.json`
//! 0.5.7.

use crate::math::{exp2, pow};
use crate::photometry::CHANNELS;
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
/// log₂ of how much the contrast of a channel (first index) masks another (second index); the columns of
/// `xcm_weights` for still channels.
const CROSS_MASKING: [[f32; CHANNELS]; CHANNELS] = [
    [-0.189_501_05, -5.962_151, -4.318_346],
    [2.565_559_4, 0.344_067_13, -2.719_646_5],
    [3.811_837_2, -1.005_170_6, -0.519_337_65],
];
/// Sensitivity beside that of the table, by channel: −0.28 dB for all, and 1.45 for red–green.
pub(crate) const CHANNEL_GAINS: [f64; CHANNELS] = [1.0, 1.45, 1.0];
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
    let n = difference.len();
    let (tf, tc, tb) = (&test.fine[..n], &test.coarse[..n], &test.background[..n]);
    let (rf, rc, rb) = (&reference.fine[..n], &reference.coarse[..n], &reference.background[..n]);
    let (sensitivity, smaller) = (&sensitivity[..n], &mut smaller[..n]);
    let weber = |fine: f32, coarse: f32, background: f32| {
        let contrast = (fine - coarse) / (if background > 0.01 { background } else { 0.01 });
        if contrast < LARGEST_CONTRAST { contrast } else { LARGEST_CONTRAST }
    };
    for x in 0..n {
        let (t, r) = (weber(tf[x], tc[x], tb[x]), weber(rf[x], rc[x], rb[x]));
        let s = exp2(sensitivity[x]);
        difference[x] = (t - r).abs() * s;
        let (t, r) = (t.abs(), r.abs());
        smaller[x] = (if t < r { t } else { r }) * s;
    }
}

/// Blurs along a row that has [`BLUR_RADIUS`] more pixels at each end than `out`.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
pub(crate) fn blur_row(blur: &Blur, padded: &[f32], out: &mut [f32]) {
    let n = out.len();
    let at: [&[f32]; 2 * BLUR_RADIUS + 1] = std::array::from_fn(|i| &padded[i..][..n]);
    for x in 0..n {
        out[x] = blurred(blur, |i| at[i][x]);
    }
}

#[inline(always)]
fn blurred(blur: &Blur, at: impl Fn(usize) -> f32) -> f32 {
    let mut sum = blur[0] * at(BLUR_RADIUS);
    for (i, weight) in blur.iter().enumerate().skip(1) {
        sum += weight * (at(BLUR_RADIUS - i) + at(BLUR_RADIUS + i));
    }
    sum
}

/// x^p, bent so that it is smooth at 0.
#[inline(always)]
pub(crate) fn safe_pow(x: f32, p: f32, offset: f32) -> f32 {
    pow(x + EPSILON, p) - offset
}

/// How channels mask each other, with what is constant in it worked out.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Masking {
    weights: [[f32; CHANNELS]; CHANNELS],
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

/// Turns differences of contrasts into visible differences, in `N` channels at once. `smaller[channel]` has
/// the rows of the masking contrast from [`BLUR_RADIUS`] above to as far below; `None` if the band is too
/// small for a blur, in which case the middle row counts.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
pub(crate) fn mask_row<const N: usize>(
    masking: &Masking,
    blur: Option<&Blur>,
    smaller: [[&[f32]; 2 * BLUR_RADIUS + 1]; N],
    mut differences: [&mut [f32]; N],
) {
    let width = differences[0].len();
    let mut powers = [[0.0; PIXELS]; N];
    for from in (0..width).step_by(PIXELS) {
        let n = PIXELS.min(width - from);
        for channel in 0..N {
            let at = smaller[channel].map(|row| &row[from..][..n]);
            let (out, exponent, offset) =
                (&mut powers[channel][..n], MASK_EXPONENTS[channel], masking.offsets[channel]);
            for x in 0..n {
                let mask = match blur {
                    Some(blur) => blurred(blur, |i| at[i][x]),
                    None => at[BLUR_RADIUS][x],
                };
                out[x] = safe_pow(mask * MASK_GAIN, exponent, offset);
            }
        }
        for (channel, out) in differences.iter_mut().enumerate() {
            let out = &mut out[from..][..n];
            for x in 0..n {
                let mut mask = 1.0;
                for (power, weights) in powers.iter().zip(&masking.weights) {
                    mask += power[x] * weights[channel];
                }
                let d = safe_pow(out[x], EXPONENT, masking.offset) / mask;
                out[x] = LARGEST * d / (LARGEST + d);
            }
        }
    }
}
