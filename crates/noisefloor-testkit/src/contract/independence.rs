//! New samples are independent of those before, in the same tile and in others.

use super::probe::Round;
use super::rounding::{LARGEST_Z, ROUNDING};
use noisefloor::{Batch, source::PixelNoise};

/// Compares the noise of batches that should be independent. `whole` is a round of another size, if the
/// source renders.
pub(super) fn check_independence(rounds: &[Round], whole: Option<&Round>, pixels: PixelNoise) {
    if rounds.iter().flatten().any(|batch| batch.spp == 0) {
        return;
    }
    check_batches(rounds, pixels);
    check_tiles(rounds, pixels);
    if pixels == PixelNoise::Independent {
        check_neighbours(rounds);
    }
    // Without noise there is nothing to correlate, but then a batch of another size must be the same too
    if let (true, Some(whole)) = (is_silent(rounds), whole) {
        let noise = whole.iter().zip(&rounds[0]).flat_map(|(a, b)| difference(a, b));
        assert!(noise.into_iter().all(|v| v == 0.0), "every batch has the same samples again");
    }
}

/// The noise of two batches against the noise of two others of the same tile, in each of the three ways to
/// pair four.
fn check_batches(rounds: &[Round], pixels: PixelNoise) {
    for [a, b, c, d] in [[0, 1, 2, 3], [0, 2, 1, 3], [0, 3, 1, 2]] {
        let mut terms = Vec::new();
        for four in rounds.chunks_exact(4) {
            for (x, y) in noise(&four[a], &four[b]).into_iter().zip(noise(&four[c], &four[d])) {
                terms.extend(products(x.into_iter().zip(y), pixels));
            }
        }
        let z = z(&terms);
        assert!(
            z.abs() < LARGEST_Z,
            "successive batches are correlated: z = {z}; are they means of new samples only?"
        );
    }
}

/// The noise of each pixel against that of the next one to the right, and of the next one below, in pairs of which
/// no two have a pixel in common.
fn check_neighbours(rounds: &[Round]) {
    for below in [false, true] {
        let mut terms = Vec::new();
        for two in rounds.chunks_exact(2) {
            for (batch, noise) in two[0].iter().zip(noise(&two[0], &two[1])) {
                let (width, height) = (batch.tile.width, batch.tile.height);
                for (i, x) in noise.iter().enumerate() {
                    let (column, row) = (i % width, i / width);
                    let (place, end, step) = if below { (row, height, width) } else { (column, width, 1) };
                    if place % 2 == 0 && place + 1 < end {
                        terms.push(x * noise[i + step]);
                    }
                }
            }
        }
        let z = z(&terms);
        assert!(
            z.abs() < LARGEST_Z,
            "neighbouring pixels have noise in common: z = {z}; if a pixel filter, \
             a denoiser or splats are meant to, say PixelNoise::Shared"
        );
    }
}

/// The noise of each tile against the noise of the one before it, pixel by pixel from their corners.
fn check_tiles(rounds: &[Round], pixels: PixelNoise) {
    let width = |tile: usize| rounds[0][tile].tile.width;
    let mut terms = Vec::new();
    for four in rounds.chunks_exact(4) {
        let x = noise(&four[0], &four[1]);
        for tile in 1..x.len() {
            let (w, before) = (width(tile), width(tile - 1));
            let shared = x[tile].iter().enumerate().filter(|(i, _)| i % w < before);
            let pairs = shared.filter_map(|(i, &v)| Some((*x[tile - 1].get(i / w * before + i % w)?, v)));
            terms.extend(products(pairs, pixels));
        }
    }
    let z = z(&terms);
    assert!(
        z.abs() < LARGEST_Z,
        "tiles have the same noise: z = {z}; are random numbers numbered from the tile's corner?"
    );
}

fn is_silent(rounds: &[Round]) -> bool {
    rounds.windows(2).all(|two| noise(&two[0], &two[1]).iter().flatten().all(|&v| v == 0.0))
}

/// Noise alone: the differences of two rounds, tile by tile.
fn noise(a: &Round, b: &Round) -> Vec<Vec<f64>> {
    a.iter().zip(b).map(|(a, b)| difference(a, b)).collect()
}

/// Sum of the channels of a − b in each pixel; 0 where that is rounding or not finite.
fn difference(a: &Batch, b: &Batch) -> Vec<f64> {
    let sum = |p: &[f32; 3]| p.iter().map(|&c| f64::from(c)).sum::<f64>();
    let size = |p: &[f32; 3]| p.iter().map(|&c| f64::from(c).abs()).sum::<f64>();
    let noise = |(a, b): (&[f32; 3], &[f32; 3])| {
        let d = sum(a) - sum(b);
        if d.is_finite() && d.abs() > ROUNDING * size(a).max(size(b)) { d } else { 0.0 }
    };
    a.mean.iter().zip(&b.mean).map(noise).collect()
}

/// Products whose signs are independent: those of pixels, or their sum over the tile where pixels share a
/// Markov chain.
fn products(pairs: impl Iterator<Item = (f64, f64)>, pixels: PixelNoise) -> Vec<f64> {
    let products = pairs.map(|(x, y)| x * y);
    if pixels == PixelNoise::Independent { products.collect() } else { vec![products.sum()] }
}

/// Σt/√Σt²; 0 without noise.
fn z(terms: &[f64]) -> f64 {
    let (sum, squares) = terms.iter().fold((0.0, 0.0), |(sum, squares), t| (sum + t, squares + t * t));
    if squares > 0.0 { sum / f64::sqrt(squares) } else { 0.0 }
}
