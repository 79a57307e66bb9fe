//! Path tracing with next event estimation.

use crate::accel::Stack;
use crate::bsdf::{self, Ggx};
use crate::light::Light;
use crate::material::{Kind, Looks};
use crate::math::{self, Frame, Ray, Vec3, power_heuristic};
use crate::rng::Rng;
use crate::scene::{NO, Scene, Surface};
use std::f32::consts::FRAC_1_PI;

/// What the integrator must know besides the scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Settings {
    /// Longest path, in segments: 1 is light seen directly, 2 is direct light.
    pub(crate) max_depth: u32,
    /// Number of segments from which on paths end by Russian roulette.
    pub(crate) roulette: u32,
    /// Multiple importance sampling, or lights by next event estimation alone.
    pub(crate) mis: bool,
}

/// Stands for the density of a direction that no light could be aimed along: camera rays, mirrors, glass.
const DELTA: f32 = f32::INFINITY;

/// An estimator of radiance along a camera ray.
pub(crate) type Estimator = fn(&Scene, Settings, Ray, &mut Rng, &mut Stack) -> Vec3;

/// The estimator that has what the scene needs, and nothing else.
pub(crate) fn estimator(scene: &Scene) -> Estimator {
    let n = scene.needs;
    match (n.surfaces, n.bsdfs, n.sky) {
        (false, false, false) => radiance::<false, false, false>,
        (false, false, true) => radiance::<false, false, true>,
        (false, true, false) => radiance::<false, true, false>,
        (false, true, true) => radiance::<false, true, true>,
        (true, false, false) => radiance::<true, false, false>,
        (true, false, true) => radiance::<true, false, true>,
        (true, true, false) => radiance::<true, true, false>,
        (true, true, true) => radiance::<true, true, true>,
    }
}

/// One sample of the radiance along `ray` (Kajiya 1986; next event estimation: Shirley et al. 1996).
fn radiance<const SURFACES: bool, const BSDFS: bool, const SKY: bool>(
    scene: &Scene,
    settings: Settings,
    mut ray: Ray,
    rng: &mut Rng,
    stack: &mut Stack,
) -> Vec3 {
    let mut sum = Vec3::ZERO;
    let mut throughput = Vec3::ONE;
    // Density with which the ray's direction was chosen, and where from
    let mut density = DELTA;
    let mut depth = 0;
    loop {
        depth += 1;
        let hit = scene.accel.closest::<SURFACES>(&ray, stack);
        if hit.prim == NO {
            if SKY {
                sum += throughput * sky(scene, settings, ray.dir, density);
            }
            return sum;
        }
        let prim = &scene.prims[hit.prim as usize];
        let surface = scene.surface::<SURFACES>(&ray, &hit, prim);

        // Light met by scattering
        if prim.light != NO {
            let light = &scene.lights.all[prim.light as usize];
            let cos = -ray.dir.dot(surface.flat) * if surface.front { 1.0 } else { -1.0 };
            if light.shines(cos) {
                let weight =
                    met_weight(settings, density, || light.pdf(ray.origin, hit.t, cos) * light.chance);
                sum += throughput * light.radiance * weight;
            }
        }
        if depth >= settings.max_depth {
            return sum;
        }

        // Scatter: next event estimation, then a new direction
        let scattered = if !BSDFS || surface.looks.kind == Kind::Diffuse {
            diffuse::<SURFACES>(scene, settings, &surface, throughput, &mut sum, rng, stack)
        } else if surface.looks.kind == Kind::Rough {
            rough::<SURFACES>(scene, settings, &ray, &surface, throughput, &mut sum, rng, stack)
        } else {
            let (dir, weight) = specular(&ray, &surface, rng);
            Some((dir, weight, DELTA))
        };
        let Some((dir, weight, pdf)) = scattered else { return sum };
        throughput *= weight;
        density = pdf;

        // Russian roulette (Arvo, Kirk 1990)
        if depth >= settings.roulette {
            let survive = throughput.max_element().min(0.95);
            if rng.one() >= survive {
                return sum;
            }
            throughput /= survive;
        }
        if throughput.max_element() <= 0.0 {
            return sum;
        }
        ray = Ray { origin: scene.leave(&surface, dir), dir };
    }
}

/// Share of light met by scattering with `density` that counts; `aimed` is the density of next event estimation there.
#[inline]
fn met_weight(settings: Settings, density: f32, aimed: impl FnOnce() -> f32) -> f32 {
    if density == DELTA {
        1.0
    } else if settings.mis {
        power_heuristic(density, aimed())
    } else {
        0.0
    }
}

/// Radiance of the sky for a ray that met nothing. The dome is gathered by scattering alone, the sun also by next events.
#[inline]
fn sky(scene: &Scene, settings: Settings, dir: Vec3, density: f32) -> Vec3 {
    let mut sum = scene.dome.as_ref().map_or(Vec3::ZERO, |dome| dome.radiance(dir));
    if let Some(sun) = scene.sun.map(|i| &scene.lights.all[i]).filter(|sun| sun.covers(dir)) {
        let weight = met_weight(settings, density, || sun.pdf(Vec3::ZERO, 0.0, 1.0) * sun.chance);
        sum += sun.radiance * weight;
    }
    sum
}

