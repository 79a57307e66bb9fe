//! Contrast sensitivity: castleCSF (Ashraf et al. 2024), as tabulated by ColorVideoVDP 0.5.7 for patterns of
//! fixed size, still ones and light that flickers at 5 Hz.

use crate::math::log2;
use crate::temporal::ALL_CHANNELS;

/// Knots along either axis of the table.
pub(crate) const KNOTS: usize = 32;

/// log₁₀ of the sensitivity as little-endian f32, by channel (the transient one last), then luminance, then
/// frequency; both axes are logarithmic. From `csf_lut_weber_fixed_size.json`, MIT licence: `data/LICENSE-ColorVideoVDP`.
static TABLE: &[u8; 4 * ALL_CHANNELS * KNOTS * KNOTS] = include_bytes!("../data/castlecsf.f32");

/// The frequencies of the table, from its first to its last, in cycles per degree. Its luminances are 0.005
/// to 10,000 cd/m².
const FREQUENCIES: (f64, f64) = (0.1, 64.0);

/// An opponent channel (Derrington, Krauskopf and Lennie 1984).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OpponentChannel {
    /// Light and dark.
    Achromatic,
    /// Red and green.
    RedGreen,
    /// Yellow and violet.
    YellowViolet,
}

/// Sensitivity to contrast: one over the least Weber contrast that people see, for a pattern of `frequency`
/// cycles per degree on a background of `luminance` cd/m². Luminances are held within 0.005…10,000; beyond
/// 0.1…64 cycles per degree it is extrapolated.
pub fn contrast_sensitivity(channel: OpponentChannel, frequency: f64, luminance: f64) -> f64 {
    let knots = by_luminance(channel as usize, frequency);
    let place = (place(luminance as f32)).clamp(0.0, (KNOTS - 1) as f32) as f64;
    let low = (place as usize).min(KNOTS - 2);
    10f64.powf(knots[low] + (knots[low + 1] - knots[low]) * (place - low as f64))
}

fn knot(channel: usize, luminance: usize, frequency: usize) -> f64 {
    let at = 4 * ((channel * KNOTS + luminance) * KNOTS + frequency);
    f64::from(f32::from_le_bytes([TABLE[at], TABLE[at + 1], TABLE[at + 2], TABLE[at + 3]]))
}

/// log₁₀ of the sensitivity at each luminance of the table, linear between the knots in the logarithm of the
/// frequency.
pub(crate) fn by_luminance(channel: usize, frequency: f64) -> [f64; KNOTS] {
    let (first, last) = FREQUENCIES;
    let place = (frequency / first).log10() / (last / first).log10() * (KNOTS - 1) as f64;
    let low = (place.max(0.0) as usize).min(KNOTS - 2);
    std::array::from_fn(|luminance| {
        let ends = [knot(channel, luminance, low), knot(channel, luminance, low + 1)];
        ends[0] + (ends[1] - ends[0]) * (place - low as f64)
    })
}

/// Place of a luminance, in cd/m², among the knots: 0 to KNOTS − 1 within the table.
#[inline(always)]
pub(crate) fn place(luminance: f32) -> f32 {
    // 31 steps over log₂ of 0.005…10,000 cd/m²
    log2(luminance) * 1.481_016_6 + 11.320_678
}

#[cfg(test)]
mod tests {
    use super::OpponentChannel::{Achromatic, RedGreen, YellowViolet};
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn corners_of_the_table() {
        // `o0_c1` of the JSON file: its first row begins with 0.54041479, its eleventh with 0.87367935
        let first = contrast_sensitivity(OpponentChannel::Achromatic, 0.1, 0.005);
        assert!((first.log10() - 0.540_414_79).abs() < 1e-5, "{first}");
        let eleventh = contrast_sensitivity(OpponentChannel::Achromatic, 0.1, 0.538_964_704_871);
        assert!((eleventh.log10() - 0.873_679_35).abs() < 1e-5, "{eleventh}");
        let violet =
            contrast_sensitivity(OpponentChannel::YellowViolet, 0.123_174_819_531, 0.538_964_704_871);
        assert!((violet.log10() - 0.898_588_73).abs() < 1e-5, "{violet}");
    }

    #[test]
    fn eyes_see_what_textbooks_say() {
        let of =
            |frequency, luminance| contrast_sensitivity(OpponentChannel::Achromatic, frequency, luminance);
        // Band-pass for light and dark, best at a few cycles per degree; hardly anything at 60; better in the
        // light
        assert!(of(3.0, 100.0) > of(0.3, 100.0) && of(3.0, 100.0) > of(20.0, 100.0));
        assert!(of(3.0, 100.0) > 100.0 && of(60.0, 100.0) < 2.0);
        assert!(of(8.0, 100.0) > of(8.0, 0.1));
        // Colour is low-pass
        let red = |frequency| contrast_sensitivity(OpponentChannel::RedGreen, frequency, 100.0);
        assert!(red(0.2) > red(3.0) && red(3.0) > red(20.0));
    }

    proptest! {
        #[test]
        fn luminances_beyond_the_table_are_those_at_its_ends(frequency in 0.05f64..200.0, by in 1.0f64..1e6) {
            for channel in [Achromatic, RedGreen, YellowViolet] {
                let sensitivity = |luminance| contrast_sensitivity(channel, frequency, luminance);
                prop_assert!((sensitivity(10_000.0 * by) / sensitivity(10_000.0) - 1.0).abs() < 1e-4);
                prop_assert!((sensitivity(0.005 / by) / sensitivity(0.005) - 1.0).abs() < 1e-4);
            }
        }
    }
}
