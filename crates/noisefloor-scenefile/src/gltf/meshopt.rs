//! Buffer views that meshoptimizer compressed (EXT_meshopt_compression, whose appendices have the formats). They are
//! inflated before anything is read, as if the file had them so.

use super::asset::Asset;
use crate::{LoadError, Place};
use gltf::json::buffer::{Stride, View};
use gltf::json::{Index, Value};

pub(super) const NAME: &str = "EXT_meshopt_compression";
/// Most bytes that a byte of data becomes: a header byte stands for 64 of them that repeat, an index of triangles
/// takes 12.
const BYTES_A_BYTE: u64 = 64;

/// Inflates all compressed views.
pub(super) fn inflate(asset: &mut Asset<'_>) -> Result<(), LoadError> {
    for index in 0..asset.root.buffer_views.len() {
        let extensions = asset.root.buffer_views[index].extensions.as_ref();
        let Some(extension) = extensions.and_then(|e| e.others.get(NAME)) else { continue };
        let place = Place::part(asset.path, format_args!("buffer view {index}, {NAME}"));
        let (bytes, stride) = inflated(asset, extension, &place)?;
        let view = asset.add_view(bytes);
        let mut view = asset.get(view, "buffer view", &place)?.clone();
        view.byte_stride = Some(Stride(stride));
        asset.root.buffer_views[index] = view;
    }
    Ok(())
}

/// The bytes of a view, and how far its elements are apart.
fn inflated(asset: &Asset<'_>, extension: &Value, place: &Place) -> Result<(Vec<u8>, usize), LoadError> {
    let number = |key: &str| extension.get(key).and_then(Value::as_u64);
    let needed = |key: &str| number(key).ok_or_else(|| place.clone().bad(format_args!("it needs a `{key}`")));
    let word = |key: &str| extension.get(key).and_then(Value::as_str).unwrap_or("NONE");
    let [buffer, length, stride, count] =
        [needed("buffer")?, needed("byteLength")?, needed("byteStride")?, needed("count")?];
    let compressed = View {
        buffer: Index::new(u32::try_from(buffer).unwrap_or(u32::MAX)),
        byte_length: length.into(),
        byte_offset: Some(number("byteOffset").unwrap_or(0).into()),
        byte_stride: None,
        name: None,
        target: None,
        extensions: None,
        extras: Default::default(),
    };
    let data = asset.bytes_of(&compressed, place, || place.clone())?;
    let most = (data.len() as u64).saturating_mul(BYTES_A_BYTE);
    let becomes = count.saturating_mul(stride);
    place.clone().at_most("bytes of compressed data", becomes, most)?;
    // Any number of views may name the same data
    asset.folder().inflate(becomes, place)?;
    let (stride, count) = (stride as usize, count as usize);
    let (mode, filter) = (word("mode"), word("filter"));
    let fits = match (mode, filter) {
        ("ATTRIBUTES", "NONE") => stride.is_multiple_of(4) && (4..=256).contains(&stride),
        ("ATTRIBUTES", "OCTAHEDRAL") => stride == 4 || stride == 8,
        ("ATTRIBUTES", "QUATERNION") => stride == 8,
        ("ATTRIBUTES", "EXPONENTIAL") => stride.is_multiple_of(4) && (4..=256).contains(&stride),
        ("TRIANGLES", "NONE") => (stride == 2 || stride == 4) && count.is_multiple_of(3),
        ("INDICES", "NONE") => stride == 2 || stride == 4,
        _ => {
            let what = format_args!("data of the mode {mode:?} with the filter {filter:?}");
            return Err(place.clone().unsupported(what));
        }
    };
    if !fits {
        return Err(place
            .clone()
            .bad(format_args!("{count} elements of {stride} bytes are no {mode} ({filter})")));
    }
    let broken = || place.clone().bad("its data is broken, or of a later version");
    let mut bytes = match mode {
        "ATTRIBUTES" => attributes(data, stride, count),
        "TRIANGLES" => triangles(data, count).map(|indices| narrowed(&indices, stride)),
        _ => sequence(data, count).map(|indices| narrowed(&indices, stride)),
    }
    .ok_or_else(broken)?;
    let elements = bytes.chunks_exact_mut(stride);
    match filter {
        "OCTAHEDRAL" if stride == 4 => elements.for_each(|e| octahedral(e, 127.0, read_i8, write_i8)),
        "OCTAHEDRAL" => elements.for_each(|e| octahedral(e, 32767.0, read_i16, write_i16)),
        "QUATERNION" => elements.for_each(quaternion),
        "EXPONENTIAL" => bytes.as_chunks_mut().0.iter_mut().for_each(exponential),
        _ => {}
    }
    Ok((bytes, stride))
}

