//! What an embedder calls, a push and a verdict of a session with all that they do, by size and threads; and what memory
//! gives beside them.
#![allow(missing_docs, reason = "a benchmark")]
#![expect(clippy::disallowed_methods, reason = "it measures time")]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use noisefloor::{Oracle, Params, Rgb, Session};
use noisefloor_testkit::Noise;
use std::hint::black_box;
use std::time::Instant;

/// `Session::push_image`, and `Session::judge` on all tiles with the exposure settled and samples watched: the first
/// verdict of a picture, after two passes. Tiles of 64, as for GPUs.
fn sessions(c: &mut Criterion) {
    let all = rayon::current_num_threads();
    for (width, height) in [(512, 512), (1920, 1080), (3840, 2160)] {
        let mut noise = Noise::new(3);
        let mut pass = || -> Vec<Rgb> {
            let pixel = |i: usize| {
                let light =
                    0.05 + ((i % width) as f32 / 97.0).sin().abs() * ((i / width) as f32 / 61.0).cos().abs();
                let noisy = 2.0 * light * noise.uniform() as f32;
                [noisy, 0.8 * noisy, 0.6 * noisy]
            };
            (0..width * height).map(pixel).collect()
        };
        let passes = [pass(), pass()];
        let new = || {
            let params = Params::default().with_tile(64).with_max_spp(1 << 30);
            Session::new(width, height, Oracle::bundled(), params).expect("a valid size")
        };
        let mut group = c.benchmark_group(format!("session of {width}x{height}"));
        group.sample_size(10).throughput(Throughput::Elements((width * height) as u64));
        let mut threads = vec![1, 2, all];
        threads.sort_unstable();
        threads.dedup();
        for threads in threads {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            let mut session = new();
            group.bench_function(format!("push_image, threads: {threads}"), |b| {
                b.iter(|| pool.install(|| session.push_image(1, black_box(&passes[0]))));
            });
            group.bench_function(format!("judge, threads: {threads}"), |b| {
                b.iter_custom(|times| {
                    let mut verdict = |_| {
                        let mut session = new();
                        pool.install(|| {
                            passes.iter().for_each(|pass| session.push_image(8, pass).expect("it fits"));
                            let start = Instant::now();
                            black_box(session.judge()).expect("a verdict");
                            start.elapsed()
                        })
                    };
                    (0..times).map(&mut verdict).sum()
                });
            });
        }
        group.finish();
    }
}

/// What memory gives: numbers copied from one array to another, on one thread and on all, as STREAM's Copy.
fn memory(c: &mut Criterion) {
    use rayon::prelude::*;
    const NUMBERS: usize = 16 << 20;
    let (from, mut to) = (vec![1.0f32; NUMBERS], vec![0.0f32; NUMBERS]);
    let mut group = c.benchmark_group("memory");
    group.sample_size(10).throughput(Throughput::Bytes(8 * NUMBERS as u64));
    for threads in [1, rayon::current_num_threads()] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let part = NUMBERS.div_ceil(threads);
        group.bench_function(format!("copy, threads: {threads}"), |b| {
            b.iter(|| {
                pool.install(|| {
                    to.par_chunks_mut(part)
                        .zip(from.par_chunks(part))
                        .for_each(|(to, from)| to.copy_from_slice(from));
                    black_box(&mut to);
                });
            });
        });
    }
    group.finish();
}

criterion_group!(benches, sessions, memory);
criterion_main!(benches);
