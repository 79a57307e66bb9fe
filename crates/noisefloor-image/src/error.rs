//! What can go wrong with picture files. Every message says what, where, and what to do.

use noisefloor::tile::TileError;
use std::io;
use std::path::PathBuf;
use thiserror::Error;

/// Why a picture could not be read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PictureError {
    /// The operating system could not read it.
    #[error("{}: cannot be read: {source}; check the path and its permissions", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// Not the expected format.
    #[error("{}: is {found}, not {wanted}; the content tells the format, not the name", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// What it looks like.
        found: &'static str,
        /// What it should be.
        wanted: &'static str,
    },
    /// A file that stands for the picture: a pointer of Git LFS or git-annex, or a web page.
    #[error("{}: {instead}", path.display())]
    StandIn {
        /// The file.
        path: PathBuf,
        /// What it is, and what to do.
        instead: &'static str,
    },
    /// The file is longer than [`MAX_FILE_BYTES`](crate::MAX_FILE_BYTES).
    #[error(
        "{}: {bytes} bytes exceed the limit of {limit}; save fewer layers or a smaller image",
        path.display()
    )]
    Long {
        /// The file.
        path: PathBuf,
        /// Its length in bytes.
        bytes: u64,
        /// The limit in bytes.
        limit: u64,
    },
    /// The header names a size outside the limits of [`noisefloor::tile`]; no pixel was allocated.
    #[error("{}: {source}; crop or scale the image", path.display())]
    Size {
        /// The file.
        path: PathBuf,
        /// The size, and the limits.
        source: TileError,
    },
    /// More pixels than the caller accepts; none was allocated.
    #[error(
        "{}: {width}×{height} pixels exceed the limit of {most} pixels here; crop the image",
        path.display()
    )]
    Large {
        /// The file.
        path: PathBuf,
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
        /// Most pixels.
        most: usize,
    },
    /// The image is within the limits, but its memory could not be allocated.
    #[error(
        "{}: no memory for {width}×{height} pixels; close other programs or use a smaller image",
        path.display()
    )]
    Memory {
        /// The file.
        path: PathBuf,
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// The file is cut short or corrupt.
    #[error("{}: broken {format} file: {reason}; write it again", path.display())]
    Broken {
        /// The file.
        path: PathBuf,
        /// `"EXR"`, `"PFM"` or `"PNG"`.
        format: &'static str,
        /// What the decoder found.
        reason: String,
    },
    /// The EXR has no part with R, G and B, nor a luminance channel Y.
    #[error(
        "{}: no colour: channel {missing} is missing (it has {found}); save R, G and B, or only Y for grey",
        path.display()
    )]
    Channels {
        /// The file.
        path: PathBuf,
        /// Names of the missing channels, comma-separated.
        missing: String,
        /// Names of the existing channels, comma-separated, at most twenty.
        found: String,
    },
    /// It has several layers, none of which is known to be the picture, and nobody said which is meant.
    #[error(
        "{}: has the layers {found}, and does not say which is the picture; save that one by itself, \
         or name it by --layer in `judge` and `metrics`",
        path.display()
    )]
    Layers {
        /// The file.
        path: PathBuf,
        /// Names of the layers that have colours, comma-separated, at most twenty.
        found: String,
    },
    /// It has no colours in the layer that was asked for, or in more than one that is called so.
    #[error("{}: the layer {layer:?} is not one of those with R, G and B: {found}", path.display())]
    NoLayer {
        /// The file.
        path: PathBuf,
        /// The layer.
        layer: String,
        /// As above.
        found: String,
    },
    /// It does not say how many samples it has, and nobody else did.
    #[error("{}: does not say how many samples per pixel it has; give the number with --spp", path.display())]
    NoSamples {
        /// The file.
        path: PathBuf,
    },
    /// Its tiles have different numbers of samples, and one for all is needed.
    #[error(
        "{}: has {fewest} to {most} samples per pixel, not the same everywhere; \
         judge a picture rendered with --criterion spp:N, or give one number with --spp",
        path.display()
    )]
    UnevenSamples {
        /// The file.
        path: PathBuf,
        /// Fewest samples per pixel of a tile.
        fewest: u64,
        /// Most samples per pixel of a tile.
        most: u64,
    },
    /// It states colours that are not converted.
    #[error("{}: states {stated}; {advice}", path.display())]
    Colours {
        /// The file.
        path: PathBuf,
        /// The colours.
        stated: String,
        /// What to do about it.
        advice: &'static str,
    },
    /// A valid file that uses a feature this crate does not read.
    #[error("{}: {what}; {advice}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// The feature.
        what: &'static str,
        /// What to do about it.
        advice: &'static str,
    },
}

