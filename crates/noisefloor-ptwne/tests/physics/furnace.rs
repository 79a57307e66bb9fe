//! Furnaces: closed rooms and uniform surroundings, in which the radiance is known.

use crate::kit::{UP, agrees, albedo, look, mean, scene};
use noisefloor_ptwne::{Emission, Environment, Estimator, Material, RenderOptions, SceneBuilder};

/// Inside a closed room of albedo ρ that emits L everywhere, the radiance is L + ρL + ρ²L + … = L/(1 − ρ).
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
    for estimator in [Estimator::Mis, Estimator::NextEvents, Estimator::BruteForce] {
        let options = RenderOptions { estimator, seed: 3, ..RenderOptions::default() };
        for (channel, albedo) in [(0, 0.6), (1, 0.3)] {
            // Corners lose less than 1e-3 of the light, by the offset of ray origins and since shadow rays
            // end at 0.9999
            agrees(mean(scene(camera, sphere), 8, 64, 40, channel, options), 0.5 / (1.0 - albedo), 1e-3);
            agrees(mean(scene(camera, cube), 8, 64, 40, channel, options), 0.5 / (1.0 - albedo), 1e-3);
        }
    }
}

/// A lossless convex body in surroundings of radiance 1 has radiance 1 everywhere, so that it cannot be seen.
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
        // Without roulette every sample is exactly 1, up to rounding and light still inside the glass after
        // 65 segments
        let options = RenderOptions { roulette: 1000, ..RenderOptions::default() };
        let (radiance, _) = mean(scene, 24, 2, 16, 1, options);
        assert!((radiance - 1.0).abs() < 1e-5, "{material:?}: {radiance}");
    }
}

/// Reflectance of a boundary with the index of refraction η + ik, from Fresnel's equations with complex
/// numbers.
fn reflectance(cos: f64, eta: f64, k: f64) -> f64 {
    type C = [f64; 2];
    let mul = |a: C, b: C| [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]];
    let norm = |a: C| a[0] * a[0] + a[1] * a[1];
    let n = [eta, k];
    let n2 = mul(n, n);
    // cos of refraction: √(1 − sin²/n²)
    let sin2 = 1.0 - cos * cos;
    let c2 = [1.0 - sin2 * n2[0] / norm(n2), sin2 * n2[1] / norm(n2)];
    let length = norm(c2).sqrt();
    let cos_t = [((length + c2[0]) / 2.0).max(0.0).sqrt(), ((length - c2[0]) / 2.0).max(0.0).sqrt()];
    let (n_cos, n_cos_t) = ([eta * cos, k * cos], mul(n, cos_t));
    let perpendicular = norm([cos - n_cos_t[0], -n_cos_t[1]]) / norm([cos + n_cos_t[0], n_cos_t[1]]);
    let parallel =
        norm([n_cos[0] - cos_t[0], n_cos[1] - cos_t[1]]) / norm([n_cos[0] + cos_t[0], n_cos[1] + cos_t[1]]);
    0.5 * (perpendicular + parallel)
}

/// Schlick's approximation.
fn schlick(f0: f64, cos: f64) -> f64 {
    f0 + (1.0 - f0) * (1.0 - cos).powi(5)
}

