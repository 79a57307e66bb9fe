//! Emitters, and how next event estimation chooses points on them.

use crate::accel::Shape;
use crate::alias::Alias;
use crate::bsdf::DELTA;
use crate::environment::{Map, check_radiance};
use crate::error::SceneError;
use crate::math::{self, Frame, Vec3};
use crate::scene::NO;
use noisefloor::Rgb;
use std::f32::consts::PI;

/// Where a light is.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Place {
    Planar {
        corner: Vec3,
        e1: Vec3,
        e2: Vec3,
        normal: Vec3,
        area: f32,
        outline: Outline,
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
    /// The environment map.
    Map,
    /// A point; within `outer` of `axis` if that is a spot. Its radiance is its intensity.
    Point {
        position: Vec3,
        axis: Vec3,
        inner: f32,
        outer: f32,
    },
    /// All light from one direction. Its radiance is the irradiance of a surface that faces it.
    Distant {
        towards: Vec3,
    },
}

/// What of a plane shines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outline {
    Parallelogram,
    Triangle,
    Ellipse,
}

/// A light without size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Punctual {
    /// Light from a point, alike in all directions.
    Point {
        /// Where it is, in scene units.
        position: [f32; 3],
        /// Radiant intensity: power per solid angle, 0…1e12.
        intensity: Rgb,
    },
    /// Light from a point into a cone, fading as glTF's `KHR_lights_punctual` says.
    Spot {
        /// Where it is, in scene units.
        position: [f32; 3],
        /// Where it shines to; need not have length 1.
        direction: [f32; 3],
        /// Radiant intensity along the direction, 0…1e12.
        intensity: Rgb,
        /// Half angle in degrees within which it does not fade, 0…90.
        inner: f32,
        /// Half angle in degrees beyond which it is dark: above `inner`, up to 90.
        outer: f32,
    },
    /// Parallel light from infinitely far away.
    Distant {
        /// Where it travels to; need not have length 1.
        direction: [f32; 3],
        /// Irradiance of a surface that faces it, 0…1e12.
        irradiance: Rgb,
    },
}

/// An emitter: a surface of the scene, or something far away or without size.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Light {
    pub(crate) place: Place,
    pub(crate) radiance: Vec3,
    pub(crate) two_sided: bool,
    /// The texture that multiplies its radiance, among those of the scene's emissions.
    pub(crate) texture: u32,
    /// The surface that shines.
    pub(crate) prim: u32,
    /// Probability that next event estimation chooses this light.
    pub(crate) chance: f32,
}

/// A point on a light, seen from a point of the scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Aim {
    pub(crate) dir: Vec3,
    /// Infinite for what is far away.
    pub(crate) distance: f32,
    /// Radiance over density in solid angle, given the light. Of the environment map, one over the density: its radiance is
    /// looked up once nothing is in between, as looking it up takes longer than finding that out.
    pub(crate) value: Vec3,
    /// That density; [`DELTA`] if the light cannot be met by chance.
    pub(crate) pdf: f32,
    /// Where on the surface, along its edges.
    pub(crate) uv: [f32; 2],
}

impl Aim {
    /// A direction of the environment map.
    #[inline]
    pub(crate) fn far(dir: Vec3, pdf: f32) -> Self {
        Self { dir, distance: f32::INFINITY, value: Vec3::ONE / pdf, pdf, uv: [0.0; 2] }
    }
}

impl Light {
    fn new(place: Place, radiance: Vec3) -> Self {
        Self { place, radiance, two_sided: false, texture: NO, prim: NO, chance: 0.0 }
    }

    pub(crate) fn surface(shape: &Shape, radiance: Vec3, two_sided: bool, prim: u32) -> Self {
        let place = match *shape {
            Shape::Planar { corner, e1, e2, whole: true } => {
                planar(corner, e1, e2, 1.0, Outline::Parallelogram)
            }
            Shape::Planar { corner, e1, e2, whole: false } => planar(corner, e1, e2, 0.5, Outline::Triangle),
            Shape::Disk { centre, e1, e2 } => planar(centre, e1, e2, PI, Outline::Ellipse),
            Shape::Sphere { centre, radius } => Place::Sphere { centre: centre.into(), radius },
        };
        Self { two_sided, prim, ..Self::new(place, radiance) }
    }

    /// The sun: `radius` is half its apparent diameter in radians.
    pub(crate) fn sun(direction: Vec3, radius: f32, radiance: Vec3) -> Self {
        // 1 − cos r = 2 sin²(r/2), which does not cancel
        let half = (0.5 * radius).sin();
        Self::new(Place::Sun { frame: Frame::new(direction), one_minus_cos: 2.0 * half * half }, radiance)
    }

    /// The environment map; `mean` is its mean radiance over the sphere.
    pub(crate) fn map(mean: Vec3) -> Self {
        Self::new(Place::Map, mean)
    }

