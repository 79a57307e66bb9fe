//! PLY, text and binary: positions, normals, texture coordinates, faces, triangle strips and one attribute.
//! Other elements are named; other properties are those of a mesh that a scene does not ask for.
//!
//! Read here and not by a crate: ply-rs-bw 4.0.1 refuses numbers such as `.5`, `1.` and `5.e-1`, the version
//! `1`, and lines that are indented, and makes all the elements that a header asks for.

use super::Triangles;
use super::polygon::Cutter;
use crate::error::{LoadError, Place};
use std::fmt;
use std::path::Path;

/// Most elements of a header, and most properties of all of them.
const MAX_ELEMENTS: u64 = 64;
const MAX_PROPERTIES: u64 = 1024;
/// Most characters of a word of a file that an error repeats.
const MAX_WORD: usize = 40;

/// Reads the PLY file `bytes`, which came from `path`.
///
/// # Errors
/// [`LoadFault::Bad`] if the file is cut short or corrupt, its header asks for more than the file holds, or
/// it has no faces although its header does not say so. [`LoadFault::TooLarge`] as of [`Cutter::cut`].
pub(crate) fn parse(bytes: &[u8], path: &Path) -> Result<Triangles, LoadError> {
    parse_with(bytes, path, None)
}

/// As [`parse`], with the colours of an attribute as Mitsuba names it: `vertex_` or `face_` and the name of its
/// properties without their numbers. One of a single number is grey.
pub(crate) fn parse_with(bytes: &[u8], path: &Path, attribute: Option<&str>) -> Result<Triangles, LoadError> {
    let place = Place::file(path);
    let Header { elements, format, length } = Header::read(bytes, path)?;
    let mut body = Body { bytes, at: length, format, path };

    // Nothing is allocated for elements that the file cannot hold
    let needed = elements.iter().try_fold(0u64, |sum, element| {
        sum.checked_add(element.least_bytes(format).checked_mul(element.count)?)
    });
    let empty = elements.iter().any(|element| element.properties.is_empty() && element.count > 0);
    if empty || needed.is_none_or(|needed| needed > bytes.len() as u64) {
        return Err(place.bad("the header asks for more elements than the file holds"));
    }
    let wanted = attribute.and_then(|attribute| attribute.split_once('_'));
    let has = |(of, name): (&str, &str)| {
        let found = elements.iter().find(|element| element.name == of);
        let at = |i| found.is_some_and(|e| e.properties.iter().any(|p| channel(&p.name, name) == Some(i)));
        (at(0) && at(1) == at(2)).then(|| at(1))
    };
    let coloured = wanted.and_then(has);
    if let Some(attribute) = attribute.filter(|_| coloured.is_none()) {
        return Err(place.bad(format_args!("the mesh has no attribute `{attribute}`")));
    }
    let wanted_of = |element: &Element| wanted.filter(|(of, _)| *of == element.name).map(|(_, name)| name);
    let colour = |values: [f32; 3]| if coloured == Some(true) { values } else { [values[0]; 3] };

    let mut mesh = Triangles::default();
    let mut faces = Faces::default();
    for element in &elements {
        match element.name.as_str() {
            "vertex" => {
                let has =
                    |names: &[&str]| names.iter().all(|n| element.properties.iter().any(|p| p.name == *n));
                if !has(&["x", "y", "z"]) {
                    return Err(place.bad("its vertices have no x, y and z"));
                }
                let normals = has(&["nx", "ny", "nz"]);
                let uvs = UVS.iter().find(|names| has(&names[..]));
                let slots = element.slots(|name| match name {
                    "x" | "y" | "z" => Some(usize::from(name.as_bytes()[0] - b'x')),
                    "nx" | "ny" | "nz" => Some(3 + usize::from(name.as_bytes()[1] - b'x')),
                    _ => match uvs.and_then(|names| names.iter().position(|n| *n == name)) {
                        Some(at) => Some(6 + at),
                        None => wanted_of(element).and_then(|of| channel(name, of)).map(|at| 8 + at),
                    },
                });
                for index in 0..element.count {
                    let mut row = [0.0; 11];
                    for (property, slot) in element.properties.iter().zip(&slots) {
                        body.property(element, index, property, |value| {
                            if let Some(slot) = slot {
                                row[*slot] = value as f32;
                            }
                            Ok(())
                        })?;
                    }
                    let [x, y, z, nx, ny, nz, u, v, r, g, b] = row;
                    mesh.positions.push([x, y, z]);
                    mesh.normals.extend(normals.then_some([nx, ny, nz]));
                    mesh.uvs.extend(uvs.map(|_| [u, v]));
                    mesh.colours.extend(wanted_of(element).map(|_| colour([r, g, b])));
                }
            }
            "face" | "tristrips" => {
                let strips = element.name == "tristrips";
                let slots = element.slots(|name| wanted_of(element).and_then(|of| channel(name, of)));
                for index in 0..element.count {
                    let (mut row, start) = ([0.0; 3], faces.corners.len());
                    for (property, slot) in element.properties.iter().zip(&slots) {
                        let corners = matches!(property.name.as_str(), "vertex_indices" | "vertex_index");
                        let corners = corners && property.count.is_some();
                        body.property(element, index, property, |value| {
                            match slot {
                                Some(slot) => row[*slot] = value as f32,
                                None if corners && strips && value == -1.0 => faces.end_strip(),
                                None if corners => match value as u32 {
                                    corner if f64::from(corner) == value => faces.corners.push(corner),
                                    _ => return Err(format!("{value} is no number of a vertex")),
                                },
                                None => {}
                            }
                            Ok(())
                        })?;
                    }
                    if strips {
                        faces.end_strip();
                    } else if faces.corners.len() - start < 3 {
                        let what = format!("face {index} has no `vertex_indices`, or fewer than 3");
                        return Err(place.bad(what));
                    } else {
                        faces.ends.push(faces.corners.len());
                        faces.colours.extend(wanted_of(element).map(|_| colour(row)));
                    }
                }
            }
            _ => {
                for index in 0..element.count {
                    for property in &element.properties {
                        body.property(element, index, property, |_| Ok(()))?;
                    }
                }
                if element.count > 0 {
                    mesh.unread.push(format!("the element `{}`", element.name));
                }
            }
        }
    }
    faces.add_to(&mut mesh, &place)?;
    let says_so = elements.iter().any(|e| matches!(e.name.as_str(), "face" | "tristrips") && e.count == 0);
    if mesh.indices.is_empty() && !says_so {
        return Err(
            place.bad("the PLY file has no faces: it is a cloud of points, or has faces of another name")
        );
    }
    Ok(mesh)
}

