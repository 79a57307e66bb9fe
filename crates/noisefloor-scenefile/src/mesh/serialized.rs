//! Mitsuba's own mesh files: deflated meshes one after another, and a table of where each starts.

use super::Triangles;
use crate::error::{LoadError, Place};
use crate::files::Folder;
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

/// Reads mesh number `index`, from 0, of the file `bytes`, which came from `path`. The second result is
/// whether the mesh asks for flat faces.
///
/// # Errors
/// [`LoadError`] if there is no such mesh, or the file is cut short, corrupt, of another version than 3 and
/// 4, or too large.
pub(crate) fn parse(
    folder: &Folder,
    bytes: &[u8],
    index: usize,
    path: &Path,
) -> Result<(Triangles, bool), LoadError> {
    let place = Place::part(path, format_args!("mesh {index}"));
    let bad = |what: &str| place.bad(what);
    let version = version(bytes, &place)?;

    // The table at the end: where each mesh starts, then how many there are
    let entry = if version == 4 { 8 } else { 4 };
    let end = bytes.len().checked_sub(4).ok_or_else(|| bad("the file is cut short"))?;
    let count = number(&bytes[end..]) as usize;
    let table = count.checked_mul(entry).and_then(|size| end.checked_sub(size));
    let table = table.ok_or_else(|| bad("the file is cut short: it has no table of its meshes"))?;
    if index >= count {
        return Err(place.bad(format!("there are only {count} meshes in the file, numbered from 0")));
    }
    let start = |index: usize| number(&bytes[table + index * entry..][..entry]);
    let next = if index + 1 < count { start(index + 1) } else { table as u64 };
    let mesh = usize::try_from(start(index)).ok().zip(usize::try_from(next).ok());
    let mesh = mesh.filter(|(_, next)| *next <= table).and_then(|(start, next)| bytes.get(start..next));
    let mesh = mesh.ok_or_else(|| bad("the table of meshes is corrupt"))?;

    let version = self::version(mesh, &place)?;
    let stream = &mesh[4..];
    let limit = (stream.len() as u64).saturating_mul(RATIO).min(MAX_BYTES);
    Inflated { stream: ZlibDecoder::new(stream), left: limit, folder, place: &place }.mesh(version)
}

