//! The paper's descriptors: the tile and what it is compared with, pixel by pixel (Takouachet et al. 2017,
//! §4.3, §5).

use super::kind::{Descriptor, DescriptorError, DescriptorKind, TileDescriptor, edge, mask};
use crate::descriptor::NoiseMask;
use crate::evidence::TilePlanes;
use ndarray::{Array2, s};
use std::collections::BTreeMap;

pub(super) const MASKS: DescriptorKind = DescriptorKind {
    name: "mask-pair",
    make: |parameters| Ok(Descriptor::new(MaskPair { mask: mask(parameters)?, edge: edge(parameters)? })),
};

pub(super) const LUMINANCES: DescriptorKind = DescriptorKind {
    name: "luminance-pair",
    make: |parameters| Ok(Descriptor::new(LuminancePair { edge: edge(parameters)? })),
};

/// See [`Descriptor::mask_pair`].
#[derive(Debug)]
pub(super) struct MaskPair {
    pub(super) mask: NoiseMask,
    pub(super) edge: usize,
}

/// See [`Descriptor::luminance_pair`].
#[derive(Debug)]
pub(super) struct LuminancePair {
    pub(super) edge: usize,
}

impl TileDescriptor for MaskPair {
    fn name(&self) -> &'static str {
        MASKS.name
    }

    fn version(&self) -> u16 {
        1
    }

    fn parameters(&self) -> BTreeMap<String, f64> {
        let mask = f64::from(f32::from(self.mask));
        BTreeMap::from([("mask".to_owned(), mask), ("edge".to_owned(), self.edge as f64)])
    }

    fn number_names(&self) -> Vec<String> {
        numbered('m', self.edge)
    }

    /// The mask of the tile, then the mask of what it is compared with, each row-major.
    fn describe(&self, planes: &TilePlanes) -> Result<Vec<f32>, DescriptorError> {
        fits(self.edge, planes)?;
        Ok(inner(planes, [self.mask.apply(&planes.image), self.mask.apply(&counterpart(planes))]))
    }
}

impl TileDescriptor for LuminancePair {
    fn name(&self) -> &'static str {
        LUMINANCES.name
    }

    fn version(&self) -> u16 {
        1
    }

    fn parameters(&self) -> BTreeMap<String, f64> {
        BTreeMap::from([("edge".to_owned(), self.edge as f64)])
    }

    fn number_names(&self) -> Vec<String> {
        numbered('l', self.edge)
    }

    /// The luminance of the tile, then that of what it is compared with, each row-major.
    fn describe(&self, planes: &TilePlanes) -> Result<Vec<f32>, DescriptorError> {
        fits(self.edge, planes)?;
        Ok(inner(planes, [planes.image.clone(), counterpart(planes)]))
    }
}

fn numbered(letter: char, edge: usize) -> Vec<String> {
    (0..2 * edge * edge).map(|i| format!("{letter}{i}")).collect()
}

fn fits(expected: usize, planes: &TilePlanes) -> Result<(), DescriptorError> {
    let (width, height) = (planes.inner.width, planes.inner.height);
    let error = DescriptorError::TileSize { expected, width, height };
    if (width, height) == (expected, expected) { Ok(()) } else { Err(error) }
}

fn counterpart(planes: &TilePlanes) -> Array2<f32> {
    &planes.image - &planes.residual
}

/// The pixels of the tile itself in each of two planes.
fn inner(planes: &TilePlanes, pair: [Array2<f32>; 2]) -> Vec<f32> {
    let t = planes.inner;
    let mut out = Vec::with_capacity(2 * t.pixels());
    for plane in pair {
        out.extend(plane.slice(s![t.y..t.y + t.height, t.x..t.x + t.width]).iter());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::descriptor::{Descriptor, DescriptorError};
    use crate::tile::TileGrid;

    /// A picture of x + y/4, held against 0.5.
    fn planes() -> TilePlanes {
        let tile = TileGrid::new(16, 16, 16).unwrap().tile(0);
        TilePlanes::gather((16, 16), tile, |x, y| {
            let shown = (4 * x + y) as f32 / 64.0;
            ([shown; 3], [shown - 0.5; 3])
        })
    }

    #[test]
    fn both_pictures_are_there_pixel_by_pixel() {
        let own = |descriptor: Descriptor| descriptor.describe(&planes()).unwrap();
        let luminance = own(Descriptor::luminance_pair(16));
        let masks = own(Descriptor::mask_pair(NoiseMask::default(), 16));
        for (i, (l, m)) in luminance.iter().zip(&masks).enumerate() {
            let (x, y) = (i % 16, i / 16 % 16);
            let known = if i < 256 { (4 * x + y) as f32 / 64.0 } else { 0.5 };
            assert!((l - known).abs() < 1e-6, "{i}: {l}");
            // A ramp and a constant have no mask, but where the picture is mirrored
            assert!(m.abs() < 1e-6 || (i < 256 && [x, y].iter().any(|e| [0, 15].contains(e))), "{i}: {m}");
        }
        assert_eq!((luminance.len(), masks.len()), (512, 512));
    }

    #[test]
    fn another_size_is_an_error() {
        let error = Descriptor::luminance_pair(32).describe(&planes()).unwrap_err();
        assert_eq!(error, DescriptorError::TileSize { expected: 32, width: 16, height: 16 });
    }
}
