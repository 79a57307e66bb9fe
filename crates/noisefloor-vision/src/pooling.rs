//! From visible differences to just-objectionable differences (Mantiuk et al. 2024, §3.7), with the constants
//! of `cvvdp_parameters.json` 0.5.7.

use crate::lanes::{change_row, map_rows};
use crate::masking::{EPSILON, EXPONENT, grown};
use crate::math::pow;
use crate::temporal::{ALL_CHANNELS, TRANSIENT_WEIGHT};
use multiversion::multiversion;

/// Weight of a still picture against a film of one second.
pub(crate) const STILL: f64 = 0.577_918_291_091_919; // image_int
/// Weights of the coarsest band, by channel.
pub(crate) const BASEBAND: [f64; ALL_CHANNELS] =
    [0.003_633_448_621_258_139_6, 1.662_772_417_068_481_4, 4.118_745_326_995_85, 25.259_698_867_797_85];
/// Weights of channels.
pub(crate) const WEIGHTS: [f64; ALL_CHANNELS] = [1.0, 1.0, 1.0, TRANSIENT_WEIGHT];
const JOD_GAIN: f64 = 0.043_956_939_131_021_5; // jod_a
const JOD_EXPONENT: f64 = 0.930_204_272_270_202_6; // jod_exp
/// Up to this difference, JODs are linear in it.
const LINEAR: f64 = 0.1;

/// x^p, bent so that it is smooth at 0.
fn bent(x: f64, p: f64) -> f64 {
    let epsilon = f64::from(EPSILON);
    (x + epsilon).powf(p) - epsilon.powf(p)
}

/// JODs lost to a pooled difference.
pub(crate) fn lost(difference: f64) -> f64 {
    if difference > LINEAR {
        JOD_GAIN * difference.powf(JOD_EXPONENT)
    } else {
        JOD_GAIN * LINEAR.powf(JOD_EXPONENT - 1.0) * difference
    }
}

/// [`lost`] in every pixel of a map.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
pub(crate) fn lost_in(map: &mut [f32]) {
    let slope = (JOD_GAIN * LINEAR.powf(JOD_EXPONENT - 1.0)) as f32;
    for value in map {
        let (linear, bent) = (slope * *value, JOD_GAIN as f32 * pow(*value, JOD_EXPONENT as f32));
        *value = if *value > LINEAR as f32 { bent } else { linear };
    }
}

/// Root mean square over the pixels of a band from the sum of [`bent`] squares.
pub(crate) fn over_pixels(sum: f64, pixels: usize) -> f64 {
    bent(sum / pixels as f64, 0.5)
}

/// Quality from what [`over_pixels`] gave, by band and channel; the last band is the coarsest. `integration` is
/// [`STILL`] for a still, without a transient channel, and 1 for a film, of which all frames are alike.
pub(crate) fn quality(bands: &[[f64; ALL_CHANNELS]], integration: f64) -> f64 {
    let mut channels = [0.0; ALL_CHANNELS];
    for (band, values) in bands.iter().enumerate() {
        for (channel, value) in values.iter().enumerate() {
            let weight = if band + 1 == bands.len() { BASEBAND[channel] } else { 1.0 };
            channels[channel] += bent(value * weight * WEIGHTS[channel], 4.0);
        }
    }
    let across: f64 = channels.iter().map(|&sum| bent(bent(sum, 0.25), 4.0)).sum();
    10.0 - lost(bent(across, 0.25) * integration)
}

/// One difference from those of all channels, for the map; as many weights as channels.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
pub(crate) fn across_channels<const N: usize>(
    planes: [&[f32]; N],
    weights: [f32; N],
    share: f32,
    out: &mut [f32],
) {
    // [`bent`] with the powers of 4 and 1/4
    const FOURTH: f32 = EPSILON * EPSILON * EPSILON * EPSILON;
    let root = EPSILON.sqrt().sqrt();
    out.fill(EPSILON - N as f32 * FOURTH);
    for (plane, weight) in planes.into_iter().zip(weights) {
        for (out, value) in out.iter_mut().zip(plane) {
            let square = (value * weight + EPSILON) * (value * weight + EPSILON);
            *out += square * square;
        }
    }
    out.iter_mut().for_each(|out| *out = (out.sqrt().sqrt() - root) * share);
}

/// The map without that bend, of a residual whose contrast has changed by `growth` to the power of
/// 1/[`EXPONENT`]: the mean of fourth order over channels, times `weight`; with the transient channel of a film.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
pub(crate) fn across_row<const N: usize>(
    planes: [&[f32]; N],
    weights: [f32; N],
    transient: Option<&[f32]>,
    growth: f32,
    weight: f32,
    out: &mut [f32],
) {
    if N == 1 && transient.is_none() {
        map_rows([planes[0]], [out], |[d]| [weight * grown(d, growth)]);
        return;
    }
    out.fill(0.0);
    for (plane, of_channel) in planes.into_iter().zip(weights) {
        for (out, &d) in out.iter_mut().zip(plane) {
            let difference = of_channel * grown(d, growth);
            let square = difference * difference;
            *out += square * square;
        }
    }
    for (out, &d) in out.iter_mut().zip(transient.unwrap_or_default()) {
        let square = (TRANSIENT_WEIGHT as f32 * grown(d, growth)).powi(2);
        *out += square * square;
    }
    out.iter_mut().for_each(|out| *out = weight * out.sqrt().sqrt());
}

/// Squares of contrasts from differences that are not limited, which grow as contrast^[`EXPONENT`].
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
pub(crate) fn energy_row(row: &mut [f32]) {
    const POWER: f32 = 2.0 / EXPONENT;
    // A logarithm of 0 is finite here, and no number that means something
    change_row(row, |value| if value > 1e-30 { pow(value, POWER) } else { 0.0 });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_to_see_is_ten() {
        assert_eq!(
            [STILL, 1.0].map(|integration| quality(&[[0.0; ALL_CHANNELS]; 5], integration)),
            [10.0; 2]
        );
    }

    #[test]
    fn jods_are_continuous_and_fall() {
        assert!((lost(LINEAR) - lost(LINEAR + 1e-9)).abs() < 1e-8);
        assert!((lost(1.0) - JOD_GAIN).abs() < 1e-15);
        assert!(lost(2.0) > lost(1.0) && lost(0.05) > lost(0.01));
    }
}
