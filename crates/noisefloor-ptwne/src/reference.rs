//! The quick ray-traced reference: direct light, and what mirrors and glass show of it (Takouachet et al. 2017, §4.3).
//! Light that was scattered by a diffuse surface on its way is missing, as in the paper.
//!
//! # How fine
//! [`RAYS`] rays a pixel, through the points of a Hammersley set: one in each of 4×4 squares, and no two in one row or column
//! of sixteen. Each ray that meets a surface looks at n×n points of every light, one a stratum: n = 4 up to 4 lights, 2 up to
//! 16, else 1; and at 2n×2n directions of a smooth sky. An image of the sky is a light, of which all rays of a pixel look at
//! points that stand for equal shares of its brightness. The points of the rays of one pixel are shifted against each other,
//! alike in all pixels: a pixel sees [`RAYS`]·n² points of each light, and as all pixels see the same, there is no noise, but
//! steps of 1/([`RAYS`]·n²) in penumbrae. Of more than 32 lights, each ray of a pixel looks at every k-th, k = 2, 4, 8 or 16,
//! in turn: all rays together look at each 16/k times. Of the rays that meet a surface with holes, a share passes that is
//! right to one in [`RAYS`], or in [`RAYS`]·n² towards lights.
//!
//! Mirrors and both sides of glass are followed to [`MAX_SPECULAR`] segments, down to a weight of [`MIN_WEIGHT`]. Microfacets
//! show n×n directions of the visible normals, one at deeper levels; what these meet and the points of the lights
//! share by the balance heuristic (Veach 1997, §9.2.2). On diffuse surfaces that are seen so, n is at most 2.

use crate::accel::Stack;
use crate::bsdf::{self, DELTA};
use crate::light::Aim;
use crate::material::Kind;
use crate::math::{self, Frame, Ray, Vec3};
use crate::rng::{Key, Rng};
use crate::scene::{Holes, Scene, Sky, Surface};
use noisefloor::Rgb;
use rayon::prelude::*;
use std::f32::consts::FRAC_1_PI;

/// Rays through each pixel.
const RAYS: u32 = 16;
/// Longest chain of mirrors and glass.
const MAX_SPECULAR: u32 = 10;
/// Branches that weigh less are cut.
const MIN_WEIGHT: f32 = 2e-3;

/// Renders the reference, row-major. `key` turns the points of all pixels by the same amount: another quadrature as good.
pub(crate) fn render(scene: &Scene, width: usize, height: usize, key: Key) -> Vec<Rgb> {
    let turn = Rng::new(key, 0, 0).two().map(|u| (u * RAYS as f32) as u32);
    let lens = scene.lens(width, height);
    let strata = match scene.lights.all.len() {
        0..=4 => 4,
        5..=16 => 2,
        _ => 1,
    };
    let stride = (scene.lights.all.len() / 32).clamp(1, 16).next_power_of_two();
    let first = (turn[0] as f32 + 0.5) / RAYS as f32;
    let map = scene.map().map_or(vec![], |map| map.spread(RAYS * strata * strata, first));
    let mut pixels = vec![[0.0; 3]; width * height];
    pixels.par_chunks_mut(width).with_max_len(1).enumerate().for_each(|(y, row)| {
        let stack = scene.accel.stack();
        let mut tracer = Tracer { scene, strata, shift: [0.0; 2], ray: 0, map: &map, stride, turn: 0, stack };
        for (x, pixel) in row.iter_mut().enumerate() {
            let mut sum = Vec3::ZERO;
            for i in 0..RAYS {
                let [dx, dy] = hammersley(i, RAYS);
                tracer.shift = shift(i, turn);
                tracer.ray = i;
                // Rays that are neighbours in the pixel see different lights
                tracer.turn = (i + i / 4) as usize % stride;
                let ray = lens.ray(x as f32 + dx, y as f32 + dy);
                sum += tracer.radiance(&ray, 1, Vec3::ONE, None);
            }
            *pixel = (sum / RAYS as f32).to_array();
        }
    });
    pixels
}

/// Point `i` of `n` of the Hammersley set, each in the middle of its row and column.
fn hammersley(i: u32, n: u32) -> [f32; 2] {
    let half = 0.5 / n as f32;
    [i as f32 / n as f32 + half, (i.reverse_bits() >> 8) as f32 / (1 << 24) as f32 + half]
}

/// Where the points of ray `i` lie in their strata: a Hammersley set too, run through in another order than the rays' own, and
/// turned. The rays of a pixel have all sixteen values in each direction, so that the points lie evenly whatever the turn.
fn shift(i: u32, turn: [u32; 2]) -> [f32; 2] {
    let order = [i * 5 + 3, (i * 11 + 7).reverse_bits() >> 28];
    std::array::from_fn(|k| ((order[k] + turn[k]) % RAYS) as f32 / RAYS as f32 + 0.5 / RAYS as f32)
}

