//! The surfaces of glTF, Mitsuba's `principled` and pbrt's `disney`: against their formulas, written in f64
//! and independently of the renderer, under light from one direction and under a white sky.

use crate::kit::{agrees, albedo, look, mean, scene};
use noisefloor_ptwne::{Dialect, Material, MaterialOptions, Principled, Punctual, RenderOptions, Texture};
use std::f64::consts::PI;

type V = [f64; 3];

fn dot(a: V, b: V) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn half(a: V, b: V) -> V {
    let sum: V = std::array::from_fn(|i| a[i] + b[i]);
    sum.map(|x| x / dot(sum, sum).sqrt())
}

/// A direction by its angle from the normal and its azimuth, in degrees.
fn toward(polar: f64, azimuth: f64) -> V {
    let ((sin, cos), (s, c)) = (polar.to_radians().sin_cos(), azimuth.to_radians().sin_cos());
    [sin * c, sin * s, cos]
}

/// GGX of α along x and y: D (Heitz 2014, eq. 85) times Smith's G₁ of both directions (eqs. 72 and 80), over
/// 4 cos cos.
fn ggx(alpha: [f64; 2], a: V, b: V) -> f64 {
    let h = half(a, b);
    let [x, y] = alpha;
    let slopes = (h[0] / x).powi(2) + (h[1] / y).powi(2);
    let d = 1.0 / (PI * x * y * (slopes + h[2] * h[2]).powi(2));
    let g1 = |w: V| {
        let a2tan2 = ((x * w[0]).powi(2) + (y * w[1]).powi(2)) / (w[2] * w[2]);
        2.0 / (1.0 + (1.0 + a2tan2).sqrt())
    };
    d * g1(a) * g1(b) / (4.0 * a[2] * b[2])
}

fn weight(cos: f64) -> f64 {
    (1.0 - cos).powi(5)
}

fn fresnel(cos: f64, n: f64) -> f64 {
    let t = (1.0 - (1.0 - cos * cos) / (n * n)).sqrt();
    let (s, p) = ((cos - n * t) / (cos + n * t), (n * cos - t) / (n * cos + t));
    0.5 * (s * s + p * p)
}

/// glTF 2.0, appendix B.2: `mix` of `fresnel_mix` and `conductor_fresnel`, simplified as in B.3.
fn gltf(base: f64, roughness: f64, metal: f64, ior: f64, a: V, b: V) -> f64 {
    let cos = dot(half(a, b), a);
    let f0 = ((ior - 1.0) / (ior + 1.0)).powi(2) * (1.0 - metal) + base * metal;
    let f = f0 + (1.0 - f0) * weight(cos);
    (1.0 - f) * base * (1.0 - metal) / PI + f * ggx([roughness.powi(2); 2], a, b)
}

/// Burley 2012 and 2015 as in Mitsuba 3.9.1 and pbrt-v3, for a grey base.
fn principled(p: &Principled, [base, roughness, metal]: [f64; 3], a: V, b: V) -> f64 {
    coloured(p, [base, roughness, metal], 1.0, a, b)
}

/// The same for one channel of a base, whose hue is that channel over its luminance.
fn coloured(p: &Principled, [base, roughness, metal]: [f64; 3], hue: f64, a: V, b: V) -> f64 {
    let [anisotropic, tint, sheen, flatness, coat, gloss, n] =
        [p.anisotropic, p.specular_tint, p.sheen, p.flatness, p.clearcoat, p.clearcoat_gloss, p.ior]
            .map(f64::from);
    let cos = dot(half(a, b), a);
    let (fa, fb, r) = (weight(a[2]), weight(b[2]), 2.0 * roughness * cos * cos);
    let usual = (1.0 - fa / 2.0) * (1.0 - fb / 2.0) + r * (fa + fb + fa * fb * (r - 1.0));
    let ss = (1.0 + (r / 2.0 - 1.0) * fa) * (1.0 + (r / 2.0 - 1.0) * fb);
    let flat = 1.25 * (ss * (1.0 / (a[2] + b[2]) - 0.5) + 0.5);
    let tinted = |share: f64| 1.0 + (hue - 1.0) * share;
    let sheen = sheen * tinted(f64::from(p.sheen_tint));
    let diffuse = base / PI * (usual * (1.0 - flatness) + flat * flatness) + sheen * weight(cos);

    let schlick = |f0: f64| f0 + (1.0 - f0) * weight(cos);
    let f0 = ((n - 1.0) / (n + 1.0)).powi(2);
    let facets = match p.dialect {
        Dialect::Mitsuba => {
            let dielectric = (1.0 - tint) * fresnel(cos, n) + tint * schlick(hue * f0);
            metal * schlick(base) + (1.0 - metal) * dielectric
        }
        _ => {
            let normal = metal * base + (1.0 - metal) * f0 * tinted(tint);
            metal * schlick(normal) + (1.0 - metal) * fresnel(cos, n)
        }
    };
    let aspect = (1.0 - 0.9 * anisotropic).sqrt();
    let alpha = [roughness.powi(2) / aspect, roughness.powi(2) * aspect];

    let (width, h) = (0.1 + (0.001 - 0.1) * gloss, half(a, b)[2]);
    let w2: f64 = width * width;
    let gtr1 = (w2 - 1.0) / (PI * w2.ln() * (1.0 + (w2 - 1.0) * h * h));
    let masked = |c: f64| 2.0 * c / (c + (0.0625 + (1.0 - 0.0625) * c * c).sqrt());
    let scale = if p.dialect == Dialect::Pbrt { 4.0 * a[2] * b[2] } else { 1.0 };
    let coat = 0.25 * coat * gtr1 * schlick(0.04) * masked(a[2]) * masked(b[2]) / scale;
    (1.0 - metal) * diffuse + facets * ggx(alpha, a, b) + coat
}

