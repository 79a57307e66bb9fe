//! Albedo and normals of first hits, against what is known of the scene.

use crate::kit::{look, scene};
use noisefloor::{ProgressiveSource, source::FirstHits};
use noisefloor_ptwne::{Environment, Material, Ptwne, RenderOptions, Scene, scenes};
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
