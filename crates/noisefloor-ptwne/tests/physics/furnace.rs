//! Furnaces: closed rooms and uniform surroundings, where radiance is known.

use crate::kit::{agrees, look, mean, scene};
use noisefloor_ptwne::{Emission, Environment, Material, Options, SceneBuilder};

const UP: [f32; 3] = [0.0, 1.0, 0.0];

/// Inside a closed room of albedo ρ that gives off L everywhere, radiance is L + ρL + ρ²L + … = L/(1 − ρ).
#[test]
fn closed_rooms_have_the_radiance_of_the_geometric_series() {
    let camera = look([0.1, 0.05, 0.2], [0.0, 0.0, -1.0], UP, 60.0);
    let light = || Some(Emission::two_sided([0.5, 0.5, 0.5]));
    let sphere = |b: &mut SceneBuilder| {
        let m = b.material(Material::diffuse([0.6, 0.3, 0.0])).unwrap();
        b.sphere([0.0; 3], 1.0, m, light()).unwrap();
    };
    let cube = |b: &mut SceneBuilder| {
        let m = b.material(Material::diffuse([0.6, 0.3, 0.0])).unwrap();
        let (x, y, z) = ([2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 2.0]);
        for (e1, e2) in [(x, y), (y, z), (z, x)] {
            b.parallelogram([-1.0; 3], e1, e2, m, light()).unwrap();
            let e3: [f32; 3] = std::array::from_fn(|i| 1.0 - e1[i] - e2[i]);
            b.parallelogram(e3, e1, e2, m, light()).unwrap();
        }
    };
    for mis in [true, false] {
        let options = Options { mis, seed: 3, ..Options::default() };
        for (channel, albedo) in [(0, 0.6), (1, 0.3)] {
            // The offset of ray origins and 0.9999 of shadow rays: less than 1e-3 of the light is lost in corners
            agrees(mean(scene(camera, sphere), 8, 64, 40, channel, options), 0.5 / (1.0 - albedo), 1e-3);
            agrees(mean(scene(camera, cube), 8, 64, 40, channel, options), 0.5 / (1.0 - albedo), 1e-3);
        }
    }
}

/// A lossless convex body in surroundings of radiance 1 has radiance 1 everywhere: it cannot be seen.
#[test]
fn lossless_balls_cannot_be_seen() {
    let mirror = Material::Mirror { reflectance: [1.0; 3] };
    let polished = Material::RoughConductor { reflectance: [1.0; 3].into(), roughness: 0.0 };
    for material in
        [Material::diffuse([1.0; 3]), mirror, Material::Glass { ior: 1.5, tint: [1.0; 3] }, polished]
    {
        let scene = scene(look([0.0, 0.0, 4.0], [0.0; 3], UP, 40.0), |b| {
            let m = b.material(material.clone()).unwrap();
            b.sphere([0.0; 3], 1.0, m, None).unwrap();
            b.environment(Environment::constant([1.0; 3])).unwrap();
        });
        // Without roulette every sample is exactly 1, up to rounding and light still inside the glass after 65 segments
        let options = Options { roulette: 1000, ..Options::default() };
        let (radiance, _) = mean(scene, 24, 2, 16, 1, options);
        assert!((radiance - 1.0).abs() < 1e-5, "{material:?}: {radiance}");
    }
}

/// Directional albedo of single-scattering GGX with F = 1, by midpoint rule over the hemisphere, in f64, written from
/// Walter et al. 2007 and Heitz 2014 independently of the renderer.
fn directional_albedo(alpha: f64, cos_o: f64) -> f64 {
    let n = 1200;
    let (wo, a2) = ([(1.0 - cos_o * cos_o).sqrt(), 0.0, cos_o], alpha * alpha);
    let lambda = |cos: f64| 0.5 * ((1.0 + a2 * (1.0 / (cos * cos) - 1.0)).sqrt() - 1.0);
    let half_pi = std::f64::consts::FRAC_PI_2;
    let mut sum = 0.0;
    for i in 0..n {
        let (sin_i, cos_i) = ((i as f64 + 0.5) / n as f64 * half_pi).sin_cos();
        for j in 0..n {
            let phi = (j as f64 + 0.5) / n as f64 * 2.0 * half_pi; // half a turn: symmetric
            let h = [wo[0] + sin_i * phi.cos(), sin_i * phi.sin(), wo[2] + cos_i];
            let cos2_h = h[2] * h[2] / h.iter().map(|x| x * x).sum::<f64>();
            let d = a2 / (std::f64::consts::PI * (cos2_h * (a2 - 1.0) + 1.0).powi(2));
            let g = 1.0 / (1.0 + lambda(cos_o) + lambda(cos_i));
            sum += d * g / (4.0 * cos_o) * sin_i;
        }
    }
    sum * 2.0 * half_pi * 2.0 * half_pi / f64::from(n * n)
}

/// A rough conductor with F = 1 loses what its microfacets mask, and no more.
#[test]
fn rough_conductors_lose_what_is_masked() {
    for (roughness, degrees) in [(0.2f32, 20.0f32), (0.5, 50.0), (1.0, 0.1), (1.0, 75.0)] {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let camera = look([4.0 * sin, 4.0 * cos, 0.0], [0.0; 3], [0.0, 0.1, 1.0], 0.5);
        let scene = scene(camera, |b| {
            let metal = Material::RoughConductor { reflectance: [1.0; 3].into(), roughness };
            let m = b.material(metal).unwrap();
            b.parallelogram([-9.0, 0.0, -9.0], [0.0, 0.0, 18.0], [18.0, 0.0, 0.0], m, None).unwrap();
            b.environment(Environment::constant([1.0; 3])).unwrap();
        });
        let expected = directional_albedo(f64::from(roughness), f64::from(cos));
        assert!(expected < 1.0 + 1e-4);
        // The bias covers the quadrature
        agrees(mean(scene, 4, 64, 200, 0, Options::default()), expected, 1e-3);
    }
}