    /// # Errors
    /// [`SceneError`] if a number is not finite or out of range, or a direction is zero.
    pub(crate) fn punctual(punctual: Punctual) -> Result<Self, SceneError> {
        let direction = |d: [f32; 3]| {
            // In f64: the length of a tiny vector would vanish
            let length = glam::Vec3::from(d).as_dvec3().try_normalize();
            length.map(|d| d.as_vec3a()).ok_or(SceneError::NotFinite { what: "the direction of a light" })
        };
        let (place, radiance) = match punctual {
            Punctual::Point { position, intensity } => {
                // A cone that nothing is outside of
                let position = crate::builder::position(position)?.into();
                (Place::Point { position, axis: Vec3::Z, inner: -2.0, outer: -3.0 }, intensity)
            }
            Punctual::Spot { position, direction: d, intensity, inner, outer } => {
                if !(0.0 <= inner && inner < outer && outer <= 90.0) {
                    let (what, range) =
                        ("the outer angle of a spot", "above the inner one, up to 90 degrees");
                    return Err(SceneError::Range { what, value: outer, range });
                }
                let (inner, outer) = (inner.to_radians().cos(), outer.to_radians().cos());
                let position = crate::builder::position(position)?.into();
                (Place::Point { position, axis: direction(d)?, inner, outer }, intensity)
            }
            Punctual::Distant { direction: d, irradiance } => {
                (Place::Distant { towards: -direction(d)? }, irradiance)
            }
        };
        check_radiance(radiance)?;
        Ok(Self::new(place, radiance.into()))
    }

    /// Power, up to what is common to all lights; what is far away shines on a scene of radius `extent`. `texture` is the
    /// mean factor on the radiance.
    fn power(&self, extent: f32, texture: Vec3) -> f32 {
        let sides = if self.two_sided { 2.0 } else { 1.0 };
        let cross = PI * extent * extent;
        let area = match self.place {
            Place::Planar { area, .. } => area * sides * PI,
            Place::Sphere { radius, .. } => 4.0 * PI * radius * radius * sides * PI,
            Place::Sun { one_minus_cos, .. } => 2.0 * PI * one_minus_cos * cross,
            Place::Map => 4.0 * PI * cross,
            Place::Point { outer, .. } => 2.0 * PI * (1.0 - outer.max(-1.0)),
            Place::Distant { .. } => cross,
        };
        math::luminance(self.radiance * texture) * area
    }

    /// A point for `u` uniform in the unit cube, as seen from `from`; none if the light's back is seen. The third number
    /// serves large environment maps alone.
    #[inline]
    pub(crate) fn aim(&self, from: Vec3, [u, v, more]: [f32; 3], map: Option<&Map>) -> Option<Aim> {
        let u = [u, v];
        match self.place {
            Place::Planar { corner, e1, e2, normal, area, outline } => {
                let [a, b] = match outline {
                    Outline::Parallelogram => u,
                    // Fold the square onto the triangle
                    Outline::Triangle if u[0] + u[1] > 1.0 => [1.0 - u[0], 1.0 - u[1]],
                    Outline::Triangle => u,
                    Outline::Ellipse => math::disk(u),
                };
                let to = corner + e1 * a + e2 * b - from;
                let d2 = to.length_squared();
                let distance = d2.sqrt();
                let dir = to / distance;
                let cos = self.facing(-dir.dot(normal));
                let pdf = d2 / (cos * area);
                (cos > 0.0 && distance > 0.0).then(|| self.aimed(dir, distance, pdf, [a, b]))
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
                Some(self.aimed(dir, near, math::cone_pdf(m), u))
            }
            Place::Sun { frame, one_minus_cos } => {
                let dir = frame.to_world(math::cone(one_minus_cos, u));
                Some(self.aimed(dir, f32::INFINITY, math::cone_pdf(one_minus_cos), u))
            }
            Place::Map => {
                let (dir, pdf) = map?.sample(u, more)?;
                Some(Aim::far(dir, pdf))
            }
            Place::Point { position, axis, inner, outer } => {
                let to = position - from;
                let d2 = to.length_squared();
                let distance = d2.sqrt();
                let dir = to / distance;
                let fade = ((-dir.dot(axis) - outer) / (inner - outer)).clamp(0.0, 1.0);
                let value = self.radiance * (fade * fade / d2);
                (distance > 0.0 && fade > 0.0).then_some(Aim { dir, distance, value, pdf: DELTA, uv: u })
            }
            Place::Distant { towards } => {
                Some(Aim { dir: towards, distance: f32::INFINITY, value: self.radiance, pdf: DELTA, uv: u })
            }
        }
    }

    #[inline]
    fn aimed(&self, dir: Vec3, distance: f32, pdf: f32, uv: [f32; 2]) -> Aim {
        Aim { dir, distance, value: self.radiance / pdf, pdf, uv }
    }

