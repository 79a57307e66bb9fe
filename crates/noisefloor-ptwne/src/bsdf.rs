//! How surfaces scatter. Directions are local, the normal is +z, and both point away from the surface.

use crate::math::{self, Vec3};
use std::f32::consts::FRAC_1_PI;

/// Stands for the density of a direction that could not have been chosen otherwise: mirrors, glass, camera rays.
pub(crate) const DELTA: f32 = f32::INFINITY;

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

/// Reflectance of a conductor with index of refraction η + ik, unpolarised, at `cos` ≥ 0 (Born, Wolf 1999, §14.2, in the
/// form without complex numbers).
#[inline]
pub(crate) fn fresnel_complex(eta: Vec3, k: Vec3, cos: f32) -> Vec3 {
    let (cos2, sin2) = (cos * cos, (1.0 - cos * cos).max(0.0));
    let t = eta * eta - k * k - Vec3::splat(sin2);
    // a² + b² and a, of √((η + ik)² − sin²) = a + ib
    let sum = (t * t + 4.0 * eta * eta * k * k).map(f32::sqrt);
    let a = (0.5 * (sum + t)).max(Vec3::ZERO).map(f32::sqrt);
    let (x, y) = (sum + Vec3::splat(cos2), 2.0 * cos * a);
    let perpendicular = (x - y) / (x + y);
    let (x, y) = (cos2 * sum + Vec3::splat(sin2 * sin2), y * sin2);
    0.5 * perpendicular * (Vec3::ONE + (x - y) / (x + y))
}

/// The Fresnel term of what reflects without letting light in.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Fresnel {
    /// One: a perfect mirror.
    None,
    /// Schlick's, with the colour at normal incidence.
    Schlick,
    /// Of a conductor; the colour is a factor.
    Complex { eta: Vec3, k: Vec3 },
}

impl Fresnel {
    #[inline]
    pub(crate) fn at(&self, colour: Vec3, cos: f32) -> Vec3 {
        match *self {
            Self::None => colour,
            Self::Schlick => schlick(colour, cos),
            Self::Complex { eta, k } => colour * fresnel_complex(eta, k, cos),
        }
    }
}

/// Reflectance and transmittance of a thin pane: all reflections between its boundaries summed. They add up to one.
#[inline]
pub(crate) fn pane(cos: f32, eta: f32) -> f32 {
    let (r, _) = fresnel(cos, eta);
    // r + t²r + t²r³ + … with t = 1 − r
    2.0 * r / (1.0 + r)
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

    /// A normal from the distribution of those that `wo` sees (Dupuy, Benyoub 2023).
    #[inline]
    fn visible_normal(self, wo: Vec3, u: [f32; 2]) -> Vec3 {
        // Stretch, take a normal of the hemisphere as the sum of wo and a point of a spherical cap, and stretch back
        let stretched = Vec3::new(wo.x * self.alpha, wo.y * self.alpha, wo.z).normalize();
        let z = (1.0 - u[0]) * (1.0 + stretched.z) - stretched.z;
        let r = (1.0 - z * z).max(0.0).sqrt();
        let (sin, cos) = math::turn(u[1]);
        let c = Vec3::new(r * cos, r * sin, z) + stretched;
        Vec3::new(c.x * self.alpha, c.y * self.alpha, c.z.max(1e-7)).normalize()
    }

    /// A direction of reflection from the distribution of visible normals (Dupuy, Benyoub 2023), and its weight
    /// f·cos θᵢ / density = G₂/G₁ without the Fresnel term, and the half vector's cosine. Weight 0: nothing is reflected.
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

/// A rough or smooth dielectric boundary over a base: how much light it lets through, tabulated once a material.
#[derive(Clone, Debug)]
pub(crate) struct Coat {
    pub(crate) ior: f32,
    /// GGX α; none if it varies.
    alpha: Option<f32>,
    inside: Inside,
    rows: Vec<Row>,
}

/// What becomes of light that a rough coat reflects back onto its base.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Inside {
    /// All that does not get out comes back. By reciprocity that is 1 − T̄/η² of diffuse light, T̄ = 2∫T(μ)μ dμ: a white base
    /// loses nothing.
    Kept,
    /// Facets let it in, reflect it and let it out once each, and what they mask is lost.
    Once,
}

/// Transmittance for one roughness.
#[derive(Clone, Debug)]
struct Row {
    /// Share of light from one direction that gets in: at cosines of (i/[`STEPS`])².
    at: [f32; STEPS + 1],
    /// Share of diffuse light from inside that is reflected back.
    inside: f32,
}