/// Directional albedo of single-scattering GGX with a Fresnel term, and masking as a function of Smith's Λ of both
/// directions, by midpoint rule over the hemisphere, in
/// f64, written from Walter et al. 2007 and Heitz 2014 independently of the renderer.
fn masked_albedo(
    alpha: f64,
    cos_o: f64,
    n: u32,
    fresnel: impl Fn(f64) -> f64,
    masking: fn(f64, f64) -> f64,
) -> f64 {
    let (wo, a2) = ([(1.0 - cos_o * cos_o).sqrt(), 0.0, cos_o], alpha * alpha);
    let lambda = |cos: f64| 0.5 * ((1.0 + a2 * (1.0 / (cos * cos) - 1.0)).sqrt() - 1.0);
    let half_pi = std::f64::consts::FRAC_PI_2;
    let mut sum = 0.0;
    for i in 0..n {
        let (sin_i, cos_i) = ((f64::from(i) + 0.5) / f64::from(n) * half_pi).sin_cos();
        let g = masking(lambda(cos_o), lambda(cos_i));
        for j in 0..n {
            let phi = (f64::from(j) + 0.5) / f64::from(n) * 2.0 * half_pi; // half a turn: symmetric
            let h = [wo[0] + sin_i * phi.cos(), sin_i * phi.sin(), wo[2] + cos_i];
            let length2 = h.iter().map(|x| x * x).sum::<f64>();
            let d = a2 / (std::f64::consts::PI * (h[2] * h[2] / length2 * (a2 - 1.0) + 1.0).powi(2));
            // wo·h of the half vector of length 1
            sum += d * g / (4.0 * cos_o) * sin_i * fresnel(0.5 * length2.sqrt());
        }
    }
    sum * 2.0 * half_pi * 2.0 * half_pi / f64::from(n * n)
}

/// Height-correlated masking (Heitz 2014).
fn correlated(o: f64, i: f64) -> f64 {
    1.0 / (1.0 + o + i)
}

/// A rough conductor with F = 1 loses only what its microfacets mask.
#[test]
fn rough_conductors_lose_what_is_masked() {
    for (roughness, degrees) in [(0.2f32, 20.0f32), (0.5, 50.0), (1.0, 0.1), (1.0, 75.0), (0.1, 85.0)] {
        let metal = Material::RoughConductor { reflectance: [1.0; 3].into(), roughness };
        let cos = f64::from(degrees.to_radians().cos());
        let expected = masked_albedo(f64::from(roughness), cos, 1200, |_| 1.0, correlated);
        assert!(expected < 1.0 + 1e-4);
        // The bias covers the quadrature
        agrees(albedo(&metal, degrees, 200), expected, 1e-3);
    }
}

/// Smooth boundaries reflect and transmit by Fresnel's equations, and diffuse surfaces by their albedo.
#[test]
fn smooth_surfaces_are_fresnels() {
    for degrees in [0.1f32, 40.0, 80.0] {
        let cos = f64::from(degrees.to_radians().cos());
        // The field of view is 0.5°: at 80° that is 1e-3 of a reflectance
        let test =
            |material: Material, expected: f64| agrees(albedo(&material, degrees, 100), expected, 2e-3);
        test(Material::diffuse([0.7; 3]), 0.7);
        test(Material::Mirror { reflectance: [0.9; 3] }, 0.9);
        let r = reflectance(cos, 1.5, 0.0);
        // Behind the boundary radiance is η² times that of the sky it comes from
        test(Material::Glass { ior: 1.5, tint: [0.8; 3] }, r + (1.0 - r) * 0.8 / 2.25);
        // Two boundaries: r + t² r (1 + r² + r⁴ + …), t = 1 − r
        let both = r + (1.0 - r) * (1.0 - r) * r / (1.0 - r * r);
        test(Material::ThinGlass { ior: 1.5, tint: [0.8; 3] }, both + (1.0 - both) * 0.8);
        for (eta, k) in [(0.2, 3.9), (2.9, 3.0), (1.5, 0.0)] {
            let metal = Material::Conductor {
                eta: [eta as f32; 3],
                k: [k as f32; 3],
                reflectance: [1.0; 3].into(),
                roughness: 0.0,
            };
            test(metal, reflectance(cos, eta, k));
        }
        let polished = Material::RoughConductor { reflectance: [0.4; 3].into(), roughness: 0.0 };
        test(polished, schlick(0.4, cos));
    }
}

