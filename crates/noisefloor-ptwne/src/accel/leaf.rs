//! Surfaces as a ray is tested against them: packs of four planar ones, and round ones one at a time.

use super::node::WideRay;
use super::shape::{Shape, dual};
use crate::math::{Ray, Vec3};
use glam::Vec4;

/// By how much a planar surface is widened, in units of its edges, so that no ray slips between neighbours.
pub(super) const EDGE: f32 = 2e-6;

/// Up to four planar surfaces, one per lane. With corner c and unit normal n, a ray o + t·d meets the plane
/// at t = n·(c − o) / n·d, where u and v are dot products with the dual basis of the edges. Lanes without a
/// surface are all zero: t is then NaN, and no comparison holds.
#[derive(Clone, Debug, Default)]
pub(super) struct Pack {
    pub(super) corner: [Vec4; 3],
    pub(super) normal: [Vec4; 3],
    dual_u: [Vec4; 3],
    dual_v: [Vec4; 3],
    /// One for parallelograms, zero for triangles: u + v − whole·min(u, v) ≤ 1 bounds both.
    whole: Vec4,
    pub(super) prim: [u32; 4],
}

/// A sphere or an ellipse.
#[derive(Clone, Copy, Debug)]
pub(super) struct Round {
    pub(super) centre: Vec3,
    pub(super) prim: u32,
    pub(super) shape: RoundShape,
}

/// Where on a surface a ray meets it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Spot {
    /// Coordinates along its edges, and whether the ray comes to its front.
    Plane { uv: [f32; 2], front: bool },
    /// The normal outside, where the ray comes to the front; and whether the ray came in through the other
    /// side of the sphere.
    Sphere { normal: Vec3, front: bool, far: bool },
}

#[derive(Clone, Copy, Debug)]
pub(super) enum RoundShape {
    Sphere { radius: f32 },
    Disk { normal: Vec3, dual_u: Vec3, dual_v: Vec3 },
}

/// "No pack" among the indices of packs.
pub(super) const NO_PACK: u32 = u32::MAX;

/// The surfaces of a leaf of the hierarchy.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leaf {
    /// [`NO_PACK`] if none of its surfaces is planar.
    pub(super) pack: u32,
    pub(super) first_round: u32,
    pub(super) rounds: u32,
}

impl Pack {
    /// Puts a planar surface, of which `dual` is the normal and dual basis, into a lane.
    pub(super) fn set(
        &mut self,
        lane: usize,
        corner: glam::Vec3,
        [normal, u, v]: [glam::DVec3; 3],
        whole: bool,
        prim: u32,
    ) {
        let put = |what: &mut [Vec4; 3], v: glam::DVec3| {
            for i in 0..3 {
                what[i][lane] = v[i] as f32;
            }
        };
        put(&mut self.corner, corner.as_dvec3());
        put(&mut self.normal, normal);
        put(&mut self.dual_u, u);
        put(&mut self.dual_v, v);
        self.whole[lane] = if whole { 1.0 } else { 0.0 };
        self.prim[lane] = prim;
    }

    /// The normal and the dual basis of a lane.
    pub(super) fn plane(&self, lane: usize) -> [Vec3; 3] {
        [&self.normal, &self.dual_u, &self.dual_v].map(|v| Vec3::new(v[0][lane], v[1][lane], v[2][lane]))
    }

    /// Where a ray of that direction meets the surface of a lane.
    #[inline]
    pub(super) fn spot(&self, lane: usize, uv: [f32; 2], dir: Vec3) -> Spot {
        let [x, y, z] = [0, 1, 2].map(|i| self.normal[i][lane] * dir[i]);
        Spot::Plane { uv, front: x + y + z < 0.0 }
    }