struct Tracer<'a> {
    scene: &'a Scene,
    strata: u32,
    /// Where in each stratum its point lies.
    shift: [f32; 2],
    /// Which of the pixel's rays this is: decides about holes, alike in all pixels.
    ray: u32,
    /// Points of the environment map, for all rays of a pixel.
    map: &'a [(Vec3, f32)],
    /// Every how many lights the ray looks at, and the first.
    stride: usize,
    turn: usize,
    stack: Stack,
}

impl Tracer<'_> {
    /// Radiance along `ray`, times `weight`. `sampled` is the density of a direction chosen by a rough surface, with the number
    /// of directions it chose: light is then shared with the points of the lights.
    fn radiance(&mut self, ray: &Ray, depth: u32, weight: Vec3, sampled: Option<(f32, u32)>) -> Vec3 {
        let scene = self.scene;
        let hit = scene.closest::<true>(ray, &mut self.stack, Holes::Shared(self.ray));
        let points = (self.strata * self.strata) as f32;
        let share = |pdf: f32| sampled.map_or(1.0, |(p, n)| p * n as f32 / (p * n as f32 + pdf * points));
        if hit.is_miss() {
            return weight * scene.beyond(ray.dir, |pdf, _| share(pdf));
        }
        let surface = scene.surface::<true>(ray, &hit);
        let mut sum = Vec3::ZERO;
        if let Some((radiance, light, cos)) = scene.emitted::<true>(&surface, &hit, ray.dir) {
            sum += weight * radiance * share(light.pdf(ray.origin, hit.t, cos));
        }
        if surface.looks.one_sided && !surface.front {
            return sum;
        }
        let cos = (-ray.dir.dot(surface.normal)).clamp(0.0, 1.0);
        let mirrored = math::reflect(ray.dir, surface.normal);
        // Both branches of glass
        let mut split = |reflectance: f32, dir: Vec3, tint: Vec3| {
            let mut both = self.follow(&surface, mirrored, depth, weight * reflectance);
            if reflectance < 1.0 {
                both += self.follow(&surface, dir, depth, weight * tint * (1.0 - reflectance));
            }
            both
        };
        sum + match &surface.looks.kind {
            Kind::Diffuse { albedo } => {
                let n = if sampled.is_some() { self.strata.min(2) } else { self.strata };
                let normal = surface.normal;
                let lambert = |dir: Vec3| Vec3::splat(dir.dot(normal).max(0.0) * FRAC_1_PI);
                weight
                    * albedo.at::<true>(surface.uv)
                    * (self.lights(&surface, n, |dir, _| lambert(dir)) + self.dome(&surface, n, lambert))
            }
            Kind::Mirror { fresnel, colour } => {
                let factor = fresnel.at(colour.at::<true>(surface.uv), cos);
                self.follow(&surface, mirrored, depth, weight * factor)
            }
            Kind::Glass { ior, tint } => {
                let eta = if surface.front { *ior } else { 1.0 / ior };
                let (reflectance, cos_t) = bsdf::fresnel(cos, eta);
                split(reflectance, bsdf::refract(ray.dir, surface.normal, cos, cos_t, eta), *tint)
            }
            Kind::ThinGlass { ior, tint } => split(bsdf::pane(cos, *ior), ray.dir, *tint),
            Kind::Metal { .. } | Kind::Plastic { .. } | Kind::Blend { .. } => {
                self.glossy(ray, &surface, depth, weight, sampled.is_some())
            }
        }
    }

    /// Radiance from `dir`, if the chain may go on.
    fn follow(&mut self, surface: &Surface<'_>, dir: Vec3, depth: u32, weight: Vec3) -> Vec3 {
        if depth >= MAX_SPECULAR || weight.max_element() < MIN_WEIGHT {
            return Vec3::ZERO;
        }
        let ray = Ray { origin: self.scene.leave(surface, dir), dir };
        self.radiance(&ray, depth + 1, weight, None)
    }

    /// Point `i` of n×n strata of the unit square.
    fn stratum(&self, i: u32, n: u32) -> [f32; 2] {
        let cell = [(i % n) as f32, (i / n) as f32];
        std::array::from_fn(|k| ((cell[k] + self.shift[k]) / n as f32).min(1.0 - f32::EPSILON))
    }

    /// Sums `scattered` · radiance / density over the points of all lights that the surface sees.
    fn lights(&mut self, surface: &Surface<'_>, n: u32, scattered: impl Fn(Vec3, f32) -> Vec3) -> Vec3 {
        let scene = self.scene;
        let origin = scene.leave(surface, surface.flat);
        let mut sum = Vec3::ZERO;
        let shining = scene.lights.all.iter().skip(self.turn).step_by(self.stride).filter(|l| l.chance > 0.0);
        for light in shining {
            // One point is all there is of a light without size
            let n = if light.has_size() { n } else { 1 };
            for i in 0..n * n {
                let aim = if light.is_map() {
                    // Of the points of all rays, every sixteenth is this one's; where fewer are looked at, every other
                    let step = self.strata * self.strata / (n * n);
                    self.map.get((i * step * RAYS + self.ray) as usize).map(|&(dir, pdf)| Aim::far(dir, pdf))
                } else {
                    let [u, v] = self.stratum(i, n);
                    scene.aim::<true>(light, origin, [u, v, 0.0])
                };
                let Some(Aim { dir, distance, value, pdf, .. }) = aim else { continue };
                if dir.dot(surface.flat) <= 0.0 {
                    continue;
                }
                let share = scattered(dir, pdf) * value / (n * n) as f32;
                // A share that is not finite is one whose density is beyond f32
                let counts = share.max_element() > 0.0 && share.is_finite();
                let shadow = Ray { origin, dir };
                let holes = Holes::Shared(self.ray * n * n + i);
                if counts && !scene.blocked::<true>(&shadow, distance * 0.9999, &mut self.stack, holes) {
                    sum += share * scene.revealed(light, dir) * self.stride as f32;
                }
            }
        }
        sum
    }

    /// Sums `scattered` · radiance / density over directions of a smooth sky that the surface sees. An image is a light.
    fn dome(&mut self, surface: &Surface<'_>, n: u32, scattered: impl Fn(Vec3) -> Vec3) -> Vec3 {
        let Some(Sky::Dome(dome)) = &self.scene.sky else { return Vec3::ZERO };
        let mut sum = Vec3::ZERO;
        let (n, frame) = (2 * n, Frame::new(surface.normal));
        for i in 0..n * n {
            let local = math::cosine_hemisphere(self.stratum(i, n));
            let dir = frame.to_world(local);
            if dir.dot(surface.flat) > 0.0 {
                let ray = Ray { origin: self.scene.leave(surface, dir), dir };
                let holes = Holes::Shared(self.ray * n * n + i);
                if !self.scene.blocked::<true>(&ray, f32::INFINITY, &mut self.stack, holes) {
                    let pdf = local.z.max(1e-6) * FRAC_1_PI;
                    sum += scattered(dir) * dome.radiance(dir) / (pdf * (n * n) as f32);
                }
            }
        }
        sum
    }

    /// Microfacets and coats: what the facets mirror, and direct light on the base.
    fn glossy(
        &mut self,
        ray: &Ray,
        surface: &Surface<'_>,
        depth: u32,
        weight: Vec3,
        seen_blurred: bool,
    ) -> Vec3 {
        let frame = Frame::new(surface.normal);
        let wo = frame.to_local(-ray.dir);
        let Some(glossy) = surface.glossy::<true>(wo.z) else { return Vec3::ZERO };
        let (n, points) =
            (if depth == 1 { self.strata.max(2) } else { 1 }, (self.strata * self.strata) as f32);
        let directions = (n * n) as f32;
        let follows = depth < MAX_SPECULAR && weight.max_element() >= MIN_WEIGHT;

        let mut sum = weight
            * self.lights(surface, self.strata, |dir, pdf| {
                let wi = frame.to_local(dir);
                let (facets, chosen) = glossy.facets(wo, wi);
                let rival = if follows && pdf < DELTA { chosen * directions / (pdf * points) } else { 0.0 };
                glossy.base(wi) + facets / (1.0 + rival)
            });
        let n_base = if seen_blurred { self.strata.min(2) } else { self.strata };
        sum += weight * self.dome(surface, n_base, |dir| glossy.base(frame.to_local(dir)));
        for i in 0..if follows { n * n } else { 0 } {
            let Some((wi, factor, pdf)) = glossy.reflect(wo, self.stratum(i, n)) else { continue };
            let dir = frame.to_world(wi).normalize();
            if dir.dot(surface.flat) <= 0.0 {
                continue;
            }
            let ray = Ray { origin: self.scene.leave(surface, dir), dir };
            if pdf == DELTA {
                return sum + self.radiance(&ray, depth + 1, weight * factor, None);
            }
            sum += self.radiance(&ray, depth + 1, weight * factor / directions, Some((pdf, n * n)));
        }
        sum
    }
}