/// Coloured rough conductors reflect the mean of the Fresnel term over visible microfacets, and never more
/// than they receive.
#[test]
fn rough_conductors_are_fresnels_over_facets() {
    for (roughness, degrees) in [(0.15f32, 30.0f32), (0.5, 70.0), (1.0, 10.0)] {
        let (alpha, cos) = (f64::from(roughness), f64::from(degrees.to_radians().cos()));
        let schlicks = Material::RoughConductor { reflectance: [0.5; 3].into(), roughness };
        let expected = masked_albedo(alpha, cos, 800, |c| schlick(0.5, c), correlated);
        agrees(albedo(&schlicks, degrees, 200), expected, 2e-3);
        let (eta, k, reflectances) = ([0.2; 3], [3.9; 3], [1.0; 3].into());
        let gold = Material::Conductor { eta, k, reflectance: reflectances, roughness };
        let expected = masked_albedo(alpha, cos, 800, |c| reflectance(c, 0.2, 3.9), correlated);
        assert!(expected < 1.0);
        agrees(albedo(&gold, degrees, 200), expected, 2e-3);
    }
}

fn plastic(albedo: f32, roughness: f32, nonlinear: bool) -> Material {
    Material::Plastic { diffuse: [albedo; 3].into(), specular: [1.0; 3], ior: 1.5, roughness, nonlinear }
}

/// What a coat reflects of light from one direction, and what comes out of a base of albedo ρ: light that
/// entered is reflected by the base and the inside of the coat in turn until it leaves.
fn coated(reflected: f64, albedo: f64, inner: f64) -> f64 {
    reflected + (1.0 - reflected) * albedo * (1.0 - inner) / (1.0 - albedo * inner)
}

#[test]
fn smooth_coats_keep_the_light_of_their_base() {
    // Diffuse light from inside: 2∫R(μ)μ dμ, with total reflection beyond the critical angle
    let n = 20_000;
    let inner: f64 = (0..n)
        .map(|i| {
            let cos = (f64::from(i) + 0.5) / f64::from(n);
            let sin2 = 2.25 * (1.0 - cos * cos);
            // By reciprocity, as from outside at the refracted angle
            let r = if sin2 >= 1.0 { 1.0 } else { reflectance((1.0 - sin2).sqrt(), 1.5, 0.0) };
            2.0 * r * cos / f64::from(n)
        })
        .sum();
    for degrees in [0.1f32, 55.0, 80.0] {
        let r = reflectance(f64::from(degrees.to_radians().cos()), 1.5, 0.0);
        for rho in [1.0f32, 0.5] {
            let albedo_of = |nonlinear| albedo(&plastic(rho, 0.0, nonlinear), degrees, 200);
            // The coat's table is accurate to 1e-3, and the view is 0.5° wide
            agrees(albedo_of(true), coated(r, f64::from(rho), inner), 3e-3);
            agrees(albedo_of(false), r + (1.0 - r) * f64::from(rho), 3e-3);
        }
    }
}

/// What Mitsuba 3.9.1's `roughplastic` (GGX, nonlinear, index 1.5) reflects of a white sky: the mean weight
/// of 2²⁰ of its own samples, accurate to 1e-3. Its facets mask by a product of two terms, ours by the
/// height-correlated one; the difference is found by quadrature. Tables of 64 steps in both renderers leave half a
/// percent.
#[test]
fn rough_coats_reflect_what_mitsubas_do() {
    for (base, alpha, mitsuba) in [
        (0.8f32, 0.2f32, [0.5469, 0.5475, 0.554, 0.5631]),
        (0.2, 0.2, [0.1247, 0.1332, 0.1715, 0.238]),
        (0.5, 0.1, [0.3089, 0.3165, 0.3629, 0.4563]),
    ] {
        for (cos, mitsuba) in [0.95f32, 0.7, 0.4, 0.15].into_iter().zip(mitsuba) {
            let facets = |masking: fn(f64, f64) -> f64| {
                masked_albedo(f64::from(alpha), f64::from(cos), 600, |c| reflectance(c, 1.5, 0.0), masking)
            };
            let expected = mitsuba + facets(correlated) - facets(|o, i| 1.0 / ((1.0 + o) * (1.0 + i)));
            let (got, error) = albedo(&plastic(base, alpha, true), cos.acos().to_degrees(), 200);
            let tolerance = 5.0 * error + 1e-3 + 5e-3 * expected;
            assert!((got - expected).abs() < tolerance, "{base} {alpha} {cos}: {got} ± {error}, {expected}");
        }
    }
}