const UVS: [[&str; 2]; 4] = [["u", "v"], ["s", "t"], ["texture_u", "texture_v"], ["texture_s", "texture_t"]];

/// Which channel of the attribute called `name` a property is.
fn channel(property: &str, name: &str) -> Option<usize> {
    let numbered = property.strip_prefix(name).and_then(|rest| rest.strip_prefix('_'));
    let number = numbered.and_then(|number| ["0", "1", "2"].iter().position(|n| *n == number));
    number.or_else(|| ["r", "g", "b"].iter().position(|c| name == "color" && *c == property))
}

/// Polygons, until all vertices are known.
#[derive(Debug, Default)]
struct Faces {
    corners: Vec<u32>,
    /// Where in `corners` each face ends.
    ends: Vec<usize>,
    colours: Vec<[f32; 3]>,
    strip: Vec<u32>,
}

impl Faces {
    /// Makes triangles of the strip that ends here: every second one runs the other way.
    fn end_strip(&mut self) {
        let start = self.ends.last().copied().unwrap_or(0);
        self.strip.clear();
        self.strip.extend(self.corners.drain(start..));
        for (number, corners) in self.strip.windows(3).enumerate() {
            let [a, b, c] = [corners[0], corners[1], corners[2]];
            self.corners.extend(if number % 2 == 0 { [a, b, c] } else { [b, a, c] });
            self.ends.push(self.corners.len());
        }
    }

