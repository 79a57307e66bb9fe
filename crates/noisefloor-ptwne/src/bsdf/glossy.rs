//! Microfacets, coats and diffuse lobes.

use super::coat::Coat;
use super::fresnel::{Fresnel, fresnel, schlick};
use super::ggx::{Facets, Ggx, MIN_ROUGHNESS};
use super::principled::{Burley, Clearcoat};
use crate::light::Receiver;
use crate::material::{Gloss, Principled};
use crate::math::{self, DELTA, Frame, Vec3};
use std::f32::consts::FRAC_1_PI;

/// Microfacets, what lies below them, and light that shines through, seen from one direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Glossy<'a> {
    ggx: Ggx,
    fresnel: &'a Fresnel,
    /// Colour of the metal, and its weight in the blend.
    metal: Vec3,
    metal_share: f32,
    /// The index of refraction of facets that are no metal, and the factor on their reflection.
    ior: f32,
    specular: Vec3,
    below: Below<'a>,
    /// A second reflection, over all else.
    clearcoat: Option<Clearcoat>,
    /// Of a coat [`Coat::base`], times the transmittance of the outgoing direction; else the albedo over π.
    base: Vec3,
    /// The albedo over π of diffuse transmission.
    through: Vec3,
    /// What is mirrored besides the facets' reflection.
    mirror: Vec3,
    /// Probabilities of choosing a microfacet, transmission, and the mirror.
    pub(super) facet: f32,
    transmission: f32,
    pub(super) mirrored: f32,
    /// Whether the coat is smooth, without microfacets.
    pub(super) smooth: bool,
}

/// What lies below the microfacets.
#[derive(Clone, Copy, Debug)]
enum Below<'a> {
    Nothing,
    Coat(&'a Coat),
    /// A diffuse surface from which the facets take nothing.
    Diffuse(OrenNayar),
    /// The diffuse part of Ashikhmin and Shirley, whose facets it comes with.
    AshikhminShirley,
    /// A Lambertian surface that gets what facets with Schlick's term leave.
    Schlick,
    /// A diffuse surface from which the facets take nothing.
    Burley(Burley),
}

/// The two constants of Oren and Nayar's qualitative model (1994, eq. 30).
#[derive(Clone, Copy, Debug)]
pub(crate) struct OrenNayar {
    a: f32,
    b: f32,
}

impl OrenNayar {
    /// Slopes of a standard deviation of `sigma` radians; 0 is Lambertian.
    pub(crate) fn new(sigma: f32) -> Self {
        let s2 = sigma * sigma;
        Self { a: 1.0 - 0.5 * s2 / (s2 + 0.33), b: 0.45 * s2 / (s2 + 0.09) }
    }

    /// The factor on Lambertian reflection.
    fn at(self, wo: Vec3, wi: Vec3) -> f32 {
        if self.b == 0.0 {
            return self.a;
        }
        // cos(φᵢ − φₒ)·sin α·tan β, where the sines cancel
        let across = (wo.x * wi.x + wo.y * wi.y).max(0.0);
        self.a + self.b * across / wo.z.max(wi.z).max(1e-6)
    }
}

/// [`crate::Lobes`] at one point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LobesAt {
    pub(crate) diffuse: Vec3,
    pub(crate) through: Vec3,
    pub(crate) specular: Vec3,
    pub(crate) mirror: Vec3,
    pub(crate) gloss: Gloss,
    pub(crate) oren_nayar: OrenNayar,
    pub(crate) ggx: Ggx,
}

impl<'a> Glossy<'a> {
    pub(crate) fn metal(fresnel: &'a Fresnel, colour: Vec3, ggx: Ggx) -> Self {
        let zero = Vec3::ZERO;
        Self {
            ggx,
            fresnel,
            metal: colour,
            metal_share: 1.0,
            ior: 1.0,
            specular: zero,
            below: Below::Nothing,
            clearcoat: None,
            base: zero,
            through: zero,
            mirror: zero,
            facet: 1.0,
            transmission: 0.0,
            mirrored: 0.0,
            smooth: false,
        }
    }

    /// Facets to start from that are no metal.
    fn no_metal(ggx: Ggx) -> Self {
        Self { metal_share: 0.0, ..Self::metal(&Fresnel::None, Vec3::ZERO, ggx) }
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
        let passed = coat.transmittance(alpha, cos);
        let (reflected, inside) =
            ((1.0 - passed) * math::luminance(specular), passed * math::luminance(diffuse));
        Self {
            ior: coat.ior,
            specular,
            below: Below::Coat(coat),
            base: coat.base(alpha, diffuse, nonlinear) * passed,
            facet: lobe_probability(reflected, inside),
            smooth: alpha < MIN_ROUGHNESS,
            ..Self::no_metal(ggx)
        }
    }

