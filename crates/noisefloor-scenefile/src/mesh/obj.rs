//! Wavefront OBJ: positions, normals, texture coordinates and faces; what else is there is named.
//!
//! Read here and not by a crate: tobj 4.0.5 panics where a texture coordinate or normal is out of range (in
//! builds that check for overflow; in others it takes the wrong one), gives vertices the normals of others
//! where some corners have none, and does not say on which line an error is. To check a file before tobj sees
//! it takes as much code as to read it.

use super::Triangles;
use super::polygon::Cutter;
use crate::error::{LoadError, Place};
use crate::files;
use std::collections::HashMap;
use std::path::Path;

/// Most kinds of statements that are named as not read.
const MAX_UNREAD: usize = 8;

/// Position, texture coordinates and normal of a corner, as indices.
type Corner = (u32, Option<u32>, Option<u32>);

/// Statements that change nothing: groups and names, and materials, in whose place a scene gives the shape
/// one.
const IRRELEVANT: [&str; 7] = ["g", "o", "s", "mg", "usemtl", "mtllib", "call"];

/// Reads the OBJ file `bytes`, which came from `path`. Corners that agree in all their indices become one
/// vertex. Where some corners have no normal or texture coordinates, these are 0.
///
/// # Errors
/// [`LoadFault::Bad`] if a number or an index is, or if there are no faces.
/// [`LoadFault::TooLarge`] as of [`Cutter::cut`].
pub(crate) fn parse(bytes: &[u8], path: &Path) -> Result<Triangles, LoadError> {
    let text = files::text(bytes);
    let mut reader = Reader {
        path,
        line: 0,
        positions: vec![],
        uvs: vec![],
        normals: vec![],
        vertices: HashMap::new(),
        polygon: vec![],
        cutter: Cutter::default(),
        mesh: Triangles::default(),
        has_uvs: false,
        has_normals: false,
    };
    // A backslash at its end continues a line; what is said of it names the last of its lines
    let mut begun = String::new();
    for (index, line) in files::lines(&text).enumerate() {
        reader.line = index + 1;
        match line.trim_end().strip_suffix('\\') {
            Some(part) => begun = begun + part + " ",
            None if begun.is_empty() => reader.line(line)?,
            None => reader.line(&(std::mem::take(&mut begun) + line))?,
        }
    }
    reader.line(&begun)?;

    let mut mesh = reader.mesh;
    if mesh.indices.is_empty() {
        let what =
            "the OBJ file has no faces: it is another kind of file, or has only curves, lines or points";
        return Err(Place::file(path).bad(what));
    }
    if !reader.has_normals {
        mesh.normals.clear();
    }
    if !reader.has_uvs {
        mesh.uvs.clear();
    }
    Ok(mesh)
}

/// What has been read so far.
struct Reader<'a> {
    path: &'a Path,
    /// From 1.
    line: usize,
    positions: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    normals: Vec<[f32; 3]>,
    /// Where in the mesh a corner is.
    vertices: HashMap<Corner, u32>,
    /// Vertices of the face that is being read.
    polygon: Vec<u32>,
    cutter: Cutter,
    mesh: Triangles,
    has_uvs: bool,
    has_normals: bool,
}

