//! Tests of noisefloor-image, one module a subject.

/// Colours that files state.
#[cfg(test)]
mod colours;
/// LUTs: known answers, and what is refused.
#[cfg(test)]
mod cube;
/// What EXRs say of their samples.
#[cfg(test)]
mod facts;
/// Broken files: every byte flip and cut is an error or a picture, never a panic.
#[cfg(test)]
mod hostile;
/// What is read from PFM, and what is refused.
#[cfg(test)]
mod pfm;
/// What is read from EXR and PNG.
#[cfg(test)]
mod read;
/// Playback of stacks.
#[cfg(test)]
mod stack;
/// Files that others make, for the tests to read.
#[cfg(test)]
mod util;
/// Round trips and atomic writing.
#[cfg(test)]
mod write;