    /// Distances, u, v, and a mask of the surfaces that the ray meets before `t_max`.
    #[inline(always)]
    pub(super) fn intersect(&self, ray: &WideRay, t_max: f32) -> (Vec4, Vec4, Vec4, u32) {
        let (origin, dir) = (ray.origin.map(Vec4::splat), ray.dir.map(Vec4::splat));
        let dot = |a: &[Vec4; 3], b: &[Vec4; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let to: [Vec4; 3] = std::array::from_fn(|i| self.corner[i] - origin[i]);
        let t = dot(&self.normal, &to) / dot(&self.normal, &dir);
        let at: [Vec4; 3] = std::array::from_fn(|i| dir[i] * t - to[i]);
        let (u, v) = (dot(&self.dual_u, &at), dot(&self.dual_v, &at));
        let low = u.min(v);
        let inside = low.cmpge(Vec4::splat(-EDGE))
            & (u + v - self.whole * low).cmple(Vec4::splat(1.0 + EDGE))
            & t.cmpgt(Vec4::ZERO)
            & t.cmplt(Vec4::splat(t_max));
        (t, u, v, inside.bitmask())
    }
}

impl Round {
    pub(super) fn new(shape: &Shape, prim: u32) -> Self {
        let (centre, form) = match *shape {
            Shape::Sphere { centre, radius } => (centre, RoundShape::Sphere { radius }),
            Shape::Disk { centre, e1, e2 } | Shape::Planar { corner: centre, e1, e2, .. } => {
                let [normal, dual_u, dual_v] = dual(e1.as_dvec3(), e2.as_dvec3()).map(|v| v.as_vec3a());
                (centre, RoundShape::Disk { normal, dual_u, dual_v })
            }
        };
        Self { centre: centre.into(), prim, shape: form }
    }

    /// The nearest distance in (0, `t_max`) and the spot there, if any; with `far` that of the far side of a
    /// sphere that has both sides in front.
    #[inline]
    pub(super) fn intersect(&self, ray: &Ray, t_max: f32, far: bool) -> Option<(f32, Spot)> {
        let to = self.centre - ray.origin;
        let (t, spot) = match self.shape {
            RoundShape::Sphere { radius } => {
                let [low, high] = sphere(to, ray.dir, radius)?;
                let t = match far {
                    false if low > 0.0 => low,
                    true if low <= 0.0 => return None,
                    _ => high,
                };
                let normal = (ray.dir * t - to) / radius;
                (t, Spot::Sphere { normal, front: normal.dot(ray.dir) < 0.0, far })
            }
            RoundShape::Disk { .. } if far => return None,
            RoundShape::Disk { normal, dual_u, dual_v } => {
                let t = normal.dot(to) / normal.dot(ray.dir);
                let at = ray.dir * t - to;
                let uv = [dual_u.dot(at), dual_v.dot(at)];
                if uv[0] * uv[0] + uv[1] * uv[1] > 1.0 {
                    return None;
                }
                // Along the plane t is NaN, and not below `t_max`
                (t, Spot::Plane { uv, front: normal.dot(ray.dir) < 0.0 })
            }
        };
        (t > 0.0 && t < t_max).then_some((t, spot))
    }

    /// The nearest spot before `t_max` that is `solid`.
    #[inline]
    pub(super) fn meets(
        &self,
        ray: &Ray,
        t_max: f32,
        solid: &impl Fn(u32, Spot) -> bool,
    ) -> Option<(f32, Spot)> {
        let first = self.intersect(ray, t_max, false)?;
        if solid(self.prim, first.1) {
            return Some(first);
        }
        self.intersect(ray, t_max, true).filter(|(_, spot)| solid(self.prim, *spot))
    }
}

/// Where a ray from the origin meets a sphere around `to`, the nearer side first. The discriminant is taken at the
/// point nearest to the centre instead of as b² − c (Haines et al. 2019, "Precision Improvements for
/// Ray/Sphere Intersection").
#[inline]
fn sphere(to: Vec3, dir: Vec3, radius: f32) -> Option<[f32; 2]> {
    let b = to.dot(dir);
    let discriminant = radius * radius - (to - dir * b).length_squared();
    if discriminant <= 0.0 {
        return None;
    }
    let q = b + discriminant.sqrt().copysign(b);
    let (r1, r2) = ((to.length_squared() - radius * radius) / q, q);
    Some(if r1 < r2 { [r1, r2] } else { [r2, r1] })
}
