//! Accessors: the numbers of a mesh among the bytes of a file (glTF 2.0, §3.6.2).

use super::asset::Asset;
use crate::{LoadError, Place};
use gltf::json::accessor::{ComponentType, GenericComponentType, IndexComponentType, sparse::Sparse};
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index, buffer};
use std::fmt;

/// The elements of an accessor, of `N` numbers each. `place` is what names the accessor.
pub(super) fn floats<const N: usize>(
    asset: &Asset<'_>,
    index: Index<Accessor>,
    place: &Place,
) -> Result<Vec<[f32; N]>, LoadError> {
    Reader::new(asset, index, place)?.elements(|x| x as f32)
}

/// The elements of an accessor of unsigned whole numbers.
pub(super) fn indices(
    asset: &Asset<'_>,
    index: Index<Accessor>,
    place: &Place,
) -> Result<Vec<u32>, LoadError> {
    let reader = Reader::new(asset, index, place)?;
    if !matches!(reader.kind, ComponentType::U8 | ComponentType::U16 | ComponentType::U32) {
        return Err(reader.bad(format_args!("indices are unsigned whole numbers, not {:?}", reader.kind)));
    }
    Ok(reader.elements(|x| x as u32)?.into_iter().map(|[x]| x).collect())
}

struct Reader<'a> {
    asset: &'a Asset<'a>,
    accessor: &'a Accessor,
    index: usize,
    kind: ComponentType,
    place: &'a Place,
}

impl<'a> Reader<'a> {
    fn new(asset: &'a Asset<'a>, index: Index<Accessor>, place: &'a Place) -> Result<Self, LoadError> {
        let accessor = asset.get(index, "accessor", place)?;
        let index = index.value();
        let Checked::Valid(GenericComponentType(kind)) = accessor.component_type else {
            let what = format_args!("the componentType of accessor {index} is not one of glTF's");
            return Err(place.bad(what));
        };
        Ok(Self { asset, accessor, index, kind, place })
    }

    fn bad(&self, what: impl fmt::Display) -> LoadError {
        self.place.bad(format_args!("accessor {}: {what}", self.index))
    }

    fn elements<T: Copy, const N: usize>(
        &self,
        convert: impl Fn(f64) -> T,
    ) -> Result<Vec<[T; N]>, LoadError> {
        let found = match self.accessor.type_ {
            Checked::Valid(shape) => shape.multiplicity(),
            Checked::Invalid => 0,
        };
        if found != N {
            return Err(self.bad(format_args!("an element must have {N} numbers here, not {found}")));
        }
        let size = N * self.kind.size();
        let element = |bytes: &[u8]| numbers(bytes, self.kind, self.accessor.normalized).map(&convert);
        let count = self.accessor.count.0;
        let mut elements: Vec<[T; N]> = match self.accessor.buffer_view {
            Some(view) => {
                let start = self.accessor.byte_offset.unwrap_or_default().0;
                self.slices(view, start, count, size)?.map(element).collect()
            }
            None => {
                self.place.at_most("elements without data", count, self.asset.bytes())?;
                vec![[convert(0.0); N]; count as usize]
            }
        };
        if let Some(sparse) = &self.accessor.sparse {
            let replaced = sparse.count.0;
            if replaced > count {
                return Err(self.bad(format_args!("it replaces {replaced} of its {count} elements")));
            }
            let values =
                self.slices(sparse.values.buffer_view, sparse.values.byte_offset.0, sparse.count.0, size)?;
            for (at, value) in self.sparse_indices(sparse)?.zip(values) {
                let replaced = elements.get_mut(at).ok_or_else(|| {
                    self.bad(format_args!("its sparse index {at} is past its {count} elements"))
                })?;
                *replaced = element(value);
            }
        }
        Ok(elements)
    }

    fn sparse_indices(&self, sparse: &Sparse) -> Result<impl Iterator<Item = usize>, LoadError> {
        let indices = &sparse.indices;
        let Checked::Valid(IndexComponentType(kind)) = indices.component_type else {
            return Err(self.bad("the componentType of its sparse indices is not one of glTF's"));
        };
        let slices = self.slices(indices.buffer_view, indices.byte_offset.0, sparse.count.0, kind.size())?;
        Ok(slices.map(move |bytes| {
            let [at] = numbers(bytes, kind, false);
            at as usize
        }))
    }

    /// The bytes of `count` elements of `size` bytes in a buffer view.
    fn slices(
        &self,
        view: Index<buffer::View>,
        start: u64,
        count: u64,
        size: usize,
    ) -> Result<impl Iterator<Item = &'a [u8]> + use<'a>, LoadError> {
        let bytes = self.asset.view(view, self.place)?;
        let stride = self.asset.get(view, "buffer view", self.place)?.byte_stride;
        // Zero is not allowed, but common
        let stride = stride.map_or(0, |stride| stride.0);
        let stride = if stride == 0 { size } else { stride };
        if stride < size {
            return Err(self.bad(format_args!("a byteStride of {stride} for elements of {size} bytes")));
        }
        let last = (count.max(1) - 1).checked_mul(stride as u64).and_then(|x| x.checked_add(start));
        let end = last.and_then(|x| x.checked_add(size as u64));
        if count > 0 && end.is_none_or(|end| end > bytes.len() as u64) {
            return Err(self.bad(format_args!(
                "{count} elements of {size} bytes, {stride} apart from byte {start}, \
                 reach past the end of buffer view {}, which has {} bytes",
                view.value(),
                bytes.len()
            )));
        }
        // All fit in memory now, hence in usize
        Ok((0..count as usize).map(move |i| &bytes[start as usize + i * stride..][..size]))
    }
}

/// The `N` numbers of an element. Every type fits an `f64`.
fn numbers<const N: usize>(bytes: &[u8], kind: ComponentType, normalized: bool) -> [f64; N] {
    std::array::from_fn(|i| {
        let at = &bytes[i * kind.size()..];
        // glTF 2.0, §3.11: what the largest whole number stands for when normalized
        let (x, largest) = match kind {
            ComponentType::I8 => (f64::from(at[0] as i8), 127.0),
            ComponentType::U8 => (f64::from(at[0]), 255.0),
            ComponentType::I16 => (f64::from(i16::from_le_bytes([at[0], at[1]])), 32767.0),
            ComponentType::U16 => (f64::from(u16::from_le_bytes([at[0], at[1]])), 65535.0),
            ComponentType::U32 => {
                (f64::from(u32::from_le_bytes([at[0], at[1], at[2], at[3]])), f64::from(u32::MAX))
            }
            ComponentType::F32 => {
                return f64::from(f32::from_le_bytes([at[0], at[1], at[2], at[3]]));
            }
        };
        if normalized { (x / largest).max(-1.0) } else { x }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_normalized_as_the_specification_says() {
        assert_eq!(numbers(&[0x80, 0x81, 127], ComponentType::I8, true), [-1.0, -1.0, 1.0]);
        assert_eq!(numbers(&[0x80, 255], ComponentType::U8, true), [128.0 / 255.0, 1.0]);
        assert_eq!(numbers(&[0, 0x80, 0xff, 0x7f], ComponentType::I16, true), [-1.0, 1.0]);
        assert_eq!(numbers(&[0xff, 0xff, 1, 0], ComponentType::U16, false), [65535.0, 1.0]);
        assert_eq!(numbers(&[0xff, 0xff, 0xff, 0xff], ComponentType::U32, false), [4294967295.0]);
        assert_eq!(numbers(&(-1.5f32).to_le_bytes(), ComponentType::F32, true), [-1.5]);
    }
}
