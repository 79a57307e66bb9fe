//! Dielectric coats over a diffuse base: how much light they let through, in tables.

use super::fresnel::{fresnel, refract};
use super::ggx::{Facets, Ggx, MIN_ROUGHNESS};
use crate::math::Vec3;
use std::f32::consts::FRAC_1_PI;
use std::sync::Arc;

/// A smooth or rough dielectric boundary over a base: how much light it lets through, tabulated per material.
#[derive(Clone, Debug)]
pub(crate) struct Coat {
    pub(crate) ior: f32,
    /// α; `None` if it varies.
    alpha: Option<f32>,
    facets: Facets,
    interior: Interior,
    rows: Vec<Row>,
}

/// What happens to light that a rough coat reflects back onto its base.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Interior {
    /// All light that does not get out returns to the base. By reciprocity that is 1 − T̄/η² of diffuse
    /// light, with T̄ = 2∫T(μ)μ dμ. A white base loses no energy.
    Conserving,
    /// Facets transmit or reflect it once, and what they mask is lost: as Mitsuba computes it.
    SingleScattering,
}

/// Transmittance at one roughness.
#[derive(Clone, Debug)]
struct Row {
    /// Share of the light from one direction that gets in, at cosines of (i/[`STEPS`])².
    at: [f32; STEPS + 1],
    /// Share of diffuse light from inside that is reflected back in.
    inside: f32,
}

/// Steps of the tables in the cosine, and in α where it varies. Squares of even steps are dense where T
/// bends: at grazing angles, and where a smooth coat becomes rough. Linear interpolation is then accurate to
/// 1e-3 in the cosine, and to 2e-3 in α up to 85°.
const STEPS: usize = 64;
const ALPHAS: usize = 24;

impl Coat {
    /// A coat with index of refraction `ior` and roughness `alpha`, or any roughness if that is `None`.
    pub(crate) fn new(ior: f32, alpha: Option<f32>, facets: Facets, interior: Interior) -> Self {
        let row = |alpha: f32| Row::new(ior, Ggx::of(alpha, facets), interior);
        let rows = match alpha {
            Some(alpha) => vec![row(alpha)],
            None => (0..=ALPHAS).map(|i| row((i as f32 / ALPHAS as f32).powi(2))).collect(),
        };
        Self { ior, alpha, facets, interior, rows }
    }

    /// Whether [`Coat::new`] would make the same coat.
    fn is_for(&self, ior: f32, alpha: Option<f32>, facets: Facets, interior: Interior) -> bool {
        (self.ior, self.alpha, self.facets, self.interior) == (ior, alpha, facets, interior)
    }

    /// The coat among `coats` that is for these values; it is added if there is none.
    pub(crate) fn shared(
        coats: &mut Vec<Arc<Self>>,
        ior: f32,
        alpha: Option<f32>,
        facets: Facets,
        interior: Interior,
    ) -> Arc<Self> {
        if let Some(coat) = coats.iter().find(|c| c.is_for(ior, alpha, facets, interior)) {
            return coat.clone();
        }
        let coat = Arc::new(Self::new(ior, alpha, facets, interior));
        coats.push(coat.clone());
        coat
    }

    /// Interpolates a value of the rows at `alpha`.
    #[inline]
    fn blend(&self, alpha: f32, of: impl Fn(&Row) -> f32) -> f32 {
        match self.rows.as_slice() {
            [only] => of(only),
            rows => {
                let x = alpha.clamp(0.0, 1.0).sqrt() * ALPHAS as f32;
                let i = (x as usize).min(ALPHAS - 1);
                let (low, high) = (of(&rows[i]), of(&rows[i + 1]));
                low + (high - low) * (x - i as f32)
            }
        }
    }

    /// Share of the light from a direction of cosine `cos` that gets in.
    #[inline]
    pub(crate) fn transmittance(&self, alpha: f32, cos: f32) -> f32 {
        let x = cos.clamp(0.0, 1.0).sqrt() * STEPS as f32;
        let i = (x as usize).min(STEPS - 1);
        self.blend(alpha, |row| row.at[i] + (row.at[i + 1] - row.at[i]) * (x - i as f32))
    }

