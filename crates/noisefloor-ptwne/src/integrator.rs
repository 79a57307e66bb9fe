//! Path tracing with next event estimation.

use crate::accel::Stack;
use crate::bsdf;
use crate::geometry::{Intersection, NO};
use crate::light::{LightSample, Prospect, Receiver};
use crate::material::Bsdf;
use crate::math::{self, DELTA, Frame, Ray, Vec3, power_heuristic};
use crate::sampler::{Draws, Sampler};
use crate::scene::Scene;
use serde::{Deserialize, Serialize};
use std::f32::consts::FRAC_1_PI;

/// What the integrator needs to know besides the scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settings {
    /// Longest path, in segments: 1 is emitted light seen directly, 2 is direct light.
    pub(crate) max_depth: u32,
    /// Number of segments from which Russian roulette may end paths.
    pub(crate) roulette: u32,
    pub(crate) estimator: Estimator,
}

/// How paths find light. All estimators converge to the same picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Estimator {
    /// By next event estimation and by scattering, combined by multiple importance sampling.
    #[default]
    Mis,
    /// By next event estimation only (Takouachet et al. 2017, §4.2). Light that scattered rays hit counts
    /// only after the camera, mirrors and glass.
    NextEvents,
    /// By scattering only. A check of the other two: lights without size, which no ray can hit, are black,
    /// and small lights are noisy.
    BruteForce,
}

impl Estimator {
    /// The weight of a light sample of density `pdf` where scattered rays have the density `own`.
    #[inline(always)]
    fn light_weight(self, pdf: f32, own: f32) -> f32 {
        if self == Self::Mis { power_heuristic(pdf, own) } else { 1.0 }
    }
}

/// Samples the radiance along a camera ray.
pub(crate) type SampleRadiance = fn(&Scene, Settings, Ray, &mut Sampler, &mut Stack) -> Vec3;

/// The integrator for scenes with or without partly transparent surfaces. It is compiled for both, since the
/// test costs up to 8 %; code for textures, microfacets, mirrors and skies costs other scenes 0 to 4 %, and
/// is always there. Inlined into another crate, it would bring all of the integrator with it,
/// to be compiled once more, and in a build for tests without optimisation.
#[inline(never)]
pub(crate) fn integrator(opacity: bool) -> SampleRadiance {
    if opacity { radiance::<true> } else { radiance::<false> }
}

/// One sample of the radiance along `ray` (Kajiya 1986; next event estimation: Shirley et al. 1996).
fn radiance<const OPACITY: bool>(
    scene: &Scene,
    settings: Settings,
    ray: Ray,
    sampler: &mut Sampler,
    stack: &mut Stack,
) -> Vec3 {
    let draws = sampler.draws();
    let prospect = Prospect::unknown(Receiver::diffuse(ray.origin, ray.dir));
    Path::<OPACITY> { scene, settings, sampler, stack, draws, prospect }.radiance(ray)
}

struct Path<'a, const OPACITY: bool> {
    scene: &'a Scene,
    settings: Settings,
    sampler: &'a mut Sampler,
    stack: &'a mut Stack,
    /// Of the last ray, but for shadow rays.
    draws: Draws,
    /// Of the last surface that sampled a light.
    prospect: Prospect,
}

/// A new direction, its weight f·cos θ / density, its density, and a number left over for Russian roulette.
struct Scattered {
    dir: Vec3,
    weight: Vec3,
    /// η² of the boundary it crosses, by which its weight was divided; 1 if it crosses none.
    eta2: f32,
    pdf: f32,
    roulette: f32,
}

