//! The hierarchy against a loop over all surfaces.

use super::tree::is_crowded;
use super::{Bvh, Hierarchy, Shape};
use crate::math::{self, Ray, Vec3};
use crate::rng::{Key, Rng};
use obvhs::aabb::Aabb;

fn alone_in_scene(own: Bvh) -> Hierarchy {
    Hierarchy::new(own, vec![], vec![])
}

/// The hierarchy finds the same surfaces as a loop over all of them.
#[test]
fn traversal_agrees_with_a_loop() {
    let mut rng = Rng::new(Key::new(7), 0, 0);
    let mut point =
        |scale: f32| glam::Vec3::from_array([rng.one(), rng.one(), rng.one()]) * scale - 0.5 * scale;
    let shapes: Vec<Shape> = (0..300)
        .map(|i| match i % 3 {
            0 => Shape::Sphere { centre: point(4.0), radius: 0.1 },
            1 if i % 2 == 0 => Shape::Disk { centre: point(4.0), e1: point(1.0), e2: point(1.0) },
            k => Shape::Planar { corner: point(4.0), e1: point(1.0), e2: point(1.0), whole: k == 1 },
        })
        .collect();
    let all: Vec<u32> = (0..shapes.len() as u32).collect();
    let bvh = alone_in_scene(Bvh::new(&shapes, &all));
    let alone: Vec<Hierarchy> = shapes.iter().map(|s| alone_in_scene(Bvh::new(&[*s], &[0]))).collect();
    let mut stack = bvh.stack();
    let mut hits = 0;
    for i in 0..5000 {
        let mut rng = Rng::new(Key::new(8), i, 0);
        let ray = Ray { origin: point(4.0).into(), dir: math::sphere(rng.two()).normalize() };
        let hit = bvh.closest(&ray, &mut stack, |_, _, _| true);
        let all = alone.iter().map(|a| a.closest(&ray, &mut stack, |_, _, _| true).t);
        let best = all.fold(f32::INFINITY, f32::min);
        // A surface alone is widened less
        assert!(hit.t == best || (hit.t - best).abs() < 1e-5 * best, "{} {best}", hit.t);
        assert_eq!(bvh.blocked::<true>(&ray, f32::INFINITY, &mut stack, |_, _, _| true), best.is_finite());
        if best.is_finite() {
            hits += 1;
            assert!(!bvh.blocked::<true>(&ray, hit.t, &mut stack, |_, _, _| true));
        }
    }
    assert!(hits > 500, "{hits}");
}

#[test]
fn no_ray_hits_an_empty_hierarchy() {
    let bvh = alone_in_scene(Bvh::new(&[], &[]));
    let ray = Ray { origin: Vec3::ZERO, dir: Vec3::new(0.0, 0.6, -0.8) };
    assert!(bvh.closest(&ray, &mut bvh.stack(), |_, _, _| true).t.is_infinite());
    assert!(!bvh.blocked::<false>(&ray, 1.0, &mut bvh.stack(), |_, _, _| true));
}

/// Where many boxes overlap, the hierarchy is still one of few levels, and says the same as a loop.
#[test]
fn crowds_make_no_deep_trees() {
    let (near, far) = (glam::Vec3::ZERO, glam::Vec3::splat(50.0));
    let equal = |_| Shape::Sphere { centre: near, radius: 1.0 };
    let nested = |i| Shape::Sphere { centre: near, radius: 1.0 + i as f32 / 4000.0 };
    for crowd in [(0..4000).map(equal).collect::<Vec<_>>(), (0..4000).map(nested).collect()] {
        // In a scene that is mostly something else
        let mut shapes = crowd;
        shapes.extend((0..100).map(|i| Shape::Sphere { centre: far * i as f32, radius: 1.0 }));
        let all: Vec<u32> = (0..shapes.len() as u32).collect();
        let bvh = Bvh::new(&shapes, &all);
        // log₂ 4100 < 13 levels of two children, each of which leaves at most three nodes behind
        assert!(bvh.tree.waiting <= 3 * 13 + 4, "{}", bvh.tree.waiting);
        let hierarchy = alone_in_scene(bvh);
        let ray = Ray { origin: Vec3::new(0.0, 0.0, 10.0), dir: Vec3::NEG_Z };
        let hit = hierarchy.closest(&ray, &mut hierarchy.stack(), |_, _, _| true);
        let Shape::Sphere { radius, .. } = shapes[3999] else { unreachable!() };
        assert!((hit.t - (10.0 - radius)).abs() < 1e-5, "{}", hit.t);
    }
}

/// A crowd is found among more boxes than are looked at, and a lattice of as many boxes is none.
#[test]
fn crowds_are_found_by_a_sample() {
    let cube = |at: Vec3| Aabb::new(at - 0.4, at + 0.4);
    let lattice = |i: u32| cube(Vec3::new((i % 64) as f32, (i / 64 % 64) as f32, (i / 4096) as f32));
    let mut boxes: Vec<Aabb> = (0..150_000).map(lattice).collect();
    assert!(!is_crowded(&boxes));
    // One of 75 boxes: 2000 that a ray through them meets, more than the 500 that are allowed
    boxes.iter_mut().step_by(75).for_each(|crowded| *crowded = cube(Vec3::ZERO));
    assert!(is_crowded(&boxes));
}

/// Discs cut into triangles that share a corner, as CAD programs cut them: their tree is deeper than the 96 levels
/// that `obvhs` expects, and deeper still after reinsertion.
#[test]
fn fans_are_no_trouble() {
    for count in [400, 3000] {
        let rim = |i: u32| {
            let (sin, cos) = (std::f32::consts::TAU * i as f32 / (count + 2) as f32).sin_cos();
            glam::Vec3::new(cos, sin, 0.0)
        };
        let fan = |i: u32| {
            let (e1, e2) = (rim(i + 1) - rim(0), rim(i + 2) - rim(0));
            Shape::Planar { corner: rim(0), e1, e2, whole: false }
        };
        let shapes: Vec<Shape> = (0..count).map(fan).collect();
        let all: Vec<u32> = (0..count).collect();
        let bvh = Bvh::new(&shapes, &all);
        assert!(bvh.tree.waiting > 96, "{}", bvh.tree.waiting);
        let disc = alone_in_scene(bvh);
        let mut stack = disc.stack();
        for i in 0..2000 {
            let mut rng = Rng::new(Key::new(9), i, 0);
            let [x, y] = rng.two().map(|u| 2.0 * u - 1.0);
            let ray = Ray { origin: Vec3::new(x, y, 2.0), dir: Vec3::NEG_Z };
            // The polygon of so many sides, but for its rim
            let inside = x.hypot(y);
            if (inside - 1.0).abs() > 1e-3 {
                let hit = disc.closest(&ray, &mut stack, |_, _, _| true);
                assert_eq!(hit.t.is_finite(), inside < 1.0, "{x} {y}");
            }
        }
    }
}
