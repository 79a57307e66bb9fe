//! Path tracing with next event estimation.

use crate::accel::{Hit, Stack};
use crate::bsdf::{self, DELTA};
use crate::material::{Kind, Paint};
use crate::math::{self, Frame, Ray, Vec3, power_heuristic};
use crate::sampler::Sampler;
use crate::scene::{Holes, Needs, Scene, Surface};
use std::f32::consts::FRAC_1_PI;

/// What the integrator must know besides the scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settings {
    /// Longest path, in segments: 1 is light seen directly, 2 is direct light.
    pub(crate) max_depth: u32,
    /// Number of segments from which on paths end by Russian roulette.
    pub(crate) roulette: u32,
    pub(crate) estimator: Estimator,
}

/// How light finds its way into paths. All converge to the same picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Estimator {
    /// By next events and by scattering, which share it by multiple importance sampling.
    #[default]
    Mis,
    /// By next events alone, as in Takouachet et al. 2017, §4.2: lights met by scattering count only after the camera, mirrors
    /// and glass.
    NextEvents,
    /// By scattering alone. A check of the other two: lights without size, which cannot be met, are black, and small ones noise.
    BruteForce,
}

/// The radiance along a camera ray, sampled.
pub(crate) type Sample = fn(&Scene, Settings, Ray, &mut Sampler, &mut Stack) -> Vec3;

// Needs as bits of a constant
const TEXTURES: u8 = 1;
const GLOSSY: u8 = 2;
const SPECULAR: u8 = 4;
const SKY: u8 = 8;
const HOLES: u8 = 16;

/// The integrator for scenes that have no more than this.
pub(crate) fn integrator(needs: Needs) -> Sample {
    const ALL: [Sample; 32] = [
        radiance::<0>,
        radiance::<1>,
        radiance::<2>,
        radiance::<3>,
        radiance::<4>,
        radiance::<5>,
        radiance::<6>,
        radiance::<7>,
        radiance::<8>,
        radiance::<9>,
        radiance::<10>,
        radiance::<11>,
        radiance::<12>,
        radiance::<13>,
        radiance::<14>,
        radiance::<15>,
        radiance::<16>,
        radiance::<17>,
        radiance::<18>,
        radiance::<19>,
        radiance::<20>,
        radiance::<21>,
        radiance::<22>,
        radiance::<23>,
        radiance::<24>,
        radiance::<25>,
        radiance::<26>,
        radiance::<27>,
        radiance::<28>,
        radiance::<29>,
        radiance::<30>,
        radiance::<31>,
    ];
    let Needs { textures, glossy, specular, sky, holes } = needs;
    let bits = [(textures, TEXTURES), (glossy, GLOSSY), (specular, SPECULAR), (sky, SKY), (holes, HOLES)];
    ALL[bits.iter().map(|(has, bit)| u8::from(*has) * bit).sum::<u8>() as usize]
}

/// One sample of the radiance along `ray` (Kajiya 1986; next event estimation: Shirley et al. 1996).
fn radiance<const NEEDS: u8>(
    scene: &Scene,
    settings: Settings,
    ray: Ray,
    sampler: &mut Sampler,
    stack: &mut Stack,
) -> Vec3 {
    let seed = if NEEDS & HOLES != 0 { sampler.seed() } else { 0 };
    Walk::<NEEDS> { scene, settings, sampler, stack, seed }.radiance(ray)
}

/// One path.
struct Walk<'a, const NEEDS: u8> {
    scene: &'a Scene,
    settings: Settings,
    sampler: &'a mut Sampler,
    stack: &'a mut Stack,
    /// Of decisions about holes; another for each ray.
    seed: u64,
}

/// A new direction, its weight f·cos θ / density, its density, and a number left over for Russian roulette.
struct Scattered {
    dir: Vec3,
    weight: Vec3,
    pdf: f32,
    roulette: f32,
}