/// Takes bytes off the front of data.
struct Bytes<'a>(&'a [u8]);

impl<'a> Bytes<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.0.split_at_checked(count)?;
        self.0 = rest;
        Some(taken)
    }

    fn byte(&mut self) -> Option<u8> {
        Some(self.take(1)?[0])
    }

    /// A number of seven bits a byte.
    fn varint(&mut self) -> Option<u32> {
        let mut value = 0;
        for shift in (0..35).step_by(7) {
            let byte = self.byte()?;
            value |= u32::from(byte & 127) << shift;
            if byte < 128 {
                return Some(value);
            }
        }
        None
    }
}

/// A signed number whose sign is its last bit.
fn unzigzag(value: u32) -> u32 {
    (value >> 1) ^ (value & 1).wrapping_neg()
}

/// Mode 0: each byte of the elements is a stream of its own, as differences between neighbours, in blocks.
fn attributes(data: &[u8], stride: usize, count: usize) -> Option<Vec<u8>> {
    // The tail holds the element before the first
    let (data, tail) = data.split_at_checked(data.len().checked_sub(stride.max(32))?)?;
    let mut last = tail[tail.len() - stride..].to_vec();
    let mut data = Bytes(data);
    if data.byte()? != 0xa0 {
        return None;
    }
    let mut elements = vec![0; count * stride];
    for block in elements.chunks_mut(((8192 / stride) & !15).min(256) * stride) {
        let size = block.len() / stride;
        for (k, last) in last.iter_mut().enumerate() {
            let groups = size.div_ceil(16);
            let header = data.take(groups.div_ceil(4))?;
            for group in 0..groups {
                let deltas = deltas(&mut data, header[group / 4] >> (2 * (group % 4)) & 3)?;
                for (i, delta) in deltas.into_iter().enumerate().take(size - 16 * group) {
                    *last = last.wrapping_add((delta >> 1) ^ (delta & 1).wrapping_neg());
                    block[(16 * group + i) * stride + k] = *last;
                }
            }
        }
    }
    data.0.is_empty().then_some(elements)
}

/// Sixteen bytes of a group: none, or 2, 4 or 8 bits each; all ones stand for a byte that follows.
fn deltas(data: &mut Bytes<'_>, kind: u8) -> Option<[u8; 16]> {
    let mut deltas = [0; 16];
    let bits = match kind {
        0 => return Some(deltas),
        3 => return data.take(16)?.try_into().ok(),
        kind => 2 * usize::from(kind),
    };
    let (packed, ones) = (data.take(2 * bits)?, (1u8 << bits) - 1);
    for (i, delta) in deltas.iter_mut().enumerate() {
        let at = i * bits;
        let value = packed[at / 8] >> (8 - bits - at % 8) & ones;
        *delta = if value == ones { data.byte()? } else { value };
    }
    Some(deltas)
}

/// Sixteen things, of which the last ones pushed are read.
struct Fifo<T>([T; 16], usize);

impl<T: Copy> Fifo<T> {
    fn push(&mut self, value: T) {
        self.0[self.1 & 15] = value;
        self.1 += 1;
    }

    /// The one pushed `back` before the next.
    fn get(&self, back: usize) -> T {
        self.0[self.1.wrapping_sub(back) & 15]
    }
}

