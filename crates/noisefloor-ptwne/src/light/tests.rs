//! Choice, densities and solid angles of lights.

use super::choice::Lights;
use super::cone::Falloff;
use super::emitter::{Light, LightShape};
use super::punctual::Punctual;
use super::receiver::Receiver;
use crate::accel::Shape;
use crate::math::{self, Vec3};
use crate::rng::{Key, Rng};
use std::f32::consts::PI;

/// A one-sided square with corner (x, y, z) that faces down.
fn ceiling([x, y, z]: [f32; 3], radiance: f32) -> Light {
    let (corner, e1, e2) = (glam::Vec3::new(x, y, z), glam::Vec3::X, glam::Vec3::Z);
    Light::surface(&Shape::Planar { corner, e1, e2, whole: true }, Vec3::splat(radiance), false, 0)
}

/// Numbers for a scene.
struct Draw(Rng);

impl Draw {
    fn new(seed: u64) -> Self {
        Self(Rng::new(Key::new(seed), 0, 0))
    }

    fn point(&mut self, size: f32) -> glam::Vec3 {
        glam::Vec3::from_array([self.0.one(), self.0.one(), self.0.one()]) * size - 0.5 * size
    }

    fn direction(&mut self) -> Vec3 {
        math::sphere(self.0.two()).normalize()
    }

    /// A light of any kind that has a position, within a cube of size 4; strengths vary by six decades.
    fn light(&mut self, i: usize) -> Light {
        let radiance = Vec3::splat(10f32.powf(6.0 * self.0.one() - 3.0));
        let (corner, e1, e2) = (self.point(4.0), self.point(0.6), self.point(0.6));
        let (position, intensity) = (corner.to_array(), radiance.to_array());
        let shape = match i % 6 {
            0 => Shape::Sphere { centre: corner, radius: 0.05 + 0.2 * self.0.one() },
            1 => Shape::Planar { corner, e1, e2, whole: true },
            2 => Shape::Planar { corner, e1, e2, whole: false },
            3 => Shape::Disk { centre: corner, e1, e2 },
            4 => return Light::punctual(Punctual::Point { position, intensity }).unwrap(),
            _ => {
                let direction = self.direction().to_array();
                let (inner, outer, falloff) = (10.0, 10.0 + 80.0 * self.0.one(), Falloff::Squared);
                let spot = Punctual::Spot { position, direction, intensity, inner, outer, falloff };
                return Light::punctual(spot).unwrap();
            }
        };
        Light::surface(&shape, radiance, i.is_multiple_of(4), 0)
    }

    /// A lamp that faces down, of so many triangles within 0.03 of its middle that differ in size and a
    /// little in direction: one patch of a scene of the size 5.
    fn lamp(&mut self, middle: glam::Vec3, radiance: f32, triangles: usize) -> Vec<Light> {
        let mut triangle = || {
            let corner = middle + self.point(0.02);
            let (e1, e2) = (glam::Vec3::X * 0.01 * self.0.one(), glam::Vec3::Z * 0.01);
            let shape = Shape::Planar { corner, e1, e2: e2 + self.point(0.003), whole: false };
            Light::surface(&shape, Vec3::splat(radiance), false, 0)
        };
        (0..triangles).map(|_| triangle()).collect()
    }

    /// A diffuse or glossy receiver.
    fn receiver(&mut self) -> Receiver {
        let mut receiver = Receiver::diffuse(self.point(5.0).into(), self.direction());
        if self.0.one() < 0.5 {
            let alpha = 0.01 + self.0.one();
            let diffuse = (self.0.one() - 0.5).max(0.0);
            let (position, normal) = (receiver.position, receiver.normal);
            receiver = Receiver::new(position, normal, diffuse, 1.0, self.direction(), alpha * alpha);
        }
        receiver
    }
}

/// Scenes of 1 to 300 lights and up to three lamps of many triangles, also with a distant light, a sun or an
/// environment map.
fn scenes() -> Vec<Lights> {
    let mut draw = Draw::new(3);
    let mut all = vec![];
    for (seed, count) in [2, 3, 4, 5, 17, 300].into_iter().enumerate() {
        for far in 0..4 {
            let mut lights: Vec<Light> = (0..count).map(|i| draw.light(i + seed)).collect();
            for radiance in (0..seed.min(3)).map(|i| 10f32.powi(i as i32)) {
                let middle = draw.point(4.0);
                lights.extend(draw.lamp(middle, radiance, 20));
            }
            let direction = draw.direction();
            if far == 1 || far == 2 {
                let (direction, irradiance) = (direction.to_array(), [0.1; 3]);
                lights.push(Light::punctual(Punctual::Distant { direction, irradiance }).unwrap());
            }
            if far == 2 {
                lights.push(Light::sun(direction, 0.1, Vec3::splat(30.0)));
            }
            if far == 3 {
                lights.push(Light::map(Vec3::splat(0.5)));
            }
            all.push(Lights::new(lights, [Vec3::splat(-2.5), Vec3::splat(2.5)], &[]));
        }
    }
    all
}

