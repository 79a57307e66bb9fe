//! Albedo and normals of what camera rays meet first: auxiliary pictures for denoisers.
//!
//! Behind smooth glass, and in mirrors, that is the first surface that scatters: its albedo times what is reflected
//! and let through on the way, both ways of a boundary blended by Fresnel's equations, as the manual of Open Image
//! Denoise advises. Both ways are followed, so that glass adds no noise.

use crate::accel::Stack;
use crate::bsdf::{fresnel, pane, refract};
use crate::filter::Filter;
use crate::geometry::{Intersection, NO};
use crate::material::Bsdf;
use crate::math::{Ray, Vec3, reflect};
use crate::rng::{Key, mix};
use crate::sampler::{Draws, Place, Sampler, Sampling};
use crate::scene::Scene;
use noisefloor::{Rgb, source::FirstHits};
use rayon::prelude::*;

/// Keeps the random numbers of these pictures apart from those of paths.
const APART: u64 = 0x6669_7273_7468_6974;
/// Rays of a pixel between two looks at what they scatter by.
const LOOK: u64 = 16;
/// A pixel has rays enough when no value of its mean has a standard error beyond this, as if rays were
/// independent; they are stratified, and better.
const CLEAN: f64 = 1.0 / 32.0;
/// A way of less weight is not followed, and the other one stands for both.
const LEAST: f32 = 1.0 / 64.0;
/// Smooth boundaries in a row that are followed.
const BOUNDARIES: u32 = 16;

/// Renders a picture from up to `spp` rays a pixel, at least 1: fewer where they agree. They are Owen-scrambled
/// Sobol points in any case: that has less noise, and different scramblings are independent.
pub(crate) fn render(
    scene: &Scene,
    (width, height): (usize, usize),
    filter: Filter,
    (seed, index): (u64, u64),
    spp: u64,
) -> FirstHits {
    let key = Key::new(mix(seed ^ APART).wrapping_add(index));
    let lens = scene.lens(width, height);
    let pixel = |x: usize, y: usize, eye: &mut Eye<'_>| {
        let mut seen = Mean::default();
        while seen.rays < spp && !(seen.rays % LOOK == 0 && seen.is_clean()) {
            let place = Place::only(seen.rays);
            let mut sampler = Sampler::new(Sampling::Sobol, key, (y * width + x) as u64, place);
            let [u, v, lens_u, lens_v] = sampler.four();
            let [dx, dy] = filter.offset([u, v]);
            let ray = lens.ray(x as f32 + dx, y as f32 + dy, [lens_u, lens_v]);
            seen.add(eye.look(ray, sampler.draws()));
        }
        seen.means()
    };
    let rows: Vec<Vec<(Rgb, Rgb)>> = (0..height)
        .into_par_iter()
        .map_init(|| Eye::new(scene), |eye, y| (0..width).map(|x| pixel(x, y, eye)).collect())
        .collect();
    let (albedo, normal) = rows.into_iter().flatten().unzip();
    FirstHits::new((width, height), albedo, normal)
}

/// Means of albedo and normal over the rays of a pixel, and what they scatter by.
#[derive(Default)]
struct Mean {
    rays: u64,
    sums: [f64; 6],
    squares: [f64; 6],
}

impl Mean {
    fn add(&mut self, (albedo, normal): (Vec3, Vec3)) {
        self.rays += 1;
        let values = albedo.to_array().into_iter().chain(normal.to_array()).map(f64::from);
        for ((sum, square), value) in self.sums.iter_mut().zip(&mut self.squares).zip(values) {
            *sum += value;
            *square += value * value;
        }
    }

    fn is_clean(&self) -> bool {
        let rays = self.rays as f64;
        let variance = |(sum, square): (&f64, &f64)| square / rays - (sum / rays).powi(2);
        self.rays > 0 && self.sums.iter().zip(&self.squares).map(variance).all(|v| v <= CLEAN * CLEAN * rays)
    }

    fn means(&self) -> (Rgb, Rgb) {
        let [r, g, b, x, y, z] = self.sums.map(|sum| (sum / self.rays as f64) as f32);
        ([r, g, b], [x, y, z])
    }
}

/// A ray on its way from boundary to boundary.
struct Way {
    ray: Ray,
    /// What has become of white light along it, by colour; and its share of the pixel.
    colour: Vec3,
    share: f32,
    boundaries: u32,
}