    /// glTF 2.0, appendix B.3.
    pub(crate) fn gltf(base: Vec3, alpha: f32, metallic: f32, dielectric: f32, cos: f32) -> Self {
        let f0 = Vec3::splat(dielectric).lerp(base, metallic);
        let diffuse = base * (1.0 - metallic);
        let reflected = schlick(f0, cos);
        let below = diffuse * (Vec3::ONE - reflected);
        Self {
            specular: f0,
            below: Below::Schlick,
            base: diffuse * FRAC_1_PI,
            facet: lobe_probability(math::luminance(reflected), math::luminance(below)),
            ..Self::no_metal(Ggx::of(alpha, Facets::GgxUncorrelated))
        }
    }

    /// Burley's surface with its roughness, whose square is α, and the share of metal.
    pub(crate) fn principled(
        more: &Principled,
        base: Vec3,
        [roughness, metallic]: [f32; 2],
        cos: f32,
    ) -> Self {
        let burley = Burley::new(more, base, roughness, metallic);
        let (share, colour) = burley.schlick;
        let specular = Vec3::splat(1.0 - share);
        let reflected =
            share * math::luminance(schlick(colour, cos)) + (1.0 - share) * fresnel(cos, more.ior).0;
        let clearcoat = Clearcoat::new(more, reflected);
        let diffuse = base * (1.0 - metallic);
        let below = math::luminance(diffuse) + math::luminance(burley.sheen);
        Self {
            metal: colour,
            metal_share: share,
            ior: more.ior,
            specular,
            below: Below::Burley(burley),
            clearcoat,
            base: diffuse * FRAC_1_PI,
            facet: lobe_probability(reflected + clearcoat.map_or(0.0, Clearcoat::power), below),
            ..Self::metal(&Fresnel::Schlick, colour, burley.ggx)
        }
    }

    pub(crate) fn lobes(lobes: LobesAt, cos: f32) -> Self {
        let LobesAt { diffuse, through, specular, mirror, gloss, oren_nayar, ggx } = lobes;
        let (ior, below, reflected, mirror) = match gloss {
            Gloss::Dielectric { ior } => {
                let (share, _) = fresnel(cos.clamp(0.0, 1.0), ior);
                (ior, Below::Diffuse(oren_nayar), specular * share, mirror * share)
            }
            Gloss::AshikhminShirley => (1.0, Below::AshikhminShirley, schlick(specular, cos), Vec3::ZERO),
        };
        let [facets, over, under, flat] = [reflected, diffuse, through, mirror].map(math::luminance);
        let mirrored = lobe_probability(flat, facets + over + under);
        let facet = (1.0 - mirrored) * lobe_probability(facets, over + under);
        let transmission = (1.0 - mirrored - facet) * lobe_probability(under, over);
        Self {
            ior,
            specular,
            below,
            base: diffuse * FRAC_1_PI,
            through: through * FRAC_1_PI,
            mirror,
            facet,
            transmission,
            mirrored,
            ..Self::no_metal(ggx)
        }
    }

    /// The Fresnel terms of metal and coat at a half vector of cosine `cos_h`.
    #[inline]
    fn reflectance(&self, cos_h: f32) -> Vec3 {
        let mut sum = Vec3::ZERO;
        if self.metal_share > 0.0 {
            sum += self.metal_share * self.fresnel.at(self.metal, cos_h);
        }
        match self.below {
            Below::Nothing => {}
            Below::Coat(_) | Below::Diffuse(_) | Below::Burley(_) => {
                sum += self.specular * fresnel(cos_h, self.ior).0;
            }
            Below::AshikhminShirley | Below::Schlick => sum += schlick(self.specular, cos_h),
        }
        sum
    }

    /// f·cos θᵢ of the microfacets, and the density with which they are sampled. A smooth coat has none.
    #[inline]
    pub(crate) fn facets(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if self.smooth || wi.z <= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let (mut facets, density, cos_h) = self.ggx.eval(wo, wi);
        if matches!(self.below, Below::AshikhminShirley) {
            // Ashikhmin, Shirley 2000, eq. 4 with GGX
            facets = self.unmasked(wo, wi, cos_h) * density;
        }
        let f = self.reflectance(cos_h) * facets;
        match &self.clearcoat {
            None => (f, density),
            Some(coat) => {
                let (more, coat_density) = coat.eval(wo, wi);
                (f + more, density + (coat_density - density) * coat.share)
            }
        }
    }

    /// f·cos θᵢ of Ashikhmin's and Shirley's facets without the Fresnel term, over the density with which they
    /// are sampled.
    #[inline]
    fn unmasked(&self, wo: Vec3, wi: Vec3, cos_h: f32) -> f32 {
        wo.z * wi.z * (1.0 + self.ggx.lambda(wo)) / (cos_h * wo.z.max(wi.z)).max(1e-6)
    }

    /// Whether there is a base below the microfacets.
    pub(crate) fn has_base(&self) -> bool {
        let sheen = matches!(self.below, Below::Burley(burley) if burley.sheen != Vec3::ZERO);
        self.base != Vec3::ZERO || sheen
    }

    pub(crate) fn transmits(&self) -> bool {
        self.through != Vec3::ZERO
    }

