//! Albedo and normals of first hits, against what is known of the scene.

use crate::kit::{batch, look, scene, source};
use noisefloor::{ProgressiveSource, source::FirstHits};
use noisefloor_ptwne::{Emission, Environment, Material, Ptwne, RenderOptions, Scene, scenes};
use std::num::NonZeroUsize;

fn hits(scene: Scene, index: u64, threads: usize) -> FirstHits {
    let options = RenderOptions { threads: NonZeroUsize::new(threads), ..RenderOptions::default() };
    Ptwne::new(scene, 40, 40, options).unwrap().first_hits(index, 16).unwrap().unwrap()
}

/// A ball of one colour before a sky: its normals are those of a sphere seen from far away.
#[test]
fn a_ball_shows_its_colour_and_its_normals() {
    let ball = || {
        // The ball reaches across half of the picture
        let angle = 2.0 * (2.0f32 / 1000.0).atan().to_degrees();
        let camera = look([0.0, 0.0, 1000.0], [0.0; 3], [0.0, 1.0, 0.0], angle);
        scene(camera, |builder| {
            let paint = builder.material(Material::diffuse([0.2, 0.5, 0.8])).unwrap();
            builder.sphere([0.0; 3], 1.0, paint, None).unwrap();
            builder.environment(Environment::constant([0.25, 3.0, 0.0])).unwrap();
        })
    };
    let seen = hits(ball(), 0, 1);
    let mut inside = 0;
    for (i, (albedo, normal)) in seen.albedo.iter().zip(&seen.normal).enumerate() {
        let at = |n: usize| (n as f32 + 0.5) / 10.0 - 2.0;
        let (x, y) = (at(i % 40), -at(i / 40));
        let squared = x * x + y * y;
        if squared < 0.7 {
            inside += 1;
            assert!(albedo.iter().zip([0.2, 0.5, 0.8]).all(|(a, b)| (a - b).abs() < 1e-5), "{albedo:?}");
            let expected = [x, y, (1.0 - squared).sqrt()];
            // A pixel is a tenth of the radius
            let off = normal.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(off < 0.03, "{normal:?}, not {expected:?}");
        } else if squared > 1.2 {
            assert_eq!((*albedo, *normal), ([0.25, 1.0, 0.0], [0.0; 3]), "the sky, cut to 1");
        }
    }
    assert!(inside > 150, "{inside}");
}

#[test]
fn they_repeat_and_indices_differ() {
    for name in ["glass-spheres", "courtyard"] {
        let scene = || scenes::by_name(name).unwrap();
        let first = hits(scene(), 0, 1);
        assert!(first == hits(scene(), 0, 3), "{name}: threads changed them");
        assert!(first != hits(scene(), 1, 1), "{name}");
    }
}

/// Coloured walls around a glass ball, a pane, a slab and a mirror. `shining`: the walls are black, and emit what is their
/// albedo otherwise. Then the radiance of each path is the albedo of where it ends, times what glass and mirrors
/// did to it: what first hits are to be, by a path tracer.
fn gallery(shining: bool) -> Scene {
    scene(look([0.0, 0.0, 4.0], [0.0; 3], [0.0, 1.0, 0.0], 50.0), |b| {
        let mut wall = |corner, e1, e2, colour: [f32; 3]| {
            let paint = b.material(Material::diffuse(if shining { [0.0; 3] } else { colour })).unwrap();
            let light = shining.then(|| Emission::two_sided(colour));
            b.parallelogram(corner, e1, e2, paint, light).unwrap();
        };
        let (x, y, z) = ([12.0, 0.0, 0.0], [0.0, 12.0, 0.0], [0.0, 0.0, 12.0]);
        let (low, high) = ([-6.0; 3], [6.0; 3]);
        let minus = |e: [f32; 3]| e.map(|c| -c);
        wall(low, x, y, [0.7, 0.2, 0.1]);
        wall(low, y, z, [0.1, 0.6, 0.2]);
        wall(low, z, x, [0.5, 0.5, 0.5]);
        wall(high, minus(x), minus(y), [0.2, 0.3, 0.9]);
        wall(high, minus(y), minus(z), [0.9, 0.8, 0.1]);
        wall(high, minus(z), minus(x), [0.3, 0.9, 0.9]);
        let glass = b.material(Material::Glass { ior: 1.5, tint: [0.95, 0.9, 1.0] }).unwrap();
        b.sphere([-0.9, 0.7, 0.0], 0.6, glass, None).unwrap();
        // A slab: its front and its back, each with its normal to the outside
        b.parallelogram([-1.6, -1.5, 0.4], [1.2, 0.0, 0.0], [0.0, 1.2, 0.0], glass, None).unwrap();
        b.parallelogram([-0.4, -1.5, 0.2], [-1.2, 0.0, 0.0], [0.0, 1.2, 0.0], glass, None).unwrap();
        let pane = b.material(Material::ThinGlass { ior: 1.5, tint: [0.8, 0.9, 0.9] }).unwrap();
        b.parallelogram([0.2, -1.5, 0.0], [1.0, 0.0, 0.8], [0.0, 1.2, 0.0], pane, None).unwrap();
        let mirror = b.material(Material::Mirror { reflectance: [0.9, 0.8, 0.7] }).unwrap();
        b.sphere([0.9, 0.7, 0.0], 0.6, mirror, None).unwrap();
    })
}

