//! What is wrong with a picture, against a converged one. None of it can be had while rendering; it judges what criteria leave.
//!
//! | metric | takes | nobody sees a difference |
//! |---|---|---|
//! | [`relative_mse`] | linear radiance | |
//! | [`psnr`] | display values | |
//! | [`flip`] | display values, 8 bits | near 0; no published limit |
//! | [`butteraugli()`] | display values | largest below [`BUTTERAUGLI_SAME`] |
//!
//! Pictures are row-major, `width`×`height` pixels.

use crate::image::{Image, ImageError, Map, RESOLUTIONS};
use butteraugli::{ButteraugliParams, Img, RGB};
use noisefloor::{Rgb, srgb_decode};
use nv_flip::FlipImageRgb8;

/// ε of [`relative_mse`], in the unit of its pictures squared.
pub const RELATIVE_MSE_EPSILON: f64 = 0.01;

/// Largest value of [`butteraugli()`] below which two pictures look the same, by its authors' scale.
pub const BUTTERAUGLI_SAME: f64 = 1.0;

/// Smallest edge of a picture that butteraugli takes.
const BUTTERAUGLI_EDGE: usize = 8;

/// Mean over pixels and channels of (I − R)²/(R² + ε), ε = 0.01, of linear radiance (Rousselle, Knaus, Zwicker 2011, §5). Nothing
/// is trimmed: one firefly can make all of it. Expose both pictures alike first, so that the unit of radiance does not matter.
///
/// # Errors
/// [`ImageError`] if the pictures have different numbers of pixels, or none.
pub fn relative_mse(image: &[Rgb], reference: &[Rgb]) -> Result<f64, ImageError> {
    mean_of_channels(image, reference, |i, r| (i - r).powi(2) / (r * r + RELATIVE_MSE_EPSILON))
}

/// Peak signal-to-noise ratio in dB, 10·log₁₀(1/MSE), of display values in [0, 1] over all channels; infinite for equal pictures.
///
/// # Errors
/// [`ImageError`] if the pictures have different numbers of pixels, or none.
pub fn psnr(image: &[Rgb], reference: &[Rgb]) -> Result<f64, ImageError> {
    Ok(-10.0 * mean_of_channels(image, reference, |i, r| (i - r).powi(2))?.log10())
}

fn mean_of_channels(
    image: &[Rgb],
    reference: &[Rgb],
    error: impl Fn(f64, f64) -> f64,
) -> Result<f64, ImageError> {
    if image.len() != reference.len() || image.is_empty() {
        return Err(ImageError::Differ((image.len(), 1), (reference.len(), 1)));
    }
    let channels = image.as_flattened().iter().zip(reference.as_flattened());
    let sum: f64 = channels.map(|(&i, &r)| error(f64::from(i), f64::from(r))).sum();
    Ok(sum / (3 * image.len()) as f64)
}

/// FLIP (Andersson et al. 2020) by NVIDIA's own library: how different two pictures look when one flips between them, in [0, 1]
/// at each pixel. The mean is its authors' single number. `pixels_per_degree` says how finely somebody sees; FLIP's own default is
/// 67, [`crate::VdpViewing::pixels_per_degree`] that of the other metrics here. Display values are rounded to 8 bits, as on a screen.
///
/// # Errors
/// [`ImageError`] if sizes do not fit each other, or the resolution is outside 1…1000.
pub fn flip(
    reference: &[Rgb],
    test: &[Rgb],
    width: usize,
    height: usize,
    pixels_per_degree: f64,
) -> Result<Map, ImageError> {
    if !RESOLUTIONS.contains(&pixels_per_degree) {
        return Err(ImageError::Resolution(pixels_per_degree));
    }
    let image = |pixels| {
        let image = Image::new(width, height, pixels)?;
        let byte = |c: &f32| (c.clamp(0.0, 1.0) * 255.0).round() as u8; // NaN becomes 0
        let bytes: Vec<u8> = image.pixels().as_flattened().iter().map(byte).collect();
        // Edges and area are limited by `Image`, and fit.
        Ok::<_, ImageError>(FlipImageRgb8::with_data(width as u32, height as u32, &bytes))
    };
    let values = nv_flip::flip(image(reference)?, image(test)?, pixels_per_degree as f32).to_vec();
    Ok(Map { width, height, values })
}

