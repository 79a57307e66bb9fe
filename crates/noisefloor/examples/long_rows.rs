//! Trains one machine on long rows twice, through linfa's own kernel matrix and from a matrix product, and
//! says what each takes:
//! `cargo run --release -p noisefloor --features train --example long_rows -- ROWS NUMBERS`
#![allow(clippy::print_stdout, reason = "an example prints")]
#![expect(clippy::disallowed_methods, reason = "it measures time")]

use linfa::prelude::*;
use ndarray::{Array1, Array2};
use noisefloor::svm::{SvmParams, fit_svm};
use noisefloor_testkit::Noise;
use std::time::Instant;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1).map(|a| a.parse::<usize>());
    let [count, numbers] = [600, 32_768].map(|default| arguments.next().unwrap_or(Ok(default)));
    let (count, numbers) = (count?, numbers?);

    // Two seeded, overlapping clouds, as far from one another as γ = 2 can tell apart
    let mut noise = Noise::new(7);
    let mut uniform = || noise.uniform() - 0.5;
    let labels: Vec<bool> = (0..count).map(|i| i % 2 == 0).collect();
    let scale = (numbers as f64).sqrt().recip();
    let rows = Array2::from_shape_fn((count, numbers), |(i, _)| {
        scale * (uniform() + if labels[i] { 0.05 } else { -0.05 })
    });

    let params = SvmParams::PAPER;
    let begun = Instant::now();
    let ours = fit_svm(rows.view(), &labels, params)?;
    let seconds_ours = begun.elapsed().as_secs_f64();

    let data = DatasetBase::new(rows, Array1::from_vec(labels));
    let begun = Instant::now();
    let machine = linfa_svm::Svm::<f64, bool>::params()
        .pos_neg_weights(params.c, params.c)
        .gaussian_kernel(1.0 / params.gamma)
        .eps(1e-3);
    let theirs: linfa_svm::Svm<f64, bool> = machine.fit(&data)?;
    let seconds_linfa = begun.elapsed().as_secs_f64();

    println!(
        "{count} rows of {numbers} numbers: linfa {seconds_linfa:.1} s, from a matrix product {seconds_ours:.2} s"
    );
    println!("support vectors: linfa {}, ours {}", theirs.nsupport(), ours.coefficients.len());
    println!("ρ: linfa {:.6}, ours {:.6}", theirs.rho, ours.rho);
    Ok(())
}
