//! One protocol, carried out.

use super::job::Geometry;
use super::pairs::{PairScaling, Pairs};
use super::protocol::{PairProtocol, Split};
use super::solver::{Weights, fit_weights};
use crate::advance::{Advance, Watch};
use crate::error::LabError;
use ndarray::Axis;
use noisefloor::descriptor::{Descriptor, DescriptorSpec};
use noisefloor_learn::{SvmParams, SvmTrainError};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use statrs::statistics::{Data, Median};
use std::fs::File;
use std::io::Read;
use std::iter::Sum;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

/// Machines that train at once: the solver runs in one thread, and each holds two matrices of up to 0.7 GB.
const AT_ONCE: usize = 2;
const QUERIES: usize = 15;
/// Longest result that is read, in bytes.
const MAX_BYTES: u64 = 1 << 20;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fingerprint {
    /// Of all pairs and their labels.
    pub table_digest: String,
    pub pairs: DescriptorSpec,
    /// What is written into the rows.
    pub scaling: PairScaling,
    pub protocol: PairProtocol,
    pub params: SvmParams,
    pub version: String,
}

impl Fingerprint {
    pub(super) fn new(
        digest: &str,
        pairs: &Descriptor,
        scaling: PairScaling,
        protocol: PairProtocol,
    ) -> Self {
        let (params, version) = (SvmParams::PAPER, env!("CARGO_PKG_VERSION").to_owned());
        Self { table_digest: digest.to_owned(), pairs: pairs.spec(), scaling, protocol, params, version }
    }

    pub fn name(&self) -> String {
        format!("{}-{}-{}", self.pairs.name, self.scaling.name(), self.protocol.name())
    }

    /// The file that it is kept in.
    pub fn file_name(&self) -> String {
        self.name() + ".json"
    }
}

/// Pairs that were tested, and those classified right, by class.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Count {
    /// Pairs in which people see noise.
    pub noisy: usize,
    pub noisy_right: usize,
    /// Pairs that people take for identical.
    pub identical: usize,
    pub identical_right: usize,
}

impl Count {
    fn note(&mut self, converged: bool, right: bool) {
        let (all, of_them) = if converged {
            (&mut self.identical, &mut self.identical_right)
        } else {
            (&mut self.noisy, &mut self.noisy_right)
        };
        *all += 1;
        *of_them += usize::from(right);
    }
}