/// Steps of the tables in the cosine, and in α where it varies. Squares of even steps are dense where T bends, at grazing
/// angles and where a smooth coat turns rough: linear interpolation is then good to 1e-3, between two α to 2e-3 up to 85°.
const STEPS: usize = 64;
const ALPHAS: usize = 24;

impl Coat {
    /// A coat of index `ior`, of roughness `alpha`, or of any if that is `None`.
    pub(crate) fn new(ior: f32, alpha: Option<f32>, inside: Inside) -> Self {
        let rows = match alpha {
            Some(alpha) => vec![Row::new(ior, alpha, inside)],
            None => (0..=ALPHAS).map(|i| Row::new(ior, (i as f32 / ALPHAS as f32).powi(2), inside)).collect(),
        };
        Self { ior, alpha, inside, rows }
    }

    /// Whether this is what [`Coat::new`] would make.
    pub(crate) fn is_for(&self, ior: f32, alpha: Option<f32>, inside: Inside) -> bool {
        (self.ior, self.alpha, self.inside) == (ior, alpha, inside)
    }

    /// Blends what `of` says of the two rows around `alpha`.
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

    /// What the base's albedo, times the transmittances of both directions and the cosine of the incoming one, is to be
    /// multiplied by: 1/π, refraction, and all reflections between base and coat.
    #[inline]
    pub(crate) fn base(&self, alpha: f32, albedo: Vec3, nonlinear: bool) -> Vec3 {
        let inside = self.blend(alpha, |row| row.inside);
        let bounces = if nonlinear { albedo } else { Vec3::ONE };
        albedo * FRAC_1_PI / (self.ior * self.ior * (Vec3::ONE - bounces * inside))
    }
}