/// What a plane shows to the direction `to` under an irradiance of 1 (across the beam) from `from`: f·cos θ.
fn shown(material: &Material, options: &MaterialOptions, to: V, from: V) -> f64 {
    // Local x runs along the texture's u, which is world x; local y is −z
    let world = |v: V| [v[0] as f32, v[2] as f32, -v[1] as f32];
    let eye = to.map(|x| 100.0 * x);
    let scene = scene(look(world(eye), [0.0; 3], [0.1, 0.2, 1.0], 1e-3), |b| {
        let m = b.material_with(material.clone(), options.clone()).unwrap();
        let (e1, e2) = ([8.0, 0.0, 0.0], [0.0, 0.0, -8.0]);
        b.mapped_parallelogram([-4.0, 0.0, 4.0], [e1, e2], [[0.0; 2], [1.0, 0.0], [0.0, 1.0]], m, None)
            .unwrap();
        let direction = world(from).map(|x| -x);
        b.punctual(Punctual::Distant { direction, irradiance: [1.0; 3] }).unwrap();
    });
    mean(scene, 2, 2, 4, 1, RenderOptions::default()).0
}

/// The same by formula; rays differ from `to` by 1e-5, and f32 rounds half vectors to 1e-7, which lobes of α
/// = 0.04 turn into 1e-4 at most.
fn shows(got: f64, f: f64, from: V, what: &str) {
    let expected = f * from[2];
    assert!((got - expected).abs() <= 1e-3 * expected + 1e-6, "{what}: {got} instead of {expected}");
}

/// Where the light and the camera are, from normal to grazing, in the plane of the mirrored direction and
/// out of it.
fn pairs() -> [[V; 2]; 6] {
    [
        [toward(10.0, 0.0), toward(15.0, 90.0)],
        [toward(40.0, 20.0), toward(40.0, 200.0)],
        [toward(40.0, 20.0), toward(50.0, 170.0)],
        [toward(75.0, 0.0), toward(70.0, 180.0)],
        [toward(30.0, 100.0), toward(80.0, 100.0)],
        [toward(82.0, 10.0), toward(20.0, 300.0)],
    ]
}

const BASES: [f32; 4] = [0.1, 0.2, 0.5, 0.8];
const LOOKS: [[f32; 2]; 5] = [[0.5, 0.0], [0.2, 0.0], [1.0, 0.3], [0.4, 1.0], [0.7, 0.6]];

fn metallic_roughness(base: f32, [roughness, metal]: [f32; 2], ior: f32) -> Material {
    Material::MetallicRoughness {
        base: [base; 3].into(),
        metallic_roughness: [1.0, roughness, metal].into(),
        ior,
    }
}

#[test]
fn gltf_shows_what_its_specification_says() {
    for base in BASES {
        for look in LOOKS {
            for ior in [1.5, 1.8] {
                let material = metallic_roughness(base, look, ior);
                for [to, from] in pairs() {
                    let [r, m] = look.map(f64::from);
                    let f = gltf(f64::from(base), r, m, f64::from(ior), to, from);
                    let got = shown(&material, &MaterialOptions::default(), to, from);
                    shows(got, f, from, &format!("{base} {look:?} {to:?} {from:?}"));
                }
            }
        }
    }
}

fn surfaces() -> Vec<Principled> {
    let plain = Principled::default();
    let mut all = vec![
        plain.clone(),
        Principled { ior: 1.3, ..plain.clone() },
        Principled { anisotropic: 0.8, ..plain.clone() },
        Principled { specular_tint: 0.7, ior: 1.8, ..plain.clone() },
        Principled { sheen: 0.6, flatness: 0.4, ..plain.clone() },
        Principled { clearcoat: 0.9, clearcoat_gloss: 0.2, ..plain },
    ];
    let others: Vec<_> = all.iter().map(|p| Principled { dialect: Dialect::Pbrt, ..p.clone() }).collect();
    all.extend(others);
    all
}

