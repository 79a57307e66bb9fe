//! Triangles of meshes (glTF 2.0, §3.7).

use super::accessor::{floats, indices};
use super::asset::Asset;
use super::parts::{AddedMaterial, Corners};
use crate::mesh::normal_matrix;
use crate::{LoadError, Place};
use glam::{DAffine3, DMat3, DVec3};
use gltf::json::accessor::Type;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index};

/// An indexed mesh, as the renderer takes it. All but `positions` and `indices` may be empty.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Triangles {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) normals: Vec<[f32; 3]>,
    pub(super) uvs: Vec<[f32; 2]>,
    pub(super) second_uvs: Vec<[f32; 2]>,
    /// One a corner, or none.
    pub(super) colours: Vec<[f32; 3]>,
    pub(super) alphas: Vec<f32>,
    /// Of a triangle's corners; the fourth number is the sign of the bitangent.
    pub(super) tangents: Vec<[f32; 4]>,
    pub(super) indices: Vec<[u32; 3]>,
}

/// The accessor of an attribute, if there is one.
pub(super) fn attribute(primitive: &Primitive, semantic: Semantic) -> Option<Index<Accessor>> {
    primitive.attributes.get(&Checked::Valid(semantic)).copied()
}

/// The corners of a primitive, before its node's transform.
pub(super) fn positions(
    asset: &Asset<'_>,
    primitive: &Primitive,
    place: &Place,
) -> Result<Vec<[f32; 3]>, LoadError> {
    let Some(positions) = attribute(primitive, Semantic::Positions) else { return Ok(vec![]) };
    floats(asset, positions, place)
}

/// What a primitive has in `COLOR_0`.
pub(super) fn corners(asset: &Asset<'_>, primitive: &Primitive, place: &Place) -> Result<Corners, LoadError> {
    let Some(index) = attribute(primitive, Semantic::Colors(0)) else { return Ok(Corners::Nothing) };
    let four = asset.get(index, "accessor", place)?.type_ == Checked::Valid(Type::Vec4);
    Ok(if four { Corners::ColoursAndAlphas } else { Corners::Colours })
}

/// The triangles of a primitive, before its node's transform, with what its material needs.
pub(super) fn triangles(
    asset: &Asset<'_>,
    primitive: &Primitive,
    mode: Mode,
    material: &AddedMaterial,
    place: &Place,
) -> Result<Triangles, LoadError> {
    let positions = positions(asset, primitive, place)?;
    let alike = |accessor: Option<Index<Accessor>>, what: &str| match accessor {
        Some(index) => {
            let (found, expected) = (asset.get(index, "accessor", place)?.count.0, positions.len());
            if found != expected as u64 {
                return Err(place.bad(format_args!("it has {expected} positions, but {found} {what}")));
            }
            Ok(Some(index))
        }
        None => Ok(None),
    };
    let normals = match alike(attribute(primitive, Semantic::Normals), "normals")? {
        Some(normals) => floats(asset, normals, place)?,
        None => vec![],
    };
    let coordinates = |set: Option<u32>| {
        let set = set.and_then(|set| attribute(primitive, Semantic::TexCoords(set)));
        Ok(match alike(set, "texture coordinates")? {
            // The first row of an image is at v = 0 in glTF, at v = 1 in the renderer
            Some(uvs) => {
                floats(asset, uvs, place)?.into_iter().map(|[u, v]: [f32; 2]| [u, 1.0 - v]).collect()
            }
            None => vec![],
        })
    };
    let [uvs, second_uvs] = [coordinates(material.sets[0])?, coordinates(material.sets[1])?];
    let (colours, alphas) = match alike(attribute(primitive, Semantic::Colors(0)), "colours")? {
        Some(colours) => colours_of(asset, colours, place)?,
        None => (vec![], vec![]),
    };
    // Without normals, tangents are to be ignored (glTF 2.0, §3.7.2.1)
    let tangents =
        attribute(primitive, Semantic::Tangents).filter(|_| material.normal_map && !normals.is_empty());
    let tangents = match alike(tangents, "tangents")? {
        Some(tangents) => floats::<4>(asset, tangents, place)?,
        None => vec![],
    };
    let corners = match primitive.indices {
        Some(accessor) => indices(asset, accessor, place)?,
        None => (0..u32::try_from(positions.len()).unwrap_or(u32::MAX)).collect(),
    };
    let indices = assemble(mode, &corners);
    Ok(Triangles { positions, normals, uvs, second_uvs, colours, alphas, tangents, indices })
}