impl Sum for Count {
    fn sum<I: Iterator<Item = Self>>(counts: I) -> Self {
        counts.fold(Self::default(), |sum, count| Self {
            noisy: sum.noisy + count.noisy,
            noisy_right: sum.noisy_right + count.noisy_right,
            identical: sum.identical + count.identical,
            identical_right: sum.identical_right + count.identical_right,
        })
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MachineResult {
    /// What it is asked about, in words.
    pub asked: String,
    pub examples: usize,
    pub support_vectors: usize,
    pub seconds_training: f64,
    pub synthesised: Count,
    /// Pairs with a real image asked about.
    pub real: Count,
}

/// What it costs to ask a machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct QueryCost {
    pub seconds: f64,
    /// Support vectors and coefficients as `f32`.
    pub model_bytes: usize,
    /// Largest difference between the decision values of the queries, in `f32` from long rows, and those
    /// that the scores go by, in `f64` from the matrix product.
    pub largest_difference: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ProtocolOutcome {
    #[serde(flatten)]
    pub of: Fingerprint,
    /// For the matrix product of all rows, which all protocols share.
    pub seconds_distances: f64,
    /// One for each part that is left out.
    pub machines: Vec<MachineResult>,
    /// Of the machine that has learned all; none otherwise.
    pub query: Option<QueryCost>,
}

impl ProtocolOutcome {
    /// The result if it is there, whole, and `of` just that; otherwise `of` again.
    pub(super) fn read(path: &Path, of: Fingerprint) -> Result<Self, Fingerprint> {
        let mut text = Vec::new();
        let read = File::open(path).and_then(|file| file.take(MAX_BYTES).read_to_end(&mut text));
        let outcome = read.ok().and_then(|_| serde_json::from_slice::<Self>(&text).ok());
        outcome.filter(|outcome| outcome.of == of).ok_or(of)
    }

    pub(super) fn compute(
        of: Fingerprint,
        pairs: &Pairs,
        geometry: &Geometry,
        watch: Watch<'_>,
    ) -> Result<Self, LabError> {
        let splits = of.protocol.splits(pairs);
        let (name, all) = (of.name(), splits.len() as u64);
        let done = AtomicU64::new(0);
        let tell = |done| watch(Advance { what: "machines trained", done, of: all, detail: &name });
        tell(0);
        let train = |split: &Split| -> Result<(MachineResult, Weights), LabError> {
            let trained = train(split, pairs, geometry, of.params).map_err(|source| {
                let machine = format!("{name}: the machine to be asked about {}", split.asked);
                LabError::Train { machine, source }
            });
            tell(1 + done.fetch_add(1, Ordering::Relaxed));
            trained
        };
        let mut trained = Vec::new();
        for splits in splits.chunks(AT_ONCE) {
            trained.extend(splits.par_iter().map(train).collect::<Result<Vec<_>, _>>()?);
        }

        // The machine that has learned all is the one to be used, so it is the one to be timed.
        let query = (of.protocol == PairProtocol::Learned)
            .then(|| ask(&splits[0], &trained[0].1, pairs, geometry, of.params));
        Ok(Self {
            of,
            seconds_distances: geometry.seconds,
            machines: trained.into_iter().map(|(machine, _)| machine).collect(),
            query,
        })
    }
}

fn train(
    split: &Split,
    pairs: &Pairs,
    geometry: &Geometry,
    params: SvmParams,
) -> Result<(MachineResult, Weights), SvmTrainError> {
    let begun = Instant::now();
    let labels: Vec<bool> = split.learn.iter().map(|&i| pairs.known[i].converged).collect();
    let learn = split.learn.as_slice();
    let squared = geometry.squared.select(Axis(0), learn).select(Axis(1), learn);
    let weights = fit_weights(squared.view(), &labels, params)?;
    let seconds_training = begun.elapsed().as_secs_f64();

    let decide = |&i: &usize| decision(i, split, &weights, geometry, params);
    let decisions: Vec<f64> = split.ask.par_iter().map(decide).collect();
    let (mut synthesised, mut real) = (Count::default(), Count::default());
    for (&i, decision) in split.ask.iter().zip(decisions) {
        let converged = pairs.known[i].converged;
        let count = if i < pairs.synthesised { &mut synthesised } else { &mut real };
        count.note(converged, (decision > 0.0) == converged);
    }
    let machine = MachineResult {
        asked: split.asked.clone(),
        examples: split.learn.len(),
        support_vectors: weights.support().count(),
        seconds_training,
        synthesised,
        real,
    };
    Ok((machine, weights))
}

/// Decision value of a row, from the distances that are there.
fn decision(row: usize, split: &Split, weights: &Weights, geometry: &Geometry, params: SvmParams) -> f64 {
    let squared = geometry.squared.row(row);
    let term = |(i, alpha): (usize, f64)| alpha * (-params.gamma * squared[split.learn[i]]).exp();
    weights.support().map(term).sum::<f64>() - weights.rho
}

fn ask(split: &Split, weights: &Weights, pairs: &Pairs, geometry: &Geometry, params: SvmParams) -> QueryCost {
    let svm = weights.machine(params, |i| pairs.row(split.learn[i]));
    let (mut seconds, mut largest_difference) = (Vec::new(), 0.0f64);
    for &row in split.ask.iter().step_by(split.ask.len().div_ceil(QUERIES)) {
        let x = pairs.row(row);
        let begun = Instant::now();
        let answer = svm.decision(&x);
        seconds.push(begun.elapsed().as_secs_f64());
        let difference = f64::from(answer) - decision(row, split, weights, geometry, params);
        largest_difference = largest_difference.max(difference.abs());
    }
    QueryCost {
        seconds: Data::new(seconds).median(),
        model_bytes: size_of::<f32>() * (svm.vectors.len() + svm.coefficients.len()),
        largest_difference,
    }
}