impl<'a, const OPACITY: bool> Path<'a, OPACITY> {
    #[inline(always)]
    fn radiance(&mut self, mut ray: Ray) -> Vec3 {
        let scene = self.scene;
        let mut sum = Vec3::ZERO;
        let mut throughput = Vec3::ONE;
        // The medium's index of refraction over the camera's, squared
        let mut eta2 = 1.0;
        // Density with which the ray's direction was sampled
        let mut pdf = DELTA;
        // Where it was sampled, and how far the ray has come since, through surfaces of nothing
        let (mut from, mut passed) = (ray.origin, 0.0);
        let mut depth = 0;
        let mut sees_lights = !scene.optics.hides_lights;
        loop {
            depth += 1;
            // One step for this ray, and one for the shadow ray from where it ends
            self.draws = self.draws.next().next();
            let hit = scene.closest::<OPACITY>(&ray, self.stack, self.draws);
            if hit.is_miss() {
                let weight = |light, light_pdf| self.hit_weight(pdf, light, light_pdf);
                return if sees_lights { sum + throughput * scene.background(ray.dir, weight) } else { sum };
            }
            let surface = scene.surface(&ray, &hit, self.draws);
            if !sees_lights && surface.light != NO {
                depth -= 1;
                ray.origin = surface.leave(ray.dir);
                continue;
            }

            // Light that the ray hit
            if let Some(emitted) = scene.emitted(&surface, &hit, ray.dir) {
                let light_pdf = emitted.light.pdf(from, passed + hit.t, emitted.cos);
                sum +=
                    throughput * emitted.radiance * self.hit_weight(pdf, surface.light as usize, light_pdf);
            }
            if depth >= self.settings.max_depth || surface.material.one_sided && !surface.front {
                return sum;
            }

            if OPACITY && surface.material.is_nothing() {
                passed += hit.t;
                ray.origin = surface.leave(ray.dir);
                continue;
            }

            // Scatter: next event estimation, then a new direction
            let Some(next) = self.scatter(&ray, &surface, throughput, &mut sum) else { return sum };
            sees_lights = true;
            throughput *= next.weight;
            eta2 *= next.eta2;
            pdf = next.pdf;

            // Russian roulette (Arvo, Kirk 1990), by basic radiance L/η²: what paths lose on entering glass
            // they win back on leaving it
            if depth >= self.settings.roulette {
                let survive = (throughput.max_element() * eta2).min(0.95);
                if next.roulette >= survive {
                    return sum;
                }
                throughput /= survive;
            }
            if throughput.max_element() <= 0.0 {
                return sum;
            }
            ray = Ray { origin: surface.leave(next.dir), dir: next.dir };
            (from, passed) = (ray.origin, 0.0);
        }
    }

    #[inline(always)]
    fn blocked(&mut self, ray: &Ray, distance: f32) -> bool {
        self.scene.blocked::<OPACITY>(ray, distance, self.stack, self.draws.next())
    }

    /// The weight of light that a ray sampled with density `pdf` hit. Samples of that light have density
    /// `light_pdf` there.
    #[inline(always)]
    fn hit_weight(&self, pdf: f32, light: usize, light_pdf: f32) -> f32 {
        match self.settings.estimator {
            _ if pdf == DELTA => 1.0,
            Estimator::Mis => power_heuristic(pdf, light_pdf * self.scene.lights.pmf(&self.prospect, light)),
            Estimator::NextEvents => 0.0,
            Estimator::BruteForce => 1.0,
        }
    }

    #[inline(always)]
    fn scatter(
        &mut self,
        ray: &Ray,
        surface: &Intersection<'a>,
        throughput: Vec3,
        sum: &mut Vec3,
    ) -> Option<Scattered> {
        match &surface.material.bsdf {
            Bsdf::Diffuse { albedo } => {
                self.diffuse(albedo.tinted(surface.uv, surface.tint), surface, throughput, sum)
            }
            Bsdf::Metal { .. } | Bsdf::Plastic { .. } | Bsdf::Gltf { .. } | Bsdf::Principled { .. } => {
                self.glossy::<false>(ray, surface, throughput, sum)
            }
            Bsdf::Lobes { .. } => self.glossy::<true>(ray, surface, throughput, sum),
            Bsdf::RoughGlass { .. } => self.rough_glass(ray, surface, throughput, sum),
            Bsdf::Mirror { .. } | Bsdf::Glass { .. } | Bsdf::ThinGlass { .. } => self.specular(ray, surface),
            // Rays pass it, and intersections have one of its parts
            Bsdf::Nothing | Bsdf::Mix { .. } => None,
        }
    }