/// A point on a light that the surface sees: its direction and cosine at the surface, radiance over density, and density.
/// `None` if there is none, or something is in between. `weigh` says by what the radiance is multiplied for a direction, zero
/// if nothing is scattered there; the ray is then not traced.
#[inline]
fn next_event<const SURFACES: bool>(
    scene: &Scene,
    surface: &Surface,
    rng: &mut Rng,
    stack: &mut Stack,
    weigh: impl FnOnce(Vec3, f32) -> Vec3,
) -> Vec3 {
    if scene.lights.all.is_empty() {
        return Vec3::ZERO;
    }
    let light: &Light =
        if scene.lights.all.len() == 1 { &scene.lights.all[0] } else { scene.lights.choose(rng.one()) };
    let origin = scene.leave(surface, surface.flat);
    let Some(aim) = light.aim(origin, rng.two()) else { return Vec3::ZERO };
    if aim.dir.dot(surface.flat) <= 0.0 {
        return Vec3::ZERO;
    }
    let pdf = aim.pdf * light.chance;
    let share = weigh(aim.dir, pdf) * light.radiance / pdf;
    // Also false for NaN: a density beyond the range of f32 is no light
    if !(share.max_element() > 0.0 && share.max_element() < f32::MAX) {
        return Vec3::ZERO;
    }
    let shadow = Ray { origin, dir: aim.dir };
    if scene.accel.blocked::<SURFACES>(&shadow, aim.distance * 0.9999, stack) { Vec3::ZERO } else { share }
}

type Scattered = Option<(Vec3, Vec3, f32)>;

/// Lambertian reflection: the new direction, its weight and its density.
#[inline]
fn diffuse<const SURFACES: bool>(
    scene: &Scene,
    settings: Settings,
    surface: &Surface,
    throughput: Vec3,
    sum: &mut Vec3,
    rng: &mut Rng,
    stack: &mut Stack,
) -> Scattered {
    let albedo = surface.looks.colour;
    *sum += throughput
        * next_event::<SURFACES>(scene, surface, rng, stack, |dir, pdf| {
            let scattering = dir.dot(surface.normal).max(0.0) * FRAC_1_PI;
            let weight = if settings.mis { power_heuristic(pdf, scattering) } else { 1.0 };
            albedo * (scattering * weight)
        });
    let local = math::cosine_hemisphere(rng.two());
    let dir = Frame::new(surface.normal).to_world(local);
    // A shading normal can send the ray below the surface: no light from there
    if SURFACES && dir.dot(surface.flat) <= 0.0 {
        return None;
    }
    Some((dir, albedo, local.z * FRAC_1_PI))
}

/// Reflection by GGX microfacets.
#[inline(never)]
#[expect(clippy::too_many_arguments, reason = "a part of the inner loop, cut out for reading")]
fn rough<const SURFACES: bool>(
    scene: &Scene,
    settings: Settings,
    ray: &Ray,
    surface: &Surface,
    throughput: Vec3,
    sum: &mut Vec3,
    rng: &mut Rng,
    stack: &mut Stack,
) -> Scattered {
    let Looks { colour: f0, value: alpha, .. } = surface.looks;
    let ggx = Ggx { alpha };
    let frame = Frame::new(surface.normal);
    let wo = frame.to_local(-ray.dir);
    *sum += throughput
        * next_event::<SURFACES>(scene, surface, rng, stack, |dir, pdf| {
            let (f_cos, scattering, cos_h) = ggx.eval(wo, frame.to_local(dir));
            let weight = if settings.mis { power_heuristic(pdf, scattering) } else { 1.0 };
            bsdf::schlick(f0, cos_h) * (f_cos * weight)
        });
    let (wi, weight, cos_h) = ggx.sample(wo, rng.two());
    let dir = frame.to_world(wi);
    if weight <= 0.0 || dir.dot(surface.flat) <= 0.0 {
        return None;
    }
    let (_, pdf, _) = ggx.eval(wo, wi);
    Some((dir.normalize(), bsdf::schlick(f0, cos_h) * weight, pdf))
}

/// Mirror and glass: the new direction and its weight. Glass chooses reflection with the probability of its Fresnel term.
#[inline(never)]
fn specular(ray: &Ray, surface: &Surface, rng: &mut Rng) -> (Vec3, Vec3) {
    let Looks { kind, colour, value, .. } = surface.looks;
    let n = surface.normal;
    let cos = (-ray.dir.dot(n)).clamp(0.0, 1.0);
    match kind {
        Kind::Glass => {
            let eta = if surface.front { value } else { 1.0 / value };
            let (reflectance, cos_t) = bsdf::fresnel(cos, eta);
            if rng.one() < reflectance {
                (math::reflect(ray.dir, n), Vec3::ONE)
            } else {
                (bsdf::refract(ray.dir, n, cos, cos_t, eta), colour)
            }
        }
        Kind::Conductor => (math::reflect(ray.dir, n), bsdf::schlick(colour, cos)),
        _ => (math::reflect(ray.dir, n), colour),
    }
}
