//! The stiff scenes, against mathematically known answers.

use crate::kit::{UP, agrees, batch, look, mean, mean_of, scene, source};
use noisefloor::Rgb;
use noisefloor_ptwne::{
    Camera, Emission, Environment, Estimator, Material, Mesh, Ptwne, Punctual, RenderOptions, Scene, scenes,
};

/// A black shell in surroundings of radiance 1, seen from inside: any light leaked through a crack.
fn leaks(positions: &[[f32; 3]], indices: &[[u32; 3]], eye: [f32; 3]) -> f64 {
    let towards = |target: [f32; 3]| look(eye, std::array::from_fn(|i| eye[i] + target[i]), UP, 100.0);
    let targets = [[1.0, 0.01, 0.0], [-1.0, 0.0, 0.2], [0.0, 0.3, 1.0], [0.1, 0.0, -1.0]];
    let shell = scene(towards(targets[0]), |b| {
        let black = b.material(Material::diffuse([0.0; 3])).unwrap();
        b.mesh(&Mesh { positions, indices, ..Mesh::default() }, black, None).unwrap();
        b.environment(Environment::constant([1.0; 3])).unwrap();
    });
    let seen = |target| {
        let shell = shell.clone().with_camera(towards(target)).unwrap();
        mean(shell, 128, 2, 8, 1, RenderOptions::default()).0
    };
    targets.map(seen).iter().sum::<f64>() / 4.0
}

/// A closed drum of needle triangles around the origin, and one of small triangles away from it.
#[test]
fn nothing_shines_through_closed_shells() {
    for (sides, rows, at) in [(8000u32, 1u32, 0.0f32), (400, 200, 20.0)] {
        let (mut positions, mut indices) = (vec![], vec![]);
        for j in 0..=rows {
            for i in 0..sides {
                let (sin, cos) = (std::f32::consts::TAU * i as f32 / sides as f32).sin_cos();
                positions.push([at + cos, at + 2.0 * j as f32 / rows as f32 - 1.0, at + sin]);
            }
        }
        for cell in 0..sides * rows {
            let (i, j) = (cell % sides, cell / sides);
            let (a, b) = (j * sides + i, j * sides + (i + 1) % sides);
            indices.extend([[a, a + sides, b], [b, a + sides, b + sides]]);
        }
        let base = positions.len() as u32;
        for y in [-1.0, 1.0] {
            for (x, z) in [(-2.0, -2.0), (2.0, -2.0), (-2.0, 2.0), (2.0, 2.0)] {
                positions.push([at + x, at + y, at + z]);
            }
        }
        for b in [base, base + 4] {
            indices.extend([[b, b + 1, b + 2], [b + 1, b + 3, b + 2]]);
        }
        // From off the axis, where rays graze; without widened edges, about five of a million rays leak
        let leaks = leaks(&positions, &indices, [at + 0.7, at + 0.03, at - 0.02]);
        assert_eq!(leaks, 0.0, "{sides}×{rows} at {at}");
    }
}

fn stiff(name: &str, camera: Option<Camera>) -> Scene {
    let scene = scenes::by_name(name).unwrap();
    camera.into_iter().fold(scene, |scene, camera| scene.with_camera(camera).unwrap())
}

#[test]
fn without_light_or_reflection_there_is_nothing() {
    for name in ["black", "unlit"] {
        let mut source = source(stiff(name, None), 32);
        assert!(batch(&mut source, 0, 16).iter().all(|p| *p == [0.0; 3]));
        assert!(source.reference().unwrap().pixels.iter().all(|p| *p == [0.0; 3]));
    }
}

/// A ball of radius 1e-4 lights like a point of intensity πr²L: at a spot of the wall, albedo/π · πr²L cos θ
/// / d².
#[test]
fn a_pinpoint_lights_as_a_point() {
    let camera = look([-2.0, 2.6, 1.0], [-2.0, 2.6, -1.5], UP, 0.05);
    let d2 = 1.6 * 1.6 + 2.9 * 2.9;
    let expected = 0.75 * 1e-8 * 6e8 * 2.9 / f64::powf(d2, 1.5);
    for estimator in [Estimator::Mis, Estimator::NextEvents] {
        let options = RenderOptions { estimator, max_depth: 2, ..RenderOptions::default() };
        agrees(mean(stiff("pinpoint", Some(camera)), 4, 64, 20, 0, options), expected, 1e-3);
    }
    let mut source = source(stiff("pinpoint", Some(camera)), 4);
    let reference = f64::from(source.reference().unwrap().pixels[5][0]);
    assert!((reference - expected).abs() < 1e-3 * expected, "{reference} {expected}");
}

/// A keyhole through which only the lamp is seen lights as if it emitted light itself: a hole of a×b at
/// distance d has the form factor ab/πd², up to (a² + b²)/d², 7e-4 here.
#[test]
fn a_keyhole_lights_as_a_small_lamp() {
    let camera = look([0.31, 1.06, 0.0], [0.31, 1.06, 4.0], UP, 0.05);
    let expected = 0.75 * 1600.0 * 0.06 * 0.12 / (std::f64::consts::PI * 25.0);
    let options = RenderOptions { max_depth: 2, ..RenderOptions::default() };
    agrees(mean(stiff("keyhole", Some(camera)), 4, 64, 800, 0, options), expected, 2e-3);
}

