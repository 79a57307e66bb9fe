//! What other crates of this workspace share with this one.

#[cfg(feature = "files")]
pub use crate::container::{FileFault, Format};
pub use crate::evidence::{HALO, held};
pub use crate::model::familiarity::nearest;

/// Luminance weights, squared and summed: variance of Y′ for unit variance of R′, G′ and B′.
pub const ROUNDING_LUMINANCE: f32 = crate::display::ROUNDING_LUMINANCE;