    fn add_to(&self, mesh: &mut Triangles, place: &Place) -> Result<(), LoadError> {
        let mut cutter = Cutter::default();
        let starts = [0].iter().chain(&self.ends);
        for (number, (start, end)) in starts.zip(&self.ends).enumerate() {
            let face = &self.corners[*start..*end];
            let colour = self.colours.get(number);
            if let Ok(triangle) = <[u32; 3]>::try_from(face) {
                mesh.indices.push(triangle);
                mesh.face_colours.extend(colour);
                continue;
            }
            // What is out of range is said when the mesh is checked
            let corners = face.iter().map(|i| mesh.positions.get(*i as usize).copied().unwrap_or([0.0; 3]));
            for triangle in cutter.cut(&corners.collect::<Vec<_>>(), place)? {
                mesh.indices.push(triangle.map(|i| face[i]));
                mesh.face_colours.extend(colour);
            }
        }
        Ok(())
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Ascii,
    LittleEndian,
    BigEndian,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The number that little-endian bytes stand for.
    fn value(self, bytes: [u8; 8]) -> f64 {
        let [a, b, c, d, ..] = bytes;
        match self {
            Self::I8 => f64::from(a as i8),
            Self::U8 => f64::from(a),
            Self::I16 => f64::from(i16::from_le_bytes([a, b])),
            Self::U16 => f64::from(u16::from_le_bytes([a, b])),
            Self::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Self::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Self::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Self::F64 => f64::from_le_bytes(bytes),
        }
    }
}

#[derive(Debug)]
struct PropertyDef {
    name: String,
    scalar: Scalar,
    /// The type of the count of a list.
    count: Option<Scalar>,
}

#[derive(Debug)]
struct Element {
    name: String,
    count: u64,
    properties: Vec<PropertyDef>,
}

impl Element {
    /// What `slot` says of each property.
    fn slots(&self, slot: impl Fn(&str) -> Option<usize>) -> Vec<Option<usize>> {
        self.properties.iter().map(|property| slot(&property.name)).collect()
    }

