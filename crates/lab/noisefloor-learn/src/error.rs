//! Why a table could not be computed, read or written.

use crate::corpus::CorpusError;
use thiserror::Error;

/// Why a table could not be computed, read or written.
#[derive(Debug, Error)]
pub enum TableError {
    #[error(transparent)]
    Corpus(#[from] CorpusError),
    #[error(
        "{scene}, zone {zone}: {images} images are too few; two independent sets of samples and a converged picture are needed"
    )]
    TooFew { scene: String, zone: u32, images: usize },
    #[error("{scene}, zone {zone}: reference.exr has not the size of the full picture")]
    Reference { scene: String, zone: u32 },
    /// The descriptor is for tiles of another size.
    #[error("{scene}, zone {zone}: {source}")]
    Descriptor { scene: String, zone: u32, source: noisefloor::descriptor::DescriptorError },
    #[error("line {line}: {what}")]
    Row {
        /// Line, from 1.
        line: u64,
        what: String,
    },
    #[error("the table cannot be read or written: {0}")]
    Csv(#[from] csv::Error),
}
