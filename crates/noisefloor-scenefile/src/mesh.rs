//! Triangle meshes, from their files to the renderer.

pub(crate) mod obj;
pub(crate) mod ply;
pub(crate) mod polygon;
pub(crate) mod serialized;
pub(crate) mod solids;
pub(crate) mod subdivide;

use crate::error::{LoadError, Place};
use glam::{DMat3, DMat4, DVec3, Vec2, Vec3};
use noisefloor_ptwne::{Emission, MIN_AREA, MaterialId, Mesh, SceneBuilder, SceneError};

/// Indexed triangles. Normals, texture coordinates and colours are one a position, or none.
#[derive(Clone, Debug, Default)]
pub(crate) struct Triangles {
    pub(crate) positions: Vec<[f32; 3]>,
    /// Shading normals, of any length; 0 where there is none.
    pub(crate) normals: Vec<[f32; 3]>,
    pub(crate) uvs: Vec<[f32; 2]>,
    /// Colours; none but of meshes that were asked for them.
    pub(crate) colours: Vec<[f32; 3]>,
    /// Colours of the triangles, or none.
    pub(crate) face_colours: Vec<[f32; 3]>,
    /// Corners of each triangle; the front is where they run counter-clockwise.
    pub(crate) indices: Vec<[u32; 3]>,
    /// What else its file has, which nobody reads.
    pub(crate) unread: Vec<String>,
}

impl Triangles {
    /// Checks that indices are in range and positions finite. Normals and texture coordinates that are not
    /// finite become 0.
    pub(crate) fn check(&mut self, place: &Place) -> Result<(), LoadError> {
        let count = self.positions.len();
        if let Some(face) = self.indices.iter().position(|t| t.iter().any(|i| *i as usize >= count)) {
            let triangle = self.indices[face];
            let what = format!("face {face} has corners {triangle:?}, but there are {count} vertices");
            return Err(place.bad(what));
        }
        let numbers = self.normals.as_flattened_mut().iter_mut().chain(self.uvs.as_flattened_mut());
        numbers.filter(|x| !x.is_finite()).for_each(|x| *x = 0.0);
        match self.positions.iter().position(|row| row.iter().any(|x| !x.is_finite())) {
            Some(vertex) => Err(place.bad(format!("vertex {vertex} has a number that is not finite"))),
            None => Ok(()),
        }
    }