    /// The fewest bytes that one takes.
    fn least_bytes(&self, format: Format) -> u64 {
        let sizes = self.properties.iter().map(|property| property.count.unwrap_or(property.scalar).size());
        match format {
            // A digit and what parts it from the next; the last line may lack its end
            Format::Ascii => (2 * self.properties.len() as u64).saturating_sub(1),
            _ => sizes.sum::<usize>() as u64,
        }
    }
}

#[derive(Debug)]
struct Header {
    elements: Vec<Element>,
    format: Format,
    /// In bytes.
    length: usize,
}

impl Header {
    fn read(bytes: &[u8], path: &Path) -> Result<Self, LoadError> {
        let (mut at, mut number) = (0, 0);
        let (mut elements, mut format, mut properties) = (Vec::<Element>::new(), None, 0);
        // As the first line ends: what is binary may begin as the other half of an end
        let mut wide = None;
        loop {
            number += 1;
            let here = Place::line(path, number);
            let rest = &bytes[at..];
            let Some(end) = rest.iter().position(|b| matches!(b, b'\n' | b'\r')) else {
                return Err(here.bad("the PLY file is broken: its header does not end"));
            };
            let line = String::from_utf8_lossy(&rest[..end]);
            let wide = *wide.get_or_insert(rest[end..].starts_with(b"\r\n"));
            at += end + if wide && rest[end..].starts_with(b"\r\n") { 2 } else { 1 };
            let words: Vec<&str> = line.split_ascii_whitespace().collect();
            if number == 1 && words != ["ply"] {
                return Err(here.bad("the PLY file is broken: its first line is not `ply`"));
            }
            let scalar = |name: &str| {
                let unknown = || here.bad(format_args!("`{}` is no type of a PLY file", cut(name)));
                Scalar::named(name).ok_or_else(unknown)
            };
            match (words.as_slice(), elements.last_mut()) {
                ([] | ["comment" | "obj_info", ..], _) => {}
                (["ply"], _) if number == 1 => {}
                (["format", "ascii", "1.0" | "1"], _) => format = Some(Format::Ascii),
                (["format", "binary_little_endian", "1.0" | "1"], _) => format = Some(Format::LittleEndian),
                (["format", "binary_big_endian", "1.0" | "1"], _) => format = Some(Format::BigEndian),
                (["element", name, count], _) => {
                    let count = count
                        .parse()
                        .ok()
                        .ok_or_else(|| here.bad(format_args!("`{}` is no number of elements", cut(count))))?;
                    elements.push(Element { name: (*name).to_owned(), count, properties: vec![] });
                    here.at_most("elements", elements.len() as u64, MAX_ELEMENTS)?;
                }
                (["property", "list", count, kind, name], Some(element)) => {
                    let (count, scalar) = (Some(scalar(count)?), scalar(kind)?);
                    element.properties.push(PropertyDef { name: (*name).to_owned(), scalar, count });
                    properties += 1;
                }
                (["property", kind, name], Some(element)) => {
                    let scalar = scalar(kind)?;
                    element.properties.push(PropertyDef { name: (*name).to_owned(), scalar, count: None });
                    properties += 1;
                }
                (["end_header"], _) => {
                    let format = format
                        .ok_or_else(|| here.bad("the PLY file is broken: its header gives no `format`"))?;
                    return Ok(Self { elements, format, length: at });
                }
                _ => {
                    let line = cut(&line);
                    return Err(here.bad(format_args!("`{line}` is no line of the header of a PLY file")));
                }
            }
            Place::file(path).at_most("properties", properties, MAX_PROPERTIES)?;
        }
    }
}

/// The beginning of a text, for an error.
fn cut(text: &str) -> String {
    text.trim().chars().map(|c| if c.is_control() { ' ' } else { c }).take(MAX_WORD).collect()
}

#[derive(Debug)]
struct Body<'a> {
    bytes: &'a [u8],
    at: usize,
    format: Format,
    path: &'a Path,
}

