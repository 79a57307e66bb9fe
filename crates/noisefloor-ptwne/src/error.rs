//! Errors of scenes and of render options.

use std::error::Error as StdError;
use thiserror::Error;

/// Why a scene cannot be built.
#[derive(Debug, Error, Clone, PartialEq)]
#[non_exhaustive]
pub enum SceneError {
    #[error("{what} is not finite; every coordinate, colour and size must be")]
    NotFinite { what: &'static str },
    #[error("{what} is {value}, outside {range}")]
    Range {
        what: &'static str,
        value: f32,
        /// The range it must lie in, as text.
        range: &'static str,
    },
    #[error("a mesh with {vertices} vertices has the index {index}")]
    Index { index: u32, vertices: usize },
    #[error("a mesh with {positions} positions has {found} {what}; give none, or one per position")]
    Lengths {
        /// What there are too many or too few of.
        what: &'static str,
        positions: usize,
        found: usize,
    },
    #[error("an emitter has no area")]
    EmptyEmitter,
    #[error("material {0} does not exist in this builder")]
    Material(u32),
    #[error("an image of {width}×{height} pixels has {found} values")]
    Image { width: usize, height: usize, found: usize },
    #[error("the camera has no orientation: eye and target coincide, or up is parallel to the view")]
    Camera,
    #[error("the axes of an environment map must have length 1 and be perpendicular to each other")]
    Rotation,
    /// Objects and instances do not fit together.
    #[error("{0}; objects hold surfaces that do not shine, and are shown by instances in the scene")]
    Object(&'static str),
    #[error(
        "the matrix of an instance is singular: scale no axis by zero, nor one 10⁶ times as much as another"
    )]
    Singular,
    #[error("there is no memory for {bytes} bytes more; allow more (`ulimit -v`), or simplify the scene")]
    Memory {
        /// Bytes that were asked for.
        bytes: usize,
    },
    #[error("the scene has {found} {what}, more than {limit}")]
    TooLarge {
        /// What there are too many of.
        what: &'static str,
        found: usize,
        limit: usize,
    },
}

/// Why a renderer cannot be made.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RenderError {
    #[error(transparent)]
    Size(#[from] noisefloor::tile::TileError),
    #[error("option `{name}` is {value}; it must be {range}")]
    Option {
        name: &'static str,
        value: usize,
        /// The range it must lie in, as text.
        range: &'static str,
    },
    #[error("option `clamp` is {0}; it must be a radiance above 0")]
    Clamp(f32),
    #[error("threads could not be started")]
    Threads(#[source] Box<dyn StdError + Send + Sync>),
    #[error("the reference was cancelled")]
    Cancelled,
}

#[derive(Debug, Error)]
#[error("tile {index} reaches to pixel ({right}, {bottom}) of an image of {width}×{height}")]
pub(crate) struct OutsideError {
    pub(crate) index: usize,
    pub(crate) right: usize,
    pub(crate) bottom: usize,
    pub(crate) width: usize,
    pub(crate) height: usize,
}
