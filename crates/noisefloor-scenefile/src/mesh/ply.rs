//! PLY, text and binary: positions, normals, texture coordinates, faces and one attribute; all else is left out.

use super::Triangles;
use crate::error::{LoadError, Place};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, KeyMap, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType,
};
use std::path::Path;

/// Most characters of a message of the parser that are passed on.
const MAX_MESSAGE: usize = 200;

/// Names of the properties that hold the attribute that is asked for: no file has a space in a name.
const ATTRIBUTE: [&str; 3] = ["attribute 0", "attribute 1", "attribute 2"];

/// Reads the PLY file `bytes`, which came from `path`. Polygons become fans.
///
/// # Errors
/// [`LoadError::Bad`] if the file is cut short or corrupt, or its header asks for more than the file holds.
pub(crate) fn parse(bytes: &[u8], path: &Path) -> Result<Triangles, LoadError> {
    parse_with(bytes, path, None)
}

/// As [`parse`], with the colours of an attribute as Mitsuba names it: `vertex_` or `face_` and the name of its
/// properties without their numbers. One of a single number is grey.
///
/// # Errors
/// As [`parse`]; and if the mesh has no such attribute.
pub(crate) fn parse_with(bytes: &[u8], path: &Path, attribute: Option<&str>) -> Result<Triangles, LoadError> {
    let place = Place::file(path);
    // Its messages repeat whole lines, however long
    let bad = |e: ply_rs_bw::parser::ParseError| {
        let message: String =
            e.to_string().chars().map(|c| if c.is_control() { ' ' } else { c }).take(MAX_MESSAGE).collect();
        place.clone().bad(format!("the PLY file is broken: {message}"))
    };

    let mut reader = Reader::new(bytes);
    let mut header = Parser::<Skipped>::new().read_header(&mut reader).map_err(bad)?;
    // The parser makes as many elements as the header says, even of elements that take no bytes
    let needed = header.elements.iter().try_fold(0u64, |sum, (_, element)| {
        sum.checked_add(least_bytes(element, header.encoding).checked_mul(element.count as u64)?)
    });
    let empty = header.elements.iter().any(|(_, e)| e.properties.is_empty() && e.count > 0);
    if empty || needed.is_none_or(|needed| needed > bytes.len() as u64) {
        return Err(place.clone().bad("the header asks for more elements than the file holds"));
    }

    if let Some(attribute) = attribute {
        let found = attribute.split_once('_').is_some_and(|(element, name)| {
            header.elements.get_mut(element).is_some_and(|element| mark(element, name))
        });
        if !found {
            return Err(place.clone().bad(format!("the mesh has no attribute `{attribute}`")));
        }
    }

    let mut mesh = Triangles::default();
    for (name, element) in &header.elements {
        match name.as_str() {
            "vertex" => {
                let vertices =
                    Parser::<Vertex>::new().read_payload_for_element(&mut reader, element, &header);
                add_vertices(&mut mesh, element, &vertices.map_err(bad)?, &place)?;
            }
            "face" => {
                let faces = Parser::<Face>::new().read_payload_for_element(&mut reader, element, &header);
                add_faces(&mut mesh, element, &faces.map_err(bad)?, &place)?;
            }
            _ => {
                let skipped =
                    Parser::<Skipped>::new().read_payload_for_element(&mut reader, element, &header);
                skipped.map_err(bad)?;
            }
        }
    }
    Ok(mesh)
}

/// Renames the properties of the attribute called `name` to [`ATTRIBUTE`]. Returns whether it has one number or
/// three.
fn mark(element: &mut ElementDef, name: &str) -> bool {
    let colour = |property: &str| ["r", "g", "b"].iter().position(|c| name == "color" && *c == property);
    let number = |property: &str| {
        let number = property.strip_prefix(name)?.strip_prefix('_')?;
        ["0", "1", "2"].iter().position(|n| *n == number)
    };
    let mut renamed = KeyMap::new();
    for (_, mut property) in std::mem::take(&mut element.properties) {
        if let Some(at) = number(&property.name).or_else(|| colour(&property.name)) {
            ATTRIBUTE[at].clone_into(&mut property.name);
        }
        renamed.insert(property.name.clone(), property);
    }
    element.properties = renamed;
    let has = |at: usize| element.properties.contains_key(ATTRIBUTE[at]);
    has(0) && has(1) == has(2)
}