/// Mode 1: triangles, most of which share an edge with one of the last, and a corner.
fn triangles(data: &[u8], count: usize) -> Option<Vec<u32>> {
    let mut data = Bytes(data);
    if data.byte()? != 0xe1 {
        return None;
    }
    let codes = data.take(count / 3)?;
    let (rest, table) = data.0.split_at_checked(data.0.len().checked_sub(16)?)?;
    data.0 = rest;
    let (mut edges, mut vertices) = (Fifo([[0u32; 2]; 16], 0), Fifo([0u32; 16], 0));
    let (mut next, mut last) = (0u32, 0u32);
    let mut indices = Vec::with_capacity(count);
    let fresh = |next: &mut u32| {
        *next = next.wrapping_add(1);
        next.wrapping_sub(1)
    };
    for &code in codes {
        let (high, low) = (usize::from(code >> 4), usize::from(code & 15));
        if high < 15 {
            let [a, b] = edges.get(high + 1);
            let c = match low {
                0 => fresh(&mut next),
                1..13 => vertices.get(low + 1),
                13 => last.wrapping_sub(1),
                14 => last.wrapping_add(1),
                _ => last.wrapping_add(unzigzag(data.varint()?)),
            };
            if low >= 13 {
                last = c;
            }
            if low == 0 || low >= 13 {
                vertices.push(c);
            }
            edges.push([c, b]);
            edges.push([a, c]);
            indices.extend([a, b, c]);
            continue;
        }
        let aux = if low < 14 { table[low] } else { data.byte()? };
        let (second, third) = (usize::from(aux >> 4), usize::from(aux & 15));
        // Numbers that do not come from the table may start again
        if low >= 14 && aux == 0 {
            next = 0;
        }
        let explicit = |slot: usize| low >= 14 && slot == 15;
        let mut a = if low == 15 { 0 } else { fresh(&mut next) };
        let mut b = if second == 0 { fresh(&mut next) } else { vertices.get(second) };
        let mut c = if third == 0 { fresh(&mut next) } else { vertices.get(third) };
        for (corner, there) in [(&mut a, low == 15), (&mut b, explicit(second)), (&mut c, explicit(third))] {
            if there {
                last = last.wrapping_add(unzigzag(data.varint()?));
                *corner = last;
            }
        }
        vertices.push(a);
        for (corner, slot) in [(b, second), (c, third)] {
            if slot == 0 || explicit(slot) {
                vertices.push(corner);
            }
        }
        for edge in [[b, a], [c, b], [a, c]] {
            edges.push(edge);
        }
        indices.extend([a, b, c]);
    }
    data.0.is_empty().then_some(indices)
}

/// Mode 2: indices as differences from one of two earlier ones.
fn sequence(data: &[u8], count: usize) -> Option<Vec<u32>> {
    let mut data = Bytes(data.get(..data.len().checked_sub(4)?)?);
    if data.byte()? != 0xd1 {
        return None;
    }
    let mut last = [0u32; 2];
    let indices: Option<Vec<u32>> = (0..count)
        .map(|_| {
            let value = data.varint()?;
            let base = &mut last[(value & 1) as usize];
            *base = base.wrapping_add(unzigzag(value >> 1));
            Some(*base)
        })
        .collect();
    indices.filter(|_| data.0.is_empty())
}

/// Indices as bytes.
fn narrowed(indices: &[u32], stride: usize) -> Vec<u8> {
    indices.iter().flat_map(|index| index.to_le_bytes().into_iter().take(stride)).collect()
}

fn read_i8(element: &[u8], i: usize) -> f32 {
    f32::from(element[i] as i8)
}

fn write_i8(element: &mut [u8], i: usize, value: f32) {
    element[i] = value as i8 as u8;
}

fn read_i16(element: &[u8], i: usize) -> f32 {
    f32::from(i16::from_le_bytes([element[2 * i], element[2 * i + 1]]))
}

fn write_i16(element: &mut [u8], i: usize, value: f32) {
    element[2 * i..2 * i + 2].copy_from_slice(&(value as i16).to_le_bytes());
}

/// A direction folded onto two numbers; the third says what 1 is, the fourth stays.
fn octahedral(
    element: &mut [u8],
    most: f32,
    read: fn(&[u8], usize) -> f32,
    write: fn(&mut [u8], usize, f32),
) {
    let [mut x, mut y, one] = [0, 1, 2].map(|i| read(element, i));
    let z = one - x.abs() - y.abs();
    let fold = (-z).max(0.0);
    x -= if x >= 0.0 { fold } else { -fold };
    y -= if y >= 0.0 { fold } else { -fold };
    let scale = most / (x * x + y * y + z * z).sqrt().max(f32::MIN_POSITIVE);
    for (i, value) in [x, y, z].into_iter().enumerate() {
        write(element, i, (value * scale).round());
    }
}

/// A rotation without its largest component, whose place and scale are in the fourth number.
fn quaternion(element: &mut [u8]) {
    let last = read_i16(element, 3) as i16;
    let scale = std::f32::consts::FRAC_1_SQRT_2 / f32::from(last | 3);
    let [x, y, z] = [0, 1, 2].map(|i| read_i16(element, i) * scale);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    for (i, value) in [w, x, y, z].into_iter().enumerate() {
        write_i16(element, ((last & 3) as usize + i) & 3, (value * 32767.0).round());
    }
}

