//! Bands of spatial frequency, and what is worked out once for a display.

use crate::csf::{KNOTS, by_luminance};
use crate::lanes::map_rows;
use crate::masking::{CHANNEL_GAINS, SENSITIVITY_DB};
use crate::math::exp2;
use crate::pyramid::Size;
use crate::temporal::ALL_CHANNELS;
use multiversion::multiversion;
use std::f64::consts::LOG2_10;
use std::ops::Range;

/// Centre of the second band beside the highest frequency that pixels can show; further bands halve it.
const SECOND: f64 = 0.3228;
/// Bands end with the first one below this, in cycles per degree.
const LOWEST: f64 = 0.2;
/// Frequency that the coarsest band is taken to have, in cycles per degree.
const BASEBAND: f64 = 0.1;

/// log₂ of the sensitivity of one channel at each luminance of the table, and the step to the next.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Curve {
    values: [f32; KNOTS],
    steps: [f32; KNOTS],
}

/// A display's bands.
#[derive(Clone, Debug)]
pub(crate) struct Bands {
    /// From the finest on; those that a picture is too small for go unused.
    pub(crate) frequencies: Vec<f64>,
    pub(crate) curves: Vec<[Curve; ALL_CHANNELS]>,
    pub(crate) baseband: [Curve; ALL_CHANNELS],
}

impl Bands {
    pub(crate) fn new(pixels_per_degree: f64) -> Self {
        let nyquist = pixels_per_degree / 2.0;
        let centre = |band: i32| if band == 0 { nyquist } else { SECOND * nyquist / 2f64.powi(band - 1) };
        let last = (0..).find(|&band| centre(band) <= LOWEST).expect("they halve");
        let frequencies: Vec<f64> = (0..=last).map(centre).collect();
        let curves = frequencies
            .iter()
            // Between the finest and the coarsest band, the pyramid halves contrasts
            .enumerate()
            .map(|(band, &frequency)| curves(frequency, if band == 0 { 1.0 } else { 2.0 }))
            .collect();
        Self { frequencies, curves, baseband: curves_of_baseband() }
    }

    /// Levels of the Gaussian pyramid of a picture, the coarsest of which is the baseband.
    pub(crate) fn levels(&self, size: Size) -> usize {
        let most = size.width.min(size.height).max(2).ilog2() as usize - 1;
        self.frequencies.len().min(most) + 1
    }

    /// Bands of a picture of at least 4×4 pixels whose centres lie between two frequencies; if none does, the
    /// nearest one.
    pub(crate) fn within(&self, size: Size, (lowest, highest): (f64, f64)) -> Range<usize> {
        let bands = &self.frequencies[..self.levels(size) - 1];
        let start = bands.iter().take_while(|&&frequency| frequency > highest).count();
        let end = bands.iter().take_while(|&&frequency| frequency >= lowest).count();
        let start = start.min(bands.len() - 1);
        start..end.max(start + 1)
    }
}

fn curves_of_baseband() -> [Curve; ALL_CHANNELS] {
    let mut curves = curves(BASEBAND, 1.0);
    // Its difference is not masked, and has no gain by channel
    for (curve, gain) in curves.iter_mut().zip(CHANNEL_GAINS) {
        curve.values.iter_mut().for_each(|value| *value -= gain.log2() as f32);
    }
    curves
}

fn curves(frequency: f64, contrast: f64) -> [Curve; ALL_CHANNELS] {
    std::array::from_fn(|channel| {
        let shift = SENSITIVITY_DB / 20.0 * LOG2_10 + (CHANNEL_GAINS[channel] * contrast).log2();
        let values = by_luminance(channel, frequency).map(|log10| (log10 * LOG2_10 + shift) as f32);
        Curve { values, steps: std::array::from_fn(|i| values[(i + 1).min(KNOTS - 1)] - values[i]) }
    })
}

/// log₂ of the sensitivities at places between the knots.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
pub(crate) fn sensitivity_row(curve: &Curve, places: &[f32], out: &mut [f32]) {
    /// Adding it to a number below it leaves the nearest integer in the lowest bits.
    const WHOLE: f32 = (1 << 23) as f32;
    map_rows([places], [out], |[place]| {
        // Rounded down by hand: a cast keeps what is no integer from being one, number by number
        let near = (place + WHOLE) - WHOLE;
        let low = if near > place { near - 1.0 } else { near };
        // Places lie within 0…KNOTS − 1; the remainder says so to the compiler
        let knot = (low + WHOLE).to_bits() as usize % KNOTS;
        [curve.values[knot] + curve.steps[knot] * (place - low)]
    });
}

/// Sensitivity at one place between the knots.
pub(crate) fn sensitivity(curve: &Curve, place: f32) -> f32 {
    let mut log = [0.0];
    sensitivity_row(curve, &[place], &mut log);
    exp2(log[0])
}
