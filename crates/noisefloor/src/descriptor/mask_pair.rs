//! The paper's descriptor: both noise masks, pixel by pixel (Takouachet et al. 2017, §5).

use crate::evidence::TilePlanes;
use crate::mask::NoiseMask;
use ndarray::{Array2, s};

/// The mask of the tile, then the mask of what it is held against, each row-major: 2·edge² numbers.
pub(super) fn describe(planes: &TilePlanes, mask: NoiseMask) -> Vec<f32> {
    let counterpart = &planes.image - &planes.residual;
    let t = planes.inner;
    let mut out = Vec::with_capacity(2 * t.pixels());
    let mut push = |plane: &Array2<f32>| {
        out.extend(mask.apply(plane).slice(s![t.y..t.y + t.height, t.x..t.x + t.width]).iter());
    };
    push(&planes.image);
    push(&counterpart);
    out
}
