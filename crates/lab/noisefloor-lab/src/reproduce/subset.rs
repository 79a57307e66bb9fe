//! A few of the pairs, with what our machine says of them, for other programs to train on.

use super::gram::squared_distances;
use super::job::Reproduction;
use super::pairs::Pairs;
use super::solver::fit_weights;
use crate::advance::Watch;
use crate::error::LabError;
use crate::files::{make_folder, write_json};
use ndarray::{Array2, ArrayView2, s};
use noisefloor_image::write_atomic;
use noisefloor_learn::SvmParams;
use serde::Serialize;
use std::io::Write;
use std::path::Path;
use std::time::Instant;

/// Pairs, and a machine that has learned the first half of them.
#[derive(Clone, Debug, Serialize)]
pub struct PairSubset {
    pub params: SvmParams,
    /// Rows that were learned, counted from the first; the others were not.
    pub learned: usize,
    /// Of each row: whether the pair is identical.
    pub identical: Vec<bool>,
    pub decisions: Vec<f32>,
    pub support_vectors: usize,
    pub seconds_training: f64,
    /// To ask it about one row.
    pub seconds_query: f64,
    pub threads: usize,
    /// The pairs: a row each.
    #[serde(skip)]
    pub rows: Array2<f32>,
}

/// Learns `count` of the synthesised pairs of noise masks and asks about as many others, both spread evenly.
pub fn subset(job: &Reproduction, count: usize, watch: Watch<'_>) -> Result<PairSubset, LabError> {
    learn(&job.load(&job.masks(), watch)?.into_pairs()?, count)
}

fn learn(pairs: &Pairs, count: usize) -> Result<PairSubset, LabError> {
    let (all, most) = (pairs.synthesised, pairs.synthesised / 2);
    if count > most {
        return Err(LabError::Subset { asked: count, most, all });
    }
    let spread = |offset: usize| (0..count).map(move |i| (2 * i + offset) * all / (2 * count));
    let chosen: Vec<usize> = spread(0).chain(spread(1)).collect();
    let identical: Vec<bool> = chosen.iter().map(|&i| pairs.known[i].converged).collect();
    let mut rows = Array2::zeros((chosen.len(), 2 * pairs.tiles.ncols()));
    for (mut row, &i) in rows.rows_mut().into_iter().zip(&chosen) {
        row.iter_mut().zip(pairs.row(i)).for_each(|(to, from)| *to = from);
    }

    let params = SvmParams::PAPER;
    let learned = rows.slice(s![..count, ..]).mapv(f64::from);
    let begun = Instant::now();
    let squared = squared_distances(learned.view(), |_, _| ());
    let weights = fit_weights(squared.view(), &identical[..count], params)
        .map_err(|source| LabError::Train { machine: "the machine of the subset".into(), source })?;
    let svm = weights.machine(params, |i| rows.row(i).to_vec());
    let seconds_training = begun.elapsed().as_secs_f64();
    let begun = Instant::now();
    let decisions: Vec<f32> = rows.rows().into_iter().map(|row| svm.decision(&row.to_vec())).collect();
    Ok(PairSubset {
        params,
        learned: count,
        identical,
        support_vectors: svm.coefficients.len(),
        seconds_training,
        seconds_query: begun.elapsed().as_secs_f64() / decisions.len() as f64,
        decisions,
        threads: rayon::current_num_threads(),
        rows,
    })
}

/// Writes rows.npy and machine.json into the folder, which is made.
pub fn write_subset(folder: &Path, subset: &PairSubset) -> Result<(), LabError> {
    make_folder(folder)?;
    write_atomic(folder.join("rows.npy"), |to| write_npy(subset.rows.view(), to))?;
    write_json(&folder.join("machine.json"), subset)?;
    Ok(())
}

/// NumPy's format, version 1.0: a header of text, padded to 64 bytes, and the numbers.
fn write_npy(rows: ArrayView2<'_, f32>, to: &mut impl Write) -> std::io::Result<()> {
    let (height, width) = rows.dim();
    let mut header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({height}, {width}), }}");
    let preamble = b"\x93NUMPY\x01\x00";
    let length = (preamble.len() + 2 + header.len() + 1).next_multiple_of(64) - preamble.len() - 2;
    header = format!("{header:pad$}\n", pad = length - 1);
    to.write_all(preamble)?;
    to.write_all(&(length as u16).to_le_bytes())?;
    to.write_all(header.as_bytes())?;
    rows.iter().try_for_each(|value| to.write_all(&value.to_le_bytes()))
}
