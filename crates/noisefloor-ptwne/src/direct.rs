//! Samples of the ray-traced reference: direct light, also as seen in mirrors, glass and microfacets.

use crate::accel::Stack;
use crate::bsdf;
use crate::camera::Lens;
use crate::geometry::{Intersection, NO};
use crate::guide::{Contributions, Guide, GuidedSample};
use crate::light::LightSample;
use crate::material::Bsdf;
use crate::math::{self, DELTA, Frame, Ray, Vec3};
use crate::rng::{GOLDEN, mix};
use crate::sampler::Draws;
use crate::scene::{Scene, Sky};
use std::f32::consts::FRAC_1_PI;

/// Light samples at each surface. Most of the error is there, and a ray to the next surface costs as much as
/// one.
const LIGHT_SAMPLES: u32 = 4;
/// Longest chain of mirrors and glass.
const MAX_SPECULAR: u32 = 10;
/// Branches with less weight are cut.
const MIN_WEIGHT: f32 = 2e-3;

/// What the numbers at a surface are used for: each use has its own scrambling.
#[derive(Clone, Copy)]
enum Use {
    Ray,
    Lights,
    Hemisphere,
    Facets,
}

/// Takes samples. Each decision along a path uses two dimensions of Owen-scrambled Sobol points (Burley
/// 2020).
pub(crate) struct Tracer<'a> {
    scene: &'a Scene,
    pub(crate) guide: Guide<'a>,
    /// The light that samples find, while a guide is learned from them.
    pub(crate) found: Option<Contributions>,
    stack: Stack,
    /// The index of the sample in its sequences.
    index: u32,
    seed: u64,
}

#[derive(Clone, Copy)]
struct Branch {
    ray: Ray,
    /// Where its direction was sampled, and how far it has come since, through surfaces of nothing.
    from: Vec3,
    passed: f32,
    /// Density with which its direction was sampled.
    density: f32,
    /// Factor on its light.
    weight: Vec3,
    /// Its medium's index of refraction over the camera's, squared.
    eta2: f32,
    /// One at the camera, doubled at each surface, plus one for light that glass transmits: unique among the
    /// rays of a sample.
    code: u64,
}

impl<'a> Tracer<'a> {
    pub(crate) fn new(scene: &'a Scene, guide: Guide<'a>) -> Self {
        Self { scene, guide, found: None, stack: scene.bvh.stack(), index: 0, seed: 0 }
    }

    /// Sample `index` of the pixel `at` in the sequence of `seed`, which has 2¹⁶/[`LIGHT_SAMPLES`].
    pub(crate) fn sample(&mut self, lens: &Lens, at: [usize; 2], index: u32, seed: u64) -> Vec3 {
        (self.index, self.seed) = (index, seed);
        let [u, v, lens_u, lens_v] = sobol_burley::sample_4d(index, 0, seed as u32);
        let ray = lens.ray(at[0] as f32 + u, at[1] as f32 + v, [lens_u, lens_v]);
        self.radiance(Branch {
            ray,
            from: ray.origin,
            passed: 0.0,
            density: DELTA,
            weight: Vec3::ONE,
            eta2: 1.0,
            code: 1,
        })
    }

    /// Number of directions that each surface samples in [`Tracer::hemisphere`], the only way to find a
    /// smooth sky.
    fn directions(&self) -> u32 {
        if matches!(self.scene.sky, Some(Sky::Dome(_))) { LIGHT_SAMPLES } else { 1 }
    }

    /// The seed of the numbers of a ray.
    fn seed(&self, code: u64, purpose: Use) -> u64 {
        mix(self.seed.wrapping_add((4 * code + purpose as u64).wrapping_mul(GOLDEN)))
    }

