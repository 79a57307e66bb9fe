//! What eyes see: how visible a difference between two pictures is, on a given display, from a given distance;
//! of stills, or of a still view in a film whose noise is new in every frame.
//!
//! The image path of ColorVideoVDP (Mantiuk et al. 2024) in Rust, with the constants of the PyPI package
//! `cvvdp` 0.5.7 and its results: on 98 recorded pairs, JODs agree within 0.00003 and difference maps within
//! 0.01 %. Reads no files, starts no threads, knows no renderer.
//!
//! | item | |
//! |---|---|
//! | [`Viewing`] | a display, the room's light, the distance; as text `desk` or `ppd=60,peak=300` |
//! | [`Chromaticities`] | its primaries and its white, where they are not those of sRGB |
//! | [`PRESETS`], [`Screen`] | viewing conditions by name; pixels per degree of a screen |
//! | [`VisionModel::compare`] | JODs and a map of two pictures |
//! | [`VisionModel::compare_frame`] | the same in a film, of which some of the difference stands still |
//! | [`VisionModel::residual`] | visible differences by band and channel in a tile, for stopping rules |
//! | [`rescaled`] | the same for noise of another contrast, without computing it again |
//! | [`VisionWorkspace`] | memory, used again from picture to picture |
//! | [`contrast_sensitivity`] | castleCSF by channel, frequency and luminance |
//!
//! The steps, in the order of the data: `photometry.rs` (code values → cd/m² → opponent channels),
//! `temporal.rs` (in films), `pyramid.rs`, `bands.rs` and `csf.rs` (contrast in units of its threshold),
//! `masking.rs`, `pooling.rs`; `engine.rs` puts them together.
//!
//! ```
//! use noisefloor_vision::{Viewing, VisionModel, VisionWorkspace};
//!
//! // A grey wall, and the same with noise
//! let wall = vec![[0.5; 3]; 64 * 64];
//! let grain = |i: usize| 0.02 * ((i * 7919 % 13) as f32 - 6.0) / 6.0;
//! let noisy: Vec<[f32; 3]> = (0..64 * 64).map(|i| [0.5 + grain(i); 3]).collect();
//!
//! let mut workspace = VisionWorkspace::default();
//! let mut jod = |viewing: &str| -> Result<f64, Box<dyn std::error::Error>> {
//!     let viewing: Viewing = viewing.parse()?;
//!     let model = VisionModel::new(&viewing);
//!     Ok(model.compare(&noisy, &wall, (64, 64), &mut workspace)?.jod())
//! };
//! // Seen from further away, the noise is less visible
//! assert!(jod("desk")? < jod("desk,distance=1.2")?);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod bands;
mod check;
mod chromaticity;
mod csf;
mod engine;
mod error;
mod lanes;
mod masking;
mod math;
mod model;
mod part;
mod photometry;
mod pooling;
mod presets;
mod pyramid;
mod residual;
mod screen;
mod temporal;
mod text;
mod viewing;
mod workspace;

pub use chromaticity::{Chromaticities, ChromaticityError};
pub use csf::{OpponentChannel, contrast_sensitivity};
pub use error::VisionError;
pub use model::{VisionComparison, VisionModel};
pub use presets::{PRESETS, ViewingPreset};
pub use residual::{
    DifferenceBand, ResidualPatch, ResidualPixels, VisibleDifference, VisionDetail, rescaled,
};
pub use screen::Screen;
pub use text::ViewingTextError;
pub use viewing::{Eotf, Primaries, Viewing, ViewingError, ViewingParams};
pub use workspace::VisionWorkspace;
