//! What can be wrong with a scene or with a render's options.

use thiserror::Error;

/// Why a scene cannot be built.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum SceneError {
    /// A number is not finite.
    #[error("{what} is not finite; every coordinate, colour and size must be")]
    NotFinite {
        /// Which number.
        what: &'static str,
    },
    /// A number is outside its range.
    #[error("{what} is {value}, outside {range}")]
    Range {
        /// Which number.
        what: &'static str,
        /// Its value.
        value: f32,
        /// The range it must lie in, for people.
        range: &'static str,
    },
    /// An index of a mesh points past the end of its vertices.
    #[error("index {index} of a mesh with {vertices} vertices")]
    Index {
        /// The index.
        index: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// Normals or texture coordinates do not go with the positions.
    #[error("a mesh with {positions} positions has {found} {what}; give none, or one a position")]
    Lengths {
        /// What there is too much or too little of.
        what: &'static str,
        /// Number of positions.
        positions: usize,
        /// Number found.
        found: usize,
    },
    /// An emitter has no area, so that its power is not defined.
    #[error("an emitter has no area")]
    EmptyEmitter,
    /// A material was made by another builder.
    #[error("material {0} does not exist in this builder")]
    Material(u32),
    /// An image texture has another number of pixels than its size says.
    #[error("an image texture of {width}×{height} pixels has {found} values")]
    Image {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
        /// Number of values found.
        found: usize,
    },
    /// The camera looks nowhere: eye and target coincide, or its up vector is parallel to the view.
    #[error("the camera looks nowhere: eye and target coincide, or up is parallel to the view")]
    Camera,
    /// Three rows are not those of a rotation.
    #[error(
        "the axes of an environment map are no rotation: each must have length 1, and stand upright on the others"
    )]
    Rotation,
    /// The scene has more of something than the limit allows.
    #[error("the scene has {found} {what}, more than {limit}")]
    TooLarge {
        /// What there is too much of.
        what: &'static str,
        /// Number found.
        found: usize,
        /// The limit.
        limit: usize,
    },
}

/// Why a renderer cannot be made.
#[derive(Debug, Error)]
pub enum RenderError {
    /// The image is empty or too large.
    #[error(transparent)]
    Size(#[from] noisefloor::TileError),
    /// An option is outside its range.
    #[error("option `{name}` is {value}; it must be {range}")]
    Option {
        /// The option's name.
        name: &'static str,
        /// Its value.
        value: usize,
        /// The range it must lie in, for people.
        range: &'static str,
    },
    /// The clamp is not a positive, finite radiance.
    #[error("option `clamp` is {0}; it must be a radiance above 0")]
    Clamp(f32),
    /// Threads could not be started.
    #[error("threads could not be started")]
    Threads(#[from] rayon::ThreadPoolBuildError),
    /// Whoever watched it gave the reference up.
    #[error("the reference was given up")]
    GivenUp,
}

/// What can go wrong in a call of [`ProgressiveSource::sample`](noisefloor::ProgressiveSource::sample).
#[derive(Debug, Error)]
#[error("tile {index} reaches to pixel ({right}, {bottom}) of an image of {width}×{height}")]
pub(crate) struct OutsideError {
    pub(crate) index: usize,
    pub(crate) right: usize,
    pub(crate) bottom: usize,
    pub(crate) width: usize,
    pub(crate) height: usize,
}
