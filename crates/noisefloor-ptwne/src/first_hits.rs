//! Albedo and normals of what camera rays meet first: auxiliary pictures for denoisers.

use crate::accel::Stack;
use crate::filter::Filter;
use crate::intersection::OpacityTest;
use crate::math::{Ray, Vec3};
use crate::rng::{Key, mix};
use crate::sampler::{Place, Sampler, Sampling};
use crate::scene::Scene;
use noisefloor::{Rgb, source::FirstHits};
use rayon::prelude::*;

/// Keeps the random numbers of these pictures apart from those of paths.
const APART: u64 = 0x6669_7273_7468_6974;

/// Renders a picture from `spp` rays a pixel, at least 1. They are Owen-scrambled Sobol points in any case: that
/// has less noise, and different scramblings are independent.
pub(crate) fn render(
    scene: &Scene,
    (width, height): (usize, usize),
    filter: Filter,
    (seed, index): (u64, u64),
    spp: u64,
) -> FirstHits {
    let key = Key::new(mix(seed ^ APART).wrapping_add(index));
    let lens = scene.lens(width, height);
    let pixel = |x: usize, y: usize, stack: &mut Stack| {
        let mut sums = (glam::DVec3::ZERO, glam::DVec3::ZERO);
        for k in 0..spp {
            let mut sampler = Sampler::new(Sampling::Sobol, key, (y * width + x) as u64, Place::only(k));
            let [u, v, lens_u, lens_v] = sampler.four();
            let [dx, dy] = filter.offset([u, v]);
            let ray = lens.ray(x as f32 + dx, y as f32 + dy, [lens_u, lens_v]);
            let (albedo, normal) = first_hit(scene, &ray, sampler.seed(), stack);
            sums = (sums.0 + albedo.as_dvec3(), sums.1 + normal.as_dvec3());
        }
        let mean = |sum: glam::DVec3| (sum / spp as f64).as_vec3().to_array();
        (mean(sums.0), mean(sums.1))
    };
    let rows: Vec<Vec<(Rgb, Rgb)>> = (0..height)
        .into_par_iter()
        .map_init(|| scene.bvh.stack(), |stack, y| (0..width).map(|x| pixel(x, y, stack)).collect())
        .collect();
    let (albedo, normal) = rows.into_iter().flatten().unzip();
    FirstHits { width, height, albedo, normal }
}

/// Albedo and normal of what the ray meets. The background is its own colour, and has no normal.
fn first_hit(scene: &Scene, ray: &Ray, seed: u64, stack: &mut Stack) -> (Vec3, Vec3) {
    // A scene without opacity passes every test of it
    let hit = scene.closest::<true>(ray, stack, OpacityTest::Random(seed));
    let (colour, normal) = if hit.is_miss() {
        (scene.background(ray.dir, |_, _| 1.0), Vec3::ZERO)
    } else {
        let surface = scene.surface(ray, &hit);
        (surface.material.bsdf.colour(surface.uv, surface.tint), surface.normal)
    };
    // NaN becomes 0, too
    (colour.max(Vec3::ZERO).min(Vec3::ONE), normal)
}
