//! The same seed gives the same samples, and other samples are independent.

use crate::kit::{batch, source};
use noisefloor::{ProgressiveSource, Request, TileGrid};
use noisefloor_ptwne::{Filter, Ptwne, RenderError, RenderOptions, Sampling, scenes};
use std::num::NonZeroUsize;

fn cornell(options: RenderOptions) -> Ptwne {
    Ptwne::new(scenes::by_name("cornell-box").unwrap(), 40, 40, options).unwrap()
}

#[test]
fn threads_change_nothing() {
    let run = |threads| {
        let options = RenderOptions { threads: NonZeroUsize::new(threads), ..RenderOptions::default() };
        let mut source = cornell(options);
        (batch(&mut source, 5, 7), source.reference().unwrap())
    };
    assert_eq!(run(1), run(4));
}

#[test]
fn tiles_and_batches_change_nothing_but_rounding() {
    for (sampling, filter) in [
        (Sampling::Independent, Filter::Box),
        (Sampling::Independent, Filter::Gaussian),
        (Sampling::Sobol, Filter::Box),
        (Sampling::Sobol, Filter::Tent),
    ] {
        let mut source = cornell(RenderOptions { sampling, filter, ..RenderOptions::default() });
        let (all, a, b) = (batch(&mut source, 0, 32), batch(&mut source, 0, 8), batch(&mut source, 8, 24));
        for ((all, a), b) in all.iter().zip(&a).zip(&b) {
            for c in 0..3 {
                // Two roundings to f32, 6e-8 each, of the parts, one of the whole
                let both = (f64::from(a[c]) * 8.0 + f64::from(b[c]) * 24.0) / 32.0;
                assert!((both - f64::from(all[c])).abs() <= 2e-7 * both.abs(), "{both} {}", all[c]);
            }
        }
        let tiles = TileGrid::new(40, 40, 16).unwrap().tiles();
        let mut requests: Vec<Request> = tiles.map(|tile| Request::new(tile, 0, 32)).collect();
        requests.reverse();
        let batches = source.sample(&requests).unwrap();
        for (request, batch) in requests.iter().zip(&batches) {
            assert_eq!(request.tile, batch.tile);
            let whole: Vec<_> = batch.tile.rows(40).flat_map(|row| all[row].to_vec()).collect();
            assert_eq!(batch.mean, whole);
        }
    }
}

/// A sample is the same on its own as within a batch.
#[test]
fn samples_are_the_same_wherever_batches_begin() {
    for sampling in [Sampling::Independent, Sampling::Sobol] {
        let mut source = cornell(RenderOptions { sampling, ..RenderOptions::default() });
        // Across the end of a Sobol sequence, too
        for first in [0, 65_534] {
            let together = batch(&mut source, first, 4);
            let alone: Vec<_> = (first..first + 4).map(|k| batch(&mut source, k, 1)).collect();
            for (i, pixel) in together.iter().enumerate() {
                let sum: f64 = alone.iter().map(|s| f64::from(s[i][1])).sum();
                assert_eq!((sum / 4.0) as f32, pixel[1]);
            }
        }
    }
}

/// Opacity tests change no bit of the picture of a scene that does not need them.
#[test]
fn opacity_tests_change_nothing() {
    for name in ["cornell-box", "softbox", "courtyard", "glass-spheres", "plates", "grazing"] {
        let run = |forced: bool| {
            let scene = scenes::by_name(name).unwrap();
            let mut source = source(scene, 24);
            if forced {
                source.force_opacity_tests();
            }
            batch(&mut source, 0, 8)
        };
        assert_eq!(run(false), run(true), "{name}");
    }
}

