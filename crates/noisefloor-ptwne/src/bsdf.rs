//! How surfaces scatter. Directions are local, the normal is +z, and both point away from the surface.

use crate::math::{self, Vec3};
use std::f32::consts::FRAC_1_PI;

/// Schlick's approximation of the Fresnel term (Schlick 1994), for reflectance `f0` at normal incidence.
#[inline]
pub(crate) fn schlick(f0: Vec3, cos: f32) -> Vec3 {
    let m = (1.0 - cos).clamp(0.0, 1.0);
    let m2 = m * m;
    f0 + (Vec3::ONE - f0) * (m2 * m2 * m)
}

/// Unpolarised Fresnel reflectance of a dielectric at `cos_i` ≥ 0, and the cosine of the refracted direction. `eta` is the
/// index on the far side over that on the near side. (1, 0) is total internal reflection.
#[inline]
pub(crate) fn fresnel(cos_i: f32, eta: f32) -> (f32, f32) {
    let sin2_t = (1.0 - cos_i * cos_i).max(0.0) / (eta * eta);
    if sin2_t >= 1.0 {
        return (1.0, 0.0);
    }
    let cos_t = (1.0 - sin2_t).sqrt();
    let parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    let perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    (0.5 * (parallel * parallel + perpendicular * perpendicular), cos_t)
}

/// Snell's law: the direction of `dir` (towards the surface) behind a surface with normal `n` against it.
#[inline]
pub(crate) fn refract(dir: Vec3, n: Vec3, cos_i: f32, cos_t: f32, eta: f32) -> Vec3 {
    (dir / eta + n * (cos_i / eta - cos_t)).normalize()
}

/// Isotropic GGX microfacets with Smith's height-correlated masking-shadowing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ggx {
    pub(crate) alpha: f32,
}

impl Ggx {
    /// Density of microfacet normals (Walter et al. 2007, eq. 33), written with sin² so that it keeps its precision at h = n.
    #[inline]
    fn d(self, h: Vec3) -> f32 {
        let a2 = self.alpha * self.alpha;
        let k = h.z * h.z * a2 + h.x * h.x + h.y * h.y;
        a2 * FRAC_1_PI / (k * k)
    }

    /// Smith's Λ (Heitz 2014, eq. 72).
    #[inline]
    fn lambda(self, w: Vec3) -> f32 {
        let z2 = (w.z * w.z).max(1e-12);
        let tan2 = (1.0 - w.z * w.z).max(0.0) / z2;
        0.5 * ((1.0 + self.alpha * self.alpha * tan2).sqrt() - 1.0)
    }

    /// Reflected radiance factor f·cos θᵢ without the Fresnel term, the density of [`Ggx::sample`], and the half vector's
    /// cosine with the directions. Zero if either direction lies below the surface.
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

    /// A direction of reflection from the distribution of visible normals (Dupuy, Benyoub 2023), and its weight
    /// f·cos θᵢ / density = G₂/G₁ without the Fresnel term, and the half vector's cosine. Weight 0: nothing is reflected.
    #[inline]
    pub(crate) fn sample(self, wo: Vec3, u: [f32; 2]) -> (Vec3, f32, f32) {
        // Stretch, take a normal of the hemisphere as the sum of wo and a point of a spherical cap, and stretch back
        let stretched = Vec3::new(wo.x * self.alpha, wo.y * self.alpha, wo.z).normalize();
        let z = (1.0 - u[0]) * (1.0 + stretched.z) - stretched.z;
        let r = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = math::turn(u[1]);
        let c = Vec3::new(r * cos, r * sin, z) + stretched;
        let h = Vec3::new(c.x * self.alpha, c.y * self.alpha, c.z.max(1e-7)).normalize();
        let cos_h = wo.dot(h);
        let wi = h * (2.0 * cos_h) - wo;
        if wi.z <= 0.0 || cos_h <= 0.0 {
            return (wi, 0.0, 1.0);
        }
        let (lo, li) = (self.lambda(wo), self.lambda(wi));
        (wi, (1.0 + lo) / (1.0 + lo + li), cos_h)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::PI;

    /// ∫ density over the hemisphere and ∫ f·cos agree with the sampled weights: both by midpoint rule over (θ, φ).
    #[test]
    fn ggx_samples_what_it_evaluates() {
        for (alpha, cos) in [(0.15f32, 0.9f32), (0.5, 0.7), (1.0, 0.3)] {
            let ggx = Ggx { alpha };
            let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
            let n = 1500;
            let (mut albedo, mut mass) = (0.0, 0.0);
            for i in 0..n {
                // Uniform in cos θ would waste points on the lobe: use θ
                let theta = (i as f32 + 0.5) / n as f32 * 0.5 * PI;
                for j in 0..n {
                    let phi = (j as f32 + 0.5) / n as f32 * 2.0 * PI;
                    let wi = Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
                    let (f, pdf, _) = ggx.eval(wo, wi);
                    let area = f64::from(theta.sin()) * (0.5 * PI * 2.0 * PI) as f64 / f64::from(n * n);
                    albedo += f64::from(f) * area;
                    mass += f64::from(pdf) * area;
                }
            }
            let m = 1000;
            let (mut sampled, mut alive) = (0.0, 0.0);
            for i in 0..m * m {
                let u = [((i / m) as f32 + 0.5) / m as f32, ((i % m) as f32 + 0.5) / m as f32];
                let (_, weight, _) = ggx.sample(wo, u);
                sampled += f64::from(weight) / f64::from(m * m);
                alive += f64::from(u8::from(weight > 0.0)) / f64::from(m * m);
            }
            // Both quadratures are good to 1e-3 here: the integrands are smooth at the scale of the grids
            assert!((albedo - sampled).abs() < 2e-3, "α {alpha}: {albedo} {sampled}");
            assert!((mass - alive).abs() < 2e-3, "α {alpha}: {mass} {alive}");
        }
    }

    #[test]
    fn fresnel_at_known_angles() {
        // Normal incidence: ((n−1)/(n+1))²; Brewster's angle: the parallel part vanishes; beyond the critical angle: 1
        assert!((fresnel(1.0, 1.5).0 - 0.04).abs() < 1e-6);
        let brewster = 1.5f32.atan();
        let expected = 0.5 * ((1.0 - 2.25f32) / (1.0 + 2.25)).powi(2);
        assert!((fresnel(brewster.cos(), 1.5).0 - expected).abs() < 1e-5);
        assert_eq!(fresnel(0.5, 1.0 / 1.5), (1.0, 0.0));
        assert!((fresnel(0.0, 1.5).0 - 1.0).abs() < 1e-6);
    }
}
