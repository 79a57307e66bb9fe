//! What can go wrong with picture files. Every message says what, where, and what to do.

use noisefloor::{Tile, tile::TileError};
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a picture could not be read.
#[derive(Debug, Error)]
#[error("{}: {fault}", path.display())]
pub struct PictureError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    pub fault: PictureFault,
}

/// What is wrong with a picture.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PictureFault {
    /// The operating system could not read it.
    #[error("cannot be read: {0}; check the path and its permissions")]
    Io(io::Error),
    /// Not the expected format.
    #[error("is {found}, not {wanted}; the content tells the format, not the name")]
    Foreign {
        /// What it looks like.
        found: &'static str,
        /// What it should be.
        wanted: &'static str,
    },
    /// A file that stands for the picture: a pointer of Git LFS or git-annex, or a web page. It says what it is, and what
    /// to do.
    #[error("{0}")]
    StandIn(&'static str),
    /// The file is longer than [`MAX_FILE_BYTES`](crate::MAX_FILE_BYTES).
    #[error("{bytes} bytes exceed the limit of {limit}; save fewer layers or a smaller image")]
    Long {
        /// Its length in bytes.
        bytes: u64,
        /// The limit in bytes.
        limit: u64,
    },
    /// The header names a size outside the limits of [`noisefloor::tile`]; no pixel was allocated.
    #[error("{0}; crop or scale the image")]
    Size(TileError),
    /// More pixels than the caller accepts; none was allocated.
    #[error("{width}×{height} pixels exceed the limit of {most} pixels here; crop the image")]
    Large {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
        /// Most pixels.
        most: usize,
    },
    /// The image is within the limits, but its memory could not be allocated.
    #[error("no memory for {width}×{height} pixels; close other programs or use a smaller image")]
    Memory {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// The file is cut short or corrupt.
    #[error("broken {format} file: {reason}; write it again")]
    Broken {
        /// `"EXR"`, `"PFM"` or `"PNG"`.
        format: &'static str,
        /// What the decoder found.
        reason: String,
    },
    /// The EXR has no part with R, G and B, nor a luminance channel Y.
    #[error("no colour: channel {missing} is missing (it has {found}); save R, G and B, or only Y for grey")]
    Channels {
        /// Names of the missing channels, comma-separated.
        missing: String,
        /// Names of the existing channels, comma-separated, at most twenty.
        found: String,
    },
    /// It has several layers, none of which is known to be the picture, and nobody said which is meant: names of the layers
    /// that have colours, comma-separated, at most twenty.
    #[error(
        "has the layers {0}, and does not say which is the picture; save that one by itself, \
         or name it by --layer in `judge` and `metrics`"
    )]
    Layers(String),
    /// It has no colours in the layer that was asked for, or in more than one that is called so.
    #[error("the layer {layer:?} is not one of those with R, G and B: {found}")]
    NoLayer {
        /// The layer.
        layer: String,
        /// As of [`Self::Layers`].
        found: String,
    },
    /// It does not say how many samples it has, and nobody else did.
    #[error("does not say how many samples per pixel it has; give the number with --spp")]
    NoSamples,
    /// Its tiles have different numbers of samples, and one for all is needed.
    #[error(
        "has {fewest} to {most} samples per pixel, not the same everywhere; \
         judge a picture rendered with --criterion spp:N, or give one number with --spp"
    )]
    UnevenSamples {
        /// Fewest samples per pixel of a tile.
        fewest: u64,
        /// Most samples per pixel of a tile.
        most: u64,
    },
    /// It states colours that are not converted.
    #[error("states {stated}; {advice}")]
    Colours {
        /// The colours.
        stated: String,
        /// What to do about it.
        advice: &'static str,
    },
    /// A valid file that uses a feature this crate does not read.
    #[error("{what}; {advice}")]
    Unsupported {
        /// The feature.
        what: &'static str,
        /// What to do about it.
        advice: &'static str,
    },
}

impl PictureFault {
    pub(crate) fn of(self, path: &Path) -> PictureError {
        PictureError { path: path.to_owned(), fault: self }
    }
}

/// Why a file could not be written. An existing file is unchanged.
#[derive(Debug, Error)]
#[error("{}: {fault}", path.display())]
pub struct WriteError {
    /// The file wanted.
    pub path: PathBuf,
    /// What went wrong.
    #[source]
    pub fault: WriteFault,
}