/// Sobol points have the mean of independent ones and, in smooth light, a smaller error: here a wall under a
/// softbox, 64 samples per pixel, against the mean of all.
#[test]
fn sobol_points_have_the_same_mean_and_less_noise() {
    let run = |sampling| {
        let options = RenderOptions { sampling, max_depth: 2, ..RenderOptions::default() };
        let mut source = Ptwne::new(scenes::by_name("softbox").unwrap(), 24, 24, options).unwrap();
        let batches: Vec<_> = (0..16).map(|i| batch(&mut source, 64 * i, 64)).collect();
        let at = |b: &Vec<[f32; 3]>, i: usize| f64::from(b[i][1]);
        let means: Vec<f64> =
            (0..576).map(|i| batches.iter().map(|b| at(b, i)).sum::<f64>() / 16.0).collect();
        let variance = |i: usize| batches.iter().map(|b| (at(b, i) - means[i]).powi(2)).sum::<f64>() / 15.0;
        let all: Vec<f64> = (0..576).map(variance).collect();
        // Over the whole picture, the standard error of the mean of 16 batches; and the noise of the upper
        // quarter, the wall
        let error = (all.iter().sum::<f64>() / 16.0).sqrt() / 576.0;
        let noise = all[..144].iter().sum::<f64>() / 144.0;
        (means.iter().sum::<f64>() / 576.0, error, noise)
    };
    let (independent, sobol) = (run(Sampling::Independent), run(Sampling::Sobol));
    // Batches of one sequence are not independent, so only the error of the independent samples counts, at
    // five standard errors
    assert!((independent.0 - sobol.0).abs() < 5.0 * independent.1, "{independent:?} {sobol:?}");
    assert!(sobol.2 < 0.5 * independent.2, "{independent:?} {sobol:?}");
}

#[test]
fn seeds_are_images() {
    let run = |seed| batch(&mut cornell(RenderOptions { seed, ..RenderOptions::default() }), 0, 2);
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

/// Σxy / √Σx²y² of independent x, y, symmetric around 0, is close to standard normal: |z| < 5 fails with p =
/// 6e-7. Compared: the noise of two pairs of batches at the same pixel, and of one pair at neighbouring
/// pixels.
#[test]
fn disjoint_samples_are_uncorrelated() {
    let mut source = cornell(RenderOptions::default());
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
    assert!(matches!(Ptwne::new(scene(), 0, 10, RenderOptions::default()), Err(RenderError::Size(_))));
    let options = RenderOptions { max_depth: 0, ..RenderOptions::default() };
    assert!(matches!(
        Ptwne::new(scene(), 10, 10, options),
        Err(RenderError::Option { name: "max_depth", .. })
    ));
    let options = RenderOptions { threads: NonZeroUsize::new(1 << 20), ..RenderOptions::default() };
    assert!(matches!(Ptwne::new(scene(), 10, 10, options), Err(RenderError::Option { name: "threads", .. })));
    let tile = TileGrid::new(64, 64, 32).unwrap().tile(3);
    assert!(cornell(RenderOptions::default()).sample(&[Request::new(tile, 0, 1)]).is_err());
    let tile = TileGrid::new(40, 40, 16).unwrap().tile(3);
    let none = cornell(RenderOptions::default()).sample(&[Request::new(tile, 0, 0)]).unwrap();
    assert!(none[0].spp == 0 && none[0].mean.is_empty());
}

/// Tiles that see only the sky trace no rays and look the same as when they are part of a larger tile, which
/// does.
#[test]
fn background_tiles_trace_no_rays() {
    let scene = crate::kit::scene(crate::kit::look([0.0, 0.0, 9.0], [0.0; 3], [0.0, 1.0, 0.0], 40.0), |b| {
        let grey = b.material(noisefloor_ptwne::Material::diffuse([0.5; 3])).unwrap();
        b.sphere([0.0; 3], 0.5, grey, None).unwrap();
        let sky = noisefloor_ptwne::Environment {
            zenith: [0.1, 0.2, 0.9],
            ..noisefloor_ptwne::Environment::constant([0.5; 3])
        };
        b.environment(sky).unwrap();
    });
    let mut source = source(scene, 96);
    let whole = batch(&mut source, 0, 4);
    assert_eq!(source.counts().background, 0);
    let tiles = TileGrid::new(96, 96, 32).unwrap().tiles();
    let requests: Vec<Request> = tiles.map(|tile| Request::new(tile, 0, 4)).collect();
    for batch in source.sample(&requests).unwrap() {
        let part: Vec<_> = batch.tile.rows(96).flat_map(|row| whole[row].to_vec()).collect();
        assert_eq!(batch.mean, part);
    }
    // The ball, with its bounding box, is only in the middle tile
    assert_eq!(source.counts().background, 8 * 32 * 32 * 4);
}
