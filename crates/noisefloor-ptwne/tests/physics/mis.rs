//! Next event estimation, scattering, and both together: they change the noise, not the mean.

use crate::kit::{batch, look, mean_of, scene};
use noisefloor_ptwne::{
    Emission, EnvironmentMap, Estimator, Material, Mesh, Ptwne, RenderOptions, Scene, scenes,
};

/// Edges of the picture and of the parts that are compared, in pixels.
const SIZE: usize = 24;
const PART: usize = 8;
const PARTS: usize = (SIZE / PART) * (SIZE / PART);
const SEEDS: u64 = 3;
const BATCHES: u64 = 64;

/// Mean of green over each part, with its standard error, from batches of `SEEDS` seeds.
fn parts(scene: &Scene, estimator: Estimator, samples: u64) -> [(f64, f64); PARTS] {
    let mut means = vec![];
    for seed in 0..SEEDS {
        // No two renders share random numbers
        let options =
            RenderOptions { estimator, seed: 3 * seed + estimator as u64, ..RenderOptions::default() };
        let mut source = Ptwne::new(scene.clone(), SIZE, SIZE, options).unwrap();
        means.extend((0..BATCHES).map(|i| {
            let pixels = batch(&mut source, i * samples, samples);
            let mut sums = [0.0; PARTS];
            for (i, pixel) in pixels.iter().enumerate() {
                sums[i / SIZE / PART * (SIZE / PART) + i % SIZE / PART] += f64::from(pixel[1]);
            }
            sums.map(|sum| sum / (PART * PART) as f64)
        }));
        assert_eq!(source.counts().dropped, 0);
    }
    std::array::from_fn(|part| mean_of(&means.iter().map(|m| m[part]).collect::<Vec<f64>>()))
}

/// Asserts that all three estimators agree in every part of the picture, each pair at five standard errors.
fn check(name: &str, scene: &Scene) {
    let mis = parts(scene, Estimator::Mis, 2);
    let next = parts(scene, Estimator::NextEvents, 2);
    let brute = parts(scene, Estimator::BruteForce, 16);
    for (what, a, b) in [
        ("MIS, next events", mis, next),
        ("MIS, brute force", mis, brute),
        ("next events, brute force", next, brute),
    ] {
        for (part, ((a, e), (b, f))) in a.into_iter().zip(b).enumerate() {
            let error = e.hypot(f);
            assert!((a - b).abs() < 5.0 * error, "{name}, part {part}, {what}: {a} ± {e}, {b} ± {f}");
            assert!(error < 0.06 * a, "{name}, part {part}, {what}: ±{error} proves nothing about {a}");
        }
    }
}

/// Scenes whose lights are large enough to be hit by chance. Of 135 comparisons (five scenes, nine parts,
/// three pairs) one is off by 5 standard errors with p < 135 · 5.7e-7 = 8e-5, and means of 24,000 samples and
/// more, in 192 batches, are normal enough for that.
#[test]
fn all_estimators_agree_on_scenes_with_large_lights() {
    for name in ["cornell-box", "softbox", "glass-spheres", "lanterns"] {
        check(name, &scenes::by_name(name).unwrap());
    }
    check("lights of all shapes", &lights_of_all_shapes());
}

/// A floor, a ball of metal and one of varnish under 42 lights of all shapes, with one or two sides, and an
/// environment map: every way to bound and to choose a light.
fn lights_of_all_shapes() -> Scene {
    scene(look([0.0, 2.2, 7.0], [0.0, 0.9, 0.0], [0.0, 1.0, 0.0], 40.0), |b| {
        let grey = b.material(Material::diffuse([0.5; 3])).unwrap();
        let metal = Material::RoughConductor { reflectance: [0.8; 3].into(), roughness: 0.4 };
        let metal = b.material(metal).unwrap();
        let (diffuse, specular) = ([0.5, 0.2, 0.1].into(), [1.0; 3]);
        let varnish = Material::Plastic { diffuse, specular, ior: 1.5, roughness: 0.3, nonlinear: false };
        let varnish = b.material(varnish).unwrap();
        b.parallelogram([-5.0, 0.0, -3.0], [0.0, 0.0, 9.0], [10.0, 0.0, 0.0], grey, None).unwrap();
        b.sphere([-1.1, 0.7, 0.5], 0.7, metal, None).unwrap();
        b.sphere([1.1, 0.7, 0.5], 0.7, varnish, None).unwrap();
        for i in 0..42 {
            let (column, row) = ((i % 7) as f32 - 3.0, (i / 7) as f32);
            let at = [1.3 * column, 2.6 + 0.2 * column.abs(), 1.3 * row - 3.0];
            let strength = [0.2, 1.0, 4.0][i % 3];
            let light = Emission { two_sided: i % 2 == 0, ..Emission::front([strength; 3]) };
            let (e1, e2) = ([0.9, 0.1 * row, 0.0], [0.0, 0.1 * column, 0.7]);
            match i % 4 {
                0 => b.sphere(at, 0.3, grey, Some(light)).unwrap(),
                1 => b.parallelogram(at, e1, e2, grey, Some(light)).unwrap(),
                2 => b.disk(at, [e1.map(|x| 0.5 * x), e2], false, grey, Some(light)).unwrap(),
                _ => {
                    let to = |e: [f32; 3]| std::array::from_fn(|k| at[k] + e[k]);
                    let mesh =
                        Mesh { positions: &[at, to(e1), to(e2)], indices: &[[0, 1, 2]], ..Mesh::default() };
                    assert_eq!(b.mesh(&mesh, grey, Some(light)), Ok(0));
                }
            }
        }
        let pixels = (0..32).map(|i| [0.05 + 0.1 * (i % 8) as f32; 3]).collect();
        let to_world = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        b.environment_map(EnvironmentMap { width: 8, height: 4, pixels, to_world, poles: false }).unwrap();
    })
}

/// Suns are too small to be hit by chance, but next event estimation finds them with and without scattered
/// rays.
#[test]
fn next_events_alone_are_enough_under_a_sun() {
    for name in ["courtyard", "arcade"] {
        let scene = scenes::by_name(name).unwrap();
        let (mis, next) = (parts(&scene, Estimator::Mis, 1), parts(&scene, Estimator::NextEvents, 1));
        for (part, ((a, e), (b, f))) in mis.into_iter().zip(next).enumerate() {
            // Of 18 comparisons one is off by as much with p < 2e-5
            assert!((a - b).abs() < 5.0 * e.hypot(f), "{name}, part {part}: {a} ± {e}, {b} ± {f}");
            assert!(e.hypot(f) < 0.03 * a, "{name}, part {part}: ±{} proves nothing about {a}", e.hypot(f));
        }
    }
}
