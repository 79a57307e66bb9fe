//! Next event estimation, scattering, and both together: they change the noise, not the mean.

use crate::kit::batch;
use noisefloor_ptwne::{Estimator, Ptwne, RenderOptions, scenes};

/// Edges of the picture and of the parts that are compared, in pixels.
const SIZE: usize = 24;
const PART: usize = 8;
const PARTS: usize = (SIZE / PART) * (SIZE / PART);
const SEEDS: u64 = 3;
const BATCHES: u64 = 64;

/// Mean of green over each part, with its standard error, from batches of `SEEDS` seeds.
fn parts(name: &str, estimator: Estimator, samples: u64) -> [(f64, f64); PARTS] {
    let mut means = vec![];
    for seed in 0..SEEDS {
        // No two renders share random numbers
        let options =
            RenderOptions { estimator, seed: 3 * seed + estimator as u64, ..RenderOptions::default() };
        let mut source = Ptwne::new(scenes::by_name(name).unwrap(), SIZE, SIZE, options).unwrap();
        means.extend((0..BATCHES).map(|i| {
            let pixels = batch(&mut source, i * samples, samples);
            let mut sums = [0.0; PARTS];
            for (i, pixel) in pixels.iter().enumerate() {
                sums[i / SIZE / PART * (SIZE / PART) + i % SIZE / PART] += f64::from(pixel[1]);
            }
            sums.map(|sum| sum / (PART * PART) as f64)
        }));
        assert_eq!(source.counts().dropped, 0);
    }
    let n = means.len() as f64;
    std::array::from_fn(|part| {
        let mean = means.iter().map(|m| m[part]).sum::<f64>() / n;
        let variance = means.iter().map(|m| (m[part] - mean).powi(2)).sum::<f64>() / (n - 1.0);
        (mean, (variance / n).sqrt())
    })
}

/// In scenes whose lights are large enough to be hit by chance, all three agree in every part of the picture.
/// Of 108 comparisons (four scenes, nine parts, three pairs) one is off by 5 standard errors with p < 108 ·
/// 5.7e-7 = 6e-5, and means of 24,000 samples and more, in 192 batches, are normal enough for that.
#[test]
fn all_estimators_agree_on_scenes_with_large_lights() {
    for name in ["cornell-box", "softbox", "glass-spheres", "lanterns"] {
        let mis = parts(name, Estimator::Mis, 2);
        let next = parts(name, Estimator::NextEvents, 2);
        let brute = parts(name, Estimator::BruteForce, 16);
        for (what, a, b) in [
            ("MIS, next events", mis, next),
            ("MIS, brute force", mis, brute),
            ("next events, brute force", next, brute),
        ] {
            for (part, ((a, e), (b, f))) in a.into_iter().zip(b).enumerate() {
                let error = e.hypot(f);
                assert!((a - b).abs() < 5.0 * error, "{name}, part {part}, {what}: {a} ± {e}, {b} ± {f}");
                assert!(error < 0.06 * a, "{name}, part {part}, {what}: ±{error} proves nothing about {a}");
            }
        }
    }
}

/// Suns are too small to be hit by chance, but next event estimation finds them with and without scattered
/// rays.
#[test]
fn next_events_alone_are_enough_under_a_sun() {
    for name in ["courtyard", "arcade"] {
        let (mis, next) = (parts(name, Estimator::Mis, 1), parts(name, Estimator::NextEvents, 1));
        for (part, ((a, e), (b, f))) in mis.into_iter().zip(next).enumerate() {
            // Of 18 comparisons one is off by as much with p < 2e-5
            assert!((a - b).abs() < 5.0 * e.hypot(f), "{name}, part {part}: {a} ± {e}, {b} ± {f}");
            assert!(e.hypot(f) < 0.03 * a, "{name}, part {part}: ±{} proves nothing about {a}", e.hypot(f));
        }
    }
}
