//! Scattering against quadrature, reciprocity and known angles.

use super::Glossy;
use super::fresnel::fresnel;
use super::ggx::{Facets, Ggx};
use crate::geometry::Intersection;
use crate::geometry::NO;
use crate::material::{CompiledMaterial, Dialect, Gloss, Lobes, Material, MaterialOptions, Principled};
use crate::math::{self, DELTA, Vec3};
use crate::rng::{Key, Rng};
use crate::texture::Texture;
use std::f32::consts::PI;

/// ∫ density over the hemisphere and ∫ f·cos agree with the sampled weights: both by midpoint rule over (θ,
/// φ).
#[test]
fn facets_are_sampled_as_they_are_evaluated() {
    let (ggx, beckmann) = (Facets::Ggx, Facets::BeckmannUncorrelated);
    for (facets, alpha, cos) in [
        (ggx, 0.15f32, 0.9f32),
        (ggx, 0.5, 0.7),
        (ggx, 1.0, 0.3),
        (beckmann, 0.15, 0.9),
        (beckmann, 0.5, 0.7),
        (beckmann, 1.0, 0.3),
        (beckmann, 0.15, 0.15),
    ] {
        let ggx = Ggx::of(alpha, facets);
        let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
        let n = 1500;
        let (mut albedo, mut mass) = (0.0, 0.0);
        for i in 0..n {
            // Uniform in cos θ would waste points on the lobe: use θ
            let theta = (i as f32 + 0.5) / n as f32 * 0.5 * PI;
            for j in 0..n {
                let phi = (j as f32 + 0.5) / n as f32 * 2.0 * PI;
                let wi = Vec3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos());
                let (f, pdf, _) = ggx.eval(wo, wi);
                let area = f64::from(theta.sin()) * (0.5 * PI * 2.0 * PI) as f64 / f64::from(n * n);
                albedo += f64::from(f) * area;
                mass += f64::from(pdf) * area;
            }
        }
        let m = 1000;
        let (mut sampled, mut alive) = (0.0, 0.0);
        for i in 0..m * m {
            let u = [((i / m) as f32 + 0.5) / m as f32, ((i % m) as f32 + 0.5) / m as f32];
            let (_, weight, _) = ggx.sample(wo, u);
            sampled += f64::from(weight) / f64::from(m * m);
            alive += f64::from(u8::from(weight > 0.0)) / f64::from(m * m);
        }
        // Both quadratures are good to 1e-3 here: the integrands are smooth at the scale of the grids. Λ of
        // Beckmann's facets is an approximation, good to 0.35 %
        let good = if facets == beckmann { 4e-3 } else { 2e-3 };
        assert!((albedo - sampled).abs() < good, "{facets:?}, α {alpha}: {albedo} {sampled}");
        assert!((mass - alive).abs() < good, "{facets:?}, α {alpha}: {mass} {alive}");
    }
}