    /// The factor of f·cos θᵢ that both transmittances and the cosine of the incoming direction do not give:
    /// the base's albedo/π, refraction, and all reflections between base and coat.
    #[inline]
    pub(crate) fn base(&self, alpha: f32, albedo: Vec3, nonlinear: bool) -> Vec3 {
        let inside = self.blend(alpha, |row| row.inside);
        let bounces = if nonlinear { albedo } else { Vec3::ONE };
        albedo * FRAC_1_PI / (self.ior * self.ior * (Vec3::ONE - bounces * inside))
    }
}

impl Row {
    fn new(ior: f32, ggx: Ggx, interior: Interior) -> Self {
        let at: [f32; STEPS + 1] = std::array::from_fn(|i| {
            let cos = (i as f32 / STEPS as f32).powi(2);
            match interior {
                Interior::Conserving => 1.0 - reflectance(ior, ggx, cos),
                Interior::SingleScattering => single_scattering(ior, ggx, cos)[1],
            }
        });
        let inside = match interior {
            Interior::Conserving => {
                1.0 - mean(|s| f64::from(at[(s * STEPS as f64).round() as usize])) / f64::from(ior * ior)
            }
            // Mitsuba's mean of 64 cosines from 0 to 1, both ends in full, which comes out a 64th too low
            Interior::SingleScattering => {
                let cosines = (0..64).map(|i| i as f32 / 63.0);
                cosines.map(|c| f64::from(2.0 * c * single_scattering(1.0 / ior, ggx, c)[0])).sum::<f64>()
                    / 64.0
            }
        };
        Self { at, inside: inside as f32 }
    }
}

/// 2∫f(μ)μ dμ with μ = s², by Simpson's rule over [`STEPS`] steps in s.
fn mean(f: impl Fn(f64) -> f64) -> f64 {
    let weight = |i: usize| match i {
        0 | STEPS => 1.0,
        i if i % 2 == 1 => 4.0,
        _ => 2.0,
    };
    let at = |i: usize| i as f64 / STEPS as f64;
    (0..=STEPS).map(|i| weight(i) * f(at(i)) * 4.0 * at(i).powi(3)).sum::<f64>() / (3.0 * STEPS as f64)
}

/// Share of the light from a direction that microfacets reflect: the mean of F·G₂/G₁ over visible normals.
fn reflectance(eta: f32, ggx: Ggx, cos: f32) -> f32 {
    if ggx.alpha < MIN_ROUGHNESS {
        return fresnel(cos, eta).0;
    }
    let [reflected] = over_facets(cos, |wo, u| {
        let (_, weight, cos_h) = ggx.sample(wo, u);
        [weight * fresnel(cos_h, eta).0]
    });
    reflected
}

/// Shares of the light from a direction that a rough boundary reflects and transmits in a single scattering
/// event, masked by [`Ggx::lambda`] of the new direction only (Walter et al. 2007, §5): the means of F·G₁ and
/// (1 − F)·G₁ over visible normals.
fn single_scattering(eta: f32, ggx: Ggx, cos: f32) -> [f32; 2] {
    over_facets(cos, |wo, u| {
        let h = ggx.visible_normal(wo, u);
        let cos_h = wo.dot(h);
        let (reflectance, cos_t) = fresnel(cos_h.clamp(0.0, 1.0), eta);
        let mirrored = h * (2.0 * cos_h) - wo;
        let refracted = refract(-wo, h, cos_h, cos_t, eta);
        let kept = |leaves: bool, w: Vec3| if leaves { 1.0 / (1.0 + ggx.lambda(w)) } else { 0.0 };
        [
            reflectance * kept(mirrored.z > 0.0, mirrored),
            (1.0 - reflectance) * kept(refracted.z < 0.0, refracted),
        ]
    })
}

/// The mean of `f` over a grid of the numbers that choose a facet.
fn over_facets<const N: usize>(cos: f32, f: impl Fn(Vec3, [f32; 2]) -> [f32; N]) -> [f32; N] {
    const SIDE: u32 = 24;
    let cos = cos.max(1e-3);
    let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    let point = |i: u32| (i as f32 + 0.5) / SIDE as f32;
    let mut sums = [0.0; N];
    for i in 0..SIDE * SIDE {
        for (sum, value) in sums.iter_mut().zip(f(wo, [point(i % SIDE), point(i / SIDE)])) {
            *sum += f64::from(value);
        }
    }
    sums.map(|sum| (sum / f64::from(SIDE * SIDE)) as f32)
}
