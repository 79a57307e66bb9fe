//! One emitter, and samples of points on it.

use super::cone::Cone;
use crate::accel::Shape;
use crate::environment::Map;
use crate::geometry::NO;
use crate::math::{self, DELTA, Frame, Vec3};
use std::f32::consts::PI;

/// Where a light is, and its shape.
#[derive(Clone, Copy, Debug)]
pub(crate) enum LightShape {
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
    Map,
    /// A point that shines within a cone around `axis`. Its radiance is its intensity.
    Point {
        position: Vec3,
        axis: Vec3,
        cone: Cone,
    },
    /// A point that projects its texture along `axis`. `u` and `v` are perpendicular to it, and one over the
    /// tangents of the texture's half angles long. Its radiance is its intensity.
    Projector {
        position: Vec3,
        u: Vec3,
        v: Vec3,
        axis: Vec3,
        projection: Projection,
    },
    /// Light from one direction. Its radiance is the irradiance of a surface that faces it.
    Distant {
        towards: Vec3,
    },
}

/// How the intensity of a projector depends on the angle, besides its texture.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Projection {
    /// As 1/cos³ θ.
    EvenPlane,
    Cone(Cone),
}

/// The part of a plane that shines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Outline {
    Parallelogram,
    Triangle,
    Ellipse,
}

/// An emitter: a surface of the scene, something far away or something without size.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Light {
    pub(crate) shape: LightShape,
    pub(crate) radiance: Vec3,
    pub(crate) two_sided: bool,
    /// The texture that multiplies its radiance, among the scene's emission textures; [`NO`] if there is
    /// none.
    pub(crate) texture: u32,
    /// The surface that shines.
    pub(crate) prim: u32,
    /// Its share of the power of all lights; 0 if it is never sampled.
    pub(crate) power_pmf: f32,
}

/// A point on a light, as seen from a point of the scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LightSample {
    pub(crate) dir: Vec3,
    /// Infinite for what is far away.
    pub(crate) distance: f32,
    /// Radiance over density per solid angle, given the light. For the environment map, one over the density:
    /// its radiance is looked up only if nothing blocks it, since the lookup costs more than the shadow ray.
    pub(crate) value: Vec3,
    /// That density; [`DELTA`] if scattered rays cannot hit the light.
    pub(crate) pdf: f32,
    /// Coordinates along the edges of the surface, or in the picture of a projector.
    pub(crate) uv: [f32; 2],
}

impl LightSample {
    /// A direction of the environment map.
    #[inline]
    pub(crate) fn far(dir: Vec3, pdf: f32) -> Self {
        Self { dir, distance: f32::INFINITY, value: Vec3::ONE / pdf, pdf, uv: [0.0; 2] }
    }
}

impl Light {
    pub(super) fn new(shape: LightShape, radiance: Vec3) -> Self {
        Self { shape, radiance, two_sided: false, texture: NO, prim: NO, power_pmf: 0.0 }
    }

    pub(crate) fn surface(shape: &Shape, radiance: Vec3, two_sided: bool, prim: u32) -> Self {
        let shape = match *shape {
            Shape::Planar { corner, e1, e2, whole: true } => {
                planar(corner, e1, e2, 1.0, Outline::Parallelogram)
            }
            Shape::Planar { corner, e1, e2, whole: false } => planar(corner, e1, e2, 0.5, Outline::Triangle),
            Shape::Disk { centre, e1, e2 } => planar(centre, e1, e2, PI, Outline::Ellipse),
            Shape::Sphere { centre, radius } => LightShape::Sphere { centre: centre.into(), radius },
        };
        Self { two_sided, prim, ..Self::new(shape, radiance) }
    }

    /// The sun; `radius` is half its apparent diameter in radians.
    pub(crate) fn sun(direction: Vec3, radius: f32, radiance: Vec3) -> Self {
        // 1 − cos r = 2 sin²(r/2), which does not cancel
        let half = (0.5 * radius).sin();
        Self::new(
            LightShape::Sun { frame: Frame::new(direction), one_minus_cos: 2.0 * half * half },
            radiance,
        )
    }

    /// The environment map; `mean` is its mean radiance over the sphere.
    pub(crate) fn map(mean: Vec3) -> Self {
        Self::new(LightShape::Map, mean)
    }

