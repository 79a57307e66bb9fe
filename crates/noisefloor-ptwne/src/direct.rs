//! Samples of direct light, and of what mirrors, glass and microfacets show of it: what the ray-traced reference is made of.

use crate::accel::Stack;
use crate::bsdf::{self, DELTA};
use crate::camera::Lens;
use crate::guide::{Choice, Found, Guide};
use crate::light::Aim;
use crate::material::Kind;
use crate::math::{self, Frame, Ray, Vec3};
use crate::rng::{GOLDEN, mix};
use crate::scene::{Holes, Scene, Sky, Surface};
use std::f32::consts::FRAC_1_PI;

/// Points of lights that each surface looks at. Most of the error is there; a ray to find another surface costs as much as a point.
const POINTS: u32 = 4;
/// Longest chain of mirrors and glass.
const MAX_SPECULAR: u32 = 10;
/// Branches that weigh less are cut.
const MIN_WEIGHT: f32 = 2e-3;

/// What the numbers of a surface are for: each use has a scramble of its own.
#[derive(Clone, Copy)]
enum Use {
    Ray,
    Lights,
    Glow,
    Facets,
}

/// Takes samples. Where one goes is decided by Owen-scrambled Sobol points (Burley 2020), a pair for each decision.
pub(crate) struct Tracer<'a> {
    scene: &'a Scene,
    /// How points of lights are chosen.
    pub(crate) guide: Guide<'a>,
    /// What samples find, while a guide is to be learned from them.
    pub(crate) found: Option<Found>,
    stack: Stack,
    /// Which point of the sequences the sample is.
    index: u32,
    seed: u64,
}

/// A ray of a sample.
struct Branch {
    ray: Ray,
    /// Density with which its direction was chosen.
    density: f32,
    /// Factor on its light.
    weight: Vec3,
    /// One at the camera, doubled at each surface, plus one for what glass lets through: no two rays of a sample share it.
    code: u64,
}

impl<'a> Tracer<'a> {
    pub(crate) fn new(scene: &'a Scene, guide: Guide<'a>) -> Self {
        Self { scene, guide, found: None, stack: scene.accel.stack(), index: 0, seed: 0 }
    }

    /// Sample `index` of the pixel `at`, of the sequence of `seed`. There are 2¹⁶/[`POINTS`].
    pub(crate) fn sample(&mut self, lens: &Lens, at: [usize; 2], index: u32, seed: u64) -> Vec3 {
        (self.index, self.seed) = (index, seed);
        let [u, v] = pair(index, seed);
        let ray = lens.ray(at[0] as f32 + u, at[1] as f32 + v);
        self.radiance(Branch { ray, density: DELTA, weight: Vec3::ONE, code: 1 })
    }

    /// Directions by which each surface looks for [`Tracer::glow`]: a smooth sky is found by these alone.
    fn directions(&self) -> u32 {
        if matches!(self.scene.sky, Some(Sky::Dome(_))) { POINTS } else { 1 }
    }

    /// The seed of a ray's numbers.
    fn seed(&self, code: u64, purpose: Use) -> u64 {
        mix(self.seed.wrapping_add((4 * code + purpose as u64).wrapping_mul(GOLDEN)))
    }

    fn holes(&self, code: u64, purpose: Use) -> Holes {
        Holes::Shared { index: self.index, seed: self.seed(code, purpose) }
    }

