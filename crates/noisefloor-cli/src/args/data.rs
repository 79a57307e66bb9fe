//! Options about human thresholds, and about training on them.

use super::oracle::EvidenceChoice;
use super::viewing::ViewingArgs;
use clap::Args;
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
    /// σ of the noise mask, 0.3…1.5 pixels (for --corpus; a table has its own).
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

#[cfg(feature = "train")]
pub(super) use checks::check_data;

#[cfg(feature = "train")]
mod checks {
    use super::{DataArgs, SearchArgs};
    use crate::learning::{DataJob, DataSource};
    use anyhow::{Context, bail};
    use noisefloor::{Descriptor, NoiseMask, SvmParams};
    use noisefloor_learn::TrainParams;

    /// What to learn from or to score, and how to train on it.
    pub(in crate::args) fn check_data(
        data: DataArgs,
        search: &SearchArgs,
    ) -> anyhow::Result<(DataJob, TrainParams)> {
        let params = candidates(search)?;
        let mask = NoiseMask::try_from(search.sigma).context("--sigma")?;
        let source = match data.table {
            Some(path) => DataSource::Table(path),
            None => DataSource::Corpora(data.corpus),
        };
        let descriptor = Descriptor::compact(mask);
        let viewing = search.viewing.or_default();
        Ok((DataJob { source, descriptor, evidence: search.evidence.into(), viewing }, params))
    }

    fn candidates(search: &SearchArgs) -> anyhow::Result<TrainParams> {
        let mut params = TrainParams::default();
        let given = |values: &[f64], default: fn(&SvmParams) -> f64| -> Vec<f64> {
            if !values.is_empty() {
                return values.to_vec();
            }
            let mut all: Vec<f64> = TrainParams::default().candidates.iter().map(default).collect();
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
