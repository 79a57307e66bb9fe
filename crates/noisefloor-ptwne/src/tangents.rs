//! How a surface runs along its texture coordinates.

use crate::accel::{Hit, HitShape};
use crate::geometry::{Group, NO, RINGS, RINGS_REVERSED};
use crate::math::Vec3;
use crate::scene::Scene;
use std::f32::consts::PI;

impl Scene {
    /// The derivatives of the position by u and v where a ray hit; none where texture coordinates do not span
    /// the surface.
    /// `normal` is the geometric one of the front; `second` says of which texture coordinates.
    pub(crate) fn tangents(&self, hit: &Hit, normal: Vec3, second: bool) -> Option<[Vec3; 2]> {
        let Some(instance) = self.bvh.instance(hit) else {
            return self.local_tangents(hit, normal, second);
        };
        let along = self.local_tangents(hit, instance.local_normal(normal), second)?;
        Some(along.map(|edge| instance.edge(edge)))
    }

    /// The tangent of the mesh where a ray hit, and the bitangent; none if it has none. `normal` is the
    /// shading normal of the front.
    pub(crate) fn given_tangents(&self, hit: &Hit, normal: Vec3) -> Option<[Vec3; 2]> {
        let (prim, _) = self.bvh.shape_at::<true>(hit);
        let group = self.geometry.group(prim);
        if group.tangents == NO {
            return None;
        }
        let instance = self.bvh.instance(hit);
        let normal = instance.map_or(normal, |instance| instance.local_normal(normal));
        let (tangent, side) = self.geometry.tangent(group, prim, hit.uv);
        // glTF 2.0, §3.7.2.1
        let along = [tangent, normal.cross(tangent) * side];
        Some(along.map(|edge| instance.map_or(edge, |instance| instance.edge(edge))))
    }

    /// The same in the coordinates of the object that was hit.
    fn local_tangents(&self, hit: &Hit, normal: Vec3, second: bool) -> Option<[Vec3; 2]> {
        let (prim, shape) = self.bvh.shape_at::<true>(hit);
        let group = self.geometry.group(prim);
        match (shape, self.bvh.edges(hit)) {
            (HitShape::Sphere { radius, .. }, _) => Some(self.around(group, radius, normal)),
            (HitShape::Plane { .. }, Some(edges)) => {
                let [a, b] = self.geometry.texture_steps(group, prim, hit.uv, second);
                // [e1 e2] = [dp/du dp/dv]·[a b], solved for the derivatives
                let determinant = a[0] * b[1] - b[0] * a[1];
                let inverse = determinant.recip();
                let along = [
                    (edges[0] * b[1] - edges[1] * a[1]) * inverse,
                    (edges[1] * a[0] - edges[0] * b[0]) * inverse,
                ];
                along.iter().all(|d| d.is_finite()).then_some(along)
            }
            _ => None,
        }
    }

    /// Along azimuth and polar angle of a sphere, with `normal` the one of its outside.
    fn around(&self, group: &Group, radius: f32, normal: Vec3) -> [Vec3; 2] {
        let [x, y, z] =
            self.geometry.frames.get(group.frame as usize).copied().unwrap_or([Vec3::X, Vec3::Y, Vec3::Z]);
        let along_u = z * normal.dot(x) - x * normal.dot(z);
        let along_v = (y - normal * normal.dot(y)).normalize_or_zero();
        [along_u * (2.0 * PI * radius), along_v * (PI * radius)]
    }
}

impl crate::geometry::Geometry {
    /// By how much texture coordinates grow along each edge of a planar surface of `group`, at `at` on it.
    fn texture_steps(&self, group: &Group, prim: u32, [u, v]: [f32; 2], second: bool) -> [[f32; 2]; 2] {
        let uvs = if second && group.second_uvs != NO { group.second_uvs } else { group.uvs };
        if uvs == NO {
            let turn = match group.frame {
                RINGS => -0.5 / PI,
                RINGS_REVERSED => 0.5 / PI,
                _ => return [[1.0, 0.0], [0.0, 1.0]],
            };
            // The radius √(a² + b²) and the angle atan2(b, a), at (a, b)
            let (r2, r) = (u * u + v * v, (u * u + v * v).sqrt());
            return [[u / r, -v / r2 * turn], [v / r, u / r2 * turn]];
        }
        let corners = self.vertices.corners[(group.corners + prim - group.first) as usize];
        let [a, b, c] = corners.map(|i| self.vertices.uvs[(uvs + i) as usize]);
        [[b[0] - a[0], b[1] - a[1]], [c[0] - a[0], c[1] - a[1]]]
    }
}