    /// Radiance along a ray, times its weight.
    fn radiance(&mut self, Branch { ray, density, weight, code }: Branch) -> Vec3 {
        let scene = self.scene;
        let holes = self.holes(code, Use::Ray);
        let hit = scene.closest::<true>(&ray, &mut self.stack, holes);
        if hit.is_miss() {
            return weight * self.beyond(ray.dir, density).0;
        }
        let surface = scene.surface::<true>(&ray, &hit);
        let mut sum = Vec3::ZERO;
        if let Some((radiance, light, cos)) = scene.emitted::<true>(&surface, &hit, ray.dir) {
            let own = light.pdf(ray.origin, hit.t, cos);
            sum += weight * radiance * self.share(density, surface.light as usize, own);
        }
        if surface.looks.one_sided && !surface.front {
            return sum;
        }
        let cos = (-ray.dir.dot(surface.normal)).clamp(0.0, 1.0);
        let mirrored = math::reflect(ray.dir, surface.normal);
        // Both branches of glass
        let mut split = |reflectance: f32, dir: Vec3, tint: Vec3| {
            let mut both = self.follow(&surface, mirrored, DELTA, weight * reflectance, 2 * code);
            if reflectance < 1.0 {
                both += self.follow(&surface, dir, DELTA, weight * tint * (1.0 - reflectance), 2 * code + 1);
            }
            both
        };
        sum + match &surface.looks.kind {
            Kind::Diffuse { albedo } => {
                let weight = weight * albedo.at::<true>(surface.uv);
                let lambert = |dir: Vec3| dir.dot(surface.normal).max(0.0) * FRAC_1_PI;
                let directions = self.directions() as f32;
                let lights = self.lights(&surface, weight, code, |dir, pdf| {
                    Vec3::splat(lambert(dir)) * balance(pdf, lambert(dir) * directions)
                });
                lights + self.glow(&surface, weight, code, |dir| Vec3::splat(lambert(dir)))
            }
            Kind::Mirror { fresnel, colour } => {
                let factor = fresnel.at(colour.at::<true>(surface.uv), cos);
                self.follow(&surface, mirrored, DELTA, weight * factor, 2 * code)
            }
            Kind::Glass { ior, tint } => {
                let eta = if surface.front { *ior } else { 1.0 / ior };
                let (reflectance, cos_t) = bsdf::fresnel(cos, eta);
                split(reflectance, bsdf::refract(ray.dir, surface.normal, cos, cos_t, eta), *tint)
            }
            Kind::ThinGlass { ior, tint } => split(bsdf::pane(cos, *ior), ray.dir, *tint),
            Kind::Metal { .. } | Kind::Plastic { .. } | Kind::Blend { .. } => {
                self.glossy(&ray, &surface, weight, code)
            }
        }
    }

    /// Radiance from `dir`, times the weight, if the chain may go on.
    fn follow(&mut self, surface: &Surface<'_>, dir: Vec3, density: f32, weight: Vec3, code: u64) -> Vec3 {
        if code >> MAX_SPECULAR != 0 || weight.max_element() < MIN_WEIGHT {
            return Vec3::ZERO;
        }
        let ray = Ray { origin: self.scene.leave(surface, dir), dir };
        self.radiance(Branch { ray, density, weight, code })
    }

    /// Microfacets and coats: direct light, and what the facets mirror.
    fn glossy(&mut self, ray: &Ray, surface: &Surface<'_>, weight: Vec3, code: u64) -> Vec3 {
        let frame = Frame::new(surface.normal);
        let wo = frame.to_local(-ray.dir);
        let Some(glossy) = surface.glossy::<true>(wo.z) else { return Vec3::ZERO };
        let [u, v] = pair(self.index, self.seed(code, Use::Facets));
        // Whether facets are followed must not depend on where they mirror to: points of lights would not know
        let follows = (2 * code) >> MAX_SPECULAR == 0;
        let directions = self.directions() as f32;
        let mut sum = self.lights(surface, weight, code, |dir, pdf| {
            let wi = frame.to_local(dir);
            let (facets, chosen) = glossy.facets(wo, wi);
            let share = if follows { balance(pdf, chosen) } else { 1.0 };
            glossy.base(wi) * balance(pdf, wi.z.max(0.0) * FRAC_1_PI * directions) + facets * share
        });
        if glossy.has_base() {
            sum += self.glow(surface, weight, code, |dir| glossy.base(frame.to_local(dir)));
        }
        if let Some((wi, factor, density)) = glossy.reflect(wo, [u, v]) {
            let dir = frame.to_world(wi).normalize();
            if dir.dot(surface.flat) > 0.0 {
                sum += self.follow(surface, dir, density, weight * factor, 2 * code);
            }
        }
        sum
    }