    /// Power, up to a factor common to all lights. Distant lights shine on a scene of radius `extent`;
    /// `texture` is the mean of the emission texture.
    pub(super) fn power(&self, extent: f32, texture: Vec3) -> f32 {
        let sides = if self.two_sided { 2.0 } else { 1.0 };
        let cross = PI * extent * extent;
        let area = match self.shape {
            LightShape::Planar { area, .. } => area * sides * PI,
            LightShape::Sphere { radius, .. } => 4.0 * PI * radius * radius * sides * PI,
            LightShape::Sun { one_minus_cos, .. } => 2.0 * PI * one_minus_cos * cross,
            LightShape::Map => 4.0 * PI * cross,
            LightShape::Point { cone, .. } => 2.0 * PI * (1.0 - cone.outer.max(-1.0)),
            LightShape::Projector { u, v, projection, .. } => {
                let picture = 4.0 / (u.length() * v.length());
                match projection {
                    Projection::EvenPlane => picture,
                    Projection::Cone(cone) => picture.min(2.0 * PI * (1.0 - cone.outer.max(0.0))),
                }
            }
            LightShape::Distant { .. } => cross,
        };
        math::luminance(self.radiance * texture) * area
    }

    /// A point, sampled by `u` uniform in the unit cube, as seen from `from`; none if the dark side is seen.
    /// Only large environment maps use the third number.
    #[inline]
    pub(crate) fn sample(
        &self,
        from: Vec3,
        [u, v, more]: [f32; 3],
        map: Option<&Map>,
    ) -> Option<LightSample> {
        let u = [u, v];
        match self.shape {
            LightShape::Planar { corner, e1, e2, normal, area, outline } => {
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
                (cos > 0.0 && distance > 0.0).then(|| self.surface_sample(dir, distance, pdf, [a, b]))
            }
            LightShape::Sphere { centre, radius } => self.sample_sphere(from, centre, radius, u),
            LightShape::Sun { frame, one_minus_cos } => {
                let dir = frame.to_world(math::cone(one_minus_cos, u));
                Some(self.surface_sample(dir, f32::INFINITY, math::cone_pdf(one_minus_cos), u))
            }
            LightShape::Map => {
                let (dir, pdf) = map?.sample(u, more)?;
                Some(LightSample::far(dir, pdf))
            }
            LightShape::Point { position, axis, cone } => {
                let to = position - from;
                let fade = cone.fade(-to.dot(axis) / to.length());
                self.point_sample(to, fade, u)
            }
            LightShape::Projector { position, u, v, axis, projection } => {
                let to = position - from;
                let depth = -to.dot(axis);
                let [a, b] = [u, v].map(|edge| 0.5 - 0.5 * to.dot(edge) / depth);
                let inside = depth > 0.0 && (0.0..=1.0).contains(&a) && (0.0..=1.0).contains(&b);
                let cos = depth / to.length();
                let fade = match projection {
                    Projection::EvenPlane => 1.0 / (cos * cos * cos),
                    Projection::Cone(cone) => cone.fade(cos),
                };
                if inside { self.point_sample(to, fade, [a, b]) } else { None }
            }
            LightShape::Distant { towards } => Some(LightSample {
                dir: towards,
                distance: f32::INFINITY,
                value: self.radiance,
                pdf: DELTA,
                uv: u,
            }),
        }
    }

    /// A point without size in the direction `to`, whose intensity is multiplied by `fade`.
    #[inline]
    fn point_sample(&self, to: Vec3, fade: f32, uv: [f32; 2]) -> Option<LightSample> {
        let d2 = to.length_squared();
        let distance = d2.sqrt();
        let (dir, value) = (to / distance, self.radiance * (fade / d2));
        let sample = LightSample { dir, distance, value, pdf: DELTA, uv };
        (distance > 0.0 && fade > 0.0).then_some(sample)
    }

    /// From outside a sphere: uniform in the cone that it subtends (Shirley et al. 1996).
    #[inline]
    fn sample_sphere(&self, from: Vec3, centre: Vec3, radius: f32, u: [f32; 2]) -> Option<LightSample> {
        let to = centre - from;
        let d2 = to.length_squared();
        if d2 <= radius * radius {
            return self.sample_from_inside(from, centre, radius, u);
        }
        let m = sphere_cone(d2, radius);
        let local = math::cone(m, u);
        let distance = d2.sqrt();
        let dir = Frame::new(to / distance).to_world(local);
        let sin2 = local.x * local.x + local.y * local.y;
        let near = distance * local.z - (radius * radius - d2 * sin2).max(0.0).sqrt();
        Some(self.surface_sample(dir, near, math::cone_pdf(m), u))
    }

