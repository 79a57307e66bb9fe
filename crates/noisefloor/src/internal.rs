//! What other crates of this workspace share with this one; no part of its public interface, and without
//! promises. Nothing in this crate uses it.

mod text;

pub use crate::container::{Fault, Format};
pub use crate::display::ROUNDING_LUMINANCE;
pub use crate::evidence::HALO;
pub use crate::model::familiarity::nearest;
pub use crate::tile::check_image;
pub use text::printable;

use crate::descriptor::Descriptor;

/// The paper's first attempt, without a mask, which failed: the luminance of the tile and of what it is
/// compared with, pixel by pixel (Takouachet et al. 2017, §4.3, §4.4). 2·edge² numbers, for tiles of exactly
/// edge×edge pixels.
pub fn luminance_pair(edge: usize) -> Descriptor {
    Descriptor::luminance_pair(edge)
}
