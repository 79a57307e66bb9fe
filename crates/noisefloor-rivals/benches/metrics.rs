//! What a look at one tile of 128×128 pixels costs by each metric that an oracle could be made of.
#![allow(missing_docs, reason = "a benchmark")]

use criterion::{Criterion, criterion_group, criterion_main};
use linfa_linalg::svd::SVD;
use ndarray::Array2;
use noisefloor::{Rgb, display::luminance};
use noisefloor_rivals::{DisplayPixels, Vdp, metrics};
use noisefloor_testkit::Noise;
use std::hint::black_box;

const EDGE: usize = 128;

/// A ramp, with noise or without.
fn tile(noise: f32) -> Vec<Rgb> {
    let mut random = Noise::new(1);
    let mut uniform = || random.uniform() as f32 - 0.5;
    (0..EDGE * EDGE)
        .map(|i| [0.2, 0.3, 0.1].map(|c| c + (i % EDGE) as f32 * 0.004 + noise * uniform()))
        .collect()
}

fn looks(c: &mut Criterion) {
    let (clean, noisy) = (tile(0.0), tile(0.05));
    let mut group = c.benchmark_group("tile of 128x128");
    group.bench_function("flip", |b| b.iter(|| metrics::flip(black_box(&clean), &noisy, EDGE, EDGE, 40.0)));
    group.bench_function("butteraugli", |b| {
        b.iter(|| metrics::butteraugli(black_box(&clean), &noisy, EDGE, EDGE))
    });
    let [a, b] = [&clean, &noisy]
        .map(|pixels| DisplayPixels::new(EDGE, EDGE, pixels).expect("as many pixels as it says"));
    let vdp = Vdp::default();
    group.bench_function("vdp", |bench| bench.iter(|| vdp.visible(black_box(&a), &b)));
    // The descriptor of recurrent networks: singular values of the luminance, of which they take the entropy.
    let plane = Array2::from_shape_fn((EDGE, EDGE), |(y, x)| luminance(noisy[y * EDGE + x]));
    group.bench_function("svd", |b| b.iter(|| black_box(&plane).svd(false, false)));
    group.finish();

    const LARGE: usize = 512;
    let large: Vec<Rgb> = (0..LARGE * LARGE).map(|i| noisy[i % noisy.len()]).collect();
    let small: Vec<Rgb> = (0..LARGE * LARGE).map(|i| clean[i % clean.len()]).collect();
    let [a, b] = [&small, &large]
        .map(|pixels| DisplayPixels::new(LARGE, LARGE, pixels).expect("as many pixels as it says"));
    let mut group = c.benchmark_group("image of 512x512");
    group.sample_size(10);
    group.bench_function("vdp", |bench| bench.iter(|| vdp.visible(black_box(&a), &b)));
    group.finish();
}

criterion_group!(benches, looks);
criterion_main!(benches);