impl Body<'_> {
    /// Takes a property: each of its numbers goes to `put`.
    fn property(
        &mut self,
        element: &Element,
        index: u64,
        property: &PropertyDef,
        mut put: impl FnMut(f64) -> Result<(), String>,
    ) -> Result<(), LoadError> {
        let count = match property.count {
            None => 1,
            Some(kind) => {
                let count = self.number(kind).map_err(|what| self.bad(element, index, what))?;
                let whole = count as u32;
                if f64::from(whole) != count {
                    return Err(self.bad(element, index, format!("{count} is no length of a list")));
                }
                whole
            }
        };
        for _ in 0..count {
            let put = self.number(property.scalar).and_then(&mut put);
            put.map_err(|what| self.bad(element, index, what))?;
        }
        Ok(())
    }

    fn number(&mut self, kind: Scalar) -> Result<f64, String> {
        let ends = || "it ends too early".to_owned();
        let rest = &self.bytes[self.at..];
        if self.format != Format::Ascii {
            let found = rest.get(..kind.size()).ok_or_else(ends)?;
            let mut bytes = [0; 8];
            bytes[..found.len()].copy_from_slice(found);
            if self.format == Format::BigEndian {
                bytes[..found.len()].reverse();
            }
            self.at += found.len();
            return Ok(kind.value(bytes));
        }
        let start = rest.iter().position(|b| !b.is_ascii_whitespace()).ok_or_else(ends)?;
        let word = &rest[start..];
        let word = &word[..word.iter().position(u8::is_ascii_whitespace).unwrap_or(word.len())];
        self.at += start + word.len();
        let number = std::str::from_utf8(word).ok().and_then(|word| word.parse().ok());
        number.ok_or_else(|| format!("`{}` is no number", cut(&String::from_utf8_lossy(word))))
    }

    fn bad(&self, element: &Element, index: u64, what: impl fmt::Display) -> LoadError {
        let what = format_args!("the PLY file is broken: {} {index}: {what}", element.name);
        if self.format != Format::Ascii {
            return Place::file(self.path).bad(what);
        }
        let line = 1 + self.bytes[..self.at].iter().filter(|b| **b == b'\n').count();
        Place::line(self.path, line).bad(what)
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

    const QUAD: &str = "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n";

    fn parse_text(text: &str) -> Result<Triangles, String> {
        parse(text.as_bytes(), Path::new("a.ply")).map_err(|e| e.to_string())
    }

    /// Numbers as `strtod` reads them, and headers as people write them.
    #[test]
    fn numbers_and_headers_are_read_in_all_their_forms() {
        let body = ".5 -.5 0.\n1. 5.e-1 +2E0\n1\t1 0\n\n0 1 0 4\n0 1 2 3";
        let header =
            format!("{QUAD}element face 1\nproperty list uchar int vertex_index\nend_header\n{body}");
        for text in [
            format!("ply\nformat ascii 1.0\n{header}"),
            format!("ply\nformat ascii 1\n  comment a b c\n\tobj_info x\n{header}"),
            format!("ply\nformat ascii 1.0\n{header}").replace('\n', "\r\n"),
            format!("ply\nformat ascii 1.0\n{header}").replace('\n', "\r"),
        ] {
            let mesh = parse_text(&text).unwrap();
            assert_eq!(mesh.positions[..2], [[0.5, -0.5, 0.0], [1.0, 0.5, 2.0]], "{text}");
            assert_eq!(mesh.indices.len(), 2, "{text}");
        }
        let text = format!("ply\nformat ascii 1.0\n{header}").replace("-.5", "-.5x");
        let error = parse_text(&text).unwrap_err();
        assert!(
            error.ends_with("a.ply: line 10: the PLY file is broken: vertex 0: `-.5x` is no number"),
            "{error}"
        );
        let error = parse_text("ply\nformat ascii 1.0\nelemant face 1\n").unwrap_err();
        assert!(error.contains("a.ply: line 3: `elemant face 1` is no line of the header"), "{error}");
    }

    /// Two strips, parted by −1: every second triangle of each is turned round, so that all face alike.
    #[test]
    fn strips_become_triangles() {
        let body = "0 0 0 1 0 0 0 1 0 1 1 0\n8 0 1 2 3 -1 2 1 3\n";
        let strips = "element tristrips 1\nproperty list int int vertex_indices\nend_header\n";
        let mesh = parse_text(&format!("ply\nformat ascii 1.0\n{QUAD}{strips}{body}")).unwrap();
        assert_eq!(mesh.indices, [[0, 1, 2], [2, 1, 3], [2, 1, 3]]);
    }

    /// A mesh that is lost is an error, unless its header says that it is empty.
    #[test]
    fn meshes_without_faces_are_errors_unless_they_say_so() {
        let points = format!("ply\nformat ascii 1.0\n{QUAD}end_header\n0 0 0 1 0 0 0 1 0 1 1 0\n");
        assert!(parse_text(&points).unwrap_err().contains("the PLY file has no faces: it is a cloud"));
        let faces = "element face 0\nproperty list int int vertex_indices\nend_header";
        assert!(parse_text(&points.replace("end_header", faces)).unwrap().indices.is_empty());
        let strips = "element tristrips 1\nproperty list int int vertex_indices\nend_header";
        let strips = points.replace("end_header", strips) + "2 0 1\n";
        assert!(parse_text(&strips).unwrap_err().contains("has no faces"));
        let edges = "element edge 1\nproperty int vertex1\nelement face 0\nproperty int x\nend_header";
        let mesh = parse_text(&(points.replace("end_header", edges) + "0\n")).unwrap();
        assert_eq!(mesh.unread, ["the element `edge`"]);
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
                "face 0: -1 is no number of a vertex",
            ),
            ("element vertex 1\nproperty float x\nproperty float y\n".to_owned(), "no x, y and z"),
            (
                format!(
                    "element vertex 0\n{vertex}element face 1\nproperty list uchar float vertex_indices\n"
                ),
                "face 0: NaN is no number of a vertex",
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