    /// From inside a sphere: uniform in area.
    #[inline(never)]
    fn aim_from_inside(&self, from: Vec3, centre: Vec3, radius: f32, u: [f32; 2]) -> Option<Aim> {
        let normal = math::sphere(u);
        let to = centre + normal * radius - from;
        let distance = to.length();
        let dir = to / distance;
        let cos = self.facing(-dir.dot(normal));
        let pdf = distance * distance / (cos * 4.0 * PI * radius * radius);
        (cos > 0.0 && distance > 0.0).then(|| self.aimed(dir, distance, pdf, u))
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

    /// Density with which [`Light::aim`] from `from` chooses what a ray met at `distance` with cosine `cos`. The map's own
    /// density is [`Map::pdf`].
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
            // These are never met
            Place::Map | Place::Point { .. } | Place::Distant { .. } => 0.0,
        }
    }

    /// Moves it, if it is anywhere.
    pub(crate) fn shift(&mut self, by: Vec3) {
        match &mut self.place {
            Place::Planar { corner: at, .. }
            | Place::Sphere { centre: at, .. }
            | Place::Point { position: at, .. } => *at += by,
            Place::Sun { .. } | Place::Map | Place::Distant { .. } => {}
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

    /// Whether the light can shine on anything between two corners of a box: one-sided planes do not shine backward.
    fn reaches(&self, low: Vec3, high: Vec3) -> bool {
        match self.place {
            Place::Planar { corner, normal, .. } if !self.two_sided => {
                let farthest = Vec3::select(normal.cmpgt(Vec3::ZERO), high, low);
                normal.dot(farthest - corner) > 0.0
            }
            _ => true,
        }
    }
}

fn planar(corner: glam::Vec3, e1: glam::Vec3, e2: glam::Vec3, part: f32, outline: Outline) -> Place {
    // In f64: the squares of small edges vanish in f32
    let n = e1.as_dvec3().cross(e2.as_dvec3());
    let area = n.length() as f32 * part;
    let normal = n.normalize().as_vec3a();
    Place::Planar { corner: corner.into(), e1: e1.into(), e2: e2.into(), normal, area, outline }
}

/// 1 − cos of the half angle that a sphere fills at squared distance `d2`.
#[inline]
fn sphere_cone(d2: f32, radius: f32) -> f32 {
    let sin2 = (radius * radius / d2).min(1.0);
    sin2 / (1.0 + (1.0 - sin2).sqrt())
}

/// All lights, chosen with probability proportional to power.
#[derive(Clone, Debug)]
pub(crate) struct Lights {
    pub(crate) all: Vec<Light>,
    table: Alias,
}

impl Lights {
    /// Lights of a scene within a box between two corners. `textures` are the mean factors on radiances. Lights that cannot
    /// matter, black ones and those that face away from everything, are never chosen.
    pub(crate) fn new(mut all: Vec<Light>, [low, high]: [Vec3; 2], textures: &[Vec3]) -> Self {
        let extent = 0.5 * (high - low).length();
        let power = |l: &Light| {
            let texture = textures.get(l.texture as usize).copied().unwrap_or(Vec3::ONE);
            if l.reaches(low, high) { f64::from(l.power(extent, texture)) } else { 0.0 }
        };
        let powers: Vec<f64> = all.iter().map(power).collect();
        let total: f64 = powers.iter().sum();
        for (light, power) in all.iter_mut().zip(&powers) {
            light.chance = if total > 0.0 { (power / total) as f32 } else { 0.0 };
        }
        Self { table: Alias::new(&powers), all }
    }

    /// Chooses a light by numbers uniform in [0, 1), as [`Alias::choose`]; none if none shines.
    #[inline]
    pub(crate) fn choose(&self, u: f32, more: f32) -> Option<&Light> {
        let light = match self.all.as_slice() {
            [] => return None,
            [only] => only,
            all => &all[self.table.choose(u, more).0],
        };
        (light.chance > 0.0).then_some(light)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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

    /// The density is that of the aims: the mean of 1/pdf over aims is the solid angle of what can be aimed at.
    #[test]
    fn spheres_and_suns_fill_their_solid_angle() {
        let from = Vec3::new(0.3, -0.2, 0.1);
        let ball = Shape::Sphere { centre: glam::Vec3::new(2.0, 1.0, 0.5), radius: 0.7 };
        let ball = Light::surface(&ball, Vec3::ONE, false, 0);
        let aim = ball.aim(from, [0.3, 0.6, 0.0], None).unwrap();
        let d2 = (Vec3::new(2.0, 1.0, 0.5) - from).length_squared();
        let omega = 2.0 * PI * (1.0 - (1.0 - 0.49 / d2).sqrt());
        assert!((1.0 / aim.pdf - omega).abs() < 1e-5);
        let met = from + aim.dir * aim.distance - Vec3::new(2.0, 1.0, 0.5);
        assert!((met.length() - 0.7).abs() < 1e-4);
        let sun = Light::sun(Vec3::Y, 0.27f32.to_radians(), Vec3::ONE);
        for i in 0..100 {
            let aim = sun.aim(from, [i as f32 / 100.0, i as f32 * 0.37 % 1.0, 0.0], None).unwrap();
            assert!(sun.covers(aim.dir) && !sun.covers(Vec3::new(0.006, 1.0, 0.0).normalize()));
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
        assert_eq!((lights.all[0].chance, lights.all[1].chance), (0.0, 1.0));
        assert!(Lights::new(vec![light(-1.0)], [Vec3::NEG_ONE, Vec3::ONE], &[]).choose(0.5, 0.0).is_none());
    }
}