impl<'a, const NEEDS: u8> Walk<'a, NEEDS> {
    #[inline(always)]
    fn radiance(&mut self, mut ray: Ray) -> Vec3 {
        let scene = self.scene;
        let mut sum = Vec3::ZERO;
        let mut throughput = Vec3::ONE;
        // Density with which the ray's direction was chosen
        let mut density = DELTA;
        let mut depth = 0;
        loop {
            depth += 1;
            let hit = self.closest(&ray);
            if hit.is_miss() {
                if NEEDS & SKY != 0 {
                    sum += throughput
                        * scene.beyond(ray.dir, |pdf, chance| self.met_weight(density, pdf * chance));
                }
                return sum;
            }
            let surface = self.surface(&ray, &hit);

            // Light met by scattering
            let emitted = if NEEDS & TEXTURES != 0 {
                scene.emitted::<true>(&surface, &hit, ray.dir)
            } else {
                scene.emitted::<false>(&surface, &hit, ray.dir)
            };
            if let Some((radiance, light, cos)) = emitted {
                let aimed =
                    if density == DELTA { 0.0 } else { light.pdf(ray.origin, hit.t, cos) * light.chance };
                sum += throughput * radiance * self.met_weight(density, aimed);
            }
            if depth >= self.settings.max_depth || surface.looks.one_sided && !surface.front {
                return sum;
            }

            // Scatter: next event estimation, then a new direction
            let Some(next) = self.scatter(&ray, &surface, throughput, &mut sum) else { return sum };
            throughput *= next.weight;
            density = next.pdf;

            // Russian roulette (Arvo, Kirk 1990)
            if depth >= self.settings.roulette {
                let survive = throughput.max_element().min(0.95);
                if next.roulette >= survive {
                    return sum;
                }
                throughput /= survive;
            }
            if throughput.max_element() <= 0.0 {
                return sum;
            }
            ray = Ray { origin: scene.leave(&surface, next.dir), dir: next.dir };
        }
    }

    #[inline(always)]
    fn closest(&mut self, ray: &Ray) -> Hit {
        if NEEDS & HOLES != 0 {
            self.seed = self.seed.wrapping_add(1);
            self.scene.closest::<true>(ray, self.stack, Holes::Drawn(self.seed))
        } else {
            self.scene.closest::<false>(ray, self.stack, Holes::Drawn(0))
        }
    }

    #[inline(always)]
    fn blocked(&mut self, ray: &Ray, distance: f32) -> bool {
        if NEEDS & HOLES != 0 {
            self.seed = self.seed.wrapping_add(1);
            self.scene.blocked::<true>(ray, distance, self.stack, Holes::Drawn(self.seed))
        } else {
            self.scene.blocked::<false>(ray, distance, self.stack, Holes::Drawn(0))
        }
    }

