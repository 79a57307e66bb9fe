//! Pictures in and out, and stacks of pictures on disk played back as a source of samples.
//!
//! - [`read_picture`], [`read_exr`], [`read_pfm`], [`read_png`]: linear EXR and PFM and display-encoded PNG, told apart by content. Files are
//!   hostile until parsed: sizes are checked before pixels are allocated, and a broken file is a [`PictureError`].
//! - [`write_exr`], [`write_png`], [`write_atomic`], [`check_writable`]: files that appear whole or not at all.
//! - [`StackSource`]: a folder of images as a [`noisefloor::ProgressiveSource`].
//! - [`running_means`]: which samples are in which file of a stack, told by names.
//!
//! Nothing here accumulates, tone maps or judges.
//!
//! ```
//! use noisefloor::{ProgressiveSource, Request, TileGrid};
//! use noisefloor_image::{RenderLayers, StackSource, write_exr};
//!
//! // Two running means of the same render: of the first 10 and of the first 40 samples.
//! let folder = tempfile::tempdir()?;
//! for (spp, radiance) in [(10, 1.0), (40, 1.75)] {
//!     let rgb = vec![[radiance; 3]; 16 * 16];
//!     write_exr(folder.path().join(format!("{spp:05}.exr")), &RenderLayers::rgb(16, 16, &rgb))?;
//! }
//!
//! // Played back, they are two batches: samples 1…10, and the 30 samples after them.
//! let mut stack = StackSource::open(folder.path())?;
//! let tile = TileGrid::new(16, 16, 16)?.tile(0);
//! let batch = stack.sample(&[Request { tile, first: 10, samples: 100 }])?.remove(0);
//! assert_eq!((batch.samples, batch.mean[0]), (30, [2.0; 3]));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod decode_exr;
mod decode_pfm;
mod decode_png;
mod error;
mod frames;
mod picture;
mod stack;
mod write;

pub use decode_exr::read_exr;
pub use decode_pfm::read_pfm;
pub use decode_png::read_png;
pub use error::{PictureError, StackError, WriteError};
pub use frames::{Frame, batches, running_means};
pub use picture::{DisplayImage, LinearImage, MAX_FILE_BYTES, Picture, read_picture, read_picture_within};
pub use stack::StackSource;
pub use write::{RenderLayers, check_writable, write_atomic, write_exr, write_png};