/// A number as m·2ᵉ: e in the high byte, m in the other three.
fn exponential(element: &mut [u8; 4]) {
    let value = i32::from_le_bytes(*element);
    let (exponent, mantissa) = (value >> 24, value << 8 >> 8);
    *element = ((f64::from(mantissa) * f64::from(exponent).exp2()) as f32).to_le_bytes();
}

#[cfg(test)]
mod tests {
    //! Data of meshoptimizer 1.3.0's encoder, and what its decoder makes of it.

    use super::*;

    fn bytes(hex: &str) -> Vec<u8> {
        let digits: Vec<u32> = hex.chars().filter_map(|c| c.to_digit(16)).collect();
        digits.chunks(2).map(|pair| (pair[0] << 4 | pair[1]) as u8).collect()
    }

    /// 300 elements of four bytes in two blocks: groups of all four kinds.
    const ELEMENTS: &str = "\
        a0555555552aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa \
        aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa9ffffff008aaaef04040444446466666686888888 \
        a8aaaaaacacccccceceeeeeefeff10101010101010121012121212121214121414141414141614161616161616 \
        18161818181818181a181a1a1a1a1a1a1c1a1c1c1c1c1c1c1e1c1e1e1e1e1e1e201e2020202020202220222222 \
        2222222422242424242424262426262626262628262828282828282a282a2a2a2a2a2a2c2a2c2c2c2c2c2c2e2c \
        2e2e2e2e2e2e302e30303030303032303232323232323432343434343434363436363636363638363838383838 \
        383a383a3a3a3a3a3a3c3a3c3c3c3c3c3c3e3c3e3e3e3e3e3e403e4040555555550003c0000b0c0003c0009493 \
        0003c000cbcc0003c0002b2c0003c00074730003c000ebec0003c0004b4c0003c00054530003c000f4f30003c0 \
        006b6c0003c00034330003c000d4d30003c0008b8c0003c00014130003c000b4b30003c000abacffffffff0045 \
        434343434343434543434343434343454343434343434345434343434343434543434343434343454343434343 \
        434345434343434343434543434343434343454343434343434345434343434343434543434343434343454343 \
        434343434345434343434343434543434343434343454343434343434345434343434343434543434343434343 \
        454343434343434345434343434343434543434343434343454343434343434345434343434343434543434343 \
        434343454343434343434345434343434343434543434343434343454343434343434345434343434343434543 \
        434343434343454343434343434345434343434343434543434343434315aaaaaaaaaaaaaaaaaaaaaa003f4040 \
        404042404242424242424442444444444444464446464646464648464848484848484a484a4a4a4a4a4a000000 \
        00150003c0000b0c0003c00094930003c000cbcc3f434543434343434343454343434343434345434343434343 \
        434543434343434343454343434343434345434300000000000000000000000000000000000000000000000000 \
        0000000000000000000900";
    /// A grid of 9×9 vertices, and two triangles of others.
    const TRIANGLES: &str = "\
        e1fe1e100e100e100e100e100e100e100efe1e100e100e100e100e100e100e100efe1e100e100e100e100e100e \
        100e100efe1e100e100e100e100e100e100e100efe1e100e100e100e100e100e100e100efe1e100e100e100e10 \
        0e100e100e100efe1e100e100e100e100e100e100e100efe1e100e100e100e100e100e100e100effff0f120f02 \
        0f020f020f020f020f020f02ff009f0150ff9807e107e407007687566778a9866589689801690000";
    const SEQUENCE: &str = "\
        d1000404049103040504e9fc0f040400000000";

    fn grid() -> Vec<[u32; 3]> {
        let cells = (0..8).flat_map(|j| (0..8).map(move |i| 9 * j + i));
        let two = |v: u32| [[v, v + 1, v + 9], [v + 9, v + 1, v + 10]];
        cells.flat_map(two).chain([[80, 0, 40], [500, 3, 501]]).collect()
    }

