//! The same seed gives the same samples, and other samples are independent.

use crate::kit::batch;
use noisefloor::{ProgressiveSource, Request, TileGrid};
use noisefloor_ptwne::{Options, Ptwne, RenderError, scenes};
use std::num::NonZeroUsize;

fn cornell(options: Options) -> Ptwne {
    Ptwne::new(scenes::by_name("cornell-box").unwrap(), 40, 40, options).unwrap()
}

#[test]
fn threads_change_nothing() {
    let run = |threads| {
        let options = Options { threads: NonZeroUsize::new(threads), ..Options::default() };
        let mut source = cornell(options);
        (batch(&mut source, 5, 7), source.reference().unwrap())
    };
    assert_eq!(run(1), run(4));
}

#[test]
fn tiles_and_batches_change_nothing_but_rounding() {
    let mut source = cornell(Options::default());
    let (all, a, b) = (batch(&mut source, 0, 32), batch(&mut source, 0, 8), batch(&mut source, 8, 24));
    for ((all, a), b) in all.iter().zip(&a).zip(&b) {
        for c in 0..3 {
            // Two roundings to f32, 6e-8 each, of the parts, one of the whole
            let both = (f64::from(a[c]) * 8.0 + f64::from(b[c]) * 24.0) / 32.0;
            assert!((both - f64::from(all[c])).abs() <= 2e-7 * both.abs(), "{both} {}", all[c]);
        }
    }
    let tiles = TileGrid::new(40, 40, 16).unwrap().tiles();
    let mut requests: Vec<Request> = tiles.map(|tile| Request { tile, first: 0, samples: 32 }).collect();
    requests.reverse();
    let batches = source.sample(&requests).unwrap();
    for (request, batch) in requests.iter().zip(&batches) {
        assert_eq!(request.tile, batch.tile);
        let whole: Vec<_> = batch.tile.rows(40).flat_map(|row| all[row].to_vec()).collect();
        assert_eq!(batch.mean, whole);
    }
}

#[test]
fn seeds_are_images() {
    let run = |seed| batch(&mut cornell(Options { seed, ..Options::default() }), 0, 2);
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

/// Σxy / √Σx²y² of independent x, y, symmetric around 0, is close to standard normal: |z| < 5 fails with p = 6e-7. Compared:
/// the noise of two pairs of batches at the same pixel, and of one pair at neighbouring pixels.
#[test]
fn disjoint_samples_are_uncorrelated() {
    let mut source = cornell(Options::default());
    let parts: Vec<_> = (0..4).map(|i| batch(&mut source, i * 16, 16)).collect();
    let noise = |a: usize, b: usize| -> Vec<f64> {
        parts[a].iter().zip(&parts[b]).map(|(a, b)| f64::from(a[1]) - f64::from(b[1])).collect()
    };
    let z = |x: &[f64], y: &[f64]| {
        let products: Vec<f64> = x.iter().zip(y).map(|(x, y)| x * y).collect();
        products.iter().sum::<f64>() / products.iter().map(|p| p * p).sum::<f64>().sqrt()
    };
    let (x, y) = (noise(0, 1), noise(2, 3));
    for z in [z(&x, &y), z(&x[1..], &x), z(&x[40..], &x), z(&x[1..], &y)] {
        assert!(z.abs() < 5.0, "{z}");
    }
}

#[test]
fn bad_options_and_tiles_are_errors() {
    let scene = || scenes::by_name("cornell-box").unwrap();
    assert!(matches!(Ptwne::new(scene(), 0, 10, Options::default()), Err(RenderError::Size(_))));
    let options = Options { max_depth: 0, ..Options::default() };
    assert!(matches!(
        Ptwne::new(scene(), 10, 10, options),
        Err(RenderError::Option { name: "max_depth", .. })
    ));
    let options = Options { threads: NonZeroUsize::new(1 << 20), ..Options::default() };
    assert!(matches!(Ptwne::new(scene(), 10, 10, options), Err(RenderError::Option { name: "threads", .. })));
    let tile = TileGrid::new(64, 64, 32).unwrap().tile(3);
    assert!(cornell(Options::default()).sample(&[Request { tile, first: 0, samples: 1 }]).is_err());
    let tile = TileGrid::new(40, 40, 32).unwrap().tile(3);
    let none = cornell(Options::default()).sample(&[Request { tile, first: 0, samples: 0 }]).unwrap();
    assert!(none[0].samples == 0 && none[0].mean.is_empty());
}
