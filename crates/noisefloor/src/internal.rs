//! What other crates of this workspace share with this one; no part of its public interface, and without
//! promises. Nothing in this crate uses it.

mod text;

pub use crate::container::{FileFault, Format};
pub use crate::display::ROUNDING_LUMINANCE;
pub use crate::evidence::HALO;
pub use crate::model::familiarity::nearest;
pub use crate::tile::check_image;
pub use text::printable;
