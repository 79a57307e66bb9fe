//! Reconstruction filters.

use crate::math;
use serde::{Deserialize, Serialize};

/// A reconstruction filter. Sample positions are drawn from it (Ernst, Stamminger, Greiner 2006, "Filter
/// Importance Sampling"). Each sample therefore counts for one pixel, with the same weight as all others, and
/// noise stays independent from pixel to pixel: the oracle judges it as with a box. Neighbouring pixels
/// partly see the same light, so that the picture is softer than with a box.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Filter {
    /// Uniform over the pixel.
    #[default]
    Box,
    /// A tent, two pixels wide.
    Tent,
    /// A Gaussian with a standard deviation of half a pixel, cut off two pixels from the centre.
    Gaussian,
}

/// Standard deviation and radius of the Gaussian in pixels.
const SIGMA: f32 = 0.5;
const RADIUS: f32 = 2.0;

impl Filter {
    /// The position of a sample relative to the corner of its pixel, in pixels, for `u` uniform in the unit
    /// square.
    #[inline]
    pub(crate) fn offset(self, u: [f32; 2]) -> [f32; 2] {
        match self {
            Self::Box => u,
            Self::Tent => u.map(|u| {
                let from_edge = (2.0 * u.min(1.0 - u)).sqrt();
                if u < 0.5 { from_edge - 0.5 } else { 1.5 - from_edge }
            }),
            Self::Gaussian => {
                // Box and Muller 1958, with the radius bounded
                let kept = 1.0 - (-0.5 * (RADIUS / SIGMA) * (RADIUS / SIGMA)).exp();
                let r = SIGMA * (-2.0 * (-u[0] * kept).ln_1p()).sqrt();
                let (sin, cos) = math::turn(u[1]);
                [0.5 + r * cos, 0.5 + r * sin]
            }
        }
    }

    /// The farthest that samples lie outside their pixel.
    pub(crate) fn reach(self) -> f32 {
        match self {
            Self::Box => 0.0,
            Self::Tent => 0.5,
            Self::Gaussian => RADIUS,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Mean and variance of the offsets, by the midpoint rule: 1/12 pixel² for the box, 1/6 for the tent, 1/4
    /// for the Gaussian, of which less than 1e-3 is cut off.
    #[test]
    fn offsets_have_the_filters_moments() {
        let n = 1000;
        for (filter, variance) in
            [(Filter::Box, 1.0 / 12.0), (Filter::Tent, 1.0 / 6.0), (Filter::Gaussian, 0.25)]
        {
            let (mut mean, mut square) = ([0.0; 2], [0.0; 2]);
            for i in 0..n * n {
                let u = [(i % n) as f32 + 0.5, (i / n) as f32 + 0.5].map(|x| x / n as f32);
                for (axis, x) in filter.offset(u).into_iter().enumerate() {
                    assert!(x >= -filter.reach() - 1e-6 && x <= 1.0 + filter.reach() + 1e-6);
                    mean[axis] += f64::from(x) - 0.5;
                    square[axis] += (f64::from(x) - 0.5).powi(2);
                }
            }
            let count = f64::from(n * n);
            assert!(mean.iter().all(|m| (m / count).abs() < 1e-3), "{filter:?}: {mean:?}");
            assert!(square.iter().all(|s| (s / count - variance).abs() < 2e-3), "{filter:?}: {square:?}");
        }
    }
}
