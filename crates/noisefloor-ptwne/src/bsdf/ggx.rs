//! Microfacets: GGX and Beckmann.

use super::beckmann;
use crate::math::{self, Vec3};
use std::f32::consts::FRAC_1_PI;

/// Smallest roughness (GGX α) that is treated as rough; below it, a surface is smooth.
pub const MIN_ROUGHNESS: f32 = 1e-3;

/// How the normals of microfacets are distributed, and how they hide each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Facets {
    /// GGX with Smith's height-correlated masking and shadowing (Heitz 2014, eq. 99).
    #[default]
    Ggx,
    /// GGX with masking and shadowing independent of each other, as in Mitsuba and Walter et al. 2007: darker
    /// at grazing angles.
    GgxUncorrelated,
    /// Beckmann's distribution, also with independent masking and shadowing.
    BeckmannUncorrelated,
}

impl Facets {
    /// The same with masking and shadowing independent of each other.
    pub(crate) fn uncorrelated(self) -> Self {
        match self {
            Self::Ggx => Self::GgxUncorrelated,
            other => other,
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Ggx {
    /// α, or the geometric mean of those along both axes.
    pub(crate) alpha: f32,
    /// α along x over the mean, and its inverse; 1 if no direction differs.
    stretch: [f32; 2],
    facets: Facets,
}

impl Ggx {
    #[inline]
    pub(crate) fn of(alpha: f32, facets: Facets) -> Self {
        Self { alpha, stretch: [1.0; 2], facets }
    }

    /// The same facets with other α along x and y.
    #[inline]
    pub(crate) fn stretched(self, [x, y]: [f32; 2]) -> Self {
        if x == y {
            return Self { alpha: x, stretch: [1.0; 2], ..self };
        }
        let alpha = (x * y).sqrt();
        Self { alpha, stretch: [x / alpha, alpha / x], ..self }
    }

    /// A normal of the facets as it would be if their α was the same in all directions (Heitz 2014, §5.3);
    /// but for its length.
    #[inline]
    fn squeezed(self, h: Vec3) -> Vec3 {
        Vec3::new(h.x * self.stretch[1], h.y * self.stretch[0], h.z)
    }

    /// Density of microfacet normals (Walter et al. 2007, eqs. 33 and 25), written with sin² to stay precise
    /// at h = n.
    #[inline]
    pub(super) fn d(self, h: Vec3) -> f32 {
        let h = self.squeezed(h);
        let a2 = self.alpha * self.alpha;
        if self.facets == Facets::BeckmannUncorrelated {
            let z2 = (h.z * h.z).max(1e-12);
            return (-(h.x * h.x + h.y * h.y) / (a2 * z2)).exp() * FRAC_1_PI / (a2 * z2 * z2);
        }
        let k = h.z * h.z * a2 + h.x * h.x + h.y * h.y;
        a2 * FRAC_1_PI / (k * k)
    }

    /// Smith's Λ (Heitz 2014, eq. 72; for Beckmann the rational approximation of Walter et al. 2007).
    #[inline]
    pub(super) fn lambda(self, w: Vec3) -> f32 {
        let z2 = (w.z * w.z).max(1e-12);
        let tan2 = if self.stretch[0] == 1.0 {
            (1.0 - w.z * w.z).max(0.0) / z2
        } else {
            let [x, y] = [w.x * self.stretch[0], w.y * self.stretch[1]];
            (x * x + y * y) / z2
        };
        if self.facets == Facets::BeckmannUncorrelated {
            let a = 1.0 / (self.alpha * tan2.sqrt()).max(1e-6);
            return if a < 1.6 {
                (1.0 - 1.259 * a + 0.396 * a * a) / (3.535 * a + 2.181 * a * a)
            } else {
                0.0
            };
        }
        0.5 * ((1.0 + self.alpha * self.alpha * tan2).sqrt() - 1.0)
    }

    /// Share of the facets that both directions see, from their Λ.
    #[inline]
    pub(super) fn g2(self, lo: f32, li: f32) -> f32 {
        match self.facets {
            Facets::Ggx => 1.0 / (1.0 + lo + li),
            Facets::GgxUncorrelated | Facets::BeckmannUncorrelated => 1.0 / ((1.0 + lo) * (1.0 + li)),
        }
    }

    /// Density of the normals that [`Ggx::visible_normal`] samples.
    #[inline]
    pub(super) fn normal_pdf(self, wo: Vec3, h: Vec3) -> f32 {
        self.d(h) * wo.dot(h).max(0.0) / (wo.z * (1.0 + self.lambda(wo)))
    }

    /// f·cos θᵢ without the Fresnel term, the density of [`Ggx::sample`], and the half vector's cosine with
    /// the directions. Zero if either direction lies below the surface.
    #[inline]
    pub(crate) fn eval(self, wo: Vec3, wi: Vec3) -> (f32, f32, f32) {
        if wo.z <= 0.0 || wi.z <= 0.0 {
            return (0.0, 0.0, 1.0);
        }
        let h = (wo + wi).normalize();
        let (d, lo, li) = (self.d(h), self.lambda(wo), self.lambda(wi));
        let base = d / (4.0 * wo.z);
        (base * self.g2(lo, li), base / (1.0 + lo), wo.dot(h).max(0.0))
    }

    /// A normal from the distribution of visible normals (Dupuy, Benyoub 2023; Beckmann's: Heitz, d'Eon 2014).
    #[inline]
    pub(super) fn visible_normal(self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        // Stretch; a normal of the hemisphere is the sum of wo and a point of a spherical cap; stretch back
        let [x, y] = self.stretch.map(|stretch| self.alpha * stretch);
        let stretched = Vec3::new(wo.x * x, wo.y * y, wo.z).normalize();
        if self.facets == Facets::BeckmannUncorrelated {
            let slopes = beckmann::visible_slopes(stretched, u);
            return Vec3::new(-slopes[0] * x, -slopes[1] * y, 1.0).normalize();
        }
        let z = (1.0 - u[0]) * (1.0 + stretched.z) - stretched.z;
        let r = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = math::turn(u[1]);
        let c = Vec3::new(r * cos, r * sin, z) + stretched;
        Vec3::new(c.x * x, c.y * y, c.z.max(1e-7)).normalize()
    }

    /// A direction, reflected by a visible normal; its weight f·cos θᵢ / density = G₂/G₁ without the Fresnel
    /// term; and the half vector's cosine. Weight 0: nothing is reflected.
    #[inline]
    pub(crate) fn sample(self, wo: Vec3, u: [f32; 2]) -> (Vec3, f32, f32) {
        let h = self.visible_normal(wo, u);
        let cos_h = wo.dot(h);
        let wi = h * (2.0 * cos_h) - wo;
        if wi.z <= 0.0 || cos_h <= 0.0 {
            return (wi, 0.0, 1.0);
        }
        let (lo, li) = (self.lambda(wo), self.lambda(wi));
        (wi, (1.0 + lo) * self.g2(lo, li), cos_h)
    }
}