    /// Next event estimation: radiance over density from a point on a light, times what `scattered` returns
    /// for the direction and its density. No shadow ray is traced if that is zero. `THROUGH` also takes light
    /// from behind the surface.
    #[inline(always)]
    fn next_event<const THROUGH: bool>(
        &mut self,
        surface: &Intersection<'_>,
        receiver: Receiver,
        scattered: impl FnOnce(Vec3, f32) -> Vec3,
    ) -> Vec3 {
        let scene = self.scene;
        if scene.lights.all.is_empty() || self.settings.estimator == Estimator::BruteForce {
            return Vec3::ZERO;
        }
        let [pick, u, v, more] = self.sampler.four();
        self.prospect = scene.lights.prospect(receiver);
        let Some((light, pmf)) = scene.lights.choose(&self.prospect, pick, more) else { return Vec3::ZERO };
        let (light, mut origin) = (&scene.lights.all[light], receiver.position);
        let sample = scene.sample_light(light, origin, [u, v, more]);
        let Some(LightSample { dir, distance, value, pdf, .. }) =
            sample.filter(|sample| THROUGH || sample.dir.dot(surface.flat) > 0.0)
        else {
            return Vec3::ZERO;
        };
        let light_sum = scattered(dir, pdf * pmf) * value / pmf;
        // Also false for NaN: a density beyond the range of f32 carries no light
        if !(light_sum.max_element() > 0.0 && light_sum.max_element() < f32::MAX) {
            return Vec3::ZERO;
        }
        if THROUGH {
            origin = surface.leave(dir);
        }
        if self.blocked(&Ray { origin, dir }, distance * 0.9999) {
            return Vec3::ZERO;
        }
        light_sum * scene.deferred_radiance(light, dir)
    }

    #[inline(always)]
    fn diffuse(
        &mut self,
        albedo: Vec3,
        surface: &Intersection<'a>,
        throughput: Vec3,
        sum: &mut Vec3,
    ) -> Option<Scattered> {
        let estimator = self.settings.estimator;
        let receiver = Receiver::diffuse(surface.leave(surface.flat), surface.normal);
        *sum += throughput
            * self.next_event::<false>(surface, receiver, |dir, pdf| {
                let lambert = dir.dot(surface.normal).max(0.0) * FRAC_1_PI;
                albedo * (lambert * estimator.light_weight(pdf, lambert))
            });
        let [u, v, roulette, _] = self.sampler.four();
        let local = math::cosine_hemisphere([u, v]);
        let dir = Frame::new(surface.normal).to_world(local);
        // A shading normal can send the ray below the surface, where no light comes from
        if dir.dot(surface.flat) <= 0.0 {
            return None;
        }
        Some(Scattered { dir, weight: albedo, eta2: 1.0, pdf: local.z * FRAC_1_PI, roulette })
    }

