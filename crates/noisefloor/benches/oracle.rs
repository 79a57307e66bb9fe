//! What a verdict on one tile of 128×128 pixels costs, and its parts; verdicts on whole pictures, by their size; and
//! what an embedder calls, a push and a verdict of a session with all that they do, by size and threads.
#![allow(missing_docs, reason = "a benchmark")]
#![expect(clippy::disallowed_methods, reason = "it measures time")]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use noisefloor::{
    Film, Oracle, Params, Rgb, Session, StoppingCriterion, TileGrid, criterion::View, descriptor::NoiseMask,
    display::Display, evidence::TilePlanes,
};
use noisefloor_testkit::Noise;
use std::hint::black_box;
use std::time::Instant;

fn film(edge: usize) -> Film {
    let mut film = Film::new(TileGrid::new(edge, edge, 128).expect("a valid grid"));
    let mut noise = Noise::new(1);
    let mut uniform = || noise.uniform() as f32;
    for _ in 0..2 {
        for tile in 0..film.grid().len() {
            let batch: Vec<Rgb> =
                (0..128 * 128).map(|_| [0.2 + 0.1 * uniform(), 0.3, 0.1 * uniform()]).collect();
            film.add(tile, 50, &batch).expect("it fits");
        }
    }
    film
}

fn verdict(c: &mut Criterion) {
    let (film, display) = (film(384), Display::SRGB);
    let tile = film.grid().tile(4);
    let mut oracle = Oracle::bundled();
    let planes = TilePlanes::from_halves(&film, &display, tile);
    let described = oracle.describe(&planes, 100.0).expect("any tile");
    let numbers = oracle.model().descriptor().in_picture(&[described]).remove(0);

    let mut group = c.benchmark_group("tile of 128x128");
    group.bench_function("planes", |b| b.iter(|| TilePlanes::from_halves(black_box(&film), &display, tile)));
    group.bench_function("noise mask", |b| b.iter(|| NoiseMask::default().apply(black_box(&planes.image))));
    group.bench_function("descriptor", |b| {
        b.iter(|| oracle.describe(black_box(&planes), 100.0));
    });
    group.bench_function("query", |b| {
        b.iter(|| oracle.model().judge(black_box(&numbers)));
    });
    let view = View::new(&film, &display);
    // All on one core, as the rest
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    group.bench_function("verdict", |b| {
        b.iter_custom(|times| {
            one.install(|| {
                let start = Instant::now();
                (0..times).for_each(|_| drop(black_box(oracle.judge(&view, black_box(&[tile])))));
                start.elapsed()
            })
        });
    });
    // A batch in a film, and in a session, which watches it
    let (params, mut noise) = (Params::default().with_max_spp(1 << 30), Noise::new(2));
    let batch: Vec<Rgb> = (0..128 * 128).map(|_| [0.2 + noise.uniform() as f32; 3]).collect();
    let mut film = Film::new(TileGrid::new(384, 384, 128).expect("a valid grid"));
    let mut session = Session::new(384, 384, Oracle::bundled(), params).expect("a valid size");
    group.bench_function("batch in a film", |b| b.iter(|| film.add(4, 1, black_box(&batch))));
    group.bench_function("batch in a session", |b| b.iter(|| session.push(4, 1, black_box(&batch))));
    group.finish();
}

/// Time for each pixel of a picture of which all tiles are judged, on all cores.
fn pictures(c: &mut Criterion) {
    let mut group = c.benchmark_group("picture");
    group.sample_size(10);
    for edge in [512, 1024, 2048, 5760] {
        let (film, display) = (film(edge), Display::SRGB);
        let tiles: Vec<_> = film.grid().tiles().collect();
        let mut oracle = Oracle::bundled();
        let view = View::new(&film, &display);
        group.throughput(Throughput::Elements((edge * edge) as u64));
        group.bench_function(format!("{edge}x{edge}"), |b| b.iter(|| oracle.judge(&view, black_box(&tiles))));
    }
    group.finish();
}

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

criterion_group!(benches, verdict, pictures, sessions, memory);
criterion_main!(benches);
