//! What pictures cannot be compared.

use thiserror::Error;

/// Pictures that cannot be compared.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[non_exhaustive]
pub enum VisionError {
    /// Too small or too large.
    #[error(
        "cannot compare pictures of {width}×{height} pixels: each side needs 2 or more, and all at most 2²⁸"
    )]
    Size {
        /// Pixels in a row.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// Not as many pixels as the size says.
    #[error("a picture of {width}×{height} pixels has {found} pixels")]
    Length {
        /// Pixels in a row.
        width: usize,
        /// Rows.
        height: usize,
        /// Pixels given.
        found: usize,
    },
    /// A value is infinite or no number.
    #[error("pixel {index} (row by row) is infinite or not a number")]
    NotFinite {
        /// The pixel, row by row.
        index: usize,
    },
    /// The part of interest is empty or reaches beyond the picture.
    #[error("the part of interest is empty, or reaches beyond the picture")]
    Region,
}