    /// The area of all triangles together, whose indices [`Self::check`] has checked.
    pub(crate) fn area(&self) -> f64 {
        let doubled = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|i| Vec3::from_array(self.positions[i as usize]).as_dvec3());
            (b - a).cross(c - a).length()
        };
        self.indices.iter().map(doubled).sum::<f64>() / 2.0
    }

    /// Moves positions and normals.
    pub(crate) fn transform(&mut self, to_world: DMat4) {
        for position in &mut self.positions {
            *position =
                to_world.transform_point3(Vec3::from_array(*position).as_dvec3()).as_vec3().to_array();
        }
        let matrix = normal_matrix(DMat3::from_mat4(to_world));
        for normal in &mut self.normals {
            let moved = matrix * Vec3::from_array(*normal).as_dvec3();
            *normal = moved.normalize_or_zero().as_vec3().to_array();
        }
    }

    /// Gives each vertex the mean of the normals of its triangles, weighted by their angles there (Thürmer
    /// and Wüthrich 1998), as Mitsuba does for meshes without normals.
    pub(crate) fn smooth(&mut self) {
        let mut sums = vec![Vec3::ZERO; self.positions.len()];
        for triangle in &self.indices {
            let corners = triangle.map(|i| Vec3::from_array(self.positions[i as usize]));
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize_or_zero();
            for at in 0..3 {
                let [a, b, c] = [0, 1, 2].map(|k| corners[(at + k) % 3]);
                let (ab, ac) = ((b - a).normalize_or_zero(), (c - a).normalize_or_zero());
                if ab != Vec3::ZERO && ac != Vec3::ZERO {
                    sums[triangle[at] as usize] += normal * ab.angle_between(ac);
                }
            }
        }
        self.normals = sums.iter().map(|sum| sum.normalize_or_zero().to_array()).collect();
    }

    /// Turns the triangles whose corners run the other way than their normals point: what is the front, for
    /// reflection and for emission, Mitsuba tells by the shading normals.
    pub(crate) fn face_normals_outwards(&mut self) {
        for triangle in &mut self.indices {
            let at = |rows: &[[f32; 3]]| triangle.map(|i| Vec3::from_array(rows[i as usize]));
            let [a, b, c] = at(&self.positions);
            let front: Vec3 = at(&self.normals).iter().sum();
            if (b - a).cross(c - a).dot(front) < 0.0 {
                triangle.swap(1, 2);
            }
        }
    }

    /// Moves an instance: as [`Self::transform`], and the front stays on the same side.
    pub(crate) fn place(&mut self, to_world: DMat4) {
        self.transform(to_world);
        if !self.normals.is_empty() {
            self.face_normals_outwards();
        } else if DMat3::from_mat4(to_world).determinant() < 0.0 {
            self.indices.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
    }

    /// Gives each triangle corners of its own, and those the colour of the triangle.
    pub(crate) fn spread_face_colours(&mut self) {
        if self.face_colours.is_empty() {
            return;
        }
        self.colours.clear();
        self.separate();
        self.colours = self.face_colours.iter().flat_map(|colour| [*colour; 3]).collect();
    }

    /// Gives each triangle corners of its own, with these texture coordinates, if there are no others.
    pub(crate) fn map_each(&mut self, uvs: [[f32; 2]; 3]) {
        if self.uvs.is_empty() {
            self.separate();
            self.uvs = self.indices.iter().flat_map(|_| uvs).collect();
        }
    }

    /// Gives each triangle corners of its own.
    fn separate(&mut self) {
        fn spread<T: Copy>(rows: &mut Vec<T>, corners: &[u32]) {
            if !rows.is_empty() {
                *rows = corners.iter().map(|i| rows[*i as usize]).collect();
            }
        }
        let corners = self.indices.as_flattened();
        spread(&mut self.positions, corners);
        spread(&mut self.normals, corners);
        spread(&mut self.uvs, corners);
        spread(&mut self.colours, corners);
        self.indices = (0..self.indices.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    }

    /// Adds it to a scene: as a parallelogram, which is one light, or as triangles. Returns how many of them have no
    /// area and are left out.
    pub(crate) fn add_to(
        &self,
        builder: &mut SceneBuilder,
        material: MaterialId,
        emission: Option<Emission>,
    ) -> Result<usize, SceneError> {
        if let Some(Parallelogram { corner, edges, uvs }) = self.parallelogram() {
            builder.mapped_parallelogram(corner, edges, uvs, material, emission)?;
            return Ok(0);
        }
        let Self { positions, normals, uvs, colours, indices, .. } = self;
        builder.mesh(
            &Mesh { positions, normals, uvs, colours, indices, ..Mesh::default() },
            material,
            emission,
        )
    }

    /// The parallelogram of one colour that the mesh consists of, as two flat triangles.
    fn parallelogram(&self) -> Option<Parallelogram> {
        let [first, second] = self.indices.as_slice() else { return None };
        if !self.colours.is_empty() {
            return None;
        }
        let at = |i: u32| Vec3::from_array(self.positions[i as usize]);
        // Turned so that they are (a, b, c) and (a, c, d)
        let turned = |by: usize, corners: &[u32; 3]| [0, 1, 2].map(|k| corners[(k + by) % 3]);
        let mut turns = (0..9).map(|i| [turned(i / 3, first), turned(i % 3, second)]);
        let [one, two] = turns.find(|[one, two]| at(one[0]) == at(two[0]) && at(one[2]) == at(two[1]))?;
        let [a, b, c, d] = [one[0], one[1], one[2], two[2]];
        let edges = [at(b) - at(a), at(d) - at(a)];
        let cross = edges[0].cross(edges[1]);
        let even = (at(c) - at(b) - edges[1]).length() <= 1e-5 * (edges[0].length() + edges[1].length());

        // Flat, and its texture is stretched evenly
        let along = |i: &u32| {
            let normal = self.normals.get(*i as usize).map_or(cross, |n| Vec3::from_array(*n));
            normal.normalize_or_zero().dot(cross.normalize_or_zero()) > 0.9999
        };
        let uv = |i: u32| self.uvs.get(i as usize).map(|uv| Vec2::from_array(*uv));
        let uvs = match [a, b, d].map(uv) {
            [Some(a), Some(b), Some(d)] => [a, b, d],
            _ => [Vec2::ZERO, Vec2::X, Vec2::Y],
        };
        let mapped = |i: u32, want: Vec2| uv(i).is_none_or(|uv| (uv - want).length() <= 1e-5);
        let stretched = mapped(c, uvs[1] + uvs[2] - uvs[0]) && mapped(two[0], uvs[0]);
        let whole =
            even && stretched && first.iter().chain(second).all(along) && cross.length() > 2.0 * MIN_AREA;
        whole.then(|| Parallelogram {
            corner: at(a).to_array(),
            edges: edges.map(|edge| edge.to_array()),
            uvs: uvs.map(|uv| uv.to_array()),
        })
    }

    /// Exchanges front and back.
    pub(crate) fn flip(&mut self) {
        for normal in &mut self.normals {
            *normal = normal.map(|x| -x);
        }
        for triangle in &mut self.indices {
            triangle.swap(1, 2);
        }
    }
}

/// A corner, the two edges from there, whose cross product points to the front, and the texture coordinates of the
/// corner and of the edges' ends.
#[derive(Debug, PartialEq)]
struct Parallelogram {
    corner: [f32; 3],
    edges: [[f32; 3]; 2],
    uvs: [[f32; 2]; 3],
}

/// The rows of an affine transform, as instances take them.
pub(crate) fn rows(to_world: DMat4) -> [[f64; 4]; 3] {
    [0, 1, 2].map(|i| to_world.row(i).to_array())
}

/// The directions of x, y and z.
pub(crate) fn axes(to_world: DMat4) -> [DVec3; 3] {
    [to_world.x_axis, to_world.y_axis, to_world.z_axis].map(|axis| axis.truncate().normalize_or_zero())
}

/// The rows of a rotation, as maps of the surroundings take them.
pub(crate) fn rotation(to_world: DMat3) -> [[f32; 3]; 3] {
    to_world.transpose().to_cols_array_2d().map(|row| row.map(|x| x as f32))
}

/// The matrix that takes normals along: the inverse transpose, but for a positive
/// factor. Computed from cofactors, so that singular transforms work.
pub(crate) fn normal_matrix(to_world: DMat3) -> DMat3 {
    let DMat3 { x_axis: x, y_axis: y, z_axis: z } = to_world;
    let sign = if to_world.determinant() < 0.0 { -1.0 } else { 1.0 };
    let column = |a: DVec3, b: DVec3| a.cross(b) * sign;
    DMat3::from_cols(column(y, z), column(z, x), column(x, y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// Two triangles that share an edge and are bent along it.
    fn bent() -> Triangles {
        let positions = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -3.0, 5.0]];
        Triangles { positions, indices: vec![[0, 1, 2], [1, 0, 3]], ..Triangles::default() }
    }

    #[test]
    fn smooth_normals_are_those_of_mitsuba() {
        let mut mesh = bent();
        mesh.smooth();
        // What Mitsuba 3.9.1 computes
        let want = [[0.0, 0.493, 0.870], [0.0, 0.624, 0.782], [0.0, 0.0, 1.0], [0.0, 0.857, 0.514]];
        for (normal, want) in mesh.normals.iter().zip(want) {
            let off = (Vec3::from_array(*normal) - Vec3::from_array(want)).length();
            assert!(off < 1e-3, "{normal:?} {want:?}");
        }
    }

    #[test]
    fn normals_stay_perpendicular_and_fronts_follow_them() {
        let matrix = DMat4::from_cols_array(&[
            2.0, 0.0, 0.0, 0.0, 0.5, -1.0, 0.3, 0.0, 0.0, 0.2, 3.0, 0.0, 1.0, 2.0, 3.0, 1.0,
        ]);
        let mut mesh = bent();
        mesh.indices.truncate(1);
        mesh.normals = vec![[0.0, 0.0, 2.0]; 4];
        mesh.transform(matrix);
        let corners =
            |mesh: &Triangles| mesh.indices[0].map(|i| Vec3::from_array(mesh.positions[i as usize]));
        let [a, b, c] = corners(&mesh);
        let normal = Vec3::from_array(mesh.normals[0]);
        assert!((normal.length() - 1.0).abs() < 1e-6);
        assert!(normal.dot(b - a).abs() < 1e-6 && normal.dot(c - a).abs() < 1e-6);

        // The determinant is negative: the corners now run clockwise as seen from where the normals point
        assert!((b - a).cross(c - a).dot(normal) < 0.0);
        mesh.face_normals_outwards();
        let [a, b, c] = corners(&mesh);
        assert!((b - a).cross(c - a).dot(normal) > 0.0);
        mesh.flip();
        let [a, b, c] = corners(&mesh);
        assert!(
            (b - a).cross(c - a).dot(normal) < 0.0 && Vec3::from_array(mesh.normals[0]).dot(normal) < 0.0
        );
    }

    #[test]
    fn two_triangles_are_a_parallelogram() {
        let positions = vec![[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
        let flat = Triangles { positions, ..Triangles::default() };
        for indices in [[[0, 1, 2], [0, 2, 3]], [[2, 0, 1], [3, 0, 2]], [[1, 2, 3], [3, 0, 1]]] {
            let mesh = Triangles { indices: indices.to_vec(), ..flat.clone() };
            let found = mesh.parallelogram().unwrap();
            let (a, [e1, e2]) = (Vec3::from_array(found.corner), found.edges.map(Vec3::from_array));
            assert!((e1.cross(e2) - Vec3::new(0.0, 0.0, 2.0)).length() < 1e-6, "{indices:?}");
            let middle = a + 0.5 * (e1 + e2);
            assert!((middle - Vec3::new(1.5, 0.5, 0.0)).length() < 1e-6, "{indices:?}");
        }
        // Fronts on different sides, a bend, a trapezium, smooth normals
        let odd = Triangles { indices: vec![[0, 1, 2], [0, 3, 2]], ..flat.clone() };
        assert_eq!(odd.parallelogram(), None);
        let square = Triangles { indices: vec![[0, 1, 2], [0, 2, 3]], ..flat };
        for moved in [[1.0, 1.0, 0.5], [1.5, 1.0, 0.0]] {
            let mut odd = square.clone();
            odd.positions[3] = moved;
            assert_eq!(odd.parallelogram(), None);
        }
        let mut smooth = square.clone();
        smooth.normals = vec![[0.0, 0.0, 1.0], [0.0, 0.0, 1.0], [0.1, 0.0, 1.0], [0.0, 0.0, 1.0]];
        assert_eq!(smooth.parallelogram(), None);
        // A texture that is stretched evenly, and one that is not
        let mut mapped = square.clone();
        mapped.uvs = vec![[0.0, 0.0], [1.0, 0.0], [1.5, 1.0], [0.5, 1.0]];
        assert_eq!(mapped.parallelogram().unwrap().uvs, [[0.0, 0.0], [1.0, 0.0], [0.5, 1.0]]);
        mapped.uvs[2] = [1.0, 1.0];
        assert_eq!(mapped.parallelogram(), None);
        assert_eq!(bent().parallelogram(), None);
    }

    #[test]
    fn colours_of_faces_have_corners_of_their_own() {
        let mut mesh = bent();
        mesh.smooth();
        mesh.face_colours = vec![[0.1; 3], [0.9; 3]];
        mesh.spread_face_colours();
        assert_eq!((mesh.indices.as_slice(), mesh.positions.len()), ([[0, 1, 2], [3, 4, 5]].as_slice(), 6));
        assert_eq!((mesh.colours[2], mesh.colours[3]), ([0.1; 3], [0.9; 3]));
        assert_eq!((mesh.positions[3], mesh.normals[3]), (bent().positions[1], mesh.normals[1]));
    }

    #[test]
    fn what_does_not_fit_is_an_error() {
        let place = Place::file(Path::new("a.ply"));
        let mut odd = bent();
        odd.normals = vec![[f32::NAN, 0.0, 1.0]; 4];
        odd.check(&place).unwrap();
        assert_eq!(odd.normals[0], [0.0, 0.0, 1.0]);
        let mut mesh = bent();
        mesh.indices[1][2] = 4;
        let error = mesh.check(&place).unwrap_err().to_string();
        assert_eq!(error, "a.ply: face 1 has corners [1, 0, 4], but there are 4 vertices");
        let mut mesh = bent();
        mesh.positions[2][0] = f32::NAN;
        let error = mesh.check(&place).unwrap_err().to_string();
        assert_eq!(error, "a.ply: vertex 2 has a number that is not finite");
    }
}
