//! Microfacets and coats, as one lobe or two.

use super::coat::Coat;
use super::fresnel::{Fresnel, fresnel, schlick};
use super::ggx::{Ggx, MIN_ROUGHNESS};
use crate::light::Receiver;
use crate::math::{self, DELTA, Frame, Vec3};
use std::f32::consts::FRAC_1_PI;

/// Microfacets of a metal or a coat, and the diffuse base below the coat, seen from one direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Glossy<'a> {
    ggx: Ggx,
    fresnel: &'a Fresnel,
    /// Colour of the metal, and its weight in the blend.
    metal: Vec3,
    metal_share: f32,
    /// The coat, and the factor on its reflection.
    coat: Option<&'a Coat>,
    specular: Vec3,
    /// [`Coat::base`], times the transmittance of the outgoing direction.
    base: Vec3,
    /// Probability of choosing a microfacet.
    pub(super) facet: f32,
    /// Whether the coat is smooth, without microfacets.
    pub(super) smooth: bool,
}

impl<'a> Glossy<'a> {
    pub(crate) fn metal(fresnel: &'a Fresnel, colour: Vec3, ggx: Ggx) -> Self {
        let (coat, zero) = (None, Vec3::ZERO);
        Self {
            ggx,
            fresnel,
            metal: colour,
            metal_share: 1.0,
            coat,
            specular: zero,
            base: zero,
            facet: 1.0,
            smooth: false,
        }
    }

    pub(crate) fn plastic(
        coat: &'a Coat,
        diffuse: Vec3,
        specular: Vec3,
        ggx: Ggx,
        nonlinear: bool,
        cos: f32,
    ) -> Self {
        let alpha = ggx.alpha;
        let through = coat.transmittance(alpha, cos);
        let (reflected, inside) =
            ((1.0 - through) * math::luminance(specular), through * math::luminance(diffuse));
        Self {
            ggx,
            fresnel: &Fresnel::None,
            metal: Vec3::ZERO,
            metal_share: 0.0,
            coat: Some(coat),
            specular,
            base: coat.base(alpha, diffuse, nonlinear) * through,
            facet: lobe_probability(reflected, inside),
            smooth: alpha < MIN_ROUGHNESS,
        }
    }

    pub(crate) fn blend(coat: &'a Coat, base: Vec3, alpha: f32, metallic: f32, cos: f32) -> Self {
        let plastic = Self::plastic(coat, base, Vec3::ONE, Ggx::new(alpha), true, cos);
        let through = coat.transmittance(alpha, cos);
        let reflected = metallic * math::luminance(schlick(base, cos)) + (1.0 - metallic) * (1.0 - through);
        Self {
            fresnel: &Fresnel::Schlick,
            metal: base,
            metal_share: metallic,
            specular: Vec3::splat(1.0 - metallic),
            base: plastic.base * (1.0 - metallic),
            facet: lobe_probability(reflected, (1.0 - metallic) * through * math::luminance(base)),
            ..plastic
        }
    }

    /// The Fresnel terms of metal and coat at a half vector of cosine `cos_h`.
    #[inline]
    fn reflectance(&self, cos_h: f32) -> Vec3 {
        let mut sum = Vec3::ZERO;
        if self.metal_share > 0.0 {
            sum += self.metal_share * self.fresnel.at(self.metal, cos_h);
        }
        if let Some(coat) = self.coat {
            sum += self.specular * fresnel(cos_h, coat.ior).0;
        }
        sum
    }

    /// f·cos θᵢ of the microfacets, and the density with which they are sampled. A smooth coat has none.
    #[inline]
    pub(crate) fn facets(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if self.smooth || wi.z <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let (facets, density, cos_h) = self.ggx.eval(wo, wi);
        (self.reflectance(cos_h) * facets, density)
    }

    /// Whether there is a base below a coat.
    pub(crate) fn has_base(&self) -> bool {
        self.base != Vec3::ZERO
    }

    /// f·cos θᵢ of the base below the coat.
    #[inline]
    pub(crate) fn base(&self, wi: Vec3) -> Vec3 {
        match self.coat {
            Some(coat) if wi.z > 0.0 => self.base * (coat.transmittance(self.ggx.alpha, wi.z) * wi.z),
            _ => Vec3::ZERO,
        }
    }

    /// How a light's choice sees it, with the direction `wo` to where it is seen from.
    #[inline]
    pub(crate) fn receiver(&self, position: Vec3, normal: Vec3, wo: Vec3, frame: Frame) -> Receiver {
        // Transmittance hardly depends on the direction, but close to the horizon
        let diffuse = match self.coat {
            Some(coat) => math::luminance(self.base) * coat.transmittance(self.ggx.alpha, 0.7),
            None => 0.0,
        };
        let glossy = if self.smooth { 0.0 } else { math::luminance(self.reflectance(wo.z)) / wo.z.max(0.1) };
        let mirror = frame.to_world(Vec3::new(-wo.x, -wo.y, wo.z));
        Receiver { position, normal, diffuse, glossy, mirror, alpha2: self.ggx.alpha * self.ggx.alpha }
    }

    /// f·cos θᵢ, and the density of [`Glossy::sample`].
    #[inline]
    pub(crate) fn eval(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let (f, density) = self.facets(wo, wi);
        (f + self.base(wi), self.facet * density + (1.0 - self.facet) * FRAC_1_PI * wi.z.max(0.0))
    }

    /// A direction of reflection by microfacets or a smooth coat, its weight f·cos θᵢ / density, and its
    /// density.
    #[inline]
    pub(crate) fn reflect(&self, wo: Vec3, u: [f32; 2]) -> Option<(Vec3, Vec3, f32)> {
        if self.smooth {
            return Some((Vec3::new(-wo.x, -wo.y, wo.z), self.reflectance(wo.z), DELTA));
        }
        let (wi, weight, cos_h) = self.ggx.sample(wo, u);
        let (_, density, _) = self.ggx.eval(wo, wi);
        (weight > 0.0).then(|| (wi, self.reflectance(cos_h) * weight, density))
    }

    /// A direction, its weight f·cos θᵢ / density, and its density; `None` if nothing is scattered.
    #[inline]
    pub(crate) fn sample(&self, wo: Vec3, [pick, u, v]: [f32; 3]) -> Option<(Vec3, Vec3, f32)> {
        let wi = if pick < self.facet {
            let (wi, weight, density) = self.reflect(wo, [u, v])?;
            if self.coat.is_none() || density == DELTA {
                return Some((wi, weight / self.facet, density));
            }
            wi
        } else {
            math::cosine_hemisphere([u, v])
        };
        let (f, pdf) = self.eval(wo, wi);
        // Also false for NaN
        (pdf > 0.0).then(|| (wi, f / pdf, pdf))
    }
}

/// Probability of choosing the first of two lobes, by how much each reflects; neither is starved.
#[inline]
fn lobe_probability(first: f32, second: f32) -> f32 {
    if second <= 0.0 {
        1.0
    } else if first <= 0.0 {
        0.0
    } else {
        (first / (first + second)).clamp(0.1, 0.9)
    }
}
