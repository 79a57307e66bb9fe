//! Options about human thresholds, and about training on them.

use crate::learning::{DataJob, DataSource, SearchJob};
use anyhow::bail;
use clap::{Args, ValueEnum};
use noisefloor::descriptor::Descriptor;
use noisefloor_cli::options::oracle::EvidenceChoice;
use noisefloor_cli::options::viewing::ViewingArgs;
use noisefloor_learn::Learner;
use std::path::PathBuf;

/// Where the human thresholds are.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
pub struct DataArgs {
    /// Corpus folders.
    #[arg(long, value_name = "DIR", num_args = 1..)]
    pub(super) corpus: Vec<PathBuf>,
    /// Table of descriptors, written by `train --save-table`.
    #[arg(long, value_name = "FILE.csv")]
    pub(super) table: Option<PathBuf>,
}

/// How to train.
#[derive(Debug, Args)]
pub struct SearchArgs {
    /// What is trained [default: line for the visible descriptor, svm for others].
    #[arg(long, value_enum)]
    pub(super) machine: Option<MachineChoice>,
    /// What tiles are compared with (for --corpus; a table has its own).
    #[arg(long, value_enum, default_value_t = EvidenceChoice::Halves, conflicts_with = "table")]
    pub(super) evidence: EvidenceChoice,
    #[command(flatten)]
    pub(super) viewing: ViewingArgs,
    /// Values of C to choose from [default: a grid].
    #[arg(long, value_delimiter = ',', value_name = "C,…")]
    pub(super) c: Vec<f64>,
    /// Values of γ to choose from [default: a grid].
    #[arg(long, value_delimiter = ',', value_name = "G,…")]
    pub(super) gamma: Vec<f64>,
}

/// The machines that can be trained.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum MachineChoice {
    /// A support vector machine.
    Svm,
    /// Logistic regression: a straight line.
    Line,
}

/// What to learn from or to score, and how to train on it.
pub fn check_data(data: DataArgs, search: SearchArgs) -> anyhow::Result<(DataJob, SearchJob)> {
    let source = match data.table {
        Some(path) => DataSource::Table(path),
        None => DataSource::Corpora(data.corpus),
    };
    let descriptor = Descriptor::visible();
    let (evidence, viewing) = (search.evidence.into(), search.viewing.or_default());
    let learner = search.machine.map(|machine| match machine {
        MachineChoice::Svm => Learner::Svm,
        MachineChoice::Line => Learner::Line,
    });
    let (c, gamma) = (search.c, search.gamma);
    if let Some(bad) = c.iter().chain(&gamma).find(|v| !(v.is_finite() && **v > 0.0)) {
        bail!("C and γ must be positive numbers, not {bad}");
    }
    Ok((DataJob { source, descriptor, evidence, viewing }, SearchJob { learner, c, gamma }))
}