/// Why a file could not be written. An existing file is unchanged.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum WriteError {
    /// The folder does not exist or is not writable.
    #[error(
        "{}: cannot write into folder {}: {source}; choose a folder that exists and is writable",
        path.display(),
        folder.display()
    )]
    Folder {
        /// The file wanted.
        path: PathBuf,
        /// Its folder.
        folder: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// The path names something that a file must not replace.
    #[error("{}: is a folder or a device; choose another name", path.display())]
    NotAFile {
        /// The path wanted.
        path: PathBuf,
    },
    /// The number of values does not match the size.
    #[error(
        "{}: {what} holds {got} values, {width}×{height} pixels need {want}; pass one value per pixel",
        path.display()
    )]
    Size {
        /// The file wanted.
        path: PathBuf,
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
    #[error("{}: {source}; write a smaller image", path.display())]
    Image {
        /// The file wanted.
        path: PathBuf,
        /// The size, and the limits.
        source: TileError,
    },
    /// The image is empty, or larger than a PNG can be.
    #[error("{}: a PNG cannot hold {width}×{height} pixels; each edge must be 1…2147483647", path.display())]
    Png {
        /// The file wanted.
        path: PathBuf,
        /// Width in pixels.
        width: usize,
        /// Height in pixels.
        height: usize,
    },
    /// Writing failed half-way.
    #[error("{}: not written: {source}; check the space on the disk", path.display())]
    Failed {
        /// The file wanted.
        path: PathBuf,
        /// What went wrong.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

/// Why a folder is not a stack, or cannot be played back.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StackError {
    /// The folder cannot be listed.
    #[error("{}: cannot list the folder: {source}; check the path and its permissions", dir.display())]
    Folder {
        /// The folder.
        dir: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// An image of the stack cannot be read.
    #[error("{}: cannot be read: {source}", path.display())]
    Unreadable {
        /// The image.
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// No image in the folder is named as one of a stack.
    #[error(
        "{}: no stack here; name images by their samples per pixel (00100.png, 00100.exr) \
         or batch_<first>_<last>.exr",
        dir.display()
    )]
    Nothing {
        /// The folder.
        dir: PathBuf,
    },
    /// The folder holds images of both layouts.
    #[error("{}: holds both running means and batch_*.exr; keep them in separate folders", dir.display())]
    Ambiguous {
        /// The folder.
        dir: PathBuf,
    },
    /// A name that does not say which samples are in the image.
    #[error(
        "{}: {why}; expected NNNNN.png or NNNNN.exr with at least 1 sample, \
         or batch_<first>_<last>.exr with first < last",
        path.display()
    )]
    Name {
        /// The file.
        path: PathBuf,
        /// What is wrong with its name.
        why: &'static str,
    },
    /// The first batch does not start at sample 0.
    #[error("{}: the first batch starts at sample {first}, not 0; add the batches before it", path.display())]
    Start {
        /// The first batch.
        path: PathBuf,
        /// Where it starts.
        first: u64,
    },
    /// Samples are missing between two batches.
    #[error(
        "samples {from} to {to} are missing between {} and {}; add the batch or remove all after it",
        before.display(),
        after.display()
    )]
    Gap {
        /// The batch before the gap.
        before: PathBuf,
        /// The batch after it.
        after: PathBuf,
        /// Samples before the gap.
        from: u64,
        /// Samples before the next batch.
        to: u64,
    },
    /// Two images hold the same samples.
    #[error("{} and {} hold the same samples; remove one", one.display(), other.display())]
    Overlap {
        /// One image.
        one: PathBuf,
        /// The other.
        other: PathBuf,
    },
    /// An image differs in size from the rest of its stack.
    #[error(
        "{}: {got_width}×{got_height} pixels, but its stack has {width}×{height}; \
         render it again at that size",
        path.display()
    )]
    Size {
        /// The image.
        path: PathBuf,
        /// The stack's width in pixels.
        width: usize,
        /// The stack's height in pixels.
        height: usize,
        /// The image's width in pixels.
        got_width: usize,
        /// The image's height in pixels.
        got_height: usize,
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
        "a tile of {tile_width}×{tile_height} pixels at {x}, {y} is not inside the {width}×{height} image; \
         cut tiles with a TileGrid of that size"
    )]
    Tile {
        /// Left edge in pixels.
        x: usize,
        /// Top edge in pixels.
        y: usize,
        /// The tile's width in pixels.
        tile_width: usize,
        /// The tile's height in pixels.
        tile_height: usize,
        /// The image's width in pixels.
        width: usize,
        /// The image's height in pixels.
        height: usize,
    },
    /// An image could not be read.
    #[error(transparent)]
    Picture(#[from] PictureError),
}