/// Metals, coats, blends of them, and sums of lobes, from smooth to rough.
fn zoo() -> Vec<(Material, CompiledMaterial)> {
    let colour = [0.9, 0.5, 0.2];
    let mut all = vec![];
    for roughness in [0.1, 0.3, 1.0] {
        all.push(Material::RoughConductor { reflectance: colour.into(), roughness });
        all.push(Material::Conductor {
            eta: [0.2, 0.9, 1.2],
            k: [3.9, 2.4, 1.8],
            reflectance: [1.0; 3].into(),
            roughness,
        });
    }
    for (roughness, nonlinear) in [(0.0, false), (0.0, true), (0.1, true), (0.6, false)] {
        let (diffuse, specular) = (colour.into(), [1.0, 0.8, 0.6]);
        all.push(Material::Plastic { diffuse, specular, ior: 1.5, roughness, nonlinear });
    }
    for (roughness, metal) in [(0.3, 0.0), (0.5, 0.4), (0.9, 1.0)] {
        let metallic_roughness = [0.0, roughness, metal].into();
        all.push(Material::MetallicRoughness { base: colour.into(), metallic_roughness, ior: 1.5 });
    }
    for (gloss, sigma, roughness) in [
        (Gloss::Dielectric { ior: 1.5 }, 0.0, 0.3),
        (Gloss::Dielectric { ior: 1.0 / 1.5 }, 0.6, 0.1),
        (Gloss::AshikhminShirley, 0.0, 0.2),
    ] {
        let [diffuse, through, specular] = [colour, [0.3; 3], [0.4, 0.3, 0.2]].map(Texture::Colour);
        let mirror = Texture::Colour([0.2; 3]);
        all.push(Lobes { diffuse, through, specular, mirror, gloss, sigma, roughness }.into());
    }
    for (dialect, roughness, metal) in [(Dialect::Mitsuba, 0.4, 0.3), (Dialect::Pbrt, 0.7, 0.0)] {
        let (metallic_roughness, plain) = ([0.0, roughness, metal].into(), Principled::default());
        let one = Principled { base: colour.into(), metallic_roughness, dialect, ..plain };
        let other = Principled { anisotropic: 0.7, specular_tint: 0.5, flatness: 0.3, ..one.clone() };
        let coated =
            Principled { sheen: 0.8, sheen_tint: 0.5, clearcoat: 1.0, clearcoat_gloss: 0.5, ..one.clone() };
        all.extend([one, other, coated].map(Material::from));
    }
    let compile = |m, facets, roughness| {
        let options = MaterialOptions { facets, roughness, ..MaterialOptions::default() };
        CompiledMaterial::new(m, options, &mut vec![]).unwrap()
    };
    let two = [Facets::Ggx, Facets::BeckmannUncorrelated];
    let along = || Some(Texture::Colour([0.5, 0.15, 0.0]));
    let mut compiled = vec![];
    for m in all {
        compiled.extend(two.map(|facets| (m.clone(), compile(m.clone(), facets, None))));
        if !matches!(m, Material::MetallicRoughness { .. } | Material::Principled(_)) {
            compiled.extend(two.map(|facets| (m.clone(), compile(m.clone(), facets, along()))));
        }
    }
    compiled
}

/// The microfacets and coat of a material, seen from `wo`.
fn seen(material: &CompiledMaterial, wo: Vec3) -> Glossy<'_> {
    let (position, up, uv) = (Vec3::ZERO, Vec3::Z, [0.0; 4]);
    let surface = Intersection {
        position,
        flat: up,
        normal: up,
        front: true,
        uv,
        along: Vec3::ZERO,
        tint: Vec3::ONE,
        material,
        light: NO,
        offset: 0.0,
    };
    surface.glossy(wo.z).unwrap()
}

#[test]
fn scattering_is_reciprocal() {
    let mut rng = Rng::new(Key::new(5), 0, 0);
    let mut direction = || {
        let w = math::sphere(rng.two());
        Vec3::new(w.x, w.y, w.z.abs().max(0.01)).normalize()
    };
    for (description, material) in zoo() {
        for _ in 0..2000 {
            let (a, b) = (direction(), direction());
            let forth = seen(&material, a).eval(a, b).0 / b.z;
            let back = seen(&material, b).eval(b, a).0 / a.z;
            let error = (forth - back).abs().max_element();
            // Roundings of the half vector count most where the lobe is narrow
            assert!(error <= 2e-4 * forth.max_element() + 1e-6, "{description:?}: {forth} {back}");
        }
    }
}

/// Parts of the hemisphere, in polar angle and azimuth; then come smooth reflection, and no scattering or
/// transmission.
const PARTS: [usize; 2] = [8, 12];
const SMOOTH: usize = PARTS[0] * PARTS[1];
const NOTHING: usize = SMOOTH + 1;

