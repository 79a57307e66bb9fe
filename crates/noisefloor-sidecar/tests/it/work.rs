use crate::kit::{Fake, SIZE, expected, requests, tiles};
use noisefloor::tune::PixelCounts;
use noisefloor::{ProgressiveSource, Repeats, Request, Tile, Unit};
use std::num::NonZeroUsize;

#[test]
fn samples_come_as_they_were_rendered() {
    let Some(fake) = Fake::new("work") else { return };
    let mut source = fake.open().unwrap();
    let info = source.info();
    assert_eq!((info.name.as_str(), info.width, info.height), ("Fake 1", SIZE.0, SIZE.1));
    assert_eq!((info.unit, info.aims, info.repeats), (Unit::SamplesPerPixel, true, Repeats::Samples));
    assert!(info.stratified);
    for (first, samples) in [(0, 3), (3, 1), (u64::from(u32::MAX) * 7, 2)] {
        let mut requests = requests(first, samples);
        requests.reverse();
        // A tile may be named twice
        requests.push(Request::new(requests[0].tile, first + 50, requests[0].spp));
        let batches = source.sample(&requests).unwrap();
        assert_eq!(batches.len(), requests.len());
        for (request, batch) in requests.iter().zip(&batches) {
            assert_eq!((batch.tile, batch.spp), (request.tile, samples));
            assert_eq!(batch.mean, expected(5, request));
        }
    }
    assert!(source.sample(&[]).unwrap().is_empty());
    assert!(source.restarts().is_empty());
}

#[test]
fn what_is_asked_for_reaches_the_renderer() {
    let Some(mut fake) = Fake::new("work") else { return };
    assert_eq!(fake.open().unwrap().warnings(), ["max_depth None, threads None"]);
    fake.job.size = Some((33, 17));
    fake.job.max_depth = Some(4);
    fake.job.threads = NonZeroUsize::new(2);
    fake.job.seed = u64::MAX / 31;
    let mut source = fake.open().unwrap();
    assert_eq!(source.warnings(), ["max_depth 4, threads 2"]);
    assert_eq!((source.info().width, source.info().height), (33, 17));
    let tile = Tile { index: 0, x: 1, y: 2, width: 5, height: 3 };
    let request = Request::new(tile, 0, 1);
    let mean = source.sample(&[request]).unwrap().remove(0).mean;
    // Seeds go through JSON whole: 64 bits, where a double has 53
    let seed = ((u128::from(u64::MAX / 31) * 31) % 97) as u64;
    let shifted: Vec<u64> = (0..3).map(|c| (seed + 7 + 2 * 13 + c * 5) % 97).collect();
    let right = [0, 1, 2].map(|c| (shifted[c] as f64 / 97.0) as f32);
    assert_eq!(mean[0], right);
}

#[test]
fn an_adaptive_picture_comes_whole() {
    let Some(fake) = Fake::new("sample adaptively") else { return };
    let part = Tile { index: 0, x: 1, y: 2, width: 3, height: 2 };
    let adaptive = |threshold, samples, seed, part| {
        let picture = fake.open().unwrap().adaptive(threshold, samples, seed, part).unwrap().unwrap();
        assert_eq!(picture.counts, None);
        picture.pixels
    };
    assert_eq!(adaptive(0.25, Some(64), 7, None), vec![[0.25, 64.0, 7.0]; SIZE.0 * SIZE.1]);
    assert_eq!(adaptive(0.5, None, 0, None), vec![[0.5, 0.0, 0.0]; SIZE.0 * SIZE.1]);
    assert_eq!(adaptive(0.5, None, 0, Some(part)), vec![[0.5, 0.0, 0.0]; 6]);
    let Some(fake) = Fake::new("count samples") else { return };
    let picture = fake.open().unwrap().adaptive(0.25, Some(512), 7, Some(part)).unwrap().unwrap();
    let samples = (0..6).map(|pixel| 32.0 + pixel as f32).collect();
    let counts = PixelCounts { samples, fewest: 32.0, fewest_alone: 64.0, most: 512.0 };
    assert_eq!((picture.pixels, picture.counts), (vec![[0.25, 512.0, 7.0]; 6], Some(counts)));
    for how in ["count to no limit", "count no numbers"] {
        let Some(fake) = Fake::new(how) else { return };
        let error = fake.open().unwrap().adaptive(0.25, Some(512), 7, None).unwrap_err();
        assert!(error.to_string().contains("sample counts that cannot be"), "{how}: {error}");
    }
    let Some(fake) = Fake::new("work") else { return };
    assert_eq!(fake.open().unwrap().adaptive(0.5, None, 0, None).unwrap(), None);
}

/// More tiles than one header may name: as many calls as it takes, and nothing of it shows.
#[test]
fn many_tiles_are_several_calls() {
    let Some(fake) = Fake::new("work") else { return };
    let tile = |i: usize| Tile { index: i, x: i % SIZE.0, y: i / SIZE.0 % SIZE.1, width: 1, height: 1 };
    let requests: Vec<Request> = (0..10_000).map(|i| Request::new(tile(i), i as u64, 1)).collect();
    let batches = fake.open().unwrap().sample(&requests).unwrap();
    assert!(batches.iter().zip(&requests).all(|(b, r)| b.mean == expected(5, r)));
    assert_eq!(batches.len(), requests.len());
}

#[test]
fn an_exhausted_tile_has_no_samples() {
    let Some(fake) = Fake::new("be exhausted") else { return };
    let mut source = fake.open().unwrap();
    source.sample(&requests(0, 1)).unwrap();
    let batches = source.sample(&requests(1, 1)).unwrap();
    assert_eq!(batches.iter().map(|b| (b.spp, b.mean.len())).collect::<Vec<_>>(), {
        let pixels: Vec<_> = tiles().iter().map(Tile::pixels).collect();
        [(1, pixels[0]), (0, 0), (1, pixels[2]), (1, pixels[3])]
    });
}