    #[inline(always)]
    fn surface(&self, ray: &Ray, hit: &Hit) -> Surface<'a> {
        let scene = self.scene;
        if NEEDS & TEXTURES != 0 { scene.surface::<true>(ray, hit) } else { scene.surface::<false>(ray, hit) }
    }

    /// Share of light met by scattering with `density` that counts; `aimed` is the density of next event estimation there.
    #[inline(always)]
    fn met_weight(&self, density: f32, aimed: f32) -> f32 {
        match self.settings.estimator {
            _ if density == DELTA => 1.0,
            Estimator::Mis => power_heuristic(density, aimed),
            Estimator::NextEvents => 0.0,
            Estimator::BruteForce => 1.0,
        }
    }

    /// A colour of the surface.
    #[inline(always)]
    fn colour(&self, paint: &Paint, surface: &Surface<'_>) -> Vec3 {
        if NEEDS & TEXTURES != 0 { paint.at::<true>(surface.uv) } else { paint.at::<false>(surface.uv) }
    }

    #[inline(always)]
    fn scatter(
        &mut self,
        ray: &Ray,
        surface: &Surface<'a>,
        throughput: Vec3,
        sum: &mut Vec3,
    ) -> Option<Scattered> {
        match &surface.looks.kind {
            Kind::Diffuse { albedo } => {
                let albedo = self.colour(albedo, surface);
                self.diffuse(albedo, surface, throughput, sum)
            }
            Kind::Metal { .. } | Kind::Plastic { .. } | Kind::Blend { .. } if NEEDS & GLOSSY != 0 => {
                self.glossy(ray, surface, throughput, sum)
            }
            _ if NEEDS & SPECULAR != 0 => Some(self.specular(ray, surface)),
            _ => None,
        }
    }

    /// Light from a point of a light that the surface sees: radiance over density, times what `weigh` says for the direction and
    /// its density; zero if nothing is scattered there. The ray is then not traced.
    #[inline(always)]
    fn next_event(&mut self, surface: &Surface<'_>, weigh: impl FnOnce(Vec3, f32) -> Vec3) -> Vec3 {
        let scene = self.scene;
        if scene.lights.all.is_empty() || self.settings.estimator == Estimator::BruteForce {
            return Vec3::ZERO;
        }
        let [pick, u, v, more] = self.sampler.four();
        let Some(light) = scene.lights.choose(pick, more) else { return Vec3::ZERO };
        let origin = scene.leave(surface, surface.flat);
        let point = [u, v, more];
        let aim = if NEEDS & TEXTURES != 0 {
            scene.aim::<true>(light, origin, point)
        } else {
            scene.aim::<false>(light, origin, point)
        };
        let Some(aim) = aim.filter(|aim| aim.dir.dot(surface.flat) > 0.0) else { return Vec3::ZERO };
        let mut share = weigh(aim.dir, aim.pdf * light.chance) * aim.value / light.chance;
        // Also false for NaN: a density beyond the range of f32 is no light
        if !(share.max_element() > 0.0 && share.max_element() < f32::MAX) {
            return Vec3::ZERO;
        }
        let shadow = Ray { origin, dir: aim.dir };
        if self.blocked(&shadow, aim.distance * 0.9999) {
            return Vec3::ZERO;
        }
        if NEEDS & SKY != 0 {
            share *= scene.revealed(light, aim.dir);
        }
        share
    }

    /// Lambertian reflection.
    #[inline(always)]
    fn diffuse(
        &mut self,
        albedo: Vec3,
        surface: &Surface<'a>,
        throughput: Vec3,
        sum: &mut Vec3,
    ) -> Option<Scattered> {
        let mis = self.settings.estimator == Estimator::Mis;
        *sum += throughput
            * self.next_event(surface, |dir, pdf| {
                let scattering = dir.dot(surface.normal).max(0.0) * FRAC_1_PI;
                let weight = if mis { power_heuristic(pdf, scattering) } else { 1.0 };
                albedo * (scattering * weight)
            });
        let [u, v, roulette, _] = self.sampler.four();
        let local = math::cosine_hemisphere([u, v]);
        let dir = Frame::new(surface.normal).to_world(local);
        // A shading normal can send the ray below the surface: no light from there
        if NEEDS & TEXTURES != 0 && dir.dot(surface.flat) <= 0.0 {
            return None;
        }
        Some(Scattered { dir, weight: albedo, pdf: local.z * FRAC_1_PI, roulette })
    }

    /// Microfacets and coats.
    #[inline(never)]
    fn glossy(
        &mut self,
        ray: &Ray,
        surface: &Surface<'a>,
        throughput: Vec3,
        sum: &mut Vec3,
    ) -> Option<Scattered> {
        let frame = Frame::new(surface.normal);
        let wo = frame.to_local(-ray.dir);
        let glossy =
            if NEEDS & TEXTURES != 0 { surface.glossy::<true>(wo.z) } else { surface.glossy::<false>(wo.z) }?;
        let mis = self.settings.estimator == Estimator::Mis;
        *sum += throughput
            * self.next_event(surface, |dir, pdf| {
                let (f_cos, scattering) = glossy.eval(wo, frame.to_local(dir));
                f_cos * if mis { power_heuristic(pdf, scattering) } else { 1.0 }
            });
        let [pick, u, v, roulette] = self.sampler.four();
        let (wi, weight, pdf) = glossy.sample(wo, [pick, u, v])?;
        let dir = frame.to_world(wi);
        if dir.dot(surface.flat) <= 0.0 {
            return None;
        }
        Some(Scattered { dir: dir.normalize(), weight, pdf, roulette })
    }

    /// Mirror and glass. Glass chooses reflection with the probability of its Fresnel term.
    #[inline(never)]
    fn specular(&mut self, ray: &Ray, surface: &Surface<'a>) -> Scattered {
        let n = surface.normal;
        let cos = (-ray.dir.dot(n)).clamp(0.0, 1.0);
        let [pick, roulette, ..] = self.sampler.four();
        let (dir, weight) = match &surface.looks.kind {
            Kind::Glass { ior, tint } => {
                let eta = if surface.front { *ior } else { 1.0 / ior };
                let (reflectance, cos_t) = bsdf::fresnel(cos, eta);
                if pick < reflectance {
                    (math::reflect(ray.dir, n), Vec3::ONE)
                } else {
                    (bsdf::refract(ray.dir, n, cos, cos_t, eta), *tint)
                }
            }
            Kind::ThinGlass { ior, tint } => {
                if pick < bsdf::pane(cos, *ior) {
                    (math::reflect(ray.dir, n), Vec3::ONE)
                } else {
                    (ray.dir, *tint)
                }
            }
            Kind::Mirror { fresnel, colour } => {
                (math::reflect(ray.dir, n), fresnel.at(self.colour(colour, surface), cos))
            }
            _ => (ray.dir, Vec3::ZERO),
        };
        Scattered { dir, weight, pdf: DELTA, roulette }
    }
}