/// Checks the first four bytes of a file or mesh.
fn version(bytes: &[u8], place: &Place) -> Result<u16, LoadError> {
    match bytes {
        [a, b, c, d, ..] if u16::from_le_bytes([*a, *b]) == MAGIC => match u16::from_le_bytes([*c, *d]) {
            version @ (3 | 4) => Ok(version),
            other => Err(place.unsupported(format!("version {other} of serialized meshes"))),
        },
        _ => Err(place.bad("this is not a serialized mesh of Mitsuba")),
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
    /// Counts those of all meshes.
    folder: &'a Folder,
    place: &'a Place,
}

impl Inflated<'_> {
    fn mesh(mut self, version: u16) -> Result<(Triangles, bool), LoadError> {
        let flags = number(&self.bytes(4)?) as u32;
        let width = match flags & (SINGLE | DOUBLE) {
            // Early files do not say: they are single
            SINGLE | 0 => 4,
            DOUBLE => 8,
            _ => return Err(self.place.bad("its numbers are both single and double")),
        };
        if version == 4 {
            let mut length = 0;
            while self.bytes(1)? != [0] {
                length += 1;
                self.place.at_most("bytes in a name", length, MAX_NAME as u64)?;
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
            ..Triangles::default()
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
        let bad = |what: String| self.place.bad(what);
        self.left = self.left.checked_sub(count).ok_or_else(|| {
            bad(format!(
                "the mesh says it has {count} bytes more, which the file cannot hold or are too many"
            ))
        })?;
        self.folder.inflate(count, self.place)?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::Compression;
    use flate2::write::ZlibEncoder;
    use std::io::Write;

    /// The inside of a mesh of one triangle, `x` of whose third corner tells it from others.
    fn inside(version: u16, flags: u32, x: f32) -> Vec<u8> {
        let mut bytes = flags.to_le_bytes().to_vec();
        if version == 4 {
            bytes.extend(b"name\0");
        }
        bytes.extend([3u64, 1].map(u64::to_le_bytes).concat());
        let mut put = |numbers: &[f32]| {
            for v in numbers {
                if flags & DOUBLE != 0 {
                    bytes.extend(f64::from(*v).to_le_bytes())
                } else {
                    bytes.extend(v.to_le_bytes())
                }
            }
        };
        put(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, x, 1.0, 0.0]);
        for (flag, numbers) in
            [(HAS_NORMALS, [0.0, 0.6, 0.8].repeat(3)), (HAS_UVS, vec![0.25; 6]), (HAS_COLOURS, vec![0.5; 9])]
        {
            if flags & flag != 0 {
                put(&numbers);
            }
        }
        bytes.extend([0u32, 1, 2].map(u32::to_le_bytes).concat());
        bytes
    }

    fn file(version: u16, meshes: &[Vec<u8>]) -> Vec<u8> {
        let (mut bytes, mut starts) = (Vec::new(), Vec::new());
        for mesh in meshes {
            starts.push(bytes.len() as u64);
            bytes.extend(MAGIC.to_le_bytes());
            bytes.extend(version.to_le_bytes());
            let mut encoder = ZlibEncoder::new(&mut bytes, Compression::default());
            encoder.write_all(mesh).unwrap();
            encoder.finish().unwrap();
        }
        for start in &starts {
            bytes.extend(&start.to_le_bytes()[..if version == 4 { 8 } else { 4 }]);
        }
        bytes.extend((starts.len() as u32).to_le_bytes());
        bytes
    }

    fn read(bytes: &[u8], index: usize) -> Result<(Triangles, bool), String> {
        let folder = Folder::of(Path::new("a.xml"), None, String::new());
        parse(&folder, bytes, index, Path::new("a.serialized")).map_err(|e| e.to_string())
    }

    #[test]
    fn versions_precisions_and_contents_are_read() {
        for version in [3, 4] {
            for width in [SINGLE, DOUBLE] {
                let plain = inside(version, width | FACE_NORMALS, 0.5);
                let full = inside(version, width | HAS_NORMALS | HAS_UVS | HAS_COLOURS, 0.25);
                let bytes = file(version, &[plain, full]);
                let (mesh, flat) = read(&bytes, 0).unwrap();
                assert!(flat && mesh.normals.is_empty() && mesh.uvs.is_empty());
                assert_eq!(mesh.positions, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 1.0, 0.0]]);
                let (mesh, flat) = read(&bytes, 1).unwrap();
                assert!(!flat);
                assert_eq!(mesh.positions[2], [0.25, 1.0, 0.0]);
                assert_eq!((mesh.normals, mesh.uvs), (vec![[0.0, 0.6, 0.8]; 3], vec![[0.25; 2]; 3]));
                assert_eq!(mesh.indices, [[0, 1, 2]]);
                let error = read(&bytes, 2).unwrap_err();
                assert_eq!(
                    error,
                    "a.serialized: mesh 2: there are only 2 meshes in the file, numbered from 0"
                );
            }
        }
    }

    #[test]
    fn every_cut_is_an_error() {
        let bytes = file(4, &[inside(4, SINGLE | HAS_UVS, 0.5)]);
        for length in 0..bytes.len() {
            assert!(read(&bytes[..length], 0).is_err(), "{length} bytes");
        }
    }

    #[test]
    fn counts_are_checked_before_memory_is_taken() {
        for count in [u64::MAX, 1 << 61, 1 << 40, 1 << 28, 1 << 20] {
            for at in [9, 17] {
                let mut mesh = inside(4, SINGLE, 0.5);
                mesh[at..at + 8].copy_from_slice(&count.to_le_bytes());
                let error = read(&file(4, &[mesh]), 0).unwrap_err();
                assert!(error.contains("which the file cannot hold"), "{count}: {error}");
            }
        }
        let mut mesh = inside(4, SINGLE, 0.5);
        mesh[17] = 2;
        assert!(read(&file(4, &[mesh]), 0).unwrap_err().contains("ends 12 bytes early"));
    }

    #[test]
    fn what_is_no_mesh_is_named() {
        let good = file(4, &[inside(4, SINGLE, 0.5)]);
        let with = |at: usize, value: u8| {
            let mut bytes = good.clone();
            bytes[at] = value;
            read(&bytes, 0).unwrap_err()
        };
        assert!(with(0, 0).contains("this is not a serialized mesh"));
        assert!(with(2, 2).contains("version 2 of serialized meshes is not supported"));
        assert!(with(4, 0).contains("cannot be inflated"));
        assert!(with(good.len() - 12, 0xff).contains("the table of meshes is corrupt"));
        assert!(with(good.len() - 1, 0xff).contains("no table"));
        let neither = file(4, &[inside(4, HAS_UVS, 0.5)]);
        assert_eq!(read(&neither, 0).unwrap().0.positions[2], [0.5, 1.0, 0.0]);
        let both = file(4, &[inside(4, SINGLE | DOUBLE, 0.5)]);
        assert!(read(&both, 0).unwrap_err().contains("both single and double"));
        let long = file(4, &[[&SINGLE.to_le_bytes()[..], &[b'a'; 9000]].concat()]);
        assert!(read(&long, 0).unwrap_err().contains("bytes in a name, more than 4096"));
    }
}
