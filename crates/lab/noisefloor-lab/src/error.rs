//! Why an experiment failed.

use noisefloor::{
    SessionError, SourceError, criterion::CriterionError, film::FilmError, params::ParamsError,
    tile::TileError,
};
use noisefloor_denoise::DenoiseError;
use noisefloor_image::{PictureError, WriteError};
use noisefloor_learn::{CorpusError, SvmTrainError, TableError};
use noisefloor_rivals::MetricError;
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
    Criterion(#[from] CriterionError),
    #[error(transparent)]
    Params(#[from] ParamsError),
    /// The picture or its tiles have a size out of range.
    #[error(transparent)]
    Tile(#[from] TileError),
    #[error(transparent)]
    Film(#[from] FilmError),
    /// Pictures that a metric cannot compare.
    #[error(transparent)]
    Metric(#[from] MetricError),
    /// A picture could not be denoised.
    #[error(transparent)]
    Denoise(#[from] DenoiseError),
    /// A picture could not be read.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// A file could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A corpus of human thresholds could not be read.
    #[error(transparent)]
    Corpus(#[from] CorpusError),
    /// A corpus could not be described.
    #[error(transparent)]
    Table(#[from] TableError),
    /// A machine could not be trained.
    #[error("{machine}: {source}")]
    Train { machine: String, source: SvmTrainError },
    /// A folder could not be made or read.
    #[error("{}: this folder cannot be made or read: {source}", path.display())]
    Folder {
        path: PathBuf,
        /// The error of the operating system.
        source: io::Error,
    },
    /// A plot could not be drawn.
    #[error("the plot cannot be drawn: {0}")]
    Plot(String),
    /// The source gave no samples at all.
    #[error("the source gave no samples")]
    NoSamples,
    /// The source ran out of samples before the reference had enough.
    #[error(
        "the source has only {spp} samples per pixel: give a converged picture, or ask for fewer samples of the reference"
    )]
    ShortOfSamples {
        /// Samples per pixel that there are.
        spp: u64,
    },
    /// The reference was cancelled; what there is of it is kept.
    #[error("the reference is not finished: what there is of it is kept in {}, and the next run resumes it", path.display())]
    Cancelled { path: PathBuf },
    /// The kept reference is of something else.
    #[error("{}: is another reference: {what}; choose another folder, or overwrite it with --force", path.display())]
    OtherReference { path: PathBuf, what: String },
    /// A kept reference is not what the file beside it says.
    #[error("{}: is not the picture that reference.json describes; remove both, or use --force", path.display())]
    KeptReference { path: PathBuf },
    /// Zones that do not make one picture.
    #[error("{scene}: its zones are not squares of one size, which rivals need")]
    Zones { scene: String },
    /// Too few images to know the noise of a scene.
    #[error("{scene}: too few images to tell its noise from its picture")]
    TooFewImages { scene: String },
    /// Too few groups of scenes to leave some out.
    #[error("leaving scenes out needs at least 3 groups of scenes; the corpus has {found}: {names}")]
    TooFewGroups { found: usize, names: String },
    /// A subset of more pairs than there are.
    #[error("a subset of {asked} pairs is too large: at most {most}, half of the {all} pairs that there are")]
    Subset { asked: usize, most: usize, all: usize },
    /// A result that was written reads back as another one.
    #[error("{}: has been changed since it was written; run again", path.display())]
    Changed { path: PathBuf },
}
