//! Samples per second of every built-in scene at 64×64 and four samples per pixel, on the threads of the
//! global rayon pool (`RAYON_NUM_THREADS`), and of the ray-traced reference of the Cornell box.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use noisefloor::{ProgressiveSource, Request, TileGrid};
use noisefloor_ptwne::{Ptwne, RenderOptions, scenes};

const SIZE: usize = 64;
const SAMPLES: u64 = 4;

fn render(c: &mut Criterion) {
    let mut group = c.benchmark_group("samples");
    group.sample_size(20).throughput(Throughput::Elements((SIZE * SIZE) as u64 * SAMPLES));
    for entry in scenes::list() {
        let Some(scene) = scenes::by_name(entry.name) else { continue };
        let (Ok(mut source), Ok(grid)) =
            (Ptwne::new(scene, SIZE, SIZE, RenderOptions::default()), TileGrid::new(SIZE, SIZE, 32))
        else {
            continue;
        };
        let mut first = 0;
        group.bench_function(entry.name, |b| {
            b.iter(|| {
                let requests: Vec<Request> =
                    grid.tiles().map(|tile| Request::new(tile, first, SAMPLES)).collect();
                first += SAMPLES;
                source.sample(&requests)
            });
        });
    }
    group.finish();
}

fn reference(c: &mut Criterion) {
    let mut group = c.benchmark_group("reference");
    group.sample_size(10).throughput(Throughput::Elements((SIZE * SIZE) as u64));
    let scene = scenes::by_name("cornell-box");
    if let Some(Ok(mut source)) = scene.map(|s| Ptwne::new(s, SIZE, SIZE, RenderOptions::default())) {
        group.bench_function("cornell-box", |b| b.iter(|| source.reference()));
    }
    group.finish();
}

criterion_group!(benches, render, reference);
criterion_main!(benches);
