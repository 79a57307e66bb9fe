//! Choice, densities and solid angles of lights.

use super::choice::Lights;
use super::emitter::Light;
use crate::accel::Shape;
use crate::math::Vec3;
use std::f32::consts::PI;

#[test]
fn lights_are_chosen_by_power() {
    let light = |power| {
        let (corner, e1, e2) = (glam::Vec3::ZERO, glam::Vec3::X, glam::Vec3::Y);
        Light::surface(&Shape::Planar { corner, e1, e2, whole: true }, Vec3::splat(power), false, 0)
    };
    let powers = [1.0, 0.0, 5.0, 2.0, 0.5];
    let lights = Lights::new(powers.map(light).to_vec(), [Vec3::NEG_ONE, Vec3::ONE], &[]);
    let n = 1 << 16;
    let mut counts = [0u32; 5];
    for i in 0..n {
        let chosen = lights.choose((i as f32 + 0.5) / n as f32, 0.0).unwrap().radiance.x;
        counts[powers.iter().position(|p| *p == chosen).unwrap()] += 1;
    }
    for (power, count) in powers.iter().zip(counts) {
        // A grid of 2¹⁶ points over ten intervals: off by at most ten points
        assert!((f64::from(count) / f64::from(n) - f64::from(*power) / 8.5).abs() < 10.0 / f64::from(n));
    }
}

/// The mean of 1/pdf over samples is the solid angle of the light.
#[test]
fn spheres_and_suns_subtend_their_solid_angle() {
    let from = Vec3::new(0.3, -0.2, 0.1);
    let ball = Shape::Sphere { centre: glam::Vec3::new(2.0, 1.0, 0.5), radius: 0.7 };
    let ball = Light::surface(&ball, Vec3::ONE, false, 0);
    let sample = ball.sample(from, [0.3, 0.6, 0.0], None).unwrap();
    let d2 = (Vec3::new(2.0, 1.0, 0.5) - from).length_squared();
    let omega = 2.0 * PI * (1.0 - (1.0 - 0.49 / d2).sqrt());
    assert!((1.0 / sample.pdf - omega).abs() < 1e-5);
    let point = from + sample.dir * sample.distance - Vec3::new(2.0, 1.0, 0.5);
    assert!((point.length() - 0.7).abs() < 1e-4);
    let sun = Light::sun(Vec3::Y, 0.27f32.to_radians(), Vec3::ONE);
    for i in 0..100 {
        let sample = sun.sample(from, [i as f32 / 100.0, i as f32 * 0.37 % 1.0, 0.0], None).unwrap();
        assert!(sun.covers(sample.dir) && !sun.covers(Vec3::new(0.006, 1.0, 0.0).normalize()));
    }
}

#[test]
fn lights_that_face_away_from_everything_are_not_chosen() {
    let light = |y: f32| {
        let (corner, e1, e2) = (glam::Vec3::new(-1.0, y, -1.0), glam::Vec3::X, glam::Vec3::Z);
        // e1×e2 points down
        Light::surface(&Shape::Planar { corner, e1, e2, whole: true }, Vec3::ONE, false, 0)
    };
    let lights = Lights::new(vec![light(-1.0), light(1.0)], [Vec3::NEG_ONE, Vec3::ONE], &[]);
    assert_eq!((lights.all[0].pmf, lights.all[1].pmf), (0.0, 1.0));
    assert!(Lights::new(vec![light(-1.0)], [Vec3::NEG_ONE, Vec3::ONE], &[]).choose(0.5, 0.0).is_none());
}
