//! The paper's descriptors: the tile and what it is compared with, pixel by pixel (Takouachet et al. 2017,
//! §4.3, §5).

use noisefloor::descriptor::{Descriptor, DescriptorError, NoiseMask, TileDescriptor};
use noisefloor::evidence::{Plane, TilePlanes};
use std::collections::BTreeMap;

/// What the paper ends with: the noise mask of the tile and of what it is compared with, pixel by pixel (§5).
/// 2·edge² numbers, for tiles of exactly edge×edge pixels.
pub(super) fn mask_pair(mask: NoiseMask, edge: usize) -> Descriptor {
    Descriptor::new(PixelPair { mask: Some(mask), edge })
}

/// The paper's first attempt, without a mask, which failed: the luminance of both (§4.3, §4.4).
pub(super) fn luminance_pair(edge: usize) -> Descriptor {
    Descriptor::new(PixelPair { mask: None, edge })
}

#[derive(Debug)]
struct PixelPair {
    mask: Option<NoiseMask>,
    edge: usize,
}

impl TileDescriptor for PixelPair {
    fn name(&self) -> &'static str {
        if self.mask.is_some() { "mask-pair" } else { "luminance-pair" }
    }

    fn version(&self) -> u16 {
        1
    }

    fn parameters(&self) -> BTreeMap<String, f64> {
        let mask = self.mask.map(|mask| ("mask".to_owned(), f64::from(f32::from(mask))));
        mask.into_iter().chain([("edge".to_owned(), self.edge as f64)]).collect()
    }

    fn number_names(&self) -> Vec<String> {
        let letter = if self.mask.is_some() { 'm' } else { 'l' };
        (0..2 * self.edge * self.edge).map(|i| format!("{letter}{i}")).collect()
    }

    /// That of the tile, then that of what it is compared with, each row-major.
    fn describe(&self, planes: &TilePlanes) -> Result<Vec<f32>, DescriptorError> {
        let (tile, expected) = (planes.inner, self.edge);
        if (tile.width, tile.height) != (expected, expected) {
            return Err(DescriptorError::TileSize { expected, width: tile.width, height: tile.height });
        }
        // What is compared lies to either side of the middle
        let beside = |share: f32| {
            Plane::from_fn(planes.image.size(), |at| planes.image[at] + planes.residual[at] * share)
        };
        let pair = [0.5, -0.5].map(beside);
        let pair = match self.mask {
            Some(mask) => pair.each_ref().map(|picture| mask.apply(picture)),
            None => pair,
        };
        Ok(pair.iter().flat_map(|plane| plane.inside(tile)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use noisefloor::TileGrid;

    /// A picture of x + y/4, held against 0.5.
    fn planes() -> TilePlanes {
        let tile = TileGrid::new(16, 16, 16).unwrap().tile(0);
        TilePlanes::gather((16, 16), tile, |x, y| {
            let shown = (4 * x + y) as f32 / 64.0;
            ([0.5 * (shown + 0.5); 3], [shown - 0.5; 3])
        })
    }

    #[test]
    fn both_pictures_are_there_pixel_by_pixel() {
        let own = |descriptor: Descriptor| descriptor.describe(&planes()).unwrap();
        let luminance = own(luminance_pair(16));
        let masks = own(mask_pair(NoiseMask::default(), 16));
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
        let error = luminance_pair(32).describe(&planes()).unwrap_err();
        assert_eq!(error, DescriptorError::TileSize { expected: 32, width: 16, height: 16 });
    }
}