    /// f·cos θᵢ of the base below the microfacets.
    #[inline]
    pub(crate) fn base(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        if wi.z <= 0.0 {
            return Vec3::ZERO;
        }
        match self.below {
            Below::Nothing => Vec3::ZERO,
            Below::Coat(coat) => self.base * (coat.transmittance(self.ggx.alpha, wi.z) * wi.z),
            Below::Diffuse(oren_nayar) => self.base * (oren_nayar.at(wo, wi) * wi.z),
            Below::Schlick => {
                let cos_h = wo.dot((wo + wi).normalize()).max(0.0);
                self.base * (Vec3::ONE - schlick(self.specular, cos_h)) * wi.z
            }
            Below::Burley(burley) => burley.at(wo, wi, self.base) * wi.z,
            Below::AshikhminShirley => {
                // Ashikhmin, Shirley 2000, eq. 5
                let part = |cos: f32| 1.0 - (1.0 - 0.5 * cos).powi(5);
                let factor = 28.0 / 23.0 * part(wo.z) * part(wi.z) * wi.z;
                self.base * (Vec3::ONE - self.specular) * factor
            }
        }
    }

    /// The factor on light from the mirrored direction, besides what facets reflect; none if that is black.
    pub(crate) fn mirror(&self) -> Option<Vec3> {
        (self.mirror != Vec3::ZERO).then_some(self.mirror)
    }

    /// f·|cos θᵢ| of transmission in a direction of the far side.
    #[inline]
    pub(crate) fn through(&self, wi: Vec3) -> Vec3 {
        self.through * (-wi.z).max(0.0)
    }

    /// How a light's choice sees it, with the direction `wo` to where it is seen from.
    #[inline]
    pub(crate) fn receiver(&self, position: Vec3, normal: Vec3, wo: Vec3, frame: Frame) -> Receiver {
        // Transmittance hardly depends on the direction, but close to the horizon
        let diffuse = match self.below {
            Below::Coat(coat) => math::luminance(self.base) * coat.transmittance(self.ggx.alpha, 0.7),
            Below::Diffuse(_) | Below::AshikhminShirley | Below::Schlick | Below::Burley(_) => {
                math::luminance(self.base)
            }
            Below::Nothing => 0.0,
        };
        let glossy = if self.smooth { 0.0 } else { math::luminance(self.reflectance(wo.z)) / wo.z.max(0.1) };
        let mirror = frame.to_world(Vec3::new(-wo.x, -wo.y, wo.z));
        Receiver::new(position, normal, diffuse, glossy, mirror, self.ggx.alpha * self.ggx.alpha)
    }

    /// f·|cos θᵢ|, and the density of [`Glossy::sample`].
    #[inline]
    pub(crate) fn eval(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        if wi.z < 0.0 {
            return (self.through(wi), self.transmission * FRAC_1_PI * -wi.z);
        }
        let (f, density) = self.facets(wo, wi);
        let diffuse = 1.0 - self.facet - self.transmission - self.mirrored;
        (f + self.base(wo, wi), self.facet * density + diffuse * FRAC_1_PI * wi.z)
    }

    /// A direction of reflection by microfacets or a smooth coat, its weight f·cos θᵢ / density, and its
    /// density.
    #[inline]
    pub(crate) fn reflect(&self, wo: Vec3, u: [f32; 2]) -> Option<(Vec3, Vec3, f32)> {
        if self.smooth {
            return Some((Vec3::new(-wo.x, -wo.y, wo.z), self.reflectance(wo.z), DELTA));
        }
        if let Some(coat) = &self.clearcoat {
            let wi = coat.sample_with(wo, u, self.ggx)?;
            let (f, density) = self.facets(wo, wi);
            return (density > 0.0).then(|| (wi, f / density, density));
        }
        let (wi, weight, cos_h) = self.ggx.sample(wo, u);
        if weight <= 0.0 {
            return None;
        }
        let (_, density, _) = self.ggx.eval(wo, wi);
        let ashikhmin = matches!(self.below, Below::AshikhminShirley);
        let weight = if ashikhmin { self.unmasked(wo, wi, cos_h) } else { weight };
        Some((wi, self.reflectance(cos_h) * weight, density))
    }

    /// A direction, its weight f·cos θᵢ / density, and its density; `None` if nothing is scattered.
    #[inline]
    pub(crate) fn sample(&self, wo: Vec3, [pick, u, v]: [f32; 3]) -> Option<(Vec3, Vec3, f32)> {
        if pick >= 1.0 - self.mirrored {
            return Some((Vec3::new(-wo.x, -wo.y, wo.z), self.mirror / self.mirrored, DELTA));
        }
        let wi = if pick < self.facet {
            let (wi, weight, density) = self.reflect(wo, [u, v])?;
            if matches!(self.below, Below::Nothing) || density == DELTA {
                return Some((wi, weight / self.facet, density));
            }
            wi
        } else {
            let wi = math::cosine_hemisphere([u, v]);
            let crosses = pick < self.facet + self.transmission;
            if crosses { Vec3::new(wi.x, wi.y, -wi.z) } else { wi }
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
