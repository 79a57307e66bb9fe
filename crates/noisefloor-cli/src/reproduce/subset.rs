//! A few of the pairs, with what our machine says of them, for other programs to train on.

use super::pairs::Pairs;
use crate::output::write_json;
use anyhow::bail;
use ndarray::{Array2, ArrayView2};
use noisefloor::{SvmParams, fit_svm};
use noisefloor_image::write_atomic;
use serde::Serialize;
use std::io::Write;
use std::path::Path;
use std::time::Instant;

#[derive(Serialize)]
struct Subset {
    params: SvmParams,
    /// So many rows from the first were learned; the others were not.
    learned: usize,
    /// Of each row: whether the pair is identical.
    identical: Vec<bool>,
    /// Of each row.
    decisions: Vec<f32>,
    support_vectors: usize,
    seconds_training: f64,
    seconds_query: f64,
    threads: usize,
}

/// Learns `count` of the synthesised pairs, asks about as many others, both spread evenly, and writes rows.npy and machine.json.
pub fn dump(pairs: &Pairs, count: usize, out: &Path) -> anyhow::Result<()> {
    if 2 * count > pairs.synthesised {
        bail!("--dump-subset takes at most {} of these {} pairs", pairs.synthesised / 2, pairs.synthesised);
    }
    std::fs::create_dir_all(out)?;
    let spread = |offset: usize| (0..count).map(move |i| (2 * i + offset) * pairs.synthesised / (2 * count));
    let rows: Vec<usize> = spread(0).chain(spread(1)).collect();
    let identical: Vec<bool> = rows.iter().map(|&i| pairs.known[i].converged).collect();
    let numbers = rows.iter().flat_map(|&i| pairs.row(i)).collect();
    let rows = Array2::from_shape_vec((rows.len(), 2 * pairs.tiles.ncols()), numbers)?;
    write_atomic(out.join("rows.npy"), |to| write_npy(rows.view(), to))?;

    let params = SvmParams::PAPER;
    let learned = rows.slice(ndarray::s![..count, ..]).mapv(f64::from);
    let begun = Instant::now();
    let svm = fit_svm(learned.view(), &identical[..count], params)?;
    let seconds_training = begun.elapsed().as_secs_f64();
    let begun = Instant::now();
    let decisions: Vec<f32> = rows.rows().into_iter().map(|row| svm.decision(&row.to_vec())).collect();
    let seconds_query = begun.elapsed().as_secs_f64() / decisions.len() as f64;
    let machine = Subset {
        params,
        learned: count,
        identical,
        decisions,
        support_vectors: svm.coefficients.len(),
        seconds_training,
        seconds_query,
        threads: rayon::current_num_threads(),
    };
    write_json(&out.join("machine.json"), &machine)?;
    println!(
        "{count} pairs learned in {seconds_training:.2} s, {} support vectors; rows.npy and machine.json written to {}",
        machine.support_vectors,
        out.display()
    );
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
