//! Albedo and normals of a source.

use super::rounding::LARGEST_Z;
use noisefloor::{ProgressiveSource, Repeats, Rgb, SourceInfo, source::FirstHits};

/// Rays a pixel: few, so that edges are noisy.
const SPP: u64 = 4;
/// Most by which rounding makes a mean larger than its terms.
const ROUNDING: f32 = 1e-5;

/// First hits, if there are any: as large as the image, in range, repeated as samples are, and different for
/// every index, independently, unless they have no noise.
pub(super) fn check_first_hits(source: &mut impl ProgressiveSource, info: &SourceInfo) {
    let Some(first) = render(source, info, 0) else { return };
    let mut more =
        [1, 2, 3, 0].map(|index| render(source, info, index).expect("the source has first hits no longer"));
    if info.repeats == Repeats::Samples {
        assert!(more[3] == first, "the same first hits differ the second time");
    }
    more[3] = first;
    if more.iter().all(|hits| *hits == more[0]) {
        return;
    }
    for [a, b, c, d] in [[0, 1, 2, 3], [0, 2, 1, 3], [0, 3, 1, 2]] {
        let pairs = noise(&more[a], &more[b]).into_iter().zip(noise(&more[c], &more[d]));
        let (sum, squares) = pairs.fold((0.0, 0.0), |(sum, squares), (x, y)| {
            let term = x * y;
            (sum + term, squares + term * term)
        });
        let z = if squares > 0.0 { sum / f64::sqrt(squares) } else { 0.0 };
        assert!(z.abs() < LARGEST_Z, "first hits of different indices are correlated: z = {z}");
    }
}

fn render(source: &mut impl ProgressiveSource, info: &SourceInfo, index: u64) -> Option<FirstHits> {
    let hits = source.first_hits(index, SPP);
    let hits = hits.unwrap_or_else(|e| panic!("first hits failed: {e} ({e:?})"))?;
    let size = (hits.width, hits.height);
    assert_eq!(size, (info.width, info.height), "first hits do not have the image's size");
    let pixels = info.width * info.height;
    let counts = [hits.albedo.len(), hits.normal.len()];
    assert_eq!(counts, [pixels; 2], "wrong number of pixels in first hits");
    let within = |c: f32| (-ROUNDING..=1.0 + ROUNDING).contains(&c);
    assert!(hits.albedo.iter().flatten().all(|&c| within(c)), "albedo is outside of 0 to 1");
    let length = |n: &Rgb| n.iter().map(|c| c * c).sum::<f32>().sqrt();
    assert!(hits.normal.iter().all(|n| within(length(n))), "a normal is longer than 1");
    Some(hits)
}

/// Noise alone: the difference of two pictures, summed over the numbers of each pixel.
fn noise(a: &FirstHits, b: &FirstHits) -> Vec<f64> {
    let sum = |hits: &FirstHits, i: usize| -> f64 {
        hits.albedo[i].iter().chain(&hits.normal[i]).map(|&c| f64::from(c)).sum()
    };
    (0..a.albedo.len()).map(|i| sum(a, i) - sum(b, i)).collect()
}