fn with(p: &Principled, base: f32, [roughness, metal]: [f32; 2]) -> Material {
    let (base, metallic_roughness) = ([base; 3].into(), [1.0, roughness, metal].into());
    Principled { base, metallic_roughness, ..p.clone() }.into()
}

#[test]
fn principled_surfaces_show_what_their_formulas_say() {
    for p in surfaces() {
        for (base, look) in BASES.into_iter().zip(LOOKS) {
            let material = with(&p, base, look);
            for [to, from] in pairs() {
                let f = principled(&p, [base, look[0], look[1]].map(f64::from), to, from);
                let got = shown(&material, &MaterialOptions::default(), to, from);
                shows(got, f, from, &format!("{p:?} {base} {look:?} {to:?} {from:?}"));
            }
        }
    }
}

/// Tints have the hue of the base: green over the luminance by Rec.709.
#[test]
fn tints_have_the_hue_of_the_base() {
    let base = [0.6f32, 0.3, 0.1];
    let hue = 0.3 / (0.2126 * 0.6 + 0.7152 * 0.3 + 0.0722 * 0.1);
    for dialect in [Dialect::Mitsuba, Dialect::Pbrt] {
        let metallic_roughness = [1.0, 0.4, 0.3].into();
        let tints =
            Principled { specular_tint: 0.8, sheen: 0.5, sheen_tint: 0.6, dialect, ..Principled::default() };
        let material = Principled { base: base.into(), metallic_roughness, ..tints.clone() }.into();
        for [to, from] in pairs() {
            let f = coloured(&tints, [0.3, f64::from(0.4f32), f64::from(0.3f32)], hue, to, from);
            let got = shown(&material, &MaterialOptions::default(), to, from);
            shows(got, f, from, &format!("{dialect:?} {to:?} {from:?}"));
        }
    }
}

/// α along and across growing u, of a metal: the same lobe turned by a quarter if the two are exchanged.
#[test]
fn facets_run_along_texture_coordinates() {
    let metal = Material::RoughConductor { reflectance: [1.0; 3].into(), roughness: 0.3 };
    for [x, y] in [[0.1f32, 0.5f32], [0.5, 0.1], [0.25, 0.25]] {
        for [to, from] in pairs() {
            for (facets, correlated) in
                [(noisefloor_ptwne::Facets::GgxUncorrelated, false), (noisefloor_ptwne::Facets::Ggx, true)]
            {
                let options = MaterialOptions {
                    roughness: Some(Texture::Colour([x, y, 0.0])),
                    facets,
                    ..MaterialOptions::default()
                };
                let alpha = [x, y].map(f64::from);
                let mut f = ggx(alpha, to, from);
                if correlated {
                    let lambda = |w: V| {
                        let t = ((alpha[0] * w[0]).powi(2) + (alpha[1] * w[1]).powi(2)) / (w[2] * w[2]);
                        0.5 * ((1.0 + t).sqrt() - 1.0)
                    };
                    let (a, b) = (lambda(to), lambda(from));
                    f *= (1.0 + a) * (1.0 + b) / (1.0 + a + b);
                }
                shows(shown(&metal, &options, to, from), f, from, &format!("{x} {y} {to:?} {from:?}"));
            }
        }
    }
}

/// ∫f·cos over the hemisphere by midpoint rule, in the angle from the normal and the azimuth.
fn integral(f: impl Fn(V) -> f64) -> f64 {
    const STEPS: u32 = 350;
    let step = |i: u32, range: f64| (f64::from(i) + 0.5) / f64::from(STEPS) * range;
    let mut sum = 0.0;
    for i in 0..STEPS {
        let (sin, cos) = step(i, 0.5 * PI).sin_cos();
        for j in 0..STEPS {
            let (s, c) = step(j, 2.0 * PI).sin_cos();
            sum += f([sin * c, sin * s, cos]) * cos * sin;
        }
    }
    sum * PI * PI / f64::from(STEPS).powi(2)
}

/// Lobes of α ≥ 0.16 are smooth at the scale of the quadrature, which errs by 1e-5 for GGX at the angles tried.
#[test]
fn a_white_sky_is_reflected_by_the_integral_of_the_formulas() {
    for (base, look) in [(0.2, [0.5, 0.0]), (0.8, [1.0, 0.0]), (0.5, [0.4, 1.0]), (1.0, [0.6, 0.5])] {
        for degrees in [5.0f32, 60.0, 80.0] {
            let to = toward(f64::from(degrees), 0.0);
            let [b, r, m] = [base, look[0], look[1]].map(f64::from);
            let expected = integral(|from| gltf(b, r, m, 1.5, to, from));
            assert!(expected < 1.0, "glTF's model makes no light: {expected}");
            agrees(albedo(&metallic_roughness(base, look, 1.5), degrees, 200), expected, 2e-3);
            for p in surfaces() {
                let expected = integral(|from| principled(&p, [b, r, m], to, from));
                agrees(albedo(&with(&p, base, look), degrees, 200), expected, 2e-3);
            }
        }
    }
}
