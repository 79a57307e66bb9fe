//! Whether a denoised picture is as bright as the picture it was made from.
//!
//! The vision model compares details: it does not see that a whole tile is too bright. A denoiser keeps the
//! mean of what it smooths, so a tile whose mean has moved further than its noise explains is wrong, and that
//! counts as what people would see where the tile meets the right picture: an edge of this height.

use noisefloor::{Rgb, display::Display};
use noisefloor_vision::{VisionError, VisionModel, VisionWorkspace};

/// Standard errors of the noisy mean that explain a difference: one normal mean in 16,000 lies beyond.
const ERRORS: f64 = 4.0;
/// Difference of brightness that passes, as a share of the display's range: five steps of eight bits.
/// Denoisers bend means by a step or two, where they mistake rare bright samples for fireflies.
const TOLERANCE: f32 = 0.02;

/// Linear light of one pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Light {
    /// Mean of both noisy halves.
    noisy: Rgb,
    /// Half their difference: as much noise as their mean has.
    noise: Rgb,
    /// Mean of both denoised halves.
    denoised: Rgb,
}

impl Light {
    pub(crate) fn new(noisy: [Rgb; 2], denoised: [Rgb; 2]) -> Self {
        // Halved first: the sum of two large numbers may be none
        let half = |[a, b]: [Rgb; 2], sign: f32| std::array::from_fn(|c| 0.5 * a[c] + sign * 0.5 * b[c]);
        Self { noisy: half(noisy, 1.0), noise: half(noisy, -1.0), denoised: half(denoised, 1.0) }
    }
}

/// By how much a region is too bright or too dark on the display, at least, in its worst channel: 0 if its
/// noise explains the difference, or if there is next to none.
pub(crate) fn shift(light: &[Light], display: &Display) -> f32 {
    let count = light.len().max(1) as f64;
    let (mut noisy, mut energy, mut denoised) = ([0.0; 3], [0.0; 3], [0.0; 3]);
    for light in light {
        for c in 0..3 {
            noisy[c] += f64::from(light.noisy[c]);
            energy[c] += f64::from(light.noise[c]).powi(2);
            denoised[c] += f64::from(light.denoised[c]);
        }
    }
    let mut shift = 0.0f32;
    for c in 0..3 {
        let (noisy, denoised, energy) = (noisy[c] / count, denoised[c] / count, energy[c]);
        let explained = ERRORS * energy.sqrt() / count;
        // What lies beyond the display is shown as its end is
        let shown = |value: f64| display.encode([value.clamp(0.0, f64::from(f32::MAX)) as f32; 3])[c];
        let (low, high, found) = (shown(noisy - explained), shown(noisy + explained), shown(denoised));
        shift = shift.max(low - found).max(found - high);
    }
    if shift > TOLERANCE { shift } else { 0.0 }
}

/// Just-objectionable differences of an edge of this height in the middle of a tile around `level`, a
/// luminance Y′.
pub(crate) fn jods_of_edge(
    (level, height): (f32, f32),
    size: (usize, usize),
    eyes: &VisionModel,
    room: &mut VisionWorkspace,
) -> Result<f64, VisionError> {
    let other = if level + height <= 1.0 { level + height } else { (level - height).max(0.0) };
    let reference = vec![[level; 3]; size.0 * size.1];
    let edge = |i: usize| [if i % size.0 < size.0 / 2 { level } else { other }; 3];
    let test: Vec<Rgb> = (0..reference.len()).map(edge).collect();
    // In a film, all frames have it
    Ok(10.0 - eyes.compare_frame(&test, &test, &reference, size, room)?.jod())
}