/// Evenly spaced numbers choose each light as often as its probability says: choices by geometry and by
/// scattered light each give it one interval, which holds one number more or less than its length.
#[test]
fn lights_are_chosen_with_their_probabilities() {
    const N: usize = 1 << 13;
    let mut draw = Draw::new(4);
    for lights in scenes() {
        for _ in 0..10 {
            let receiver = draw.receiver();
            let mut counts = vec![0; lights.all.len()];
            for i in 0..N {
                if let Some((light, pmf)) =
                    lights.choose(&lights.prospect(receiver), (i as f32 + 0.5) / N as f32, 0.0)
                {
                    let again = lights.pmf(&lights.prospect(receiver), light);
                    assert!((again - pmf).abs() <= 1e-5 * pmf, "{again} {pmf}");
                    counts[light] += 1;
                }
            }
            let mut sum = 0.0;
            for (light, count) in counts.iter().enumerate() {
                let pmf = f64::from(lights.pmf(&lights.prospect(receiver), light));
                assert!((pmf * N as f64 - f64::from(*count)).abs() < 2.1, "{light}: {count}, {pmf}");
                sum += pmf;
            }
            assert!(sum < 1.0 + 1e-5, "{sum}");
        }
    }
}

/// A light that is never chosen for a receiver sends none of its samples above the receiver's horizon.
#[test]
fn only_lights_without_effect_have_no_probability() {
    let mut draw = Draw::new(5);
    let mut idle = 0;
    for lights in scenes() {
        for _ in 0..20 {
            let receiver = draw.receiver();
            for (i, light) in lights.all.iter().enumerate() {
                // Maps have no samples without their image, and all have a probability
                if lights.pmf(&lights.prospect(receiver), i) > 0.0 || light.power_pmf == 0.0 {
                    continue;
                }
                idle += 1;
                for _ in 0..32 {
                    let [a, b] = draw.0.two();
                    let sample = light.sample(receiver.position, [a, b, 0.0], None);
                    let cos = sample.map_or(-1.0, |s| s.dir.dot(receiver.normal));
                    assert!(cos < 1e-3, "{light:?}: {cos}");
                }
            }
        }
    }
    assert!(idle > 1000, "{idle}");
}

/// Of lamps in a row the nearest is chosen most often, and of two equally near ones that which faces the
/// receiver.
#[test]
fn near_lights_that_face_the_receiver_are_preferred() {
    let bounds = [Vec3::splat(-8.0), Vec3::splat(8.0)];
    let lights = Lights::new((-5..=5).map(|i| ceiling([i as f32, 2.0, -0.5], 1.0)).collect(), bounds, &[]);
    let receiver = Receiver::diffuse(Vec3::new(2.5, 0.0, 0.0), Vec3::Y);
    let pmf: Vec<f32> = (0..11).map(|i| lights.pmf(&lights.prospect(receiver), i)).collect();
    assert!((0..11).all(|i| pmf[i] <= pmf[7]), "{pmf:?}");
    assert!(pmf[7] > 4.0 * pmf[0], "{pmf:?}");
    // Half of a metal's lobe points at the last lamp
    let mirror = Vec3::new(3.0, 2.0, 0.0).normalize();
    let metal = Receiver::new(receiver.position, receiver.normal, 0.0, 1.0, mirror, 0.01);
    assert!(lights.pmf(&lights.prospect(metal), 10) > 3.0 * lights.pmf(&lights.prospect(receiver), 10));
}

/// A lamp of many triangles is chosen as often as one of a single surface of the same power, and each of its
/// triangles by its area. Both halves of the choices count: the geometric one, too, takes the lamp as one.
#[test]
fn lamps_of_many_triangles_count_as_one() {
    let mut draw = Draw::new(6);
    let mut lights = draw.lamp(glam::Vec3::new(-1.0, 2.0, 0.0), 1.0, 100);
    let area = |light: &Light| match light.shape {
        LightShape::Planar { area, .. } => area,
        _ => 0.0,
    };
    let areas: Vec<f32> = lights.iter().map(area).collect();
    let sum: f32 = areas.iter().sum();
    lights.push(ceiling([0.5, 2.0, -0.5], sum));
    let lights = Lights::new(lights, [Vec3::splat(-2.5), Vec3::splat(2.5)], &[]);
    let prospect = lights.prospect(Receiver::diffuse(Vec3::ZERO, Vec3::Y));
    let pmf: Vec<f32> = (0..=100).map(|i| lights.pmf(&prospect, i)).collect();
    let lamp: f32 = pmf[..100].iter().sum();
    // The large one covers a part of the receiver's sky, so it needs fewer samples
    assert!((lamp + pmf[100] - 1.0).abs() < 1e-5 && (0.5..0.6).contains(&lamp), "{lamp} {}", pmf[100]);
    for (pmf, area) in pmf.iter().zip(&areas) {
        assert!((pmf / lamp - area / sum).abs() < 1e-5, "{pmf} {area}");
    }
}

