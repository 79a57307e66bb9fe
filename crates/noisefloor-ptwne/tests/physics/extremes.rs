//! All samples are finite and non-negative, in any scene.

use crate::kit::{batch, look, scene, source};
use noisefloor_ptwne::{Emission, Environment, Material, Mesh, Ptwne, RenderOptions, Scene, Sun, scenes};
use std::sync::Arc;

fn check(scene: Scene, samples: u64) {
    let scene = Arc::new(scene);
    let mut source = source(scene.clone(), 32);
    let mut all = batch(&mut source, 0, samples);
    let counts = source.counts();
    assert_eq!((counts.samples, counts.dropped, counts.clamped), (32 * 32 * samples, 0, 0));
    // References take thousands of samples per pixel where light is hard to find
    let mut small = crate::kit::source(scene, 8);
    all.extend(small.reference().unwrap().pixels);
    let good = |v: &f32| v.is_finite() && *v >= 0.0;
    assert!(all.iter().flatten().all(good), "{:?}", all.iter().find(|p| !p.iter().all(good)));
}

#[test]
fn tiny_bright_lights_and_grazing_cameras_stay_finite() {
    for (size, eye) in [(1e-6, [0.0, 1e-5, 3.0]), (1e-4, [0.0, 1e-3, 1e3]), (1.0, [1e5, 2.0, 1e5])] {
        check(
            scene(look(eye, [0.0; 3], [0.0, 1.0, 0.0], 40.0), |b| {
                let floor = b.material(Material::diffuse([1.0; 3])).unwrap();
                let rough = b
                    .material(Material::RoughConductor { reflectance: [1.0; 3].into(), roughness: 1e-3 })
                    .unwrap();
                let glass = b.material(Material::Glass { ior: 4.0, tint: [1.0; 3] }).unwrap();
                let light = Some(Emission::two_sided([1e12, 1e6, 0.0]));
                b.parallelogram([-1e4, 0.0, -1e4], [0.0, 0.0, 2e4], [2e4, 0.0, 0.0], floor, None).unwrap();
                b.parallelogram([-0.5, 0.1, 0.0], [1.0, 0.3, 0.0], [0.0, 0.3, 0.8], rough, None).unwrap();
                b.sphere([0.3, 0.2, 0.4], 0.2, glass, None).unwrap();
                b.parallelogram([0.0, 1e-3, 0.0], [size, 0.0, 0.0], [0.0, 0.0, size], floor, light.clone())
                    .unwrap();
                b.sphere([-0.4, 0.5, 0.0], size, rough, light).unwrap();
                let needle = [[0.0; 3], [1.0, 1e-7, 0.0], [2.0, 1.5e-7, 0.0]];
                let (positions, normals) = (&needle, &[[0.0, -1.0, 1e-20]; 3]);
                let mesh = Mesh { positions, normals, indices: &[[0, 1, 2]], ..Mesh::default() };
                b.mesh(&mesh, floor, None).unwrap();
                let sun = Sun { direction: [0.0, -1e-30, 1.0], angular_radius: 0.01, radiance: [1e12; 3] };
                b.environment(Environment { sun: Some(sun), ..Environment::constant([1.0; 3]) }).unwrap();
            }),
            64,
        );
    }
}

/// Surfaces as far and as large as they may be.
#[test]
fn the_largest_coordinates_stay_finite() {
    let far = 1e8;
    check(
        scene(look([0.0, 1e7, 9e7], [0.0; 3], [0.0, 1.0, 0.0], 90.0), |b| {
            let floor = b.material(Material::diffuse([1.0; 3])).unwrap();
            let glass =
                b.material(Material::RoughGlass { ior: 1.5, tint: [1.0; 3], roughness: 0.2 }).unwrap();
            let light = Some(Emission::two_sided([1e12, 1.0, 0.0]));
            let (corner, across, along) = ([-far, 0.0, -far], [0.0, 0.0, far], [far, 0.0, 0.0]);
            b.parallelogram(corner, across, along, floor, None).unwrap();
            b.parallelogram([-far, 5e7, -far], along, across, floor, light.clone()).unwrap();
            b.sphere([far, far, -far], far, glass, None).unwrap();
            b.sphere([-far, -far, far], far, floor, light).unwrap();
            assert!(b.sphere([1.01 * far, 0.0, 0.0], 1.0, floor, None).is_err());
        }),
        64,
    );
}

#[test]
fn built_in_scenes_stay_finite() {
    for entry in scenes::list().chain(scenes::stiff()) {
        check(scenes::by_name(entry.name).unwrap(), 16);
    }
}

#[test]
fn an_empty_scene_is_its_sky() {
    let empty = scene(look([0.0; 3], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], 40.0), |b| {
        b.environment(Environment::constant([0.25, 0.5, 1.0])).unwrap();
    });
    let mut source = source(empty, 8);
    assert!(batch(&mut source, 0, 3).iter().all(|p| *p == [0.25, 0.5, 1.0]));
    assert!(source.reference().unwrap().pixels.iter().all(|p| *p == [0.25, 0.5, 1.0]));
}

/// Bright samples are scaled down to the clamp and counted; without a clamp, none are.
#[test]
fn clamps_bound_samples_and_are_counted() {
    let run = |clamp| {
        let scene = scenes::by_name("glass-spheres").unwrap();
        let mut source =
            Ptwne::new(scene, 48, 48, RenderOptions { clamp, ..RenderOptions::default() }).unwrap();
        (batch(&mut source, 0, 1), source.counts().clamped)
    };
    assert_eq!(RenderOptions::default().clamp, None);
    let ((free, none), (bound, clamped)) = (run(None), run(Some(2.0)));
    let mut above = 0;
    for (free, bound) in free.iter().zip(&bound) {
        let most = free.iter().fold(0.0f32, |a, b| a.max(*b));
        above += u64::from(most > 2.0);
        for (free, bound) in free.iter().zip(bound) {
            let expected = free * (2.0 / most).min(1.0);
            assert!((bound - expected).abs() <= 1e-6 * expected, "{bound} {expected}");
        }
    }
    assert_eq!((none, clamped), (0, above));
    assert!(above > 10, "{above}");
}
