//! GGX microfacets.

use crate::math::{self, Vec3};
use std::f32::consts::FRAC_1_PI;

/// Smallest roughness (GGX α) that is treated as rough; below it, a surface is smooth.
pub const MIN_ROUGHNESS: f32 = 1e-3;

/// Isotropic GGX microfacets with Smith's height-correlated masking-shadowing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ggx {
    pub(crate) alpha: f32,
}

impl Ggx {
    /// Density of microfacet normals (Walter et al. 2007, eq. 33), written with sin² to stay precise at h =
    /// n.
    #[inline]
    fn d(self, h: Vec3) -> f32 {
        let a2 = self.alpha * self.alpha;
        let k = h.z * h.z * a2 + h.x * h.x + h.y * h.y;
        a2 * FRAC_1_PI / (k * k)
    }

    /// Smith's Λ (Heitz 2014, eq. 72).
    #[inline]
    pub(super) fn lambda(self, w: Vec3) -> f32 {
        let z2 = (w.z * w.z).max(1e-12);
        let tan2 = (1.0 - w.z * w.z).max(0.0) / z2;
        0.5 * ((1.0 + self.alpha * self.alpha * tan2).sqrt() - 1.0)
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
        (base / (1.0 + lo + li), base / (1.0 + lo), wo.dot(h).max(0.0))
    }

    /// A normal from the distribution of visible normals (Dupuy, Benyoub 2023).
    #[inline]
    pub(super) fn visible_normal(self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        // Stretch; a normal of the hemisphere is the sum of wo and a point of a spherical cap; stretch back
        let stretched = Vec3::new(wo.x * self.alpha, wo.y * self.alpha, wo.z).normalize();
        let z = (1.0 - u[0]) * (1.0 + stretched.z) - stretched.z;
        let r = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = math::turn(u[1]);
        let c = Vec3::new(r * cos, r * sin, z) + stretched;
        Vec3::new(c.x * self.alpha, c.y * self.alpha, c.z.max(1e-7)).normalize()
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
        (wi, (1.0 + lo) / (1.0 + lo + li), cos_h)
    }
}