impl Row {
    fn new(ior: f32, alpha: f32, inside: Inside) -> Self {
        let at: [f32; STEPS + 1] = std::array::from_fn(|i| {
            let cos = (i as f32 / STEPS as f32).powi(2);
            match inside {
                Inside::Kept => 1.0 - reflectance(ior, alpha, cos),
                Inside::Once => once(ior, alpha, cos)[1],
            }
        });
        let inside = match inside {
            Inside::Kept => {
                1.0 - mean(|s| f64::from(at[(s * STEPS as f64).round() as usize])) / f64::from(ior * ior)
            }
            Inside::Once => mean(|s| f64::from(once(1.0 / ior, alpha, (s * s) as f32)[0])),
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

/// Share of the light from a direction that a boundary reflects by microfacets: the mean of F·G₂/G₁ over visible normals.
fn reflectance(eta: f32, alpha: f32, cos: f32) -> f32 {
    if alpha < crate::MIN_ROUGHNESS {
        return fresnel(cos, eta).0;
    }
    let [reflected] = over_facets(alpha, cos, |ggx, wo, u| {
        let (_, weight, cos_h) = ggx.sample(wo, u);
        [weight * fresnel(cos_h, eta).0]
    });
    reflected
}

/// Shares of the light from a direction that a rough boundary reflects and lets through, once, with masking by [`Ggx::lambda`] of
/// the new direction alone (Walter et al. 2007, §5): the means of F·G₁ and (1 − F)·G₁ over visible normals.
fn once(eta: f32, alpha: f32, cos: f32) -> [f32; 2] {
    over_facets(alpha, cos, |ggx, wo, u| {
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

/// The mean of `f` over a grid of numbers by which facets are chosen.
fn over_facets<const N: usize>(
    alpha: f32,
    cos: f32,
    f: impl Fn(Ggx, Vec3, [f32; 2]) -> [f32; N],
) -> [f32; N] {
    const SIDE: u32 = 24;
    let cos = cos.max(1e-3);
    let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    let point = |i: u32| (i as f32 + 0.5) / SIDE as f32;
    let mut sums = [0.0; N];
    for i in 0..SIDE * SIDE {
        for (sum, value) in sums.iter_mut().zip(f(Ggx { alpha }, wo, [point(i % SIDE), point(i / SIDE)])) {
            *sum += f64::from(value);
        }
    }
    sums.map(|sum| (sum / f64::from(SIDE * SIDE)) as f32)
}

/// Microfacets, of metal or of a coat, and a diffuse base below a coat, seen from one direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Glossy<'a> {
    ggx: Ggx,
    fresnel: &'a Fresnel,
    /// Colour of the metal, and its share.
    metal: Vec3,
    metal_share: f32,
    /// The coat, and the factor on its reflection.
    coat: Option<&'a Coat>,
    specular: Vec3,
    /// What [`Coat::base`] says, times the transmittance of the outgoing direction.
    base: Vec3,
    /// Probability of choosing a microfacet.
    facet: f32,
    /// Whether the coat is too smooth for microfacets.
    smooth: bool,
}

impl<'a> Glossy<'a> {
    pub(crate) fn metal(fresnel: &'a Fresnel, colour: Vec3, alpha: f32) -> Self {
        let ggx = Ggx { alpha };
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
        alpha: f32,
        nonlinear: bool,
        cos: f32,
    ) -> Self {
        let through = coat.transmittance(alpha, cos);
        let (reflected, inside) =
            ((1.0 - through) * math::luminance(specular), through * math::luminance(diffuse));
        Self {
            ggx: Ggx { alpha },
            fresnel: &Fresnel::None,
            metal: Vec3::ZERO,
            metal_share: 0.0,
            coat: Some(coat),
            specular,
            base: coat.base(alpha, diffuse, nonlinear) * through,
            facet: share(reflected, inside),
            smooth: alpha < crate::MIN_ROUGHNESS,
        }
    }

    pub(crate) fn blend(coat: &'a Coat, base: Vec3, alpha: f32, metallic: f32, cos: f32) -> Self {
        let plastic = Self::plastic(coat, base, Vec3::ONE, alpha, true, cos);
        let through = coat.transmittance(alpha, cos);
        let reflected = metallic * math::luminance(schlick(base, cos)) + (1.0 - metallic) * (1.0 - through);
        Self {
            fresnel: &Fresnel::Schlick,
            metal: base,
            metal_share: metallic,
            specular: Vec3::splat(1.0 - metallic),
            base: plastic.base * (1.0 - metallic),
            facet: share(reflected, (1.0 - metallic) * through * math::luminance(base)),
            ..plastic
        }
    }

    /// Fresnel terms of all microfacets at a half vector of cosine `cos_h`.
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

    /// f·cos θᵢ of the microfacets, and their density. A smooth coat has none.
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

    /// f·cos θᵢ, and the density of [`Glossy::sample`].
    #[inline]
    pub(crate) fn eval(&self, wo: Vec3, wi: Vec3) -> (Vec3, f32) {
        let (f, density) = self.facets(wo, wi);
        (f + self.base(wi), self.facet * density + (1.0 - self.facet) * FRAC_1_PI * wi.z.max(0.0))
    }

    /// A direction of reflection by microfacets or a smooth coat, its weight f·cos θᵢ / density, and its density.
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

/// Probability of choosing the first of two lobes that reflect so much; neither is starved.
#[inline]
fn share(first: f32, second: f32) -> f32 {
    if second <= 0.0 {
        1.0
    } else if first <= 0.0 {
        0.0
    } else {
        (first / (first + second)).clamp(0.1, 0.9)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::{Cover, Looks, Material};
    use crate::rng::{Key, Rng};
    use crate::scene::{NO, Surface};
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

    /// Metals, coats and blends of them, from smooth to rough.
    fn zoo() -> Vec<(Material, Looks)> {
        let colour = [0.9, 0.5, 0.2];
        let mut all = vec![];
        for roughness in [0.1, 0.3, 1.0] {
            all.push(Material::RoughConductor { reflectance: colour.into(), roughness });
            all.push(Material::Conductor {
                eta: [0.2, 0.9, 1.2],
                k: [3.9, 2.4, 1.8],
                reflectance: [1.0; 3].into(),
                roughness,
            });
        }
        for (roughness, nonlinear) in [(0.0, false), (0.0, true), (0.1, true), (0.6, false)] {
            let (diffuse, specular) = (colour.into(), [1.0, 0.8, 0.6]);
            all.push(Material::Plastic { diffuse, specular, ior: 1.5, roughness, nonlinear });
        }
        for (roughness, metal) in [(0.3, 0.0), (0.5, 0.4), (0.9, 1.0)] {
            let metallic_roughness = [0.0, roughness, metal].into();
            all.push(Material::MetallicRoughness { base: colour.into(), metallic_roughness, ior: 1.5 });
        }
        all.into_iter().map(|m| (m.clone(), Looks::new(m, Cover::default(), &mut vec![]).unwrap())).collect()
    }

    /// What looks so, seen from `wo`.
    fn seen(looks: &Looks, wo: Vec3) -> Glossy<'_> {
        let (position, up, uv) = (Vec3::ZERO, Vec3::Z, [0.0; 2]);
        let surface = Surface { position, flat: up, normal: up, front: true, uv, looks, light: NO };
        surface.glossy::<false>(wo.z).unwrap()
    }

    #[test]
    fn scattering_is_reciprocal() {
        let mut rng = Rng::new(Key::new(5), 0, 0);
        let mut direction = || {
            let w = math::sphere(rng.two());
            Vec3::new(w.x, w.y, w.z.abs().max(0.01)).normalize()
        };
        for (material, looks) in zoo() {
            for _ in 0..2000 {
                let (a, b) = (direction(), direction());
                let forth = seen(&looks, a).eval(a, b).0 / b.z;
                let back = seen(&looks, b).eval(b, a).0 / a.z;
                let error = (forth - back).abs().max_element();
                // Roundings of the half vector count most where the lobe is narrow
                assert!(error <= 2e-4 * forth.max_element() + 1e-6, "{material:?}: {forth} {back}");
            }
        }
    }

    /// Samples fall where their density says, by a chi-square test over 8×12 parts of the hemisphere, one of smooth reflection
    /// and one of nothing; where they fall, density and f·cos are what `eval` says. Chi-square of n degrees of freedom exceeds
    /// n + 6√2n with p < 1e-5.
    #[test]
    fn samples_have_the_density_they_say() {
        const SAMPLES: usize = 30_000;
        const PARTS: [usize; 2] = [8, 12];
        const FINE: [usize; 2] = [320, 1440];
        let mut rng = Rng::new(Key::new(6), 0, 0);
        for (material, looks) in zoo() {
            for cos in [0.9f32, 0.5, 0.2] {
                let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
                let glossy = seen(&looks, wo);
                let (smooth, nothing) = (PARTS[0] * PARTS[1], PARTS[0] * PARTS[1] + 1);
                let mut expected = vec![0.0; nothing + 1];
                for i in 0..FINE[0] {
                    let theta = (i as f32 + 0.5) / FINE[0] as f32 * 0.5 * PI;
                    let area = f64::from(theta.sin() * PI * PI) / (FINE[0] * FINE[1]) as f64;
                    for j in 0..FINE[1] {
                        let (sin, cos) = ((j as f32 + 0.5) / FINE[1] as f32 * 2.0 * PI).sin_cos();
                        let wi = Vec3::new(theta.sin() * cos, theta.sin() * sin, theta.cos());
                        let part = i * PARTS[0] / FINE[0] * PARTS[1] + j * PARTS[1] / FINE[1];
                        expected[part] += f64::from(glossy.eval(wo, wi).1) * area;
                    }
                }
                expected[smooth] = if glossy.smooth { f64::from(glossy.facet) } else { 0.0 };
                let mass: f64 = expected.iter().sum();
                assert!(mass < 1.0 + 2e-3, "{material:?} at {cos}: {mass}");
                expected[nothing] = (1.0 - mass).max(0.0);

                let mut found = vec![0.0; nothing + 1];
                for _ in 0..SAMPLES {
                    let [pick, u] = rng.two();
                    let Some((wi, weight, pdf)) = glossy.sample(wo, [pick, u, rng.one()]) else {
                        found[nothing] += 1.0;
                        continue;
                    };
                    if pdf == DELTA {
                        found[smooth] += 1.0;
                        continue;
                    }
                    let (f, density) = glossy.eval(wo, wi);
                    assert!((density - pdf).abs() <= 2e-3 * pdf, "{material:?}: {density} {pdf}");
                    let error = (weight * pdf - f).abs().max_element();
                    assert!(error <= 4e-3 * f.max_element(), "{material:?}: {weight} {pdf} {f}");
                    let theta = wi.z.clamp(0.0, 1.0).acos() / (0.5 * PI) * PARTS[0] as f32;
                    let phi = (wi.y.atan2(wi.x) / (2.0 * PI)).rem_euclid(1.0) * PARTS[1] as f32;
                    let part = |x: f32, axis: usize| (x as usize).min(PARTS[axis] - 1);
                    found[part(theta, 0) * PARTS[1] + part(phi, 1)] += 1.0;
                }
                // Parts that expect less than ten are judged together
                let (mut square, mut freedom, mut rare) = (0f64, 0f64, [0f64; 2]);
                let mut judge = |found: f64, expected: f64| {
                    square += (found - expected).powi(2) / expected;
                    freedom += 1.0;
                };
                for (found, expected) in found.iter().zip(&expected) {
                    let expected = expected * SAMPLES as f64;
                    if expected < 10.0 {
                        rare = [rare[0] + found, rare[1] + expected];
                    } else {
                        judge(*found, expected);
                    }
                }
                judge(rare[0], rare[1].max(10.0));
                let limit = freedom + 6.0 * (2.0 * freedom).sqrt();
                assert!(square < limit, "{material:?} at {cos}: χ² {square} of {freedom}");
            }
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
