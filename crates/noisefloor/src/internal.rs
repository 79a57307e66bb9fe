//! What other crates of this workspace share with this one.

#[cfg(feature = "files")]
pub use crate::container::{FileFault, Format};
pub use crate::evidence::{HALO, held};
pub use crate::model::familiarity::nearest;
pub use crate::rgb::ROUNDING_LUMINANCE;
