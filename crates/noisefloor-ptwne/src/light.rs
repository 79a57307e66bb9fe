//! Emitters, and how next event estimation chooses points on them.

use crate::accel::Shape;
use crate::math::{self, Frame, Vec3};
use std::f32::consts::PI;

/// Where a light is.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Place {
    Planar {
        corner: Vec3,
        e1: Vec3,
        e2: Vec3,
        normal: Vec3,
        whole: bool,
        area: f32,
    },
    Sphere {
        centre: Vec3,
        radius: f32,
    },
    /// A cone of directions.
    Sun {
        frame: Frame,
        one_minus_cos: f32,
    },
}

/// An emitter: a surface of the scene, or the sun.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Light {
    pub(crate) place: Place,
    pub(crate) radiance: Vec3,
    pub(crate) two_sided: bool,
    /// Probability that next event estimation chooses this light.
    pub(crate) chance: f32,
}

/// A point on a light, seen from a point of the scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Aim {
    pub(crate) dir: Vec3,
    /// Infinite for the sun.
    pub(crate) distance: f32,
    /// Density in solid angle, given the light.
    pub(crate) pdf: f32,
}

impl Light {
    pub(crate) fn surface(shape: Shape, radiance: Vec3, two_sided: bool) -> Self {
        let place = match shape {
            Shape::Planar { corner, e1, e2, whole } => {
                let n = e1.cross(e2);
                let area = n.length() * if whole { 1.0 } else { 0.5 };
                Place::Planar { corner, e1, e2, normal: n.normalize(), whole, area }
            }
            Shape::Sphere { centre, radius } => Place::Sphere { centre, radius },
        };
        Self { place, radiance, two_sided, chance: 0.0 }
    }

    /// The sun: `radius` is half its apparent diameter in radians.
    pub(crate) fn sun(direction: Vec3, radius: f32, radiance: Vec3) -> Self {
        // 1 − cos r = 2 sin²(r/2), which does not cancel
        let half = (0.5 * radius).sin();
        let place = Place::Sun { frame: Frame::new(direction), one_minus_cos: 2.0 * half * half };
        Self { place, radiance, two_sided: false, chance: 0.0 }
    }

    /// Power, up to what is common to all lights; the sun shines on a scene of radius `extent`.
    fn power(&self, extent: f32) -> f32 {
        let sides = if self.two_sided { 2.0 } else { 1.0 };
        let area = match self.place {
            Place::Planar { area, .. } => area * sides * PI,
            Place::Sphere { radius, .. } => 4.0 * PI * radius * radius * sides * PI,
            Place::Sun { one_minus_cos, .. } => 2.0 * PI * one_minus_cos * PI * extent * extent,
        };
        math::luminance(self.radiance) * area
    }

    /// A point for `u` uniform in the unit square, as seen from `from`; none if the light's back is seen.
    #[inline]
    pub(crate) fn aim(&self, from: Vec3, u: [f32; 2]) -> Option<Aim> {
        match self.place {
            Place::Planar { corner, e1, e2, normal, whole, area } => {
                // Fold the square onto the triangle
                let [a, b] = if !whole && u[0] + u[1] > 1.0 { [1.0 - u[0], 1.0 - u[1]] } else { u };
                let to = corner + e1 * a + e2 * b - from;
                let d2 = to.length_squared();
                let distance = d2.sqrt();
                let dir = to / distance;
                let cos = self.facing(-dir.dot(normal));
                (cos > 0.0 && distance > 0.0).then(|| Aim { dir, distance, pdf: d2 / (cos * area) })
            }
            Place::Sphere { centre, radius } => {
                let to = centre - from;
                let d2 = to.length_squared();
                if d2 <= radius * radius {
                    return self.aim_from_inside(from, centre, radius, u);
                }
                // Uniform in the cone that the sphere fills (Shirley et al. 1996)
                let m = sphere_cone(d2, radius);
                let local = math::cone(m, u);
                let distance = d2.sqrt();
                let dir = Frame::new(to / distance).to_world(local);
                let sin2 = local.x * local.x + local.y * local.y;
                let near = distance * local.z - (radius * radius - d2 * sin2).max(0.0).sqrt();
                Some(Aim { dir, distance: near, pdf: math::cone_pdf(m) })
            }
            Place::Sun { frame, one_minus_cos } => {
                let dir = frame.to_world(math::cone(one_minus_cos, u));
                Some(Aim { dir, distance: f32::INFINITY, pdf: math::cone_pdf(one_minus_cos) })
            }
        }
    }

    /// From inside a sphere: uniform in area.
    #[inline(never)]
    fn aim_from_inside(&self, from: Vec3, centre: Vec3, radius: f32, u: [f32; 2]) -> Option<Aim> {
        let normal = math::sphere(u);
        let to = centre + normal * radius - from;
        let distance = to.length();
        let dir = to / distance;
        let cos = self.facing(-dir.dot(normal));
        let area = 4.0 * PI * radius * radius;
        (cos > 0.0 && distance > 0.0).then(|| Aim { dir, distance, pdf: distance * distance / (cos * area) })
    }

    /// The cosine at the light, made positive on the back of a two-sided one.
    #[inline]
    fn facing(&self, cos: f32) -> f32 {
        if self.two_sided { cos.abs() } else { cos }
    }

    /// Whether a ray that meets the light with cosine `cos` (positive: from the front) sees it shine.
    #[inline]
    pub(crate) fn shines(&self, cos: f32) -> bool {
        cos > 0.0 || self.two_sided
    }