impl Reader<'_> {
    fn bad(&self, what: String) -> LoadError {
        Place::line(self.path, self.line).bad(what)
    }

    fn line(&mut self, line: &str) -> Result<(), LoadError> {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("v") => {
                let position = self.numbers(&mut words)?;
                self.positions.push(position);
            }
            Some("vn") => {
                let normal = self.numbers(&mut words)?;
                self.normals.push(normal);
            }
            Some("vt") => {
                // One number is allowed: the second is then 0
                let u = self.numbers::<1>(&mut words)?[0];
                let v = if words.clone().next().is_some() { self.numbers::<1>(&mut words)?[0] } else { 0.0 };
                self.uvs.push([u, v]);
            }
            Some("f") => self.face(words)?,
            Some(word) if !word.starts_with('#') && !IRRELEVANT.contains(&word) => {
                let word: String = word.chars().take(20).collect();
                let same = format!("`{word}`");
                let unread = &mut self.mesh.unread;
                if unread.len() < MAX_UNREAD && !unread.iter().any(|said| said.ends_with(&same)) {
                    unread.push(format!("line {}: {same}", self.line));
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn numbers<'w, const N: usize>(
        &self,
        words: &mut impl Iterator<Item = &'w str>,
    ) -> Result<[f32; N], LoadError> {
        let mut numbers = [0.0; N];
        for number in &mut numbers {
            let word = words.next().ok_or_else(|| self.bad(format!("fewer than {N} numbers")))?;
            *number = word
                .parse()
                .ok()
                .filter(|n: &f32| n.is_finite())
                .ok_or_else(|| self.bad(format!("`{word}` is not a finite number")))?;
        }
        Ok(numbers)
    }

    fn face<'w>(&mut self, words: impl Iterator<Item = &'w str>) -> Result<(), LoadError> {
        self.polygon.clear();
        for word in words {
            if word.starts_with('#') {
                break;
            }
            let corner = self.corner(word)?;
            let vertex = self.vertex(corner);
            self.polygon.push(vertex);
        }
        if self.polygon.len() < 3 {
            return Err(self.bad(format!("a face of {} corners; at least 3 are needed", self.polygon.len())));
        }
        if let Ok(triangle) = <[u32; 3]>::try_from(self.polygon.as_slice()) {
            self.mesh.indices.push(triangle);
            return Ok(());
        }
        let corners: Vec<_> = self.polygon.iter().map(|i| self.mesh.positions[*i as usize]).collect();
        let place = Place::line(self.path, self.line);
        let triangles = self.cutter.cut(&corners, &place)?;
        self.mesh.indices.extend(triangles.iter().map(|triangle| triangle.map(|i| self.polygon[i])));
        Ok(())
    }

    /// `position/texture/normal`, of which the last two may be missing.
    fn corner(&self, word: &str) -> Result<Corner, LoadError> {
        let mut parts = word.split('/');
        let mut index = |what: &str, count: usize| {
            let Some(part) = parts.next().filter(|part| !part.is_empty()) else { return Ok(None) };
            // From 1, or back from the last so far
            let found = part.parse::<i64>().ok().and_then(|i| match i {
                1.. => usize::try_from(i - 1).ok(),
                _ => i.checked_neg().and_then(|back| count.checked_sub(usize::try_from(back).ok()?)),
            });
            match found.filter(|found| *found < count) {
                Some(found) => Ok(Some(found as u32)),
                None => {
                    Err(self.bad(format!("`{word}`: there is no {what} {part}; {count} are given so far")))
                }
            }
        };
        let position = index("position", self.positions.len())?;
        let uv = index("texture coordinate", self.uvs.len())?;
        let normal = index("normal", self.normals.len())?;
        match (position, parts.next()) {
            (Some(position), None) => Ok((position, uv, normal)),
            _ => Err(self.bad(format!("`{word}` is not a corner; expected position/texture/normal"))),
        }
    }

    fn vertex(&mut self, corner: Corner) -> u32 {
        let (position, uv, normal) = corner;
        *self.vertices.entry(corner).or_insert_with(|| {
            self.has_uvs |= uv.is_some();
            self.has_normals |= normal.is_some();
            self.mesh.positions.push(self.positions[position as usize]);
            self.mesh.uvs.push(uv.map_or([0.0; 2], |i| self.uvs[i as usize]));
            self.mesh.normals.push(normal.map_or([0.0; 3], |i| self.normals[i as usize]));
            self.mesh.positions.len() as u32 - 1
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse_text(text: &str) -> Result<Triangles, String> {
        parse(text.as_bytes(), Path::new("a.obj")).map_err(|e| e.to_string())
    }

    const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn polygons_become_fans_of_shared_vertices() {
        let mesh = parse_text(&format!("# a square\no x\n{CORNERS}usemtl m\nf 1 2 3 4 # all\nf -4 -2 -1\n"))
            .unwrap();
        assert_eq!(mesh.indices, [[0, 1, 2], [0, 2, 3], [0, 2, 3]]);
        assert_eq!(mesh.positions, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
        assert!(mesh.normals.is_empty() && mesh.uvs.is_empty());
    }

    #[test]
    fn corners_that_differ_are_vertices_of_their_own() {
        let text = format!("{CORNERS}vt 0.25 0.5\nvt 0.75\nvn 0 0 2\nf 1/1/1 2/2/1 3//1\nf 1/1/1 3 4/2\n");
        let mesh = parse_text(&text).unwrap();
        assert_eq!(mesh.indices, [[0, 1, 2], [0, 3, 4]]);
        assert_eq!(mesh.uvs, [[0.25, 0.5], [0.75, 0.0], [0.0, 0.0], [0.0, 0.0], [0.75, 0.0]]);
        let (up, none) = ([0.0, 0.0, 2.0], [0.0; 3]);
        assert_eq!(mesh.normals, [up, up, up, none, none]);
    }

    #[test]
    fn lines_may_be_continued() {
        for text in ["f 1 2 \\\n3\nf 1 2 4\n", "f 1 2 3 \nf \\\n 1 \\\n 2 4", "f 1 2 3\nf 1 2 4 \\"] {
            let mesh = parse_text(&format!("{CORNERS}{text}")).unwrap();
            assert_eq!(mesh.indices, [[0, 1, 2], [0, 1, 3]], "{text}");
        }
    }

    #[test]
    fn lines_end_in_any_way_and_text_may_be_in_any_encoding() {
        let text = format!("# x\n{CORNERS}f 1 2 3\n");
        let wide: Vec<u8> =
            "\u{feff}".encode_utf16().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect();
        let latin = [b"g caf\xe9\n".as_slice(), text.as_bytes()].concat();
        for bytes in
            [text.replace('\n', "\r").into_bytes(), text.replace('\n', "\r\n").into_bytes(), wide, latin]
        {
            assert_eq!(parse(&bytes, Path::new("a.obj")).unwrap().indices, [[0, 1, 2]]);
        }
    }

    /// A mesh that is lost is an error, and what is not read is said once, with its line.
    #[test]
    fn nothing_is_lost_in_silence() {
        let error = parse_text("<svg/>\n").unwrap_err();
        assert!(error.contains("a.obj: the OBJ file has no faces"), "{error}");
        let mesh = parse_text(&format!("{CORNERS}mtllib a.mtl\nl 1 2\nl 2 3\nf 1 2 3\nsurf 0 1\n")).unwrap();
        assert_eq!(mesh.unread, ["line 6: `l`", "line 9: `surf`"]);
    }

    #[test]
    fn errors_say_the_line() {
        for (line, what) in [
            ("v 1 2", "fewer than 3 numbers"),
            ("v 1 2 x", "`x` is not a finite number"),
            ("vn 1 nan 2", "`nan` is not a finite number"),
            ("vt 1e99", "`1e99` is not a finite number"),
            ("f 1 2", "a face of 2 corners; at least 3 are needed"),
            ("f 1 2 5", "`5`: there is no position 5; 4 are given so far"),
            ("f 1 2 0", "`0`: there is no position 0; 4 are given so far"),
            ("f 1 2 -5", "`-5`: there is no position -5; 4 are given so far"),
            (
                "f 1 2 -9223372036854775808",
                "`-9223372036854775808`: there is no position -9223372036854775808; 4 are given so far",
            ),
            ("f 1/-9 2 3", "`1/-9`: there is no texture coordinate -9; 0 are given so far"),
            ("f 1//2 2 3", "`1//2`: there is no normal 2; 0 are given so far"),
            ("f 1 2 /1", "`/1`: there is no texture coordinate 1; 0 are given so far"),
            ("f 1 2 //", "`//` is not a corner; expected position/texture/normal"),
            ("f 1 2 3///", "`3///` is not a corner; expected position/texture/normal"),
        ] {
            let error = parse_text(&format!("{CORNERS}{line}\n")).unwrap_err();
            assert_eq!(error, format!("a.obj: line 5: {what}"));
        }
    }
}