    /// Microfacets, coats and diffuse lobes. `THROUGH` also sends light through the surface.
    #[inline(never)]
    fn glossy<const THROUGH: bool>(
        &mut self,
        ray: &Ray,
        surface: &Intersection<'a>,
        throughput: Vec3,
        sum: &mut Vec3,
    ) -> Option<Scattered> {
        let frame = surface.frame();
        let wo = frame.to_local(-ray.dir);
        let glossy = surface.glossy(wo.z)?;
        let estimator = self.settings.estimator;
        let receiver = if THROUGH && glossy.transmits() {
            Receiver::all_round(surface.position)
        } else {
            let origin = surface.leave(surface.flat);
            glossy.receiver(origin, surface.normal, wo, frame)
        };
        *sum += throughput
            * self.next_event::<THROUGH>(surface, receiver, |dir, pdf| {
                let wi = frame.to_local(dir);
                if THROUGH && !surface.is_consistent(dir, wi) {
                    return Vec3::ZERO;
                }
                let (f_cos, bsdf_pdf) = glossy.eval(wo, wi);
                f_cos * estimator.light_weight(pdf, bsdf_pdf)
            });
        let [pick, u, v, roulette] = self.sampler.four();
        let (wi, weight, pdf) = glossy.sample(wo, [pick, u, v])?;
        let dir = frame.to_world(wi);
        if !surface.is_consistent(dir, wi) {
            return None;
        }
        Some(Scattered { dir: dir.normalize(), weight, eta2: 1.0, pdf, roulette })
    }

    /// A rough dielectric boundary.
    #[inline(never)]
    fn rough_glass(
        &mut self,
        ray: &Ray,
        surface: &Intersection<'a>,
        throughput: Vec3,
        sum: &mut Vec3,
    ) -> Option<Scattered> {
        let glass = surface.rough_glass()?;
        let receiver = Receiver::all_round(surface.position);
        let frame = surface.frame();
        let wo = frame.to_local(-ray.dir);
        let estimator = self.settings.estimator;
        *sum += throughput
            * self.next_event::<true>(surface, receiver, |dir, pdf| {
                let wi = frame.to_local(dir);
                if !surface.is_consistent(dir, wi) {
                    return Vec3::ZERO;
                }
                let (f_cos, bsdf_pdf) = glass.eval(wo, wi);
                f_cos * estimator.light_weight(pdf, bsdf_pdf)
            });
        let [pick, u, v, roulette] = self.sampler.four();
        let (wi, weight, pdf) = glass.sample(wo, [pick, u, v])?;
        let dir = frame.to_world(wi).normalize();
        let eta2 = glass.eta2(wi);
        surface.is_consistent(dir, wi).then_some(Scattered { dir, weight, eta2, pdf, roulette })
    }

    /// Mirrors and glass. Glass reflects with the probability of its Fresnel term.
    #[inline(never)]
    fn specular(&mut self, ray: &Ray, surface: &Intersection<'a>) -> Option<Scattered> {
        let n = surface.normal;
        let cos = (-ray.dir.dot(n)).clamp(0.0, 1.0);
        let [pick, roulette, ..] = self.sampler.four();
        let mut eta2 = 1.0;
        let (dir, weight) = match &surface.material.bsdf {
            Bsdf::Glass { ior, tint } => {
                let eta = if surface.front { *ior } else { 1.0 / ior };
                let (reflectance, cos_t) = bsdf::fresnel(cos, eta);
                if pick < reflectance {
                    (math::reflect(ray.dir, n), Vec3::ONE)
                } else {
                    let dir = bsdf::refract(ray.dir, n, cos, cos_t, eta);
                    // A shading normal must not send through the surface what stays in front of it
                    if dir.dot(surface.flat) >= 0.0 {
                        return None;
                    }
                    // Radiance spreads over η² of its solid angle (Veach 1997, §5.2)
                    eta2 = eta * eta;
                    (dir, *tint / eta2)
                }
            }
            Bsdf::ThinGlass { ior, tint } => {
                if pick < bsdf::pane(cos, *ior) {
                    (math::reflect(ray.dir, n), Vec3::ONE)
                } else {
                    (ray.dir, *tint)
                }
            }
            Bsdf::Mirror { fresnel, colour } => {
                (math::reflect(ray.dir, n), fresnel.at(colour.tinted(surface.uv, surface.tint), cos))
            }
            _ => (ray.dir, Vec3::ZERO),
        };
        Some(Scattered { dir, weight, eta2, pdf: DELTA, roulette })
    }
}
