//! The hierarchy against a loop over all surfaces.

use super::bvh::LocalHit;
use super::node::{Node, WideRay};
use super::tree::Waiting;
use super::{Bvh, Hierarchy, Shape, Surface};
use crate::geometry::NO;
use crate::math::{self, Ray, Vec3};
use crate::rng::{Key, Rng};

fn alone_in_scene(own: Bvh) -> Hierarchy {
    Hierarchy::new(own, vec![], vec![])
}

fn built(shapes: &[Shape]) -> Bvh {
    Bvh::new(shapes.iter().zip(0..).map(|(shape, prim)| Surface { shape: *shape, prim }).collect())
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
    let bvh = alone_in_scene(built(&shapes));
    let alone: Vec<Hierarchy> = shapes.iter().map(|s| alone_in_scene(built(&[*s]))).collect();
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
    let bvh = alone_in_scene(built(&[]));
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
        let bvh = built(&shapes);
        // log₂ 4100 < 13 levels of two children, each of which leaves at most seven nodes behind
        assert!(bvh.tree.waiting <= 7 * 13 + 8, "{}", bvh.tree.waiting);
        let hierarchy = alone_in_scene(bvh);
        let ray = Ray { origin: Vec3::new(0.0, 0.0, 10.0), dir: Vec3::NEG_Z };
        let hit = hierarchy.closest(&ray, &mut hierarchy.stack(), |_, _, _| true);
        let Shape::Sphere { radius, .. } = shapes[3999] else { unreachable!() };
        assert!((hit.t - (10.0 - radius)).abs() < 1e-5, "{}", hit.t);
    }
}

/// Discs cut into triangles that share a corner, as CAD programs cut them.
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
        let bvh = built(&shapes);
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

/// Triangles of many sizes.
fn crowd(count: u32) -> Vec<Shape> {
    let triangle = |i| {
        let mut rng = Rng::new(Key::new(10), i, 0);
        let mut point =
            |scale: f32| glam::Vec3::from_array([rng.one(), rng.one(), rng.one()]) * scale - 0.5 * scale;
        let size = 4.0 / (1.0 + (i % 100) as f32);
        Shape::Planar { corner: point(4.0), e1: point(size), e2: point(size), whole: false }
    };
    (0..u64::from(count)).map(triangle).collect()
}

fn random_ray(i: u64) -> Ray {
    let mut rng = Rng::new(Key::new(11), i, 0);
    let origin = Vec3::new(rng.one(), rng.one(), rng.one()) * 4.0 - 2.0;
    Ray { origin, dir: math::sphere(rng.two()).normalize() }
}

/// Trees have the same nodes and leaves in the same places for any number of threads. There are so many surfaces that
/// threads share them out.
#[test]
fn threads_leave_no_trace_in_a_tree() {
    let shapes = crowd(100_000);
    let [one, three] = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| built(&shapes))
    });
    assert_eq!([one.tree.waiting, one.packs.len()], [three.tree.waiting, three.packs.len()]);
    let mut waiting = Waiting::new(one.tree.waiting);
    let slots = |bvh: &Bvh, waiting: &mut Waiting| -> Vec<u32> {
        (0..5000).map(|i| bvh.closest(&random_ray(i), f32::INFINITY, waiting, |_, _| true).slot).collect()
    };
    let slots = [slots(&one, &mut waiting), slots(&three, &mut waiting)];
    assert!(slots[0] == slots[1]);
    assert!(slots[0].iter().filter(|slot| **slot != NO).count() > 1000);
}

/// What the vector instructions of this processor find is what four lanes at a time find, to the bit.
#[test]
fn instructions_leave_no_trace_in_a_hit() {
    let bvh = built(&crowd(3000));
    let mut waiting = Waiting::new(bvh.tree.waiting);
    let mut hits = 0;
    for i in 0..20_000 {
        let ray = random_ray(i);
        let hit = bvh.closest(&ray, f32::INFINITY, &mut waiting, |_, _| true);
        let plain = bvh.nearest::<false>(&ray, f32::INFINITY, &mut waiting, |_, _| true, Node::meet);
        let bits = |hit: LocalHit| (hit.t.to_bits(), hit.slot, hit.uv.map(f32::to_bits));
        assert_eq!(bits(hit), bits(plain), "{ray:?}");
        let length = 2.0 * hit.t.min(1.0);
        assert_eq!(
            bvh.blocked::<false>(&ray, length, &mut waiting, |_, _| true),
            bvh.any::<false, false>(&ray, length, &mut waiting, |_, _| true, Node::meet),
        );
        hits += usize::from(hit.slot != NO);
    }
    assert!(hits > 5000, "{hits}");
}

/// A ray that begins in the plane of many lamps, as a camera between them, looks at none of them.
#[test]
fn what_lies_where_a_ray_begins_is_not_looked_at() {
    let flat = |z: f32| Shape::Planar {
        corner: glam::Vec3::new(-1.0, -1.0, z),
        e1: glam::Vec3::X * 2.0,
        e2: glam::Vec3::Y * 2.0,
        whole: true,
    };
    let shapes = [vec![flat(0.0); 20_000], vec![flat(-1.0)]].concat();
    let bvh = built(&shapes);
    let ray = Ray { origin: Vec3::new(0.1, 0.2, 0.0), dir: Vec3::new(0.3, 0.1, -0.9).normalize() };
    let wide = WideRay::new(&ray);
    let mut waiting = Waiting::new(bvh.tree.waiting);
    let mut looked = 0;
    bvh.tree.nearest(&wide, f32::INFINITY, &mut waiting, Node::meet, |_| {
        looked += 1;
        f32::INFINITY
    });
    assert!(looked < 10, "{looked}");
    let hit = bvh.closest(&ray, f32::INFINITY, &mut waiting, |_, _| true);
    assert!((hit.t - ray.dir.z.recip().abs()).abs() < 1e-5, "{}", hit.t);
}

/// Both ways to meet boxes agree to the bit where a ray runs along a side of a box, or a box is empty.
#[test]
fn instructions_leave_no_trace_at_the_sides_of_boxes() {
    let shapes = crowd(3000);
    let bvh = built(&shapes);
    let mut waiting = Waiting::new(bvh.tree.waiting);
    for i in 0..2000 {
        let [corner, axis] = [i / 3, i % 3];
        let Shape::Planar { corner, .. } = shapes[corner] else { unreachable!() };
        let dir = [Vec3::X, Vec3::NEG_Y, Vec3::Z][axis];
        let ray = Ray { origin: Vec3::from(corner) - dir, dir };
        let hit = bvh.closest(&ray, f32::INFINITY, &mut waiting, |_, _| true);
        let plain = bvh.nearest::<false>(&ray, f32::INFINITY, &mut waiting, |_, _| true, Node::meet);
        assert_eq!((hit.t.to_bits(), hit.slot), (plain.t.to_bits(), plain.slot), "{ray:?}");
    }
}
