//! relMSE and PSNR.

use crate::picture::MetricError;
use noisefloor::Rgb;

/// ε of [`relative_mse`], in the squared unit of its pictures.
pub(crate) const RELATIVE_MSE_EPSILON: f64 = 0.01;

/// Mean over pixels and channels of (I − R)²/(R² + ε), ε = 0.01, of linear radiance (Rousselle, Knaus,
/// Zwicker 2011, §5). Nothing is trimmed: a single firefly can dominate. Expose both pictures alike first, so
/// that the unit of radiance does not matter.
pub fn relative_mse(image: &[Rgb], reference: &[Rgb]) -> Result<f64, MetricError> {
    mean_of_channels(image, reference, |i, r| (i - r).powi(2) / (r * r + RELATIVE_MSE_EPSILON))
}

/// Peak signal-to-noise ratio in dB, 10·log₁₀(1/MSE), of display values in [0, 1] over all channels; infinite
/// for equal pictures.
pub fn psnr(image: &[Rgb], reference: &[Rgb]) -> Result<f64, MetricError> {
    Ok(-10.0 * mean_of_channels(image, reference, |i, r| (i - r).powi(2))?.log10())
}

fn mean_of_channels(
    image: &[Rgb],
    reference: &[Rgb],
    error: impl Fn(f64, f64) -> f64,
) -> Result<f64, MetricError> {
    if image.len() != reference.len() || image.is_empty() {
        return Err(MetricError::Differ((image.len(), 1), (reference.len(), 1)));
    }
    let channels = image.as_flattened().iter().zip(reference.as_flattened());
    let sum: f64 = channels.map(|(&i, &r)| error(f64::from(i), f64::from(r))).sum();
    Ok(sum / (3 * image.len()) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use noisefloor_testkit::Noise;

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
        // Noise of σ = 0.01 is 40 dB; the mean square of 3·10⁴ values errs by √(2/3·10⁴) = 0.8 %, 0.035 dB:
        // four of those.
        let mut noise = Noise::new(3);
        let noisy: Vec<Rgb> =
            (0..10_000).map(|_| [0; 3].map(|_| 0.5 + 0.01 * noise.normal() as f32)).collect();
        let forty = psnr(&noisy, &vec![[0.5; 3]; 10_000]).unwrap();
        assert!((forty - 40.0).abs() < 0.14, "{forty}");
    }
}
