//! Tests of noisefloor-exr, one module a subject.

/// Programs that render into files.
#[cfg(test)]
mod command;
/// Thresholds and the images they belong to.
#[cfg(test)]
mod corpus;
/// Broken files: every byte flip and cut is an error or a picture, never a panic.
#[cfg(test)]
mod hostile;
/// The paper's pairs.
#[cfg(test)]
mod pairs;
/// What is read from PFM, and what is refused.
#[cfg(test)]
mod pfm;
/// What is read from EXR and PNG.
#[cfg(test)]
mod read;
/// The human data in `../shared`, where they are.
#[cfg(test)]
mod shared;
/// Playback of stacks.
#[cfg(test)]
mod stack;
/// Files that others make, for the tests to read.
#[cfg(test)]
mod util;
/// Round trips and atomic writing.
#[cfg(test)]
mod write;