/// The probability of each part, by quadrature of the density.
fn expected_parts(glossy: &Glossy<'_>, wo: Vec3) -> [f64; NOTHING + 1] {
    const FINE: [usize; 2] = [320, 1440];
    let mut expected = [0.0; NOTHING + 1];
    for i in 0..FINE[0] {
        let theta = (i as f32 + 0.5) / FINE[0] as f32 * 0.5 * PI;
        let area = f64::from(theta.sin() * PI * PI) / (FINE[0] * FINE[1]) as f64;
        for j in 0..FINE[1] {
            let (sin, cos) = ((j as f32 + 0.5) / FINE[1] as f32 * 2.0 * PI).sin_cos();
            let wi = Vec3::new(theta.sin() * cos, theta.sin() * sin, theta.cos());
            let part = i * PARTS[0] / FINE[0] * PARTS[1] + j * PARTS[1] / FINE[1];
            expected[part] += f64::from(glossy.eval(wo, wi).1) * area;
        }
    }
    expected[SMOOTH] = f64::from(if glossy.smooth { glossy.facet } else { glossy.mirrored });
    let mass: f64 = expected.iter().sum();
    assert!(mass < 1.0 + 2e-3, "{mass}");
    expected[NOTHING] = (1.0 - mass).max(0.0);
    expected
}

/// The part that one sample falls into, after a check of its density and weight.
fn sampled_part(glossy: &Glossy<'_>, wo: Vec3, rng: &mut Rng) -> usize {
    let [pick, u] = rng.two();
    let Some((wi, weight, pdf)) = glossy.sample(wo, [pick, u, rng.one()]) else { return NOTHING };
    if pdf == DELTA {
        return SMOOTH;
    }
    let (f, density) = glossy.eval(wo, wi);
    assert!((density - pdf).abs() <= 2e-3 * pdf, "{density} {pdf}");
    let error = (weight * pdf - f).abs().max_element();
    assert!(error <= 4e-3 * f.max_element(), "{weight} {pdf} {f}");
    if wi.z < 0.0 {
        return NOTHING;
    }
    let theta = wi.z.clamp(0.0, 1.0).acos() / (0.5 * PI) * PARTS[0] as f32;
    let phi = (wi.y.atan2(wi.x) / (2.0 * PI)).rem_euclid(1.0) * PARTS[1] as f32;
    let part = |x: f32, axis: usize| (x as usize).min(PARTS[axis] - 1);
    part(theta, 0) * PARTS[1] + part(phi, 1)
}

/// Chi-square and its degrees of freedom. Parts with fewer than ten expected samples are pooled.
fn chi_square(found: &[f64], expected: &[f64]) -> (f64, f64) {
    let (mut square, mut freedom, mut rare) = (0.0, 1.0, [0.0; 2]);
    for (found, expected) in found.iter().zip(expected) {
        if *expected < 10.0 {
            rare = [rare[0] + found, rare[1] + expected];
        } else {
            square += (found - expected).powi(2) / expected;
            freedom += 1.0;
        }
    }
    let pooled = f64::max(rare[1], 10.0);
    (square + f64::powi(rare[0] - pooled, 2) / pooled, freedom)
}

/// Samples are distributed by their density: a chi-square test over the parts. Where they fall, density and
/// f·cos are those of `eval`. Chi-square with n degrees of freedom exceeds n + 6√2n with p < 1e-5.
#[test]
fn samples_have_the_density_they_report() {
    const SAMPLES: usize = 30_000;
    let mut rng = Rng::new(Key::new(6), 0, 0);
    for (description, material) in zoo() {
        for cos in [0.9f32, 0.5, 0.2] {
            let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
            let glossy = seen(&material, wo);
            let expected = expected_parts(&glossy, wo).map(|p| p * SAMPLES as f64);
            let mut found = [0.0; NOTHING + 1];
            for _ in 0..SAMPLES {
                found[sampled_part(&glossy, wo, &mut rng)] += 1.0;
            }
            let (square, freedom) = chi_square(&found, &expected);
            let limit = freedom + 6.0 * (2.0 * freedom).sqrt();
            assert!(square < limit, "{description:?} at {cos}: χ² {square} of {freedom}");
        }
    }
}