/// What went wrong with writing a file.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum WriteFault {
    /// The folder does not exist or is not writable.
    #[error("cannot write into folder {}: {source}; choose a folder that exists and is writable", folder.display())]
    Folder {
        /// Its folder.
        folder: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The path names something that a file must not replace.
    #[error("is a folder or a device; choose another name")]
    NotAFile,
    /// The number of values does not match the size.
    #[error("{what} holds {got} values, {width}×{height} pixels need {want}; pass one value per pixel")]
    Size {
        /// Which of the arguments.
        what: &'static str,
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
        /// Values passed.
        got: usize,
        /// Values needed.
        want: usize,
    },
    /// The image is empty or larger than [`noisefloor::tile`] allows.
    #[error("{0}; write a smaller image")]
    Image(TileError),
    /// The image is empty, or larger than a PNG can be.
    #[error("a PNG cannot hold {width}×{height} pixels; each edge must be 1…2147483647")]
    Png {
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// Writing failed half-way.
    #[error("not written: {0}; check the space on the disk")]
    Failed(#[source] Box<dyn std::error::Error + Send + Sync>),
}

impl WriteFault {
    pub(crate) fn of(self, path: &Path) -> WriteError {
        WriteError { path: path.to_owned(), fault: self }
    }
}

/// Why a folder is not a stack, or cannot be played back.
#[derive(Debug, Error)]
#[error("{}: {fault}", path.display())]
pub struct StackError {
    /// The folder, or the image that is wrong.
    pub path: PathBuf,
    /// What is wrong with it.
    pub fault: StackFault,
}

/// What is wrong with a stack.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StackFault {
    /// The folder cannot be listed.
    #[error("cannot list the folder: {0}; check the path and its permissions")]
    Folder(io::Error),
    /// No image in the folder is named as one of a stack.
    #[error(
        "no stack here; name images by their samples per pixel (00100.png, 00100.exr) \
         or batch_<first>_<last>.exr"
    )]
    Nothing,
    /// The folder holds images of both layouts.
    #[error("holds both running means and batch_*.exr; keep them in separate folders")]
    Ambiguous,
    /// A name that does not say which samples are in the image, and why.
    #[error(
        "{0}; expected NNNNN.png or NNNNN.exr with at least 1 sample, \
         or batch_<first>_<last>.exr with first < last"
    )]
    Name(&'static str),
    /// The first batch does not start at sample 0, but here.
    #[error("the first batch starts at sample {0}, not 0; add the batches before it")]
    Start(u64),
    /// Samples are missing between a batch and the next.
    #[error(
        "samples {from} to {to} are missing between this batch and {}; add the batch or remove all after it",
        next.display()
    )]
    Gap {
        /// The batch after the gap.
        next: PathBuf,
        /// Samples before the gap.
        from: u64,
        /// Samples before the next batch.
        to: u64,
    },
    /// Another image holds the same samples.
    #[error("holds samples that are in {}, too; remove one", .0.display())]
    Overlap(PathBuf),
    /// An image differs in size from the rest of its stack.
    #[error(
        "{}×{} pixels, but its stack has {}×{}; render it again at that size", got.0, got.1, size.0, size.1
    )]
    Size {
        /// The stack's width and height in pixels.
        size: (usize, usize),
        /// The image's.
        got: (usize, usize),
    },
    /// A request for samples from the middle of a stored batch.
    #[error(
        "no stored batch starts at sample {first}; a stack is played back batch by batch from 0: \
         {near} is the nearest start"
    )]
    Boundary {
        /// The first sample asked for.
        first: u64,
        /// The nearest start of a batch, or the end of the stack.
        near: u64,
    },
    /// A request for a tile that is not inside the image.
    #[error(
        "a tile of {}×{} pixels at {}, {} is not inside the {}×{} image; cut tiles with a TileGrid of that size",
        tile.width, tile.height, tile.x, tile.y, size.0, size.1
    )]
    Tile {
        /// The tile.
        tile: Tile,
        /// The image's width and height in pixels.
        size: (usize, usize),
    },
    /// An image could not be read.
    #[error(transparent)]
    Picture(PictureFault),
}

impl StackFault {
    /// What is wrong with this folder or image.
    pub fn of(self, path: &Path) -> StackError {
        StackError { path: path.to_owned(), fault: self }
    }
}

impl From<PictureError> for StackError {
    fn from(PictureError { path, fault }: PictureError) -> Self {
        Self { path, fault: StackFault::Picture(fault) }
    }
}