    /// Light from points of lights that the surface sees, times the weight. `scattered` is f·cos θ in a direction, times the share
    /// that points of lights have in it, which follows from their density.
    fn lights(
        &mut self,
        surface: &Surface<'_>,
        weight: Vec3,
        code: u64,
        scattered: impl Fn(Vec3, f32) -> Vec3,
    ) -> Vec3 {
        let scene = self.scene;
        let origin = scene.leave(surface, surface.flat);
        let seed = self.seed(code, Use::Lights);
        let mut sum = Vec3::ZERO;
        for index in self.index * POINTS..(self.index + 1) * POINTS {
            let Some(Choice { light, aim, part }) = self.guide.aim(origin, pair(index, seed)) else {
                continue;
            };
            let Aim { dir, distance, value, pdf, .. } = aim;
            if dir.dot(surface.flat) <= 0.0 {
                continue;
            }
            let share = weight * scattered(dir, pdf * POINTS as f32) * value / POINTS as f32;
            // A share that is not finite is one whose density is beyond f32
            let counts = share.max_element() > 0.0 && share.is_finite();
            let shadow = Ray { origin, dir };
            let holes = Holes::Shared { index, seed };
            if counts && !scene.blocked::<true>(&shadow, distance * 0.9999, &mut self.stack, holes) {
                let light = share * scene.revealed(light, dir);
                self.note(part, light);
                sum += light;
            }
        }
        sum
    }

    /// Light met in a direction chosen by its cosine, times the weight: from the sky, and from lights so near that points on them are
    /// a poor choice. `scattered` is f·cos θ.
    fn glow(
        &mut self,
        surface: &Surface<'_>,
        weight: Vec3,
        code: u64,
        scattered: impl Fn(Vec3) -> Vec3,
    ) -> Vec3 {
        let n = self.directions();
        let (frame, seed) = (Frame::new(surface.normal), self.seed(code, Use::Glow));
        let mut sum = Vec3::ZERO;
        for index in self.index * n..(self.index + 1) * n {
            let local = math::cosine_hemisphere(pair(index, seed));
            let dir = frame.to_world(local);
            let density = local.z * FRAC_1_PI;
            if dir.dot(surface.flat) <= 0.0 || density <= 0.0 {
                continue;
            }
            let ray = Ray { origin: self.scene.leave(surface, dir), dir };
            let (radiance, part) = self.met(&ray, Holes::Shared { index, seed }, density * n as f32);
            let light = weight * scattered(dir) * radiance / (density * n as f32);
            if let Some(part) = part {
                self.note(part, light);
            }
            sum += light;
        }
        sum
    }

    /// What of the light met by a ray counts, whose direction was chosen with that density, and the part of the lights it is of, if any.
    fn met(&mut self, ray: &Ray, holes: Holes, density: f32) -> (Vec3, Option<usize>) {
        let scene = self.scene;
        let hit = scene.closest::<true>(ray, &mut self.stack, holes);
        if hit.is_miss() {
            return self.beyond(ray.dir, density);
        }
        let met = scene.surface::<true>(ray, &hit);
        let Some((radiance, light, cos)) = scene.emitted::<true>(&met, &hit, ray.dir) else {
            return (Vec3::ZERO, None);
        };
        let part = met.light as usize;
        (radiance * self.share(density, part, light.pdf(ray.origin, hit.t, cos)), Some(part))
    }

    /// What of the radiance from far away counts for a direction of that density, and the part of the lights that it is of, if any.
    fn beyond(&self, dir: Vec3, density: f32) -> (Vec3, Option<usize>) {
        let mut part = None;
        let radiance = self.scene.beyond(dir, |own, _| {
            let seen = self.guide.parts.far(dir);
            part = Some(seen);
            self.share(density, seen, own)
        });
        (radiance, part)
    }

    /// The share of a direction of that density beside points of lights. `own` is the density of the light's own choice.
    fn share(&self, density: f32, part: usize, own: f32) -> f32 {
        balance(density, self.guide.density(part, own) * POINTS as f32)
    }

    fn note(&mut self, part: usize, light: Vec3) {
        if let Some(found) = &mut self.found {
            found.note(part, light);
        }
    }
}

/// Point `index` of the sequence of `seed`.
fn pair(index: u32, seed: u64) -> [f32; 2] {
    let [u, v, ..] = sobol_burley::sample_4d(index, 0, seed as u32);
    [u, v]
}

/// Balance heuristic (Veach 1997, §9.2.2): the share of a technique of some density beside another.
fn balance(density: f32, rival: f32) -> f32 {
    if density == DELTA { 1.0 } else { density / (density + rival) }
}
