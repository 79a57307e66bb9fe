//! What a tile of 128×128 pixels costs with a halo of 16, by how much of the model is computed; and whole
//! pictures.
#![allow(missing_docs, reason = "a benchmark")]

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use noisefloor_vision::{ResidualPatch, ResidualPixels, Viewing, VisionDetail, VisionModel, VisionWorkspace};
use std::hint::black_box;

const TILE: usize = 128;
const HALO: usize = 16;

/// A picture with edges, and its noise.
fn pictures(edge: usize) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
    let mut state = 1u64;
    let mut noise = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 40) as f32 / (1 << 24) as f32 - 0.5) * 0.05
    };
    let picture = (0..edge * edge).map(|i| {
        let (x, y) = (i % edge, i / edge);
        let wall = 0.3 + 0.3 * ((x * y) as f32 / 900.0).sin();
        [wall, wall * 0.8, if (x / 20 + y / 30) % 2 == 0 { 0.2 } else { 0.5 }]
    });
    (picture.collect(), (0..edge * edge).map(|_| [noise(), noise(), noise()]).collect())
}

fn tile(c: &mut Criterion) {
    let edge = TILE + 2 * HALO;
    let (picture, residual) = pictures(edge);
    let grey = |pixels: &[[f32; 3]]| -> Vec<f32> {
        pixels.iter().map(|p| 0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2]).collect()
    };
    let (grey_picture, grey_residual) = (grey(&picture), grey(&residual));
    let planes =
        [&picture, &residual].map(|of| [0, 1, 2].map(|c| of.iter().map(|p| p[c]).collect::<Vec<f32>>()));
    let [of_picture, of_residual] = planes.each_ref().map(|planes| planes.each_ref().map(Vec::as_slice));
    let rgb = ResidualPixels::Rgb { picture: of_picture, residual: of_residual };
    let grey = ResidualPixels::Grey { picture: &grey_picture, residual: &grey_residual };
    let model = VisionModel::new(&Viewing::default());
    let of_film = VisionModel::new(&"desk,fps=24".parse().expect("viewing conditions"));
    let mut workspace = VisionWorkspace::default();
    let below = |chromatic_below, highest| VisionDetail { chromatic_below, frequencies: (1.0, highest) };

    let mut group = c.benchmark_group("tile of 128x128");
    group.throughput(Throughput::Elements((TILE * TILE) as u64));
    for (name, model, pixels, detail) in [
        ("colour, all bands", &model, rgb, VisionDetail::FULL),
        ("colour, all bands, of a film", &of_film, rgb, VisionDetail::FULL),
        ("of a grey picture in a film, above 1", &of_film, grey, VisionDetail::FAST),
        ("colour, above 1", &model, rgb, below(100.0, 100.0)),
        ("colour of verdicts", &model, rgb, VisionDetail::COLOUR),
        ("colour, 1 to 15", &model, rgb, below(15.0, 15.0)),
        ("light and dark, above 1", &model, rgb, VisionDetail::FAST),
        ("light and dark, 1 to 15", &model, rgb, below(0.0, 15.0)),
        ("of a grey picture, above 1", &model, grey, VisionDetail::FAST),
        ("of a grey picture, 1 to 15", &model, grey, below(0.0, 15.0)),
    ] {
        let inner = HALO..HALO + TILE;
        let patch = ResidualPatch { pixels, size: (edge, edge), columns: inner.clone(), rows: inner };
        group.bench_function(name, |b| {
            b.iter(|| model.residual(black_box(&patch), detail, &mut workspace).expect("a patch").map().step);
        });
    }
    let inner = HALO..HALO + TILE;
    let patch = ResidualPatch { pixels: rgb, size: (edge, edge), columns: inner.clone(), rows: inner };
    let mut found = model.residual(&patch, VisionDetail::FAST, &mut workspace).expect("a patch");
    group.bench_function("another contrast", |b| b.iter(|| found.map_at(black_box(0.7)).step));
    group.finish();
}

fn whole(c: &mut Criterion) {
    let mut group = c.benchmark_group("two pictures");
    let model = VisionModel::new(&Viewing::default());
    let mut workspace = VisionWorkspace::default();
    for edge in [256, 1024] {
        let (picture, residual) = pictures(edge);
        group.throughput(Throughput::Elements((edge * edge) as u64));
        group.bench_function(format!("JOD of {edge}x{edge}"), |b| {
            b.iter(|| {
                model
                    .compare(black_box(&residual), &picture, (edge, edge), &mut workspace)
                    .expect("two")
                    .jod()
            });
        });
        group.bench_function(format!("JOD and map of {edge}x{edge}"), |b| {
            b.iter(|| {
                let mut found =
                    model.compare(black_box(&residual), &picture, (edge, edge), &mut workspace).expect("two");
                found.map()[0]
            });
        });
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(20).warm_up_time(std::time::Duration::from_millis(500))
        .measurement_time(std::time::Duration::from_secs(1));
    targets = tile, whole
}
criterion_main!(benches);
