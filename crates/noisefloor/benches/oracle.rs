//! What a verdict on one tile of 128×128 pixels costs, and its parts; and verdicts on whole pictures, by
//! their size.
#![allow(missing_docs, reason = "a benchmark")]
#![expect(clippy::disallowed_methods, reason = "it measures time")]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use noisefloor::{
    Film, Oracle, Params, Rgb, Session, StoppingCriterion, TileGrid, Viewing, criterion::View,
    descriptor::NoiseMask, display::Display, evidence::TilePlanes,
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
    let view = View {
        film: &film,
        display: &display,
        viewing: Viewing::default(),
        audience: noisefloor::Audience::TRAINED,
        reference: None,
    };
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
        let view = View {
            film: &film,
            display: &display,
            viewing: Viewing::default(),
            audience: noisefloor::Audience::TRAINED,
            reference: None,
        };
        group.throughput(Throughput::Elements((edge * edge) as u64));
        group.bench_function(format!("{edge}x{edge}"), |b| b.iter(|| oracle.judge(&view, black_box(&tiles))));
    }
    group.finish();
}

criterion_group!(benches, verdict, pictures);
criterion_main!(benches);