/// The attribute of something, if the element has it.
fn colour(element: &ElementDef, values: [f32; 3]) -> Option<[f32; 3]> {
    let has = |at: usize| element.properties.contains_key(ATTRIBUTE[at]);
    has(0).then(|| if has(1) { values } else { [values[0]; 3] })
}

fn add_vertices(
    mesh: &mut Triangles,
    element: &ElementDef,
    vertices: &[Vertex],
    place: &Place,
) -> Result<(), LoadError> {
    let has = |names: &[&str]| names.iter().all(|name| element.properties.contains_key(*name));
    if !has(&["x", "y", "z"]) {
        return Err(place.clone().bad("its vertices have no x, y and z"));
    }
    mesh.positions.extend(vertices.iter().map(|v| v.position));
    if has(&["nx", "ny", "nz"]) {
        mesh.normals.extend(vertices.iter().map(|v| v.normal));
    }
    if has(&["u", "v"]) || has(&["s", "t"]) {
        mesh.uvs.extend(vertices.iter().map(|v| v.uv));
    }
    mesh.colours.extend(vertices.iter().filter_map(|v| colour(element, v.attribute)));
    Ok(())
}

fn add_faces(
    mesh: &mut Triangles,
    element: &ElementDef,
    faces: &[Face],
    place: &Place,
) -> Result<(), LoadError> {
    for (index, face) in faces.iter().enumerate() {
        let Some(corners) = face.corners.as_deref().filter(|corners| corners.len() >= 3) else {
            let what = format!("face {index} has no `vertex_indices`, or fewer than 3");
            return Err(place.clone().bad(what));
        };
        for pair in corners[1..].windows(2) {
            mesh.indices.push([corners[0], pair[0], pair[1]]);
            mesh.face_colours.extend(colour(element, face.attribute));
        }
    }
    Ok(())
}

/// The fewest bytes that an element takes.
fn least_bytes(element: &ElementDef, encoding: Encoding) -> u64 {
    let size = |scalar: &ScalarType| match (encoding, scalar) {
        // A digit and what parts it from the next
        (Encoding::Ascii, _) => 2,
        (_, ScalarType::Char | ScalarType::UChar) => 1,
        (_, ScalarType::Short | ScalarType::UShort) => 2,
        (_, ScalarType::Int | ScalarType::UInt | ScalarType::Float) => 4,
        (_, ScalarType::Double) => 8,
    };
    let bytes: u64 = element
        .properties
        .iter()
        .map(|(_, property)| match &property.data_type {
            PropertyType::Scalar(scalar) => size(scalar),
            PropertyType::List(count, _) => size(count),
        })
        .sum();
    // The last line of a text may lack its end
    if encoding == Encoding::Ascii { bytes.saturating_sub(1) } else { bytes }
}

#[derive(Default)]
struct Vertex {
    position: [f32; 3],
    normal: [f32; 3],
    uv: [f32; 2],
    attribute: [f32; 3],
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        let slot = match name {
            "x" => &mut self.position[0],
            "y" => &mut self.position[1],
            "z" => &mut self.position[2],
            "nx" => &mut self.normal[0],
            "ny" => &mut self.normal[1],
            "nz" => &mut self.normal[2],
            "u" | "s" => &mut self.uv[0],
            "v" | "t" => &mut self.uv[1],
            _ => match ATTRIBUTE.iter().position(|attribute| *attribute == name) {
                Some(at) => &mut self.attribute[at],
                None => return PropertyAccessResult::Ignored,
            },
        };
        set(slot, &value)
    }
}

fn set(slot: &mut f32, value: &Property) -> PropertyAccessResult {
    match value.to_f32_lossy() {
        Some(value) => {
            *slot = value;
            PropertyAccessResult::Set
        }
        None => PropertyAccessResult::UnsupportedType,
    }
}

#[derive(Default)]
struct Face {
    corners: Option<Vec<u32>>,
    attribute: [f32; 3],
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, value: Property) -> PropertyAccessResult {
        if let Some(at) = ATTRIBUTE.iter().position(|attribute| *attribute == name) {
            return set(&mut self.attribute[at], &value);
        }
        if name != "vertex_indices" && name != "vertex_index" {
            return PropertyAccessResult::Ignored;
        }
        match value.to_u32_list() {
            Some(corners) => {
                self.corners = Some(corners);
                PropertyAccessResult::Set
            }
            None => PropertyAccessResult::UnsupportedType,
        }
    }
}

