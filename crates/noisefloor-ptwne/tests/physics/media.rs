//! Cameras and lamps in media of different indices of refraction, against known answers: radiance L over η²
//! stays the same across boundaries (Veach 1997, §5.2).

use crate::kit::{UP, agrees, look, mean, scene, source};
use noisefloor_ptwne::{Emission, Environment, Estimator, Material, RenderOptions, Scene, SceneBuilder};

/// What a boundary of index 1.5 reflects at normal incidence.
const F: f64 = 0.04;

/// A square around the z axis that faces +z, or −z.
fn square(b: &mut SceneBuilder, z: f32, faces: f32, material: Material, emission: Option<Emission>) {
    let material = b.material(material).unwrap();
    b.parallelogram([-9.0 * faces, -9.0, z], [18.0 * faces, 0.0, 0.0], [0.0, 18.0, 0.0], material, emission)
        .unwrap();
}

/// Boundaries at these depths, each with an index and the side it faces, and a black lamp of radiance 1 behind
/// them, seen at normal incidence.
fn lamp_behind(boundaries: &[(f32, f32, f32)], glass: fn(f32) -> Material) -> Scene {
    scene(look([0.0, 0.0, 4.0], [0.0; 3], UP, 0.5), |b| {
        for (z, ior, faces) in boundaries {
            square(b, *z, *faces, glass(*ior), None);
        }
        square(b, -3.0, 1.0, Material::diffuse([0.0; 3]), Some(Emission::front([1.0; 3])));
    })
}

fn smooth(ior: f32) -> Material {
    Material::Glass { ior, tint: [1.0; 3] }
}

fn rough(ior: f32) -> Material {
    Material::RoughGlass { ior, tint: [1.0; 3], roughness: 0.4 }
}

fn nearly_smooth(ior: f32) -> Material {
    Material::RoughGlass { ior, tint: [1.0; 3], roughness: 0.02 }
}

/// The lamp stands in the glass, the camera does not, or the other way round; both stand outside a closed
/// slab; water lies on glass. The reference says the same.
#[test]
fn lamps_shine_across_boundaries() {
    // Within a slab light is also reflected twice, four times …: (1 − F)²(1 + F² + F⁴ + …)
    let slab = (1.0 - F) / (1.0 + F);
    // F of 4/3 beside air, and of 1.5 beside 4/3
    let (water, between) = ((1.0 / 7.0f64).powi(2), (1.0 / 17.0f64).powi(2));
    for (boundaries, expected) in [
        (vec![(0.0, 1.5, 1.0)], (1.0 - F) / 2.25),
        (vec![(0.0, 1.5, -1.0)], (1.0 - F) * 2.25),
        (vec![(0.0, 1.5, 1.0), (-1.0, 1.5, -1.0)], slab),
        (
            vec![(0.0, 4.0 / 3.0, 1.0), (-1.0, 1.125, 1.0)],
            (1.0 - water) * (1.0 - between) / (1.0 - water * between) / 2.25,
        ),
    ] {
        for estimator in [Estimator::Mis, Estimator::NextEvents, Estimator::BruteForce] {
            let options = RenderOptions { estimator, ..RenderOptions::default() };
            let seen = |glass| mean(lamp_behind(&boundaries, glass), 4, 64, 128, 0, options);
            agrees(seen(smooth), expected, 1e-4);
            if estimator == Estimator::BruteForce {
                // Of light from a wide lamp behind facets of 1° only the Fresnel term's curvature is lost
                agrees(seen(nearly_smooth), expected, 2e-3);
            }
        }
        let mut source = source(lamp_behind(&boundaries, smooth), 4);
        let reference = f64::from(source.reference().unwrap().pixels[5][0]);
        // Its branches end at a weight of 2e-3
        assert!((reference - expected).abs() < 2e-3 * expected, "{reference} {expected}");
    }
}

/// Samples of lamps across a rough boundary carry as much light as rays scattered towards them.
#[test]
fn estimators_agree_across_rough_boundaries() {
    for faces in [1.0, -1.0] {
        let [mis, next, brute] =
            [Estimator::Mis, Estimator::NextEvents, Estimator::BruteForce].map(|estimator| {
                let options = RenderOptions { estimator, ..RenderOptions::default() };
                mean(lamp_behind(&[(0.0, 1.5, faces)], rough), 4, 64, 512, 0, options)
            });
        for (other, error) in [mis, next] {
            agrees((other, error.hypot(brute.1)), brute.0, 0.0);
        }
    }
}

/// In a white sky there is radiance η² inside of lossless glass, wherever light gets in.
#[test]
fn glass_in_a_white_sky_is_filled_with_its_square() {
    for ior in [1.5f32, 0.5, 4.0] {
        let scene = scene(look([0.0; 3], [0.0, 0.0, 1.0], UP, 1.0), |b| {
            let m = b.material(smooth(ior)).unwrap();
            b.sphere([0.0; 3], 1.0, m, None).unwrap();
            b.environment(Environment::constant([1.0; 3])).unwrap();
        });
        agrees(mean(scene, 4, 16, 32, 0, RenderOptions::default()), f64::from(ior).powi(2), 1e-4);
    }
}

/// Roulette goes by L/η². A path in a lossless ball survives each segment with 95 %, so that the variance of
/// its sample, 1/0.95ᵏ, is small; by radiance it would survive the first one with 1/η², and the variance were
/// more than η² − 1.
#[test]
fn roulette_spares_paths_inside_glass() {
    for material in [smooth(3.0), Material::RoughGlass { ior: 3.0, tint: [1.0; 3], roughness: 0.05 }] {
        let scene = scene(look([0.0, 0.0, 9.0], [0.0; 3], UP, 1.0), |b| {
            let m = b.material(material.clone()).unwrap();
            b.sphere([0.0; 3], 1.0, m, None).unwrap();
            b.environment(Environment::constant([1.0; 3])).unwrap();
        });
        let options = RenderOptions { roulette: 1, ..RenderOptions::default() };
        let (_, error) = mean(scene, 8, 64, 16, 0, options);
        // 64 batches of 16 samples of 64 pixels
        let variance = error * error * f64::from(64 * 16 * 64);
        assert!(variance < 1.0, "{material:?}: {variance}");
    }
}