    /// Radiance along a ray, times its weight.
    fn radiance(&mut self, branch: Branch) -> Vec3 {
        let Branch { mut ray, from, passed, density, weight, eta2, code } = branch;
        let scene = self.scene;
        let mut draws = Draws { index: self.index, seed: self.seed(code, Use::Ray) };
        let blind = code == 1 && scene.optics.hides_lights;
        let (hit, surface) = loop {
            let hit = scene.closest::<true>(&ray, &mut self.stack, draws);
            if hit.is_miss() {
                return if blind { Vec3::ZERO } else { weight * self.background(ray.dir, density).0 };
            }
            let surface = scene.surface(&ray, &hit, draws);
            if !(blind && surface.light != NO) {
                break (hit, surface);
            }
            ray.origin = surface.leave(ray.dir);
            draws = draws.next();
        };
        let mut sum = Vec3::ZERO;
        if let Some(emitted) = scene.emitted(&surface, &hit, ray.dir) {
            let own = emitted.light.pdf(from, passed + hit.t, emitted.cos);
            sum += weight * emitted.radiance * self.share(density, surface.light as usize, own);
        }
        if surface.material.one_sided && !surface.front {
            return sum;
        }
        if surface.material.is_nothing() {
            let code = 2 * code;
            if code >> MAX_SPECULAR != 0 {
                return sum;
            }
            let ray = Ray { origin: surface.leave(ray.dir), dir: ray.dir };
            return sum + self.radiance(Branch { ray, passed: passed + hit.t, code, ..branch });
        }
        let cos = (-ray.dir.dot(surface.normal)).clamp(0.0, 1.0);
        let mirrored = math::reflect(ray.dir, surface.normal);
        // Both branches of glass. Radiance that crosses a boundary spreads over η² of its solid angle
        let mut split = |reflectance: f32, dir: Vec3, tint: Vec3, by: f32| {
            let mut both = self.follow(&surface, mirrored, DELTA, (weight * reflectance, eta2), 2 * code);
            // Not what a shading normal sends through the surface, and yet to its front
            if reflectance < 1.0 && dir.dot(surface.flat) < 0.0 {
                let through = weight * tint * ((1.0 - reflectance) / by);
                both += self.follow(&surface, dir, DELTA, (through, eta2 * by), 2 * code + 1);
            }
            both
        };
        sum + match &surface.material.bsdf {
            Bsdf::Diffuse { albedo } => {
                let weight = weight * albedo.tinted(surface.uv, surface.tint);
                let lambert = |dir: Vec3| dir.dot(surface.normal).max(0.0) * FRAC_1_PI;
                let directions = self.directions() as f32;
                let lights = self.lights(&surface, weight, code, |dir, pdf| {
                    Vec3::splat(lambert(dir)) * balance(pdf, lambert(dir) * directions)
                });
                lights + self.hemisphere(&surface, weight, code, |dir| Vec3::splat(lambert(dir)))
            }
            Bsdf::Mirror { fresnel, colour } => {
                let factor = fresnel.at(colour.tinted(surface.uv, surface.tint), cos);
                self.follow(&surface, mirrored, DELTA, (weight * factor, eta2), 2 * code)
            }
            Bsdf::Glass { ior, tint } => {
                let eta = if surface.front { *ior } else { 1.0 / ior };
                let (reflectance, cos_t) = bsdf::fresnel(cos, eta);
                split(reflectance, bsdf::refract(ray.dir, surface.normal, cos, cos_t, eta), *tint, eta * eta)
            }
            Bsdf::ThinGlass { ior, tint } => split(bsdf::pane(cos, *ior), ray.dir, *tint, 1.0),
            Bsdf::RoughGlass { .. } => self.rough_glass(&surface, &branch),
            // Rays pass it, and intersections have one of its parts
            Bsdf::Nothing | Bsdf::Mix { .. } => Vec3::ZERO,
            Bsdf::Metal { .. }
            | Bsdf::Plastic { .. }
            | Bsdf::Gltf { .. }
            | Bsdf::Principled { .. }
            | Bsdf::Lobes { .. } => self.glossy(&surface, &branch),
        }
    }

    /// Radiance from `dir`, times the weight, if the chain may continue. With the weight comes
    /// [`Branch::eta2`].
    fn follow(
        &mut self,
        surface: &Intersection<'_>,
        dir: Vec3,
        density: f32,
        (weight, eta2): (Vec3, f32),
        code: u64,
    ) -> Vec3 {
        // By basic radiance L/η², so that what is inside glass is not cut sooner
        if code >> MAX_SPECULAR != 0 || weight.max_element() * eta2 < MIN_WEIGHT {
            return Vec3::ZERO;
        }
        let ray = Ray { origin: surface.leave(dir), dir };
        self.radiance(Branch { ray, from: ray.origin, passed: 0.0, density, weight, eta2, code })
    }

