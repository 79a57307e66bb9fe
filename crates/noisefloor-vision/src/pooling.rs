//! From visible differences to just-objectionable differences (Mantiuk et al. 2024, §3.7), with the constants
//! of `cvvdp_parameters.json` 0.5.7.

use crate::masking::EPSILON;
use crate::photometry::CHANNELS;
use multiversion::multiversion;

/// Weight of a still picture against a film of one second.
pub(crate) const STILL: f64 = 0.577_918_291_091_919; // image_int
/// Weights of the coarsest band, by channel.
pub(crate) const BASEBAND: [f64; CHANNELS] =
    [0.003_633_448_621_258_139_6, 1.662_772_417_068_481_4, 4.118_745_326_995_85];
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
pub(crate) fn lost_in(map: &mut [f32]) {
    map.iter_mut().for_each(|value| *value = lost(f64::from(*value)) as f32);
}

/// Root mean square over the pixels of a band from the sum of [`bent`] squares.
pub(crate) fn over_pixels(sum: f64, pixels: usize) -> f64 {
    bent(sum / pixels as f64, 0.5)
}

/// Quality from what [`over_pixels`] gave, by band and channel; the last band is the coarsest.
pub(crate) fn quality(bands: &[[f64; CHANNELS]]) -> f64 {
    let mut channels = [0.0; CHANNELS];
    for (band, values) in bands.iter().enumerate() {
        for (channel, value) in values.iter().enumerate() {
            let weight = if band + 1 == bands.len() { BASEBAND[channel] } else { 1.0 };
            channels[channel] += bent(value * weight, 4.0);
        }
    }
    let across: f64 = channels.iter().map(|&sum| bent(bent(sum, 0.25), 4.0)).sum();
    10.0 - lost(bent(across, 0.25) * STILL)
}

/// One difference from those of all channels, for the map; as many weights as channels.
pub(crate) fn across_channels(values: [f32; CHANNELS], weights: [f64; CHANNELS]) -> f32 {
    let sum: f64 = (0..CHANNELS).map(|i| bent(f64::from(values[i]) * weights[i] * STILL, 4.0)).sum();
    bent(sum, 0.25) as f32
}

/// The map without that bend: the mean of fourth order over channels, times `weight`.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
pub(crate) fn across_row<const N: usize>(planes: [&[f32]; N], weight: f32, out: &mut [f32]) {
    let n = out.len();
    let planes = planes.map(|plane| &plane[..n]);
    if N == 1 {
        out.iter_mut().zip(planes[0]).for_each(|(out, d)| *out = weight * d);
        return;
    }
    for (x, out) in out.iter_mut().enumerate() {
        let mut sum = 0.0;
        for plane in planes {
            let square = plane[x] * plane[x];
            sum += square * square;
        }
        *out = weight * sum.sqrt().sqrt();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_to_see_is_ten() {
        assert_eq!(quality(&[[0.0; CHANNELS]; 5]), 10.0);
    }

    #[test]
    fn jods_are_continuous_and_fall() {
        assert!((lost(LINEAR) - lost(LINEAR + 1e-9)).abs() < 1e-8);
        assert!((lost(1.0) - JOD_GAIN).abs() < 1e-15);
        assert!(lost(2.0) > lost(1.0) && lost(0.05) > lost(0.01));
    }
}
