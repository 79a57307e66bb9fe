//! The shape of a surface.

use super::aabb::Aabb;
use crate::math::Vec3;

/// The shape of a surface, without its material.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Shape {
    /// The points `corner + u·e1 + v·e2` for u, v ≥ 0: u, v ≤ 1 in a parallelogram (`whole`), u + v ≤ 1 in a
    /// triangle.
    Planar {
        corner: glam::Vec3,
        e1: glam::Vec3,
        e2: glam::Vec3,
        whole: bool,
    },
    Sphere {
        centre: glam::Vec3,
        radius: f32,
    },
    /// An ellipse: the points `centre + u·e1 + v·e2` with u² + v² ≤ 1.
    Disk {
        centre: glam::Vec3,
        e1: glam::Vec3,
        e2: glam::Vec3,
    },
}

/// A surface, by its index.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Surface {
    pub(crate) shape: Shape,
    pub(crate) prim: u32,
}

impl Shape {
    pub(super) fn bounds(&self) -> Aabb {
        match *self {
            Shape::Planar { corner, e1, e2, whole } => {
                let [corner, a, b] = [corner, corner + e1, corner + e2].map(Vec3::from);
                let last = if whole { a + Vec3::from(e2) } else { corner };
                Aabb::new(corner.min(a).min(b).min(last), corner.max(a).max(b).max(last))
            }
            Shape::Sphere { centre, radius } => Aabb::new((centre - radius).into(), (centre + radius).into()),
            Shape::Disk { centre, e1, e2 } => {
                let reach = (e1 * e1 + e2 * e2).map(f32::sqrt);
                Aabb::new((centre - reach).into(), (centre + reach).into())
            }
        }
    }

    pub(crate) fn translated(self, by: glam::Vec3) -> Self {
        match self {
            Shape::Planar { corner, e1, e2, whole } => Shape::Planar { corner: corner + by, e1, e2, whole },
            Shape::Sphere { centre, radius } => Shape::Sphere { centre: centre + by, radius },
            Shape::Disk { centre, e1, e2 } => Shape::Disk { centre: centre + by, e1, e2 },
        }
    }
}

/// Lowest and highest corner of the bounding box of `shapes`; none if there are no shapes.
pub(crate) fn bounds<'a>(shapes: impl IntoIterator<Item = &'a Shape>) -> Option<[Vec3; 2]> {
    let all = shapes.into_iter().map(Shape::bounds).reduce(|a, b| a.union(&b))?;
    Some([all.min, all.max])
}

/// The unit normal and the dual basis of two edges, in f64, since the area may be tiny.
pub(super) fn dual(a: glam::DVec3, b: glam::DVec3) -> [glam::DVec3; 3] {
    let n = a.cross(b);
    let inverse = n.length_squared().recip();
    [n * inverse.sqrt(), b.cross(n) * inverse, n.cross(a) * inverse]
}
