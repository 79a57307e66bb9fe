//! What sessions rely on: noise that is white over the pixels, and halves that show it.

use crate::kit::mean_of;
use noisefloor::{ProgressiveSource, Request, Rgb, Tile, source::Sequence};
use noisefloor_ptwne::{Ptwne, RenderOptions, Sampling, scenes};
use std::sync::Arc;

const EDGE: usize = 24;
const SEEDS: u64 = 48;

/// The halves of a picture, each from batches of its own sequence in turns, as a session asks for them. With
/// `number` of half B being that of A, B continues the sequence of A.
fn halves(scene: &Arc<noisefloor_ptwne::Scene>, seed: u64, sampling: Sampling, b: u32) -> [Vec<f64>; 2] {
    let options = RenderOptions { seed, sampling, ..RenderOptions::default() };
    let mut source = Ptwne::new(Arc::clone(scene), EDGE, EDGE, options).unwrap();
    let tile = Tile { index: 0, x: 0, y: 0, width: EDGE, height: EDGE };
    let mut sums = [const { Vec::new() }; 2];
    let (mut taken, mut points) = (0, [0; 2]);
    // Uneven parts, as verdicts where they are due make them
    for spp in [8, 4, 20] {
        for (half, number) in [(0usize, 0), (1, b)] {
            let sequence = Sequence::new(number, points[number as usize]);
            let request = Request::new(tile, taken, spp).in_sequence(sequence);
            let mean: Vec<Rgb> = source.sample(&[request]).unwrap().remove(0).mean;
            sums[half].resize(mean.len(), 0.0);
            for (sum, pixel) in sums[half].iter_mut().zip(&mean) {
                // Brighter samples would decide alone
                *sum += f64::from(pixel[0].min(2.0)) * spp as f64 / 32.0;
            }
            taken += spp;
            points[number as usize] += spp;
        }
    }
    sums
}

/// (A − B)²/4 less the variance of (A + B)/2 over seeds, in units of its standard error over pixels: normal, since
/// pixels are independent. And the correlation of the noise of neighbours, likewise.
fn statistics(scene: &str, sampling: Sampling, b: u32) -> (f64, f64) {
    let scene = Arc::new(scenes::by_name(scene).unwrap());
    let pictures: Vec<[Vec<f64>; 2]> = (0..SEEDS).map(|seed| halves(&scene, seed, sampling, b)).collect();
    let (mut excess, mut noise) = (Vec::new(), Vec::new());
    for pixel in 0..EDGE * EDGE {
        let means: Vec<f64> = pictures.iter().map(|[a, b]| 0.5 * (a[pixel] + b[pixel])).collect();
        let mean = means.iter().sum::<f64>() / SEEDS as f64;
        let variance = means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / (SEEDS - 1) as f64;
        let shown: f64 = pictures.iter().map(|[a, b]| (a[pixel] - b[pixel]).powi(2) / 4.0).sum();
        let scale = mean.max(1e-3).powi(2); // so that dark pixels count, too
        excess.push((shown / SEEDS as f64 - variance) / scale);
        noise.push((means[0] - mean) / variance.sqrt().max(1e-9));
    }
    let z = |values: &[f64]| {
        let (mean, error) = mean_of(values);
        mean / error
    };
    let neighbours: Vec<f64> =
        (0..noise.len()).filter(|i| i % EDGE > 0).map(|i| noise[i] * noise[i - 1]).collect();
    (z(&excess), z(&neighbours))
}

/// Each |z| < 4.5 fails by chance with p = 7e-6.
#[test]
fn halves_show_the_noise_of_their_mean_and_pixels_are_independent() {
    for sampling in [Sampling::Independent, Sampling::Sobol] {
        for scene in ["cornell-box", "arcade"] {
            let (excess, neighbours) = statistics(scene, sampling, 1);
            assert!(excess.abs() < 4.5, "{scene}, {sampling:?}: halves are off by {excess} standard errors");
            assert!(neighbours.abs() < 4.5, "{scene}, {sampling:?}: neighbours correlate, z = {neighbours}");
        }
    }
}

/// The test above can fail: halves that complete each other show more noise than their mean has.
#[test]
fn halves_of_one_sequence_would_show_too_much() {
    let (excess, _) = statistics("cornell-box", Sampling::Sobol, 0);
    assert!(excess > 4.5, "{excess}");
}