    /// A rough boundary: one sampled direction, by which lights are found, too.
    fn rough_glass(&mut self, surface: &Intersection<'_>, branch: &Branch) -> Vec3 {
        let &Branch { ray, weight, eta2, code, .. } = branch;
        let Some(glass) = surface.rough_glass() else { return Vec3::ZERO };
        let frame = surface.frame();
        let numbers = sobol_burley::sample_4d(self.index, 0, self.seed(code, Use::Facets) as u32);
        let sampled = glass.sample(frame.to_local(-ray.dir), [numbers[2], numbers[0], numbers[1]]);
        let Some((wi, factor, _)) = sampled else { return Vec3::ZERO };
        let dir = frame.to_world(wi).normalize();
        if !surface.is_consistent(dir, wi) {
            return Vec3::ZERO;
        }
        self.follow(surface, dir, DELTA, (weight * factor, eta2 * glass.eta2(wi)), 2 * code)
    }

    /// Microfacets and coats: direct light, and what the facets reflect.
    fn glossy(&mut self, surface: &Intersection<'_>, branch: &Branch) -> Vec3 {
        let &Branch { ray, weight, eta2, code, .. } = branch;
        let frame = surface.frame();
        let wo = frame.to_local(-ray.dir);
        let Some(glossy) = surface.glossy(wo.z) else { return Vec3::ZERO };
        let [u, v] = pair(self.index, self.seed(code, Use::Facets));
        // Must not depend on where the facets reflect to, which light samples could not know
        let follows = (2 * code) >> MAX_SPECULAR == 0;
        let directions = self.directions() as f32;
        let mut sum = self.lights(surface, weight, code, |dir, pdf| {
            let wi = frame.to_local(dir);
            let (facets, chosen) = glossy.facets(wo, wi);
            let share = if follows { balance(pdf, chosen) } else { 1.0 };
            glossy.base(wo, wi) * balance(pdf, wi.z.max(0.0) * FRAC_1_PI * directions) + facets * share
        });
        if glossy.has_base() {
            sum += self.hemisphere(surface, weight, code, |dir| glossy.base(wo, frame.to_local(dir)));
        }
        if glossy.transmits() {
            let far = surface.turned_over();
            let through = |dir: Vec3| glossy.through(frame.to_local(dir));
            sum += self.lights(&far, weight, code, |dir, pdf| {
                let cos = dir.dot(far.normal).max(0.0);
                through(dir) * balance(pdf, cos * FRAC_1_PI * directions)
            });
            sum += self.hemisphere(&far, weight, code, through);
        }
        if let Some(factor) = glossy.mirror() {
            let dir = math::reflect(ray.dir, surface.normal);
            if dir.dot(surface.flat) > 0.0 {
                sum += self.follow(surface, dir, DELTA, (weight * factor, eta2), 2 * code + 1);
            }
        }
        if let Some((wi, factor, density)) = glossy.reflect(wo, [u, v]) {
            let dir = frame.to_world(wi).normalize();
            if dir.dot(surface.flat) > 0.0 {
                sum += self.follow(surface, dir, density, (weight * factor, eta2), 2 * code);
            }
        }
        sum
    }

    /// Direct light by light samples, times the weight. `scattered` is f·cos θ in a direction, times the
    /// weight that a light sample of that density has.
    fn lights(
        &mut self,
        surface: &Intersection<'_>,
        weight: Vec3,
        code: u64,
        scattered: impl Fn(Vec3, f32) -> Vec3,
    ) -> Vec3 {
        let scene = self.scene;
        let origin = surface.leave(surface.flat);
        let seed = self.seed(code, Use::Lights);
        let mut sum = Vec3::ZERO;
        for index in self.index * LIGHT_SAMPLES..(self.index + 1) * LIGHT_SAMPLES {
            let Some(GuidedSample { light, sample, stratum }) = self.guide.sample(origin, pair(index, seed))
            else {
                continue;
            };
            let LightSample { dir, distance, value, pdf, .. } = sample;
            if dir.dot(surface.flat) <= 0.0 {
                continue;
            }
            let share = weight * scattered(dir, pdf * LIGHT_SAMPLES as f32) * value / LIGHT_SAMPLES as f32;
            // Not finite if the density is beyond the range of f32
            let counts = share.max_element() > 0.0 && share.is_finite();
            let shadow = Ray { origin, dir };
            let draws = Draws { index, seed };
            if counts && !scene.blocked::<true>(&shadow, distance * 0.9999, &mut self.stack, draws) {
                let light = share * scene.deferred_radiance(light, dir);
                self.note(stratum, light);
                sum += light;
            }
        }
        sum
    }

