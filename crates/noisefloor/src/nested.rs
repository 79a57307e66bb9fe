//! Whether one picture contains the samples of another.

use crate::descriptor::NoiseMask;
use crate::display::Display;
use crate::evidence::{Plane, Rendering, Samples};
use crate::rgb::{ROUNDING_LUMINANCE, luminance};
use crate::tile::Tile;

/// Edge of the blocks that count as independent observations, in pixels: wider than any pixel filter.
const BLOCK: usize = 16;
/// Standard errors that the two hypotheses must lie apart: the one in the middle between them is then reached
/// by chance once in 740.
const APART: f64 = 6.0;

/// Error of the slope that the curvature of the display adds, which blocks do not scatter by: below this at
/// noise up to a tenth of the radiance (the test has 0.0087 where two standard errors are 0.0105). Ratios of
/// counts above 40 are therefore never decided.
const CURVATURE: f64 = 0.004;

/// Whether two pictures of one view share samples, as far as they show it.
///
/// Let x be the mean of n samples and y that of m > n, both masked, so that little of the picture is left beside the
/// noise. If y contains the samples of x, y has nothing in common with their difference; if it does not, the noise of y
/// is part of the difference: the slope of the regression of y on that difference is 0 or −n/(n + m). It is averaged
/// over blocks, weighted so that textured ones, where y says little about its noise, count less; the scatter of the
/// blocks gives its standard error. `None` if that is too large to tell the slopes apart, as with equal counts, where
/// there is no nesting.
pub(crate) fn shared_samples(
    size: (usize, usize),
    one: Rendering<'_>,
    other: Rendering<'_>,
    display: &Display,
) -> Option<Samples> {
    let (fewer, more) = if one.spp <= other.spp { (one, other) } else { (other, one) };
    let independent_slope = -fewer.spp / (fewer.spp + more.spp);
    let (x, y) = (masked(size, fewer, display), masked(size, more, display));
    let rounding = NoiseMask::default().white_noise_gain() * ROUNDING_LUMINANCE;
    let known = [fewer.rounding, more.rounding].map(|variance| f64::from(rounding * variance));
    let blocks = blocks(&x, &y, known);

    // Slope of the weighted regression, and its standard error from the residuals of the blocks.
    let weighted = |f: &dyn Fn(&Block) -> f64| blocks.iter().map(|b| b.weight * f(b)).sum::<f64>();
    let variance = weighted(&|b| b.variance);
    if variance <= 0.0 || blocks.len() < 8 {
        return None;
    }
    let slope = weighted(&|b| b.covariance) / variance;
    let scatter: f64 = blocks.iter().map(|b| (b.weight * (b.covariance - slope * b.variance)).powi(2)).sum();
    let error = (scatter.sqrt() / variance).hypot(CURVATURE);
    // Also where the error is not a number
    if error.is_nan() || independent_slope.abs() <= APART * error {
        return None;
    }
    let nested = slope > 0.5 * independent_slope;
    Some(if nested { Samples::Nested } else { Samples::Independent })
}

/// Sums over one block.
struct Block {
    /// Of (x − y)·y, less what the rounding of y adds.
    covariance: f64,
    /// Of (x − y)², less what rounding adds.
    variance: f64,
    weight: f64,
}

fn blocks(x: &Plane, y: &Plane, [of_x, of_y]: [f64; 2]) -> Vec<Block> {
    let (rows, columns) = x.size();
    let mut blocks = Vec::new();
    for top in (0..rows).step_by(BLOCK) {
        for left in (0..columns).step_by(BLOCK) {
            let (height, width) = (BLOCK.min(rows - top), BLOCK.min(columns - left));
            let here = Tile { index: 0, x: left, y: top, width, height };
            let (mut covariance, mut variance, mut energy, mut pixels) = (0.0, 0.0, 0.0, 0.0);
            for (x, y) in x.inside(here).zip(y.inside(here)) {
                let (difference, y) = (f64::from(x) - f64::from(y), f64::from(y));
                covariance += difference * y;
                variance += difference * difference;
                energy += y * y;
                pixels += 1.0;
            }
            let variance = variance - pixels * (of_x + of_y);
            // Blocks that rounding fills, or in which nothing differs, say nothing
            if energy > 0.0 && variance > 0.0 {
                let covariance = covariance + pixels * of_y;
                blocks.push(Block { covariance, variance, weight: pixels / energy });
            }
        }
    }
    blocks
}

/// Masked luminance as displayed.
fn masked((width, height): (usize, usize), picture: Rendering<'_>, display: &Display) -> Plane {
    let encoded = picture.pixels.iter().map(|&p| luminance(display.encode(p))).collect();
    NoiseMask::default().apply(&Plane::new((height, width), encoded))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rgb::Rgb;
    use noisefloor_testkit::Noise;

    const EDGE: usize = 128;

    /// Sums of `spp` samples of a picture with texture in one half, and noise of standard deviation 0.5 a
    /// sample.
    fn sums(seed: u64, spp: u32) -> Vec<f32> {
        let mut noise = Noise::new(seed);
        let mut pixel = |i: usize| {
            let (x, y) = (i % EDGE, i / EDGE);
            let texture = if x < EDGE / 2 && (x / 3 + y / 5).is_multiple_of(2) { 0.2 } else { 0.0 };
            spp as f32 * (0.4 + texture) + 0.5 * (spp as f32).sqrt() * noise.normal() as f32
        };
        (0..EDGE * EDGE).map(&mut pixel).collect()
    }

    fn told(one: &[f32], n: f64, other: &[f32], m: f64) -> Option<Samples> {
        let mean = |sums: &[f32], spp: f64| sums.iter().map(|s| [s / spp as f32; 3]).collect::<Vec<Rgb>>();
        let (one, other) = (mean(one, n), mean(other, m));
        let (one, other) =
            [(&one, n), (&other, m)].map(|(pixels, spp)| Rendering { pixels, spp, rounding: 0.0 }).into();
        let told = |a, b| shared_samples((EDGE, EDGE), a, b, &Display::SRGB);
        let forward = told(one, other);
        assert_eq!(forward, told(other, one));
        forward
    }

    #[test]
    fn nested_pictures_are_recognised_at_every_ratio_that_noise_allows() {
        for (seed, m) in [(1, 110u32), (2, 150), (3, 200), (4, 400), (5, 800)] {
            let few = sums(2 * seed, 100);
            // Seeds far apart: neighbouring ones are correlated
            let rest = sums(500 + seed, m - 100);
            let nested: Vec<f32> = few.iter().zip(&rest).map(|(a, b)| a + b).collect();
            assert_eq!(told(&few, 100.0, &nested, f64::from(m)), Some(Samples::Nested), "100 in {m}");
            let independent = sums(1000 + seed, m);
            let apart = told(&few, 100.0, &independent, f64::from(m));
            assert_eq!(apart, Some(Samples::Independent), "100 beside {m}");
        }
    }

    /// Ten thousand times the samples, a hundred times, or no noise at all: the pictures do not show it, and
    /// that is what is said.
    #[test]
    fn what_cannot_be_told_is_not_guessed() {
        let (few, many) = (sums(1, 10), sums(2, 100_000));
        assert_eq!(told(&few, 10.0, &many, 100_000.0), None);
        assert_eq!(told(&few, 10.0, &sums(503, 1000), 1000.0), None);
        let still = vec![40.0; EDGE * EDGE];
        assert_eq!(told(&still, 100.0, &still, 100.0), None);
    }
}