/// Butteraugli of libjxl, in its port to Rust: a distance at each pixel, at 80 cd/m². [`Map::max`] is its authors' score, below
/// [`BUTTERAUGLI_SAME`] of which pictures look the same; the 3-norm ([`Map::norm`]) is what they recommend for an average.
///
/// # Errors
/// [`ImageError`] if sizes do not fit each other, or an edge is below 8 pixels.
pub fn butteraugli(reference: &[Rgb], test: &[Rgb], width: usize, height: usize) -> Result<Map, ImageError> {
    let linear = |pixels| {
        let image = Image::new(width, height, pixels)?;
        let decode = |c: f32| srgb_decode(if c.is_nan() { 0.0 } else { c });
        let pixels = image.pixels().iter().map(|&[r, g, b]| RGB::new(decode(r), decode(g), decode(b)));
        Ok::<_, ImageError>(Img::new(pixels.collect::<Vec<_>>(), width, height))
    };
    let (reference, test) = (linear(reference)?, linear(test)?);
    if width.min(height) < BUTTERAUGLI_EDGE {
        return Err(ImageError::Small { metric: "butteraugli", least: BUTTERAUGLI_EDGE, width, height });
    }
    let params = ButteraugliParams::new().with_compute_diffmap(true);
    let result = butteraugli::butteraugli_linear(reference.as_ref(), test.as_ref(), &params);
    let refused = |why: String| ImageError::Refused { metric: "butteraugli", why };
    let map = result.map_err(|e| refused(e.to_string()))?.diffmap.ok_or_else(|| refused("no map".into()))?;
    Ok(Map { width, height, values: map.pixels().collect() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Bell;

    fn grey(values: impl Iterator<Item = u8>) -> Vec<Rgb> {
        values.map(|v| [f32::from(v) / 255.0; 3]).collect()
    }

    #[test]
    fn relative_mse_of_known_pictures() {
        // (0.5 − 0.4)²/(0.4² + 0.01) = 0.01/0.17
        let error = relative_mse(&[[0.5; 3]; 4], &[[0.4; 3]; 4]).unwrap();
        assert!((error - 0.01 / 0.17).abs() < 1e-7, "{error}");
        assert_eq!(relative_mse(&[[1e8; 3]], &[[1e8; 3]]).unwrap(), 0.0);
        assert!(relative_mse(&[[1e30; 3]], &[[0.0; 3]]).unwrap().is_finite());
        assert!(relative_mse(&[[0.0; 3]; 2], &[[0.0; 3]]).is_err() && relative_mse(&[], &[]).is_err());
        // One channel of one of two pixels: a sixth.
        let error = relative_mse(&[[1.0, 0.0, 0.0], [0.0; 3]], &[[0.0; 3]; 2]).unwrap();
        assert!((error - 1.0 / 0.01 / 6.0).abs() < 1e-9, "{error}");
    }

    #[test]
    fn psnr_of_known_pictures() {
        let twenty = psnr(&[[0.6; 3]; 4], &[[0.5; 3]; 4]).unwrap();
        assert!((twenty - 20.0).abs() < 1e-4, "{twenty}");
        assert_eq!(psnr(&[[0.3; 3]], &[[0.3; 3]]).unwrap(), f64::INFINITY);
        // Noise of σ = 0.01 is 40 dB; the mean square of 3·10⁴ values errs by √(2/3·10⁴) = 0.8 %, 0.035 dB: four of those.
        let mut bell = Bell(3);
        let noisy: Vec<Rgb> = (0..10_000).map(|_| [0; 3].map(|_| 0.5 + 0.01 * bell.next() as f32)).collect();
        let forty = psnr(&noisy, &vec![[0.5; 3]; 10_000]).unwrap();
        assert!((forty - 40.0).abs() < 0.14, "{forty}");
    }

    /// Values of flip-evaluator 1.7, NVIDIA's own package for Python: `flip_evaluator.evaluate(ref, test, "LDR", applyMagma=False,
    /// parameters={"ppd": …})` on the same pictures.
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
        assert!(
            flip(&[[0.0; 3]], &[[0.0; 3]], 1, 1, 1e9).unwrap_err().to_string().contains("1 to 1000 pixels")
        );
        let picture = vec![[0.5; 3]; 64];
        assert!(matches!(flip(&picture, &picture, 8, 9, 40.0), Err(ImageError::Pixels { .. })));
        assert!(matches!(flip(&picture, &picture, 8, 8, 0.0), Err(ImageError::Resolution(_))));
        assert!(matches!(flip(&picture, &picture, 8, 8, f64::NAN), Err(ImageError::Resolution(_))));
        assert!(matches!(butteraugli(&picture, &picture[1..], 8, 8), Err(ImageError::Pixels { .. })));
        assert!(matches!(butteraugli(&picture, &picture, 4, 16), Err(ImageError::Small { .. })));
        let odd = vec![[f32::NAN, -1.0, f32::INFINITY]; 64];
        assert!(butteraugli(&picture, &odd, 8, 8).unwrap().values.iter().all(|v| v.is_finite()));
        assert!(flip(&picture, &odd, 8, 8, 40.0).unwrap().values.iter().all(|v| v.is_finite()));
    }
}