/// An element that is passed over.
struct Skipped;

impl PropertyAccess for Skipped {
    fn new() -> Self {
        Self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "element vertex 4\nproperty float x\nproperty double y\nproperty float z\nproperty float nx\n\
        property float ny\nproperty float nz\nproperty float s\nproperty float t\nproperty uchar red\n\
        element extra 1\nproperty list uchar short all\n\
        element face 1\nproperty list uchar int vertex_indices\nend_header\n";

    fn text() -> String {
        format!(
            "ply\nformat ascii 1.0\ncomment by hand\n{HEADER}\
             0 0 0 0 0 1 0 0 7\n1 0 0 0 0 1 1 0 7\n1 1 0 0 0 1 1 0.5 7\n0 1 0 0 0 1 0 0.5 7\n2 5 6\n4 0 1 2 3\n"
        )
    }

    fn binary(little: bool) -> Vec<u8> {
        let order = if little { "little" } else { "big" };
        let mut bytes = format!("ply\nformat binary_{order}_endian 1.0\n{HEADER}").into_bytes();
        let mut put = |big: &[u8]| {
            if little { bytes.extend(big.iter().rev()) } else { bytes.extend(big) }
        };
        for [x, y] in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0f32]] {
            put(&x.to_be_bytes());
            put(&f64::from(y).to_be_bytes());
            for v in [0.0, 0.0, 0.0, 1.0, x, 0.5 * y] {
                put(&f32::to_be_bytes(v));
            }
            put(&[7]);
        }
        put(&[2]);
        put(&5i16.to_be_bytes());
        put(&6i16.to_be_bytes());
        put(&[4]);
        for corner in 0..4i32 {
            put(&corner.to_be_bytes());
        }
        bytes
    }

    #[test]
    fn all_encodings_say_the_same() {
        for bytes in [text().into_bytes(), binary(true), binary(false)] {
            let mesh = parse(&bytes, Path::new("a.ply")).unwrap();
            assert_eq!(mesh.positions, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
            assert_eq!(mesh.normals, [[0.0, 0.0, 1.0]; 4]);
            assert_eq!(mesh.uvs, [[0.0, 0.0], [1.0, 0.0], [1.0, 0.5], [0.0, 0.5]]);
            assert_eq!(mesh.indices, [[0, 1, 2], [0, 2, 3]]);
        }
    }

    #[test]
    fn every_cut_is_an_error() {
        for bytes in [text().into_bytes(), binary(true), binary(false)] {
            // But for the end of the last line of a text
            let needed = if bytes.starts_with(b"ply\nformat ascii") { bytes.len() - 1 } else { bytes.len() };
            for length in 0..needed {
                assert!(parse(&bytes[..length], Path::new("a.ply")).is_err(), "{length} bytes");
            }
        }
    }

    #[test]
    fn absurd_headers_are_errors() {
        let vertex = "property float x\nproperty float y\nproperty float z\n";
        for (header, what) in [
            ("element vertex 4000000000\nproperty float x\n".to_owned(), "more elements than the file holds"),
            (
                "element vertex 18446744073709551615\nproperty float x\n".to_owned(),
                "more elements than the file holds",
            ),
            ("element nothing 18446744073709551615\n".to_owned(), "more elements than the file holds"),
            (
                format!("element vertex 0\n{vertex}element face 1\nproperty list uint int vertex_indices\n"),
                "file is broken",
            ),
            ("element vertex 1\nproperty float x\nproperty float y\n".to_owned(), "no x, y and z"),
            (
                format!(
                    "element vertex 0\n{vertex}element face 1\nproperty list uchar float vertex_indices\n"
                ),
                "file is broken",
            ),
            (
                format!("element vertex 0\n{vertex}element face 1\nproperty int other\n"),
                "no `vertex_indices`",
            ),
        ] {
            let file = format!("ply\nformat binary_little_endian 1.0\n{header}end_header\n");
            let bytes = [file.as_bytes(), &[0xff; 8]].concat();
            let error = parse(&bytes, Path::new("a.ply")).unwrap_err().to_string();
            assert!(error.starts_with("a.ply: ") && error.contains(what), "{header}: {error}");
        }
    }
}