/// Colours, and their alphas if they have any.
fn colours_of(
    asset: &Asset<'_>,
    index: Index<Accessor>,
    place: &Place,
) -> Result<(Vec<[f32; 3]>, Vec<f32>), LoadError> {
    // Also false for NaN
    let inside = |x: f32| if x > 0.0 { x.min(1.0) } else { 0.0 };
    let colour = |[r, g, b]: [f32; 3]| [r, g, b].map(inside);
    Ok(if asset.get(index, "accessor", place)?.type_ == Checked::Valid(Type::Vec4) {
        let rows = floats::<4>(asset, index, place)?;
        rows.into_iter().map(|[r, g, b, a]| (colour([r, g, b]), inside(a))).unzip()
    } else {
        (floats::<3>(asset, index, place)?.into_iter().map(colour).collect(), vec![])
    })
}

/// How the corners of a primitive make triangles.
pub(super) fn mode(primitive: &Primitive, place: &Place) -> Result<Mode, LoadError> {
    match primitive.mode {
        Checked::Valid(mode) => Ok(mode),
        Checked::Invalid => Err(place.bad("its mode is not one of glTF's")),
    }
}

/// Number of triangles of a mode that `corners` make.
pub(super) fn count(mode: Mode, corners: u64) -> u64 {
    match mode {
        Mode::Triangles => corners / 3,
        Mode::TriangleStrip | Mode::TriangleFan => corners.saturating_sub(2),
        Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => 0,
    }
}

/// Triangles from the corners of a mode. Incomplete ones are left out, as the specification says.
fn assemble(mode: Mode, corners: &[u32]) -> Vec<[u32; 3]> {
    let (groups, _) = corners.as_chunks::<3>();
    let windows = corners.windows(3).map(|w| [w[0], w[1], w[2]]);
    match mode {
        Mode::Triangles => groups.to_vec(),
        Mode::TriangleStrip => {
            windows.enumerate().map(|(i, [a, b, c])| if i % 2 == 0 { [a, b, c] } else { [a, c, b] }).collect()
        }
        Mode::TriangleFan => {
            corners.get(1..).unwrap_or_default().windows(2).map(|w| [w[0], w[1], corners[0]]).collect()
        }
        Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => vec![],
    }
}

impl Triangles {
    /// Moves each vertex to the world, by a transform of its own or by that of its node, which then repeats.
    pub(super) fn place<'m>(&mut self, mut moves: impl Iterator<Item = &'m DAffine3> + Clone) {
        for (p, to_world) in self.positions.iter_mut().zip(moves.clone()) {
            *p = to_world.transform_point3(DVec3::from_array(p.map(f64::from))).as_vec3().to_array();
        }
        for (n, to_world) in self.normals.iter_mut().zip(moves.clone()) {
            let turned = normal_matrix(to_world.matrix3) * DVec3::from_array(n.map(f64::from));
            *n = turned.normalize_or_zero().as_vec3().to_array();
        }
        for (tangent, to_world) in self.tangents.iter_mut().zip(moves.clone()) {
            *tangent = turned_tangent(*tangent, &to_world.matrix3);
        }
        if moves.next().is_some_and(|to_world| to_world.matrix3.determinant() < 0.0) {
            self.indices.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
    }
}

/// A tangent goes along with the surface. In a mirror image, so does the bitangent, where the cross product
/// that it is made by would turn round.
fn turned_tangent([x, y, z, side]: [f32; 4], to_world: &DMat3) -> [f32; 4] {
    let t = (*to_world * DVec3::from_array([x, y, z].map(f64::from))).normalize_or_zero().as_vec3();
    let side = if (side < 0.0) != (to_world.determinant() < 0.0) { -1.0 } else { 1.0 };
    [t.x, t.y, t.z, side]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_make_triangles_that_face_alike() {
        let corners = [0, 1, 2, 3, 4];
        assert_eq!(assemble(Mode::Triangles, &corners), [[0, 1, 2]]);
        assert_eq!(assemble(Mode::TriangleStrip, &corners), [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        assert_eq!(assemble(Mode::TriangleFan, &corners), [[1, 2, 0], [2, 3, 0], [3, 4, 0]]);
        for mode in [Mode::Triangles, Mode::TriangleStrip, Mode::TriangleFan, Mode::Lines] {
            for length in 0..=5 {
                let found = assemble(mode, &corners[..length]).len() as u64;
                assert_eq!(found, count(mode, length as u64), "{mode:?} of {length}");
            }
        }
    }
}
