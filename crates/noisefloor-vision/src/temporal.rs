//! Films: what eyes make of noise that is new in every frame (Mantiuk et al. 2024, §3.3), with the constants of
//! `cvvdp_parameters.json` 0.5.7.
//!
//! ColorVideoVDP filters a film over time into four channels: the three of a still, which follow slowly (they are
//! called sustained), and a transient one, which sees changes of light. Noise that is independent from frame to
//! frame looks the same in space after such a filter, and has √(Σ hₖ²) of its standard deviation. What is the same
//! in every frame passes the sustained channels as it is (Σ hₖ = 1), and not the transient one (Σ hₖ = 3·10⁻⁷).
//! So one frame, with its noise times a gain for each channel, stands for the film. The mean of a heavy tail over
//! frames is nearer to a normal distribution than its values are, which this leaves out.

use crate::photometry::CHANNELS;

/// With the transient one.
pub(crate) const ALL_CHANNELS: usize = CHANNELS + 1;
/// The last channel: changes of light. Its planes of the reference are zero, so nothing masks in it.
pub(crate) const TRANSIENT: usize = CHANNELS;
/// How much the transient channel counts beside the others.
pub(crate) const TRANSIENT_WEIGHT: f64 = 0.808_113_455_772_399_9; // ch_trans_w

/// Width and power of the filters, by channel.
const WIDTHS: [f64; ALL_CHANNELS] = [5.793_36, 14.1255, 6.636_61, 0.123_14]; // sigma_tf
const POWERS: [f64; ALL_CHANNELS] = [1.3314, 1.1196, 0.947_901, 0.1898]; // beta_tf
/// What the transient channel sees best, in Hz.
const PEAK: f64 = 5.0;
/// How long filters are, in seconds.
const LENGTH: f64 = 0.25;

/// The standard deviation of noise behind the filter of each channel, as a share of that in each frame, at this many
/// frames per second.
pub(crate) fn gains(frames_per_second: f64) -> [f32; ALL_CHANNELS] {
    // Filters have an odd number of taps, and responses that are real: by Parseval's theorem, the sum of the squares
    // of the taps is the mean of the squared responses, at the frequencies that ColorVideoVDP takes them at
    let half = (LENGTH * frames_per_second / 2.0).ceil().max(1.0) as usize;
    let step = frames_per_second / (2 * half) as f64;
    std::array::from_fn(|channel| {
        let square = |k: usize| response(channel, k as f64 * step).powi(2);
        let sum = square(0) + 2.0 * (1..=half).map(square).sum::<f64>();
        (sum / (2 * half + 1) as f64).sqrt() as f32
    })
}

/// How much of a frequency, in Hz, passes a filter.
fn response(channel: usize, frequency: f64) -> f64 {
    let power = frequency.powf(POWERS[channel]);
    if channel == TRANSIENT {
        (-(power - PEAK.powf(POWERS[channel])).powi(2) / WIDTHS[channel]).exp()
    } else {
        (-power / WIDTHS[channel]).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// √(Σ hₖ²) of the filters that `get_temporal_filters` of the package returns.
    #[test]
    fn gains_are_those_of_the_package() {
        for (rate, expected) in [
            (24.0, [0.4197, 0.6206, 0.5298, 0.7740]),
            (25.0, [0.4021, 0.6150, 0.5185, 0.7757]),
            (30.0, [0.3774, 0.5712, 0.4828, 0.7275]),
            (60.0, [0.2746, 0.4210, 0.3534, 0.5458]),
            (120.0, [0.1994, 0.3026, 0.2549, 0.3912]),
        ] {
            for (found, expected) in gains(rate).into_iter().zip(expected) {
                assert!((found - expected).abs() < 1e-4, "{rate}: {found} for {expected}");
            }
        }
    }

    #[test]
    fn what_stands_still_is_seen_by_all_channels_but_the_transient_one() {
        let still: Vec<f64> = (0..ALL_CHANNELS).map(|channel| response(channel, 0.0)).collect();
        assert_eq!(still[..TRANSIENT], [1.0; CHANNELS]);
        assert!(still[TRANSIENT] < 1e-6, "{still:?}");
    }
}