    /// Direct light by directions sampled by their cosine, times the weight: from the sky, and from lights so
    /// near that light samples are a poor choice. `scattered` is f·cos θ.
    fn hemisphere(
        &mut self,
        surface: &Intersection<'_>,
        weight: Vec3,
        code: u64,
        scattered: impl Fn(Vec3) -> Vec3,
    ) -> Vec3 {
        let n = self.directions();
        let (frame, seed) = (Frame::new(surface.normal), self.seed(code, Use::Hemisphere));
        let mut sum = Vec3::ZERO;
        for index in self.index * n..(self.index + 1) * n {
            let local = math::cosine_hemisphere(pair(index, seed));
            let dir = frame.to_world(local);
            let density = local.z * FRAC_1_PI;
            if dir.dot(surface.flat) <= 0.0 || density <= 0.0 {
                continue;
            }
            let ray = Ray { origin: surface.leave(dir), dir };
            let (radiance, stratum) = self.emitted_along(&ray, Draws { index, seed }, density * n as f32);
            let light = weight * scattered(dir) * radiance / (density * n as f32);
            if let Some(stratum) = stratum {
                self.note(stratum, light);
            }
            sum += light;
        }
        sum
    }

    /// The weighted light that a ray hits, whose direction was sampled with that density, and the stratum of
    /// its last light.
    fn emitted_along(&mut self, ray: &Ray, mut draws: Draws, density: f32) -> (Vec3, Option<usize>) {
        let (scene, mut passed, mut onward) = (self.scene, 0.0, *ray);
        let (mut sum, mut stratum) = (Vec3::ZERO, None);
        loop {
            let hit = scene.closest::<true>(&onward, &mut self.stack, draws);
            if hit.is_miss() {
                let (radiance, seen) = self.background(ray.dir, density);
                return (sum + radiance, seen.or(stratum));
            }
            let surface = scene.surface(&onward, &hit, draws);
            passed += hit.t;
            if let Some(emitted) = scene.emitted(&surface, &hit, ray.dir) {
                let own = emitted.light.pdf(ray.origin, passed, emitted.cos);
                sum += emitted.radiance * self.share(density, surface.light as usize, own);
                stratum = Some(surface.light as usize);
            }
            if !surface.material.is_nothing() {
                return (sum, stratum);
            }
            onward.origin = surface.leave(ray.dir);
            draws = draws.next();
        }
    }

    /// The weighted radiance from infinitely far away for a direction of that density, and the stratum of its
    /// light.
    fn background(&self, dir: Vec3, density: f32) -> (Vec3, Option<usize>) {
        let mut stratum = None;
        let radiance = self.scene.background(dir, |_, own| {
            let seen = self.guide.strata.far(dir);
            stratum = Some(seen);
            self.share(density, seen, own)
        });
        (radiance, stratum)
    }

    /// The weight of a direction of that density beside light samples. `own` is the density of the light's
    /// own samples.
    fn share(&self, density: f32, stratum: usize, own: f32) -> f32 {
        balance(density, self.guide.density(stratum, own) * LIGHT_SAMPLES as f32)
    }

    fn note(&mut self, stratum: usize, light: Vec3) {
        if let Some(found) = &mut self.found {
            found.note(stratum, light);
        }
    }
}

/// Point `index` of the sequence of `seed`.
fn pair(index: u32, seed: u64) -> [f32; 2] {
    let [u, v, ..] = sobol_burley::sample_4d(index, 0, seed as u32);
    [u, v]
}

/// Balance heuristic (Veach 1997, §9.2.2): the weight of a sample that another technique takes with density
/// `rival`.
fn balance(density: f32, rival: f32) -> f32 {
    if density == DELTA { 1.0 } else { density / (density + rival) }
}
