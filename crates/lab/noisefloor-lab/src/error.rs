//! Why an experiment failed.

use noisefloor::{SessionError, SourceError, film::FilmError, tile::TileError};
use noisefloor_denoise::DenoiseError;
use noisefloor_image::{PictureError, WriteError};
use noisefloor_learn::{CorpusError, SvmTrainError, TableError};
use noisefloor_rivals::MetricError;
use plotters::drawing::DrawingAreaErrorKind;
use std::io;
use std::path::PathBuf;
use thiserror::Error;

#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LabError {
    #[error(transparent)]
    Source(#[from] SourceError),
    #[error(transparent)]
    Session(#[from] SessionError),
    #[error(transparent)]
    Tile(#[from] TileError),
    #[error(transparent)]
    Film(#[from] FilmError),
    #[error(transparent)]
    Metric(#[from] MetricError),
    #[error(transparent)]
    Denoise(#[from] DenoiseError),
    #[error(transparent)]
    Picture(#[from] PictureError),
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error(transparent)]
    Corpus(#[from] CorpusError),
    #[error(transparent)]
    Table(#[from] TableError),
    #[error("{machine}: {source}")]
    Train { machine: String, source: SvmTrainError },
    #[error("{}: this folder cannot be made or read: {source}", path.display())]
    Folder {
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    #[error("the plot cannot be drawn: {0}")]
    Plot(String),
    #[error("the source gave no samples")]
    NoSamples,
    #[error(
        "the source has only {spp} samples per pixel: give a converged picture, or ask for fewer samples of the reference"
    )]
    ShortOfSamples {
        /// Samples per pixel that there are.
        spp: u64,
    },
    #[error("the reference is not finished: what there is of it is kept in {}, and the next run resumes it", path.display())]
    Cancelled { path: PathBuf },
    #[error("{}: is another reference: {what}; choose another folder, or overwrite it with --force", path.display())]
    OtherReference { path: PathBuf, what: String },
    #[error("{}: is not the picture that reference.json describes; remove both, or use --force", path.display())]
    KeptReference { path: PathBuf },
    #[error("{scene}: its zones are not squares of one size, which rivals need")]
    Zones { scene: String },
    #[error("{scene}: too few images to tell its noise from its picture")]
    TooFewImages { scene: String },
    #[error("leaving scenes out needs at least 3 groups of scenes; the corpus has {found}: {names}")]
    TooFewGroups { found: usize, names: String },
    /// A result that was written reads back as another one.
    #[error("{}: has been changed since it was written; run again", path.display())]
    Changed { path: PathBuf },
}

impl<E: std::error::Error + Send + Sync> From<DrawingAreaErrorKind<E>> for LabError {
    fn from(error: DrawingAreaErrorKind<E>) -> Self {
        Self::Plot(error.to_string())
    }
}
