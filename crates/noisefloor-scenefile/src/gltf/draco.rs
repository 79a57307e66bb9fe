//! Meshes that Draco compressed (KHR_draco_mesh_compression). They are inflated before anything is read: their
//! numbers become buffers of the asset, and accessors point to them, as if the file had them so.

use super::asset::Asset;
use super::mesh::attribute;
use super::parts::{DRACO as NAME, name};
use crate::files::has_memory;
use crate::{LoadError, Place};
use draco_core::{DataType, DecodeLimits, DecoderBuffer, DracoError, ErrorKind, MeshDecoder};
use draco_core::{PointAttribute, PointIndex};
use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::buffer::View;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index, Value, deserialize};
use std::collections::{BTreeMap, HashMap};

/// Bytes that a vertex or a triangle takes while it is inflated, about: tables of neighbours, and the numbers twice.
const BYTES_EACH: u64 = 512;
/// Those of them that stay, about.
const KEPT_EACH: u64 = 32;

/// What a primitive says of its data.
struct Compressed {
    view: Index<View>,
    /// Number of an attribute in the data, by its name.
    attributes: BTreeMap<String, u32>,
    /// Vertices and triangles, as its accessors count them. Old encoders counted before they left some out.
    declared: u64,
    place: Place,
}

/// Inflates the meshes that are there only in this form. All data is decoded once, whoever refers to it.
pub(super) fn inflated(mut asset: Asset<'_>) -> Result<Asset<'_>, LoadError> {
    let mut all: Vec<((usize, usize), Compressed)> = vec![];
    for (m, mesh) in asset.root.meshes.iter().enumerate() {
        for (p, primitive) in mesh.primitives.iter().enumerate() {
            let place = || {
                let called = name("mesh", m, mesh.name.as_deref());
                Place::part(asset.path, format_args!("{called}, primitive {p}"))
            };
            if let Some(compressed) = compressed(&asset, primitive, place)? {
                all.push(((m, p), compressed));
            }
        }
    }
    all.sort_by_key(|(_, compressed)| compressed.view.value());
    for group in all.chunk_by(|(_, a), (_, b)| a.view.value() == b.view.value()) {
        let (_, first) = &group[0];
        // A short file can stand for many triangles
        let left = asset.load.folder.left();
        has_memory(first.declared.min(left / KEPT_EACH), BYTES_EACH, &first.place)?;
        let mesh = decoded(&asset, first, left)?;
        let elements = (mesh.num_points() + mesh.num_faces()) as u64;
        asset.load.folder.inflate(elements.saturating_mul(KEPT_EACH), &first.place)?;
        let past = |corner: &PointIndex| corner.0 as usize >= mesh.num_points();
        if mesh.faces().iter().flatten().any(past) {
            return Err(first.place.bad("a triangle of its Draco data has a corner past the vertices"));
        }
        let faces: Vec<u8> =
            mesh.faces().iter().flatten().flat_map(|corner| corner.0.to_le_bytes()).collect();
        let triangles = asset.add_view(faces);
        let mut views: HashMap<u32, Index<View>> = HashMap::new();
        for ((m, p), compressed) in group {
            let mut attributes = asset.root.meshes[*m].primitives[*p].attributes.clone();
            for (semantic, index) in &mut attributes {
                let Checked::Valid(semantic) = semantic else { continue };
                let Some(id) = compressed.attributes.get(&semantic.to_string()) else { continue };
                let place = &compressed.place;
                let missing = || place.bad(format_args!("its Draco data has no attribute {id}"));
                let values = mesh.attribute_by_unique_id(*id).ok_or_else(missing)?;
                let accessor = asset.get(*index, "accessor", place)?;
                let accessor = described(accessor, values, mesh.num_points(), semantic, place)?;
                let view = match views.get(id) {
                    Some(view) => *view,
                    None => asset.add_view(bytes_of(values, mesh.num_points(), semantic, place)?),
                };
                views.insert(*id, view);
                *index =
                    Index::push(&mut asset.root.accessors, Accessor { buffer_view: Some(view), ..accessor });
            }
            let indices = Index::push(&mut asset.root.accessors, corners(triangles, mesh.num_faces() as u64));
            let primitive = &mut asset.root.meshes[*m].primitives[*p];
            (primitive.attributes, primitive.indices) = (attributes, Some(indices));
            primitive.mode = Checked::Valid(Mode::Triangles);
        }
    }
    // Where a mesh is there as it is as well, the compressed one makes no difference
    for primitive in asset.root.meshes.iter_mut().flat_map(|mesh| &mut mesh.primitives) {
        primitive.extensions.iter_mut().for_each(|extensions| drop(extensions.others.remove(NAME)));
    }
    Ok(asset)
}

/// What a primitive has of Draco, if its positions have no other data.
fn compressed(
    asset: &Asset<'_>,
    primitive: &Primitive,
    place: impl Fn() -> Place,
) -> Result<Option<Compressed>, LoadError> {
    let Some(extension) = primitive.extensions.as_ref().and_then(|e| e.others.get(NAME)) else {
        return Ok(None);
    };
    let place = place();
    let Some(positions) = attribute(primitive, Semantic::Positions) else { return Ok(None) };
    let positions = asset.get(positions, "accessor", &place)?;
    if positions.buffer_view.is_some() || positions.sparse.is_some() {
        return Ok(None);
    }
    let bad = |what: &str| place.bad(format_args!("{NAME}: {what}"));
    let view = extension.get("bufferView").and_then(Value::as_u64).and_then(|view| u32::try_from(view).ok());
    let view = Index::new(view.ok_or_else(|| bad("it needs a bufferView"))?);
    let attributes = extension.get("attributes").cloned().unwrap_or_default();
    let attributes =
        deserialize::from_value(attributes).map_err(|_| bad("it needs a number per attribute"))?;
    let corners = match primitive.indices {
        Some(indices) => asset.get(indices, "accessor", &place)?.count.0,
        None => 0,
    };
    let declared = positions.count.0.saturating_add(corners / 3);
    Ok(Some(Compressed { view, attributes, declared, place }))
}

/// The mesh in a buffer view, which takes at most so many bytes.
fn decoded(asset: &Asset<'_>, compressed: &Compressed, left: u64) -> Result<draco_core::Mesh, LoadError> {
    let Compressed { view, place, .. } = compressed;
    let limits = DecodeLimits::default()
        .with_max_points(left / KEPT_EACH)
        .with_max_faces(left / KEPT_EACH)
        .with_max_decoded_bytes(left);
    let data = asset.view(*view, place)?;
    // The one version of the extension; the decoder would try to make sense of later ones
    if let Some([b'D', b'R', b'A', b'C', b'O', major, minor]) = data.first_chunk()
        && (*major, *minor) != (2, 2)
    {
        return Err(place.unsupported(format_args!("version {major}.{minor} of Draco data")));
    }
    let mut buffer = DecoderBuffer::new(data).with_limits(limits);
    let mut mesh = draco_core::Mesh::new();
    let failed = |cause: DracoError| match cause.kind() {
        ErrorKind::LimitExceeded => {
            place.bad(format_args!("its Draco data is out of proportion to the file: {cause}"))
        }
        ErrorKind::UnsupportedFeature => place.unsupported(format_args!("this kind of Draco data ({cause})")),
        _ => place.bad(format_args!("its Draco data cannot be decoded: {cause}")),
    };
    MeshDecoder::new().decode(&mut buffer, &mut mesh).map_err(failed)?;
    Ok(mesh)
}

/// The accessor of an attribute without its view: of the type that the data has.
fn described(
    accessor: &Accessor,
    values: &PointAttribute,
    points: usize,
    semantic: &Semantic,
    place: &Place,
) -> Result<Accessor, LoadError> {
    let kind = match values.data_type() {
        DataType::Int8 => ComponentType::I8,
        DataType::Uint8 => ComponentType::U8,
        DataType::Int16 => ComponentType::I16,
        DataType::Uint16 => ComponentType::U16,
        DataType::Uint32 => ComponentType::U32,
        DataType::Float32 => ComponentType::F32,
        other => {
            let what = format_args!("{} of the type {other:?} in Draco data", semantic.to_string());
            return Err(place.unsupported(what));
        }
    };
    let expected = match accessor.type_ {
        Checked::Valid(shape) => shape.multiplicity(),
        Checked::Invalid => 0,
    };
    let found = usize::from(values.num_components());
    if expected != found {
        let what =
            format_args!("{} has {found} numbers in its Draco data, not {expected}", semantic.to_string());
        return Err(place.bad(what));
    }
    Ok(Accessor {
        byte_offset: None,
        count: (points as u64).into(),
        component_type: Checked::Valid(GenericComponentType(kind)),
        sparse: None,
        ..accessor.clone()
    })
}

/// The values of an attribute, vertex by vertex.
fn bytes_of(
    values: &PointAttribute,
    points: usize,
    semantic: &Semantic,
    place: &Place,
) -> Result<Vec<u8>, LoadError> {
    let size = usize::from(values.num_components()) * values.data_type().byte_length();
    let (data, stride) = (values.buffer().data(), usize::try_from(values.byte_stride()).unwrap_or(0));
    let mut bytes = Vec::with_capacity(points.saturating_mul(size));
    for point in 0..points {
        let start = (values.mapped_index(PointIndex(point as u32)).0 as usize).checked_mul(stride);
        let value = start.and_then(|start| data.get(start..)?.get(..size)).ok_or_else(|| {
            place.bad(format_args!("{} has no value {point} in Draco data", semantic.to_string()))
        })?;
        bytes.extend(value);
    }
    Ok(bytes)
}

/// The accessor of the corners of so many triangles.
fn corners(view: Index<View>, triangles: u64) -> Accessor {
    Accessor {
        buffer_view: Some(view),
        byte_offset: None,
        count: (3 * triangles).into(),
        component_type: Checked::Valid(GenericComponentType(ComponentType::U32)),
        extensions: None,
        extras: Default::default(),
        type_: Checked::Valid(Type::Scalar),
        min: None,
        max: None,
        name: None,
        normalized: false,
        sparse: None,
    }
}
