//! Butteraugli of libjxl, in its port to Rust.

use crate::picture::{DifferenceMap, DisplayPixels, MetricError};
use ::butteraugli::{ButteraugliParams, Img, RGB};
use noisefloor::{Rgb, display::srgb_decode};

/// Smallest edge of a picture for butteraugli.
const BUTTERAUGLI_EDGE: usize = 8;

/// Butteraugli of libjxl, in its port to Rust: a distance at each pixel, at 80 cd/m². Its authors' score is
/// [`DifferenceMap::max`]; below 1 pictures look the same. As an average they recommend
/// the 3-norm ([`DifferenceMap::norm`]).
pub fn butteraugli(
    reference: &[Rgb],
    test: &[Rgb],
    width: usize,
    height: usize,
) -> Result<DifferenceMap, MetricError> {
    let linear = |pixels| {
        let image = DisplayPixels::new(width, height, pixels)?;
        let decode = |c: f32| srgb_decode(if c.is_nan() { 0.0 } else { c });
        let pixels = image.pixels().iter().map(|&[r, g, b]| RGB::new(decode(r), decode(g), decode(b)));
        Ok::<_, MetricError>(Img::new(pixels.collect::<Vec<_>>(), width, height))
    };
    let (reference, test) = (linear(reference)?, linear(test)?);
    if width.min(height) < BUTTERAUGLI_EDGE {
        return Err(MetricError::Small { metric: "butteraugli", least: BUTTERAUGLI_EDGE, width, height });
    }
    let params = ButteraugliParams::new().with_compute_diffmap(true);
    let result = ::butteraugli::butteraugli_linear(reference.as_ref(), test.as_ref(), &params);
    let refused = |why: String| MetricError::Refused { metric: "butteraugli", why };
    let map = result.map_err(|e| refused(e.to_string()))?.diffmap.ok_or_else(|| refused("no map".into()))?;
    Ok(DifferenceMap { width, height, values: map.pixels().collect() })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grey(values: impl Iterator<Item = u8>) -> Vec<Rgb> {
        values.map(|v| [f32::from(v) / 255.0; 3]).collect()
    }

    /// Scores of the butteraugli of libjxl in C++, as recorded in the port's `reference_data.rs`.
    #[test]
    fn butteraugli_is_that_of_its_authors() {
        let shifted = grey([138; 32 * 32].into_iter());
        let uniform = butteraugli(&grey([128; 32 * 32].into_iter()), &shifted, 32, 32).unwrap();
        assert!((uniform.max() - 21.285_757).abs() < 0.02, "{}", uniform.max());

        let ramp = |shift: usize| {
            let value = move |i: usize| ((i % 47 + i / 47) * 255 / (47 + 33 - 2) + shift).min(255) as u8;
            grey((0..47 * 33).map(value))
        };
        let gradient = butteraugli(&ramp(0), &ramp(20), 47, 33).unwrap();
        assert!((gradient.max() - 20.760_262).abs() < 0.02, "{}", gradient.max());

        let same = butteraugli(&ramp(0), &ramp(0), 47, 33).unwrap();
        assert!(same.max() == 0.0 && same.norm(3.0) == 0.0);
        assert!(gradient.norm(3.0) < gradient.max() && gradient.norm(3.0) > gradient.mean());
    }

    #[test]
    fn what_does_not_fit_is_an_error() {
        let picture = vec![[0.5; 3]; 64];
        assert!(matches!(butteraugli(&picture, &picture[1..], 8, 8), Err(MetricError::Pixels { .. })));
        assert!(matches!(butteraugli(&picture, &picture, 4, 16), Err(MetricError::Small { .. })));
        let odd = vec![[f32::NAN, -1.0, f32::INFINITY]; 64];
        assert!(butteraugli(&picture, &odd, 8, 8).unwrap().values.iter().all(|v| v.is_finite()));
    }
}
