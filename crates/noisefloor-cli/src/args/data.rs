//! Options about human thresholds, and about training on them.

use super::oracle::EvidenceChoice;
use super::viewing::ViewingArgs;
use clap::{Args, ValueEnum};
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
    /// What is computed from a tile (for --corpus; a table has its own).
    #[arg(long, value_enum, default_value_t = DescriptorChoice::Compact)]
    pub(super) descriptor: DescriptorChoice,
    /// What is trained [default: line for the visible descriptor and for --nested, svm otherwise; a table does
    /// not say].
    #[arg(long, value_enum)]
    pub(super) machine: Option<MachineChoice>,
    /// σ of the noise mask of the compact descriptor, 0.3…1.5 pixels (for --corpus; a table has its own).
    #[arg(long, default_value_t = 1.0, value_name = "PIXELS")]
    pub(super) sigma: f32,
    /// What tiles are compared with (for --corpus; a table has its own).
    #[arg(long, value_enum, default_value_t = EvidenceChoice::Halves)]
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

/// The descriptors that models can be trained with.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum DescriptorChoice {
    /// How many times too strong the noise is by a model of human vision, in the tile and its picture.
    Visible,
    /// Visible noise by constants of our own; knows no viewing conditions.
    Compact,
}

#[cfg(feature = "train")]
pub(super) use checks::check_data;

#[cfg(feature = "train")]
mod checks {
    use super::{DataArgs, DescriptorChoice, MachineChoice, SearchArgs};
    use crate::learning::{DataJob, DataSource};
    use anyhow::{Context, bail};
    use noisefloor::{Descriptor, NoiseMask, SvmParams};
    use noisefloor_learn::TrainParams;

    /// What to learn from or to score, and how to train on it.
    pub(in crate::args) fn check_data(
        data: DataArgs,
        search: &SearchArgs,
        nested: bool,
    ) -> anyhow::Result<(DataJob, TrainParams)> {
        let line = nested || search.descriptor == DescriptorChoice::Visible;
        let machine = search.machine.unwrap_or(if line { MachineChoice::Line } else { MachineChoice::Svm });
        let params = candidates(search, machine)?;
        let mask = NoiseMask::try_from(search.sigma).context("--sigma")?;
        let source = match data.table {
            Some(path) => DataSource::Table(path),
            None => DataSource::Corpora(data.corpus),
        };
        let descriptor = match search.descriptor {
            DescriptorChoice::Visible => Descriptor::visible(),
            DescriptorChoice::Compact => Descriptor::compact(mask),
        };
        let (evidence, viewing) = (search.evidence.into(), search.viewing.or_default());
        Ok((DataJob { source, descriptor, evidence, viewing }, params))
    }

    fn candidates(search: &SearchArgs, machine: MachineChoice) -> anyhow::Result<TrainParams> {
        let mut params = match machine {
            MachineChoice::Svm => TrainParams::default(),
            MachineChoice::Line => TrainParams::line(),
        };
        let defaults = params.candidates.clone();
        let given = |values: &[f64], default: fn(&SvmParams) -> f64| -> Vec<f64> {
            if !values.is_empty() {
                return values.to_vec();
            }
            let mut all: Vec<f64> = defaults.iter().map(default).collect();
            all.sort_by(f64::total_cmp);
            all.dedup();
            all
        };
        let (cs, gammas) = (given(&search.c, |p| p.c), given(&search.gamma, |p| p.gamma));
        if let Some(bad) = cs.iter().chain(&gammas).find(|v| !(v.is_finite() && **v > 0.0)) {
            bail!("C and γ must be positive numbers, not {bad}");
        }
        params.candidates =
            cs.iter().flat_map(|&c| gammas.iter().map(move |&gamma| SvmParams { c, gamma })).collect();
        Ok(params)
    }
}
