//! Bounds of one light or several: where they are, where they face, and how strong they are.

use super::emitter::{Light, LightShape, Outline};
use crate::math::{self, Vec3};
use std::f32::consts::{FRAC_PI_2, PI};

/// Bounds of lights (Conty Estevez, Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree
/// Splitting", §4.1).
#[derive(Clone, Copy, Debug)]
pub(super) struct Cluster {
    low: Vec3,
    high: Vec3,
    /// A sphere around all of it.
    pub(super) centre: Vec3,
    pub(super) radius: f32,
    /// Axis of a cone of all normals, and its half angle in radians.
    pub(super) axis: Vec3,
    pub(super) spread: f32,
    /// Largest angle between a normal and a direction in which its light shines, in radians.
    pub(super) emission: f32,
    pub(super) two_sided: bool,
    /// How far behind the centre, along the axis, the farthest receiver is. Infinite but for one surface, which
    /// shines only to the front of its plane.
    pub(super) behind: f32,
    /// Sum of the intensities along the normals.
    pub(super) intensity: f64,
    /// Sum of the areas, as seen along the normals.
    pub(super) area: f32,
    pub(super) count: u32,
}

impl Cluster {
    /// The bounds of one light, whose emission texture has the mean `texture`; none if it is infinitely far
    /// away.
    pub(super) fn of(light: &Light, texture: Vec3) -> Option<Self> {
        let luminance = f64::from(math::luminance(light.radiance * texture));
        let everywhere = (Vec3::Z, PI, FRAC_PI_2);
        let (centre, half, radius, (axis, spread, emission), area) = match light.shape {
            LightShape::Planar { corner, e1, e2, normal, area, outline } => {
                let (centre, half, radius) = plane_bounds(corner, e1, e2, outline);
                (centre, half, radius, (normal, 0.0, FRAC_PI_2), area)
            }
            LightShape::Sphere { centre, radius } => {
                (centre, Vec3::splat(radius), radius, everywhere, PI * radius * radius)
            }
            LightShape::Point { position, cone, .. } if cone.inner < -1.0 => {
                (position, Vec3::ZERO, 0.0, everywhere, 0.0)
            }
            LightShape::Point { position, axis, cone } => {
                let (inner, outer) = (cone.inner.acos(), cone.outer.acos());
                (position, Vec3::ZERO, 0.0, (axis, inner, outer - inner), 0.0)
            }
            LightShape::Projector { position, u, v, axis, .. } => {
                // All directions up to the corners count alike
                let corner = u.length_recip().hypot(v.length_recip()).atan();
                (position, Vec3::ZERO, 0.0, (axis, corner, 0.02), 0.0)
            }
            LightShape::Sun { .. } | LightShape::Map | LightShape::Distant { .. } => return None,
        };
        // The radiance of lights without size is their intensity
        let intensity = luminance * if area > 0.0 { f64::from(area) } else { 1.0 };
        let (low, high, two_sided) = (centre - half, centre + half, light.two_sided);
        let behind = match light.shape {
            LightShape::Planar { corner, .. } if !two_sided => axis.dot(centre - corner),
            _ => f32::INFINITY,
        };
        Some(Self {
            low,
            high,
            centre,
            radius,
            axis,
            spread,
            emission,
            two_sided,
            behind,
            intensity,
            area,
            count: 1,
        })
    }

    /// Whether it is one flat surface.
    pub(super) fn is_flat(&self) -> bool {
        self.area > 0.0 && self.spread == 0.0
    }

    pub(super) fn union(&self, other: &Self) -> Self {
        let (low, high) = (self.low.min(other.low), self.high.max(other.high));
        let centre = 0.5 * (low + high);
        let reach = |c: &Self| (c.centre - centre).length() + c.radius;
        let (axis, spread) = cone_union((self.axis, self.spread), (other.axis, other.spread));
        Self {
            low,
            high,
            centre,
            radius: reach(self).max(reach(other)).min(0.5 * (high - low).length()),
            axis,
            spread,
            emission: self.emission.max(other.emission),
            two_sided: self.two_sided || other.two_sided,
            behind: f32::INFINITY,
            intensity: self.intensity + other.intensity,
            area: self.area + other.area,
            count: self.count + other.count,
        }
    }

    /// How much a cluster costs in noise: its strength times the extent of positions and directions (§4.4).
    pub(super) fn cost(&self) -> f64 {
        let size = self.high - self.low;
        let area = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
        let (spread, reach) = (self.spread, (self.spread + self.emission).min(PI));
        // The solid angle of the cone, and that of the emission beyond it, weighted by its cosine
        let mut angles = 2.0 * PI * (1.0 - spread.cos());
        angles += FRAC_PI_2
            * (2.0 * reach * spread.sin() - (spread - 2.0 * reach).cos() - 2.0 * spread * spread.sin()
                + spread.cos());
        // Lights along a line, or in one point, still differ in strength
        let area = f64::from(area) + 1e-3 * f64::from(size.length_squared());
        self.intensity * area * f64::from(angles.max(0.0))
    }

    /// Edges of the bounding box.
    pub(super) fn size(&self) -> Vec3 {
        self.high - self.low
    }
}

/// Centre, half edges of the bounding box and bounding radius of a planar light.
fn plane_bounds(corner: Vec3, e1: Vec3, e2: Vec3, outline: Outline) -> (Vec3, Vec3, f32) {
    match outline {
        Outline::Ellipse => {
            let half = (e1 * e1 + e2 * e2).sqrt();
            // The longer half axis: the largest singular value of (e1, e2)
            let (a, b, c) = (e1.length_squared(), e2.length_squared(), e1.dot(e2));
            let largest = 0.5 * (a + b) + (0.25 * (a - b) * (a - b) + c * c).sqrt();
            (corner, half, largest.sqrt())
        }
        Outline::Parallelogram => {
            let half = 0.5 * (e1.abs() + e2.abs());
            let radius = 0.5 * (e1 + e2).length().max((e1 - e2).length());
            (corner + 0.5 * (e1 + e2), half, radius)
        }
        Outline::Triangle => {
            let (low, high) = (Vec3::ZERO.min(e1).min(e2), Vec3::ZERO.max(e1).max(e2));
            let centre = 0.5 * (low + high);
            let radius = [Vec3::ZERO, e1, e2].map(|p| (p - centre).length()).into_iter().fold(0.0, f32::max);
            (corner + centre, 0.5 * (high - low), radius)
        }
    }
}

/// A cone around two cones, given by axis and half angle (§4.3).
fn cone_union(a: (Vec3, f32), b: (Vec3, f32)) -> (Vec3, f32) {
    let (wide, narrow) = if a.1 >= b.1 { (a, b) } else { (b, a) };
    let between = wide.0.dot(narrow.0).clamp(-1.0, 1.0).acos();
    if (between + narrow.1).min(PI) <= wide.1 {
        return wide;
    }
    let spread = 0.5 * (wide.1 + between + narrow.1);
    let pivot = wide.0.cross(narrow.0).normalize_or_zero();
    if spread >= PI || pivot == Vec3::ZERO {
        return (wide.0, PI);
    }
    // Turn the axis of the wider cone towards the other
    let (sin, cos) = (spread - wide.1).sin_cos();
    ((wide.0 * cos + pivot.cross(wide.0) * sin).normalize(), spread)
}