    #[test]
    fn all_modes_are_decoded() {
        let element = |i: u32| {
            let third = if i % 16 == 7 { i * 37 } else { 9 };
            [i, (i * i) >> 4, third, (i * 7919) >> 3].map(|x| x as u8)
        };
        let expected: Vec<u8> = (0..300).flat_map(element).collect();
        assert_eq!(attributes(&bytes(ELEMENTS), 4, 300), Some(expected));
        let found = triangles(&bytes(TRIANGLES), 390).unwrap();
        // The encoder may begin a triangle at another corner
        let first = |[a, b, c]: [u32; 3]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min();
        let all = |list: &[[u32; 3]]| list.iter().map(|t| first(*t)).collect::<Vec<_>>();
        assert_eq!(all(found.as_chunks().0), all(&grid()));
        assert_eq!(sequence(&bytes(SEQUENCE), 11), Some(vec![0, 1, 2, 3, 100, 4, 101, 5, 65535, 6, 7]));
    }

    #[test]
    fn all_filters_are_undone() {
        type Undo = fn(&mut [u8]);
        let filters: [(usize, &str, &str, Undo); 4] = [
            (
                4,
                "\
                    a0013ff00000fdfe5cfa7d013fc00000fd6f266300013ff0000004817ffec20000000000000000000000000000 \
                    00000000000000000000000000007f007f7f",
                "\
                    7f00007f008100814c009a40c44cae0049494a7fde4366e0",
                |e| octahedral(e, 127.0, read_i8, write_i8),
            ),
            (
                8,
                "\
                    a00127e000006741013ff000000d0e191007012fc00000dd6433013ec000000f18050000013460000004012ff0 \
                    00007f7ffec2000000000000000000000000000000000000000000000000ff070000ff07ff7f",
                "\
                    ff7f00000000ff7f0000018000000180c54c00009599004097c2ca4c0dae0000dd49dd49f949ff7fd0dd6044a9 \
                    6600e0",
                |e| octahedral(e, 32767.0, read_i16, write_i16),
            ),
            (
                8,
                "\
                    a0010ff00000b28f213a010fc000000b1003010ff00000b1f42c06010df000000a150e010ff00000b1e963ad01 \
                    0ed000000a0b0133f0000005060504000000000000000000000000000000000000000000000000000000000000 \
                    00ff07",
                "\
                    000000000000ff7fff7f0000000000000f4006c0fa3ffa3f6417bc2e2046755d6566000033b30000900227fce8 \
                    7f4801",
                quaternion,
            ),
            (
                8,
                "\
                    a0010c00000090013c0000002f7800013c0000002342013c0000001d1e013c0000009a510120000000013c0000 \
                    002342000000000000000000000000000000000000000000000000001800f400dcfff4",
                "\
                    0000c03f000010c00000000000c427370020f14700000000",
                |e| e.as_chunks_mut().0.iter_mut().for_each(exponential),
            ),
        ];
        for (stride, data, expected, undo) in filters {
            let expected = bytes(expected);
            let mut found = attributes(&bytes(data), stride, expected.len() / stride).unwrap();
            found.chunks_exact_mut(stride).for_each(undo);
            assert_eq!(found, expected, "{data}");
        }
    }

    /// Cut or changed data is refused or read as something else, and never panics.
    #[test]
    fn damage_does_no_harm() {
        let mut random = fastrand::Rng::with_seed(3);
        type Decodes = fn(&[u8]) -> bool;
        let decode: [(&str, Decodes); 3] = [
            (ELEMENTS, |data| attributes(data, 4, 300).is_some()),
            (TRIANGLES, |data| triangles(data, 390).is_some()),
            (SEQUENCE, |data| sequence(data, 11).is_some()),
        ];
        for (data, decodes) in decode {
            let data = bytes(data);
            assert!(decodes(&data));
            for length in 0..data.len() {
                assert!(!decodes(&data[..length]), "cut at {length}");
            }
            for _ in 0..5000 {
                let mut data = data.clone();
                for _ in 0..=random.usize(..3) {
                    let at = random.usize(..data.len());
                    data[at] = random.u8(..);
                }
                decodes(&data);
            }
        }
        for _ in 0..2000 {
            let element: [u8; 8] = std::array::from_fn(|_| random.u8(..));
            octahedral(&mut element.clone(), 127.0, read_i8, write_i8);
            octahedral(&mut element.clone(), 32767.0, read_i16, write_i16);
            quaternion(&mut element.clone());
            element.clone().as_chunks_mut().0.iter_mut().for_each(exponential);
        }
        quaternion(&mut [0xff; 8]);
        octahedral(&mut [0; 4], 127.0, read_i8, write_i8);
    }
}
