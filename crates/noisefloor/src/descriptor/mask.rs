//! The noise mask: an image minus its 3×3 Gaussian blur (Takouachet et al. 2017, §5.1).

use crate::evidence::Plane;
use multiversion::multiversion;
#[cfg(feature = "files")]
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A checked mask width: σ of the 3×3 Gaussian, in pixels, within [0.3, 1.5] (Takouachet et al. 2017, §5.1).
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "files", derive(Serialize, Deserialize))]
#[cfg_attr(feature = "files", serde(try_from = "f32", into = "f32"))]
pub struct NoiseMask {
    sigma: f32,
}

/// σ outside [0.3, 1.5].
#[derive(Debug, Error, Clone, Copy, PartialEq)]
#[error("the noise mask needs a σ within 0.3…1.5 pixels, not {0}")]
pub struct SigmaError(pub f32);

impl Default for NoiseMask {
    /// σ = 1.
    fn default() -> Self {
        Self { sigma: 1.0 }
    }
}

impl TryFrom<f32> for NoiseMask {
    type Error = SigmaError;

    fn try_from(sigma: f32) -> Result<Self, SigmaError> {
        if (0.3..=1.5).contains(&sigma) { Ok(Self { sigma }) } else { Err(SigmaError(sigma)) }
    }
}

impl From<NoiseMask> for f32 {
    fn from(mask: NoiseMask) -> f32 {
        mask.sigma
    }
}

impl NoiseMask {
    /// σ in pixels.
    pub fn sigma(&self) -> f32 {
        self.sigma
    }

    /// The weights of one row of the separable kernel: neighbour, centre; neighbour + centre + neighbour = 1.
    pub fn weights(&self) -> (f32, f32) {
        let neighbour = (-0.5 / (self.sigma * self.sigma)).exp();
        let sum = 1.0 + 2.0 * neighbour;
        (neighbour / sum, 1.0 / sum)
    }

    /// Share of the variance of white noise that the mask lets through: Σ (δ − g)², over the 3×3 kernel g.
    /// Mask energies divided by it are variances of the pixels.
    pub fn white_noise_gain(&self) -> f32 {
        let (n, c) = self.weights();
        let squares = 2.0 * n * n + c * c; // Σ g² of one direction
        1.0 - 2.0 * c * c + squares * squares
    }

    /// The noise mask of a plane, of the same shape and unit. Pixels beyond the edge repeat the edge.
    pub fn apply(&self, plane: &Plane) -> Plane {
        let (height, width) = plane.size();
        let mut out = Plane::filled((height, width), 0.0);
        if width == 0 || height == 0 {
            return out;
        }
        let (weights, mut column) = (self.weights(), vec![0.0; width]);
        for (y, target) in out.values_mut().chunks_exact_mut(width).enumerate() {
            let around = [y.saturating_sub(1), y, (y + 1).min(height - 1)].map(|y| plane.row(y));
            mask_row(weights, around, &mut column, target);
        }
        out
    }
}

/// The mask of one row of a plane, `here`, which is not empty, into `out`, by the weights of [`NoiseMask::weights`]: blurs along
/// columns into `column`, which has room for as many numbers, then along that, and takes the blur off.
#[multiversion(targets("x86_64+avx512f+avx512vl+avx512dq+avx2", "x86_64+avx2"))]
pub(super) fn mask_row(
    (n, c): (f32, f32),
    [above, here, below]: [&[f32]; 3],
    column: &mut [f32],
    out: &mut [f32],
) {
    let width = out.len();
    let (above, here, below, column) =
        (&above[..width], &here[..width], &below[..width], &mut column[..width]);
    for x in 0..width {
        column[x] = n * (above[x] + below[x]) + c * here[x];
    }
    let masked = |before: f32, middle: f32, after: f32, here: f32| here - (n * (before + after) + c * middle);
    for x in 1..width.max(1) - 1 {
        out[x] = masked(column[x - 1], column[x], column[x + 1], here[x]);
    }
    let last = width - 1;
    out[0] = masked(column[0], column[0], column[last.min(1)], here[0]);
    out[last] = masked(column[last.saturating_sub(1)], column[last], column[last], here[last]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn an_impulse_gives_the_kernel() {
        let mut plane = Plane::filled((5, 5), 0.0);
        plane[(2, 2)] = 1.0;
        let mask = NoiseMask::default();
        let (n, c) = mask.weights();
        let out = mask.apply(&plane);
        assert!((out[(2, 2)] - (1.0 - c * c)).abs() < 1e-6);
        assert!((out[(2, 1)] + n * c).abs() < 1e-6);
        assert!((out[(1, 1)] + n * n).abs() < 1e-6);
        assert_eq!(out[(0, 2)], 0.0);
        // exp(-1/2) and exp(-1) against the centre: the two-dimensional Gaussian of σ = 1.
        assert!((n / c - (-0.5f32).exp()).abs() < 1e-6);
    }

    #[test]
    fn white_noise_gain_is_the_energy_of_the_impulse_response() {
        for sigma in [0.3, 0.7, 1.0, 1.5] {
            let mask = NoiseMask::try_from(sigma).unwrap();
            let mut plane = Plane::filled((5, 5), 0.0);
            plane[(2, 2)] = 1.0;
            let energy: f32 = mask.apply(&plane).values().iter().map(|v| v * v).sum();
            assert!((energy - mask.white_noise_gain()).abs() < 1e-6);
        }
    }

    #[test]
    fn sigma_is_checked() {
        for bad in [0.29, 1.51, f32::NAN, -1.0, f32::INFINITY] {
            assert!(NoiseMask::try_from(bad).is_err(), "{bad}");
        }
    }

    proptest! {
        #[test]
        fn planes_without_detail_vanish(level in 0.0f32..1.0, slope in -0.01f32..0.01, sigma in 0.3f32..=1.5) {
            let mask = NoiseMask::try_from(sigma).unwrap();
            let ramp = Plane::from_fn((8, 9), |(y, x)| level + slope * (x as f32 + 2.0 * y as f32));
            let out = mask.apply(&ramp);
            // The mask of a ramp is zero but at the repeated edge.
            for y in 1..7 {
                for x in 1..8 {
                    prop_assert!(out[(y, x)].abs() < 1e-6);
                }
            }
        }

        #[test]
        fn is_linear(a in -2.0f32..2.0, seed in 0u32..100) {
            let mask = NoiseMask::default();
            let plane = Plane::from_fn((6, 7), |(y, x)| ((y * 31 + x * 17 + seed as usize) % 13) as f32 / 13.0);
            let (scaled, out) = (mask.apply(&Plane::from_fn((6, 7), |at| plane[at] * a)), mask.apply(&plane));
            prop_assert!(scaled.values().iter().zip(out.values()).all(|(s, o)| (s - a * o).abs() < 1e-5));
        }
    }
}
