//! FLIP, by NVIDIA's own library.

use crate::picture::{DifferenceMap, DisplayPixels, MetricError, RESOLUTIONS};
use noisefloor::Rgb;
use nv_flip::FlipImageRgb8;

/// FLIP (Andersson et al. 2020) by NVIDIA's own library: how different two pictures look when flipping
/// between them, in [0, 1] at each pixel. Its authors report the mean. FLIP's default of `pixels_per_degree`
/// is 67. Display values are rounded to 8 bits, as on a screen.
pub fn flip(
    reference: &[Rgb],
    test: &[Rgb],
    width: usize,
    height: usize,
    pixels_per_degree: f64,
) -> Result<DifferenceMap, MetricError> {
    if !RESOLUTIONS.contains(&pixels_per_degree) {
        return Err(MetricError::Resolution(pixels_per_degree));
    }
    let image = |pixels| {
        let image = DisplayPixels::new(width, height, pixels)?;
        let byte = |c: &f32| (c.clamp(0.0, 1.0) * 255.0).round() as u8; // NaN becomes 0
        let bytes: Vec<u8> = image.pixels().as_flattened().iter().map(byte).collect();
        // `DisplayPixels` limits the edges: they fit into 32 bits
        Ok::<_, MetricError>(FlipImageRgb8::with_data(width as u32, height as u32, &bytes))
    };
    let values = nv_flip::flip(image(reference)?, image(test)?, pixels_per_degree as f32).to_vec();
    Ok(DifferenceMap { width, height, values })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Values of flip-evaluator 1.7, NVIDIA's own package for Python: `flip_evaluator.evaluate(ref, test,
    /// "LDR", applyMagma=False, parameters={"ppd": …})` on the same pictures.
    #[test]
    fn flip_is_that_of_its_authors() {
        let (width, height) = (48usize, 32usize);
        let (mut reference, mut test) = (Vec::new(), Vec::new());
        for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
            let ramp = [x * 5 % 256, y * 7 % 256, (x * 3 + y * 2) % 256];
            let hash = (x * 2_654_435_761 + y * 40_503) % 65_536 / 256;
            let shift = [hash % 64, hash / 2 % 64, hash * 3 % 64];
            reference.push(ramp.map(|c| c as f32 / 255.0));
            test.push(std::array::from_fn(|c| {
                (ramp[c] as f32 + shift[c] as f32 - 32.0).clamp(0.0, 255.0) / 255.0
            }));
        }
        for (resolution, mean, largest, pixels) in [
            (67.0, 0.126_563_79, 0.452_112_14, [0.096_510_43, 0.095_037_535, 0.338_931_3]),
            (40.0, 0.221_024_26, 0.538_901_45, [0.075_619_11, 0.178_273_72, 0.365_243_85]),
        ] {
            let map = flip(&reference, &test, width, height, resolution).unwrap();
            let got = [0, 16 * width + 24, 31 * width + 47].map(|i| map.values[i]);
            assert!(
                (map.mean() - mean).abs() < 1e-3 && (map.max() - largest).abs() < 1e-3,
                "{} {}",
                map.mean(),
                map.max()
            );
            assert!(got.iter().zip(pixels).all(|(a, b)| (a - b).abs() < 1e-3), "{got:?}");
        }
        let (black, white) = (vec![[0.0; 3]; 256], vec![[1.0; 3]; 256]);
        assert!((flip(&black, &white, 16, 16, 67.0).unwrap().mean() - 0.967_391_9).abs() < 1e-3);
        assert_eq!(flip(&white, &white, 16, 16, 67.0).unwrap().max(), 0.0);
    }

    #[test]
    fn what_does_not_fit_is_an_error() {
        assert!(
            flip(&[[0.0; 3]], &[[0.0; 3]], 1, 1, 1e9).unwrap_err().to_string().contains("1 to 1000 pixels")
        );
        let picture = vec![[0.5; 3]; 64];
        assert!(matches!(flip(&picture, &picture, 8, 9, 40.0), Err(MetricError::Pixels { .. })));
        assert!(matches!(flip(&picture, &picture, 8, 8, 0.0), Err(MetricError::Resolution(_))));
        assert!(matches!(flip(&picture, &picture, 8, 8, f64::NAN), Err(MetricError::Resolution(_))));
        let odd = vec![[f32::NAN, -1.0, f32::INFINITY]; 64];
        assert!(flip(&picture, &odd, 8, 8, 40.0).unwrap().values.iter().all(|v| v.is_finite()));
    }
}
