//! A denoiser of a few lines.

use noisefloor::{Rgb, display::luminance};

/// A bilateral filter (Tomasi & Manduchi 1998) of 7×7 pixels: Gaussian weights by distance, with a standard
/// deviation of two pixels, and by the difference of luminances, with one of `range`. `pixels` are row-major.
/// It blurs texture whose contrast lies below `range`, as poor denoisers do.
///
/// # Panics
/// If the number of pixels is not that of the size.
pub fn bilateral((width, height): (usize, usize), pixels: &[Rgb], range: f32) -> Vec<Rgb> {
    assert_eq!(pixels.len(), width * height, "as many pixels as the size says");
    let around = |at: usize, edge: usize| at.saturating_sub(3)..(at + 4).min(edge);
    let filter = |i: usize| {
        let (x, y) = (i % width, i / width);
        let (mut sum, mut weights) = ([0.0; 3], 0.0);
        for (j, k) in around(y, height).flat_map(|j| around(x, width).map(move |k| (j, k))) {
            let other = pixels[j * width + k];
            let distance = (x.abs_diff(k).pow(2) + y.abs_diff(j).pow(2)) as f32 / (2.0 * 4.0);
            let contrast = (luminance(other) - luminance(pixels[i])) / range;
            let weight = (-distance - 0.5 * contrast * contrast).exp();
            sum.iter_mut().zip(other).for_each(|(sum, value)| *sum += weight * value);
            weights += weight;
        }
        sum.map(|sum| sum / weights)
    };
    (0..pixels.len()).map(filter).collect()
}
