//! A rough dielectric boundary (Walter et al. 2007).

use super::fresnel::{fresnel, refract};
use super::ggx::Ggx;
use crate::math::Vec3;

/// Microfacets that reflect and refract, seen from one side.
#[derive(Clone, Copy, Debug)]
pub(crate) struct RoughGlass {
    ggx: Ggx,
    /// Index of refraction of the far side over that of the near side.
    eta: f32,
    /// Factor on refracted radiance, which spreads over η² of its solid angle.
    tint: Vec3,
}

impl RoughGlass {
    pub(crate) fn new(ggx: Ggx, eta: f32, tint: Vec3) -> Self {
        Self { ggx, eta, tint: tint / (eta * eta) }
    }

    /// f·cos θᵢ, and the density of [`RoughGlass::sample`]. `wi` may lie on either side.
    #[inline]
    pub(crate) fn eval(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let none = (Vec3::ZERO, 0.0);
        let reflects = wi.z > 0.0;
        // Eqs. 13 and 16
        let half = if reflects { wo + wi } else { -(wo + wi * self.eta) };
        let Some(h) = half.try_normalize() else { return none };
        let h = if h.z < 0.0 { -h } else { h };
        let (cos_o, cos_i) = (wo.dot(h), wi.dot(h));
        if wo.z <= 0.0 || cos_o <= 0.0 || (cos_i > 0.0) != reflects {
            return none;
        }
        let (lo, li) = (self.ggx.lambda(wo), self.ggx.lambda(wi));
        let (reflectance, _) = fresnel(cos_o.min(1.0), self.eta);
        let (d, g) = (self.ggx.d(h), self.ggx.g2(lo, li));
        let visible = self.ggx.normal_pdf(wo, h);
        if reflects {
            let f = reflectance * d * g / (4.0 * wo.z);
            (Vec3::splat(f), reflectance * visible / (4.0 * cos_o))
        } else {
            // Eqs. 17 and 21; the η² of eq. 21 is that of directions, and the tint divides by it
            let scale = cos_o + self.eta * cos_i;
            let jacobian = self.eta * self.eta * -cos_i / (scale * scale).max(1e-12);
            let f = (1.0 - reflectance) * d * g * cos_o / wo.z * jacobian;
            (self.tint * f, (1.0 - reflectance) * visible * jacobian)
        }
    }

    /// η² of a boundary that light from `wi` crosses; 1 if it is reflected.
    #[inline]
    pub(crate) fn eta2(&self, wi: Vec3) -> f32 {
        if wi.z > 0.0 { 1.0 } else { self.eta * self.eta }
    }

    /// A direction, its weight f·cos θᵢ / density, and its density; `None` if nothing is scattered.
    #[inline]
    pub(crate) fn sample(&self, wo: Vec3, [pick, u, v]: [f32; 3]) -> Option<(Vec3, Vec3, f32)> {
        let h = self.ggx.visible_normal(wo, [u, v]);
        let cos_h = wo.dot(h);
        if wo.z <= 0.0 || cos_h <= 0.0 {
            return None;
        }
        let (reflectance, cos_t) = fresnel(cos_h.min(1.0), self.eta);
        let reflects = pick < reflectance;
        let wi = if reflects { h * (2.0 * cos_h) - wo } else { refract(-wo, h, cos_h, cos_t, self.eta) };
        if (wi.z > 0.0) != reflects || wi.z == 0.0 {
            return None;
        }
        let weight = (1.0 + self.ggx.lambda(wo)) * self.ggx.g2(self.ggx.lambda(wo), self.ggx.lambda(wi));
        let (_, pdf) = self.eval(wo, wi);
        let colour = if reflects { Vec3::ONE } else { self.tint };
        (pdf > 0.0 && pdf.is_finite()).then_some((wi, colour * weight, pdf))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bsdf::Facets;
    use crate::math::sphere;

    /// The density integrates to the share of samples that scatter, and weights are f·cos / density.
    #[test]
    fn what_is_sampled_is_what_is_evaluated() {
        let (ggx, beckmann) = (Facets::GgxUncorrelated, Facets::BeckmannUncorrelated);
        for (facets, alpha, eta, cos) in [
            (ggx, 0.3f32, 1.5f32, 0.8f32),
            (ggx, 0.5, 1.0 / 1.5, 0.9),
            (beckmann, 0.2, 1.33, 0.4),
            (beckmann, 0.5, 1.0 / 1.5, 0.9),
        ] {
            let glass = RoughGlass::new(Ggx::of(alpha, facets), eta, Vec3::splat(0.8));
            let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
            let n = 400u32;
            let at = |i: u32| (i as f32 + 0.5) / n as f32;
            let (mut mass, mut light, mut scattered, mut weights) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
            for i in 0..n {
                for j in 0..n {
                    let (f, pdf) = glass.eval(wo, sphere([at(i), at(j)]));
                    mass += f64::from(pdf);
                    light += f64::from(f.x);
                    let pick = (i * 7 + j * 13) % n;
                    if let Some((wi, weight, pdf)) = glass.sample(wo, [at(pick), at(i), at(j)]) {
                        scattered += 1.0;
                        weights += f64::from(weight.x);
                        let (f, density) = glass.eval(wo, wi);
                        assert!((density / pdf - 1.0).abs() < 1e-3);
                        assert!(
                            (f.x / density / weight.x - 1.0).abs() < 2e-2,
                            "{} {}",
                            f.x / density,
                            weight.x
                        );
                    }
                }
            }
            let points = f64::from(n * n);
            let sphere = 4.0 * std::f64::consts::PI;
            assert!((mass / points * sphere - scattered / points).abs() < 0.02, "{mass} {scattered}");
            assert!((light / points * sphere - weights / points).abs() < 0.02, "{light} {weights}");
        }
    }
}