    #[inline]
    fn surface_sample(&self, dir: Vec3, distance: f32, pdf: f32, uv: [f32; 2]) -> LightSample {
        LightSample { dir, distance, value: self.radiance / pdf, pdf, uv }
    }

    /// From inside a sphere: uniform in area.
    #[inline(never)]
    fn sample_from_inside(&self, from: Vec3, centre: Vec3, radius: f32, u: [f32; 2]) -> Option<LightSample> {
        let normal = math::sphere(u);
        let to = centre + normal * radius - from;
        let distance = to.length();
        let dir = to / distance;
        let cos = self.facing(-dir.dot(normal));
        let pdf = distance * distance / (cos * 4.0 * PI * radius * radius);
        (cos > 0.0 && distance > 0.0).then(|| self.surface_sample(dir, distance, pdf, u))
    }

    /// The cosine at the light, made positive on the back of a two-sided one.
    #[inline]
    fn facing(&self, cos: f32) -> f32 {
        if self.two_sided { cos.abs() } else { cos }
    }

    /// Whether a ray that hits the light with cosine `cos` (positive: from the front) sees it shine.
    #[inline]
    pub(crate) fn shines(&self, cos: f32) -> bool {
        cos > 0.0 || self.two_sided
    }

    /// Density with which [`Light::sample`] from `from` samples the point that a ray hit at `distance` with
    /// cosine `cos`. That of the environment map is [`Map::pdf`].
    #[inline]
    pub(crate) fn pdf(&self, from: Vec3, distance: f32, cos: f32) -> f32 {
        match self.shape {
            LightShape::Planar { area, .. } => distance * distance / (cos.abs() * area),
            LightShape::Sphere { centre, radius } => {
                let d2 = (centre - from).length_squared();
                if d2 <= radius * radius {
                    distance * distance / (cos.abs() * 4.0 * PI * radius * radius)
                } else {
                    math::cone_pdf(sphere_cone(d2, radius))
                }
            }
            LightShape::Sun { one_minus_cos, .. } => math::cone_pdf(one_minus_cos),
            // Rays never hit these
            LightShape::Map
            | LightShape::Point { .. }
            | LightShape::Projector { .. }
            | LightShape::Distant { .. } => 0.0,
        }
    }

    /// Translates it, unless it is infinitely far away.
    pub(crate) fn translate(&mut self, by: Vec3) {
        match &mut self.shape {
            LightShape::Planar { corner: at, .. }
            | LightShape::Sphere { centre: at, .. }
            | LightShape::Point { position: at, .. }
            | LightShape::Projector { position: at, .. } => *at += by,
            LightShape::Sun { .. } | LightShape::Map | LightShape::Distant { .. } => {}
        }
    }

    /// Whether `dir` points into the sun.
    #[inline]
    pub(crate) fn covers(&self, dir: Vec3) -> bool {
        match self.shape {
            // |dir − z|² = 2 (1 − cos): does not cancel
            LightShape::Sun { frame, one_minus_cos } => {
                (dir - frame.z).length_squared() < 2.0 * one_minus_cos
            }
            _ => false,
        }
    }

    /// Whether the light can shine on anything in a box with these corners: one-sided planes do not shine
    /// backward.
    pub(super) fn reaches(&self, low: Vec3, high: Vec3) -> bool {
        match self.shape {
            LightShape::Planar { corner, normal, .. } if !self.two_sided => {
                let farthest = Vec3::select(normal.cmpgt(Vec3::ZERO), high, low);
                normal.dot(farthest - corner) > 0.0
            }
            _ => true,
        }
    }
}

fn planar(corner: glam::Vec3, e1: glam::Vec3, e2: glam::Vec3, share: f32, outline: Outline) -> LightShape {
    // In f64, since the squares of short edges vanish in f32
    let n = e1.as_dvec3().cross(e2.as_dvec3());
    let area = n.length() as f32 * share;
    let normal = n.normalize().as_vec3a();
    LightShape::Planar { corner: corner.into(), e1: e1.into(), e2: e2.into(), normal, area, outline }
}

/// 1 − cos of the half angle that a sphere subtends at squared distance `d2`.
#[inline]
fn sphere_cone(d2: f32, radius: f32) -> f32 {
    let sin2 = (radius * radius / d2).min(1.0);
    sin2 / (1.0 + (1.0 - sin2).sqrt())
}
