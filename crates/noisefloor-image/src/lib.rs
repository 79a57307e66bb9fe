//! Pictures on disk, and stacks of them played back as a source of samples.
//!
//! - [`read_picture`], [`read_exr`], [`read_pfm`], [`read_png`]: linear EXR and PFM, display-encoded PNG. The
//!   content tells the format. Colours that a file states become those of Rec.709 or sRGB. Files may be
//!   hostile: sizes are checked before pixels are allocated, and a broken file is a [`PictureError`].
//! - [`read_facts`], [`read_still`]: what an EXR says of its samples, and a picture with them.
//! - [`read_unread`]: what is ignored of a file: alpha and further layers.
//! - [`write_exr`], [`write_png`], [`write_atomic`], [`check_writable`]: files that appear complete or not at
//!   all.
//! - [`read_cube`]: a `.cube` LUT, and as a tone mapping ([`ColourLut::into_tone_curve`]).
//! - `maps`, behind the feature of that name: numbers drawn over a picture, in colours, with a legend.
//! - [`StackSource`]: a folder of images as a [`noisefloor::ProgressiveSource`].
//! - [`running_means`], [`batches`]: which samples are in which file of a stack.
//!
//! Nothing here accumulates or judges.
//!
//! ```
//! use noisefloor::{ProgressiveSource, Request, TileGrid};
//! use noisefloor_image::{RenderLayers, StackSource, write_exr};
//!
//! // Two running means of one render: of its first 10 and of its first 40 samples.
//! let folder = tempfile::tempdir()?;
//! for (spp, radiance) in [(10, 1.0), (40, 1.75)] {
//!     let rgb = vec![[radiance; 3]; 16 * 16];
//!     write_exr(folder.path().join(format!("{spp:05}.exr")), &RenderLayers::rgb(16, 16, &rgb))?;
//! }
//!
//! // Played back, they are two batches: samples 1…10, and the 30 samples after them.
//! let mut stack = StackSource::open(folder.path())?;
//! let tile = TileGrid::new(16, 16, 16)?.tile(0);
//! let batch = stack.sample(&[Request::new(tile, 10, 100)])?.remove(0);
//! assert_eq!((batch.spp, batch.mean[0]), (30, [2.0; 3]));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod atomic;
mod colours;
mod cube;
mod decode_exr;
mod decode_pfm;
mod decode_png;
mod error;
mod facts;
mod frames;
#[cfg(feature = "maps")]
pub mod maps;
mod open;
mod picture;
mod plane;
#[cfg(feature = "profiles")]
mod profile;
mod read;
mod stack;
#[cfg(feature = "tables")]
mod table;
mod unread;
mod write;

pub use atomic::{check_writable, write_atomic};
pub use cube::read_cube;
pub use decode_exr::read_exr;
pub use decode_pfm::read_pfm;
pub use decode_png::read_png;
pub use error::{PictureError, PictureFault, StackError, StackFault, WriteError, WriteFault};
pub use facts::{SampleFacts, read_facts};
pub use frames::{Frame, batches, running_means};
#[doc(inline)]
pub use noisefloor::display::{ColourLut, CubeError, LutInput, LutInputError};
pub use open::{MAX_FILE_BYTES, ReadOptions};
pub use picture::{DisplayImage, LinearImage, Picture};
pub use plane::Plane;
pub use read::{read_picture, read_picture_with, read_still, read_still_with};
pub use stack::StackSource;
#[cfg(feature = "tables")]
pub use table::write_csv;
pub use unread::{Unread, read_unread};
pub use write::{RenderLayers, write_exr, write_png};