/// The shares of a white sky that come from the two sides, as sampled.
fn albedo(material: &CompiledMaterial, cos: f32) -> [f64; 2] {
    const SIDE: u32 = 64;
    let wo = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
    let glossy = seen(material, wo);
    let at = |i: u32| (i as f32 + 0.5) / SIDE as f32;
    let mut sums = [0.0; 2];
    for i in 0..SIDE.pow(3) {
        let numbers = [i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE].map(at);
        if let Some((wi, weight, _)) = glossy.sample(wo, numbers) {
            sums[usize::from(wi.z < 0.0)] += f64::from(weight.x) / f64::from(SIDE.pow(3));
        }
    }
    sums
}

/// Sums of lobes at known albedos.
#[test]
fn lobes_reflect_and_transmit_what_they_should() {
    let lobes = |diffuse: f32, through: f32, specular: f32, mirror: f32, gloss, sigma: f32| {
        let [diffuse, through, specular] = [diffuse, through, specular].map(|x| Texture::Colour([x; 3]));
        let lobes = Lobes { diffuse, through, specular, gloss, sigma, roughness: 0.01, ..Lobes::default() };
        let material = Lobes { mirror: Texture::Colour([mirror; 3]), ..lobes }.into();
        CompiledMaterial::new(material, MaterialOptions::default(), &mut vec![]).unwrap()
    };
    let dielectric = |ior| Gloss::Dielectric { ior };
    // Numbers are midpoints of 64 strata, and lobes choose by one of them
    let near = |got: [f64; 2], expected: [f64; 2]| {
        let error = got.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(error < 0.01, "{got:?} instead of {expected:?}");
    };
    near(albedo(&lobes(0.3, 0.5, 0.0, 0.0, dielectric(1.5), 0.0), 0.6), [0.3, 0.5]);
    // Facets so smooth that they are a mirror: 4 % at normal incidence, all beyond the critical angle
    near(albedo(&lobes(0.3, 0.0, 0.5, 0.0, dielectric(1.5), 0.0), 1.0), [0.3 + 0.5 * 0.04, 0.0]);
    near(albedo(&lobes(0.3, 0.0, 0.5, 0.0, dielectric(1.0 / 1.5), 0.0), 0.5), [0.8, 0.0]);
    near(albedo(&lobes(0.3, 0.0, 0.0, 0.4, dielectric(1.0 / 1.5), 0.0), 0.5), [0.7, 0.0]);
    // Seen along the normal, Oren and Nayar's factor is A = 1 − σ²/(2(σ² + 0.33))
    let s2 = 0.25f64;
    let a = 1.0 - 0.5 * s2 / (s2 + 0.33);
    near(albedo(&lobes(0.6, 0.0, 0.0, 0.0, dielectric(1.5), 0.5), 1.0), [0.6 * a, 0.0]);
    // Ashikhmin's and Shirley's diffuse part along the normal: (1 − ½⁵)·28/23·2∫μ(1 − (1 − μ/2)⁵)dμ. With
    // u = 1 − μ/2, ∫μu⁵dμ = 4∫(u⁵ − u⁶)du from ½ to 1
    let moment = 4.0 * ((1.0 - 0.5f64.powi(6)) / 6.0 - (1.0 - 0.5f64.powi(7)) / 7.0);
    let share = (1.0 - 0.5f64.powi(5)) * 28.0 / 23.0 * 2.0 * (0.5 - moment);
    near(albedo(&lobes(0.6, 0.0, 0.0, 0.0, Gloss::AshikhminShirley, 0.0), 1.0), [0.6 * share, 0.0]);
}

#[test]
fn fresnel_at_known_angles() {
    // Normal incidence: ((n−1)/(n+1))²; Brewster's angle: the parallel part vanishes; beyond the critical
    // angle: 1
    assert!((fresnel(1.0, 1.5).0 - 0.04).abs() < 1e-6);
    let brewster = 1.5f32.atan();
    let expected = 0.5 * ((1.0 - 2.25f32) / (1.0 + 2.25)).powi(2);
    assert!((fresnel(brewster.cos(), 1.5).0 - expected).abs() < 1e-5);
    assert_eq!(fresnel(0.5, 1.0 / 1.5), (1.0, 0.0));
    assert!((fresnel(0.0, 1.5).0 - 1.0).abs() < 1e-6);
}
