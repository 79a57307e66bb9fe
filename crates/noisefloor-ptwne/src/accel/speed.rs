//! Rays a second, beside Embree's: docs/benchmarks/bvh.md.
//!
//! `NOISEFLOOR_RAYS=FOLDER/NAME cargo test --release -p noisefloor-ptwne --lib speed -- --ignored --nocapture`
//! reads what benchmarks/rays has written for a scene.

use super::{Bvh, Hierarchy, Shape, Surface};
use crate::math::Ray;
use std::time::{Duration, Instant};

const PASSES: usize = 10;
const PART: usize = 5000;

/// A ray, its length, and what Embree says of it.
struct Told {
    ray: Ray,
    length: f32,
    found: f32,
}

fn floats(stem: &str, end: &str) -> Vec<f32> {
    let bytes = std::fs::read(format!("{stem}.{end}")).expect("benchmarks/rays/ has written the file");
    bytes.as_chunks::<4>().0.iter().map(|four| f32::from_le_bytes(*four)).collect()
}

fn rays(stem: &str, end: &str) -> Vec<Told> {
    let told = |r: &[f32; 8]| Told {
        ray: Ray { origin: glam::Vec3A::new(r[0], r[1], r[2]), dir: glam::Vec3A::new(r[3], r[4], r[5]) },
        length: r[6],
        found: r[7],
    };
    floats(stem, end).as_chunks::<8>().0.iter().map(told).collect()
}

/// The most memory that this process had so far, in bytes.
fn peak() -> usize {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or_default();
    line.split_whitespace().next().and_then(|kilobytes| kilobytes.parse().ok()).map_or(0, |k: usize| k * 1024)
}

/// Millions of rays a second, of the shortest of some passes over each part of them: other processes on the machine
/// spare some.
fn rate<Answer>(rays: &[Told], answers: &mut [Answer], mut trace: impl FnMut(&Told) -> Answer) -> f64 {
    let mut best = vec![Duration::MAX; rays.len().div_ceil(PART)];
    for _ in 0..PASSES {
        for ((rays, answers), best) in rays.chunks(PART).zip(answers.chunks_mut(PART)).zip(&mut best) {
            let start = Instant::now();
            for (told, answer) in rays.iter().zip(answers) {
                *answer = trace(told);
            }
            *best = start.elapsed().min(*best);
        }
    }
    rays.len() as f64 / best.iter().sum::<Duration>().as_secs_f64() / 1e6
}

#[test]
#[ignore = "a benchmark, for a scene that NOISEFLOOR_RAYS names"]
fn speed() {
    let stem = std::env::var("NOISEFLOOR_RAYS").expect("NOISEFLOOR_RAYS names a scene");
    let surfaces: Vec<Surface> = {
        let corners = floats(&stem, "triangles");
        let shape = |c: &[f32; 9]| {
            let [a, b, c] = [0, 3, 6].map(|i| glam::Vec3::new(c[i], c[i + 1], c[i + 2]));
            Shape::Planar { corner: a, e1: b - a, e2: c - a, whole: false }
        };
        let mut shapes: Vec<Shape> = corners.as_chunks::<9>().0.iter().map(shape).collect();
        let has_area = |s: &Shape| {
            let Shape::Planar { e1, e2, .. } = s else { return true };
            0.5 * e1.as_dvec3().cross(e2.as_dvec3()).length() >= f64::from(crate::builder::MIN_AREA)
        };
        shapes.retain(has_area);
        shapes.into_iter().zip(0..).map(|(shape, prim)| Surface { shape, prim }).collect()
    };
    // From here on, only what building takes
    let _ = std::fs::write("/proc/self/clear_refs", "5");
    let (before, start) = (peak(), Instant::now());
    let count = surfaces.len();
    let bvh = Bvh::new(surfaces);
    let (build, building) = (start.elapsed().as_secs_f64(), peak().saturating_sub(before));
    let per = |bytes: usize| bytes as f64 / count as f64;
    println!(
        "{stem}: {} triangles, built in {build:.2} s; bytes a triangle: {:.0}, while building {:.0} more than {}",
        count,
        per(bvh.bytes()),
        per(building),
        size_of::<Surface>(),
    );

    let scene = Hierarchy::new(bvh, vec![], vec![]);
    let mut stack = scene.stack();
    let (closest, shadow) = (rays(&stem, "closest"), rays(&stem, "shadow"));
    let mut found = vec![0.0; closest.len()];
    let closest_rate =
        rate(&closest, &mut found, |told| scene.closest(&told.ray, &mut stack, |_, _, _| true).t);
    let same = |(told, found): &(&Told, &f32)| {
        **found == told.found || (**found - told.found).abs() <= 1e-3 * told.found
    };
    let agree = closest.iter().zip(&found).filter(same).count() as f64 / closest.len() as f64;
    let mut blocked = vec![false; shadow.len()];
    let shadow_rate = rate(&shadow, &mut blocked, |told| {
        scene.blocked::<false>(&told.ray, told.length, &mut stack, |_, _, _| true)
    });
    let same = |(told, blocked): &(&Told, &bool)| **blocked == (told.found > 0.5);
    let agree_shadow = shadow.iter().zip(&blocked).filter(same).count() as f64 / shadow.len() as f64;
    println!(
        "  {closest_rate:.2} and {shadow_rate:.2} million rays a second, {:.3} and {:.3} % as Embree's",
        100.0 * agree,
        100.0 * agree_shadow
    );
    assert!(agree > 0.999 && agree_shadow > 0.999);
}