/// A huge dim panel behind whose plane a receiver lies, or that lies below the receiver's horizon, takes no
/// samples of two small lamps, although the sphere around it holds the receiver.
#[test]
fn panels_that_do_not_reach_the_receiver_take_no_samples() {
    let panel = |corner, e1, e2| {
        Light::surface(&Shape::Planar { corner, e1, e2, whole: true }, Vec3::splat(0.5), false, 0)
    };
    let (up, far) = (glam::Vec3::Y * 40.0, glam::Vec3::Z * 40.0);
    // At x = −1 in the back of the receiver, facing −x; and a floor that faces up, half a unit below
    let wall = panel(glam::Vec3::new(-1.0, -20.0, -20.0), far, up);
    let floor = panel(glam::Vec3::new(-20.0, -0.5, -20.0), far, glam::Vec3::X * 40.0);
    let receiver = Receiver::diffuse(Vec3::ZERO, Vec3::Y);
    for large in [wall, floor] {
        let lamps = [ceiling([1.0, 3.0, 0.0], 20.0), ceiling([3.0, 3.0, 0.0], 20.0)];
        let lights = [large].into_iter().chain(lamps).collect();
        let lights = Lights::new(lights, [Vec3::splat(-20.0), Vec3::splat(20.0)], &[]);
        assert!(lights.all[0].power_pmf > 0.9, "{}", lights.all[0].power_pmf);
        let prospect = lights.prospect(receiver);
        let [panel, near, distant] = [0, 1, 2].map(|i| lights.pmf(&prospect, i));
        assert_eq!(panel, 0.0);
        assert!((near + distant - 1.0).abs() < 1e-6 && near > distant, "{near} {distant}");
    }
}

/// Two balls in the zenith send as much light. The large one covers r²/d² = 0.16 of what a diffuse receiver
/// scatters, so it is worth 1/1.16 of the small one; by geometry both are alike.
#[test]
fn lights_that_scattered_rays_find_need_fewer_samples() {
    let ball = |radius: f32| {
        let centre = glam::Vec3::new(0.0, 8.0, 0.0);
        Light::surface(&Shape::Sphere { centre, radius }, Vec3::splat(radius.powi(-2)), false, 0)
    };
    let lights = Lights::new(vec![ball(3.2), ball(1e-3)], [Vec3::splat(-9.0), Vec3::splat(9.0)], &[]);
    let prospect = lights.prospect(Receiver::diffuse(Vec3::ZERO, Vec3::Y));
    let [large, small] = [0, 1].map(|i| lights.pmf(&prospect, i));
    let expected = 0.8 * 1.16 / 2.16 + 0.2 * 0.5;
    assert!((small - expected).abs() < 1e-5 && (large - (1.0 - expected)).abs() < 1e-5, "{small} {large}");
}

/// Power decides what the reference's guide begins with.
#[test]
fn power_shares_are_those_of_the_power() {
    let powers = [1.0, 0.0, 5.0, 2.0, 0.5];
    let lights = powers.map(|power| ceiling([0.0; 3], power)).to_vec();
    let lights = Lights::new(lights, [Vec3::NEG_ONE, Vec3::ONE], &[]);
    for (light, power) in lights.all.iter().zip(powers) {
        assert!((light.power_pmf - power / 8.5).abs() < 1e-6);
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
    let below = || ceiling([-1.0, -1.0, -1.0], 1.0);
    let bounds = [Vec3::NEG_ONE, Vec3::ONE];
    let receiver = Receiver::diffuse(Vec3::ZERO, Vec3::Y);
    let lights = Lights::new(vec![below(), ceiling([-1.0, 1.0, -1.0], 1.0)], bounds, &[]);
    assert_eq!(
        (lights.pmf(&lights.prospect(receiver), 0), lights.pmf(&lights.prospect(receiver), 1)),
        (0.0, 1.0)
    );
    assert_eq!(lights.all[0].power_pmf, 0.0);
    let lights = Lights::new(vec![below()], bounds, &[]);
    assert!(lights.choose(&lights.prospect(receiver), 0.5, 0.0).is_none());
}