    /// Density with which [`Light::aim`] from `from` chooses what a ray met at `distance` with cosine `cos`.
    #[inline]
    pub(crate) fn pdf(&self, from: Vec3, distance: f32, cos: f32) -> f32 {
        match self.place {
            Place::Planar { area, .. } => distance * distance / (cos.abs() * area),
            Place::Sphere { centre, radius } => {
                let d2 = (centre - from).length_squared();
                if d2 <= radius * radius {
                    distance * distance / (cos.abs() * 4.0 * PI * radius * radius)
                } else {
                    math::cone_pdf(sphere_cone(d2, radius))
                }
            }
            Place::Sun { one_minus_cos, .. } => math::cone_pdf(one_minus_cos),
        }
    }

    /// Whether `dir` points into the sun.
    #[inline]
    pub(crate) fn covers(&self, dir: Vec3) -> bool {
        match self.place {
            // |dir − z|² = 2 (1 − cos): does not cancel
            Place::Sun { frame, one_minus_cos } => (dir - frame.z).length_squared() < 2.0 * one_minus_cos,
            _ => false,
        }
    }
}

/// 1 − cos of the half angle that a sphere fills at squared distance `d2`.
#[inline]
fn sphere_cone(d2: f32, radius: f32) -> f32 {
    let sin2 = (radius * radius / d2).min(1.0);
    sin2 / (1.0 + (1.0 - sin2).sqrt())
}

/// All lights, chosen with probability proportional to power.
#[derive(Clone, Debug, Default)]
pub(crate) struct Lights {
    pub(crate) all: Vec<Light>,
    /// Walker's alias table (Vose 1991): keep the column's own light below the threshold, else take its alias.
    table: Vec<(f32, u32)>,
}

impl Lights {
    pub(crate) fn new(mut all: Vec<Light>, extent: f32) -> Self {
        let powers: Vec<f64> = all.iter().map(|l| f64::from(l.power(extent))).collect();
        let total: f64 = powers.iter().sum();
        let n = all.len();
        // Lights of no power would divide by zero; all black: choose evenly
        let chances: Vec<f64> =
            powers.iter().map(|p| if total > 0.0 { p / total } else { 1.0 / n as f64 }).collect();
        for (light, chance) in all.iter_mut().zip(&chances) {
            light.chance = *chance as f32;
        }
        let mut rest: Vec<f64> = chances.iter().map(|c| c * n as f64).collect();
        let mut table: Vec<(f32, u32)> = (0..n as u32).map(|i| (1.0, i)).collect();
        let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..n).partition(|&i| rest[i] < 1.0);
        while let (Some(s), Some(&l)) = (small.pop(), large.last()) {
            table[s] = (rest[s] as f32, l as u32);
            rest[l] -= 1.0 - rest[s];
            if rest[l] < 1.0 {
                large.pop();
                small.push(l);
            }
        }
        Self { all, table }
    }

    /// Chooses a light by `u` uniform in [0, 1).
    #[inline]
    pub(crate) fn choose(&self, u: f32) -> &Light {
        if let [only] = self.all.as_slice() {
            return only;
        }
        let x = u * self.table.len() as f32;
        let column = (x as usize).min(self.table.len() - 1);
        let (threshold, alias) = self.table[column];
        &self.all[if x - (column as f32) < threshold { column } else { alias as usize }]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_are_chosen_by_power() {
        let light = |power| {
            let (corner, e1, e2) = (Vec3::ZERO, Vec3::X, Vec3::Y);
            Light::surface(Shape::Planar { corner, e1, e2, whole: true }, Vec3::splat(power), false)
        };
        let powers = [1.0, 0.0, 5.0, 2.0, 0.5];
        let lights = Lights::new(powers.map(light).to_vec(), 1.0);
        let n = 1 << 16;
        let mut counts = [0u32; 5];
        for i in 0..n {
            let chosen = lights.choose((i as f32 + 0.5) / n as f32).radiance.x;
            counts[powers.iter().position(|p| *p == chosen).unwrap()] += 1;
        }
        for (power, count) in powers.iter().zip(counts) {
            // A grid of 2¹⁶ points over ten intervals: off by at most ten points
            assert!((f64::from(count) / f64::from(n) - f64::from(*power) / 8.5).abs() < 10.0 / f64::from(n));
        }
    }

    /// The density is that of the aims: the mean of 1/pdf over aims is the solid angle of what can be aimed at.
    #[test]
    fn spheres_and_suns_fill_their_solid_angle() {
        let from = Vec3::new(0.3, -0.2, 0.1);
        let ball = Shape::Sphere { centre: Vec3::new(2.0, 1.0, 0.5), radius: 0.7 };
        let ball = Light::surface(ball, Vec3::ONE, false);
        let aim = ball.aim(from, [0.3, 0.6]).unwrap();
        let d2 = (Vec3::new(2.0, 1.0, 0.5) - from).length_squared();
        let omega = 2.0 * PI * (1.0 - (1.0 - 0.49 / d2).sqrt());
        assert!((1.0 / aim.pdf - omega).abs() < 1e-5);
        let met = from + aim.dir * aim.distance - Vec3::new(2.0, 1.0, 0.5);
        assert!((met.length() - 0.7).abs() < 1e-4);
        let sun = Light::sun(Vec3::Y, 0.27f32.to_radians(), Vec3::ONE);
        for i in 0..100 {
            let aim = sun.aim(from, [i as f32 / 100.0, i as f32 * 0.37 % 1.0]).unwrap();
            assert!(sun.covers(aim.dir) && !sun.covers(Vec3::new(0.006, 1.0, 0.0).normalize()));
        }
    }
}
