//! Mitsuba's own mesh files: deflated meshes one after another, and a table of where each starts.

use super::mesh::Triangles;
use crate::error::{LoadError, Place};
use flate2::read::ZlibDecoder;
use std::io::Read;
use std::path::Path;

/// Both the file and each of its meshes begin with this and a version.
const MAGIC: u16 = 0x041c;
/// Most bytes of a mesh, inflated.
const MAX_BYTES: u64 = 1 << 30;
/// Most bytes that deflate makes of one.
const RATIO: u64 = 1032;
/// Longest name of a mesh, in bytes.
const MAX_NAME: usize = 4096;

const HAS_NORMALS: u32 = 0x1;
const HAS_UVS: u32 = 0x2;
const HAS_COLOURS: u32 = 0x8;
const FACE_NORMALS: u32 = 0x10;
const SINGLE: u32 = 0x1000;
const DOUBLE: u32 = 0x2000;

/// Reads mesh number `index`, from 0, of the file `bytes`, which came from `path`. The second result is whether the mesh asks
/// for flat faces.
///
/// # Errors
/// [`LoadError`] if there is no such mesh, or the file is cut short, corrupt, of another version than 3 and 4, or too large.
pub(super) fn parse(bytes: &[u8], index: usize, path: &Path) -> Result<(Triangles, bool), LoadError> {
    let place = Place::part(path, format_args!("mesh {index}"));
    let bad = |what: &str| place.clone().bad(what);
    let version = version(bytes, &place)?;

    // The table at the end: where each mesh starts, then how many there are
    let entry = if version == 4 { 8 } else { 4 };
    let end = bytes.len().checked_sub(4).ok_or_else(|| bad("the file is cut short"))?;
    let count = number(&bytes[end..]) as usize;
    let table = count.checked_mul(entry).and_then(|size| end.checked_sub(size));
    let table = table.ok_or_else(|| bad("the file is cut short: it has no table of its meshes"))?;
    if index >= count {
        return Err(place.clone().bad(format!("there are only {count} meshes in the file, numbered from 0")));
    }
    let start = |index: usize| number(&bytes[table + index * entry..][..entry]);
    let next = if index + 1 < count { start(index + 1) } else { table as u64 };
    let mesh = usize::try_from(start(index)).ok().zip(usize::try_from(next).ok());
    let mesh = mesh.filter(|(_, next)| *next <= table).and_then(|(start, next)| bytes.get(start..next));
    let mesh = mesh.ok_or_else(|| bad("the table of meshes is corrupt"))?;

    let version = self::version(mesh, &place)?;
    let stream = &mesh[4..];
    let limit = (stream.len() as u64).saturating_mul(RATIO).min(MAX_BYTES);
    Inflated { stream: ZlibDecoder::new(stream), left: limit, place: &place }.mesh(version)
}

/// Checks the first four bytes of a file or mesh.
fn version(bytes: &[u8], place: &Place) -> Result<u16, LoadError> {
    match bytes {
        [a, b, c, d, ..] if u16::from_le_bytes([*a, *b]) == MAGIC => match u16::from_le_bytes([*c, *d]) {
            version @ (3 | 4) => Ok(version),
            other => Err(place.clone().unsupported(format!("version {other} of serialized meshes"))),
        },
        _ => Err(place.clone().bad("this is not a serialized mesh of Mitsuba")),
    }
}

/// A little-endian number of at most 8 bytes.
fn number(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |sum, byte| sum << 8 | u64::from(*byte))
}

/// An inflated mesh, read piece by piece.
struct Inflated<'a> {
    stream: ZlibDecoder<&'a [u8]>,
    /// Bytes that may still come.
    left: u64,
    place: &'a Place,
}

impl Inflated<'_> {
    fn mesh(mut self, version: u16) -> Result<(Triangles, bool), LoadError> {
        let flags = number(&self.bytes(4)?) as u32;
        let width = match flags & (SINGLE | DOUBLE) {
            SINGLE => 4,
            DOUBLE => 8,
            _ => return Err(self.place.clone().bad("its numbers are neither single nor double")),
        };
        if version == 4 {
            let mut length = 0;
            while self.bytes(1)? != [0] {
                length += 1;
                self.place.clone().at_most("bytes in a name", length, MAX_NAME as u64)?;
            }
        }
        let (vertices, faces) = (number(&self.bytes(8)?), number(&self.bytes(8)?));

        let mesh = Triangles {
            positions: self.rows(vertices, width)?,
            normals: self.rows(if flags & HAS_NORMALS != 0 { vertices } else { 0 }, width)?,
            uvs: self.rows(if flags & HAS_UVS != 0 { vertices } else { 0 }, width)?,
            indices: {
                if flags & HAS_COLOURS != 0 {
                    self.rows::<3>(vertices, width)?;
                }
                let corner = |b: &[u8]| number(b) as u32;
                self.table(faces, 12)?
                    .chunks_exact(12)
                    .map(|row| [corner(&row[..4]), corner(&row[4..8]), corner(&row[8..])])
                    .collect()
            },
        };
        Ok((mesh, flags & FACE_NORMALS != 0))
    }

    /// `count` rows of `N` numbers of `width` bytes.
    fn rows<const N: usize>(&mut self, count: u64, width: usize) -> Result<Vec<[f32; N]>, LoadError> {
        let single = |b: &[u8]| f32::from_bits(number(b) as u32);
        let double = |b: &[u8]| f64::from_bits(number(b)) as f32;
        let row = |row: &[u8]| {
            let mut numbers = [0.0; N];
            for (number, bytes) in numbers.iter_mut().zip(row.chunks_exact(width)) {
                *number = if width == 4 { single(bytes) } else { double(bytes) };
            }
            numbers
        };
        Ok(self.table(count, N * width)?.chunks_exact(N * width).map(row).collect())
    }

    /// `count` rows of `width` bytes.
    fn table(&mut self, count: u64, width: usize) -> Result<Vec<u8>, LoadError> {
        self.bytes(count.saturating_mul(width as u64))
    }

    fn bytes(&mut self, count: u64) -> Result<Vec<u8>, LoadError> {
        let bad = |what: String| self.place.clone().bad(what);
        self.left = self.left.checked_sub(count).ok_or_else(|| {
            bad(format!("the mesh says it has {count} bytes more, which the file cannot hold or are too many"))
        })?;
        // Grows with what comes, whatever the counts say
        let mut bytes = Vec::new();
        self.stream
            .by_ref()
            .take(count)
            .read_to_end(&mut bytes)
            .map_err(|e| bad(format!("the mesh cannot be inflated: {e}")))?;
        if (bytes.len() as u64) < count {
            return Err(bad(format!("the mesh ends {} bytes early", count - bytes.len() as u64)));
        }
        Ok(bytes)
    }
}