/// Behind glass and in mirrors, albedo is what a path tracer finds where surfaces shine as bright as their albedo: on average
/// within 0.004, with 400 times 256 paths; per pixel within what ways of less than 1/64 are worth that are not followed,
/// at most three in a ball, beside five standard errors of its paths.
#[test]
fn glass_and_mirrors_show_what_is_seen_in_them() {
    let seen = hits(gallery(false), 0, 2);
    let mut shining =
        Ptwne::new(gallery(true), 40, 40, RenderOptions { roulette: 1000, ..Default::default() }).unwrap();
    let paths = 256;
    let (truth, again) = (batch(&mut shining, 0, paths), batch(&mut shining, paths, paths));
    let (mut sum, mut off) = (0.0, Vec::new());
    for (pixel, albedo) in seen.albedo.iter().enumerate() {
        for c in 0..3 {
            let mean = 0.5 * (truth[pixel][c] + again[pixel][c]);
            sum += f64::from(albedo[c] - mean);
            off.push((albedo[c] - mean).abs());
        }
    }
    let mean = sum / off.len() as f64;
    assert!(mean.abs() < 0.004, "{mean}");
    off.sort_by(f32::total_cmp);
    // Pixels with an edge of glass in them have noise of their own
    let most = off[off.len() * 98 / 100];
    assert!(most < 0.06, "{most}");
    // The tint of glass alone would be far off
    let tinted = seen.albedo.iter().filter(|albedo| albedo[2] > 0.93).count();
    assert_eq!(tinted, 0);
}

/// In a mirror, normals are those of what it shows; behind a pane, of both by their shares.
#[test]
fn normals_are_those_of_what_is_seen() {
    let normal = |material: Material| {
        let scene = scene(look([0.0, 0.0, 2.0], [0.0; 3], [0.0, 1.0, 0.0], 1.0), |b| {
            let wall = b.material(Material::diffuse([0.5; 3])).unwrap();
            // Turned to the left behind the pane, facing it behind the camera
            b.parallelogram([-20.0, -10.0, -20.0], [40.0, 0.0, 40.0], [0.0, 20.0, 0.0], wall, None).unwrap();
            b.parallelogram([-9.0, -9.0, 9.0], [0.0, 18.0, 0.0], [18.0, 0.0, 0.0], wall, None).unwrap();
            let material = b.material(material).unwrap();
            b.parallelogram([-1.0, -1.0, 1.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0], material, None).unwrap();
        });
        hits(scene, 0, 1).normal[20 * 40 + 20]
    };
    let near = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 0.01);
    let mirrored = normal(Material::Mirror { reflectance: [0.3; 3] });
    assert!(near(mirrored, [0.0, 0.0, -1.0]), "{mirrored:?}");
    // A twenty-fifth of light is reflected at each of two boundaries, 0.0769 with what goes to and fro
    let behind = normal(Material::ThinGlass { ior: 1.5, tint: [0.1; 3] });
    let (share, slope) = (0.076_923, std::f32::consts::FRAC_1_SQRT_2);
    let expected = [-slope * (1.0 - share), 0.0, slope * (1.0 - share) - share];
    assert!(near(behind, expected), "{behind:?}, not {expected:?}");
}

/// Where all rays of a pixel agree, a few do: more change nothing. At the ball's edge, more are better.
#[test]
fn rays_go_where_they_disagree() {
    let ball = || {
        scene(look([0.0, 0.0, 10.0], [0.0; 3], [0.0, 1.0, 0.0], 20.0), |b| {
            let paint = b.material(Material::diffuse([0.8; 3])).unwrap();
            b.sphere([0.0; 3], 1.0, paint, None).unwrap();
        })
    };
    let with = |index, spp| source(ball(), 40).first_hits(index, spp).unwrap().unwrap();
    let (few, many) = (with(0, 16), with(0, 256));
    let same = few.albedo.iter().zip(&many.albedo).filter(|(a, b)| a == b).count();
    assert!((1300..1600).contains(&same), "{same} of 1600");
    let noise = |spp| -> f32 {
        let (a, b) = (with(1, spp), with(2, spp));
        a.albedo.iter().zip(&b.albedo).map(|(a, b)| (a[0] - b[0]).powi(2)).sum()
    };
    let (few, many) = (noise(16), noise(256));
    assert!(many < 0.1 * few, "{many} and {few}");
}
