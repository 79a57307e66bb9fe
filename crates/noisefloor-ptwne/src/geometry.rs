//! Surfaces in groups, and what they have at their corners.

use crate::material::CompiledMaterial;
use crate::math::Vec3;
use crate::texture::{Coordinates, twice};

pub(crate) const NO: u32 = u32::MAX;

/// In [`Group::frame`]: texture coordinates of a disk are its radius and its angle, counted down or up.
pub(crate) const RINGS: u32 = u32::MAX - 1;
pub(crate) const RINGS_REVERSED: u32 = u32::MAX - 2;

/// Surfaces that were added together: they share a material, and are numbered from `first`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Group {
    pub(crate) first: u32,
    pub(crate) material: u32,
    /// The light of the first surface; those of the others follow. [`NO`] if they do not shine.
    pub(crate) light: u32,
    /// Index of the first surface's corners; [`NO`] if the group is flat and has no texture coordinates.
    pub(crate) corners: u32,
    /// Where the group's normals and texture coordinates begin in [`Vertices`]; [`NO`] if there are none.
    /// Both pairs of coordinates are in one list.
    pub(crate) normals: u32,
    pub(crate) uvs: u32,
    pub(crate) second_uvs: u32,
    /// Where its colours and alphas of corners, and its tangents begin there; [`NO`] if there are none.
    pub(crate) colours: u32,
    pub(crate) alphas: u32,
    pub(crate) tangents: u32,
    /// The axes of a sphere's texture coordinates, or how those of a disk run; [`NO`] for the usual ones.
    pub(crate) frame: u32,
}

impl Group {
    pub(crate) fn new(first: u32, material: u32, light: u32) -> Self {
        let [corners, normals, uvs, second_uvs, colours, alphas, tangents, frame] = [NO; 8];
        Self { first, material, light, corners, normals, uvs, second_uvs, colours, alphas, tangents, frame }
    }
}

/// What smooth or textured surfaces have at their corners.
#[derive(Clone, Debug, Default)]
pub(crate) struct Vertices {
    pub(crate) corners: Vec<[u32; 3]>,
    pub(crate) normals: Vec<[f32; 3]>,
    pub(crate) uvs: Vec<[f32; 2]>,
    pub(crate) colours: Vec<[f32; 3]>,
    pub(crate) alphas: Vec<f32>,
    pub(crate) tangents: Vec<[f32; 4]>,
}

/// All surfaces of a scene, apart from their shapes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Geometry {
    pub(crate) group_of: Vec<u32>,
    pub(crate) groups: Vec<Group>,
    pub(crate) vertices: Vertices,
    /// Axes of texture coordinates of spheres.
    pub(crate) frames: Vec<[Vec3; 3]>,
}

impl Geometry {
    #[inline]
    pub(crate) fn group(&self, prim: u32) -> &Group {
        &self.groups[self.group_of[prim as usize] as usize]
    }

    /// What a planar surface of `group` has at its corners, in a list where the group's begins at `first`.
    #[inline]
    fn corners<T: Copy>(&self, group: &Group, prim: u32, list: &[T], first: u32) -> [T; 3] {
        let corners = self.vertices.corners[(group.corners + prim - group.first) as usize];
        corners.map(|i| list[(first + i) as usize])
    }

    /// Texture coordinates of a planar surface of `group`, at `uv` along its edges.
    #[inline]
    pub(crate) fn texture_coordinates(&self, group: &Group, prim: u32, [u, v]: [f32; 2]) -> Coordinates {
        if group.uvs == NO {
            return twice(match group.frame {
                RINGS | RINGS_REVERSED => rings(group.frame, u, v),
                _ => [u, v],
            });
        }
        let pair = |uvs: u32| -> [f32; 2] {
            let [a, b, c] = self.corners(group, prim, &self.vertices.uvs, uvs);
            std::array::from_fn(|i| a[i] + (b[i] - a[i]) * u + (c[i] - a[i]) * v)
        };
        let first = pair(group.uvs);
        if group.second_uvs == NO {
            return twice(first);
        }
        let second = pair(group.second_uvs);
        [first[0], first[1], second[0], second[1]]
    }