/// Follows rays to the first surface that scatters.
struct Eye<'a> {
    scene: &'a Scene,
    stack: Stack,
    ways: Vec<Way>,
}

impl<'a> Eye<'a> {
    fn new(scene: &'a Scene) -> Self {
        Self { scene, stack: scene.bvh.stack(), ways: Vec::new() }
    }

    /// Albedo and normal of what the ray shows. The background is its own colour, and has no normal.
    fn look(&mut self, ray: Ray, mut draws: Draws) -> (Vec3, Vec3) {
        let (mut albedo, mut normal) = (Vec3::ZERO, Vec3::ZERO);
        self.ways.push(Way { ray, colour: Vec3::ONE, share: 1.0, boundaries: 0 });
        while let Some(way) = self.ways.pop() {
            draws = draws.next();
            // A scene without opacity passes every test of it
            let hit = self.scene.closest::<true>(&way.ray, &mut self.stack, draws);
            if hit.is_miss() {
                let background = match way.boundaries {
                    0 => self.scene.backdrop(way.ray.dir),
                    _ => self.scene.background(way.ray.dir, |_, _| 1.0),
                };
                // NaN becomes 0, too
                albedo += way.colour * background.max(Vec3::ZERO).min(Vec3::ONE);
                continue;
            }
            let surface = self.scene.surface(&way.ray, &hit, draws);
            if way.boundaries == 0 && surface.light != NO && self.scene.optics.hides_lights {
                let ray = Ray { origin: surface.leave(way.ray.dir), ..way.ray };
                self.ways.push(Way { ray, ..way });
                continue;
            }
            if way.boundaries == BOUNDARIES || !self.passes(&way, &surface) {
                let colour = surface.material.bsdf.colour(surface.uv, surface.tint);
                albedo += way.colour * colour.max(Vec3::ZERO).min(Vec3::ONE);
                normal += way.share * surface.normal;
            }
        }
        (albedo.max(Vec3::ZERO).min(Vec3::ONE), normal)
    }

    /// Follows what a smooth boundary reflects and lets through. False for other surfaces.
    fn passes(&mut self, way: &Way, surface: &Intersection<'_>) -> bool {
        let (dir, n) = (way.ray.dir, surface.normal);
        let cos = (-dir.dot(n)).clamp(0.0, 1.0);
        let reflected = reflect(dir, n);
        match &surface.material.bsdf {
            Bsdf::Mirror { fresnel, colour } => {
                let colour = fresnel.at(colour.tinted(surface.uv, surface.tint), cos);
                self.follow(way, surface, reflected, colour, 1.0);
            }
            Bsdf::Glass { ior, tint } => {
                let eta = if surface.front { *ior } else { 1.0 / ior };
                let (reflectance, cos_t) = fresnel(cos, eta);
                let through = refract(dir, n, cos, cos_t, eta);
                // A shading normal must not send through the surface what stays in front of it
                let reflectance = if through.dot(surface.flat) < 0.0 { reflectance } else { 1.0 };
                self.both(way, surface, (reflectance, reflected), (through, *tint));
            }
            Bsdf::ThinGlass { ior, tint } => {
                self.both(way, surface, (pane(cos, *ior), reflected), (dir, *tint));
            }
            Bsdf::Nothing => self.follow(way, surface, dir, Vec3::ONE, 1.0),
            _ => return false,
        }
        true
    }

    /// Both ways of a boundary that reflects this share, unless one of them hardly counts.
    fn both(
        &mut self,
        way: &Way,
        surface: &Intersection<'_>,
        (reflectance, reflected): (f32, Vec3),
        (through, tint): (Vec3, Vec3),
    ) {
        let share = match reflectance {
            r if r * way.share < LEAST => 0.0,
            r if (1.0 - r) * way.share < LEAST => 1.0,
            r => r,
        };
        if share > 0.0 {
            self.follow(way, surface, reflected, Vec3::splat(share), share);
        }
        if share < 1.0 {
            self.follow(way, surface, through, tint * (1.0 - share), 1.0 - share);
        }
    }

    fn follow(&mut self, way: &Way, surface: &Intersection<'_>, dir: Vec3, colour: Vec3, share: f32) {
        self.ways.push(Way {
            ray: Ray { origin: surface.leave(dir), dir },
            colour: way.colour * colour,
            share: way.share * share,
            boundaries: way.boundaries + 1,
        });
    }
}
