//! The paper's descriptors: the tile and what it is held against, pixel by pixel (Takouachet et al. 2017, §4.3, §5).

use crate::evidence::TilePlanes;
use crate::mask::NoiseMask;
use ndarray::{Array2, s};

/// The mask of the tile, then the mask of what it is held against, each row-major: 2·edge² numbers.
pub(super) fn masks(planes: &TilePlanes, mask: NoiseMask) -> Vec<f32> {
    inner(planes, [mask.apply(&planes.image), mask.apply(&counterpart(planes))])
}

/// The luminance of the tile, then that of what it is held against, each row-major: 2·edge² numbers.
pub(super) fn luminances(planes: &TilePlanes) -> Vec<f32> {
    inner(planes, [planes.image.clone(), counterpart(planes)])
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
        let own = |descriptor: Descriptor| descriptor.describe(&planes(), 1.0).unwrap().own;
        let luminance = own(Descriptor::LuminancePair { edge: 16 });
        let masks = own(Descriptor::MaskPair { mask: NoiseMask::default(), edge: 16 });
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
        let error = Descriptor::LuminancePair { edge: 32 }.describe(&planes(), 1.0).unwrap_err();
        assert_eq!(error, DescriptorError::TileSize { expected: 32, width: 16, height: 16 });
    }
}