    /// A sphere's normal along the axes of its texture coordinates, of which the second points up.
    #[inline]
    pub(crate) fn to_local(&self, group: &Group, normal: Vec3) -> Vec3 {
        match self.frames.get(group.frame as usize) {
            Some([x, y, z]) => Vec3::new(normal.dot(*x), normal.dot(*y), normal.dot(*z)),
            None => normal,
        }
    }

    /// The shading normal of a planar surface of `group`, which has normals; none if they cancel.
    #[inline]
    pub(crate) fn shading_normal(&self, group: &Group, prim: u32, uv: [f32; 2]) -> Option<Vec3> {
        let normals = self.corners(group, prim, &self.vertices.normals, group.normals);
        between(normals.map(Vec3::from_array), uv).try_normalize()
    }

    /// The colour between the corners of a planar surface of `group`, which has colours.
    #[inline(never)]
    pub(crate) fn tint(&self, group: &Group, prim: u32, uv: [f32; 2]) -> Vec3 {
        let colours = self.corners(group, prim, &self.vertices.colours, group.colours);
        // The edges are widened a little
        between(colours.map(Vec3::from_array), uv).clamp(Vec3::ZERO, Vec3::ONE)
    }

    /// The alpha between the corners of a planar surface of `group`, which has alphas.
    #[inline(never)]
    pub(crate) fn alpha(&self, group: &Group, prim: u32, [u, v]: [f32; 2]) -> f32 {
        let [a, b, c] = self.corners(group, prim, &self.vertices.alphas, group.alphas);
        (a * (1.0 - u - v) + b * u + c * v).clamp(0.0, 1.0)
    }

    /// The tangent between the corners of a planar surface of `group`, which has tangents, and the sign of
    /// its bitangent.
    pub(crate) fn tangent(&self, group: &Group, prim: u32, uv: [f32; 2]) -> (Vec3, f32) {
        let rows = self.corners(group, prim, &self.vertices.tangents, group.tangents);
        (between(rows.map(|[x, y, z, _]| Vec3::new(x, y, z)), uv), rows[0][3])
    }

    /// Memory that it takes, in bytes.
    pub(crate) fn bytes(&self) -> usize {
        let Vertices { corners, normals, uvs, colours, alphas, tangents } = &self.vertices;
        size_of_val(self.group_of.as_slice())
            + size_of_val(self.groups.as_slice())
            + size_of_val(corners.as_slice())
            + size_of_val(normals.as_slice())
            + size_of_val(uvs.as_slice())
            + size_of_val(colours.as_slice())
            + size_of_val(alphas.as_slice())
            + size_of_val(tangents.as_slice())
            + size_of_val(self.frames.as_slice())
    }
}

/// A value between those of the three corners.
#[inline]
fn between([a, b, c]: [Vec3; 3], [u, v]: [f32; 2]) -> Vec3 {
    a * (1.0 - u - v) + b * u + c * v
}

/// Distance from the middle of a disk, and the angle there as a share of a turn.
fn rings(direction: u32, u: f32, v: f32) -> [f32; 2] {
    let turn = v.atan2(u) * (0.5 * std::f32::consts::FRAC_1_PI);
    let turn = if turn < 0.0 { turn + 1.0 } else { turn };
    [(u * u + v * v).sqrt(), if direction == RINGS { 1.0 - turn } else { turn }]
}

/// Where a ray hit a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Intersection<'a> {
    pub(crate) position: Vec3,
    /// The geometric normal, on the side of the ray's origin.
    pub(crate) flat: Vec3,
    /// The shading normal, on the same side.
    pub(crate) normal: Vec3,
    /// Whether the ray hit the front.
    pub(crate) front: bool,
    pub(crate) uv: Coordinates,
    /// Along growing u, of any length; 0 if that does not count.
    pub(crate) along: Vec3,
    /// The colour between its corners; white if they have none.
    pub(crate) tint: Vec3,
    pub(crate) material: &'a CompiledMaterial,
    /// The index of its light; [`NO`] if it does not shine.
    pub(crate) light: u32,
    /// The least distance by which origins of scattered rays are moved off it.
    pub(crate) offset: f32,
}
