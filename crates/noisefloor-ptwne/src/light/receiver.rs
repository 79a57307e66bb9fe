//! A point that receives light, as the choice of a light sees it.

use crate::math::Vec3;
use std::f32::consts::{FRAC_1_PI, PI};

/// A point of a surface, and roughly how the surface scatters the light that it receives.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Receiver {
    pub(crate) position: Vec3,
    /// The shading normal, on the side that light comes from.
    pub(crate) normal: Vec3,
    /// Factor of the cosine in f·cos θ.
    pub(crate) diffuse: f32,
    /// Factor of the normalised lobe in f·cos θ; 0 if there is none.
    pub(crate) glossy: f32,
    /// Direction in which the middle of the lobe points.
    pub(crate) mirror: Vec3,
    /// Square of GGX's α, for the width of the lobe.
    pub(crate) alpha2: f32,
    /// One over all that it scatters of light from everywhere.
    pub(super) share: f32,
}

impl Receiver {
    /// A receiver with a diffuse part and a lobe; see the fields.
    #[inline]
    pub(crate) fn new(
        position: Vec3,
        normal: Vec3,
        diffuse: f32,
        glossy: f32,
        mirror: Vec3,
        alpha2: f32,
    ) -> Self {
        let all = PI * diffuse + glossy;
        Self {
            position,
            normal,
            diffuse,
            glossy,
            mirror,
            alpha2,
            share: if all > 0.0 { all.recip() } else { 0.0 },
        }
    }

    #[inline]
    pub(crate) fn diffuse(position: Vec3, normal: Vec3) -> Self {
        Self { position, normal, diffuse: 1.0, glossy: 0.0, mirror: normal, alpha2: 1.0, share: FRAC_1_PI }
    }

    /// A surface that light from all around reaches, scattered alike: no side is below its horizon.
    #[inline]
    pub(crate) fn all_round(position: Vec3) -> Self {
        let none = Vec3::ZERO;
        Self { position, normal: none, diffuse: 0.0, glossy: 1.0, mirror: none, alpha2: 1.0, share: 1.0 }
    }
}

impl Receiver {
    /// The normalised lobe towards a distant light with the sine `sin` of its half angle, which falls into
    /// the lobe at most as a whole.
    #[inline]
    pub(super) fn lobe(&self, dir: Vec3, sin: f32) -> f32 {
        // The half vector turns half as far as the direction
        let cos2 = (0.5 + 0.5 * self.mirror.dot(dir)).clamp(0.0, 1.0);
        let k = cos2 * self.alpha2 + (1.0 - cos2);
        let density = 0.25 * self.alpha2 / (PI * k * k);
        density / (1.0 + density * PI * sin * sin)
    }
}
