//! Meshes that move, at rest: morph targets by their default weights, skins by where their joints are (glTF
//! 2.0, §3.7.2.2 and §3.7.3).

use super::accessor::floats;
use super::asset::Asset;
use super::mesh::{Triangles, attribute};
use super::nodes::affine;
use super::parts::name;
use crate::{LoadError, Place};
use glam::{DAffine3, DMat3, DVec3};
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::{Accessor, Index, Skin};
use std::collections::HashMap;

/// Where the joints of a skin take its vertices.
pub(super) type Joints = Vec<DAffine3>;

/// The joints of a skin, that the node at `place` has.
pub(super) fn joints(
    asset: &Asset<'_>,
    index: Index<Skin>,
    nodes: &HashMap<usize, DAffine3>,
    place: &Place,
) -> Result<Joints, LoadError> {
    let skin = asset.get(index, "skin", place)?;
    let here = Place::part(asset.path, name("skin", index.value(), skin.name.as_deref()));
    let inverse = match skin.inverse_bind_matrices {
        Some(accessor) => {
            // Any number of skins may name the same matrices
            let count = asset.get(accessor, "accessor", &here)?.count.0;
            asset.load.folder.inflate(count.saturating_mul(64), &here)?;
            floats::<16>(asset, accessor, &here)?
        }
        None => vec![],
    };
    if skin.inverse_bind_matrices.is_some() && inverse.len() < skin.joints.len() {
        let what = format_args!("it has {} joints, but {} matrices", skin.joints.len(), inverse.len());
        return Err(here.bad(what));
    }
    let joint = |(number, joint): (usize, &Index<_>)| {
        asset.get(*joint, "node", &here)?;
        let outside = || here.bad(format_args!("its joint {} is not in the scene", joint.value()));
        let to_world = nodes.get(&joint.value()).copied().ok_or_else(outside)?;
        Ok(to_world * inverse.get(number).map_or(DAffine3::IDENTITY, |m| affine(*m)))
    };
    skin.joints.iter().enumerate().map(joint).collect()
}

/// Moves the vertices of a primitive by their joints. The result is whether they have any.
pub(super) fn skin(
    asset: &Asset<'_>,
    primitive: &Primitive,
    joints: &Joints,
    triangles: &mut Triangles,
    place: &Place,
) -> Result<bool, LoadError> {
    let [Some(of), Some(weights)] =
        [Semantic::Joints(0), Semantic::Weights(0)].map(|s| attribute(primitive, s))
    else {
        return Ok(false);
    };
    let count = triangles.positions.len();
    let [of, weights] = [rows::<4>(asset, of, count, place)?, rows::<4>(asset, weights, count, place)?];
    let mut moves = Vec::with_capacity(count);
    for (of, weights) in of.iter().zip(&weights) {
        let (mut matrix, mut shift, mut sum) = (DMat3::ZERO, DVec3::ZERO, 0.0);
        for (joint, weight) in of.iter().zip(weights).filter(|(_, weight)| **weight > 0.0) {
            let weight = f64::from(*weight);
            let joint = joints.get(*joint as usize).ok_or_else(|| {
                place.bad(format_args!("joint {joint} is past the {} of its skin", joints.len()))
            })?;
            matrix += joint.matrix3 * weight;
            shift += joint.translation * weight;
            sum += weight;
        }
        let by = if sum > 0.0 { 1.0 / sum } else { 0.0 };
        moves.push(DAffine3::from_mat3_translation(matrix * by, shift * by));
    }
    triangles.place(moves.iter());
    Ok(true)
}

/// Adds morph targets by their weights.
pub(super) fn morph(
    asset: &Asset<'_>,
    primitive: &Primitive,
    weights: &[f32],
    triangles: &mut Triangles,
    place: &Place,
) -> Result<(), LoadError> {
    let targets = primitive.targets.iter().flatten().zip(weights).filter(|(_, weight)| **weight != 0.0);
    for (target, weight) in targets {
        for (by, to) in
            [(target.positions, &mut triangles.positions), (target.normals, &mut triangles.normals)]
        {
            let Some(by) = by.filter(|_| !to.is_empty()) else { continue };
            let deltas = rows::<3>(asset, by, to.len(), place)?;
            for (to, by) in to.iter_mut().zip(deltas) {
                *to = std::array::from_fn(|i| to[i] + weight * by[i]);
            }
        }
        if let Some(by) = target.tangents.filter(|_| !triangles.tangents.is_empty()) {
            let deltas = rows::<3>(asset, by, triangles.tangents.len(), place)?;
            for ([x, y, z, _], by) in triangles.tangents.iter_mut().zip(deltas) {
                *x += weight * by[0];
                *y += weight * by[1];
                *z += weight * by[2];
            }
        }
    }
    Ok(())
}

/// The elements of an accessor, one a vertex.
fn rows<const N: usize>(
    asset: &Asset<'_>,
    index: Index<Accessor>,
    count: usize,
    place: &Place,
) -> Result<Vec<[f32; N]>, LoadError> {
    let found = asset.get(index, "accessor", place)?.count.0;
    if found != count as u64 {
        let what = format_args!("it has {count} positions, but {found} in accessor {}", index.value());
        return Err(place.bad(what));
    }
    floats(asset, index, place)
}