/// Sixteen decades in one picture. Each panel shows exactly its own radiance. Niches at the corners are
/// mirror images of each other, as are those at the edges, so their pictures are too, up to their panels'
/// radiance. Next event estimation by itself finds the dim panels beside the bright ones, too, though with
/// more noise.
#[test]
fn decades_keep_to_themselves() {
    let mis = decades(Estimator::Mis, 4);
    let next = decades(Estimator::NextEvents, 16);
    for (a, b) in [(0, 2), (2, 6), (6, 8), (1, 3), (3, 5), (5, 7)] {
        agree(mis[a], mis[b], 0.05);
    }
    for i in 0..9 {
        agree(mis[i], next[i], 0.1);
    }
}

/// Asserts that two means agree within five standard errors, which must be small enough to prove something.
fn agree((x, e): (f64, f64), (y, f): (f64, f64), most: f64) {
    assert!((x - y).abs() < 5.0 * e.hypot(f), "{x} ± {e}, {y} ± {f}");
    assert!(e.hypot(f) < most * x, "{x} ± {e}, {y} ± {f}");
}

/// The mean of each niche of `decades` without its panel, over its panel's radiance, and the standard error,
/// from 64 batches.
fn decades(estimator: Estimator, samples: u64) -> Vec<(f64, f64)> {
    const SIZE: usize = 96;
    let options = RenderOptions { estimator, ..RenderOptions::default() };
    let mut source = Ptwne::new(stiff("decades", None), SIZE, SIZE, options).unwrap();
    let batches: Vec<Vec<Rgb>> = (0..64).map(|i| batch(&mut source, i * samples, samples)).collect();
    assert_eq!(source.counts().dropped, 0);
    let niche = |i: usize| {
        let radiance = 10f64.powi(2 * i as i32 - 8);
        // Centres of niches are 28 pixels apart
        let [x, y] = [20 + 28 * (i % 3), 20 + 28 * (i / 3)];
        let panel = f64::from(batches[0][y * SIZE + x][0]);
        assert!((panel - radiance).abs() < 1e-6 * radiance, "{panel} {radiance}");
        // From centre to centre of pixels, in halves of pixels, so that all masks are mirror images too
        let near = |p: usize, centre: usize, range: usize| (2 * p + 1).abs_diff(2 * centre) <= 2 * range;
        let within = |range: usize| move |p: &usize| near(p % SIZE, x, range) && near(p / SIZE, y, range);
        let wall: Vec<usize> = (0..SIZE * SIZE).filter(within(12)).filter(|p| !within(6)(p)).collect();
        let means: Vec<f64> = batches
            .iter()
            .map(|b| wall.iter().map(|p| f64::from(b[*p][0]) / radiance).sum::<f64>() / wall.len() as f64)
            .collect();
        mean_of(&means)
    };
    (0..9).map(niche).collect()
}

/// A scene far from the origin has the same picture. Its numbers are multiples of 1/16, which f32 can hold
/// there.
#[test]
fn far_away_is_as_near() {
    let at = |to: [f32; 3], p: [f32; 3]| -> [f32; 3] { std::array::from_fn(|i| to[i] + p[i]) };
    let camera = |to, eye| look(at(to, eye), at(to, [0.0, -40.0, 0.0]), UP, 40.0);
    let build = |to: [f32; 3]| {
        scene(camera(to, [100.0, 60.0, 420.0]), |b| {
            let grey = b.material(Material::diffuse([0.6; 3])).unwrap();
            let metal = b
                .material(Material::RoughConductor { reflectance: [0.9; 3].into(), roughness: 0.2 })
                .unwrap();
            let glass = b.material(Material::Glass { ior: 1.5, tint: [0.9; 3] }).unwrap();
            let corner = at(to, [-300.0, -128.0, -300.0]);
            b.parallelogram(corner, [0.0, 0.0, 600.0], [600.0, 0.0, 0.0], grey, None).unwrap();
            b.sphere(at(to, [-90.0, -68.0, 0.0]), 60.0, metal, None).unwrap();
            b.sphere(at(to, [70.0, -78.0, 60.0]), 50.0, glass, None).unwrap();
            let light = || Some(Emission::front([6.0; 3]));
            let edges = [[90.0, 0.0, 0.0], [0.0, 0.0, 60.0]];
            b.disk(at(to, [0.0, 128.0, 0.0]), edges, false, grey, light()).unwrap();
            let corners =
                [[-60.0, 10.5, -200.0], [60.0, 0.0, -200.0], [0.0, 100.0, -180.0625]].map(|p| at(to, p));
            let mesh = Mesh { positions: &corners, indices: &[[0, 1, 2]], ..Mesh::default() };
            b.mesh(&mesh, metal, light()).unwrap();
            let position = at(to, [200.0, 100.0, 200.0]);
            b.punctual(Punctual::Point { position, intensity: [40_000.0; 3] }).unwrap();
        })
    };
    let render = |scene| {
        let mut source = source(scene, 32);
        (batch(&mut source, 0, 8), source.reference().unwrap().pixels)
    };
    let (here, there) = ([0.0; 3], [998_000.0, -999_000.0, 997_000.0]);
    assert_eq!(render(build(here)), render(build(there)));
    let aside = |to| build(to).with_camera(camera(to, [-200.0, 20.0, 300.0])).unwrap();
    assert_eq!(render(aside(here)), render(aside(there)));
}
