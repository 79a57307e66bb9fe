//! What Disney's principled surface has besides microfacets (Burley 2012, "Physically Based Shading at
//! Disney", and 2015, "Extending the Disney BRDF to a BSDF").

use super::fresnel::schlick;
use super::ggx::{Facets, Ggx, MIN_ROUGHNESS};
use crate::material::{Dialect, Principled};
use crate::math::{self, Vec3};
use std::f32::consts::PI;

/// The diffuse reflection at one point, with what the microfacets there are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Burley {
    roughness: f32,
    flatness: f32,
    /// f of the sheen without its Fresnel term.
    pub(super) sheen: Vec3,
    pub(super) ggx: Ggx,
    /// How much of the facets reflects by Schlick's term, metal or tinted, and with which colour.
    pub(super) schlick: (f32, Vec3),
}

impl Burley {
    pub(super) fn new(more: &Principled, base: Vec3, roughness: f32, metallic: f32) -> Self {
        let light = math::luminance(base);
        let hue = if light > 0.0 { base / light } else { Vec3::ONE };
        let normal = ((more.ior - 1.0) / (more.ior + 1.0)).powi(2);

        // Schlick's term is linear in its colour, so two of them are one
        let (share, colour) = match more.dialect {
            Dialect::Mitsuba => {
                let tinted = (1.0 - metallic) * more.specular_tint;
                let share = metallic + tinted;
                let sum = base * metallic + hue * (normal * tinted);
                (share, if share > 0.0 { sum / share } else { Vec3::ZERO })
            }
            Dialect::Pbrt => {
                let dielectric = Vec3::ONE.lerp(hue, more.specular_tint) * normal;
                (metallic, dielectric.lerp(base, metallic))
            }
        };

        let sheen = Vec3::ONE.lerp(hue, more.sheen_tint) * (more.sheen * (1.0 - metallic));
        let alpha = (roughness * roughness).max(MIN_ROUGHNESS);
        let mut ggx = Ggx::of(alpha, Facets::GgxUncorrelated);
        if more.anisotropic > 0.0 {
            let aspect = (1.0 - 0.9 * more.anisotropic).sqrt();
            let square = roughness * roughness;
            ggx = ggx.stretched([square / aspect, square * aspect].map(|alpha| alpha.max(MIN_ROUGHNESS)));
        }
        Self { roughness, flatness: more.flatness, sheen, ggx, schlick: (share, colour) }
    }

    /// f, with `base` the albedo over π.
    #[inline]
    pub(super) fn at(&self, wo: Vec3, wi: Vec3, base: Vec3) -> Vec3 {
        let cos_d = wi.dot((wo + wi).normalize()).clamp(0.0, 1.0);
        let (out, into) = (schlick_weight(wo.z), schlick_weight(wi.z));
        // Burley 2015, eq. 4
        let retro = 2.0 * self.roughness * cos_d * cos_d;
        let rough = (1.0 - 0.5 * out) * (1.0 - 0.5 * into);
        let mut diffuse = rough + retro * (out + into + out * into * (retro - 1.0));
        if self.flatness > 0.0 {
            // Burley 2012, §5.3, after Hanrahan and Krueger
            let grazing = 0.5 * retro;
            let side = |weight: f32| 1.0 + (grazing - 1.0) * weight;
            let flat = 1.25 * (side(out) * side(into) * (1.0 / (wo.z + wi.z) - 0.5) + 0.5);
            diffuse += (flat - diffuse) * self.flatness;
        }
        base * diffuse + self.sheen * schlick_weight(cos_d)
    }
}

/// (1 − cos)⁵.
#[inline]
fn schlick_weight(cos: f32) -> f32 {
    let m = (1.0 - cos).clamp(0.0, 1.0);
    m * m * (m * m) * m
}

/// A reflection with long tails: GTR of exponent 1 (Burley 2012, eq. 4), with an index of refraction of 1.5,
/// and masked as facets of α = ¼.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clearcoat {
    weight: f32,
    alpha: f32,
    dialect: Dialect,
    /// Probability of choosing it among the reflections.
    pub(super) share: f32,
}

impl Clearcoat {
    /// That of a surface, if it has any; `beside` is what its microfacets reflect.
    pub(super) fn new(more: &Principled, beside: f32) -> Option<Self> {
        let coat = Self {
            weight: 0.25 * more.clearcoat,
            alpha: 0.1 + (0.001 - 0.1) * more.clearcoat_gloss,
            dialect: more.dialect,
            share: 0.0,
        };
        let share = (coat.power() / (coat.power() + beside)).clamp(0.1, 0.9);
        (more.clearcoat > 0.0).then_some(Self { share, ..coat })
    }

    /// About how much it reflects.
    pub(super) fn power(self) -> f32 {
        0.04 * self.weight
    }

    /// Density of its normals.
    #[inline]
    fn d(self, h: Vec3) -> f32 {
        let a2 = self.alpha * self.alpha;
        // 1 + (α² − 1)cos², precise at h = n
        (1.0 - a2) / (PI * -a2.ln() * (h.x * h.x + h.y * h.y + a2 * h.z * h.z))
    }

    /// f·cos θᵢ, and the density with which it is sampled.
    #[inline]
    pub(super) fn eval(self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let h = (wo + wi).normalize();
        let cos_h = wo.dot(h);
        if wo.z <= 0.0 || cos_h <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let d = self.d(h);
        let masked = |cos: f32| 2.0 * cos / (cos + (0.0625 + 0.9375 * cos * cos).sqrt());
        let mut f = self.weight * d * masked(wo.z) * masked(wi.z) * wi.z;
        if self.dialect == Dialect::Pbrt {
            f /= 4.0 * wo.z * wi.z;
        }
        (schlick(Vec3::splat(0.04), cos_h) * f, d * h.z / (4.0 * cos_h))
    }

    /// A direction that it or the facets beside it reflect; none if that is below the surface.
    #[inline]
    pub(super) fn sample_with(self, wo: Vec3, [u, v]: [f32; 2], beside: Ggx) -> Option<Vec3> {
        let h = if u < self.share {
            let a2 = self.alpha * self.alpha;
            // sin² of what is distributed as d·cos
            let sin2 = ((a2.powf(1.0 - u / self.share) - a2) / (1.0 - a2)).clamp(0.0, 1.0);
            let (sin, cos) = (sin2.sqrt(), (1.0 - sin2).sqrt());
            let (sin_phi, cos_phi) = math::turn(v);
            Vec3::new(sin * cos_phi, sin * sin_phi, cos)
        } else {
            beside.visible_normal(wo, [((u - self.share) / (1.0 - self.share)).min(0.999_999_94), v])
        };
        let cos_h = wo.dot(h);
        let wi = (h * (2.0 * cos_h) - wo).normalize();
        (cos_h > 0.0 && wi.z > 0.0).then_some(wi)
    }
}
